"""Dense output is as accurate as the steps, everywhere, and refuses times outside the run."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.trajectory import Steps

x, y, lam = (ca.SX.sym(s) for s in ("x", "y", "lam"))
SYSTEM = ns.FilippovSystem([x, y], field=[y, -x - 0.4 * lam], multipliers=lam, surface=y)


def exact(times):
    """Dry friction from (3, 0): half periods around -+0.4 with amplitudes falling by 0.8."""
    half = np.minimum((times // np.pi).astype(int), 4)
    s = times - half * np.pi
    centre = np.where(half % 2 == 0, 0.4, -0.4)
    start = np.array([3.0, -2.2, 1.4, -0.6, -0.2])[half]
    radius = start - centre
    position = np.where(half == 4, -0.2, centre + radius * np.cos(s))
    speed = np.where(half == 4, 0.0, -radius * np.sin(s))
    return np.stack([position, speed], axis=-1)


@pytest.mark.parametrize("tol", [1e-4, 1e-7, 1e-10, 1e-13])
def test_dense_output_is_accurate_to_the_tolerance_everywhere(tol):
    run = ns.simulate(SYSTEM, [3.0, 0.0], 15.0, tol=tol)
    times = np.linspace(0.0, 15.0, 2001)
    assert np.abs(run(times) - exact(times)).max() < 20 * tol + 1e-13


def test_shapes_follow_the_times():
    run = ns.simulate(SYSTEM, [3.0, 0.0], 15.0)
    assert run(1.0).shape == (2,)
    assert run([[1.0, 2.0, 3.0]]).shape == (1, 3, 2)
    assert run([]).shape == (0, 2)


def test_dense_output_meets_the_nodes_and_the_events():
    run = ns.simulate(SYSTEM, [3.0, 0.0], 15.0, tol=1e-12)
    np.testing.assert_allclose(run(run.t), run.x, atol=1e-11)
    for e in run.events:
        np.testing.assert_allclose(run(e.t), e.x, atol=1e-11)


def test_segments_tile_the_run():
    run = ns.simulate(SYSTEM, [3.0, 0.0], 15.0)
    assert " ".join(s.mode for s in run.segments) == run.itinerary
    assert run.segments[0].t_start == 0.0 and run.segments[-1].t_end == 15.0
    for a, b in zip(run.segments, run.segments[1:], strict=False):
        assert a.t_end == b.t_start and a.last == b.first


@pytest.mark.parametrize("time", [-0.1, 15.1])
def test_times_outside_the_run_are_refused_with_its_status(time):
    run = ns.simulate(SYSTEM, [3.0, 0.0], 15.0)
    with pytest.raises(ns.PointError, match=r"^time .*\[0.0, 15.0\].*REACHED_END"):
        run(time)


def test_the_representation_fits_a_line():
    text = repr(ns.simulate(SYSTEM, [300.0, 0.0], 3000.0))
    assert "events" in text and "REACHED_END" in text and len(text) < 150


def by_hand(steps, t, n, forward, side):
    """States at one time by Horner's scheme in numbers of Python, as the definition of a step says."""
    sign, starts = (1 if forward else -1), steps.starts.tolist()
    before = [sign * s <= sign * t if side == "right" else sign * s < sign * t for s in starts]
    k = max(sum(before) - 1, 0)
    found = []
    for row in np.asarray(steps.coefficients[k])[:n].tolist():
        value = row[-1]
        for c in row[-2::-1]:
            value = value * (t - starts[k]) + c
        found.append(value)
    return found


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("forward", [True, False])
@pytest.mark.parametrize("orders", [[9], [9, 4, 9, 0, 1]])
def test_steps_are_read_to_the_last_bit(orders, forward, side):
    """One array where all steps have one order, or a list of polynomials of several lengths."""
    rng, sign = np.random.default_rng(3), 1 if forward else -1
    starts = sign * np.repeat(np.cumsum(rng.uniform(0.01, 1.0, 20)), rng.integers(1, 3, 20))
    rows = [rng.normal(size=(3, orders[k % len(orders)] + 1)) for k in range(len(starts))]
    steps = Steps(starts, np.array(rows) if len(orders) == 1 else rows)
    low, high = sorted((starts[0], starts[-1]))
    times = rng.permutation(np.concatenate([rng.uniform(low - 1, high + 1, 3000), starts, starts]))
    found = steps.at(times, 2, forward, side)
    assert found.tolist() == [by_hand(steps, t, 2, forward, side) for t in times.tolist()]


def test_steps_without_times():
    assert Steps(np.zeros(1), np.ones((1, 2, 4))).at(np.zeros(0), 2).shape == (0, 2)
    assert Steps(np.zeros(1), [np.ones((2, 4))]).at(np.zeros(0), 2).shape == (0, 2)
