"""Ctrl-C is heard wherever it comes: searches, runs and bounces end with it and with nothing else.

Python looks for signals when a function begins and when a call of C returns. Each work is repeated
with an interrupt at one of these places, chosen by its number and not by the clock.
"""

import inspect
import sys

import casadi as ca
import numpy as np
import pytest

import bounce
import nonsmooth as ns

x, y, z, lam, kap = (ca.SX.sym(s) for s in ("x", "y", "z", "lam", "kap"))

HIDDEN = ns.FilippovSystem(
    [x, y], field=[-lam + 0.2, 2 * lam**2 - 1], multipliers=lam, surface=x, hidden=True
)
BILINEAR = ns.FilippovSystem(
    [x, y],
    field=[-lam + 0.2 * lam * kap + 0.1, -kap + 0.2 * lam],
    multipliers=[lam, kap],
    surfaces=[x, y],
)
FOLD = ns.FilippovSystem([x, y, z], surface=x, above=[-y, 1, 2], below=[z, 3, 4])
PENDULUM = ns.FilippovSystem([x, y], field=[y, -ca.sin(x)], resets=[ns.Reset(x, [x, -0.9 * y], -1)])
SMOOTH = ns.FilippovSystem([x, y], surface=y + 9, above=[y, -ca.sin(x)], below=[y, 1])
NET = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.0, eta=0.5, G=0.01, load="net")

WORKS = {
    "a search for multipliers": lambda: ns.local.sliding_branches(HIDDEN, [0.0, 0.0]),
    "hidden sliding": lambda: ns.simulate(HIDDEN, [0.01, 0.0], 0.03),
    "an intersection": lambda: ns.simulate(BILINEAR, [0.01, 0.01], 0.05),
    "resets": lambda: ns.simulate(PENDULUM, [0.1, 0.0], 2.0),
    "a two-fold": lambda: ns.find_two_fold(FOLD, [0.01, 0.02, 0.03]),
    "a point": lambda: ns.classify(FOLD, [0.0, 0.1, 0.2]),
    "a sliding field": lambda: ns.sliding_field(FOLD, [0.0, 0.1, 0.2]),
    "an equilibrium": lambda: ns.find_equilibrium(SMOOTH, [0.1, 0.2], mode="+"),
    "one bounce": lambda: bounce.simulate(NET, 0.3, -1.0, 0.1),
    "many bounces": lambda: bounce.lift_off(NET, np.linspace(0.1, 0.3, 9), -1.0, 0.1),
}


class Profile:
    """Counts the places where Python hears a signal, and interrupts at one of them."""

    def __init__(self, at=None):
        self.at, self.count = at, 0

    def __call__(self, frame, event, argument):
        # A generator that is closed hears nothing; neither does what this test itself calls.
        if event not in ("call", "c_return") or frame.f_code.co_flags & inspect.CO_GENERATOR:
            return
        self.count += 1
        if self.count == self.at:
            sys.setprofile(None)
            raise KeyboardInterrupt

    def run(self, work):
        sys.setprofile(self)
        try:
            work()
        finally:
            sys.setprofile(None)


@pytest.mark.slow_cases("an intersection")
@pytest.mark.parametrize("name", WORKS)
def test_an_interrupt_is_raised_at_every_point(name):
    work = WORKS[name]
    for _ in range(2):  # what is built once is not looked at
        work()
    counted = Profile()
    counted.run(work)
    points = np.unique(np.linspace(2, counted.count - 4, 25).astype(int))
    for at in points.tolist():
        with pytest.raises(KeyboardInterrupt):
            Profile(at).run(work)
    work()


@pytest.mark.parametrize("name", WORKS)
def test_no_array_is_converted_by_casadi(name):
    """CasADi does it by Python code that it calls from C++, where an interrupt is lost."""
    work, found = WORKS[name], []

    def look(frame, event, argument):
        if event == "call" and frame.f_code.co_name in ("DM_from_array", "IM_from_array"):
            found.append(frame.f_back.f_code.co_name)

    work()
    sys.setprofile(look)
    try:
        work()
    finally:
        sys.setprofile(None)
    assert found == []


def test_the_way_that_loses_interrupts_does_lose_them():
    """What the tests above look for is there, as long as this one holds."""
    function = ca.Function("f", [x], [x**2])

    def work():
        for _ in range(20):
            function(np.array([[2.0, 3.0]]))

    work()
    counted = Profile()
    counted.run(work)
    outcomes = set()
    for at in range(2, counted.count - 4, 3):
        try:
            Profile(at).run(work)
            outcomes.add("lost")
        except KeyboardInterrupt:
            outcomes.add("heard")
        except Exception as error:
            outcomes.add(type(error).__name__)
    assert outcomes - {"heard"}
