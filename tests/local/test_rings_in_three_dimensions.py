"""With higher-order terms every class still does what its table row says, by integration.

Two independent ways: the event-driven simulator from a ring in attracting sliding, and fixed-step
Runge-Kutta of the desingularised sliding flow dx/dr = L2 F1 - L1 F2, dt/dr = L2 - L1, which is
smooth through the two-fold, in both directions of time.
"""

import math

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.local import find_two_fold
from tests.local.two_folds.test_classification import ANGLES, EXAMPLES, VV

RADIUS = 0.02
QUADRATIC = np.random.default_rng(7).normal(size=(2, 3, 3, 3)) * 0.5

CASES = [EXAMPLES[k][:3] for k in (0, 1, 2, 5, 6, 9, 10, 11, 12, 13, 14, 16)]


def fields(sigma, nu, x):
    """Normal form plus quadratic terms; x (3, k)."""
    f1 = np.array([-x[1], np.full(x.shape[1], -sigma[0]), np.full(x.shape[1], nu[0])])
    f2 = np.array([x[2], np.full(x.shape[1], nu[1]), np.full(x.shape[1], sigma[1])])
    terms = np.einsum("fabc,bk,ck->fak", QUADRATIC, x, x)
    return f1 + terms[0], f2 + terms[1]


def system(sigma, nu):
    x = ca.vertcat(*(ca.SX.sym(s) for s in "xyz"))
    f = [ca.vertcat(-x[1], -sigma[0], nu[0]), ca.vertcat(x[2], nu[1], sigma[1])]
    for k in (0, 1):
        f[k] += ca.vertcat(*(ca.mtimes([x.T, ca.DM(QUADRATIC[k, a]), x]) for a in range(3)))
    return ns.FilippovSystem(ca.vertsplit(x), surface=x[0], above=f[0], below=f[1])


def desingularised(sigma, nu, starts, direction):
    """Follow starts (k, 3) in Da; how each ends, its closest approach to s and its time."""
    x, time = np.array(starts).T.copy(), np.zeros(len(starts))
    end = np.full(len(starts), "", dtype="<U3")
    closest = np.linalg.norm(x, axis=0)

    def rate(y):
        f1, f2 = fields(sigma, nu, y)
        return direction * (f2[0] * f1 - f1[0] * f2), direction * (f2[0] - f1[0])

    step = 0.05
    for _ in range(4000):
        go = end == ""
        if not go.any():
            return end, closest, time
        y = x[:, go]
        k1, t1 = rate(y)
        k2, t2 = rate(y + step / 2 * k1)
        k3, t3 = rate(y + step / 2 * k2)
        k4, t4 = rate(y + step * k3)
        x[:, go] = y + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        time[go] += step / 6 * (t1 + 2 * t2 + 2 * t3 + t4)
        f1, f2 = fields(sigma, nu, x)
        radius = np.linalg.norm(x, axis=0)
        closest = np.minimum(closest, radius)
        crossed = (("s", radius < 1e-7 * RADIUS), ("z2", f1[0] >= 0), ("z3", f2[0] <= 0),
               ("far", radius > 6 * RADIUS))  # fmt: skip
        for name, here in crossed:
            end[go & here & (end == "")] = name
    raise AssertionError("no end")


def survey(fold, sigma, nu, direction):
    """Number of the ring's orbits that reach s, slopes of isolated ones, and the times."""

    def follow(angles):
        z = RADIUS * np.column_stack([np.cos(angles), np.sin(angles)])
        return desingularised(sigma, nu, fold.point_at(z), direction)

    end, _, time = follow(ANGLES)
    isolated = []
    for k in range(119):
        if end[k] != end[k + 1] and "s" not in (end[k], end[k + 1]):
            a, b = ANGLES[k], ANGLES[k + 1]
            for _ in range(5):
                parts = np.linspace(a, b, 41)
                j = int(np.argmax(follow(parts)[0] != end[k]))
                a, b = parts[j - 1], parts[j]
            if follow(np.array([a, b]))[1].min() < 0.5 * RADIUS:
                isolated.append(math.tan(a))
    return end == "s", isolated, time


@pytest.mark.slow_cases("sigma3-nu3-II-C", "sigma7-nu7-mix-S", "sigma11-nu11-mix-S")
@pytest.mark.parametrize(("sigma", "nu", "label"), CASES)
def test_desingularised_sliding_flow(sigma, nu, label):
    fold = find_two_fold(system(sigma, nu), [0.01, -0.02, 0.015])
    assert fold.label == label
    np.testing.assert_allclose(fold.nu, nu, atol=1e-12)
    both = ((1, fold.classification.into), (-1, fold.classification.out_of))
    for direction, slopes in both:
        reached, isolated, time = survey(fold, sigma, nu, direction)
        predicted = np.array([slopes.contains(math.tan(a)) for a in ANGLES])
        # the edge of a sector moves by O(radius)
        assert np.sum(reached != predicted) <= 4
        assert len(isolated) == (slopes.kind == "one")
        if isolated:
            assert isolated[0] == pytest.approx(slopes.low, rel=20 * RADIUS)
        z = RADIUS * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
        both_reach = reached & predicted
        expected = fold.reach_time(z)[both_reach]
        np.testing.assert_allclose(time[both_reach], expected, rtol=20 * RADIUS)


@pytest.mark.parametrize("every", [24, pytest.param(10, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("sigma", "nu", "label"), CASES)
def test_simulation_from_attracting_sliding(sigma, nu, label, every):
    s = system(sigma, nu)
    fold = find_two_fold(s, [0.01, -0.02, 0.015])
    angles = ANGLES[3::every]
    z = RADIUS * np.column_stack([np.cos(angles), np.sin(angles)])
    times = fold.reach_time(z)
    agree = 0
    for start, time in zip(fold.point_at(z), times, strict=True):
        run = ns.simulate(s, start, t_end=6 * RADIUS, tol=1e-10)
        end = run.events[0]  # where sliding ended, whatever the driver calls it
        reached = np.linalg.norm(end.x - fold.point) < 1e-5 * RADIUS
        agree += reached == (time > 0)
        if reached:
            assert end.t == pytest.approx(time, rel=20 * RADIUS)
    assert agree >= len(angles) - 1  # one start may lie at the edge of a sector


def test_slope_of_the_canard_moves_in_proportion_to_the_radius():
    sigma, nu = VV, (-2, -1)
    s = system(sigma, nu)
    fold = find_two_fold(s, [0.01, -0.02, 0.015])
    expected = fold.slopes[0]
    errors = []
    for radius in (0.02, 0.01, 0.005):
        a, b = math.atan(expected) - 0.3, math.atan(expected) + 0.3

        def ends(angles, radius=radius):
            z = radius * np.column_stack([np.cos(angles), np.sin(angles)])
            return desingularised(sigma, nu, fold.point_at(z), 1)[0]

        left = ends(np.array([a]))[0]
        for _ in range(5):
            parts = np.linspace(a, b, 41)
            j = int(np.argmax(ends(parts) != left))
            a, b = parts[j - 1], parts[j]
        errors.append(math.tan(a) - expected)
    ratios = [errors[0] / errors[1], errors[1] / errors[2]]
    np.testing.assert_allclose(ratios, 2, rtol=0.1)
