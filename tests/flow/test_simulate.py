"""The interpreter runs at once; a long run is worth a program of its own."""

import re
from importlib import import_module

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.compiled import Engine, TapeEngine, find_compiler

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
def engines(monkeypatch):
    """Which engines have run."""
    ran = []
    for kind in (Engine, TapeEngine):

        def watched(self, *arguments, original=kind.run):
            ran.append(type(self).__name__)
            return original(self, *arguments)

        monkeypatch.setattr(kind, "run", watched)
    return ran


@pytest.mark.parametrize(
    ("long", "expected"), [(20_000, ["TapeEngine"]), (100, ["TapeEngine", "Engine"])]
)
def test_which_engine_runs(long, expected, engines, monkeypatch):
    monkeypatch.setattr(import_module("nonsmooth.flow.simulate"), "_LONG", long)
    run = ns.simulate(chain(2), np.full(4, 0.2), 2.0, max_step=0.01, tol=1e-8)
    assert run.status is ns.Status.REACHED_END and len(run.t) > 200
    assert engines == expected


def test_limits_of_steps_are_those_of_the_whole_run(engines, monkeypatch):
    monkeypatch.setattr(import_module("nonsmooth.flow.simulate"), "_LONG", 20)
    run = ns.simulate(chain(2), np.full(4, 0.2), 2.0, max_step=0.01, tol=1e-8, max_steps=50)
    assert run.status is ns.Status.TOO_MANY_STEPS and len(run.steps.starts) == 50


@pytest.mark.parametrize("engine", ["reference", "auto", "compiled"])
@pytest.mark.parametrize(("start", "mode"), [(1.0, "-"), (-1.0, "+"), (1.0, "s")])
def test_a_start_mode_on_another_side_than_the_point_is_refused(engine, start, mode):
    x = ca.SX.sym("x")
    system = ns.FilippovSystem([x], surface=x, above=[-1], below=[3])
    side = "+" if start > 0 else "-"
    message = re.escape(f"h0 = {start:g} ({side!r}), received {mode!r}")
    with pytest.raises(ns.OptionError, match=message):
        ns.simulate(system, [start], t_end=1.0, start_mode=mode, engine=engine)
    assert ns.simulate(system, [start], t_end=0.1, start_mode=side).status == 0
