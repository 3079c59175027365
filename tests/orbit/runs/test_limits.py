"""Derivatives through events that accumulate: closed forms, differences of runs, and the transpose."""

from __future__ import annotations

import json
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

PATH = Path(__file__).parents[2] / "cases" / "chatter.json"
CASES = {case["id"]: case for case in json.loads(PATH.read_text())}
y, v, z, u, s, t, a, b, g, r, A, w, mu, k, l1, l2, R = (
    ca.SX.sym(name) for name in "y v z u s t a b g r A w mu k l1 l2 R".split()
)


def ball(gap=y, **more) -> ns.FilippovSystem:
    hit = ns.Impact(gap, restitution=r)
    return ns.FilippovSystem([y, v], field=[v, -g], impacts=hit, **more)


CH1 = ball(parameters={r: 0.6, g: 2.0})
CH2 = ns.FilippovSystem(
    [s, u, y, v],
    field=[u, -mu * l1 * R, v, R - g],
    surface=u,
    multipliers=l1,
    impacts=ns.Impact(y, restitution=r, reaction=R),
    parameters={r: 0.6, g: 2.0, mu: 0.1},
)
TABLE = ball(y - A * ca.sin(w * t), time=t, parameters={r: 0.5, g: 10.0, A: 0.5, w: 5.0})
TWISTING = ns.FilippovSystem(
    [y, v, z],
    surfaces=[y, v],
    multipliers=[l1, l2],
    field=[v, -a * l1 - b * l2, y - z],
    parameters={a: 2.0, b: 1.0},
)


def numbers(case: str, key: str) -> np.ndarray:
    return np.array(CASES[case]["values"][key], float)


def at_limit(run: ns.Trajectory) -> int:
    return next(k for k, e in enumerate(run.events) if e.kind in ("contact", "rest"))


@pytest.mark.parametrize("tol", [1e-6, 1e-10, 1e-13])
def test_limits_have_the_derivatives_of_closed_forms(tol: float) -> None:
    for case, system in (("CH1", CH1), ("CH2", CH2), ("CH7", TWISTING)):
        given = CASES[case]
        run = ns.simulate(system, given["start"], given["t_end"], tol=tol)
        found = ns.sensitivity(run)
        i = at_limit(run)
        times = np.append(found.dt_dx0[i], found.dt_dp[i])
        ends = np.hstack([found.dx_dx0, found.dx_dp])
        names = [*given["system"]["states"].split(), *system.parameter_names]
        for key, expected in given["values"].items():
            if not key.startswith("d"):
                continue
            wanted = key.split("/d(")[1].split(")")[0].replace("0", "")
            wanted = names if wanted == "..." else wanted.split(",")
            columns = [names.index(name) for name in wanted]
            if key.startswith("dx_end"):
                assert not found.dx_dx0.any()
                continue
            row = times if key.startswith("dt") else ends[names.index(key[1])]
            exact, near = np.array(expected, float), 1e-12 + 10 * tol**2
            assert row[columns] == pytest.approx(exact, rel=1e-12, abs=near)


@pytest.mark.parametrize("e", [0.99, 0.9, 0.3, 0.01, 1e-3, 1e-4, 1e-5])
def test_any_restitution_has_the_derivatives_of_its_limit(e: float) -> None:
    """Small ones end with an impact whose speed is lost in rounding."""
    run = ns.simulate(CH1, [1.0, 0.5], 5000.0, parameters={"r": e})
    assert set(run.events.column("name").tolist()) == {"impact", "REACHED_END"}
    found, speed = ns.sensitivity(run), 4.25**0.5
    exact = [(1 + e) / (1 - e) / speed, speed / (1 - e) ** 2]
    assert [found.dt_dx0[-1, 0], found.dt_dp[-1, 0]] == pytest.approx(exact, rel=2e-11)


def rocking() -> ns.FilippovSystem:
    """A block that rocks on two edges."""
    back = ns.Reset(y, [y, r * v, z], 0)
    fields = [[v, y - a, y], [v, y + a, y]]
    return ns.FilippovSystem(
        [y, v, z],
        surface=y,
        above=fields[0],
        below=fields[1],
        resets=back,
        parameters={r: 0.7, a: 0.3},
    )


def tanks() -> ns.FilippovSystem:
    """One inflow that goes to the tank that is empty: no motion follows."""
    switches = [ns.Reset(y, [y, v, -1], -1, name="one"), ns.Reset(v, [y, v, 1], -1, name="two")]
    fields = [[-a, b, 0], [b, -k, 0]]
    return ns.FilippovSystem(
        [y, v, z], surface=z, above=fields[0], below=fields[1], resets=switches,
        parameters={a: 0.5, b: 0.2, k: 0.4},
    )  # fmt: skip


def masses() -> ns.FilippovSystem:
    """A ball on a mass that a spring holds."""
    hit = ns.Impact(y - s, restitution=r + 0.1 * ca.sin(u), reaction=R)
    field = [u, -k * s - 0.1 * u - R / 3, v, R - g]
    return ns.FilippovSystem(
        [s, u, y, v], field=field, impacts=hit, parameters={k: 0.5, r: 0.5, g: 1.0}
    )


def puck() -> ns.FilippovSystem:
    """A puck that bounces and slides on."""
    return ns.FilippovSystem(
        [y, v, s, u],
        field=[v, -g, -0.1 * l1, -0.1 * l2],
        surfaces=[ca.vertcat(s, u)],
        multipliers=[ca.vertcat(l1, l2)],
        impacts=ns.Impact(y, r),
        parameters={g: 1.0, r: 0.5},
    )


def varying() -> ns.FilippovSystem:
    field = [v, -(a + 0.2 * z) * l1 - (b + 0.1 * ca.sin(z)) * l2 - 0.1 * y, y + 0.3 - z]
    return ns.FilippovSystem(
        [y, v, z], surfaces=[y, v], multipliers=[l1, l2], field=field, parameters={a: 2.0, b: 1.0}
    )


#: Systems, starts and ends: rest, a release after rest and a second chatter, rotation, no motion beyond, sets.
RUNS = {
    "table": (TABLE, [0.41, 1.5], 2.3, 0.18545904360032244649, "o c o c"),
    "masses": (masses(), [0.0, 0.1, 1.0, 0.2], 9.0, 0.0, "o c"),
    "rocking": (rocking(), [0.2, 0.0, 0.1], 20.0, 0.0, None),
    "tanks": (tanks(), [1.0, 0.9, 1.0], 60.0, 0.0, None),
    "puck": (puck(), [0.1, 0.0, 3.0, 4.0], 3.0, 0.0, "*o *c"),
    "twisting": (varying(), [1.0, 0.2, 0.3], 9.0, 0.0, None),
    "slow": (ball(parameters={r: 0.92, g: 2.0}), [1.0, 0.5], 40.0, 0.0, "o c"),
}


@pytest.mark.parametrize("name", RUNS)
def test_limits_have_the_differences_of_runs(name: str) -> None:
    system, start, t_end, t_start, itinerary = RUNS[name]
    names, n = system.parameter_names, len(start)
    at = np.append(start, system.parameter_vector(None))
    moving = 2 if name == "tanks" else n  # the third state says which tank is filled

    def end(q: np.ndarray) -> np.ndarray:
        given = dict(zip(names, q[n:], strict=True))
        run = ns.simulate(system, q[:n], t_end, t_start=t_start, parameters=given, tol=1e-13)
        return run.x[-1, :moving]

    def slope(i: int, h: float = 1e-3) -> np.ndarray:
        step = np.eye(len(at))[i]
        one, two = (
            (end(at + q * step) - end(at - q * step)) / (2 * q) for q in (h * 0.5, h * 0.25)
        )
        return (4 * two - one) / 3

    run = ns.simulate(system, start, t_end, t_start=t_start, tol=1e-12)
    assert itinerary is None or run.itinerary == itinerary
    found = ns.sensitivity(run)
    exact = np.hstack([found.dx_dx0, found.dx_dp])
    differences = np.column_stack([slope(i) for i in range(len(at))])
    assert np.abs(exact[:moving] - differences).max() < 3e-8 * max(1.0, np.abs(exact).max())
    row = np.cos(np.arange(n))
    back = np.concatenate(ns.vjp(run, row))
    assert np.abs(back - row @ exact).max() < 1e-11 * max(1.0, np.abs(exact).max())


def test_a_limit_without_derivatives_raises() -> None:
    """A reset leaves a body pressed against its zero; of too few impacts no limit follows."""
    pressed = ns.FilippovSystem([y, v], field=[v, -1], resets=ns.Reset(y, [y, 0], -1))
    run = ns.simulate(pressed, [1.0, 0.0], 3.0)
    assert run.status is ns.Status.ACCUMULATION
    with pytest.raises(ns.DegenerateError, match="accumulate"):
        ns.sensitivity(run)
    few = ns.simulate(CH1, [1.0, 0.5], 8.0, parameters={"r": 1e-9})
    with pytest.raises(ns.DegenerateError, match="smaller tol"):
        ns.sensitivity(few)
