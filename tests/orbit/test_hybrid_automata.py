"""Orbits, branches and derivatives of hybrid automata: discrete states, conditions and jump sets."""

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

import nonsmooth as ns

x, v, q, g, a, b = (ca.SX.sym(s) for s in "xvqgab")


def converter(*more):
    """A buck converter whose current is kept within a band: i' = q E - v, v' = (i - v)/2."""
    i, out, width, supply = (ca.SX.sym(s) for s in ("i", "out", "width", "supply"))
    on = ns.Reset(i - 1 + width, {q: 1}, -1, level=True, when=q == 0, name="on")
    off = ns.Reset(i - 1 - width, {q: 0}, 1, level=True, when=q == 1, name="off")
    return ns.FilippovSystem(
        [i, out],
        field=[q * supply - out, (i - out) / 2],
        discrete={q: (0, 1)},
        resets=[on, off, *(make(i, out) for make in more)],
        parameters={supply: 2.0, width: 0.2},
    )


def test_the_orbit_of_a_thermostat_has_its_multipliers_in_the_temperature():
    system = ns.textbook.thermostat().system
    run = ns.simulate(system, [20.0, 0], 10.0)
    assert run.itinerary.startswith("q=0 q=1 q=0")
    orbit = ns.periodic_orbit(system, run)
    assert orbit.period == pytest.approx(np.log(12 / 8 * 22 / 18), abs=1e-13)
    assert orbit.multipliers.tolist() == [1.0] and orbit.itinerary in ("q=1 q=0", "q=0 q=1")
    assert orbit.trajectory.itinerary == orbit.itinerary
    by_heat = 1 / 12 - 1 / 8
    assert orbit.derivative("a").period == pytest.approx(by_heat, abs=1e-13)
    assert ns.lyapunov_spectrum(system, [20.0, 0], 10.0).exponents.shape == (1,)


def test_a_branch_of_a_thermostat_ends_where_the_heat_does_not_suffice():
    system = ns.textbook.thermostat().system
    orbit = ns.periodic_orbit(system, ns.simulate(system, [20.0, 0], 10.0))
    branch = ns.continue_orbit(orbit, "a", bounds=(10.0, 60.0))
    assert branch.ends[0] is not branch.ends[1] and not branch.events
    assert branch.ends[0].name == "PERIOD_DIVERGES" and branch.values.min() < 22.2
    for value in (25.0, 50.0):
        (at,) = branch.at(value)
        expected = np.log((value - 18) / (value - 22) * 22 / 18)
        assert at.period == pytest.approx(expected, abs=1e-12)


def test_the_multiplier_of_a_converter_is_that_of_its_flows_and_jumps():
    system = converter()
    orbit = ns.periodic_orbit(system, ns.simulate(system, [1.0, 1.0, 1], 60.0))
    linear, product = np.array([[0.0, -1.0], [0.5, -0.5]]), np.eye(2)
    for leg, following in zip(orbit.legs, np.roll(orbit.legs, -1), strict=True):
        before = linear @ following.start[:2] + [2.0 * leg.start[2], 0.0]
        after = linear @ following.start[:2] + [2.0 * following.start[2], 0.0]
        jump = np.eye(2) + np.outer(after - before, [1.0, 0.0]) / before[0]
        product = jump @ expm(linear * leg.duration) @ product
    expected = sorted(np.linalg.eigvals(product), key=abs)[::-1]
    np.testing.assert_allclose(orbit.multipliers, expected, atol=1e-12)
    with pytest.raises(ns.OptionError, match="2 states that move"):
        ns.lyapunov_spectrum(system, orbit.start, 10.0, k=3)


@pytest.mark.slow
def test_the_exponents_of_a_converter_are_those_of_its_multipliers():
    system = converter()
    orbit = ns.periodic_orbit(system, ns.simulate(system, [1.0, 1.0, 1], 60.0))
    exponents = ns.lyapunov_spectrum(system, orbit.start, 300 * orbit.period).exponents
    expected = np.log(np.abs(orbit.multipliers)) / orbit.period
    np.testing.assert_allclose(exponents, expected, atol=2e-3)


NEVER = [
    lambda i, out: ns.Reset(out - 1.05, {q: 0}, 1, level=True, when=q == 2, name="never"),
    lambda i, out: ns.Reset(out - 1.05, {q: 0}, 1, when=ca.logic_and(q == 0, i > 5), name="never"),
    lambda i, out: ns.Reset(ca.logic_and(out > 1.05, q == 2), {q: 0}, name="never"),
    lambda i, out: ns.Reset(ca.logic_and(i > 5, out > 1.05), {q: 0}, name="never"),
]


@pytest.mark.parametrize(
    "number", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2, 3))]
)
def test_a_guard_that_makes_nothing_due_is_no_bifurcation(number):
    """The output voltage touches 1.05 as the band becomes wider, which matters to nobody."""
    system = converter(NEVER[number])
    orbit = ns.periodic_orbit(system, ns.simulate(system, [1.0, 1.0, 1], 60.0))
    branch = ns.continue_orbit(orbit, "width", bounds=(0.1, 0.8))
    assert not branch.events and [e.name for e in branch.ends] == ["REACHED_BOUND"] * 2
    assert min(o.trajectory.x[:, 1].max() for o in branch.orbits) < 1.05
    assert max(o.trajectory.x[:, 1].max() for o in branch.orbits) > 1.05
    assert all("never" not in m.what for m in orbit.margins)


@pytest.mark.parametrize("condition", [False, True])
def test_a_guard_that_makes_something_due_ends_the_branch_where_it_is_touched(condition):
    def more(i, out):
        when = ca.logic_and(out > 1.05, i > 0)
        if condition:
            return ns.Reset(when, {q: 1 - q, i: 1}, name="trip")
        return ns.Reset(out - 1.05, {q: 1 - q, i: 1}, 1, when=i > 0, name="trip")

    system = converter(more)
    orbit = ns.periodic_orbit(system, ns.simulate(system, [1.0, 1.0, 1], 60.0))
    branch = ns.continue_orbit(orbit, "width", bounds=(0.1, 0.8))
    assert [e.kind for e in branch.events] == ["grazing of a reset"]
    at = branch.events[0].orbit.trajectory
    times = np.linspace(0, at.t[-1], 20001)
    assert at(times)[:, 1].max() == pytest.approx(1.05, abs=1e-8)


def test_a_relay_that_is_odd_has_half_orbits():
    up = ns.Reset(x - b, {q: 1}, 1, level=True, when=q == -1, name="up")
    down = ns.Reset(x + b, {q: -1}, -1, level=True, when=q == 1, name="down")
    system = ns.FilippovSystem(
        [x, v],
        field=[v, -0.3 * v - x - q],
        discrete={q: (-1, 1)},
        resets=[up, down],
        parameters={b: 0.2},
    )
    run = ns.simulate(system, [1.0, 0.0, 1], 80.0)
    whole = ns.periodic_orbit(system, run)
    half = ns.periodic_orbit(system, run, symmetry="odd")
    assert half.period == pytest.approx(whole.period, abs=1e-12)
    np.testing.assert_allclose(half.multipliers, whole.multipliers, atol=1e-10)
    assert set(half.itinerary.split()) == {"q=1", "q=-1"} and half.residual < 1e-12
    branch = ns.continue_orbit(half, "b", bounds=(0.1, 1.0))
    (at,) = branch.at(0.5)
    given = ns.simulate(system, [1.0, 0.0, 1], 80.0, parameters={b: 0.5})
    assert at.period == pytest.approx(ns.periodic_orbit(system, given).period, abs=1e-11)


def test_two_neurons_that_inhibit_each_other_fire_in_turn():
    """After a spike the other is at u - e; the half map is u -> I (1 - (I - 1)/(I - u + e))."""
    current, kick = 1.3, 0.1
    system = ns.textbook.integrate_and_fire_pair().system
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.0, 0.4], 60.0))
    u = 0.5
    for _ in range(200):
        u = current * (1 - (current - 1) / (current - u + kick))
    slope = -current * (current - 1) / (current - u + kick) ** 2
    period = 2 * np.log((current - u + kick) / (current - 1))
    assert orbit.period == pytest.approx(period, abs=1e-12)
    assert orbit.multipliers[1] == pytest.approx(slope**2, abs=1e-11)


def test_a_gear_slows_the_approach_to_rest():
    found = ns.find_equilibrium(ns.textbook.gearbox().system, [4.0, 3])
    assert found.eigenvalues[0] == pytest.approx(-1 / 3)


def test_nothing_has_a_derivative_by_a_discrete_state():
    """The gear enters the field as a number would."""
    up = ns.Reset(x - 1.5, {g: g + 1}, 1, level=True, when=g <= 1, name="up")
    system = ns.FilippovSystem(
        [x], field=[(a - x) / g], discrete={g: (1, 2)}, resets=up, parameters={a: 4.0}
    )
    run = ns.simulate(system, [0.0, 1], 2.0)
    found = ns.sensitivity(run)
    shift = np.log(4.0 / 2.5)
    slope = np.exp(-(2.0 - shift) / 2) / 2 * 2.5 / 4.0
    np.testing.assert_allclose(found.dx_dx0, [[slope, 0], [0, 0]], atol=1e-12)
    np.testing.assert_allclose(found.dt_dx0, [[-1 / 4.0, 0]], atol=1e-12)
    back, by_parameters = ns.vjp(run, [1.0, 1.0])
    np.testing.assert_allclose(back, [slope, 0], atol=1e-12)
    np.testing.assert_allclose(by_parameters, found.dx_dp[0], atol=1e-12)


def test_an_orbit_crosses_surfaces_beside_its_discrete_states():
    """A mass with friction that a relay pushes: x'' = -x - 0.3 sgn x' - 2 q; one multiplier from the flows."""
    right = ns.Reset(x - 1, {q: 1}, 1, level=True, when=q == -1, name="right")
    left = ns.Reset(x + 1, {q: -1}, -1, level=True, when=q == 1, name="left")
    system = ns.FilippovSystem(
        [x, v],
        surface=v,
        above=[v, -x - 0.3 - 2 * q],
        below=[v, -x + 0.3 - 2 * q],
        discrete={q: (-1, 1)},
        resets=[right, left],
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.0, 1.0, -1], 60.0))
    assert [leg.kind for leg in orbit.legs].count("crossing") == 2
    product = np.eye(2)
    for leg, following in zip(orbit.legs, np.roll(orbit.legs, -1), strict=True):
        fields = []
        for one in (leg, following):
            at, side = following.start, 1 if one.mode == "+" else -1
            fields.append(np.array([at[1], -at[0] - 0.3 * side - 2 * one.start[2]]))
        normal = np.array([0.0, 1.0] if leg.kind == "crossing" else [1.0, 0.0])
        jump = np.eye(2) + np.outer(fields[1] - fields[0], normal) / (normal @ fields[0])
        product = jump @ expm(np.array([[0, 1], [-1, 0]]) * leg.duration) @ product
    expected = sorted(np.linalg.eigvals(product), key=abs)[::-1]
    np.testing.assert_allclose(orbit.multipliers.real, expected, atol=1e-11)
