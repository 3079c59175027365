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

from ..independent import blocks
from ..independent.integrator import Run


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


def chain(k):
    """The chain of ``independent.blocks``."""
    force = lambda i, q, v, lam: (
        -blocks.SPRING * q - blocks.friction(k)[i] * lam + blocks.FALL * (v - blocks.BELT)
    )
    return row(k, force, blocks.BELT, blocks.COUPLING)


@pytest.mark.parametrize(
    "k",
    [
        1,
        pytest.param(2, marks=pytest.mark.slow),
        pytest.param(3, marks=pytest.mark.slow),
        pytest.param(4, marks=pytest.mark.slow),
    ],
)
def test_blocks_agree_with_an_independent_integrator(k):
    rng, t_end = np.random.default_rng(k), 15.0
    starts = np.hstack([rng.normal(size=(2, k)), rng.uniform(-0.5, 0.2, (2, k))])
    for start, path in zip(starts, Run(blocks.Blocks(starts), t_end).run(), strict=True):
        run = ns.simulate(chain(k), start, t_end, tol=1e-12)
        assert not path.trouble and run.itinerary == path.itinerary
        assert len(path.times) >= k
        assert np.abs(run.x[-1] - path.x).max() < 1e-9
        times = [event.t for event in run.events[:-1]]
        assert np.abs(np.array(times) - path.times).max() < 1e-9


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
