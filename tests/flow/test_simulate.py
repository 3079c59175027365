"""Long runs are compiled, short ones are not, and large systems have to be long to be worth it."""

import re
from importlib import import_module

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.compiled import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


def chain(n):
    """Pendulums in a row, the first rubbing on a belt."""
    u, v = ca.SX.sym("u", n), ca.SX.sym("v", n)
    left, right = ca.vertcat(0, u[:-1]), ca.vertcat(u[1:], 0)
    pull = left + right - 2 * u - ca.sin(u) - 0.1 * (u - left) ** 3
    rest, push = ca.vertcat(v, pull), ca.DM.zeros(2 * n)
    push[n] = 0.5
    states = ca.vertsplit(ca.vertcat(u, v))
    return ns.FilippovSystem(states, surface=v[0] - 0.3, above=rest - push, below=rest + push)


@pytest.fixture
def compiled_runs(monkeypatch):
    module = import_module("nonsmooth.flow.simulate")  # the package's name is the function
    runs, original = [], module.simulate_arrays

    def watched(*arguments):
        runs.append(arguments)
        return original(*arguments)

    monkeypatch.setattr(module, "simulate_arrays", watched)
    return runs


@pytest.mark.parametrize(("n", "steps", "compiled"), [(2, 200, 0), (2, 500, 1), (8, 500, 0)])
def test_which_engine_runs(n, steps, compiled, compiled_runs):
    run = ns.simulate(chain(n), np.full(2 * n, 0.2), 0.01 * steps, max_step=0.01, tol=1e-8)
    assert run.status is ns.Status.REACHED_END and len(run.t) > steps
    assert len(compiled_runs) == compiled


@pytest.mark.parametrize("engine", ["reference", "compiled"])
@pytest.mark.parametrize(("start", "mode"), [(1.0, "-"), (-1.0, "+"), (1.0, "s")])
def test_a_start_mode_on_another_side_than_the_point_is_refused(engine, start, mode):
    x = ca.SX.sym("x")
    system = ns.FilippovSystem([x], surface=x, above=[-1], below=[3])
    side = "+" if start > 0 else "-"
    message = re.escape(f"h0 = {start:g} ({side!r}), received {mode!r}")
    with pytest.raises(ns.OptionError, match=message):
        ns.simulate(system, [start], t_end=1.0, start_mode=mode, engine=engine)
    assert ns.simulate(system, [start], t_end=0.1, start_mode=side).status == 0
