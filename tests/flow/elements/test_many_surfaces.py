"""Blocks on a belt, each with a friction surface: up to four against an independent integrator, more by their
symmetry."""

import itertools
import sys

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.engine import interpreter_for
from nonsmooth.flow.options import Options

from ..independent.hybrid import Problem, follow, package_system
from ..random_systems import package_events


def row(k, force, belt=0.0, coupling=1.0, **others):
    """Blocks in a row, joined by springs, each with a force of its place, speed and multiplier, and a surface."""
    q, v, lam = (ca.SX.sym(name, k) for name in ("q", "v", "lam"))
    joined = [coupling * sum(q[j] - q[i] for j in (i - 1, i + 1) if 0 <= j < k) for i in range(k)]
    return ns.FilippovSystem(
        [*ca.vertsplit(q), *ca.vertsplit(v)],
        field=[*ca.vertsplit(v), *[force(i, q[i], v[i], lam[i]) + joined[i] for i in range(k)]],
        surfaces=[v[i] - belt for i in range(k)],
        multipliers=ca.vertsplit(lam),
        **others,
    )


def chain(k, start):
    """Blocks with friction of 1, 1.2, ... on a belt."""
    v = [f"v{i}" for i in range(k)]
    forces = [
        f"-0.1*q{i}-{1 + i / 5}*l{i}+0.1*(v{i}-0.3)"
        + "".join(f"+q{j}-q{i}" for j in (i - 1, i + 1) if 0 <= j < k)
        for i in range(k)
    ]
    states, surfaces = [*[f"q{i}" for i in range(k)], *v], [f"v{i}-0.3" for i in range(k)]
    return Problem(states, [*v, *forces], start.tolist(), 15.0, surfaces)


@pytest.mark.parametrize("k", [1, *[pytest.param(k, marks=pytest.mark.slow) for k in (2, 3, 4)]])
def test_blocks_agree_with_an_independent_integrator(k):
    rng = np.random.default_rng(k)
    for start in np.hstack([rng.normal(size=(2, k)), rng.uniform(-0.5, 0.2, (2, k))]):
        problem = chain(k, start)
        exact, run = follow(problem), ns.simulate(package_system(problem), start, 15.0, tol=1e-12)
        events = package_events(run, problem)
        assert not exact.trouble and len(events) >= k
        assert [own[1:] for own in events] == [own[1:] for own in exact.events]
        assert np.abs(run.x[-1] - exact.x).max() < 1e-9
        late = [one[0] - two[0] for one, two in zip(events, exact.events, strict=True)]
        assert np.abs(late).max() < 1e-9


def test_a_long_chain_keeps_its_symmetry():
    """Equal blocks that start at rest in a mirror image of themselves stay one, event by event."""
    k = 12
    system = row(k, lambda i, q, v, lam: -0.1 * q - lam, 0.3)
    half = 0.1 * np.array([3.0, 1.0, 4.0, 1.0, 5.0, 9.0])
    run = ns.simulate(system, [*half, *half[::-1], *[0.0] * k], 30.0)
    assert run.status is ns.Status.REACHED_END and len(run.events) > 5
    q_end, v_end = run.x[-1, :k], run.x[-1, k:]
    np.testing.assert_allclose(q_end, q_end[::-1], atol=1e-9)
    np.testing.assert_allclose(v_end, v_end[::-1], atol=1e-9)


def forced_chain(k):
    """Blocks that are pushed in time, with a friction that depends on where they are."""
    t = ca.SX.sym("t")
    return row(k, lambda i, q, v, lam: 0.1 * ca.sin(t + i) - (1 + 0.2 * ca.tanh(q)) * lam, time=t)


def test_a_program_is_generated_in_proportion_to_its_graph():
    """Counted in calls of functions: twice the blocks, twice the work."""
    work = {}
    for k in (2, 15, 30, 60):  # the first one fills caches
        system = forced_chain(k)
        calls = itertools.count()
        sys.setprofile(lambda frame, event, _, calls=calls: "call" in event and next(calls))
        try:
            interpreter_for(system, Options(t_end=1.0))
        finally:
            sys.setprofile(None)
        work[k] = next(calls)
    assert work[30] < 2.2 * work[15] and work[60] < 2.2 * work[30]
