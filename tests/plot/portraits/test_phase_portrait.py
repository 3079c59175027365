"""Portraits of planar systems draw the objects of the planar theory, and refuse other systems."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from matplotlib.text import Text
from numpy.testing import assert_allclose

import nonsmooth as ns
from nonsmooth.local.scans.box import Box
from nonsmooth.local.scans.plane_scan import PlaneScan

x, y = ca.SX.sym("x"), ca.SX.sym("y")


def harvest(level):
    """Predators y that are harvested above a level (as the textbook's, without parameters)."""
    grazed = 0.3556 * x / (0.3 + x) * y
    prey, predators = x * (1 - x) - grazed, grazed - 0.0444 * y
    return ns.FilippovSystem(
        [x, y], surface=y - level, above=[prey, predators - 0.2067 * y], below=[prey, predators]
    )


@pytest.mark.slow
def test_every_object_of_a_portrait_is_drawn_and_explained():
    figure = ns.plot.phase_portrait(harvest(0.95), (0.0, 1.2, 0.3, 1.5))
    ax = figure.axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x", "y")
    assert ax.get_xlim() == (0.0, 1.2) and ax.get_ylim() == (0.3, 1.5)
    kinds = {line.get_gid() for line in ax.lines}
    expected = {"attracting", "crossing", "orbit", "separatrix", "fold orbit", "visible fold",
            "invisible fold", "stable pseudo-node", "pseudo-saddle", "unstable focus"}  # fmt: skip
    assert expected <= kinds
    legend = {text.get_text() for text in ax.get_legend().get_texts()}
    assert {"sliding, attracting", "crossing", "orbits", "separatrices"} <= legend
    named = {text.get_text() for text in ax.findobj(Text)}
    assert {"visible fold", "stable pseudo-node", "unstable focus", "$h > 0$", "$h < 0$"} <= named


@pytest.mark.slow
def test_drawn_orbits_follow_the_fields():
    system = harvest(0.95)
    scan = PlaneScan.of(system, {}, Box(0.0, 1.2, 0.3, 1.5))
    ax = ns.plot.phase_portrait(system, (0.0, 1.2, 0.3, 1.5)).axes[0]
    orbits = [np.column_stack(ln.get_data()) for ln in ax.lines if ln.get_gid() == "orbit"]
    assert len(orbits) > 10
    for curve in orbits:
        step, values = np.diff(curve, axis=0), scan.at((curve[1:] + curve[:-1]) / 2)
        off = np.abs(values.h) > 0.02
        field = np.where(values.h[:, None] > 0, values.fields[:, 0], values.fields[:, 1])
        size = np.linalg.norm(step, axis=1) * np.linalg.norm(field, axis=1)
        clear = off & (size > 1e-9)
        assert np.all(np.sum(step * field, axis=1)[clear] > 0.995 * size[clear])


def test_orbits_that_wind_out_of_a_focus_are_followed_to_it():
    """Slowly: an orbit that stops half-way seems to come from a cycle that is not there."""
    damping = 0.05
    system = ns.FilippovSystem(
        [x, y],
        surface=y - 0.5,
        above=[y, -x - 1 + 2 * damping * y],
        below=[y, -x + 1 + 2 * damping * y],
    )
    ax = ns.plot.phase_portrait(system, (-3, 3, -2.5, 2.5)).axes[0]
    (before, _) = [
        np.column_stack(line.get_data()) for line in ax.lines if line.get_gid() == "fold orbit"
    ]
    assert_allclose(before[[0, -1]], [[1.0, 0.0], [1.0 + 2 * damping * 0.5, 0.5]], atol=1e-6)
    # half a turn of x'' - 2 d x' + x = 1 makes its amplitude exp(pi d / sqrt(1 - d^2)) times as large
    turns = np.flatnonzero(before[1:-2, 1] * before[2:-1, 1] < 0) + 1
    sizes = np.abs(before[turns, 0] - 1.0)
    expected = np.exp(np.pi * damping / np.sqrt(1 - damping**2))
    assert len(turns) > 15
    assert_allclose(sizes[4:-1] / sizes[3:-2], expected, rtol=0.02)


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


@pytest.mark.slow
def test_other_systems_and_boxes_are_refused():
    z, t = ca.SX.sym("z"), ca.SX.sym("t")
    box = (-1, 1, -1, 1)
    with pytest.raises(ns.DefinitionError, match="FilippovSystem"):
        ns.plot.phase_portrait(3, box)
    space = ns.FilippovSystem([x, y, z], surface=x, above=[-1, 0, 0], below=[1, 0, 0])
    with pytest.raises(ns.DefinitionError, match="3 states"):
        ns.plot.phase_portrait(space, box)
    lam = ca.SX.sym("lam")
    hidden = ns.FilippovSystem(
        [x, y], surface=y, multipliers=lam, field=[1, -(lam**3)], hidden=True
    )
    with pytest.raises(ns.DefinitionError, match="hidden"):
        ns.plot.phase_portrait(hidden, box)
    driven = ns.FilippovSystem([x, y], surface=x, above=[-1, t], below=[1, 0], time=t)
    with pytest.raises(ns.DefinitionError, match="time"):
        ns.plot.phase_portrait(driven, box)
    for wrong in (None, (1, -1, 0, 1), (0, 1, 2), "box", (0, 1, 0, np.inf)):
        with pytest.raises(ns.OptionError, match=r"\bbox\b"):
            ns.plot.phase_portrait(harvest(1.0), wrong)
    with pytest.raises(ns.PointError, match="starts"):
        ns.plot.phase_portrait(harvest(1.0), box, starts=[1, 2])


@pytest.mark.slow
def test_an_orbit_that_continues_beside_another_thins_out():
    pendulum = ns.FilippovSystem(
        [x, y], surface=y, above=[y, -ca.sin(x) - 0.3], below=[y, -ca.sin(x) + 0.3]
    )
    ax = ns.plot.phase_portrait(pendulum, (-4, 4, -3, 3)).axes[0]
    ends = [c for c in ax.collections if c.get_gid() == "orbit"]
    assert ends
    lines = [line.get_xydata() for line in ax.lines if line.get_gid() == "orbit"]
    for end in ends:
        widths, parts = end.get_linewidths(), end.get_segments()
        assert np.all(np.diff(widths) > 0) and widths[0] < 0.05 and widths[-1] == 0.9
        for part, following in pairwise(parts):
            assert_allclose(part[-1], following[0])
        joins = [line[k] for line in lines for k in (0, -1)]
        assert min(np.linalg.norm(parts[-1][-1] - join) for join in joins) < 1e-12


@pytest.mark.slow
def test_an_equilibrium_on_the_surface_has_the_name_that_it_has():
    """Not that of a fold, which is visible or not by rounding."""
    ax = ns.plot.phase_portrait(harvest(0.80135528), (0.0, 1.2, 0.3, 1.5)).axes[0]
    named = {text.get_text() for text in ax.findobj(Text)}
    assert "boundary node" in named and "visible fold" not in named


def test_two_folds_in_one_point_are_named_together():
    fused = ns.FilippovSystem([x, y], surface=y, above=[1, -x - 0.1 * y], below=[-1, -x])
    ax = ns.plot.phase_portrait(fused, (-1, 1, -1, 1)).axes[0]
    assert "two invisible folds" in {text.get_text() for text in ax.findobj(Text)}


# discrete states, relays, conditions and contacts -------------------------------------------------


def _curves(ax, kind):
    return [np.column_stack(ln.get_data()) for ln in ax.lines if ln.get_gid() == kind]


@pytest.mark.slow
def test_each_value_of_a_discrete_state_has_a_panel_in_which_orbits_end_at_its_events():
    q = ca.SX.sym("q")
    on = ns.Reset(x + y - 1, {q: 1}, 1, level=True, when=q == 0, name="on")
    off = ns.Reset(ca.logic_and(x < -1, y < 2), {q: 0}, name="off", when=q == 1)
    system = ns.FilippovSystem([x, y], field=[y, q - x], discrete={q: (0, 1)}, resets=[on, off])
    box = (-3, 3, -3, 3)
    left, right = ns.plot.phase_portrait(system, box).axes
    assert (left.get_title(), right.get_title()) == ("q = 0", "q = 1")
    (line,) = _curves(left, "event on")
    assert_allclose(line.sum(axis=1), 1.0, atol=1e-12)
    for curve in _curves(left, "orbit"):  # circles around (0, 0) that end on the line
        assert curve.sum(axis=1).max() < 1.0 + 1e-6
        assert np.ptp(np.hypot(*curve.T)) < 1e-6
    assert not _curves(right, "event on") and _curves(right, "event off")
    for curve in _curves(right, "orbit"):  # none continues where x falls through -1
        sides = np.sign(curve[np.abs(curve[:, 0] + 1) > 1e-6, 0] + 1)
        assert np.all(np.diff(sides)[np.diff(sides) != 0] > 0)
    belt = ns.FilippovSystem(  # its surface, with a fold at x = 2, is drawn where there is motion
        [x, y], surface=y, above=[1, x - 2], below=[1, 1], discrete={q: (0, 1)}, resets=[on]
    )
    ax = ns.plot.phase_portrait(belt, box, holding={q: 0}, legend=False).axes[0]
    ends = [c[:, 0].max() for kind in ("attracting", "crossing") for c in _curves(ax, kind)]
    assert 0.9 < max(ends) <= 1.0 and not _curves(ax, "visible fold")
    one = ns.plot.phase_portrait(system, box, holding={"q": 1}, legend=False).axes
    assert len(one) == 1 and one[0].get_title() == "q = 1"
    assert len(_curves(one[0], "orbit")) == len(_curves(right, "orbit"))


def test_a_relay_has_a_panel_for_each_state():
    u = ca.SX.sym("u")
    system = ns.FilippovSystem(
        [x, y], field=[y - 2 * u, -x], surfaces=[ns.Relay(x, on=0.5, off=-0.5)], multipliers=[u]
    )
    on, off = ns.plot.phase_portrait(system, (-4, 4, -4, 4), legend=False).axes
    for ax, sign in ((on, 1), (off, -1)):
        assert all(sign * c[:, 0].min() > -4.2 for c in _curves(ax, "orbit"))
        for curve in _curves(ax, "orbit"):
            assert (sign * curve[:, 0]).min() > -0.5 - 1e-6
            assert np.ptp(np.hypot(curve[:, 0], curve[:, 1] - 2 * sign)) < 1e-6
    with pytest.raises(ns.OptionError, match="the state of the relay"):
        ns.plot.phase_portrait(system, (-4, 4, -4, 4), holding={"q": 1})


def test_the_boundary_of_a_condition_is_closed_or_opens_and_has_no_orbits_behind():
    u = ca.SX.sym("u")
    diode = ns.Complementarity(x, multiplier=u, name="diode")
    system = ns.FilippovSystem([x, y], field=[u - y, x - y + 0.5], complementarity=diode)
    scan = PlaneScan.of(system, {}, Box(-1, 1, -1, 1))
    kinds = {piece.kind: piece.points[:, 1] for piece in scan.pieces}
    assert kinds["attracting"].min() > -1e-9 > kinds["crossing"].min()
    (fold,), (rest,) = scan.folds, scan.pseudo_equilibria
    assert_allclose([*fold.point, *rest.point], [0, 0, 0, 0.5], atol=1e-12)
    assert (fold.kind, rest.kind, rest.stable) == ("invisible", "stable pseudo-node", True)
    assert not scan.equilibria
    ax = ns.plot.phase_portrait(system, (-1, 1, -1, 1)).axes[0]
    curves = _curves(ax, "orbit")
    assert len(curves) > 3 and all(curve[:, 0].min() > -1e-8 for curve in curves)
    texts = {text.get_text() for text in ax.get_legend().get_texts()}
    assert {"closed condition", "condition that opens", "no motion"} <= texts


@pytest.mark.slow
def test_orbits_end_at_a_contact():
    ball = ns.FilippovSystem([x, y], field=[y, -1], impacts=ns.Impact(x - 0.2, 0.5))
    ax = ns.plot.phase_portrait(ball, (-1, 2, -2, 2), legend=False).axes[0]
    curves = _curves(ax, "orbit")
    assert len(curves) > 3 and all(curve[:, 0].min() > 0.2 - 1e-8 for curve in curves)
    slowed = ns.FilippovSystem(
        [x, y], surface=y, above=[y, -2], below=[y, -1], impacts=ns.Impact(x)
    )
    ax = ns.plot.phase_portrait(slowed, (-1, 2, -2, 2), legend=False).axes[0]
    (line,) = _curves(ax, "crossing")
    assert 0.0 <= line[:, 0].min() < 0.1
