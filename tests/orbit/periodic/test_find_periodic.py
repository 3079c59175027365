"""Newton's method for periodic orbits: from guesses near and far, to rounding, or with the reason why not."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import nonsmooth as ns
from tests.orbit.periodic_cases import GUESSES, stick_slip, symbols


@pytest.mark.parametrize("name", GUESSES)
def test_an_orbit_is_found_again_from_beside_it_to_rounding(name):
    system, start, given = GUESSES[name]
    orbit = ns.periodic_orbit(system, start, **given)
    scales = orbit.problem.scales(orbit.unknowns)
    beside = np.array(start) + 1e-6 * scales[: len(start)]
    again = ns.periodic_orbit(system, beside, **given)
    assert np.abs((orbit.unknowns - again.unknowns) / scales).max() < 1e-14
    one, two = orbit.evaluation.jacobian, again.evaluation.jacobian
    assert np.abs(one - two).max() < 1e-10 * np.abs(two).max()
    np.testing.assert_allclose(orbit.half_multipliers, again.half_multipliers, atol=1e-12)
    assert orbit.residual < 1e-13


def test_a_leg_that_does_not_come_to_its_event_is_reported():
    system, _, given = GUESSES["friction"]
    with pytest.raises(ns.ConvergenceError, match=r"leg 1 \(s, ended by"):
        ns.periodic_orbit(system, [0.0, 0.0], **{**given, "parameters": {"f": 1.6}})


def test_an_orbit_at_other_parameters_leads_to_the_one_there_and_too_few_iterations_to_none():
    system, start, given = GUESSES["friction"]
    orbit = ns.periodic_orbit(system, start, **given)
    there = ns.periodic_orbit(system, orbit, parameters={"f": 0.7})
    back = ns.periodic_orbit(system, there, parameters={"f": 0.6})
    assert np.abs(back.unknowns - orbit.unknowns).max() < 1e-14
    with pytest.raises(ns.ConvergenceError, match="Newton's method"):
        ns.periodic_orbit(system, orbit, parameters={"f": 0.7}, max_iterations=1)


# forced systems ------------------------------------------------------------------------------------

x, v, t = symbols("x v t")


def walls() -> ns.FilippovSystem:
    """A free mass between walls at -1 and 1 under the force 2 cos t, restitution 0.7."""
    resets = [ns.Reset(x - s, [s, -0.7 * v], direction=s, name=f"wall {s}") for s in (-1, 1)]
    return ns.FilippovSystem([x, v], field=[v, 2 * ca.cos(t)], time=t, resets=resets)


@pytest.mark.parametrize("symmetry", [None, "odd"])
@pytest.mark.parametrize("off", [0.0, 0.01, 0.02, -0.02])
def test_a_state_beside_an_unstable_orbit_gives_that_orbit(symmetry, off) -> None:
    """Impacts half a period apart, at -1 at the time s: 2 = -2 sin(s) pi (1 + r)/(1 - r) + 4 cos s."""
    r, turns = 0.7, np.pi * 1.7 / 0.3
    s = -np.arccos(2 / np.hypot(4, 2 * turns)) - np.arctan2(2 * turns, 4)
    assert abs(-2 * np.sin(s) * turns + 4 * np.cos(s) - 2) < 1e-13
    speed = -2 * r * 2 * np.sin(s) / (1 - r)
    later = s + 0.3
    state = [
        -1 + (speed - 2 * np.sin(s)) * 0.3 + 2 * (np.cos(s) - np.cos(later)),
        speed + 2 * (np.sin(later) - np.sin(s)),
    ]
    guess = np.array(state) * (1 + off)
    orbit = ns.periodic_orbit(walls(), guess, t_start=later, symmetry=symmetry)
    assert orbit.period == pytest.approx(2 * np.pi, rel=1e-13) and len(orbit.legs) == 2
    assert np.abs([leg.start[1] for leg in orbit.legs]) == pytest.approx(speed, rel=1e-12)


def driven(drive: ca.SX) -> ns.FilippovSystem:
    return ns.FilippovSystem([x], surface=x, above=[drive - 1], below=[drive + 1], time=t)


@pytest.mark.parametrize(
    ("drive", "periods"),
    [
        (2.5 * ca.cos(t) + 0.3 * ca.cos(2 * t + 0.5), 1.0),
        (2.5 * ca.cos(3 * t) + 0.3 * ca.cos(2 * t + 0.5), 1.0),
        (2.5 * ca.cos(t) + 0.3 * ca.cos(1.5 * t), 2.0),
        (2.5 * ca.cos(t) + 0.3 * ca.cos(np.sqrt(2) * t), None),
    ],
)
def test_the_common_period_of_several_frequencies_is_found(drive, periods) -> None:
    if periods is None:
        with pytest.raises(ns.OptionError, match="common period"):
            ns.periodic_orbit(driven(drive), [0.5])
    else:
        orbit = ns.periodic_orbit(driven(drive), [0.5])
        assert orbit.period == pytest.approx(2 * np.pi * periods, rel=1e-14)


def pendulum(drive: float) -> ns.FilippovSystem:
    above, below = ([v, -x - s + drive * ca.cos(t)] for s in (1, -1))
    return ns.FilippovSystem([x, v], surface=v, above=above, below=below, time=t)


@pytest.mark.parametrize(
    ("system", "guess", "options", "error", "words"),
    [
        (driven(2.5 * ca.cos(t)), [0.5], {"multiplicity": 2}, ns.ConvergenceError, "after 1 of"),
        (driven(2.5 * ca.cos(t)), [0.5], {"multiplicity": 0}, ns.OptionError, "multiplicity"),
        (driven(2.5 * ca.cos(t)), [0.5], {"multiplicity": 2, "symmetry": "odd"}, ns.OptionError, "even"),
        (driven(2.5 * ca.cos(t)), [0.5], {"max_time": 1e-9}, ns.ConvergenceError, "max_time = 1e-09"),
        (driven(2.5 * ca.cos(t)), [0.5], {"max_time": 0}, ns.OptionError, "max_time"),
        (stick_slip(), [0.5, 0.1], {"multiplicity": 1}, ns.OptionError, "does not depend on time"),
        (pendulum(0.5), [3.3, 0.0], {}, ns.ConvergenceError, "the run rests at"),
    ],
)  # fmt: skip
def test_what_is_refused_in_words(system, guess, options, error, words) -> None:
    with pytest.raises(error, match=words):
        ns.periodic_orbit(system, guess, **options)


def test_an_orbit_of_a_family_is_named() -> None:
    """Two springs: every start has the period 3 pi/2."""
    springs = ns.textbook.bilinear_oscillator().system
    orbit = ns.periodic_orbit(springs, [1.0, 0.0], progress=True)
    assert orbit.period == pytest.approx(1.5 * np.pi, rel=1e-13)
    assert "one of a family" in str(orbit) and not orbit.is_virtual


def test_multiplicity_of_a_run_and_of_one_mode() -> None:
    """x' = -x + cos t/2 has the period 4 pi over one, and over two periods of 2 pi."""
    system = ns.FilippovSystem([x], field=[-x + ca.cos(t / 2)], time=t)
    for given in ({"period": 4 * np.pi}, {"period": 4 * np.pi, "multiplicity": 1}):
        assert ns.periodic_orbit(system, [0.1], **given).period == pytest.approx(4 * np.pi)
    orbit = ns.periodic_orbit(system, [0.1], itinerary="", multiplicity=1)
    assert orbit.period == pytest.approx(4 * np.pi)
    run = ns.simulate(system, [0.1], 80.0)
    assert ns.periodic_orbit(system, run, multiplicity=1).period == pytest.approx(4 * np.pi)


def test_a_branch_continues_where_a_block_sticks_anywhere():
    """One block slips under its force, the other one sticks wherever it is: the multiplier 1 of its position."""
    x, v, y, w, t, force = symbols("x v y w t force")
    one, two = ns.Friction(v, load=1, kinetic=0.2), ns.Friction(w, load=1, kinetic=0.6)
    system = ns.FilippovSystem(
        [x, v, y, w],
        field=[
            v,
            one.force - x - 0.3 * (x - y) + force * ca.cos(1.7 * t),
            w,
            two.force - y - 0.3 * (y - x),
        ],
        surfaces=[one, two],
        time=t,
        parameters={force: 0.8},
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.3, 0.4, 0.1, 0.0], 300.0))
    assert set(leg.mode[1] for leg in orbit.legs) == {"s"}
    assert np.abs(orbit.multipliers - 1.0).min() < 1e-9
    branch = ns.continue_orbit(orbit, "force", bounds=(0.7, 1.0))
    assert not branch.events and [end.name for end in branch.ends] == ["REACHED_BOUND"] * 2
    points = [node.start[2] for node in branch.orbits]
    assert np.ptp(points) < 1e-9


@pytest.mark.parametrize("law", ["relay", "friction"])
@pytest.mark.parametrize("start", [1.0, 0.55])
def test_orbits_of_a_neutral_family_are_named_as_such_also_where_it_touches_a_surface(law, start):
    """A block on a belt with constant friction circles the equilibrium, at most where it touches the belt's speed."""
    x, v, b = symbols("x v b")
    given = {"surface": v - b, "above": [v, -x - 0.4], "below": [v, 0.4 - x]}
    if law == "friction":
        friction = ns.Friction(v - b, load=1, kinetic=0.4)
        given = {"field": [v, friction.force - x], "surfaces": [friction]}
    system = ns.FilippovSystem([x, v], parameters={b: 0.3}, **given)
    from_state = ns.periodic_orbit(system, [start, 0.0])
    assert from_state.itinerary == "-" and from_state.period == pytest.approx(2 * np.pi, rel=1e-12)
    orbit = ns.periodic_orbit(system, ns.simulate(system, [start, 0.0], 100.0))
    assert orbit.itinerary == "-" and orbit.period == pytest.approx(2 * np.pi, rel=1e-12)
    assert np.abs(orbit.multipliers - 1.0).max() < 1e-9
    assert "neutral" in orbit.stability and "family" in str(orbit)
    branch = ns.continue_orbit(orbit, "b", bounds=(0.1, 0.9))
    (event,) = branch.events  # those of one size, down to where they touch the belt's speed
    assert (event.kind, event.far_side.itinerary) == ("grazing-sliding", "")
    assert "neutral family" in event.far_side.verdict
    size = float(np.hypot(orbit.start[0] - 0.4, orbit.start[1]))
    assert event.parameter == pytest.approx(size, rel=1e-9)
    for node in branch.orbits:
        assert np.hypot(node.start[0] - 0.4, node.start[1]) == pytest.approx(size, rel=1e-6)
    assert [end.name for end in branch.ends] == ["EVENT", "REACHED_BOUND"]


@pytest.mark.parametrize("half", [0.3, 0.25, 0.24])
@pytest.mark.parametrize("simulated", [True, False])
def test_an_orbit_is_found_to_all_digits_where_a_state_is_almost_zero(half, simulated):
    """Prey falls to 2e-14 between the outbreaks; in logarithms of the states it is a relaxation oscillation."""
    system = ns.textbook.harvested_prey_predator().system
    values = {"b": half, "alpha": 3.0}

    def field(t, u):
        eaten = 0.3556 / (half + np.exp(u[0]))
        return [1 - np.exp(u[0]) - eaten * np.exp(u[1]), eaten * np.exp(u[0]) - 0.0444]

    rises = lambda t, u: u[1] - np.log(0.5)
    rises.direction = 1
    start = np.log([0.87, 0.5])
    exact = solve_ivp(
        field, (-1, 500), start, method="DOP853", rtol=1e-13, atol=1e-13, events=rises
    )
    run = ns.simulate(system, [0.5, 0.5], 600.0, parameters=values)
    orbit = ns.periodic_orbit(system, run if simulated else [0.5, 0.5], parameters=values)
    assert orbit.period == pytest.approx(np.diff(exact.t_events[0])[-1], rel=1e-11)


def test_a_family_at_one_value_of_the_parameter_has_no_folds():
    """A block on a belt with a damper that pushes: at no damping all circles up to the belt's speed are orbits."""
    x, v, damping = symbols("x v damping")
    friction = ns.Friction(v - 0.4, load=1, kinetic=0.5)
    field = [v, friction.force - x - damping * v]
    system = ns.FilippovSystem([x, v], field=field, surfaces=[friction], parameters={damping: -0.1})
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.0, 0.4], 100.0))
    branch = ns.continue_orbit(orbit, "damping", bounds=(-0.3, 0.6))
    assert [event.kind for event in branch.events] == ["grazing-sliding", "Hopf"]
    assert max(abs(event.parameter) for event in branch.events) < 1e-12


def test_the_run_of_an_orbit_follows_it_where_derivatives_grow():
    """A relay oscillator with a passenger, whose derivatives grow by exp(8 pi) along a leg."""
    x, v, w = symbols("x v w")
    rate = [v, ca.sign(v) - x - 0.2 * v, 8 * w + v]
    system = ns.FilippovSystem.from_expression([x, v, w], rate)
    q = np.exp(-0.1 * np.pi / np.sqrt(0.99))
    far = (1 + q) / (1 - q)
    orbit = ns.periodic_orbit(system, [-far, 0.0, -0.113], itinerary=["+", "-"])
    ends = [event.x for event in orbit.trajectory.events]
    assert orbit.start[0] == pytest.approx(-far, rel=1e-12)
    assert np.abs(ends[0] - orbit.legs[1].start).max() < 1e-10
    assert np.abs(ends[1] - orbit.start).max() < 1e-10
