"""Rates of bounces in 3-D beside bounces in the plane, on one thread."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

import bounce
import nonsmooth as ns

from .. import library
from ..problems import D1, D2, ETA, KAPPA, MU, T_MAX, Array, G, landings
from ..timing import alternate

NAME = "friction in the plane"
TOLERANCE = 1e-9
TURF = bounce.KelvinVoigt(mu=MU, d1=D1, d2=D2, eta=ETA, G=G, load="net")
PLANE = "nonlinear, in the plane"

#: Parts of the rate of the nonlinear bounce in the plane.
TARGETS = {
    "linear bounce in 3-D: part of the nonlinear planar rate": (0.25, "at least"),
    "nonlinear bounce in 3-D: part of the nonlinear planar rate": (0.25, "at least"),
}


def system(name: str) -> ns.FilippovSystem:
    """Return the ``linear`` or ``nonlinear`` bounce of ``problems`` with two directions along
    the ground."""
    # States X, X', Z, Z', Y, Y' and the two components of slip.
    x = [ca.SX.sym(s) for s in ("X", "V", "Z", "U", "Y", "W", "h1", "h2")]
    lam, position, speed = ca.SX.sym("lam", 2), ca.vertcat(x[0], x[2]), ca.vertcat(x[1], x[3])
    y, w = x[4], x[5]
    if name == "linear":
        load = -2 * D2 * w - y - G
        along = -2 * D1 * ETA * speed - ETA**2 * position
    else:
        load = -(2 * D2 * (1 - y) * w) - (1 + 2 * y**2) * y - G
        along = -(2 * D1 * ETA * (1 + ca.sumsqr(speed)) * (1 - y) * speed)
        along -= ETA**2 * (1 - y) * position
    friction = -MU * load * lam
    force, slip = along + friction, along + KAPPA * friction
    return ns.FilippovSystem(
        x,
        field=[x[1], force[0], x[3], force[1], w, load, slip[0], slip[1]],
        surfaces=[ca.vertcat(x[6], x[7])],
        multipliers=[lam],
        stops=[ns.Stop(load, -1, "lift-off")],
    )


def starts(count: int) -> Array:
    """Landings (count, 8) with velocities and spins along the ground in [-1, 1]."""
    v, w = np.random.default_rng(0).uniform(-1, 1, (2, count, 2))
    x = np.zeros((count, 8))
    x[:, [1, 3]], x[:, 5], x[:, 6:] = v, -1.0, v + w
    return x


def errors(name: str, count: int = 200) -> float:
    """Largest error of some ends, by a tolerance a thousand times smaller."""
    one, fine = (
        ns.ensemble(system(name), starts(count), T_MAX, tol=tol)
        for tol in (TOLERANCE, TOLERANCE / 1000)
    )
    if not np.array_equal(one.itinerary, fine.itinerary):
        raise AssertionError("itineraries in 3-D differ from those at a tolerance a thousandth")
    return float(np.abs(one.x - fine.x).max())


def run(quick: bool) -> dict[str, Any]:
    """Rates in 3-D and in the plane in turns, processor time; errors in 3-D."""
    count, turns = (500, 2) if quick else (20_000, 9)
    work = ns.Work(threads=1, progress=False)
    x, many = starts(count), 5 * count
    rng = np.random.default_rng(0)
    flat = landings(rng.uniform(-1, 1, many), rng.uniform(-1, 1, many))
    systems = {name: system(name) for name in ("linear", "nonlinear")}
    solve = library.make("nonlinear", TOLERANCE)
    options: dict[str, Any] = dict(tol=TOLERANCE, work=work)
    timings = alternate(
        {
            "linear, in 3-D": lambda: ns.ensemble(systems["linear"], x, T_MAX, **options),
            "linear, in 3-D, lift_off": lambda: bounce.lift_off(
                TURF.in_3d(), x[:, [1, 3]], -1.0, x[:, 6:] - x[:, [1, 3]], **options
            ),
            "nonlinear, in 3-D": lambda: ns.ensemble(systems["nonlinear"], x, T_MAX, **options),
            PLANE: lambda: solve(flat),
        },
        turns,
    )
    rates = {
        name: {
            "rate": (many if name == PLANE else count) / t.low,
            "median": (many if name == PLANE else count) / t.median,
        }
        for name, t in timings.items()
    }
    return {"rates": rates, "errors": {name: errors(name) for name in systems}}


def figures(results: dict[str, Any]) -> dict[str, float]:
    """Numbers to compare with TARGETS, if this section was run."""
    if NAME not in results:
        return {}
    rates = {name: r["rate"] for name, r in results[NAME]["rates"].items()}
    return {
        f"{name} bounce in 3-D: part of the nonlinear planar rate": rates[f"{name}, in 3-D"]
        / rates[PLANE]
        for name in ("linear", "nonlinear")
    }


def markdown(section: dict[str, Any], table: Any) -> str:
    """The rates as a table, and the errors."""
    whole = section["rates"][PLANE]["rate"]
    rows = [
        [name, f"{r['rate']:,.0f}", f"{r['median']:,.0f}", f"{r['rate'] / whole:.2f}"]
        for name, r in section["rates"].items()
    ]
    worst = ", ".join(f"{name} {error:.1e}" for name, error in section["errors"].items())
    head = ["bounces, one thread", "a second, fastest turn", "median", "part of the last"]
    return f"{table(head, rows)}\n\nLargest errors of 200 in 3-D: {worst}."
