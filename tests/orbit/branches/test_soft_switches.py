"""Orbits that begin to touch a surface on which nothing slides: the branch goes through, as closed forms say."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.orbit.periodic_cases import cases_of

CASES = cases_of("cases/continuous_switching.json")
x, v, t, size, l1, l2 = (ca.SX.sym(n) for n in ("x", "v", "t", "A", "l1", "l2"))
TOUCH = float(CASES["soft_touch"]["values"]["A_touch"])
FREE = size * ca.cos(0.8 * t) - 0.1 * v - x


def stop(force, amplitude=0.2):
    return ns.FilippovSystem(
        [x, v],
        surface=x - 1,
        above=[v, FREE - force],
        below=[v, FREE],
        parameters={size: amplitude},
        time=t,
    )


def multipliers_of(text):
    values = text if isinstance(text, list) else [text]
    return np.sort_complex([complex(s.replace(" ", "").replace("i", "j")) for s in values])


STOPS = {
    "soft_1e-2": 5 * (x - 1),
    "dashpot_1e-2": 5 * (x - 1) + 0.5 * v,
    "quadratic_stop_1e-4": 5 * (x - 1) ** 2,
}


@pytest.mark.parametrize("name", STOPS)
def test_a_branch_goes_through_the_touch_of_a_soft_stop(name):
    true = CASES[name]["values"]
    amplitude = float(true["A"])
    orbit = ns.periodic_orbit(stop(STOPS[name]), [0.0, 0.0])
    branch = ns.continue_orbit(orbit, "A", bounds=(0.2, amplitude))
    assert [event.kind for event in branch.events] == ["grazing of a soft switch"]
    assert branch.events[0].parameter == pytest.approx(TOUCH, abs=1e-13)
    (found,) = branch.at(amplitude)
    assert found.itinerary == "- +"
    outside = [float(d) for d in true["durations"]]  # from inside the free leg
    times = sorted(found.evaluation.durations)
    assert times == pytest.approx([outside[1], outside[0] + outside[2]], abs=1e-9)
    expected = multipliers_of(true["multipliers"])
    np.testing.assert_allclose(np.sort_complex(found.multipliers), expected, atol=1e-8)


def test_the_other_way_the_visits_end():
    system = stop(STOPS["soft_1e-2"], 0.385)
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.0, 0.0], 400.0))
    branch = ns.continue_orbit(orbit, "A", bounds=(0.3, 0.39))
    assert [event.kind for event in branch.events] == ["grazing of a soft switch"]
    assert branch.events[0].parameter == pytest.approx(TOUCH, abs=1e-13)
    assert [branch.at(a)[0].itinerary for a in (0.3, 0.38)] == ["-", "- +"]


@pytest.mark.parametrize("symmetry", [None, "odd"])
def test_two_walls_are_touched_at_once(symmetry):
    true = CASES["gap_1e-4"]["values"]
    force = 5 * ((x - 1) * (1 + l1) / 2 + (x + 1) * (1 - l2) / 2)
    gap = ns.FilippovSystem(
        [x, v],
        field=[v, FREE - force],
        surfaces=[x - 1, x + 1],
        multipliers=[l1, l2],
        parameters={size: 0.2},
        time=t,
    )
    amplitude = float(true["A"])
    orbit = ns.periodic_orbit(gap, [0, 0], symmetry=symmetry)
    branch = ns.continue_orbit(orbit, "A", bounds=(0.2, amplitude))
    assert [event.kind for event in branch.events] == ["grazing of a soft switch"]
    expected = multipliers_of(true["multipliers"])
    found = np.sort_complex(branch.at(amplitude)[0].multipliers)
    np.testing.assert_allclose(found, expected, atol=5e-8)  # a touch is near: dA is like d^2


def test_a_jerk_system_beside_its_closed_form():
    """At 0.594 two crossings vanish, at 0.654 the period doubles."""
    y, z, a = (ca.SX.sym(n) for n in "yza")
    jerk = ns.FilippovSystem(
        [x, y, z],
        surface=x,
        above=[y, z, -a * z - y + x - 1],
        below=[y, z, -a * z - y - x - 1],
        parameters={a: 0.61},
    )
    below, doubling = CASES["jerk_below"], CASES["jerk_pd2"]["values"]
    at = float(below["values"]["a"])
    start = [float(s) for s in below["start"]]
    orbit = ns.periodic_orbit(jerk, start, parameters={"a": at})
    expected = np.sort([float(m) for m in below["values"]["multipliers"]])
    np.testing.assert_allclose(np.sort(orbit.multipliers.real), expected, atol=1e-8)
    branch = ns.continue_orbit(orbit, "a", bounds=(0.58, 0.66))
    kinds = [event.kind for event in branch.events]
    assert kinds == ["grazing of a soft switch", "period doubling"]
    assert branch.events[0].parameter == pytest.approx(0.594094020240618708, abs=1e-12)
    doubled = branch.events[1]
    assert doubled.parameter == pytest.approx(float(doubling["a"]), abs=1e-10)
    times = sorted(doubled.solution.evaluation.durations)
    assert times == pytest.approx(sorted(map(float, doubling["durations"])), abs=1e-8)


@pytest.mark.parametrize(
    ("jump", "kind", "words"),
    [(0.2, "grazing of a jumping force", "square root"), (-3.0, "grazing, escaping", "")],
)
def test_a_force_that_jumps_at_the_wall_ends_the_orbit(jump, kind, words):
    """A preload, and a pull of 3 to the other side where the free block is pulled back with 1.12."""
    orbit = ns.periodic_orbit(stop(5 * (x - 1) + jump), [0.0, 0.0])
    event = ns.continue_orbit(orbit, "A", bounds=(0.2, 0.4)).events[0]
    assert event.kind == kind and words in event.far_side.verdict
    assert event.parameter == pytest.approx(TOUCH, abs=1e-13)
