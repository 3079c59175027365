"""Pseudo-equilibria in R^n: textbook values, and spectra of the sliding field differenced along the surface."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth import textbook
from nonsmooth.local import classify, find_all, find_pseudo_equilibrium


def test_harvested_predator_pseudo_saddle_node():
    problem = textbook.harvested_prey_predator()
    level = problem["pseudo-saddle-node"].value
    found = classify(problem.system, [0.35, level], parameters={"alpha": level})
    assert (found.kind, found.label) == ("pseudo-equilibrium", "pseudo-saddle-node")
    below = find_all(
        lambda x: find_pseudo_equilibrium(problem.system, x, parameters={"alpha": 1.1}),
        [[x, 1.1] for x in (0.1, 0.3, 0.5, 0.6)],
    )
    assert sorted(e.kind for e in below) == ["pseudo-saddle", "stable pseudo-node"]
    with pytest.raises(ns.ConvergenceError):
        find_pseudo_equilibrium(problem.system, [0.35, 1.3], parameters={"alpha": 1.3})


def test_welander_box():
    problem = textbook.welander_box()
    found = find_pseudo_equilibrium(problem.system, [0.8, 0.7], parameters={"eps": 0.05})
    assert problem["pseudo-equilibrium T"].agrees(found.point[0])
    assert found.kind == "stable pseudo-node" and found.stable


def test_pseudo_hopf_node():
    problem = textbook.pseudo_hopf()
    found = find_pseudo_equilibrium(problem.system, [-0.01, 0.0])
    assert problem["pseudo-node"].agrees(found.point[0])
    assert found.region is ns.Region.REPELLING and found.kind == "unstable pseudo-node"
    relay = find_pseudo_equilibrium(textbook.planar_relay().system, [0.7, -0.2])
    assert relay.point == pytest.approx([0, 0], abs=1e-14)
    assert relay.eigenvalues == pytest.approx([-2.0])


def test_the_fused_focus_of_the_pseudo_hopf_bifurcation():
    problem = textbook.pseudo_hopf()
    found = ns.local.fold_fold(problem.system, [0.0, 0.0], parameters={"al": 0.0})
    assert found.label == "II2"
    assert found.numbers["stability"] == pytest.approx(2 / 3)  # -2 r/3: the cycle is stable


def random_system(n, rng):
    """A pseudo-equilibrium at the origin of h = x1 + quadratic, with random smooth fields."""
    x = ca.vertcat(*[ca.SX.sym(f"x{i}") for i in range(n)])
    square = ca.vertcat(*[x[i] * x[j] for i in range(n) for j in range(i, n)])
    f1 = rng.normal(size=n)
    f1[0] = -rng.uniform(0.5, 2.0)
    f2 = -rng.uniform(0.5, 2.0) * f1
    fields = [
        ca.DM(f) + ca.DM(rng.normal(size=(n, n))) @ x
        + ca.DM(rng.normal(size=(n, square.numel()))) @ square
        for f in (f1, f2)
    ]  # fmt: skip
    h = x[0] + ca.dot(ca.DM(rng.normal(size=square.numel())), square)
    return ns.FilippovSystem(
        ca.vertsplit(x), surface=h, above=ca.vertsplit(fields[0]), below=ca.vertsplit(fields[1])
    )


@pytest.mark.parametrize(
    "n", [1, 2, 3, pytest.param(4, marks=pytest.mark.slow), pytest.param(6, marks=pytest.mark.slow)]
)
def test_pseudo_equilibria_in_any_dimension(n):
    for seed in range(5):
        rng = np.random.default_rng([n, seed])
        system = random_system(n, rng)
        found = find_pseudo_equilibrium(system, 1e-3 * rng.normal(size=n))
        assert found.point == pytest.approx(np.zeros(n), abs=1e-13)
        assert found.status == "real" and found.eigenvalues.shape == (n - 1,)
        if n == 1:
            continue
        # the sliding field itself, differenced along the surface
        step, basis = 1e-5, np.eye(n)[1:]
        columns = [(slide(system, step * v) - slide(system, -step * v)) / (2 * step) for v in basis]
        expected = np.linalg.eigvals(np.array(columns)[:, 1:].T)
        order = lambda v: sorted(v, key=lambda z: (round(z.real, 6), z.imag))
        assert np.allclose(order(found.eigenvalues), order(expected), rtol=1e-5, atol=1e-6)
        assert found.stable == bool(np.all(expected.real < 0))
        named = classify(system, found.point)
        assert (named.kind, named.label) == ("pseudo-equilibrium", found.kind)


def slide(system, x):
    h = system.surface_function()
    for _ in range(5):
        gradient = system.evaluate(system.gradient(h), x).ravel()
        x = x - system.evaluate(h, x).item() * gradient / (gradient @ gradient)
    return ns.sliding_field(system, x)
