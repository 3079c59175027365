"""Orbits of a planar box: through crossing and sliding, both ways in time, and the separatrices."""

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import nonsmooth as ns
from nonsmooth.local.scans.box import Box
from nonsmooth.local.scans.plane_scan import PlaneScan
from nonsmooth.orbit.manifolds.plane_orbits import PlaneOrbits

x, y = ca.SX.sym("x"), ca.SX.sym("y")


def orbits(above, below, surface=y, box=(-2.0, 2.0, -2.0, 2.0), t_end=None):
    system = ns.FilippovSystem([x, y], surface=surface, above=above, below=below)
    return PlaneOrbits(PlaneScan.of(system, {}, Box(*box)), t_end)


@pytest.mark.slow
def test_an_orbit_in_chunks_is_that_of_simulate():
    block = orbits([y, -x - 0.4], [y, -x + 0.4], box=(-4.0, 4.0, -4.0, 4.0), t_end=15.0)
    curve = block.follow(np.array([3.0, 0.0]))
    run = ns.simulate(block.scan.where.system, [3.0, 0.0], t_end=15.0, tol=1e-12)
    assert_allclose(curve[-1], run.x[-1], atol=1e-7)  # it sticks
    fine = run(np.linspace(0.0, 15.0, 20_001))
    gaps = np.linalg.norm(curve[:, None] - fine[None], axis=2).min(axis=1)
    assert gaps.max() < 2e-3  # a step of the comparison
    for step in np.diff(curve, axis=0):
        assert np.linalg.norm(step / 8.0) < 1 / 80


def test_backward_orbits_lead_to_the_start():
    block = orbits([y, -x - 0.4], [y, -x + 0.4], box=(-4.0, 4.0, -4.0, 4.0), t_end=2.0)
    there = block.follow(np.array([3.0, 0.5]))
    back = block.follow(there[-1], ahead=False)
    assert_allclose(back[-1], [3.0, 0.5], atol=1e-6)


def test_the_frame_ends_an_orbit_a_little_outside():
    curve = orbits([1, 0.1], [1, 0.1], surface=y + 5).follow(np.array([0.0, 0.0]))
    assert curve[-1, 0] == pytest.approx(2.0 + 0.03 * 4)


def test_a_cut_ends_an_orbit():
    flow = orbits([y, -x], [y, -x], t_end=1e4)
    shown = []

    def cut(curve):
        shown.append(len(curve))
        return curve[:50]

    assert len(flow.follow(np.array([1.0, 0.0]), cut=cut)) == 50
    assert len(shown) == 1


def test_a_cycle_through_events_is_drawn_once_or_twice():
    """The van der Pol oscillator with y = 0 as surface: its cycle attracts within a turn."""
    field = [y, (1 - x**2) * y - x]
    flow = orbits(field, field, box=(-3.0, 3.0, -3.0, 3.0), t_end=1e4)
    curve = flow.follow(np.array([2.0, 0.0]))
    turns = np.sum((curve[1:, 1] > 0) & (curve[:-1, 1] <= 0))
    assert 2 <= turns <= 6
    assert curve[:, 0].max() == pytest.approx(2.00862, abs=1e-4)


def test_orbits_need_few_steps(monkeypatch):
    """Spirals to t = 10000: the orbits are cut where they meet, a few steps at a time."""
    runs = []

    def spy(*arguments, **options):
        runs.append(ns.simulate(*arguments, **options))
        return runs[-1]

    monkeypatch.setattr("nonsmooth.orbit.manifolds.plane_orbits.simulate", spy)
    field = [y - 0.01 * x, -x - 0.01 * y]
    flow = orbits(field, field, surface=y + 5, t_end=1e4)
    flow.follow(np.array([1.0, 0.0]))
    assert sum(len(run.t) for run in runs) < 700  # 1600 turns would take 10000
    runs.clear()
    for _, curve, _ in flow.spaced(8):
        assert np.all(np.isfinite(curve))
    assert max(len(run.t) for run in runs) < 30
    assert sum(len(run.t) for run in runs) < 3000


def test_separatrices_of_saddles_are_their_eigenlines():
    found = list(orbits([x, -(y - 1.0)], [1, 1]).separatrices())
    saddle = [c for name, c in found if name == "separatrix"]
    assert len(saddle) == 4
    vertical = [c for c in saddle if np.ptp(c[:, 1]) > 0.5]
    horizontal = [c for c in saddle if np.ptp(c[:, 1]) < 0.5]
    assert len(vertical) == len(horizontal) == 2
    for curve in vertical:  # the stable manifold, as far as the surface
        assert_allclose(curve[curve[:, 1] > 0.01, 0], 0, atol=1e-6)
    for curve in horizontal:
        assert_allclose(curve[:, 1], 1.0, atol=1e-6)
        assert abs(curve[-1, 0]) > abs(curve[0, 0])  # outward in time


def test_orbits_through_visible_folds_and_into_pseudo_saddles():
    flow = orbits([1.0, x], [1.0, 1.0])  # a visible fold of F1 at the origin: y = x^2/2
    curves = [c for name, c in flow.separatrices() if name == "fold orbit"]
    assert len(curves) == 2
    for curve in curves:
        above = curve[curve[:, 1] > 1e-6]
        assert_allclose(above[:, 1], above[:, 0] ** 2 / 2, atol=1e-7)
    into = orbits([x, -1.0], [x, 1.0])
    (found,) = into.scan.pseudo_equilibria
    curves = [c for name, c in into.separatrices() if name == "separatrix"]
    assert found.kind == "pseudo-saddle" and len(curves) == 2
    for curve in curves:
        assert_allclose(curve[-1], found.point, atol=1e-12)  # attracting: they end there
        assert_allclose(curve[:, 0], 0, atol=1e-9)


def test_evenly_spaced_orbits_fill_the_box_both_ways():
    flow = orbits([1.0, -0.5 * y], [1.0, -0.5 * y], surface=y + 5)
    curves = [orbit.curve for orbit in flow.spaced(6)]
    assert len(curves) >= 5
    assert curves[0][0, 0] < -1.9 and curves[0][-1, 0] > 1.9
    for curve in curves:
        assert np.all(np.diff(curve[:, 0]) >= 0)  # in the direction of time
        assert_allclose(curve[:, 1], curve[0, 1] * np.exp(-0.5 * (curve[:, 0] - curve[0, 0])))


def test_starts_that_are_not_finite_have_no_orbit():
    assert orbits([1, 1], [1, 1]).follow(np.array([np.nan, 0.0])).shape == (0, 2)


def ends_in_the_box(flow, curves, rests):
    """Ends, and whether each is on another of the curves or in one of the points, as the eye sees it."""
    for k, curve in enumerate(curves):
        if flow.scan.box.contains(curve[-1]):
            others = np.vstack([c for j, c in enumerate(curves) if j != k] + rests)
            gaps = np.linalg.norm((others - curve[-1]) / flow.scan.box.size, axis=1)
            yield curve[-1], gaps.min() < 1 / 150


@pytest.mark.slow
def test_every_orbit_goes_to_where_it_ends():
    """Predator and prey with a threshold: to sliding, to rest, to another orbit or out of the box."""
    system = ns.textbook.harvested_prey_predator().system
    flow = PlaneOrbits(PlaneScan.of(system, {"alpha": 1.06}, Box(0.0, 1.1, 0.3, 1.4)), None)
    curves = [orbit.curve for orbit in flow.spaced()]
    rests = [e.point for e in [*flow.scan.equilibria, *flow.scan.pseudo_equilibria]]
    ends = list(ends_in_the_box(flow, curves, rests))
    assert len(curves) > 20 and len(ends) > 15
    assert all(abs(end[1] - 1.06) < 1e-7 or reached for end, reached in ends)


def test_orbits_end_in_a_node_and_spirals_in_a_focus():
    for field in ([-x, -2 * y], [y - 0.8 * x, -x - 0.8 * y]):
        flow = orbits(field, field, surface=y + 1.9, t_end=1e3)
        ends = list(ends_in_the_box(flow, [o.curve for o in flow.spaced(6)], [np.zeros(2)]))
        assert len(ends) > 5 and all(reached for _, reached in ends)
        assert sum(bool(np.all(np.abs(end) < 1e-12)) for end, _ in ends) > 2


@pytest.mark.slow
def test_no_orbit_ends_in_mid_air_unless_it_thins_out():
    """A limit cycle through a surface that is crossed: where orbits crowd, and nothing ends on it."""
    smooth = 0.5 * (1 - x**2) * y - x
    flow = orbits([y, smooth - 0.3], [y, smooth + 0.3], surface=x, box=(-3, 3, -3, 3))
    spaced = list(flow.spaced())
    assert any(thins[1] for _, _, thins in spaced)
    for k, (_, curve, thins) in enumerate(spaced):
        others = np.vstack([o.curve for j, o in enumerate(spaced) if j != k])
        for end, thin, own in (
            (curve[0], thins[0], curve[60:]),
            (curve[-1], thins[1], curve[:-60]),
        ):
            gaps = np.linalg.norm((np.vstack([others, own]) - end) / flow.scan.box.size, axis=1)
            assert (
                thin
                or gaps.min() < 1 / 150
                or not flow.scan.box.contains(end)
                or (
                    np.linalg.norm(end) < 0.1  # the fused foci, around which it would wind for ever
                )
            )


def test_an_orbit_may_end_where_it_begins_to_slide():
    fall = orbits([1.0, -1.0], [1.0, 1.0])
    landed = fall.follow(np.array([-1.0, 0.5]), landing=True)
    assert_allclose(landed[-1], [-0.5, 0.0], atol=1e-12)
    assert fall.follow(np.array([-1.0, 0.5]))[-1, 0] > 2.0
