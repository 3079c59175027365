"""Equations of orbits with a free parameter: their derivatives are those of differences, directions along the
branch and determinants those of linear algebra, and points are solutions across a direction."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow import fixed
from nonsmooth.flow.engine import find_compiler
from nonsmooth.model.derivatives.variational import guarded_field
from nonsmooth.orbit.branches import conditions
from nonsmooth.orbit.branches.orbit_branches import OrbitCurve
from tests.orbit.periodic_cases import GUESSES, forced_friction

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


def guessed(name):
    """The walker's reset and guard have parameters, and so has the period of the friction's forcing."""
    system, start, given = GUESSES[name]
    names = {"walker": system.parameter_names, "friction": ("f",), "relay": ("w",)}[name]
    return ns.periodic_orbit(system, start, **given), names


def whole_friction():
    """Both halves."""
    system = forced_friction()
    run = ns.simulate(system, [1.5, 0.0], 100.0, parameters={"f": 0.6})
    return ns.periodic_orbit(system, run), ("f",)


def bounces():
    """A ball on a table that vibrates; its restitution is a parameter of the reset.

    It rises with the speed pi/2 once in a period pi where the table has 2 a cos(2 t) = pi/2 (1 - r)/(1 + r).
    """
    y, v, t, r, a = (ca.SX.sym(name) for name in ("y", "v", "t", "r", "a"))
    gap, speed = y - a * ca.sin(2 * t), 2 * a * ca.cos(2 * t)
    hit = ns.Reset(gap, [y, speed - r * (v - speed)], direction=-1, name="hit")
    given = {"field": [v, -1.0], "time": t, "resets": hit, "parameters": {r: 0.6, a: 0.25}}
    system, phase = ns.FilippovSystem([y, v], **given), np.arccos(np.pi / 4)
    start = [0.25 * np.sin(phase), np.pi / 2]
    itinerary = [("", "hit")]
    orbit = ns.periodic_orbit(system, start, itinerary=itinerary, t_start=phase / 2)
    return orbit, ("a", "r")


OTHERS = {"bounces": bounces, "whole": whole_friction}


def curve_of(orbit, name):
    p, free = orbit.parameter_vector, (orbit.system.parameter_names.index(name),)
    curve = OrbitCurve(orbit.problem, p, free, np.ones(1), orbit.unknowns, 1e3)
    return curve, np.append(orbit.unknowns, p[free[0]])


@pytest.fixture(params=[*GUESSES, *OTHERS])
def orbit_and_names(request):
    return OTHERS[request.param]() if request.param in OTHERS else guessed(request.param)


def test_derivatives_of_the_equations_are_those_of_differences(orbit_and_names):
    orbit, names = orbit_and_names
    for name in names:
        curve, u = curve_of(orbit, name)
        problem, matrix = orbit.problem, curve.equations(u)[1]
        for k in (0, problem.size - 1, problem.size):
            step = 1e-5 * max(abs(u[k]), 0.1) * np.eye(u.size)[k]
            ahead, back = (curve.equations(u + s * step)[0] for s in (1, -1))
            slope = (ahead - back) / (2 * step[k])
            assert np.abs(slope - matrix[:, k]).max() < 1e-6 * max(1.0, np.abs(matrix[:, k]).max())


def test_a_corrected_point_solves_the_equations_across_the_direction(orbit_and_names):
    orbit, names = orbit_and_names
    curve, u = curve_of(orbit, names[-1])
    jacobian = curve.equations(u)[1] * curve.scale
    tangent = np.linalg.svd(jacobian)[2][-1]
    guess = u + 1e-3 * tangent * curve.scale + 1e-5 * curve.scale * np.cos(np.arange(u.size))
    found = curve.correct(guess, tangent)
    at = curve.evaluation(found)
    assert abs(tangent @ ((found - guess) / curve.scale)) < 1e-14
    assert np.abs(at.residual).max() < 1e-12 * np.abs(at.whole).max()
    bordered = np.vstack([at.whole * curve.scale, tangent])
    step = np.linalg.solve(bordered, np.append(at.residual, 0.0))
    assert np.abs(step).max() < 1e-13


def test_a_branch_by_a_parameter_of_a_reset_ends_at_its_fold():
    """Where the table is not faster than (1 - r)/(1 + r) pi/2."""
    branch = ns.continue_orbit(bounces()[0], "r", bounds=(0.5, 0.7), step=0.1)
    ratio = 1 / np.pi
    assert [event.kind for event in branch.events] == ["fold"]
    assert branch.events[0].parameter == pytest.approx((1 - ratio) / (1 + ratio), rel=1e-12)


def test_a_guess_without_a_solution_has_none():
    """The walker's gait ends in a fold below the slope 0."""
    orbit, _ = guessed("walker")
    curve, u = curve_of(orbit, orbit.system.parameter_names[0])
    guess, axis = u.copy(), np.eye(u.size)[-1]
    guess[-1] = -0.5
    assert curve.correct(guess, axis) is None


def test_directions_and_determinants_are_those_of_linear_algebra(orbit_and_names):
    orbit, names = orbit_and_names
    curve, u = curve_of(orbit, names[-1])
    jacobian = curve.equations(u)[1] * curve.scale
    before = np.linalg.svd(jacobian)[2][-1] + 0.1 * np.cos(np.arange(u.size))
    direction, determinant = curve.along(jacobian, before)
    assert np.abs(jacobian @ direction).max() < 1e-12 and direction @ before > 0
    assert abs(np.linalg.norm(direction) - 1) < 1e-14
    sign, size = np.linalg.slogdet(np.vstack([jacobian, before]))
    length = 1 / (direction @ before)
    assert np.sign(determinant) == sign
    if u.size <= 24:
        assert determinant == pytest.approx(sign * np.exp(size) * length, rel=1e-9)


def test_tests_by_multipliers_are_products_of_them(orbit_and_names):
    """prod (1 + m) and prod (m_i m_j - 1), each by its size, over the legs' map and a 0 across the flow."""
    orbit, _ = orbit_and_names
    m = np.append(orbit.half_multipliers, 0.0)
    found = conditions.smooth_tests(orbit.problem, orbit.evaluation, orbit.parameter_vector)
    flip = np.prod((1 + m) / (1 + np.abs(m))).real
    pairs = np.array([m[i] * m[j] for i in range(m.size) for j in range(i)])
    torus = np.prod((pairs - 1) / (1 + np.abs(pairs))).real
    name = "pitchfork" if orbit.symmetric else "period doubling"
    assert found[name] == pytest.approx(flip, rel=1e-9, abs=1e-10)
    assert found["Neimark-Sacker"] == pytest.approx(torus, rel=1e-9, abs=1e-10)


def test_guards_at_the_ends_of_legs_are_those_of_the_states_there():
    orbit, _ = whole_friction()
    problem, at, p = orbit.problem, orbit.evaluation, orbit.parameter_vector
    fields = [guarded_field(orbit.system, leg.mode) for leg in problem.legs]
    _, _, values = fixed.LegsWatch(fields)(list(at.starts), p, at.durations, 1e-6)
    for leg, value, flow in zip(problem.legs, values, at.by_leg, strict=True):
        expected = conditions.guard_values(orbit.system, leg.mode).copied(flow.end, p)[1][:, 0]
        np.testing.assert_allclose(value, expected, rtol=1e-12, atol=1e-13)
