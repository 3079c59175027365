"""Sliding orbits over a surface are those of closed forms, end at folds and rest, and never cross."""

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm

import nonsmooth as ns
from nonsmooth.local.scans.box import Box
from nonsmooth.local.scans.surface_scan import SurfaceScan
from nonsmooth.orbit.manifolds.sliding_orbits import SlidingOrbits

x, y, z = (ca.SX.sym(name) for name in "xyz")


def orbits(system, *limits):
    return SlidingOrbits(SurfaceScan.of(system, {}, Box(*limits)))


def two_fold(label):
    return orbits(ns.textbook.two_fold(label).system, -1.0, 1.0, -1.0, 1.0)


def test_orbits_are_those_of_the_linear_flow():
    # z' = M z/(z2 + z3) has the orbits of exp(M r) z: every point is on that curve
    curve = two_fold("mix-0").follow(np.array([0.0, 0.5, 0.2]))
    matrix = np.array([[0.5, -1.0], [1.0, 0.0]])  # nu = (0, .5), sigma = (1, 1)
    one, fine = expm(matrix * 2 / 4000), [np.array([0.5, 0.2])]
    for _ in range(4000):
        fine.append(one @ fine[-1])
    fine = np.array(fine)
    gaps = np.linalg.norm(curve[:, None] - fine[None], axis=2).min(axis=1)
    assert gaps.max() < 3e-4  # half a step of the reference
    first = int(np.argmax(fine[:, 0] < 0))  # it leaves through z2 = 0, the visible fold
    assert_allclose(curve[-1], [0, fine[first, 1]], atol=1e-3)
    assert abs(curve[-1, 0]) < 1e-8


def test_an_invariant_of_the_flow_is_kept():
    # u = u0 e^(low r), v = v0 e^(high r): high log u - low log v does not change along an orbit
    flow = ns.two_folds.ReducedFlow((1, -1), (-2.0, -1.0))
    low, high = flow.eigenvalues
    for ahead in (True, False):
        curve = two_fold("VV-C1").follow(np.array([0.0, -0.5, -0.6]), ahead)
        u, v = np.abs(np.linalg.solve(flow.eigenvectors, curve.T))
        assert len(curve) > 10
        assert_allclose(np.ptp(high * np.log(u) - low * np.log(v)), 0, atol=1e-6)


@pytest.mark.parametrize("start", [[0.0, 0.4, 0.3], [0.0, -0.4, -0.3]])
def test_time_runs_as_it_does(start):
    """Forward is the direction of the sliding field, in attracting and in repelling sliding."""
    sliding, start = two_fold("II-F"), np.array(start)
    velocity = ns.sliding_field(sliding.scan.where.system, start)[1:]
    for ahead, sign in ((True, 1), (False, -1)):
        curve = sliding.follow(start, ahead)
        assert_allclose(curve[0], start[1:])
        assert sign * (curve[1] - curve[0]) @ velocity > 0


def test_an_orbit_comes_to_rest_at_a_node():
    s = ns.FilippovSystem([x, y, z], surface=x, above=[-1, -y, -2 * z], below=[1, -y, -2 * z])
    sliding = orbits(s, -1.0, 1.0, -1.0, 1.0)
    curve = sliding.follow(np.array([0.0, 0.8, 0.6]))
    assert np.linalg.norm(curve[-1]) < 1e-3
    assert_allclose(curve[:, 1], 0.6 * (curve[:, 0] / 0.8) ** 2, atol=1e-7)
    backward = sliding.follow(np.array([0.0, 0.8, 0.6]), False)
    assert_allclose(backward[-1], [1.0, 0.6 / 0.64], atol=1e-7)  # at the frame


def test_no_orbit_starts_outside_sliding():
    sliding = two_fold("II-C")
    assert sliding.follow(np.array([0.0, -0.5, 0.5])).shape == (0, 2)
    assert sliding.follow(np.full(3, np.nan)).shape == (0, 2)


@pytest.mark.parametrize("centre", [(0.0, 0.0), (1.5, 1.0)])
def test_manifolds_of_a_pseudo_saddle(centre):
    # L1 = -1, L2 = 1: the sliding field is the mean of the two fields
    s = ns.FilippovSystem(
        [x, y, z], surface=x, above=[-1, 2 * (y - centre[0]), centre[1] - z], below=[1, 0, 0]
    )
    sliding = orbits(s, -2.0, 3.0, -2.0, 3.0)
    (found,) = sliding.scan.pseudo_equilibria
    curves = list(sliding.manifolds(found))
    ends = [(curve[0], curve[-1]) for curve in curves]
    for column in (0, 1):
        along = [c for c in curves if np.ptp(c[:, column]) > 0.1]
        assert len(along) == 2
        for curve in along:
            assert_allclose(curve[:, 1 - column], centre[1 - column], atol=1e-9)
    outward = [last for first, last in ends if abs(first - centre).max() < 0.02]
    inward = [first for first, last in ends if abs(last - centre).max() < 0.02]
    assert sorted(p[0] for p in outward) == pytest.approx([-2.0, 3.0])
    assert sorted(p[1] for p in inward) == pytest.approx([-2.0, 3.0])


@pytest.mark.parametrize("label", ["VV-C1", "II-C", "mix-S", "mix-F"])
def test_canards_of_a_normal_form_are_its_eigenlines(label):
    sliding = two_fold(label)
    (fold,) = sliding.scan.two_folds
    lines = list(sliding.eigenlines(fold))
    names = [name for name, _ in lines]
    assert names.count("canard") == 2 * (fold.canards > 0) * (1 + (label == "mix-C"))
    for name, curve in lines:
        # Da is where z2, z3 > 0: a canard comes from there, a faux canard from Dr
        assert (np.sign(curve[0].sum() - curve[-1].sum()) > 0) == (name == "canard")
        slope = curve[:, 1].sum() / curve[:, 0].sum()
        assert min(abs(slope - s) for s in np.real(fold.slopes)) < 1e-6
        assert_allclose(curve[:, 1], slope * curve[:, 0], atol=1e-6)


def test_evenly_spaced_orbits_keep_apart_in_their_regions():
    sliding = two_fold("mix-S")
    curves = list(sliding.spaced(8))
    assert len(curves) > 6
    for (_, curve, _), attracting in curves:
        assert np.all(curve >= -1e-8) if attracting else np.all(curve <= 1e-8)
    starts = list(sliding.spaced(8, avoid=[np.column_stack([np.linspace(0, 1, 99)] * 2)]))
    assert len(starts) < len(curves)
