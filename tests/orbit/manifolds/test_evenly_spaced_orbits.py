"""Evenly spaced orbits keep their distance, and polylines show what the polynomials say."""

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import nonsmooth as ns
from nonsmooth.local.scans.box import Box
from nonsmooth.orbit.manifolds.evenly_spaced_orbits import Spacing, evenly_spaced, polyline

BOX = Box(0.0, 2.0, 0.0, 1.0)


def test_a_polyline_is_close_to_the_run_and_has_its_ends():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    circle = ns.FilippovSystem([x, y], field=[y, -x])
    run = ns.simulate(circle, [1.0, 0.0], t_end=6.0)
    curve = polyline(run, np.array([2.0, 2.0]))
    assert_allclose(np.hypot(*curve.T), 1, atol=1e-9)
    assert_allclose(curve[[0, -1]], run.x[[0, -1]])
    assert np.linalg.norm(np.diff(curve, axis=0) / 2, axis=1).max() < 1.01 / 90
    still = ns.simulate(ns.FilippovSystem([x, y], field=[0, 0]), [1.0, 2.0], t_end=1.0)
    assert_allclose(polyline(still, np.ones(2)), [[1.0, 2.0]] * len(polyline(still, np.ones(2))))


def test_a_curve_ends_where_another_has_been():
    spacing = Spacing(BOX, 12)
    up = np.column_stack([np.full(50, 1.0), np.linspace(0, 1, 50)])
    spacing.add(up)
    across = np.column_stack([np.linspace(0, 2, 400), np.full(400, 0.5)])
    kept = spacing.until_contact(across)
    assert 0.9 < kept[-1, 0] < 1.01
    assert not spacing.free([1.02, 0.5]) and spacing.free([1.3, 0.5])


def test_a_curve_ends_where_it_has_been_itself():
    spacing, turns = Spacing(BOX, 12), np.linspace(0, 6 * np.pi, 3000)
    circle = np.column_stack([1 + 0.6 * np.cos(turns), 0.5 + 0.3 * np.sin(turns)])
    kept = spacing.until_contact(circle)
    assert 1000 < len(kept) < 1300  # one turn


@pytest.mark.parametrize("count", [4, 8, 16])
def test_straight_orbits_have_the_given_number_and_distance(count):
    def follow(start, ahead, cut):
        end = 2.0 if ahead else 0.0
        x = np.linspace(start[0], end, 100)
        return cut(np.column_stack([x, np.full(100, start[1])]))

    curves = [curve for _, curve, _ in evenly_spaced(BOX, count, follow)]
    heights = np.sort([curve[0, 1] for curve in curves])
    assert len(curves) == count
    assert_allclose(np.diff(heights), 1 / count)
    for curve in curves:
        assert curve[0, 0] == 0.0 and curve[-1, 0] == 2.0


def test_no_orbit_starts_beside_an_avoided_curve():
    line = np.column_stack([np.linspace(0, 2, 200), np.full(200, 1 / 16)])

    def follow(start, ahead, cut):
        return cut(np.column_stack([np.full(100, start[0]), np.linspace(start[1], ahead, 100)]))

    found = list(evenly_spaced(BOX, 8, follow, avoid=[line]))
    assert found
    for start, curve, _ in found:
        assert start[1] > 1 / 8  # the row of starts on the line is left out
        assert curve[0, 1] == 0.0  # but orbits run through it


def lines_to_a_node(rests):
    """Two orbits of x' = -x, y' = -2 y on parabolas that touch at the origin."""
    box = Box(-1.0, 1.0, -1.0, 1.0)
    spacing, s = Spacing(box, 12, rests=rests), np.exp(-np.linspace(0, 9, 4000))
    first, second = (np.column_stack([0.9 * s, c * s**2]) for c in (0.5, 0.7))
    spacing.add(first)
    return spacing.until_contact(second)


def test_a_curve_continues_beside_another_until_they_are_one_line():
    kept = lines_to_a_node([])
    gap = 0.2 * (kept[-1, 0] / 0.9) ** 2 / 2  # in units of the box
    assert 0 < gap < 1 / 200


def test_a_curve_that_comes_to_an_equilibrium_ends_in_it():
    spacing = Spacing(BOX, 12, rests=[np.array([1.0, 0.5])])
    s = np.exp(-np.linspace(0, 9, 400))
    kept = spacing.until_contact(np.column_stack([1.0 + 0.9 * s, np.full(400, 0.5)]))
    assert_allclose(kept[-1], [1.0, 0.5], atol=0)
    away = np.column_stack([np.linspace(1.0, 2.0, 100), np.full(100, 0.5)])
    assert len(spacing.until_contact(away)) == 100  # it starts there


def test_a_curve_that_stays_beside_another_thins_out_there():
    box = Box(0.0, 4.0, 0.0, 2.0)
    line, spacing = np.linspace(0, 4, 800), Spacing(box, 12)
    spacing.add(np.column_stack([line, np.full(800, 1.0)]))
    kept = spacing.until_contact(np.column_stack([line, np.maximum(1.4 - line, 1.015)]))
    assert spacing.thins
    assert 0.3 < kept[-1, 0] < 1.0  # where they came close, and a little on
    spacing.until_contact(np.column_stack([line, np.full(800, 1.4)]))
    assert not spacing.thins  # far from it all the way
    meets = spacing.until_contact(np.column_stack([line, 1.4 - 0.4 * line]))
    assert not spacing.thins and meets[-1, 1] == pytest.approx(1.0, abs=0.01)


def test_orbits_are_tapered_at_the_right_end():
    box = Box(0.0, 4.0, 0.0, 2.0)

    def follow(start, ahead, cut):
        """Along hyperbolas that crowd at one edge."""
        x = np.linspace(start[0], 4.0 if ahead else 0.0, 300)
        return cut(np.column_stack([x, 1 + (start[1] - 1) * np.exp(0.7 * (start[0] - x))]))

    ends = [thins for _, _, thins in evenly_spaced(box, 12, follow)]
    assert any(end for _, end in ends) and not any(begin for begin, _ in ends)
