"""Searches change only what is free, agree one by one and all at once, and say where they ended."""

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import nonsmooth as ns
from nonsmooth.local.searches.search import search
from nonsmooth.solvers.newton import solve_many

x, y, z = (ca.SX.sym(s) for s in "xyz")


def sphere(u):
    return np.array([u @ u - 1.0]), 2 * u[None, :]


def test_held_coordinates_keep_their_value():
    start = np.array([0.3, 0.2, 2.0])
    found = search(sphere, start, [2], tol=1e-12, max_iterations=30, what="sphere")
    assert_allclose(found.x, [0.3, 0.2, np.sqrt(1 - 0.13)], atol=1e-15)
    assert found.distance == pytest.approx(2.0 - found.x[2])


def test_where_a_search_fails_the_whole_point_is_reported():
    start = np.array([0.3, 2.0, 0.2])
    with pytest.raises(ns.ConvergenceError) as caught:
        search(sphere, start, [2], tol=1e-12, max_iterations=30, what="sphere")
    assert caught.value.point.shape == (3,)
    assert_allclose(caught.value.point[:2], start[:2])
    system = ns.FilippovSystem([x, y, z], surface=x, above=[1 + z**2, 0, 0], below=[1, 0, 0])
    with pytest.raises(ns.ConvergenceError, match="fold of F1") as caught:
        ns.find_fold(system, [0.1, 0.2, 0.3], hold=["y"])
    assert caught.value.point.shape == (3,) and caught.value.point[1] == 0.2


def test_many_at_once_find_what_one_finds():
    """Two equations in three unknowns: same least-norm steps, so the same root."""
    rng = np.random.default_rng(1)
    angles = rng.uniform(0, 2 * np.pi, size=40)
    circle = np.column_stack([np.cos(angles) / np.sqrt(1.01), np.sin(angles)])
    circle = np.column_stack([circle, 0.1 * circle[:, 0]])
    starts = circle + rng.uniform(-0.15, 0.15, size=(40, 3))

    def one(u):
        values, jacobian = sphere(u)
        return np.append(values, u[2] - 0.1 * u[0]), np.vstack([jacobian, [-0.1, 0, 1]])

    def many(u, which):
        pairs = [one(v) for v in u]
        return np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs])

    found, converged = solve_many(many, starts, tol=1e-12, iterations=30)
    assert converged.all()
    for start, point in zip(starts, found, strict=True):
        alone = search(one, start, tol=1e-12, max_iterations=50, what="circle")
        assert_allclose(point, alone.x, atol=1e-14)


def test_many_at_once_say_which_did_not_converge():
    def equations(u, which):
        with np.errstate(invalid="ignore"):
            return np.log(u) - np.array([0.0, 1.0, 2.0])[which, None], 1 / u[:, :, None]

    found, converged = solve_many(equations, np.array([[1.5], [-1.0], [7.0]]), tol=1e-12)
    assert converged.tolist() == [True, False, True]
    assert_allclose(found[[0, 2], 0], [1.0, np.exp(2.0)])
    assert solve_many(equations, np.zeros((0, 1)), tol=1e-12)[0].shape == (0, 1)


def test_a_trial_whose_jacobian_overflows_is_halved():
    """f = exp(x) - 2: from x = -5.5 the full step leads to 483, where the squared slope overflows."""
    from nonsmooth.solvers.newton import solve

    def equations(x):
        return np.exp(x) - 2.0, np.exp(x)[:, None]

    root = solve(equations, np.array([-5.5]), tol=1e-12, max_iterations=400, what="root")
    assert abs(root.x[0] - np.log(2.0)) < 1e-12
    with pytest.raises(ns.PointError, match=r"near.*root"):
        solve(equations, np.array([400.0]), tol=1e-12, max_iterations=9, what="root")
