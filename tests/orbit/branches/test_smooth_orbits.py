"""Periodic orbits of smooth systems, without any event, bifurcate where closed forms and the literature
say, and their branches are switched there."""

import casadi as ca
import numpy as np
import pytest
from scipy.special import ellipk

import nonsmooth as ns
from tests.orbit.periodic_cases import kinds, symbols


def langford(**more):
    """Rotations with amplitude r: z = b, r^2 = (0.6 + a b - b^3/3)/(1 + e b) (Langford 1979)."""
    x, y, z, a, b, e = symbols("x y z a b e")
    height = 0.6 + a * z - z**3 / 3 - (x * x + y * y) * (1 + e * z)
    return ns.FilippovSystem(
        [x, y, z],
        field=[(z - b) * x - 3 * y, 3 * x + (z - b) * y, height],
        parameters={a: 0.3, b: 0.7, e: 0.25},
    )


@pytest.fixture(scope="module")
def rotations():
    system = langford()
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.5, 0.0, 0.7], 200.0))
    return ns.continue_orbit(orbit, "a", bounds=(-1.0, 1.5))


def test_a_torus_is_born_where_the_trace_vanishes(rotations):
    # of (r, z) about the orbit: trace a - b^2 - e r^2, determinant 2 r^2 (1 + e b)
    b, e = 0.7, 0.25
    a = (b * b + e * (0.6 - b**3 / 3) / (1 + e * b)) / (1 - e * b / (1 + e * b))
    (event,) = [found for found in rotations.events if found.kind == "Neimark-Sacker"]
    assert abs(event.parameter - a) < 1e-12
    r = np.sqrt((0.6 + a * b - b**3 / 3) / (1 + e * b))
    turn = np.sqrt(2 * r * r * (1 + e * b)) * 2 * np.pi / 3
    assert abs(event.coefficients["angle"] - turn) < 1e-9


def test_a_family_ends_where_it_shrinks_to_a_hopf_point(rotations):
    first = rotations.events[0]
    assert first.kind == "Hopf" and rotations.ends[0] is ns.orbit.BranchEnd.EVENT
    assert abs(first.parameter + (0.6 - 0.7**3 / 3) / 0.7) < 1e-12
    assert abs(first.coefficients["frequency"] - 3) < 1e-12
    with pytest.raises(ns.DefinitionError, match=r"event.*equilibrium"):
        ns.continue_bifurcation(first, ("a", "b"), bounds=[(-1, 1), (0, 1)])


def test_tori_in_two_parameters_lie_on_the_closed_form(rotations):
    event = rotations.events[1]
    curve = ns.continue_bifurcation(event, ("a", "e"), bounds=[(-1, 2), (-0.5, 1)])
    a, e = curve.values.T
    expected = 0.49 + e * (0.6 + 0.7 * a - 0.343 / 3) / (1 + 0.7 * e)
    assert np.abs(a - expected).max() < 1e-11
    assert curve.solution(3).residual < 1e-11


def flipping():
    """v' = (m v1 - v1^3, -v2) seen from axes that turn by half the forcing's angle."""
    u, w, t, m, q = symbols("u w t m q")
    c, s = ca.cos(t), ca.sin(t)
    onto = ca.vertcat(ca.horzcat((1 + c) / 2, s / 2), ca.horzcat(s / 2, (1 - c) / 2))
    x = ca.vertcat(u, w)
    a = onto @ x
    f = m * a - q * (x - a) - (x.T @ a) * a + 0.5 * ca.vertcat(-w, u)
    return ns.FilippovSystem([u, w], field=[f[0], f[1]], time=t, parameters={m: -0.3, q: 1.0})


@pytest.mark.slow
def test_a_moebius_band_doubles_the_period_and_the_doubled_orbit_is_found():
    system = flipping()
    orbit = ns.periodic_orbit(system, [0.01, 0.01])
    assert np.abs(orbit.multipliers + np.exp([-0.6 * np.pi, -2 * np.pi])).max() < 1e-12
    branch = ns.continue_orbit(orbit, "m", bounds=(-1, 1))
    (event,) = branch.events
    assert event.kind == "period doubling" and abs(event.parameter) < 1e-13
    double = ns.continue_orbit(event, "m", bounds=(-1, 1))
    assert double.ends[0] is ns.orbit.BranchEnd.EVENT and double.values.min() > -1e-12
    twice = double[0.5]
    assert abs(twice.period - 4 * np.pi) < 1e-12
    assert abs(np.linalg.norm(twice.start) - np.sqrt(0.5)) < 1e-12  # v1 = sqrt(m)
    assert np.abs(twice.multipliers - np.exp(-4 * np.pi)).max() < 1e-12
    curve = ns.continue_bifurcation(event, ("m", "q"), bounds=[(-1, 1), (0.5, 2)])
    assert np.abs(curve.values[:, 0]).max() < 1e-13


def test_the_cascade_of_roessler():
    """a = b = 0.2: the period doubles at c = 2.8324, and again at 3.8374 (Kuznetsov 2004; AUTO)."""
    x, y, z, a, b, c = symbols("x y z a b c")
    system = ns.FilippovSystem(
        [x, y, z], field=[-y - z, x + a * y, b + z * (x - c)], parameters={a: 0.2, b: 0.2, c: 2.5}
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [1.0, 1.0, 0.0], 400.0))
    assert (
        abs(orbit.period - 5.749) < 1e-3
    )  # once, though a run comes back as well after two periods
    first = ns.continue_orbit(orbit, "c", bounds=(2.0, 4.5))
    assert kinds(first) == ["period doubling"]
    second = ns.continue_orbit(first.events[0], "c", bounds=(2.0, 4.5))
    assert kinds(second) == ["period doubling"]
    assert abs(first.events[0].parameter - 2.8324) < 1e-4
    assert abs(second.events[0].parameter - 3.8374) < 1e-4
    # a second method: the doubled orbit attracts between the two, at its period
    run = ns.simulate(system, second[3.2].start, 60.0, parameters={"c": 3.2}, tol=1e-12)
    assert np.abs(run(second[3.2].period) - second[3.2].start).max() < 1e-8


def test_relaxation_oscillations_are_followed_far_from_their_hopf_point():
    """The Brusselator: b = 1 + a^2 is the Hopf point; no plane meets all orbits of the family."""
    x, y, a, b = symbols("x y a b")
    system = ns.FilippovSystem(
        [x, y], field=[a - (b + 1) * x + x * x * y, b * x - x * x * y], parameters={a: 1.0, b: 3.0}
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [1.1, 3.0], 60.0))
    branch = ns.continue_orbit(orbit, "b", bounds=(1.5, 12.0))
    assert kinds(branch) == ["Hopf"] and branch.ends[1] is ns.orbit.BranchEnd.REACHED_BOUND
    assert abs(branch.events[0].parameter - 2) < 1e-12
    assert abs(branch.events[0].coefficients["frequency"] - 1) < 1e-12
    assert np.all(np.diff(branch.values) > 0)
    run = ns.simulate(system, [1.1, 3.0], 150.0, parameters={"b": 9.0}, tol=1e-12)
    found = ns.periodic_orbit(system, run, parameters={"b": 9.0})
    assert abs(branch[9.0].period - found.period) < 1e-9


def test_forced_duffing_bends_back_whatever_the_phase_of_the_run():
    """Both folds, by the orbit's symmetry and without it; the clock of the run does not matter."""
    x, v, t, F, w, d = symbols("x v t F w d")
    system = ns.FilippovSystem(
        [x, v],
        field=[v, -d * v - x - x**3 + F * ca.cos(w * t)],
        time=t,
        parameters={F: 0.3, w: 1.2, d: 0.1},
    )
    run = ns.simulate(system, [0.0, 0.0], 300.0)
    found = []
    for symmetry in (None, "odd"):
        orbit = ns.periodic_orbit(system, run, period=2 * ca.pi / w, symmetry=symmetry)
        branch = ns.continue_orbit(orbit, "w", bounds=(1.1, 2.2))
        assert kinds(branch) == ["fold", "fold"] and len(branch) < 400
        found.append(sorted(event.parameter for event in branch.events))
        low, high = found[-1]
        assert len(branch.at(0.5 * (low + high))) == 3
    assert np.abs(np.subtract(*found)).max() < 1e-11


@pytest.mark.parametrize("symmetry", [None, "odd"])
def test_a_run_of_many_periods_gives_the_prime_period(symmetry):
    x, y, mu = symbols("x y mu")
    system = ns.FilippovSystem([x, y], field=[y, mu * (1 - x * x) * y - x], parameters={mu: 1.0})
    orbit = ns.periodic_orbit(system, ns.simulate(system, [2.0, 0.0], 60.0), symmetry=symmetry)
    assert abs(orbit.period - 6.6632868593231) < 1e-12  # Andersen & Geer 1982, mu = 1


@pytest.mark.slow
def test_lorenz_orbits_lose_their_symmetry_at_a_pitchfork():
    x, y, z, r = symbols("x y z r")
    system = ns.FilippovSystem(
        [x, y, z], field=[10 * (y - x), r * x - y - x * z, x * y - 8 / 3 * z], parameters={r: 160.0}
    )
    run = ns.simulate(system, [1.0, 1.0, 150.0], 100.0)
    flip = np.diag([-1.0, -1.0, 1.0])
    whole, half = (ns.periodic_orbit(system, run, symmetry=s) for s in (None, flip))
    assert abs(whole.period - half.period) < 1e-10
    branches = [ns.continue_orbit(orbit, "r", bounds=(150, 163)) for orbit in (whole, half)]
    assert [kinds(branch) for branch in branches] == [["pitchfork"], ["pitchfork"]]
    points = [branch.events[0].parameter for branch in branches]
    assert abs(points[0] - points[1]) < 1e-8 and abs(points[0] - 154.4) < 0.1  # Sparrow 1982
    split = ns.continue_orbit(branches[1].events[0], "r", bounds=(150, 163))
    orbit = split[151.0]
    assert abs(orbit.period / half.period - 1) < 0.1
    assert np.abs(orbit.trajectory.x.mean(axis=0)[:2]).max() > 1e-2


@pytest.mark.parametrize("start", [[1.0, 0.0], [0.3, -0.4], [-2.0, 0.0]])
def test_each_orbit_of_a_centre_is_found_where_it_is(start):
    """Newton's method knows not which one of the family is meant; the guess does."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    centre = ns.FilippovSystem([x, y], field=[2 * y, -2 * x])
    orbit = ns.periodic_orbit(centre, start)
    assert abs(orbit.period - np.pi) < 1e-10
    assert np.hypot(*orbit.start) == pytest.approx(np.hypot(*start), rel=1e-8)
    assert "neutral" in orbit.stability


@pytest.mark.parametrize("start", [[0.1, 0.0], [1.0, 0.5], [2.0, 0.5], [3.0, 0.0]])
def test_a_pendulum_has_the_period_of_the_elliptic_integral(start):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    pendulum = ns.FilippovSystem([x, y], field=[y, -ca.sin(x)])
    for guess in (start, ns.simulate(pendulum, start, 40.0)):
        orbit = ns.periodic_orbit(pendulum, guess)
        modulus = np.sin(start[0] / 2) ** 2 + start[1] ** 2 / 4
        assert orbit.period == pytest.approx(4 * ellipk(modulus), rel=1e-7)
        energy = orbit.start[1] ** 2 / 2 - np.cos(orbit.start[0])
        assert energy == pytest.approx(start[1] ** 2 / 2 - np.cos(start[0]), rel=1e-7)


def test_an_orbit_without_events_is_found_behind_a_transient_with_some():
    """Friction on a belt stops acting when the block oscillates more slowly than the belt runs."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    pull = 0.04 - (x - 0.4) ** 2 - y**2  # a circle of radius 0.2, which attracts
    field = [y + (x - 0.4) * pull, -x + y * pull]
    belt = ns.FilippovSystem(
        [x, y], surface=y - 0.3, above=[field[0], field[1] - 0.4], below=[field[0], field[1] + 0.4]
    )
    run = ns.simulate(belt, [1.0, -0.2], 2000.0)
    assert len(run.events) > 2
    for guess in (run, [1.0, -0.2]):
        orbit = ns.periodic_orbit(belt, guess)
        assert orbit.itinerary == "-" and orbit.period == pytest.approx(2 * np.pi, rel=1e-12)
        assert orbit.multipliers[1].real == pytest.approx(np.exp(-0.16 * np.pi), rel=1e-10)


@pytest.mark.parametrize("size", [1e-10, 1e-5, 1.0, 1e10])
def test_an_orbit_is_no_point_because_its_states_are_small(size):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    circle = lambda s: (1 - (x / s) ** 2 - (y / s) ** 2) / 10
    system = ns.FilippovSystem([x, y], field=[y + x * circle(size), -x + y * circle(size)])
    orbit = ns.periodic_orbit(system, [1.1 * size, 0.0])
    assert np.hypot(*orbit.start) == pytest.approx(size, rel=1e-9)
    assert orbit.period == pytest.approx(2 * np.pi, rel=1e-13)
    assert orbit.multipliers[1].real == pytest.approx(np.exp(-0.4 * np.pi), rel=1e-8)
