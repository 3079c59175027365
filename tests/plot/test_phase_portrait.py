"""Portraits of planar systems find the objects of the planar theory, and refuse other systems."""

from itertools import pairwise

import casadi as ca
import matplotlib
import numpy as np
import pytest
from numpy.testing import assert_allclose

import nonsmooth as ns
from nonsmooth.plot.planar import Plane

x, y = ca.SX.sym("x"), ca.SX.sym("y")


def plane(above, below, surface=y, box=(-2.03, 2.0, -2.0, 2.01)):
    system = ns.FilippovSystem([x, y], surface=surface, above=above, below=below)
    return Plane(system, np.zeros(0), box)


def marks(p):
    found = [m for curve in p.curves() for m in p.folds(curve) + p.pseudo_equilibria(curve)]
    return {(m.kind, m.side): m for m in found}


def harvest(level):
    a, d, effort, b = 0.3556, 0.0444, 0.2067, 0.3
    psi = a * x / (b + x)
    prey = x * (1 - x) - psi * y
    return ns.FilippovSystem(
        [x, y],
        surface=y - level,
        above=[prey, psi * y - d * y - effort * y],
        below=[prey, psi * y - d * y],
    )


@pytest.mark.parametrize("box", [(-4.0, 4.0, -4.0, 4.0), (-3.9, 4.0, -4.1, 4.3)])
def test_relay_slides_between_its_folds_into_a_pseudo_node(box):
    # problem 9: sliding for |x| < 2 on x + y = 0, pseudo-node at 0, grid points on the features
    p = plane([y - x, 3 * y - 10], [y - x, 3 * y + 10], x + y, box)
    found = marks(p)
    assert set(found) == {("invisible fold", 1), ("invisible fold", -1), ("pseudo-node", 0)}
    node = found["pseudo-node", 0]
    assert_allclose(node.point, 0, atol=1e-12)
    assert node.stable
    sliding = [
        piece for curve in p.curves() for piece in p.pieces(curve) if piece.kind != "crossing"
    ]
    assert [piece.kind for piece in sliding] == ["attracting"]
    assert_allclose(np.sort(sliding[0].points[[0, -1], 0]), [-2, 2], atol=1e-12)


def test_harvested_prey_has_the_folds_of_the_literature():
    # problem 7: folds of the field below on x2 = alpha
    p = Plane(harvest(0.95), np.zeros(0), (0.0, 1.2, 0.3, 1.5))
    found = marks(p)
    assert_allclose(found["visible fold", -1].point[0], 0.04280205655526992, rtol=1e-12)
    assert_allclose(found["invisible fold", 1].point[0], 0.7208612440191388, rtol=1e-12)
    for name in ("pseudo-node", "pseudo-saddle"):
        speed = p.at(found[name, 0].point).sliding
        assert_allclose(speed, 0, atol=1e-12)
    # pseudo-equilibria: alpha a = (1 - x)(b + x)
    roots = np.roots([-1.0, 0.7, 0.3 - 0.3556 * 0.95])
    got = sorted(found[name, 0].point[0] for name in ("pseudo-node", "pseudo-saddle"))
    assert_allclose(got, np.sort(roots), rtol=1e-12)


@pytest.mark.parametrize(
    "slope, kind, stable",
    [(-1, "pseudo-node", True), (1, "pseudo-saddle", None)],
)
def test_attracting_pseudo_equilibria(slope, kind, stable):
    found = marks(plane([slope * x, -1.0], [slope * x, 1.0]))
    assert found[kind, 0].stable is stable


@pytest.mark.parametrize(
    "slope, kind, stable",
    [(-1, "pseudo-saddle", None), (1, "pseudo-node", False)],
)
def test_repelling_pseudo_equilibria(slope, kind, stable):
    found = marks(plane([slope * x, 1.0], [slope * x, -1.0]))
    assert found[kind, 0].stable is stable


@pytest.mark.parametrize(
    "matrix, kind, stable",
    [
        ([[-1, 0], [0, -2]], "node", True),
        ([[1, 0.5], [0, 2]], "node", False),
        ([[-0.1, -1], [1, -0.1]], "focus", True),
        ([[0.1, -1], [1, 0.1]], "focus", False),
        ([[0, -1], [1, 0]], "centre", None),
        ([[1, 0], [0, -1]], "saddle", None),
    ],
)
def test_equilibria_are_found_and_named_on_their_own_side_only(matrix, kind, stable):
    (a, b), (c, d) = matrix
    u, v = x - 0.3, y - 0.4
    p = plane([a * u + b * v, c * u + d * v], [x - 1, y - 1])  # that of F2 is virtual
    (mark,) = p.equilibria()
    assert (mark.kind, mark.stable, mark.side) == (kind, stable, 1)
    assert_allclose(mark.point, [0.3, 0.4], atol=1e-12)
    if kind == "saddle":
        assert_allclose(np.abs(mark.directions), [[0, 1], [1, 0]], atol=1e-12)


def test_curved_surfaces_are_met_to_rounding():
    p = plane([y - 0.3 * x, -x - 0.3 * y], [y + x, y - x], x**2 + y**2 - 1)
    (curve,) = p.curves()
    assert_allclose(np.hypot(*curve.T), 1, atol=1e-14)
    assert_allclose(curve[0], curve[-1], atol=1e-9)


def test_pieces_cover_the_surface_and_are_what_they_say():
    p = plane([1.0, ca.sin(3 * x)], [1.0, ca.cos(2 * x)])
    (curve,) = p.curves()
    pieces = p.pieces(curve)
    assert len(pieces) > 4
    for left, right in pairwise(pieces):
        assert_allclose(left.points[-1], right.points[0])
        assert left.kind != right.kind
    for piece in pieces:
        at = piece.points[1:-1, 0]
        l1, l2 = np.sin(3 * at), np.cos(2 * at)
        want = {"attracting": (l1 < 0) & (l2 > 0), "repelling": (l1 > 0) & (l2 < 0)}
        assert np.all(want.get(piece.kind, l1 * l2 > 0))


def test_every_object_of_a_portrait_is_drawn_and_explained():
    figure = ns.plot.phase_portrait(harvest(0.95), (0.0, 1.2, 0.3, 1.5))
    ax = figure.axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x", "y")
    assert ax.get_xlim() == (0.0, 1.2) and ax.get_ylim() == (0.3, 1.5)
    kinds = {line.get_gid() for line in ax.lines}
    want = {"attracting", "crossing", "orbit", "separatrix", "fold orbit", "visible fold",
            "invisible fold", "pseudo-node", "pseudo-saddle", "focus"}  # fmt: skip
    assert want <= kinds
    legend = {text.get_text() for text in ax.get_legend().get_texts()}
    assert {"visible fold", "stable pseudo-node", "unstable focus", "separatrices"} <= legend


def test_drawn_orbits_follow_the_fields():
    p = Plane(harvest(0.95), np.zeros(0), (0.0, 1.2, 0.3, 1.5))
    ax = ns.plot.phase_portrait(p.system, (0.0, 1.2, 0.3, 1.5)).axes[0]
    orbits = [np.column_stack(ln.get_data()) for ln in ax.lines if ln.get_gid() == "orbit"]
    assert len(orbits) > 10
    for curve in orbits:
        step, values = np.diff(curve, axis=0), p.at((curve[1:] + curve[:-1]) / 2)
        off = np.abs(values.h) > 0.02
        field = np.where(values.h[:, None] > 0, values.above, values.below)
        size = np.linalg.norm(step, axis=1) * np.linalg.norm(field, axis=1)
        clear = off & (size > 1e-9)
        assert np.all(np.sum(step * field, axis=1)[clear] > 0.995 * size[clear])


def test_given_starts_and_parameters_are_used():
    level = ca.SX.sym("level")
    system = ns.FilippovSystem(
        [x, y], surface=y - level, above=[1, -1], below=[1, 1], parameters=[level]
    )
    figure = ns.plot.phase_portrait(
        system, ((-1, 1), (-1, 1)), parameters={"level": 0.25}, starts=[[-0.9, 0.9]], t_end=5.0
    )
    (orbit,) = [line for line in figure.axes[0].lines if line.get_gid() == "orbit"]
    data = np.column_stack(orbit.get_data())
    assert_allclose(data[0], [-0.9, 0.9])
    assert_allclose(data[-1, 1], 0.25, atol=1e-12)  # it slides out of the box
    assert data[-1, 0] > 1.0


def test_a_box_without_the_surface_is_drawn():
    figure = ns.plot.phase_portrait(harvest(5.0), (0.1, 1.2, 0.3, 1.5), title="below")
    assert figure.axes[0].get_title() == "below"


def test_global_settings_are_left_alone_and_files_are_written(tmp_path):
    before = dict(matplotlib.rcParams)
    figure = ns.plot.phase_portrait(harvest(0.95), (0.0, 1.2, 0.3, 1.5))
    assert dict(matplotlib.rcParams) == before
    for suffix, start in (("png", b"\x89PNG"), ("pdf", b"%PDF-"), ("svg", b"<?xml")):
        figure.savefig(tmp_path / f"plane.{suffix}")
        assert (tmp_path / f"plane.{suffix}").read_bytes().startswith(start)


def test_other_systems_and_boxes_are_refused():
    z, t = ca.SX.sym("z"), ca.SX.sym("t")
    box = (-1, 1, -1, 1)
    with pytest.raises(ns.DefinitionError, match="of 2 states and 1 surface, received int"):
        ns.plot.phase_portrait(3, box)
    space = ns.FilippovSystem([x, y, z], surface=x, above=[-1, 0, 0], below=[1, 0, 0])
    with pytest.raises(ns.DefinitionError, match="received 3 states: x, y, z"):
        ns.plot.phase_portrait(space, box)
    smooth = ns.FilippovSystem([x, y], field=[y, -x])
    with pytest.raises(ns.DefinitionError, match="received 0 surfaces"):
        ns.plot.phase_portrait(smooth, box)
    driven = ns.FilippovSystem([x, y], surface=x, above=[-1, t], below=[1, 0], time=t)
    with pytest.raises(ns.DefinitionError, match="received explicit time"):
        ns.plot.phase_portrait(driven, box)
    for wrong in (None, (1, -1, 0, 1), (0, 1, 2), "box", (0, 1, 0, np.inf)):
        with pytest.raises(ns.OptionError, match="box: expected"):
            ns.plot.phase_portrait(harvest(1.0), wrong)
    with pytest.raises(ns.PointError, match="starts: expected finite numbers of shape"):
        ns.plot.phase_portrait(harvest(1.0), box, starts=[1, 2])
