"""Lists of all special points are complete: closed forms, Newton's method finds no other."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from benchmarks.analysis import proof_checks

x, y, z = (ca.SX.sym(s) for s in "xyz")
BOX = [(-1.5, 1.5), (-1.5, 1.5), (-1.0, 1.0)]


def flat(above, below, surface=z):
    """Fields whose third components are L1 and L2 on z = 0."""
    return ns.FilippovSystem([x, y, z], surface=surface, above=[1, 1, above], below=[1, -1, below])


def chebyshev(n, u):
    a, b = 1, u
    for _ in range(n - 1):
        a, b = b, 2 * u * b - a
    return b


@pytest.mark.parametrize(
    ("first", "second", "count"),
    [
        (x**2 + y**2 - 1, x - y, 2),
        (x**2 + y**2 - 1, x**2 - y**2, 4),
        (x**2 + y**2 - 1, (x - 3) ** 2 + y**2 - 1, 0),
        (chebyshev(4, x), chebyshev(5, y), 20),
        (x**2 + y**2 - 1, x - 1 + 1e-9, 2),
        (x**2 + y**2 - 1, x - 1 - 1e-9, 0),
        (ca.sin(4 * x), ca.cos(3 * y) * ca.exp(x), 6),
    ],
)
def test_the_count_is_that_of_the_closed_form(first, second, count):
    everything = ns.prove_all(flat(first, second), BOX)
    assert everything.complete and len(everything.zeros) == count
    assert all(p.exists for p in everything.zeros)


@pytest.mark.slow
def test_double_zeros_curves_and_edges_are_named():
    double = ns.prove_all(flat(x**2 + y**2 - 1, x - 1), BOX)
    assert not double.complete and "not simple" in double.undecided[0].why
    assert len(double.undecided) == 1
    circle = x**2 + y**2 - 1
    curve = ns.prove_all(flat(circle, circle * (2 + x)), BOX, max_boxes=5000)
    assert not curve.complete and curve.undecided and "not proven complete" in str(curve)
    third = 0.25 + x - ca.sqrt(ca.SX(2)) / 2  # zero at an irrational number, the box ends near it
    edge = float(np.sqrt(0.5)) - 0.25
    on = ns.prove_all(flat(third, y), [(-1.0, edge), *BOX[1:]])
    assert len(on.zeros) + len(on.edge) <= 1
    exact = ns.prove_all(flat(x - 1.5, y), BOX)
    assert exact.complete and len(exact.zeros) == 1


@pytest.mark.slow
def test_branch_points_are_not_passed_over():
    everything = ns.prove_all(flat(ca.sqrt(x) - 0.5, y), BOX)
    assert not everything.complete
    assert len(everything.zeros) == 1 and "0.25" in str(everything)
    assert ns.prove_all(flat(ca.sqrt(x) - 0.5, y), [(0.1, 1), *BOX[1:]]).complete


def test_planar_points():
    s = ns.FilippovSystem(
        [x, y], surface=y, above=[1, x * (x**2 - 0.5)], below=[1 - x**2, y + x - 0.25]
    )
    box = [(-1.5, 1.5), (-1, 1)]
    folds = ns.prove_all(s, box, "fold", side="+")
    assert folds.complete and [p.label for p in folds.zeros].count("visible") == 2
    assert len(folds.zeros) == 3
    below = ns.prove_all(s, box, "equilibrium", side="-")  # (1, -0.75) below; (-1, 1.25) outside
    assert below.complete and len(below.zeros) == 1
    s = ns.FilippovSystem([x, y], surface=y, above=[x**2 - 0.25, -1], below=[x**2 - 0.25, 1])
    rest = ns.prove_all(s, box, "pseudo-equilibrium")
    assert rest.complete and len(rest.zeros) == 2
    assert sorted(p.label for p in rest.zeros) == [
        "real stable pseudo-node",
        "real unstable pseudo-node",
    ]


@pytest.mark.slow
def test_newton_finds_nothing_that_is_not_proven():
    assert proof_checks.lists(seed=3, systems=4, starts=15).sound


@pytest.mark.slow
def test_newton_finds_nothing_in_60_random_systems():
    """All 500 are in the benchmark: ``python -m benchmarks --only theorems``."""
    found = proof_checks.lists(seed=5, systems=60, starts=100)
    assert found.sound and found.zeros > 60, found


def test_intervals_of_parameters():
    p = ca.SX.sym("p")
    system = ns.FilippovSystem(
        [x, y, z], surface=z, above=[1, 1, x**2 - p], below=[1, -1, y - x], parameters={p: 0.5}
    )
    some = ns.prove_all(system, BOX, parameters={"p": (0.4, 0.6)})
    assert some.complete and len(some.zeros) == 2
    none = ns.prove_all(system, BOX, parameters={"p": (-0.6, -0.4)})
    assert none.complete and not none.zeros
    assert not ns.prove_all(system, BOX, parameters={"p": (-0.1, 0.1)}).complete


def test_what_is_given_wrongly_is_refused():
    s = flat(x, y)
    for box in ([(-1, 1)] * 2, 3, [(-1, 1), (1, -1), (0, 1)], [(-1, np.inf), (0, 1), (0, 1)]):
        with pytest.raises(ns.OptionError, match="box"):
            ns.prove_all(s, box)
    with pytest.raises(ns.OptionError, match="dimension 1"):
        ns.prove_all(s, BOX, "fold")
    with pytest.raises(ns.OptionError, match="kind"):
        ns.prove_all(s, BOX, "cusp")
    assert ns.prove_all(s, [(-1, 1), 0.25, (-1, 1)], "fold").complete


@pytest.mark.slow
def test_a_jump_with_a_finite_derivative_is_not_passed_over():
    """atan2 jumps by 2 pi over its cut, where its derivative is finite."""
    for offset in (3.1, -3.1, 0.0, 3.0):
        for box in ((-1.0, 1.0), (-0.9, 1.1), (-1e-3, 1.0)):
            system = flat(ca.atan2(x, -1) - offset, y)
            everything = ns.prove_all(system, [box, *BOX[1:]])
            reference = np.tan(np.pi - abs(offset)) * np.sign(offset)  # where it is on that side
            inside = offset != 0.0 and box[0] < reference < box[1]
            assert len(everything.zeros) <= inside
            assert len(everything.zeros) == inside or not everything.complete
            for proof in everything.zeros:  # and no box of uniqueness reaches over the jump
                assert 0 not in proof.box["x"]
