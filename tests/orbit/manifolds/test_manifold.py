"""Manifolds are those of closed forms: separatrices through switches, thresholds, surfaces."""

import sys

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.orbit.manifolds.invariant_manifolds import Follower
from tests.orbit.interrupts import interrupt, watch_progress
from tests.orbit.manifolds.test_dividing import SLOPE, plain
from tests.orbit.periodic_cases import CASES, PARAMETERS, double_well
from tests.proofs.systems import TEIXEIRA

x, y, z = (ca.SX.sym(s) for s in "xyz")


def test_smooth_saddle_and_its_curves_through_a_switch():
    """x' = x, y' = -y + x**2 on both sides of y = 1/2: W^u is y = x**2/3, W^s is x = 0."""
    field = [x, -y + x**2]
    system = ns.FilippovSystem([x, y], surface=y - 0.5, above=field, below=[field[0] + 0, field[1]])
    saddle = ns.find_equilibrium(system, [0.1, 0.1], side="-")
    out = ns.manifold(system, saddle, stable=False, length=4.0)
    assert out.dimension == 1 and len(out.arcs) == 2
    for arc in out.arcs:
        assert np.allclose(arc.points[:, 1], arc.points[:, 0] ** 2 / 3, rtol=0, atol=1e-9)
        steps = np.linalg.norm(np.diff(arc.points, axis=0), axis=1)
        assert arc.end == "length" and steps[:-1] == pytest.approx(0.04, rel=0.03)
    back = ns.manifold(system, saddle, length=2.0)
    for arc in back.arcs:
        assert np.abs(arc.points[:, 0]).max() < 1e-9 and np.all(np.diff(arc.t) < 0)
        assert abs(arc.points[-1, 1]) == pytest.approx(2.0, abs=1e-3)
    assert {arc.itinerary for arc in back.arcs} == {"-", "- +"}


def test_thresholds_of_the_double_well_are_on_the_orbits_through_its_fold():
    """B2: the orbits that come to the visible-visible two-fold divide the basins."""
    well = double_well()
    found = ns.manifold(
        well, ns.local.fold_fold(well, [0.0, 0.0]), length=30.0, spacing=0.001, tol=1e-13
    )
    thresholds = []
    for arc in found.arcs:
        p, w = arc.points[:, 0], arc.points[:, 1]
        for k in np.flatnonzero((w[:-1] * w[1:] < 0) & (p[:-1] > 0)):
            # close to v = 0 the curve is a parabola in v
            near = slice(k - 3, k + 5)
            thresholds.append(np.polyval(np.polyfit(w[near], p[near], 4), 0.0))
    exact = [float(value) for value in CASES["B2"]["thresholds"]]
    assert sorted(thresholds)[:3] == pytest.approx(exact, abs=1e-9)


def test_the_homoclinic_orbit_leaves_by_the_fold_and_ends_at_the_pseudo_saddle():
    """H1: at the homoclinic parameter the stable manifold begins at the visible fold."""
    values = {k: float(s) for k, s in CASES["H1"].items()}
    rho, c = float(PARAMETERS["H1"]["rho"]), values["c_homoclinic"]
    system = ns.FilippovSystem(
        [x, y], surface=y, above=[rho * x - (y - 1), x + rho * (y - 1)], below=[c, 1]
    )
    saddle = ns.find_pseudo_equilibrium(system, [values["x_pseudo_saddle"] + 0.01, 0.0])
    above = ns.manifold(system, saddle, length=12.0, spacing=1e-3, tol=1e-13).arcs[0]
    apart = np.linalg.norm(above.points - [values["x_fold"], 0.0], axis=1)
    near = int(np.argmin(apart))
    assert above.t[near] == pytest.approx(-values["flight"], abs=2e-3)
    # Before the fold the orbit is a parabola that touches y = 0 there; whether it passes or is caught
    # is for rounding to say.
    part = above.points[near - 10 : near - 1]
    touch = np.polynomial.Polynomial.fit(part[:, 0] - values["x_fold"], part[:, 1], 4)
    assert abs(touch(0.0)) < 1e-10 and abs(touch.deriv()(0.0)) < 1e-7
    slide = ns.manifold(system, saddle, stable=False, length=1.0)
    assert [arc.itinerary.split()[0] for arc in slide.arcs] == ["s", "s"]
    assert np.abs(slide.arcs[0].points[:20, 1]).max() < 1e-12


@pytest.mark.slow
def test_a_surface_of_a_saddle_in_space():
    """x' = -x, y' = -3 y, z' = z + x**2: the stable manifold is z = -x**2/3."""
    switched = ns.FilippovSystem(
        [x, y, z],
        surface=x - 0.4,
        above=[-x, -3 * y, z + x**2],
        below=[-x, -3 * y + 0 * x, z + x**2],
    )
    saddle = ns.find_equilibrium(switched, [0.1, 0.1, 0.1], side="-")
    found = ns.manifold(switched, saddle, length=0.8, spacing=0.1, max_orbits=120)
    assert found.dimension == 2 and 16 <= len(found.arcs) <= 120
    points = found.points
    assert np.allclose(points[:, 2], -(points[:, 0] ** 2) / 3, rtol=0, atol=1e-9)
    corners = points[found.triangles]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    ).sum()
    assert area > 1.6 and len(found.triangles) > 200
    flat = corners[:, :, :2]
    assert (np.linalg.norm(flat.mean(axis=1), axis=1) < 0.1).any()


@pytest.fixture(scope="module")
def sheets():
    """Orbits of both fields end on the line that slides to 0: one sheet above it, one below."""
    system = ns.FilippovSystem([x, y, z], surface=z, above=[x, -y, -1], below=[x, -y, 1])
    saddle = ns.find_pseudo_equilibrium(system, [0.1, 0.1, 0.0])
    return system, saddle, ns.manifold(system, saddle, length=0.8, spacing=0.2)


def test_the_surface_that_ends_on_a_sliding_curve(sheets):
    """Sliding on z = 0 has a saddle at 0 with W^s: x = 0; fields (x, -y, -+1) keep x = 0."""
    system, saddle, found = sheets
    assert saddle.kind == "pseudo-saddle"
    assert found.dimension == 2 and np.abs(found.points[:, 0]).max() < 1e-9
    assert found.points[:, 2].max() > 0.5 and found.points[:, 2].min() < -0.5
    assert {arc.itinerary for arc in found.arcs} == {"+", "-"}
    out = ns.manifold(system, saddle, stable=False, length=1.0)
    assert out.dimension == 1 and np.abs(out.arcs[0].points[:, 1:]).max() < 1e-9


def test_an_interrupted_surface_keeps_its_orbits(monkeypatch):
    system = ns.FilippovSystem(
        [x, y, z], surface=x + 9, above=[-x, -y, z], below=[-x, -y, z + 0 * x]
    )
    saddle = ns.find_equilibrium(system, [0.1, 0.1, 0.1])
    interrupt(monkeypatch, Follower, "arc", 9)
    found = ns.manifold(system, saddle, length=0.5, spacing=0.1)
    assert not found.complete and len(found.arcs) == 9 and "interrupted" in repr(found)
    assert np.abs(found.points[:, 2]).max() < 1e-12


def test_an_interrupted_curve_keeps_its_other_half(monkeypatch):
    system = ns.FilippovSystem([x, y], surface=x + 5, above=[x, -y], below=[x, -y + 0 * x])
    saddle = ns.find_equilibrium(system, [0.1, 0.1])
    whole = ns.manifold(system, saddle, length=1.0)
    interrupt(monkeypatch, Follower, "arc", 1)
    found = ns.manifold(system, saddle, length=1.0)
    assert not found.complete and found.dimension == 1 and len(found.arcs) == 1
    assert np.array_equal(found.arcs[0].points, whole.arcs[0].points) and whole.complete
    monkeypatch.undo()
    interrupt(monkeypatch, Follower, "arc", 0)
    with pytest.raises(KeyboardInterrupt):
        ns.manifold(system, saddle, length=1.0)


def test_an_interrupted_first_curve_is_kept_as_far_as_it_was_followed(monkeypatch):
    """A separatrix of sin(x) in many steps; the interrupt comes when some of them are done."""
    system = ns.FilippovSystem(
        [x, y], surface=y + 9, above=[y, ca.sin(x)], below=[y, ca.sin(x) + 0 * y]
    )
    saddle = ns.find_equilibrium(system, [0.1, 0.1], side="+")
    whole = ns.manifold(system, saddle, length=30.0, spacing=0.1)
    interrupt(monkeypatch, sys.modules[Follower.__module__], "simulate", 2)
    found = ns.manifold(system, saddle, length=30.0, spacing=0.1)
    assert not found.complete and len(found.arcs) == 1
    (arc,) = found.arcs
    assert arc.end == "interrupted" and 5 < len(arc.points) < len(whole.arcs[0].points)
    energy = arc.points[:, 1] ** 2 / 2 + np.cos(arc.points[:, 0])
    assert np.abs(energy - 1.0).max() < 1e-7
    same = len(arc.points) - 1  # the last one is where it was interrupted
    assert np.allclose(arc.points[:same], whole.arcs[0].points[:same], rtol=0, atol=0.05)


@pytest.mark.parametrize("more", [0, 1, 5])
def test_an_interrupted_second_sheet_leaves_the_first_one(monkeypatch, sheets, more):
    system, saddle, whole = sheets
    above = sum(arc.itinerary == "+" for arc in whole.arcs)
    interrupt(monkeypatch, Follower, "arc", above + more)
    found = ns.manifold(system, saddle, length=0.8, spacing=0.2)
    assert not found.complete and whole.complete and found.dimension == 2
    named = [arc.itinerary for arc in found.arcs]
    assert named.count("+") == above and named.count("-") == (more if more > 1 else 0)
    assert found.triangles.max() < len(found.points)


def test_orbits_of_a_manifold_are_counted(monkeypatch):
    counted, options = watch_progress(monkeypatch, sys.modules[ns.manifold.__module__])
    system = ns.FilippovSystem([x, y], surface=x + 5, above=[x, -y], below=[x, -y + 0 * x])
    saddle = ns.find_equilibrium(system, [0.1, 0.1])
    ns.manifold(system, saddle, length=1.0, progress=True)
    assert counted == [1, 1, "closed"] and options == [(None, True, "orbit")]


def test_backward_a_manifold_ends_where_sliding_begins():
    """The stable manifold of the saddle above meets y = -1, where both fields lead away."""
    system = ns.FilippovSystem([x, y], surface=y + 1, above=[x, -y], below=[0.3, -1.0 + 0 * y])
    saddle = ns.find_equilibrium(system, [0.1, 0.1], side="+")
    ends = {arc.end for arc in ns.manifold(system, saddle, length=3.0).arcs}
    assert ends == {"length", "sliding"}


def test_manifolds_are_saved(tmp_path):
    plain = ns.FilippovSystem([x, y], surface=x + 5, above=[x, -y], below=[x, -y + 0 * x])
    found = ns.manifold(plain, ns.find_equilibrium(plain, [0.1, 0.1]), length=1.0)
    found.save(tmp_path / "manifold")
    again = ns.load(tmp_path / "manifold")
    assert repr(again) == repr(found) and repr(again.arcs) == repr(found.arcs)
    assert np.array_equal(again.arcs[1].points, found.arcs[1].points)


def test_points_without_a_manifold_raise():
    node = ns.FilippovSystem([x, y], surface=x - 2, above=[-x, -y], below=[-x, -2 * y])
    found = ns.find_equilibrium(node, [0.1, 0.1], side="-")
    with pytest.raises(ns.DegenerateError, match="unstable directions"):
        ns.manifold(node, found, stable=False, length=1.0)
    virtual = ns.find_equilibrium(node, [0.1, 0.1], side="+")
    with pytest.raises(ns.DegenerateError, match="virtual"):
        ns.manifold(node, virtual, length=1.0)
    with pytest.raises(ns.OptionError, match=r"\bof\b.*Equilibrium"):
        ns.manifold(node, [0.0, 0.0], length=1.0)
    with pytest.raises(ns.OptionError, match="length"):
        ns.manifold(node, found, length=-1.0)
    kicked = ns.FilippovSystem(
        [x, y], surface=x - 2, above=[x, -y], below=[x, -2 * y], resets=ns.Reset(y - 1, [x, 0], 1)
    )
    with pytest.raises(ns.DefinitionError, match="system"):
        ns.manifold(kicked, ns.find_equilibrium(kicked, [0.1, 0.1], side="-"), length=1.0)


# periodic orbits and two-folds ----------------------------------------------------------------------

X, Y, Z = (ca.SX.sym(s) for s in ("X", "Y", "Z"))
R = ca.sqrt(X * X + Y * Y)


@pytest.mark.slow
def test_the_surface_of_a_saddle_cycle_is_its_closed_form():
    """rho' = -rho + z^2 and z' = z/5 about the circle of radius 1: rho = z^2/1.4 leaves it."""
    g = 1 - R + Z * Z
    system = ns.FilippovSystem([X, Y, Z], field=[-Y + X * g / R, X + Y * g / R, 0.2 * Z])
    cycle = ns.periodic_orbit(system, [1.0, 0.0, 0.0], period=2 * np.pi)
    found = ns.manifold(system, cycle, stable=False, length=14.0, spacing=0.3)
    u, v, w = found.points.T
    assert np.abs(np.hypot(u, v) - 1 - w * w / 1.4).max() < 1e-10
    assert w.max() > 0.8 and w.min() < -0.8  # both sheets
    corners = found.points[found.triangles]
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() < 2.5 * 0.3
    inside = ns.manifold(system, cycle, stable=True, length=2.0, spacing=0.3, max_orbits=32)
    assert np.abs(inside.points[:, 2]).max() == 0.0
    assert np.hypot(*inside.points[:, :2].T).min() < 0.8


@pytest.mark.slow
def test_a_cycle_through_a_switch_keeps_its_cylinder():
    """What leaves along z grows by exp(0.6 pi) a round, at different rates on the two sides."""
    g = 1 - R
    fields = [[-Y + X * g / R, X + Y * g / R, rate * Z] for rate in (0.2, 0.4)]
    system = ns.FilippovSystem([X, Y, Z], surface=Y, above=fields[0], below=fields[1])
    cycle = ns.periodic_orbit(system, [1.0, 0.1, 0.0], itinerary="+ -")
    assert abs(cycle.multipliers[1] - np.exp(0.6 * np.pi)) < 1e-11
    found = ns.manifold(system, cycle, stable=False, length=10.0, spacing=0.3)
    assert np.abs(np.hypot(*found.points[:, :2].T) - 1).max() < 1e-9
    assert np.abs(found.points[:, 2]).max() > 0.8


def test_a_negative_multiplier_has_a_moebius_band():
    c, s = X / R, Y / R
    onto = ca.vertcat(ca.horzcat((1 + c) / 2, s / 2), ca.horzcat(s / 2, (1 - c) / 2))
    away = ca.vertcat(R - 1, Z)
    along = onto @ away
    f = 0.15 * along - 0.7 * (away - along) + 0.5 * ca.vertcat(-Z, R - 1)
    system = ns.FilippovSystem([X, Y, Z], field=[-Y + X * f[0] / R, X + Y * f[0] / R, f[1]])
    cycle = ns.periodic_orbit(system, [1.0, 0.0, 0.0], period=2 * np.pi)
    assert abs(cycle.multipliers[1] + np.exp(0.3 * np.pi)) < 1e-11
    found = ns.manifold(system, cycle, stable=False, length=4.0, spacing=0.05)
    count = 0
    for arc in found.arcs:  # up to where the band is as wide as the circle
        u, v, w = arc.points.T
        width, half = np.hypot(np.hypot(u, v) - 1, w), np.arctan2(v, u) / 2
        across = -np.sin(half) * (np.hypot(u, v) - 1) + np.cos(half) * w
        first = int(np.argmax(np.append(width, 1.0) > 0.6))
        assert np.abs(across[:first]).max(initial=0.0) < 1e-10
        count += first
    assert count > 100


def test_the_surface_that_divides_orbits_passing_a_two_fold():
    system, fold = plain()
    found = ns.manifold(system, fold, length=1.0, spacing=0.1)
    for arc in found.arcs:
        start, t = arc.points[0], arc.t
        assert abs(start[2] - SLOPE * start[1]) < 1e-7 and abs(start[0]) < 1e-12
        height, bend = (start[1], 1.0) if arc.itinerary[0] == "+" else (start[2], -1.0)
        assert np.abs(arc.points[:, 0] - height * t - bend * t * t / 2).max() < 1e-9
    # a second method: beside it orbits slide and leave to either side, on it they come to s
    arc = found.arcs[len(found.arcs) // 4]
    middle = arc.points[len(arc.points) // 2]
    ends = [
        ns.simulate(system, middle + np.array([0.0, d, 0.0]), 9.0).itinerary for d in (-1e-4, 1e-4)
    ]
    assert ends == ["+ s -", "+ s +"]
    assert len(found.triangles) > 100 and len(found.arcs) > 20


@pytest.mark.slow
def test_what_leaves_a_canard_is_a_surface_too():
    found = ns.manifold(*plain(), stable=False, length=1.0, spacing=0.2)
    assert all(abs(a.points[0, 2] - SLOPE * a.points[0, 1]) < 1e-7 for a in found.arcs)
    assert all(a.t[-1] > 0 and a.points[0, 1] >= 0 for a in found.arcs)


def test_orbits_and_two_folds_without_a_surface_raise():
    relaxing = ns.FilippovSystem([X, Y], field=[Y, (1 - X * X) * Y - X])
    cycle = ns.periodic_orbit(relaxing, ns.simulate(relaxing, [2.0, 0.0], 40.0))
    with pytest.raises(ns.DegenerateError, match="three dimensions"):
        ns.manifold(relaxing, cycle, length=1.0)
    fold = ns.find_two_fold(TEIXEIRA, near=[0.0, 0.1, -0.1])
    with pytest.raises(ns.DegenerateError, match="canard"):
        ns.manifold(TEIXEIRA, fold, length=1.0)
