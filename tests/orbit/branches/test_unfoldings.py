"""Coefficients beyond events are those of the orbits on both sides: of an impact that is grazed, of a touch
among several surfaces, of a corner; and a branch gives real orbits up to its events."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.orbit.periodic_cases import kinds, symbols

X, V, T = symbols("x v t")


def wall(w: float, *, reset: bool = False) -> ns.FilippovSystem:
    """x'' + 0.1 x' + x = F cos w t before a wall at x = 1, restitution 0.8."""
    F = ca.SX.sym("F")
    contact = (
        dict(resets=ns.Reset(X - 1, [X, -0.8 * V], 1, "wall"))
        if reset
        else dict(impacts=ns.Impact(1 - X, restitution=0.8, name="wall"))
    )
    field = [V, F * ca.cos(w * T) - X - 0.1 * V]
    return ns.FilippovSystem([X, V], field=field, parameters={F: 0.5}, time=T, **contact)


def grazed(w: float, **kind):
    system, size = wall(w, **kind), np.hypot(1 - w * w, 0.1 * w)
    at = {"F": 0.9 * size}
    response = at["F"] / (1 - w * w + 0.1j * w)  # of the oscillator that does not hit
    orbit = ns.periodic_orbit(system, [response.real, (1j * w * response).real], parameters=at)
    branch = ns.continue_orbit(orbit, "F", bounds=(0.85 * size, 1.3 * size))
    event = next(e for e in branch.events if "graz" in e.kind)
    assert abs(event.parameter - size) < 1e-11
    return branch, event, size


@pytest.mark.parametrize("reset", [False, True])
@pytest.mark.parametrize("w", [0.8, 1.6, 2.2, 2.6])
def test_the_orbit_that_hits_leaves_a_grazing_at_the_slope_of_the_square_root(w, reset):
    """The gap of the orbit that does not hit is 1 - F/F0; the other one hits with the speed s where
    1 - F/F0 = n.(I - A)^-1.A.w s + O(s^2)."""
    branch, event, size = grazed(w, reset=reset)
    slope = event.coefficients["n.(I - A)^-1.A.w"]
    fold = slope > 0
    assert event.far_side.verdict.startswith("nonsmooth fold" if fold else "persistence")
    errors = []
    for gap in (1e-3, 2.5e-4):
        value = size * (1 - gap if fold else 1 + gap)
        hitting = next(o for o in branch.at(value) if o.legs[0].event == "wall")
        speed = abs(hitting.legs[0].start[1]) / 0.8
        errors.append(abs((1 - value / size) / speed / slope - 1))
        assert "unstable" in hitting.stability
    assert errors[1] < 0.02 and errors[1] < 0.5 * errors[0] + 1e-3


def test_there_are_folds_and_persistence_among_them():
    verdicts = {grazed(w)[1].far_side.verdict[:4] for w in (0.8, 1.6, 2.2, 2.6)}
    assert verdicts == {"nons", "pers"}


def two_relays():
    k, l1, l2 = symbols("k l1 l2")
    return ns.FilippovSystem(
        [X, V],
        surfaces=[X - 1, V - k],
        multipliers=[l1, l2],
        field=[V, -X - 0.2 * V + ca.cos(T) - 0.1 * l1 - 0.15 * l2],
        time=T,
        parameters={k: 3.0},
    )


@pytest.fixture(scope="module")
def branch():
    system = two_relays()
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.0, 0.0], 200.0))
    return ns.continue_orbit(orbit, "k", bounds=(3.0, 6.5))


def test_a_corner_of_two_surfaces_is_passed_and_a_touch_of_one_is_named(branch):
    assert kinds(branch) == ["corner", "crossing-sliding", "switching-sliding", "grazing-sliding"]
    corner, event = branch.events[0], branch.events[-1]
    states = corner.orbit.evaluation.starts[:, :2] - [1.0, corner.parameter]
    assert np.abs(states).max(axis=1).min() < 1e-9  # both surfaces at one time
    assert [len(branch[corner.parameter + d].legs) for d in (-1e-3, 1e-3)] == [4, 4]
    top = event.orbit.trajectory(np.linspace(*event.orbit.trajectory.t[[0, -1]], 4001))[:, 1].max()
    assert abs(top - event.parameter) < 1e-5


def test_a_touch_of_one_of_two_surfaces_has_the_multipliers_of_both_sides(branch):
    event = branch.events[-1]
    numbers = event.coefficients
    assert event.kind == "grazing-sliding" and event.far_side.verdict == "persistence"
    errors = []
    for d in (1e-4, 1e-6):
        out, inside = branch[event.parameter + d], branch[event.parameter - d]
        assert (out.itinerary, inside.itinerary) == ("-- +-", "-- -s -- +-")
        assert np.abs(out.multipliers).max() == pytest.approx(numbers["radius of A_o"], abs=2e-5)
        assert abs(np.prod(1 - out.multipliers) - numbers["det(I - A_o)"]) < 20 * d
        errors.append(abs(np.abs(inside.multipliers).max() - numbers["radius of A_i"]))
    assert errors[1] < 0.2 * errors[0] < 1e-4  # as the root of the distance


def test_a_corner_has_the_multipliers_of_both_orders(branch):
    event = branch.events[0]
    assert event.kind == "corner" and event.far_side.verdict == "persistence"
    sides = [branch[event.parameter + d].multipliers for d in (-1e-7, 1e-7)]
    found = sorted(np.prod(1 - m).real for m in sides)
    stated = sorted(event.coefficients[f"det(I - A_{k})"] for k in "oi")
    assert np.abs(np.array(found) - stated).max() < 1e-6


def test_a_branch_gives_the_orbit_of_each_side_up_to_the_event(branch):
    """Beside a touch the orbit of the other itinerary is virtual; it is not what the system does."""
    event = branch.events[-1]
    for d in (1e-2, 1e-3, 1e-5, 1e-7, 1e-9):
        for sign, word in ((1, "-- +-"), (-1, "-- -s -- +-")):
            (orbit,) = branch.at(event.parameter + sign * d)
            assert orbit.itinerary == word and not orbit.is_virtual


@pytest.mark.slow
def test_doubled_orbits_between_two_doublings_are_followed_once():
    """A block on a belt, forced: the orbits of two periods begin and end at doublings of the single one."""
    b, A = symbols("b A")
    slip = V - b
    drive = A * ca.cos(1.3 * T) - X - 0.05 * V

    def pull(sign):
        return 0.6 * sign * (0.5 + 0.5 / (1 + 3 * sign * slip))

    system = ns.FilippovSystem(
        [X, V],
        surface=slip,
        above=[V, drive - pull(1)],
        below=[V, drive - pull(-1)],
        parameters={b: 0.4, A: 0.5},
        time=T,
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.3, 0.5], 600.0))
    branch = ns.continue_orbit(orbit, "A", bounds=(0.05, 3.0))
    # of the subcritical doubled orbits A falls, of those beyond it rises: they turn
    doubling, switching = "period doubling", "switching-sliding"
    assert kinds(branch) == [doubling, switching, "fold", switching, doubling]
    assert len(branch) < 100
    turn = branch.events[2]
    assert turn.parameter < branch.events[1].parameter
    assert np.abs(turn.orbit.multipliers - 1).min() < 1e-8
    assert branch.ends == (ns.orbit.BranchEnd.EVENT,) * 2
    ends = [event for event in branch.events if event.kind == "period doubling"]
    single = ns.continue_orbit(ends[0].orbit, "A", bounds=(0.4, 0.6))
    again = [event.parameter for event in single.events if event.kind == "period doubling"]
    assert sorted(again) == pytest.approx(sorted(e.parameter for e in ends), abs=1e-8)


@pytest.mark.slow
def test_a_symmetric_orbit_that_grazes_two_walls_at_once_is_not_classified():
    """A mass between two walls: where it touches one it touches the other half a period later."""
    F = ca.SX.sym("F")
    walls = [ns.Impact(1 - X, restitution=0.7, name="right")]
    walls += [ns.Impact(1 + X, restitution=0.7, name="left")]
    system = ns.FilippovSystem(
        [X, V], field=[V, F * ca.cos(T)], parameters={F: 1.0}, time=T, impacts=walls
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.3, 0.5], 200.0))
    branch = ns.continue_orbit(orbit, "F", bounds=(0.8, 1.5))
    event = max(branch.events, key=lambda e: e.parameter)
    assert event.kind == "impact grazing"
    assert "another event is grazed" in event.far_side.verdict and not event.coefficients


def peaked():
    """The velocity is highest where x - 0.3 is crossed: past a corner it crosses y - k before and after."""
    k, l1, l2 = symbols("k l1 l2")
    return ns.FilippovSystem(
        [X, V],
        surfaces=[X - 0.3, V - k],
        multipliers=[l1, l2],
        field=[-X + 2 * ca.cos(T) - 0.1 * l2, -V - 2 * l1 + 0.2 * l2 + 0.3 * X],
        time=T,
        parameters={k: 3.0},
    )


@pytest.mark.parametrize("k", [1.2, 2.0])
def test_a_corner_that_adds_legs_is_passed_from_either_side(k):
    """The branch continues in the itinerary that simulations have, and its multipliers jump as stated."""
    system = peaked()
    run = ns.simulate(system, [0.0, 0.0], 100.0, parameters={"k": k})
    branch = ns.continue_orbit(
        ns.periodic_orbit(system, run, parameters={"k": k}), "k", bounds=(1.0, 2.2)
    )
    assert branch.ends == (ns.orbit.BranchEnd.REACHED_BOUND, ns.orbit.BranchEnd.REACHED_BOUND)
    (event,) = branch.events
    assert event.kind == "corner" and event.far_side.verdict == "persistence"
    orbit = event.orbit.trajectory
    states = np.array([e.x for e in orbit.events])
    assert np.abs(states - [0.3, event.parameter]).max(axis=1).min() < 1e-9
    for side, legs, at in ((1, 2, "o"), (-1, 4, "i")):
        (near,) = branch.at(event.parameter + side * 1e-7)
        assert len(near.legs) == legs and not near.is_virtual
        stated = event.coefficients[f"det(I - A_{at})"]
        assert np.prod(1 - near.multipliers).real == pytest.approx(stated, abs=1e-6)
        far = event.parameter + side * 0.1
        other = ns.simulate(system, [0.0, 0.0], 100.0, parameters={"k": far})
        alike = ns.periodic_orbit(system, other, parameters={"k": far})
        assert sorted(alike.itinerary.split()) == sorted(branch[far].itinerary.split())
        assert (
            np.abs(
                np.sort(np.abs(alike.multipliers)) - np.sort(np.abs(branch[far].multipliers))
            ).max()
            < 1e-10
        )


def test_a_corner_beyond_which_nothing_is_known_names_its_events():
    """A reset is reached just where a surface is crossed: what comes first decides what the reset sees."""
    k, phase = symbols("k phase")
    system = ns.FilippovSystem(
        [X, phase],
        surface=X - k,
        above=[1.0, 1],
        below=[2.0, 1],
        resets=ns.Reset(phase - 1, [0.4 * X - 1, 0], 1, "tick"),
        parameters={k: 1.0},
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.0, 0.0], 60.0))
    branch = ns.continue_orbit(orbit, "k", bounds=(-1.0, 3.0))
    verdicts = [e.far_side.verdict for e in branch.events if e.kind == "corner"]
    assert verdicts and all("h0" in v and "tick" in v for v in verdicts), branch.events
