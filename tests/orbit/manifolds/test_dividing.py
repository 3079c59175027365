"""Dividing surfaces cut by planes of starts are those of closed forms, and what simulations find."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.orbit.manifolds.two_fold_sheet import TwoFoldSheet
from tests.orbit.interrupts import interrupt
from tests.proofs.systems import TEIXEIRA

X, Y, Z, W = (ca.SX.sym(name) for name in "XYZW")

#: Sliding is (Y, Z)' = [[-0.3, 1], [1, 0.5]] (Y, Z) but for a factor: this is Z/Y on the canard.
SLOPE = 0.4 - np.sqrt(1.16)

#: Starts at the height 0.3 touch the surface where Y = -sqrt(0.6) at the start.
TOUCHES = -np.sqrt(0.6)


def base():
    """Two visible folds in three states."""
    return [Y, 1, 0.5], [Z, 0.3, -1.0]


def carried(states, to, back, rates=()):
    """The base with further stable states, in other coordinates.

    ``to`` and ``back`` are expressions: new coordinates of old ones, and old ones of the new ``states``.
    """
    extra = [W][: len(rates)]
    old = ca.vertcat(X, Y, Z, *extra)
    slope = ca.jacobian(ca.vertcat(*to), old)
    fields = []
    for field in base():
        full = ca.vertcat(*field, *(rate * w for rate, w in zip(rates, extra, strict=True)))
        fields.append(ca.vertsplit(ca.substitute(ca.mtimes(slope, full), old, ca.vertcat(*back))))
    return ns.FilippovSystem(states, surface=back[0], above=fields[0], below=fields[1])


def miss(old):
    """How far starts above the surface, in old coordinates (k, 3 or more), are from both parts."""
    height, y, z = old[:, :3].T
    t = -y - np.sqrt(np.maximum(y * y - 2 * height, 0.0))  # they come to the surface
    return z + t / 2 - SLOPE * (y + t), y + np.sqrt(2 * height)


def require_closed_form(found, old, tol=1e-12):
    """Points of both kinds of arcs are on the surface; at least one of each."""
    kinds = set()
    for arc in found.arcs:
        slides, touches = miss(old(arc.starts.T).T)
        kinds.add(arc.kind)
        if arc.kind == "grazing":
            assert np.abs(touches).max() < tol
        else:
            apart = touches < -1e-3  # beside the junction the time above is a root of rounding
            assert apart.sum() > 3 and np.abs(slides[apart]).max() < tol
            assert np.abs(old(arc.decided.T)[:3]).max() < tol
    assert kinds == {"grazing", "two-fold"}


def plain():
    above, below = base()
    system = ns.FilippovSystem([X, Y, Z], surface=X, above=above, below=below)
    return system, ns.find_two_fold(system, near=[0.0, 0.01, 0.01])


#: Starts at the height 0.3.
CUT = {"starts": lambda a, b: [0.3, a, b], "duration": 6.0}


@pytest.mark.slow
def test_three_states_cut_at_a_height():
    found = ns.manifold(*plain(), **CUT, box=[(-2, -0.5), (-1, 1)], spacing=0.2)
    require_closed_form(found, lambda x: x)
    assert [(a.itinerary, a.begin, a.end) for a in found.arcs] == [
        ("+", "bound", "junction"),
        ("+ s", "junction", "bound"),
    ]
    assert found.junctions == pytest.approx(np.array([[TOUCHES, TOUCHES / 2]]), abs=1e-14)
    slides = found.arcs[1]
    assert np.allclose(slides.points, slides.starts[:, 1:], rtol=0, atol=0)
    y = slides.points[1:, 0]
    entry = -y - np.sqrt(y * y - 0.6)
    assert slides.entry[1:] == pytest.approx(entry, abs=1e-7)
    # on the canard L2 - L1 = (SLOPE - 1) Y, so time and Y are proportional
    rate = SLOPE - 0.3
    assert slides.t[1:] - entry == pytest.approx((y + entry) * (1 - SLOPE) / rate, abs=1e-7)
    assert slides.points[-1, 1] == 1.0  # the box is reached exactly


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4])
def test_four_states_mixed_by_a_linear_map(seed):
    """Two-folds are a line; the surface does not feel the fourth direction, but all states do."""
    v = [ca.SX.sym(f"v{k}") for k in range(4)]
    mix = np.eye(4) + 0.3 * np.random.default_rng(seed).uniform(-1, 1, (4, 4))
    inverse = np.linalg.inv(mix)
    to = ca.vertsplit(ca.mtimes(ca.SX(mix), ca.vertcat(X, Y, Z, W)))
    back = ca.vertsplit(ca.mtimes(ca.SX(inverse), ca.vertcat(*v)))
    system = carried(v, to, back, [-0.4])
    fold = ns.find_two_fold(system, near=mix @ [0.0, 0.05, 0.05, 0.2], hold=["v3"])
    corner, first, second = [0.3, -1.2, 0.0, 0.3], [0, 1, 0, 0.3], [0, 0, 1, -0.2]
    plane = [mix @ corner, mix @ first, mix @ second]
    box = [(-0.6, 0.7), (-1, 1)]
    found = ns.manifold(system, fold, starts=plane, box=box, duration=5.0, spacing=0.3)
    require_closed_form(found, lambda x: inverse @ x)
    assert found.junctions == pytest.approx(
        np.array([[1.2 + TOUCHES, TOUCHES / 2]]), rel=0, abs=1e-13
    )
    folds = found.arcs[1].decided @ inverse.T
    assert np.ptp(folds[:, 3]) > 0.02  # they are other two-folds


def bent():
    """The base and a stable state in bent coordinates: a curve of two-folds, a bent sheet."""
    v = [ca.SX.sym(f"v{k}") for k in range(4)]
    y, z = Y + 0.3 * W**2, Z + 0.2 * Y * W
    to = [X + 0.1 * y * z, y, z, W]
    old_y = v[1] - 0.3 * v[3] ** 2
    old = [v[0] - 0.1 * v[1] * v[2], old_y, v[2] - 0.2 * old_y * v[3], v[3]]
    into = ca.Function("into", [ca.vertcat(*v)], [ca.vertcat(*old)])
    out = ca.Function("out", [ca.vertcat(X, Y, Z, W)], [ca.vertcat(*to)])
    return carried(v, to, old, [-0.4]), into, out


@pytest.mark.slow
def test_four_states_in_bent_coordinates():
    system, into, out = bent()
    fold = ns.find_two_fold(system, near=[0.0, 0.05, 0.05, 0.2], hold=["v3"])
    found = ns.manifold(
        system,
        fold,
        starts=lambda a, b: out(ca.vertcat(0.3, a, b, 0.5 + 0.3 * a - 0.2 * b)),
        box=[(-1.6, -0.5), (-1, 0.5)],
        duration=5.0,
        spacing=0.3,
    )
    require_closed_form(found, lambda x: np.array(into(x)), tol=1e-11)
    assert found.complete and len(found.curves) == 1


@pytest.mark.slow
def test_five_states_without_a_closed_form_are_those_of_bisection():
    """Rates of the folds vary with states that turn about each other; simulations find the same."""
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    turning = [-0.2 * a + b + 0.1 * Y, -a - 0.2 * b]
    above = [Y + 0.2 * a, 1 + 0.2 * Z, 0.5 + 0.3 * b, *turning]
    below = [Z - 0.1 * b * Y, 0.3 - 0.2 * a, -1 + 0.1 * Y, *turning]
    system = ns.FilippovSystem([X, Y, Z, a, b], surface=X, above=above, below=below)
    fold = ns.find_two_fold(system, near=[0, 0, 0, 0.1, 0.1], hold=["a", "b"])
    start = lambda p, q: [0.3, p, q, 0.2, 0.1 * p]
    box = [(-2, -0.6), (-1, 1)]
    found = ns.manifold(system, fold, starts=start, box=box, duration=4.0, spacing=0.4)
    assert {arc.kind for arc in found.arcs} == {"two-fold", "grazing"}
    for arc in found.arcs:
        for p, q in arc.points[1:-1][:: max(1, len(arc.points) // 3)]:
            axis = 1 if arc.kind == "two-fold" else 0
            low, high = np.array([p, q]), np.array([p, q])
            low[axis] -= 1e-3
            high[axis] += 1e-3
            side = lambda u: ns.simulate(system, start(*u), 4.0, tol=1e-12).itinerary[-1]
            first = side(low)
            assert {first, side(high)} == {"+", "-"}
            for _ in range(22):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if side(middle) == first else (low, middle)
            assert abs(low[axis] - (p, q)[axis]) < 1e-9


def test_gaps_have_their_derivatives():
    system, _, out = bent()
    fold = ns.find_two_fold(system, near=[0.0, 0.05, 0.05, 0.2], hold=["v3"])
    sheet = TwoFoldSheet(system, fold.point, 1.0)
    point = np.array(out(ca.vertcat(0, -0.5, 0.4, 0.3))).ravel()
    where, h = sheet.where, 1e-5

    def on_surface(x):
        for _ in range(5):
            at = where.at(x)
            x = x - at.h * at.gradient / (at.gradient @ at.gradient)
        return x

    near = sheet.meet(point, None)
    for _ in range(3):
        point = on_surface(point + near.gap * near.across)
        near = sheet.meet(point, near)
    assert abs(near.gap) < 1e-12
    reached = sheet.meet(point, near)
    for way in where.at(point).tangents.T:
        one, other = (sheet.meet(on_surface(point + d * way), near).gap for d in (h, -h))
        assert (one - other) / (2 * h) == pytest.approx(reached.slope @ way, abs=1e-9)


def test_backward_the_same_surface_divides_what_leaves():
    """Reversing both fields turns visible folds over: those that leave are those of the reversed system."""
    above, below = base()
    system = ns.FilippovSystem(
        [X, Y, Z], surface=X, above=[-f for f in above], below=[-f for f in below]
    )
    fold = ns.find_two_fold(system, near=[0.0, 0.01, 0.01])
    found = ns.manifold(
        system,
        fold,
        stable=False,
        starts=[[0.3, 0, 0], [0, 1, 0], [0, 0, 1]],
        box=[(-2, -0.5), (-1, 1)],
        duration=6.0,
        spacing=0.4,
    )
    require_closed_form(found, lambda x: x)
    assert not found.stable


def test_curves_along_a_coordinate_are_found_too():
    """Edges of cells meet them at right angles: the arc that touches has one speed at the start."""
    found = ns.manifold(*plain(), **CUT, box=[(-1.2, -0.5), (-1, -0.7)], spacing=0.4)
    (arc,) = found.arcs
    assert (arc.itinerary, arc.begin, arc.end) == ("+", "bound", "bound")
    assert np.abs(arc.points[:, 0] - TOUCHES).max() < 1e-13


def opening():
    """A rolling body leaves a ground whose load falls as 1 - T; the pull A = Y decides how."""
    t = ca.SX.sym("T")
    # h = X, X' = Y -+ (1 - T), Y' = 1/2: sliding keeps X = 0, and Y = Y0 + T/2 at the stop T = 1.
    system = ns.FilippovSystem(
        [X, Y, t],
        surface=X,
        above=[Y - (1 - t), 0.5, 1],
        below=[Y + (1 - t), 0.5, 1],
        stops=[ns.Stop(t - 1, name="open"), ns.Stop(t - 5, name="never")],
    )
    return system, ns.find_two_fold(system, near=[0.0, 0.0, 1.0])


OPENED = {"starts": lambda a, b: [a, b, 0.0], "duration": 5.0, "until": "open", "spacing": 0.4}


@pytest.mark.slow
@pytest.mark.parametrize("computed", [False, True])
def test_orbits_that_end_where_both_fields_agree(computed):
    starts = ns.orbit.ComputedStarts(lambda u: (7.0, [*u, 0.0]))
    given = OPENED | ({"starts": starts} if computed else {})
    found = ns.manifold(*opening(), **given, box=[(-1.1, 1.03), (-2.07, 2.0)])
    kinds = {arc.itinerary for arc in found.arcs}
    assert kinds == {"+", "+ s", "- s", "-"}
    for arc in found.arcs:
        a, b = arc.points.T
        assert np.abs(arc.t - (8.0 if computed else 1.0)).max() < 1e-12
        assert np.abs(arc.starts[:, :2] - arc.points).max() == 0.0
        if arc.kind == "two-fold":
            assert np.abs(b + 0.5).max() < 1e-12  # Y0 + 1/2 = 0
        else:  # it comes to the stop with X = X0 + Y0 + 1/4 -+ 1/2 = 0
            assert np.abs(a + b + 0.25 - (0.5 if arc.itinerary == "+" else -0.5)).max() < 1e-12
    corners = np.array([[-0.25, -0.5], [0.75, -0.5]])
    near = [np.abs(found.junctions - corner).max(axis=1).min() for corner in corners]
    assert max(near) < 1e-11


def test_a_curve_is_followed_from_points_of_it():
    begin = [("s", (0.0, -0.5)), ("+ s", (0.1, -0.5)), ("+ s", (0.2, -0.5))]
    found = ns.manifold(*opening(), **OPENED, box=[(-1.0, 1.0), (-2.0, 2.0)], begin=begin)
    assert [(arc.itinerary, arc.end) for arc in found.arcs] == [("+ s", "junction"), ("+", "bound")]
    assert found.arcs[0].points[:3, 0].tolist() == [0.0, 0.1, 0.2]
    assert found.junctions == pytest.approx(np.array([[0.75, -0.5]]), abs=1e-11)
    assert found.arcs[1].points[-1] == pytest.approx([1.0, -0.75], abs=1e-13)


def test_invalid_events_of_dividing_surfaces_raise():
    system, fold = opening()
    good = dict(starts=lambda a, b: [a, b, 0.0], box=[(-1, 1), (-2, 2)], duration=5.0)
    with pytest.raises(ns.OptionError, match="until"):
        ns.manifold(system, fold, until="lift-off", **good)
    with pytest.raises(ns.DegenerateError, match=r"two-fold.*'never'"):
        ns.manifold(system, fold, until="never", **good)
    with pytest.raises(ns.OptionError, match=r"stable.*until="):
        ns.manifold(system, fold, until="open", stable=False, **good)
    with pytest.raises(ns.OptionError, match=r"starts.*until="):
        starts = ns.orbit.ComputedStarts(lambda u: (0.0, [*u, 0.0]))
        ns.manifold(system, fold, **{**good, "starts": starts})
    for begin in (5, [("+ s", (0.1, -0.5))], [("+ s", (0.1,))] * 2, [("+ s", "no")] * 2):
        with pytest.raises(ns.OptionError, match="begin"):
            ns.manifold(system, fold, until="open", begin=begin, **good)
    with pytest.raises(ns.OptionError, match=r"until.*begin.*starts="):
        ns.manifold(system, fold, until="open", length=1.0)


# interruption and refusals ---------------------------------------------------------------------------


@pytest.mark.parametrize("calls", [20, pytest.param(40, marks=pytest.mark.slow)])
def test_an_interrupted_curve_keeps_its_points(monkeypatch, calls):
    system, fold = plain()
    interrupt(monkeypatch, TwoFoldSheet, "meet", calls)
    found = ns.manifold(system, fold, **CUT, box=[(-2, -0.5), (-1, 1)], spacing=0.2)
    assert not found.complete and "interrupted" in repr(found)
    assert sum(len(arc.points) for arc in found.arcs) > 3
    for arc in found.arcs:
        slides, touches = miss(arc.starts)
        bad = touches if arc.kind == "grazing" else slides[touches < -1e-3]
        assert np.abs(bad).max(initial=0.0) < 1e-12


def test_curves_are_saved(tmp_path):
    found = ns.manifold(*plain(), **CUT, box=[(-1.5, -0.9), (-0.5, 0.5)], spacing=0.5)
    found.save(tmp_path / "curves")
    again = ns.load(tmp_path / "curves")
    assert repr(again) == repr(found)
    assert np.array_equal(again.arcs[0].points, found.arcs[0].points)


def test_invalid_planes_of_starts_raise():
    system, fold = plain()
    good = {**CUT, "box": [(-2, -0.5), (-1, 1)]}
    with pytest.raises(ns.OptionError, match="starts"):
        ns.manifold(system, fold, **{**good, "starts": [[0.3, 0, 0]]})
    with pytest.raises(ns.OptionError, match="starts"):
        ns.manifold(system, fold, **{**good, "starts": lambda a, b: [a, b]})
    with pytest.raises(ns.OptionError, match=r"starts.*coordinates"):
        ns.manifold(system, fold, **{**good, "starts": lambda a, b: [a, b, X]})
    with pytest.raises(ns.OptionError, match=r"\bbox\b"):
        ns.manifold(system, fold, **{**good, "box": [(1, -1), (0, 1)]})
    with pytest.raises(ns.OptionError, match="duration"):
        ns.manifold(system, fold, **{**good, "duration": None})
    with pytest.raises(ns.OptionError, match="length"):
        ns.manifold(system, fold)
    with pytest.raises(ns.OptionError, match="TwoFold"):
        ns.manifold(system, ns.local.fold(system, [0.0, 0.0, -1.0]), **good)
    with pytest.raises(ns.DegenerateError, match=r"starts.*dividing surface"):
        ns.manifold(system, fold, **{**good, "box": [(1, 2), (1, 2)]})
    fold = ns.find_two_fold(TEIXEIRA, near=[0.0, 0.1, -0.1])
    with pytest.raises(ns.DegenerateError, match="canard"):
        ns.manifold(TEIXEIRA, fold, **good)


@pytest.mark.slow
def test_a_curve_continues_where_starts_change_sides():
    """On either side of it orbits leave the two-fold to different sides, also where it meets the surface."""
    system, fold = plain()
    start = lambda a, b: [a, b, 0.6 - 0.3 * b]
    box = [(-0.8, 0.83), (-2.1, 1.07)]
    found = ns.manifold(system, fold, starts=start, box=box, duration=6.0, spacing=0.4)
    (curve,) = found.curves
    assert sorted(arc.itinerary for arc in curve) == ["+ s", "-", "- s"]
    # - touches the surface at a time t with z - t = 0 and x + z t - t^2/2 = 0: z^2 = -2 x; the junction
    # also has y + 0.3 t = 0 there
    b = -0.18 / (1 - 0.09)
    z = 0.6 - 0.3 * b
    assert found.junctions == pytest.approx(np.array([[-z * z / 2, b]]), abs=1e-12)
    for arc in curve:
        for before, at, after in zip(arc.points, arc.points[1:], arc.points[2:], strict=False):
            along = (after - before) / np.linalg.norm(after - before)
            across = 1e-4 * np.array([-along[1], along[0]])
            ends = {
                ns.simulate(system, start(*u), 6.0).itinerary[-1]
                for u in (at + across, at - across)
            }
            assert ends == {"+", "-"}
