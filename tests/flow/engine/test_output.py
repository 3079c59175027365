"""What a run returns does not depend on the rooms in which it was written: those of earlier runs."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.engine import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


def relay():
    """A relay of a rotation, which crosses and slides."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    return ns.FilippovSystem([x, y], surface=y, above=[y, -x - 0.1], below=[y, -x + 0.1])


def described(run):
    """Points and steps as bytes."""
    return [a.tobytes() for a in (run.t, run.x, run.steps.starts, np.array(run.steps.coefficients))]


def test_rooms_of_an_earlier_run():
    start, system = [3.0, 0.0], relay()
    fresh = {t: ns.simulate(relay(), start, t, max_step=0.01) for t in (0.05, 5.0, 20.0)}
    for t in (20.0, 20.0, 0.05, 5.0, 20.0, 0.05, 20.0):  # grown, given, much too large, too small
        run = ns.simulate(system, start, t, max_step=0.01)
        assert described(run) == described(fresh[t])
        assert [e.t for e in run.events] == [e.t for e in fresh[t].events]


def test_a_short_run_does_not_keep_the_memory_of_a_long_one():
    system = relay()
    long = ns.simulate(system, [3.0, 0.0], 20.0, max_step=0.01)
    short = ns.simulate(system, [3.0, 0.0], 0.05, max_step=0.01)
    owner = short.steps.coefficients
    while isinstance(owner.base, np.ndarray):
        owner = owner.base
    assert owner.nbytes < long.steps.coefficients.nbytes / 16
