"""Derivatives, periodic orbits, branches and equilibria of systems with complementarity conditions."""

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import nonsmooth as ns

V, I, U, R, A, B, T, X, Y = (
    ca.SX.sym(name) for name in ("v", "i", "u", "R", "a", "b", "t", "x", "y")
)


def condition(y, multiplier, name):
    return ns.Complementarity(y, multiplier=multiplier, name=name)


def rectifier():
    """A diode and a resistance R in series feed a capacity with the load 10."""
    diode = condition(V + R * I - ca.sin(T), I, "diode")
    return ns.FilippovSystem(
        [V], field=[I - V / 10], complementarity=diode, time=T, parameters={R: 0.1}
    )


def peak(load=10.0):
    diode = condition(V - ca.sin(T), I, "diode")
    return ns.FilippovSystem(
        [V], field=[I - V / R], complementarity=diode, time=T, parameters={R: load}
    )


def disc():
    inside = condition((1 - X**2 - Y**2) / 2, A, "edge")
    return ns.FilippovSystem(
        [X, Y], field=[R - A * X, -A * Y], complementarity=inside, parameters={R: 1.0}
    )


def test_two_conditions_that_close_at_one_instant_are_a_corner():
    system = ns.FilippovSystem(
        [X, Y],
        field=[-1 + A + 0.1 * B, -1 + B + 0.1 * A],
        complementarity=[condition(X, A, "left"), condition(Y, B, "bottom")],
    )
    with pytest.raises(ns.DegenerateError, match="'left' and 'bottom'"):
        ns.sensitivity(ns.simulate(system, [1.0, 1.0], 2.0))


def test_the_orbit_of_a_rectifier_and_its_multiplier():
    """The multiplier is exp(-T/10 - T_c/0.1) with the time T_c of conduction, the state that of exact legs."""
    system = rectifier()
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.0], 50.0))
    closed = sum(leg.duration for leg in orbit.legs if leg.mode == "c")
    assert orbit.period == pytest.approx(2 * np.pi)
    assert orbit.multipliers[0].real == pytest.approx(np.exp(-0.2 * np.pi - 10 * closed), rel=1e-6)

    def charging(t, t0, v0):
        """v' = (sin t - v)/R - v/10 from (t0, v0)."""
        rate, of = 10.1, lambda s: 10 * (10.1 * np.sin(s) - np.cos(s)) / (1 + 10.1**2)
        return of(t) + (v0 - of(t0)) * np.exp(-rate * (t - t0))

    (leg,) = [leg for leg in orbit.legs if leg.mode == "c"]
    on = brentq(lambda t: np.sin(t) - leg.start[0], -np.pi / 2, np.pi / 2)
    off = brentq(lambda t: charging(t, on, np.sin(on)) - np.sin(t), on + 0.1, np.pi)
    back = np.sin(off) * np.exp(-(2 * np.pi + on - off) / 10)
    assert back == pytest.approx(np.sin(on), abs=1e-9)
    assert off - on == pytest.approx(closed, abs=1e-9)


def test_a_branch_of_a_peak_rectifier():
    """The diode blocks where its current cos t + sin t / R ends, and the voltage decays until the source is above it."""
    system = peak()
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.3], 50.0))
    assert orbit.multipliers.tolist() == [0]
    branch = ns.continue_orbit(orbit, "R", bounds=(5.0, 20.0))
    assert not branch.events
    assert [str(end) for end in branch.ends] == ["REACHED_BOUND", "REACHED_BOUND"]
    for r in (5.0, 13.0, 20.0):
        (one,) = branch.at(r)
        (leg,) = [leg for leg in one.legs if leg.mode == "o"]
        off = np.pi - np.arctan(r)
        decay = lambda t, r=r, off=off: np.sin(t) - np.sin(off) * np.exp(-(t - off) / r)
        on = brentq(decay, 1.6 * np.pi, 2.5 * np.pi)
        assert leg.start[0] == pytest.approx(np.sin(off), abs=1e-9)
        assert leg.duration == pytest.approx(on - off, abs=1e-9)


def boost():
    """A boost converter whose switch is on for a part of each period of 0.2; the load 20 leaves no current at times."""
    duty, s = ca.SX.sym("duty"), ca.SX.sym("s")
    clock, on = ns.Clock(0.2, name="tick"), (1 - s) / 2
    return ns.FilippovSystem(
        [I, V],
        field=[10 * (1 - (1 - on) * V + U), (1 - on) * I - V / 20],
        surfaces=[clock.phase - 0.2 * duty],
        multipliers=[s],
        complementarity=condition(I, U, "diode"),
        clocks=clock,
        parameters={duty: 0.4},
    )


def least_current(duty):
    """The least current of the orbit on which the diode never blocks, by exponentials."""
    legs = []
    for off, time in ((0, 0.2 * duty), (1, 0.2 * (1 - duty))):
        legs.append(expm(time * np.array([[0, -10 * off, 10], [off, -0.05, 0], [0, 0, 0]])))
    whole = legs[1] @ legs[0]  # from a tick to the next
    return np.linalg.solve(np.eye(2) - whole[:2, :2], whole[:2, 2])[0]


def test_a_branch_goes_from_discontinuous_to_continuous_conduction():
    """The leg without a current ends at the duty at which the current is zero at the tick."""
    system = boost()
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.0, 2.5, 0.0], t_end=600.0))
    assert orbit.itinerary == "+c -o +o"
    branch = ns.continue_orbit(orbit, "duty", bounds=(0.35, 0.8))
    assert [str(end) for end in branch.ends] == ["REACHED_BOUND", "REACHED_BOUND"]
    (event,) = branch.events
    assert (event.kind, event.far_side.itinerary) == ("corner", "+o -o")
    assert event.parameter == pytest.approx(brentq(least_current, 0.5, 0.9), abs=1e-9)
    (beyond,) = branch.at(0.79)
    assert min(leg.start[0] for leg in beyond.legs) == pytest.approx(least_current(0.79), rel=1e-8)


def test_a_slide_that_a_clock_ends_is_no_corner_of_a_branch():
    """A ramp that rises by 1 while on, falls by 1 and rests at 0: its legs last 1 - 2a, a, a, with no event below 1/2."""
    i, a, s, lam = (ca.SX.sym(name) for name in ("i", "a", "s", "lam"))
    clock, on = ns.Clock(1.0), (1 - s) / 2
    ramp = ns.FilippovSystem(
        [i],
        field=[on - (1 - on) * lam],
        surfaces=[clock.phase - a, i],
        multipliers=[s, lam],
        clocks=clock,
        parameters={a: 0.2},
    )
    orbit = ns.periodic_orbit(ramp, ns.simulate(ramp, [0.3, 0.0], 20.0))
    branch = ns.continue_orbit(orbit, "a", bounds=(0.05, 0.49))
    assert not branch.events
    assert [str(end) for end in branch.ends] == ["REACHED_BOUND", "REACHED_BOUND"]
    (last,) = branch.at(0.45)
    assert sorted(leg.duration for leg in last.legs) == pytest.approx([0.1, 0.45, 0.45])


@pytest.mark.parametrize("start", [0.5, 0.9])
def test_a_branch_passes_the_touch_of_a_diode(start):
    """Without the diode i = b + sin(t - pi/4)/sqrt 2, which touches zero at b = 1/sqrt 2."""
    diode = condition(I, U, "diode")
    system = ns.FilippovSystem(
        [I], field=[ca.sin(T) + B - I + U], complementarity=diode, time=T, parameters={B: start}
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.9], 60.0))
    branch = ns.continue_orbit(orbit, "b", bounds=(0.2, 1.5))
    (event,) = branch.events
    assert event.kind == "grazing-sliding"
    assert event.parameter == pytest.approx(np.sqrt(0.5), abs=1e-10)
    assert event.far_side.verdict == "persistence"
    assert event.far_side.numbers["radius of A_i"] < 1e-12  # all orbits leave zero alike
    assert [str(end) for end in branch.ends] == ["REACHED_BOUND", "REACHED_BOUND"]


def test_a_branch_passes_the_touch_of_a_condition_of_degree_zero():
    """x = b + sin(t - pi/4)/sqrt 2 below 1, where a force -3 (x - 1) begins: the field is continuous."""
    clip = condition(A - (X - 1), A, "clip")
    system = ns.FilippovSystem(
        [X], field=[ca.sin(T) + B - X - 3 * A], complementarity=clip, time=T, parameters={B: 0.1}
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.0], 60.0))
    branch = ns.continue_orbit(orbit, "b", bounds=(-0.2, 1.0))
    (event,) = branch.events
    assert event.kind == "grazing of a soft switch"
    assert event.parameter == pytest.approx(1 - np.sqrt(0.5), abs=1e-10)


def test_equilibria_of_modes():
    found = ns.find_equilibrium(disc(), [0.9, 0.1], mode="c")
    assert (found.status, found.kind, found.mode) == ("real", "stable node", "c")
    assert found.point == pytest.approx([1, 0], abs=1e-12)
    assert found.eigenvalues == pytest.approx([-1])
    clipped = ns.FilippovSystem(
        [X], field=[2 - X - 3 * A], complementarity=condition(A - (X - 1), A, "clip")
    )
    assert ns.find_equilibrium(clipped, [0.9], mode="c").point == pytest.approx([1.25])
    away = ns.find_equilibrium(clipped, [0.9], mode="o")
    assert (away.status, away.point[0]) == ("virtual", pytest.approx(2))
    assert "mode 'o'" in str(away)
    with pytest.raises(ns.OptionError, match="in which mode"):
        ns.find_equilibrium(clipped, [0.9])
    with pytest.raises(ns.DefinitionError, match="without explicit time"):
        ns.find_equilibrium(peak(), [0.9], mode="c")
