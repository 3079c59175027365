"""Periodic orbits with complete chatter: a ball on a shaken table in closed form, and one on a mass that moves."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.orbit.runs.test_limits import CASES, TABLE

y, v, s, u, t, r, F, k, R = (ca.SX.sym(name) for name in "y v s u t r F k R".split())
#: A ball on a mass that a spring and a force move: what a limit of impacts does not lose continues.
MASS = ns.FilippovSystem(
    [s, u, y, v],
    field=[u, -k * s - 0.3 * u + F * ca.cos(2 * t) - 0.2 * R, v, R - 1],
    impacts=ns.Impact(y - s, restitution=r, reaction=R),
    time=t,
    parameters={k: 1.0, F: 1.6, r: 0.4},
)


def test_a_ball_on_a_table_has_the_orbit_of_the_closed_form() -> None:
    values = CASES["CH5"]["values"]
    run = ns.simulate(TABLE, [0.45, 1.5], 6.0, t_start=0.2, tol=1e-13)
    orbit = ns.periodic_orbit(TABLE, run)
    assert orbit.itinerary == "c o o..." and orbit.stability == "superstable"
    assert orbit.period == pytest.approx(float(values["period"]), abs=1e-14)
    assert orbit.multipliers.tolist() == [0.0, 0.0]
    rest, launch = orbit.legs[:2]
    exact = [float(values[name]) for name in ("launch", "y_launch", "v_launch")]
    found = [launch.t % orbit.period, *launch.start]
    assert found == pytest.approx(exact, abs=1e-13)
    assert rest.t % orbit.period == pytest.approx(float(values["t_inf"]), abs=1e-12)
    slopes = {name: orbit.derivative(name) for name in "rgAw"}
    ends = [slopes[name].durations for name in "rgAw"]
    of_launch = dict(zip("gAw", np.array(values["dlaunch/d(g,A,w)"], float), strict=True))
    of_limit = np.array(values["dt_inf/d(r,g,A,w)"], float)
    for name, wait, limit in zip("rgAw", [-d[0] for d in ends], of_limit, strict=True):
        # the wait on the table ends at the launch one period later
        period = -orbit.period / 5.0 if name == "w" else 0.0
        assert wait == pytest.approx(limit - of_launch.get(name, 0.0) - period, abs=1e-10)


def test_derivatives_and_multipliers_are_those_of_runs() -> None:
    orbit = ns.periodic_orbit(MASS, ns.simulate(MASS, [0.0, 0.0, 1.0, 0.0], 80.0, tol=1e-12))
    assert "..." in orbit.itinerary and not orbit.is_virtual
    begin = orbit.legs[0]
    middle, span = begin.t + 0.5 * begin.duration, orbit.period
    x = orbit.trajectory(middle)

    def after(x: np.ndarray, **given: float) -> np.ndarray:
        run = ns.simulate(MASS, x, middle + span, t_start=middle, tol=1e-13, parameters=given)
        return run.x[-1]

    assert np.abs(after(x) - x).max() < 1e-10
    one = ns.simulate(MASS, x, middle + span, t_start=middle, tol=1e-12)
    matrix = ns.sensitivity(one).dx_dx0
    values = np.linalg.eigvals(matrix)
    values = values[np.argsort(-np.abs(values))]
    assert np.abs(np.abs(values[:2]) - np.abs(orbit.multipliers[:2])).max() < 1e-10
    assert orbit.multipliers[2:].tolist() == [0.0, 0.0]
    h = 2e-5
    near = [ns.periodic_orbit(MASS, orbit, parameters={"r": 0.4 + way}).start for way in (-h, h)]
    assert orbit.derivative("r").start == pytest.approx((near[1] - near[0]) / (2 * h), abs=1e-7)


#: Values of parameters at which impacts no longer accumulate before the release: bisection of exact bounces, 40 digits.
ENDS = {"r": (0.76, 0.7757628161871), "A": (0.63, 0.6389395324781), "w": (5.6, 5.652165657861)}


@pytest.mark.slow
@pytest.mark.parametrize("name", ENDS)
def test_a_branch_ends_where_chatter_is_complete_no_longer(name: str) -> None:
    near, end = ENDS[name]
    given = {"parameters": {name: near}, "tol": 1e-12}
    run = ns.simulate(TABLE, [0.9, 0.0], 9.0, t_start=0.2, **given)
    orbit = ns.periodic_orbit(TABLE, run)
    branch = ns.continue_orbit(orbit, name, bounds=(near, 1.05 * end), step=0.2)
    (event,) = branch.events
    assert event.kind == "end of complete chatter"
    assert event.parameter == pytest.approx(end, rel=2e-7)
    assert all(z.stability == "superstable" for z in branch.solutions)


@pytest.mark.parametrize("start", [0.02, 1e-3])
def test_a_branch_ends_where_the_first_impact_closes_the_contact(start: float) -> None:
    given = {"parameters": {"r": start}, "tol": 1e-12}
    orbit = ns.periodic_orbit(TABLE, ns.simulate(TABLE, [0.9, 0.0], 9.0, t_start=0.2, **given))
    branch = ns.continue_orbit(orbit, "r", bounds=(0.0, 0.03))
    assert [event.kind for event in branch.events] == ["plastic impact"]
    assert abs(branch.events[0].parameter) < 1e-7
    assert branch.ends == (ns.orbit.BranchEnd.EVENT, ns.orbit.BranchEnd.REACHED_BOUND)
