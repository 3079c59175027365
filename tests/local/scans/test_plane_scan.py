"""A scan of a plane finds surface, folds, equilibria and pseudo-equilibria where closed forms have them."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import nonsmooth as ns
from nonsmooth.local.scans.box import Box
from nonsmooth.local.scans.plane_scan import PlaneScan

x, y = ca.SX.sym("x"), ca.SX.sym("y")


def plane(above, below, surface=y, box=(-2.03, 2.0, -2.0, 2.01)):
    system = ns.FilippovSystem([x, y], surface=surface, above=above, below=below)
    return PlaneScan.of(system, {}, Box(*box))


def harvest(level, *limits):
    system = ns.textbook.harvested_prey_predator().system
    return PlaneScan.of(system, {"alpha": level}, Box(*limits))


@pytest.mark.parametrize("box", [(-4.0, 4.0, -4.0, 4.0), (-3.9, 4.0, -4.1, 4.3)])
def test_relay_slides_between_its_folds_into_a_pseudo_node(box):
    # problem 9: sliding for |x| < 2 on x + y = 0, pseudo-node at 0, grid points on the features
    p = plane([y - x, 3 * y - 10], [y - x, 3 * y + 10], x + y, box)
    assert [(f.side, f.kind) for f in p.folds] == [("+", "invisible"), ("-", "invisible")]
    (node,) = p.pseudo_equilibria
    assert_allclose(node.point, 0, atol=1e-12)
    assert node.kind == "stable pseudo-node" and node.stable
    sliding = [piece for piece in p.pieces if piece.kind != "crossing"]
    assert [piece.kind for piece in sliding] == ["attracting"]
    assert_allclose(np.sort(sliding[0].points[[0, -1], 0]), [-2, 2], atol=1e-12)


def test_harvested_prey_has_the_folds_of_the_literature():
    # problem 7: folds of the field below on x2 = alpha
    p = harvest(0.95, 0.0, 1.2, 0.3, 1.5)
    above, below = p.folds
    assert (above.side, above.kind) == ("+", "invisible")
    assert (below.side, below.kind) == ("-", "visible")
    assert_allclose(below.point[0], 0.04280205655526992, rtol=1e-12)
    assert_allclose(above.point[0], 0.7208612440191388, rtol=1e-12)
    found = {e.kind: e for e in p.pseudo_equilibria}
    assert set(found) == {"stable pseudo-node", "pseudo-saddle"}
    for e in found.values():
        assert_allclose(p.at(e.point[None, :]).sliding, 0, atol=1e-12)
    # pseudo-equilibria: alpha a = (1 - x)(b + x)
    roots = np.roots([-1.0, 0.7, 0.3 - 0.3556 * 0.95])
    got = sorted(e.point[0] for e in found.values())
    assert_allclose(got, np.sort(roots), rtol=1e-12)


@pytest.mark.parametrize(
    ("slope", "attracting", "kind"),
    [
        (-1, True, "stable pseudo-node"),
        (1, True, "pseudo-saddle"),
        (-1, False, "pseudo-saddle"),
        (1, False, "unstable pseudo-node"),
    ],
)
def test_pseudo_equilibria_of_every_kind(slope, attracting, kind):
    across = -1.0 if attracting else 1.0
    (found,) = plane([slope * x, across], [slope * x, -across]).pseudo_equilibria
    assert found.kind == kind
    assert found.stable == (kind == "stable pseudo-node")


@pytest.mark.parametrize(
    ("matrix", "kind"),
    [
        ([[-1, 0], [0, -2]], "stable node"),
        ([[1, 0.5], [0, 2]], "unstable node"),
        ([[-0.1, -1], [1, -0.1]], "stable focus"),
        ([[0.1, -1], [1, 0.1]], "unstable focus"),
        ([[0, -1], [1, 0]], "degenerate"),  # a centre
        ([[1, 0], [0, -1]], "saddle"),
    ],
)
def test_equilibria_are_found_and_named_on_their_own_side_only(matrix, kind):
    (a, b), (c, d) = matrix
    u, v = x - 0.3, y - 0.4
    p = plane([a * u + b * v, c * u + d * v], [x - 1, y - 1])  # that of F2 is virtual
    (found,) = p.equilibria
    assert (found.kind, found.side) == (kind, "+")
    assert_allclose(found.point, [0.3, 0.4], atol=1e-12)
    if kind == "saddle":
        assert_allclose(np.abs(p.eigenvectors(found)), [[0, 1], [1, 0]], atol=1e-12)


def test_curved_surfaces_are_reached_to_rounding():
    p = plane([y - 0.3 * x, -x - 0.3 * y], [y + x, y - x], x**2 + y**2 - 1)
    (curve,) = p.curves
    assert_allclose(np.hypot(*curve.T), 1, atol=1e-14)
    assert_allclose(curve[0], curve[-1], atol=1e-9)


def test_pieces_cover_the_surface_and_are_what_they_say():
    p = plane([1.0, ca.sin(3 * x)], [1.0, ca.cos(2 * x)])
    pieces = p.pieces
    assert len(pieces) > 4
    for left, right in pairwise(pieces):
        assert_allclose(left.points[-1], right.points[0])
        assert left.kind != right.kind
    for piece in pieces:
        at = piece.points[1:-1, 0]
        l1, l2 = np.sin(3 * at), np.cos(2 * at)
        expected = {"attracting": (l1 < 0) & (l2 > 0), "repelling": (l1 > 0) & (l2 < 0)}
        assert np.all(expected.get(piece.kind, l1 * l2 > 0))


def test_an_equilibrium_on_the_frame_is_inside():
    p = plane([x - 1.0, -(y + 2.0)], [1, 1], surface=x + 5, box=(-1.0, 1.0, -2.0, 2.0))
    assert [e.kind for e in p.equilibria] == ["saddle"]


def test_surfaces_of_several_parts_are_all_scanned():
    p = plane([-1, y - x], [1, x + y], surface=x**2 - 1, box=(-2.03, 2.0, -2.0, 2.01))
    assert len(p.curves) == 2
    sides = np.sort([curve[:, 0].mean() for curve in p.curves])
    assert_allclose(sides, [-1, 1], atol=1e-13)


def test_without_the_surface_there_is_nothing_on_it():
    p = plane([1, 1], [1, 1 + x], surface=y - 9)
    assert p.curves == [] and p.pieces == [] and p.folds == [] and p.pseudo_equilibria == []


def test_where_a_field_is_undefined_the_scan_continues():
    p = plane([ca.sqrt(x), y - x], [1, 1], box=(-1.0, 1.0, -1.0, 1.0))
    assert all(e.side == "+" for e in p.equilibria)
    assert len(p.curves) == 1


@pytest.mark.parametrize(("force", "folds"), [(2 * x, 0), (2 * x + y, 0), (2 * x + 1, 2)])
def test_folds_of_mechanical_surfaces_are_where_a_force_jumps(force, folds):
    """A spring, one with a damper, and one with a preload: the speed y of x = 0 vanishes on both sides."""
    assert len(plane([y, 0.4 - x], [y, 0.4 - x - force], x).folds) == folds


def test_an_equilibrium_on_the_surface_is_no_fold_and_no_pseudo_equilibrium():
    """The prey's level where the equilibrium with harvest meets the threshold: a boundary node, also
    to the digits of a rounded level; far from it a fold, visible or not."""
    level = 0.801355280327832
    for off in (0.0, 1e-7, -1e-7):
        p = harvest(level + off, 0.0, 1.1, 0.3, 1.3)
        (node,) = p.boundary_equilibria
        assert (node.side, node.status, node.kind) == ("+", "boundary", "stable node")
        assert_allclose(node.point, [0.7208612440191388, level], atol=1e-6)
        assert [f.side for f in p.folds] == ["-"]
        assert p.equilibria == p.pseudo_equilibria == []
        assert [piece.kind for piece in p.pieces] == ["crossing", "attracting", "crossing"]
    for off, kind in ((0.02, "invisible"), (-0.02, "visible")):
        p = harvest(level + off, 0.0, 1.1, 0.3, 1.3)
        assert p.boundary_equilibria == []
        assert [f.kind for f in p.folds if f.side == "+"] == [kind]
