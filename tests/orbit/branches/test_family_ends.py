"""Branches of orbits that shrink to a point of a surface end at the boundary equilibrium or two-fold of the
closed form, by that name."""

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import nonsmooth as ns
from nonsmooth.local.searches.boundary_equilibria import fold_orbit_landing
from nonsmooth.orbit.branches import homoclinic_curves
from nonsmooth.orbit.branches.branch import _Half
from nonsmooth.orbit.branches.continue_orbit import curve_of
from nonsmooth.solvers.continuation import Point

X, Y, MU, NU = (ca.SX.sym(name) for name in ("x", "y", "mu", "nu"))
GROWTH = 0.1


def boundary_focus(slope: float, away: float = 0.0) -> ns.FilippovSystem:
    """An unstable focus at the height mu over the surface y = nu, on which its orbits land and slide.

    The sliding flow has its zero at x = mu (1 + r c)/(c - r): a stable pseudo-node below mu = nu if
    c > r (BF1, persistence), and a pseudo-saddle above it if c < r (BF2, a nonsmooth fold).
    """
    x, y = X - away, Y - MU
    return ns.FilippovSystem(
        [X, Y],
        surface=Y - NU,
        above=[GROWTH * x - y, x + GROWTH * y],
        below=[slope, 1.0],
        parameters={MU: 0.5, NU: 0.0},
    )


def assert_starts(branch, bounds):
    """Its first event is where its orbits begin, from which they are followed again."""
    again = ns.continue_orbit(branch.events[0], "mu", bounds=bounds)
    assert [e.kind for e in again.events] == [e.kind for e in branch.events]
    assert len(again) < 2 * len(branch) and ns.orbit.BranchEnd.STEP_TOO_SMALL not in again.ends


@pytest.mark.parametrize("step", [0.01, 0.05, 0.3])
@pytest.mark.parametrize(
    ("slope", "label", "unfolding"), [(1.0, "BF1", "persistence"), (0.0, "BF2", "nonsmooth fold")]
)
def test_sliding_cycles_end_at_a_boundary_focus_of_either_kind(slope, label, unfolding, step):
    system = boundary_focus(slope)
    orbit = ns.periodic_orbit(system, [0.05, 0.001])
    branch = ns.continue_orbit(orbit, "mu", bounds=(-0.2, 0.6), step=step)
    (event,) = branch.events
    assert event.kind == "boundary equilibrium" and abs(event.parameter) < 1e-15
    assert label in event.far_side.verdict and unfolding in event.far_side.verdict
    assert event.far_side.itinerary == ""
    assert branch.ends == (ns.orbit.BranchEnd.EVENT, ns.orbit.BranchEnd.REACHED_BOUND)
    for mu in (0.5, 0.05, 1e-4):  # the flight from the fold is that of a linear system
        slide = next(leg for leg in branch[mu].legs if leg.mode == "s")
        landing = mu * (GROWTH + fold_orbit_landing(GROWTH, 1.0))  # from the fold at x = r mu
        assert slide.start[0] == pytest.approx(landing, rel=1e-9)


def test_far_from_the_origin_and_in_two_parameters_too():
    system = boundary_focus(1.0, away=1000.0)
    orbit = ns.periodic_orbit(system, [1000.05, 0.001])
    (event,) = ns.continue_orbit(orbit, "mu", bounds=(-0.2, 0.6)).events
    assert event.kind == "boundary equilibrium" and abs(event.parameter) < 1e-12
    curve = ns.continue_bifurcation(event, ("mu", "nu"), bounds=[(-0.2, 0.6), (-0.5, 0.5)])
    assert len(curve.values) > 2 and abs(curve.values[:, 0] - curve.values[:, 1]).max() < 1e-12


def test_crossing_cycles_end_where_both_foci_are_on_the_surface():
    """Two foci in one place, one that repels and one that attracts: cycles as large as it is high."""
    focus = lambda r: [r * X - (Y - MU), X + r * (Y - MU)]
    system = ns.FilippovSystem(
        [X, Y], surface=Y, above=focus(0.1), below=focus(-0.3), parameters={MU: 0.3}
    )
    orbit = ns.periodic_orbit(system, [1.0, 0.01])
    branch = ns.continue_orbit(orbit, "mu", bounds=(-0.5, 0.5))
    (event,) = branch.events
    assert event.kind == "boundary equilibrium" and abs(event.parameter) < 1e-15
    assert_starts(branch, (-0.5, 0.5))


@pytest.mark.parametrize("bend", [pytest.param(0.3, marks=pytest.mark.slow), -0.3])
def test_crossing_cycles_end_at_a_two_fold(bend):
    """Folds at x = 0 and at x = mu, both invisible: one two-fold at mu = 0, around which cycles of the size
    sqrt(mu/bend) are born as sliding between the folds changes its stability (pseudo-Hopf)."""
    system = ns.FilippovSystem(
        [X, Y], surface=Y, above=[1, -X + bend * X**2], below=[-1, MU - X], parameters={MU: 0.05}
    )
    mu = 0.05 if bend > 0 else -0.05
    orbit = ns.periodic_orbit(system, [0.3, 0.001], parameters={"mu": mu})
    branch = ns.continue_orbit(orbit, "mu", bounds=(-0.2, 0.2))
    (event,) = branch.events
    assert event.kind == "two-fold" and abs(event.parameter) < 1e-15
    assert "shrinks to a two-fold" in event.far_side.verdict
    assert_starts(branch, (-0.2, 0.2))
    # starts s < e have the mean mu, as below h is a parabola; above e = -s + (2/3) bend s^2 + O(s^3)
    for size in (0.01, 1e-3):
        small = branch[mu / 0.05 * size]
        starts = sorted(float(leg.start[0]) for leg in small.legs)
        assert sum(starts) == pytest.approx(2 * mu / 0.05 * size, rel=1e-6)
        assert starts[1] == pytest.approx((3 * size / abs(bend)) ** 0.5, rel=2 * size**0.5)


def test_such_branches_are_drawn():
    orbit = ns.periodic_orbit(boundary_focus(1.0), [0.05, 0.001])
    branch = ns.continue_orbit(orbit, "mu", bounds=(-0.2, 0.6))
    figure = ns.plot.branch(branch)
    assert any(
        "boundary equilibrium" in str(t.get_text()) for t in figure.axes[0].get_legend().texts
    )


def test_an_orbit_that_comes_slowly_to_a_boundary_equilibrium_has_an_infinite_period():
    """A stable equilibrium at the height mu, with a fast pair of complex eigenvalues, reaches the surface at mu = 0."""
    z = ca.SX.sym("z")
    below = [-3 * X - z, -(Y - MU) - X, X - 3 * z]
    system = ns.FilippovSystem(
        [X, Y, z], surface=Y, above=[1, 1 - X, -z], below=below, parameters={MU: 0.5}
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.0, 0.1, 0.0], 60.0))
    branch = ns.continue_orbit(orbit, "mu", bounds=(-0.3, 0.6))
    assert [event.kind for event in branch.events] == ["infinite period at a boundary node"]
    assert abs(branch.events[0].parameter) < 1e-12 and "logarithm" in branch.reasons[0]
    assert branch.ends[0] is ns.orbit.BranchEnd.PERIOD_DIVERGES
    assert_starts(branch, (-0.3, 0.6))


@pytest.mark.parametrize("slope", [0.0, 1.0])
@pytest.mark.parametrize("share", [1.0, 2.0])
def test_a_slide_that_comes_to_a_two_fold_inside_ends_its_branch_there(slope, share):
    """L1 = -(x^2 + z) and L2 = k (x^2 + 2 z) vanish together at x = 0 where z, which a reset sets to mu, is zero."""
    z, w = ca.SX.sym("z"), ca.SX.sym("w")
    system = ns.FilippovSystem(
        [X, Y, z, w],
        surface=Y,
        above=[1 + slope * X, -(X**2 + z), 0, -w],
        below=[1 - slope * X / 2, share * (X**2 + 2 * z), 0, 1 - w],
        resets=[ns.Reset(X - 1, [X - 2, Y, MU, w], direction=1)],
        parameters={MU: 0.5},
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.0, 0.0, 0.5, 0.0], 30.0))
    branch = ns.continue_orbit(orbit, "mu", bounds=(-0.3, 0.6))
    assert [event.kind for event in branch.events] == ["two-fold"]
    assert abs(branch.events[0].parameter) < 1e-12 and "unique" in branch.reasons[0]


@pytest.mark.parametrize("away", [0.0, 3.0])
def test_a_slide_whose_exit_comes_to_a_two_fold_ends_its_branch_there(away):
    """x = mu + s^2 lands at s = -sqrt(-mu); while it slides z' = 1.6 s/(z - 2 s), which has the ray z = -k s into z = s = 0."""
    x, z, s = (ca.SX.sym(name) for name in "xzs")
    system = ns.FilippovSystem(
        [x, z, s],
        surface=x,
        above=[2 * s, 0, 1],
        below=[z - away, -0.8, 1],
        resets=[ns.Reset(s - 1, [1 + MU, away + 0.5, -1], direction=1)],
        parameters={MU: 0.3},
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [1.3, away + 0.5, -1.0], 10.0))
    branch = ns.continue_orbit(orbit, "mu", bounds=(-0.9, 0.4))
    assert [event.kind for event in branch.events] == ["two-fold", "grazing-sliding"]
    slope = np.sqrt(2.6) - 1.0  # k (k + 2) = 1.6
    assert branch.events[0].parameter == pytest.approx(-((0.5 / slope) ** 2), abs=1e-10)


@pytest.mark.parametrize("located", [True, False])
def test_a_branch_lost_where_folds_accumulate_at_a_saddle_focus_ends_at_its_homoclinic_orbit(
    located, monkeypatch
):
    """A saddle-focus with a reset to z = mu + x/2: orbits of period T have mu = exp(-0.8 T) - x(T)/2 (Shilnikov)."""
    z, (fall, turn, rise) = ca.SX.sym("z"), (0.4, 1.5, 0.8)
    back = ns.Reset(z - 1, [1 + 0.2 * X, 0.3 * Y, MU + 0.5 * X], direction=1, name="back")
    field = [-fall * X - turn * Y, turn * X - fall * Y, rise * z]
    system = ns.FilippovSystem([X, Y, z], field=field, resets=[back], parameters={MU: 0.1})

    def closed(period):
        c, s = np.exp(-fall * period) * np.array([np.cos(turn * period), np.sin(turn * period)])
        move, jump = np.array([[c, -s], [s, c]]), np.diag([0.2, 0.3])
        begin = np.linalg.solve(np.eye(2) - jump @ move, [1.0, 0.0])
        return begin, np.exp(-rise * period) - 0.5 * (move @ begin)[0]

    fold = minimize_scalar(lambda T: closed(T)[1], bracket=(36.5, 37.6, 39.6), tol=1e-12).x
    begin, mu = closed(fold)
    start, given = [*begin, np.exp(-rise * fold)], {"mu": mu}
    orbit = ns.periodic_orbit(system, start, itinerary=[("", "back")], parameters=given)
    curve, rows = curve_of(orbit, (0,))
    if not located:

        def refuse(*_, **__):
            raise ns.ConvergenceError("none was found")

        monkeypatch.setattr(homoclinic_curves, "find_homoclinic", refuse)
    half = _Half([(curve, Point(rows[0], np.zeros(5)))], end=ns.orbit.BranchEnd.STEP_TOO_SMALL)
    half.name_end()
    assert half.end is ns.orbit.BranchEnd.PERIOD_DIVERGES
    assert [event.kind for event in half.events] == ["homoclinic"] * located
    assert all(abs(event.parameter) < 1e-15 for event in half.events)
    assert located or "saddle [" in half.reason


def test_no_branch_point_is_reported_where_orbits_shrink_to_a_two_fold():
    """All multipliers of a relay's orbits tend to 1 at q = (2 b1 + c1)/p1, where L1 = L2."""
    rows = [[-2.97, -0.07, 0.19, -0.72, -0.9], [0.43, -1.36, -1.13, -0.18, 0.23]]
    rows += [[0.19, 0.03, -2.67, -1.19, -0.48], [1.17, -1.02, 0.28, -0.83, 0.81]]
    rows += [[-1.0, -0.6, -0.63, 2.01, -0.72]]
    b, c = ca.DM([-0.42, 0.54, 0.11, -1.04, 0.53]), ca.DM([-0.02, 0.02, -0.05, -0.09, -0.39])
    states, push = ca.SX.sym("x", 5), ca.DM([-0.35, 0.14, 0.05, -0.25, 0.11])
    field = ca.DM(rows) @ states
    system = ns.FilippovSystem(
        ca.vertsplit(states),
        surface=states[0] - 0.2 * MU,
        above=ca.vertsplit(field - b - c + MU * push),
        below=ca.vertsplit(field + b),
        parameters={MU: 1.0},
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.5] * 5, 150.0))
    branch = ns.continue_orbit(orbit, "mu", bounds=(0.9, 3.0), step=0.02)
    assert [event.kind for event in branch.events] == ["fold", "cycle from a two-fold"]
    assert branch.events[1].parameter == pytest.approx(0.86 / 0.35, rel=1e-12)
