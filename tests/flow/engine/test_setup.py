"""What a large system costs before its first step grows as the system, not as its square."""

import sys

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.engine import interpreter_for
from nonsmooth.flow.options import Options
from nonsmooth.model import driven_of
from nonsmooth.model.expressions import graph
from nonsmooth.model.printing.instructions import derived_series_of, instructions_of


def lattice(size):
    """Oscillators in a row, of which the first meets a surface."""
    u, v = ca.SX.sym("u", size), ca.SX.sym("v", size)
    left, right = ca.vertcat(0, u[:-1]), ca.vertcat(u[1:], 0)
    rest = ca.vertcat(v, left + right - 2 * u - ca.sin(u) - 0.1 * (u - left) ** 3)
    push = ca.DM.zeros(2 * size)
    push[size] = 0.5
    states = [*ca.vertsplit(u), *ca.vertsplit(v)]
    return ns.FilippovSystem(states, surface=v[0] - 0.3, above=rest - push, below=rest + push)


def blocks(size):
    """Blocks in a row with a friction surface each."""
    q, v, lam = (ca.SX.sym(name, size) for name in ("q", "v", "lam"))
    left, right = ca.vertcat(0, q[:-1]), ca.vertcat(q[1:], 0)
    force = left + right - 2.1 * q - (1 + 0.3 * np.sin(np.arange(size))) * lam + 0.1 * v
    return ns.FilippovSystem(
        [*ca.vertsplit(q), *ca.vertsplit(v)],
        field=[*ca.vertsplit(v), *ca.vertsplit(force)],
        surfaces=[v[i] - 0.3 for i in range(size)],
        multipliers=ca.vertsplit(lam),
    )


def network(size):
    """A dense network."""
    x, weights = ca.SX.sym("x", size), np.random.default_rng(0).normal(size=(size, size))
    rest, push = -x + ca.mtimes(ca.DM(weights), ca.tanh(x)), ca.DM.zeros(size)
    push[0] = 0.3
    return ns.FilippovSystem(x, surface=x[0] - 0.2, above=rest - push, below=rest + push)


def calls(work):
    """How many functions of Python and C are called."""
    count = 0

    def seen(frame, event, argument):
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(seen)
    try:
        work()
    finally:
        sys.setprofile(None)
    return count


def test_calls_grow_as_the_number_of_surfaces():
    interpreter_for(blocks(3), Options(t_end=1.0))
    one, four = (
        calls(lambda n=n: interpreter_for(blocks(n), Options(t_end=1.0))) for n in (30, 120)
    )
    assert four < 4.2 * one


@pytest.mark.parametrize(("make", "times"), [(lattice, 9), (blocks, 9), (network, 1.6)])
def test_graphs_are_read_a_few_times(make, times, monkeypatch):
    """The nodes that set-up reads are a multiple of those of the field, whatever the number of rows."""
    read, linear, found = graph._read, ca.is_linear, []
    system = make(60)
    d = system.definition
    own = ca.Function("field", [d.states, d.multipliers], [d.field]).n_instructions()
    monkeypatch.setattr(
        graph, "_read", lambda f, merged: found.append(f.n_instructions()) or read(f, merged)
    )
    monkeypatch.setattr(ca, "is_linear", lambda *args: found.append(own) or linear(*args))
    interpreter_for(system, Options(t_end=1.0))
    assert sum(found) < times * own


def test_without_sliding_derivatives_have_series_of_the_field_alone():
    """Of Lorenz's field the derivatives are the states, constants and 28 - z: one rule more."""
    x, y, z = (ca.SX.sym(name) for name in "xyz")
    above, below = ([10 * (y - x), x * (28 - z) - y, x * y - z + push] for push in (-2, 2))
    of = driven_of(ns.FilippovSystem([x, y, z], surface=x, above=above, below=below))
    plain, derived = instructions_of(of).free, derived_series_of(of)[1]
    assert len(derived.lists["later"]) <= len(plain.lists["later"]) + 3
