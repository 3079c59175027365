"""Equilibria, pseudo-equilibria and boundary equilibria in R^n: textbook values, spectra, messages."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth import textbook
from nonsmooth.local.equilibria import (
    find_all,
    find_boundary_equilibrium,
    find_equilibrium,
    find_pseudo_equilibrium,
)
from nonsmooth.local.objects import classify
from nonsmooth.local.planar import boundary_equilibrium, fold_fold, fold_orbit_landing

X, Y, Z = (ca.SX.sym(s) for s in "xyz")


# textbook ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("side", "quantity", "near", "kind", "label"),
    [
        ("below", "boundary focus", (0.05, 0.9), "unstable focus", "BF"),
        ("above", "boundary node", (0.7, 0.8), "stable node", "BN"),
    ],
)
def test_harvested_predator_boundary_equilibria(side, quantity, near, kind, label):
    problem = textbook.harvested_prey_predator()
    point, value = find_boundary_equilibrium(problem.system, near, vary="alpha", side=side)
    assert problem[quantity].agrees(value)
    found = classify(problem.system, point, parameters={"alpha": value})
    assert found.kind == "boundary equilibrium" and found.label.startswith(label)
    assert found.side == side
    real = find_equilibrium(problem.system, near, side=side, parameters={"alpha": value})
    assert (real.kind, real.status) == (kind, "boundary")


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
    for side, quantity in (("below", "k = 0"), ("above", "k = 5")):
        _, eps = find_boundary_equilibrium(problem.system, [0.5, 0.5], vary="eps", side=side)
        assert problem[f"boundary equilibrium, {quantity}"].agrees(eps)


def test_pseudo_hopf_node_and_its_fused_focus():
    problem = textbook.pseudo_hopf()
    found = find_pseudo_equilibrium(problem.system, [-0.01, 0.0])
    assert problem["pseudo-node"].agrees(found.point[0])
    assert found.region is ns.Region.REPELLING and found.kind == "unstable pseudo-node"
    fused = classify(problem.system, [0.0, 0.0], parameters={"al": 0.0})
    assert fused.label == "II2"
    assert fused.evidence["stability"] == pytest.approx(2 / 3)  # -2 r/3: the cycle is stable
    relay = find_pseudo_equilibrium(textbook.planar_relay().system, [0.7, -0.2])
    assert relay.point == pytest.approx([0, 0], abs=1e-14)
    assert relay.eigenvalues == pytest.approx([-2.0])


def test_the_threshold_between_bf2_and_bf3():
    for rho, known in ((0.1, -0.586212601032527), (0.3, 0.052559241307771)):
        assert rho + (1 + rho**2) / fold_orbit_landing(rho, 1.0) == pytest.approx(known, abs=1e-14)
        for shift, label in ((-0.01, "BF3"), (0.01, "BF2"), (0.0, "degenerate")):
            c = known + shift
            system = ns.FilippovSystem(
                [X, Y], surface=Y, above=[rho * X - Y, X + rho * Y], below=[c, 1]
            )
            assert boundary_equilibrium(system, [0, 0]).label == label


# any dimension ----------------------------------------------------------------------------------


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


@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
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


def test_classify_in_three_dimensions():
    system = ns.FilippovSystem([X, Y, Z], surface=X, above=[-Y, 1, -2], below=[Z, -1, 1])
    cases = [
        ((0, 1, 1), "sliding", "attracting sliding"),
        ((0, -1, 1), "crossing", "crossing up"),
        ((0, 0, 1), "fold", "invisible"),
        ((0, 1, 0), "fold", "invisible"),
        ((0, 0, 0), "two-fold", "II-C"),
        ((0, 1e-8, 1), "degenerate", "near L1 = 0"),
    ]
    for point, kind, label in cases:
        found = classify(system, point)
        assert (found.kind, found.label) == (kind, label), str(found)
    whitney = ns.FilippovSystem([X, Y, Z], surface=X, above=[Y, Z, 1], below=[1, 0, 0])
    assert classify(whitney, [0, 0, 0]).kind == "cusp"
    assert classify(whitney, [0, 0, 1]).label == "visible"


@pytest.mark.parametrize("label", textbook.TWO_FOLDS)
def test_two_folds_are_named(label):
    found = classify(textbook.two_fold(label).system, [0, 0, 0])
    assert (found.kind, found.label) == ("two-fold", label)
    assert found.distance > 0.05 and "L11" in found.evidence


def test_two_folds_near_a_boundary_are_degenerate():
    for eps in (0.0, 1e-12, 1e-8):
        system = textbook.two_fold((1, -1), (2.0, 0.5 + eps)).system  # Delta = 2 eps
        found = classify(system, [0, 0, 0])
        assert found.kind == "degenerate" and found.nearest == "Delta=0"
        assert found.distance == pytest.approx(2 * eps, abs=1e-15)


def test_boundary_equilibrium_in_three_dimensions_is_persistence_or_fold():
    for s in (1.0, -1.0):
        system = ns.FilippovSystem(
            [X, Y, Z], surface=X, above=[-X + Y, -Y + Z, -2 * Z], below=[1, -s, -3]
        )
        found = boundary_equilibrium(system, [0, 0, 0])
        expected = np.linalg.solve([[-1, 1, 0], [0, -1, 1], [0, 0, -2]], [1, -s, -3])[0]
        assert found.numbers["s"] == pytest.approx(expected)
        assert found.label == ("nonsmooth fold" if expected > 0 else "persistence")


def test_equilibria_from_many_starts():
    system = ns.FilippovSystem(
        [X, Y], surface=X - 0.5, above=[Y, X - X**3], below=[Y, X - X**3 - 0.1 * Y]
    )
    starts = [[x, y] for x in (-1.5, -0.4, 0.1, 1.2) for y in (-0.5, 0.5)]
    below = find_all(lambda x: find_equilibrium(system, x, side="below"), starts)
    table = {round(e.point[0]): (e.status, e.kind) for e in below}
    assert table == {
        -1: ("real", "stable focus"), 0: ("real", "saddle"), 1: ("virtual", "stable focus")
    }  # fmt: skip
    centre = find_equilibrium(system, [0.9, 0.1])
    assert (centre.status, centre.kind) == ("real", "degenerate")  # a centre: no real part


# mistakes ---------------------------------------------------------------------------------------


PLANE = ns.FilippovSystem([X, Y], surface=Y, above=[1, X], below=[1, 1])


def test_messages():
    with pytest.raises(ns.PointError, match=r"expected a point of the surface.*nearest point"):
        classify(PLANE, [1.0, 0.5])
    with pytest.raises(ns.PointError, match=r"expected an equilibrium of a field.*nearest zero"):
        boundary_equilibrium(PLANE, [0.0, 0.0])
    with pytest.raises(ns.PointError, match=r"expected a fold-fold, L1 = L2 = 0"):
        fold_fold(PLANE, [0.0, 0.0])
    space = ns.FilippovSystem([X, Y, Z], surface=X, above=[Y, 1, 0], below=[1, 0, 0])
    with pytest.raises(ns.DefinitionError, match=r"expected a planar system.*received 3 states"):
        fold_fold(space, [0.0, 0.0, 0.0])
    with pytest.raises(ns.DefinitionError, match=r"side: expected 'above'"):
        find_equilibrium(PLANE, [0.0, 0.0], side="left")
    with pytest.raises(ns.DefinitionError, match=r"vary: expected a parameter among \[\]"):
        find_boundary_equilibrium(PLANE, [0.0, 0.0], vary="mu")
    with pytest.raises(ns.ConvergenceError, match="equilibrium above"):
        find_equilibrium(PLANE, [0.0, 0.0])
    with pytest.raises(ns.OptionError, match="margin"):
        classify(PLANE, [0.0, 0.0], margin=-1.0)


def test_time_and_hidden_dynamics():
    t, lam = ca.SX.sym("t"), ca.SX.sym("lam")
    moving = ns.FilippovSystem([X, Y], surface=Y, above=[ca.cos(t), -1], below=[1, 1], time=t)
    with pytest.raises(ns.DefinitionError, match="without explicit time"):
        find_equilibrium(moving, [0.0, 0.0])
    assert classify(moving, [0.0, 0.0], t=1.0).label == "attracting sliding"
    hidden = ns.FilippovSystem(
        [X, Y], surface=Y, multipliers=lam, field=[1, -(lam**3)], hidden=True
    )
    with pytest.raises(ns.DefinitionError, match="hidden dynamics"):
        classify(hidden, [0.0, 0.0])


def test_both_fields_vanish():
    system = ns.FilippovSystem([X, Y], surface=Y, above=[X, -Y], below=[-X, Y])
    found = classify(system, [0.0, 0.0])
    assert found.kind == "degenerate" and found.distance == 0.0


def test_the_answer_reads():
    text = str(classify(PLANE, [0.0, 0.0]))
    assert text.startswith("fold: visible of F1 (above) at [0.0, 0.0] (")
    assert "L11 = 1" in text
