"""Bifurcations of equilibria in two parameters lie on curves known in closed form, and so do their
points of codimension two."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, z, a, b = (ca.SX.sym(s) for s in ("x", "y", "z", "a", "b"))
BOX = [(-1, 1), (-1.5, 1)]


def system(above, below=(1, 1), start=(0.0, 0.0), surface=y + 100, states=(x, y)):
    return ns.FilippovSystem(
        list(states),
        surface=surface,
        above=list(above),
        below=list(below),
        parameters={a: start[0], b: start[1]},
    )


@pytest.fixture(scope="module")
def takens():
    """Bogdanov-Takens' normal form: folds on b^2 = 4 a, Hopf points on a = 0 > b."""
    s = system([y, a + b * x + x**2 - x * y], start=(0.1, -1.0))
    return ns.continue_equilibrium(s, [0.11, 0], "a", bounds=(-0.5, 0.5))


def test_folds_and_hopf_points_meet_in_a_bogdanov_takens_point(takens):
    hopf, fold = (next(e for e in takens.events if e.kind == k) for k in ("Hopf", "fold"))
    folds = ns.continue_bifurcation(fold, ("a", "b"), bounds=BOX)
    assert np.abs(folds.values[:, 1] ** 2 - 4 * folds.values[:, 0]).max() < 1e-12
    assert [point.kind for point in folds.special] == ["Bogdanov-Takens"]
    assert np.abs(folds.special[0].values).max() < 1e-10
    hopfs = ns.continue_bifurcation(hopf, ("a", "b"), bounds=BOX)
    assert np.abs(hopfs.values[:, 0]).max() < 1e-12
    assert np.ptp(hopfs.values[:, 1]) > 2
    assert "Bogdanov-Takens" in str(folds) and "fold" in repr(folds)
    assert abs(folds.solution(3).point[0] + folds.values[3, 1] / 2) < 1e-10


def test_boundary_equilibria_with_their_degenerate_points():
    """A focus at (0, a) with trace 2 b: on the surface at a = 0, a boundary Hopf point at b = 0, and
    where the pseudo-equilibria change sides: s = C A^-1 E = 0."""
    u, v = x, y - a
    s = system([b * u - v, u + b * v], [1, 0.5], (0.5, -0.5), surface=y)
    branch = ns.continue_equilibrium(s, [0, 0.5], "a", bounds=(-1, 1))
    (event,) = branch.events
    curve = ns.continue_bifurcation(event, ("a", "b"), bounds=BOX)
    assert np.abs(curve.values[:, 0]).max() < 1e-13
    found = {point.kind: point.values[1] for point in curve.special}
    # C adj(A) E with A = [[b, -1], [1, b]]: -E1 + b E2 = 0
    assert set(found) == {"boundary Hopf"}
    assert abs(found["boundary Hopf"]) < 1e-12
    other = system([b * u - v, u + b * v], [0.5, 1], (0.5, -0.5), surface=y)
    (event,) = ns.continue_equilibrium(other, [0, 0.5], "a", bounds=(-1, 1)).events
    found = {
        point.kind: point.values[1]
        for point in ns.continue_bifurcation(event, ("a", "b"), bounds=BOX).special
    }
    assert abs(found["persistence turns into nonsmooth fold"] - 0.5) < 1e-12


def test_boundary_equilibria_from_either_side_are_one_curve():
    """At h = y = 0 with A = -1: (0, a + b^2) is on the surface where a = -b^2."""
    s = system([-x, -(y - a - b**2)], [0, 1], (0.5, 0.3), surface=y)
    (event,) = ns.continue_equilibrium(s, [0, 0.5], "a", bounds=(-1, 1)).events
    real = ns.continue_bifurcation(event, ("a", "b"), bounds=BOX)
    assert np.abs(real.values[:, 0] + real.values[:, 1] ** 2).max() < 1e-12
    below = ns.find_pseudo_equilibrium(s, [0, 0], parameters={"a": -0.5, "b": 0.3}).point
    branch = ns.continue_equilibrium(
        s, below, "a", bounds=(-1, 1), side=None, parameters={"a": -0.5, "b": 0.3}
    )
    (event,) = branch.events
    pseudo = ns.continue_bifurcation(event, ("a", "b"), bounds=BOX)
    assert np.abs(pseudo.values[:, 0] + pseudo.values[:, 1] ** 2).max() < 1e-12


def test_pseudo_saddle_nodes_and_two_folds():
    """Sliding flow a - x^2 + b x on y = 0: folds on b^2 = -4 a; two-folds where L1 = L2 = 0."""
    flow = a + b * x - x**2
    s = system([flow, -1], [flow, 1], (0.5, 0.3), surface=y)
    branch = ns.continue_equilibrium(s, [0.9, 0], "a", bounds=(-1, 1), side=None)
    curve = ns.continue_bifurcation(branch.events[0], ("a", "b"), bounds=BOX)
    assert curve.kind == "pseudo-saddle-node"
    assert np.abs(curve.values[:, 1] ** 2 + 4 * curve.values[:, 0]).max() < 1e-12
    s = system([1, x], [-1, x + a - b**2], (-0.5, 0.3), surface=y)
    branch = ns.continue_equilibrium(s, [0.2, 0], "a", bounds=(-1, 1), side=None)
    curve = ns.continue_bifurcation(branch.events[0], ("a", "b"), bounds=BOX)
    assert curve.kind == "two-fold"
    assert np.abs(curve.values[:, 0] - curve.values[:, 1] ** 2).max() < 1e-12


def test_a_closed_curve_of_folds():
    """x'= a^2 + b^2 - 1/4 + x^2: folds on a circle."""
    s = system([a**2 + b**2 - 0.25 + x**2, -y], start=(0.1, 0.1))
    branch = ns.continue_equilibrium(s, [0.48, 0], "a", bounds=(-1, 1))
    event = branch.events[-1]
    curve = ns.continue_bifurcation(event, ("a", "b"), bounds=[(-1, 1), (-1, 1)])
    assert np.abs(np.hypot(*curve.values.T) - 0.5).max() < 1e-12
    assert curve.ends == (ns.BranchEnd.CLOSED, ns.BranchEnd.CLOSED)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (dict(parameters=("a", "a")), ns.DefinitionError, "two names"),
        (dict(parameters=("a", "kappa")), ns.DefinitionError, "kappa"),
        (dict(parameters="a"), ns.DefinitionError, "two names"),
        (dict(bounds=[(-1, 1)]), ns.OptionError, "two pairs"),
        (dict(bounds=[(-1, 1), (0, 1)]), ns.OptionError, "around b"),
        (dict(event="fold"), ns.DefinitionError, "Branch.events"),
    ],
)
def test_bad_input(takens, change, error, words):
    given = {"event": takens.events[0], "parameters": ("a", "b"), "bounds": BOX} | change
    with pytest.raises(error, match=words):
        ns.continue_bifurcation(given.pop("event"), given.pop("parameters"), **given)
