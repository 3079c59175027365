"""Every kind of guard has its condition in words, by its side; many legs are judged as each of them is."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.names import described
from nonsmooth.model import Guard
from nonsmooth.orbit.runs.guards import change_violation, violations_of_legs, watch
from nonsmooth.orbit.runs.legs import Leg, integrate_leg, leg_name


@pytest.mark.parametrize(
    ("guard", "words"),
    [
        (Guard("surface", 0, 1, 0), "h0 > 0"),
        (Guard("surface", 1, -1, 1), "h1 < 0"),
        (Guard("exit", 0, 1, 0), "lambda0 <= 1"),
        (Guard("exit", 0, -1, 0), "lambda0 >= -1"),
        (Guard("exit", 1, 1, 1), "lambda1 <= 1"),
        (Guard("exit", 1, -1, 1), "lambda1 >= -1"),
        (Guard("impact", 0, 1, 2), "the gap of 'floor' >= 0"),
        (Guard("release", 0, 0, 2), "the reaction of 'floor' >= 0"),
        (Guard("stop", 0, 1, 0), "end"),
    ],
)
def test_a_guard_is_described_by_its_condition(guard, words):
    x, v, lam, kap = (ca.SX.sym(name) for name in ("x", "v", "lam", "kap"))
    system = ns.FilippovSystem(
        [x, v],
        surfaces=[v, v - 1],
        multipliers=[lam, kap],
        field=[v, -lam - kap],
        stops=[ns.Stop(x - 9, name="end")],
        impacts=[ns.Impact(x, name="floor")],
    )
    assert described(system, guard) == words


def test_legs_are_judged_together_as_one_by_one():
    """A swing above and below y = 0, of which some legs pass it, begin beyond it, or have no duration."""
    x, y, v = (ca.SX.sym(name) for name in ("x", "y", "v"))
    system = ns.FilippovSystem(
        [x, y, v],
        surface=y,
        above=[1, v, -y - 0.2],
        below=[1, v, 0.2 - y],
        stops=ns.Stop(x - 7.5, 1, "out"),
    )
    legs = [
        Leg("+", "crossing", 0, 1),
        Leg("-", "crossing", 0, -1),
        Leg("+", "crossing", 0, 1),
        Leg("-", "crossing", 0, -1),
        Leg("+"),
    ]
    starts = np.array([[0, 0.2, 0.7], [7, -0.3, 0], [0, 0.0, 1], [0, 0.1, -1], [0, 1, 0.0]])
    durations, p = np.array([5.0, 1.0, 2.6, 0.0, 9.0]), np.zeros(0)
    ends = [
        integrate_leg(system, leg, s, d, p)
        for leg, s, d in zip(legs, starts, durations, strict=True)
    ]
    speeds = np.array([end.rate[1] * (-1) ** i for i, end in enumerate(ends)])
    expected = []
    for i, leg in enumerate(legs):
        if durations[i] <= 0.0:
            expected.append(f"leg {i + 1} {leg_name(system, leg)} has the duration 0")
            continue
        found = watch(system, leg, starts[i], durations[i], p).violations
        j = (i + 1) % len(legs)
        violation = change_violation(system, leg, legs[j].mode, ends[i].end, starts[j], p)
        found += [violation] if violation else []
        expected += [f"leg {i + 1} {leg_name(system, leg)}: {violation}" for violation in found]
    together = violations_of_legs(system, legs, starts, durations, speeds, p, True)
    assert together == expected and len(together) >= 5
    assert sum("is violated" in violation for violation in together) >= 1
    assert sum("begins after it" in violation for violation in together) >= 1
    assert (
        sum("'out' reaches zero" in violation for violation in together) == 2
    )  # from 7 to 8, and from 0 to 9


@pytest.mark.parametrize("kind", ["stop", "reset"])
@pytest.mark.parametrize("duration", [1.0, 3.0, 40.0])
def test_what_is_passed_inside_a_step_is_seen(kind, duration):
    """x - 0.9 rises all along a leg of one step, x = t or of many: it has no extremum and one zero."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    given = (
        {"stops": ns.Stop(x - 0.9, 1, "out")}
        if kind == "stop"
        else {"resets": ns.Reset(x - 0.9, [0, y], 1, "out")}
    )
    turn = ca.sin(y) if duration > 3 else 0  # many steps
    system = ns.FilippovSystem(
        [x, y], surface=y + 99, above=[1, 1 + 0.1 * turn], below=[1, 1 + 0 * y], **given
    )
    p = np.zeros(0)
    (violation,) = watch(system, Leg("+"), np.array([0.0, 0.0]), duration, p).violations
    assert violation.startswith(f"{kind} 'out' reaches zero ")
    assert watch(system, Leg("+"), np.array([0.91, 0.0]), duration, p).violations == []
    late = np.array([0.9 - duration, 0.0])  # zero at the very end, as the guard that ends the leg
    assert watch(system, Leg("+"), late, duration, p).violations == []
    assert watch(system, Leg("+"), np.array([0.9, 0.0]), duration, p).violations == []
