"""A scan of a surface finds its regions, fold curves, cusps, two-folds and pseudo-equilibria."""

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import nonsmooth as ns
from nonsmooth.local.scans.box import Box
from nonsmooth.local.scans.surface_scan import SurfaceScan

x, y, z, a = (ca.SX.sym(name) for name in "xyza")
BOX = Box(-1.0, 1.01, -1.0, 1.0)


def scan(above, below, surface=x, box=BOX, parameters=None, **options):
    system = ns.FilippovSystem(
        [x, y, z], surface=surface, above=above, below=below, parameters=parameters or {}
    )
    values = {str(k): v for k, v in (parameters or {}).items()}
    return SurfaceScan.of(system, values, box, **options)


def test_regions_are_those_of_the_signs():
    found = SurfaceScan.of(ns.textbook.two_fold("II-C").system, {}, Box(-1, 1.01, -1, 1.01))
    u, v = found.mesh
    z2, z3 = np.meshgrid(u, v)
    expected = np.where(z2 > 0, np.where(z3 > 0, 0, 3), np.where(z3 > 0, 2, 1))
    away = (np.abs(z2) > 1e-9) & (np.abs(z3) > 1e-9)
    assert np.array_equal(found.regions[away], expected[away])


@pytest.mark.parametrize("label", ["VV-C1", "II-C", "mix-S"])
def test_two_folds_are_found_with_their_class(label):
    found = SurfaceScan.of(ns.textbook.two_fold(label).system, {}, Box(-0.7, 0.9, -1.1, 0.8))
    (fold,) = found.two_folds
    assert fold.label == label
    assert_allclose(fold.point, 0, atol=1e-14)


def test_a_curved_surface_is_lifted_to_rounding_and_its_holes_are_left_out():
    # the upper half of a sphere over the disk, found from above
    found = scan([1, 0, 0], [0, 1, 0], surface=x**2 + y**2 + z**2 - 0.5, guess=0.7,
                 coordinates=("y", "z"))  # fmt: skip
    flat = BOX.grid(41)
    lifted = found.lift(flat)
    inside = np.sum(flat**2, axis=1) < 0.49
    assert np.isnan(lifted[np.sum(flat**2, axis=1) > 0.51]).any(axis=1).all()
    assert_allclose(lifted[inside, 0], np.sqrt(0.5 - np.sum(flat**2, axis=1)[inside]), atol=1e-12)
    assert np.array_equal(found.flat(lifted)[inside], flat[inside])


def test_cusps_are_solved_for():
    # L1 = z + y^2 - .3, L11 = y' 2 y + z': cusp where 2 y (1 + y^3) + .2 = 0 on the parabola
    found = scan([z + y**2 - 0.3, 1 + y**3, 0.2], [1, 0.3, 0.1 - z], box=Box(-0.5, 0.6, -0.5, 0.6))
    (curve,) = [c for c in found.folds if c.side == "+"]
    roots = np.roots([2.0, 0.0, 0.0, 2.0, 0.2])
    (at,) = [r.real for r in roots if abs(r.imag) < 1e-12 and abs(r) < 0.5]
    assert_allclose(curve.cusps, [[at, 0.3 - at**2]], atol=1e-12)
    seen = {visible: points for points, visible in curve.pieces}
    assert seen[True][:, 0].min() == pytest.approx(at) == seen[False][:, 0].max()
    for points in seen.values():
        assert_allclose(points[:, 1], 0.3 - points[:, 0] ** 2, atol=1e-12)


def test_folds_of_the_other_field_carry_its_letter():
    found = scan([1, 0, 0], [y - 0.25, 1, 0])
    (curve,) = found.folds
    assert curve.side == "-" and len(curve.pieces) == 1 and curve.cusps.shape == (0, 2)
    points, visible = curve.pieces[0]
    assert_allclose(points[:, 0], 0.25, atol=1e-13)
    assert not visible  # L22 = 1 > 0: the orbit below turns up, away from its side


def test_pseudo_equilibria_and_parameters():
    # the sliding field is the mean of the fields
    found = scan([-1, y - a, z], [1, y - a, z - 0.2], parameters={a: 0.3})
    (e,) = found.pseudo_equilibria
    assert_allclose(e.point, [0, 0.3, 0.1], atol=1e-13)
    assert e.kind == "pseudo-saddle"


def test_the_flattest_coordinates_are_chosen():
    names = [scan([1, 1, 1], [0, 1, 1], surface=h).left_out for h in (x + 0.1 * y, 5 * z + y, y)]
    assert names == [0, 2, 1]


@pytest.mark.parametrize("coordinates", [("x",), ("x", "x"), ("x", "q")])
def test_bad_coordinates_are_refused(coordinates):
    with pytest.raises(ns.DefinitionError, match="coordinates: expected two of the states"):
        scan([1, 0, 0], [0, 1, 0], coordinates=coordinates)


def test_no_surface_over_the_box_is_refused():
    with pytest.raises(ns.DefinitionError, match="surface: "):
        scan([1, 0, 0], [0, 1, 0], surface=x**2 + 1)


def test_a_degenerate_cusp_stays_where_the_folds_change():
    # L1 = z, L11 = y^3: a triple zero, which Newton's method approaches slowly
    found = scan([z, 1, y**3], [1, 0.3, 0.1], box=Box(-0.5, 0.61, -0.5, 0.6))
    (curve,) = found.folds
    assert len(curve.pieces) == 2
    assert_allclose(curve.cusps, [[0, 0]], atol=0.01)
