"""Every sliding solution at a point is found, and the stable ones are those that simulate follows."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, z, lam, kap = (ca.SX.sym(s) for s in ("x", "y", "z", "lam", "kap"))


def test_hidden_dynamics_has_the_branches_of_its_polynomial():
    """grad h . f = -(lam + .6)(lam)(lam - .7): stable, unstable, stable."""
    field = [-(lam + 0.6) * lam * (lam - 0.7), 2 * lam**2 - 1]
    system = ns.FilippovSystem([x, y], field=field, multipliers=lam, surface=x, hidden=True)
    branches = ns.local.sliding_branches(system, [0.0, 0.3])
    np.testing.assert_allclose([b.multipliers[0] for b in branches], [-0.6, 0, 0.7], atol=1e-12)
    assert [b.stable for b in branches] == [True, False, True]
    for b in branches:
        np.testing.assert_allclose(b.velocity, [0, 2 * b.multipliers[0] ** 2 - 1], atol=1e-12)


def test_linear_filippov_has_the_one_branch_of_alpha():
    system = ns.FilippovSystem([x, y], surface=x, above=[-1, 2], below=[3, -4])
    (branch,) = ns.local.sliding_branches(system, [0.0, 0.0])
    assert (1 - branch.multipliers[0]) / 2 == pytest.approx(ns.alpha(system, [0.0, 0.0]))
    np.testing.assert_allclose(branch.velocity, ns.sliding_field(system, [0.0, 0.0]), atol=1e-14)
    assert branch.stable


def test_repelling_sliding_is_an_unstable_branch_and_crossing_has_none():
    repelling = ns.FilippovSystem([x], surface=x, above=[1], below=[-1])
    assert [b.stable for b in ns.local.sliding_branches(repelling, [0.0])] == [False]
    crossing = ns.FilippovSystem([x], surface=x, above=[1], below=[2])
    assert ns.local.sliding_branches(crossing, [0.0]) == []


def test_a_bilinear_intersection_has_two():
    """-lam + 2 kap lam = .2 and -kap + 2 lam kap = .2: lam = kap with 2 lam^2 - lam = .2."""
    system = ns.FilippovSystem(
        [x, y, z],
        field=[-lam + 2 * kap * lam - 0.2, -kap + 2 * lam * kap - 0.2, 1],
        multipliers=[lam, kap],
        surfaces=[x, y],
    )
    branches = ns.local.sliding_branches(system, [0.0, 0.0, 0.0])
    roots = (1 + np.array([-1, 1]) * np.sqrt(1 + 1.6)) / 4
    np.testing.assert_allclose([b.multipliers for b in branches], np.c_[roots, roots], atol=1e-10)
    assert [b.stable for b in branches] == [True, False]
