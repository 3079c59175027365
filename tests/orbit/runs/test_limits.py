"""Derivatives through events that accumulate: closed forms, differences of runs, and the transpose."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.orbit.periodic_cases import cases_of

CASES = cases_of("cases/chatter.json")
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
            required = key.split("/d(")[1].split(")")[0].replace("0", "")
            required = names if required == "..." else required.split(",")
            columns = [names.index(name) for name in required]
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
