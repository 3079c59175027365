"""Statements say no more than what is proven: printed radii, modes of other surfaces, hidden dynamics."""

from fractions import Fraction

import casadi as ca
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import nonsmooth as ns
from nonsmooth.proofs.arithmetic.enclosure import rounded
from nonsmooth.proofs.arithmetic.instructions import ExpressionGraph

x, y, z, p, a, b = (ca.SX.sym(s) for s in ("x", "y", "z", "p", "a", "b"))
BOX = [(-1, 1)] * 3


@given(st.fractions(-1000, 1000), st.fractions(0, 10), st.integers(0, 30), st.integers(0, 25))
def test_what_is_printed_holds_the_enclosure(low, width, shift, points):
    ends = low, low + width / 10**shift
    value = ns.proofs.Enclosure(rounded(ends[0], points, -1), rounded(ends[1], points, 1))
    middle, _, radius = str(value).partition(" +- ")
    m, r = Fraction(middle), Fraction(radius or 0)
    assert m - r <= Fraction(value.low) and Fraction(value.high) <= m + r


def two_surfaces():
    """A Teixeira singularity at 0 whose lower field is another one for y < p."""
    above, below = [-y, 1, -2], [z, -1, 1 + 0.5 * b]
    mix = [(1 + a) / 2 * f + (1 - a) / 2 * g for f, g in zip(above, below, strict=True)]
    return ns.FilippovSystem(
        [x, y, z], surfaces=[x, y - p], multipliers=[a, b], field=mix, parameters={p: 0.5}
    )


def test_points_are_proven_only_where_the_fields_of_their_mode_apply():
    system = two_surfaces()
    fold = ns.find_two_fold(system, near=[0, 0.1, -0.1], surface=0)
    assert ns.certify(fold).proven and "mode" in str(ns.certify(fold))
    over = ns.certify(fold, parameters={"p": ("-0.5", "0.5")}, max_pieces=16)
    assert not over.proven and not over.exists
    for piece in over.pieces:
        assert piece.proven == (piece.parameters["p"].ends[0] > 0)
        assert piece.proven or "other sides" in str(piece).replace("\n ", "")
    assert len(ns.prove_all(system, BOX, mode="+-").zeros) == 1
    wrong = ns.prove_all(system, BOX, mode="++")
    assert wrong.complete and not wrong.zeros
    for ends, complete in (((-0.5, -0.25), True), ((-0.5, 0.5), False)):
        some = ns.prove_all(system, BOX, mode="++", parameters={"p": ends})
        assert some.complete == complete and len(some.zeros) == complete


def test_equilibria_behind_another_surface_or_a_wall_do_not_count():
    system = ns.FilippovSystem(
        [x, y], surfaces=[x + 2, y], multipliers=[a, b], field=[y - 0.5, -x + 0 * a - 0.0 * b]
    )
    box = [(-1, 1), (-1, 1)]
    assert len(ns.prove_all(system, box, "equilibrium", mode="++").zeros) == 1
    assert not ns.prove_all(system, box, "equilibrium", mode="+-").zeros
    wall = ns.FilippovSystem(
        [x, y], field=[y, -x - a], surface=y, multipliers=a, impacts=ns.Impact(x + 0.5)
    )
    found = ns.prove_all(wall, [(-2, 2), (-1, 1)], "fold")
    assert found.complete and not found.zeros  # x = -1 is behind the wall
    assert len(ns.prove_all(wall, [(-2, 2), (-1, 1)], "fold", side="-").zeros) == 1


def test_classes_are_not_claimed_for_hidden_dynamics():
    above, below = [-y, 1, -2], [z, -1, 1]
    mix = [(1 + a) / 2 * f + (1 - a) / 2 * g for f, g in zip(above, below, strict=True)]
    mix[0] = mix[0] + 0.3 * (1 - a**2)
    system = ns.FilippovSystem([x, y, z], surface=x, multipliers=a, field=mix, hidden=True)
    proof = ns.certify(ns.find_two_fold(system, near=[0, 0.1, -0.1]))
    assert proof.exists and not proof.proven and not proof.label
    assert "nonlinearly" in str(proof) and "anards" not in str(proof)


def test_a_box_is_printed_as_it_was_given():
    system = ns.FilippovSystem(
        [x, y, z], surface=x, above=[-(y - p), 1, -2], below=[z, -1, 1], parameters={p: 0.25}
    )
    found = ns.prove_all(system, [(-1, 1), ("0.24999999", 1), ("-1/3", 1)], parameters={"p": 0.25})
    words = " ".join(str(found).split())
    assert "y in [0.24999999, 1]" in words and "For p = 0.25" in words
    assert "-0.333333 " not in words and "doubles" in words


def test_a_fraction_is_not_read_as_the_decimal_of_the_equal_double():
    graph = ExpressionGraph()
    assert graph.constant(0.1) != graph.constant(Fraction(0.1))


def test_undecided_pieces_leave_pieces_for_the_rest():
    system = ns.FilippovSystem(
        [x, y, z], surface=x, above=[-y, 1, -p], below=[z, -1, 1], parameters={p: 2.0}
    )
    fold = ns.find_two_fold(system, near=[0, 0, 0])
    proof = ns.certify(fold, parameters={"p": ("0.3", "3.1")}, max_pieces=24)
    size = sum(
        float(np.ptp([float(v) for v in q.parameters["p"].ends])) for q in proof.pieces if q.proven
    )
    assert size > 0.99 * 2.8 and {q.label for q in proof.pieces} == {"II-C", "II-F", ""}
