"""Bifurcations in two parameters, of equilibria and of orbits, lie on curves known in closed form, and so do
their points of codimension two."""

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import nonsmooth as ns
from nonsmooth.orbit import BranchEnd
from tests.orbit.interrupts import interrupt
from tests.orbit.periodic_cases import impact_oscillator, symbols, table

x, y, z, a, b = (ca.SX.sym(s) for s in ("x", "y", "z", "a", "b"))
BOX = [(-1, 1), (-1.5, 1)]


def system(above, below=(1, 1), start=(0.0, 0.0), surface=y + 100, states=(x, y)):
    return ns.FilippovSystem(
        list(states),
        surface=surface,
        above=list(above),
        below=list(below),
        parameters={a: start[0], b: start[1]},
    )


@pytest.fixture(scope="module")
def takens():
    """Bogdanov-Takens' normal form: folds on b^2 = 4 a, Hopf points on a = 0 > b."""
    s = system([y, a + b * x + x**2 - x * y], start=(0.1, -1.0))
    return ns.continue_equilibrium(s, [0.11, 0], "a", bounds=(-0.5, 0.5))


def test_folds_and_hopf_points_meet_in_a_bogdanov_takens_point(takens):
    hopf, fold = (next(e for e in takens.events if e.kind == k) for k in ("Hopf", "fold"))
    leave = lambda point: ns.continue_bifurcation(point, ("a", "b"), bounds=BOX)
    folds = ns.continue_bifurcation(fold, ("a", "b"), bounds=BOX)
    assert np.abs(folds.values[:, 1] ** 2 - 4 * folds.values[:, 0]).max() < 1e-12
    assert [point.kind for point in folds.special] == ["Bogdanov-Takens"]
    assert np.abs(folds.special[0].values).max() < 1e-10
    (half,) = leave(folds.special[0])  # on the other side neutral saddles
    assert half.kind == "Hopf" and np.abs(half.values[-1] - [0.0, -1.5]).max() < 1e-12
    hopfs = ns.continue_bifurcation(hopf, ("a", "b"), bounds=BOX)
    assert [one.kind for one in leave(hopfs.special[0])] == ["fold", "fold"]
    assert np.abs(hopfs.values[:, 0]).max() < 1e-12
    assert (
        np.ptp(hopfs.values[:, 1]) > 1.4 and hopfs.values[:, 1].max() < 1e-9
    )  # then neutral saddles
    assert "Bogdanov-Takens" in str(folds) and "fold" in repr(folds)
    assert abs(folds.solution(3).point[0] + folds.values[3, 1] / 2) < 1e-10


def test_boundary_equilibria_with_their_degenerate_points():
    """A focus at (0, a) with trace 2 b: on the surface at a = 0, a boundary Hopf point at b = 0, and
    where the pseudo-equilibria change sides: s = C A^-1 E = 0."""
    u, v = x, y - a
    # C adj(A) E with A = [[b, -1], [1, b]]: -E1 + b E2 = 0
    for other, more in (([1, 0.5], {}), ([0.5, 1], {"persistence turns into nonsmooth fold": 0.5})):
        s = system([b * u - v, u + b * v], other, (0.5, -0.5), surface=y)
        (event,) = ns.continue_equilibrium(s, [0, 0.5], "a", bounds=(-1, 1)).events
        curve = ns.continue_bifurcation(event, ("a", "b"), bounds=BOX)
        assert np.abs(curve.values[:, 0]).max() < 1e-13
        found = {point.kind: point.values[1] for point in curve.special}
        assert found == pytest.approx({"boundary Hopf": 0.0, **more}, abs=1e-12)


def test_boundary_equilibria_from_either_side_are_one_curve():
    """At h = y = 0 with A = -1: (0, a + b^2) is on the surface where a = -b^2."""
    s = system([-x, -(y - a - b**2)], [0, 1], (0.5, 0.3), surface=y)
    (event,) = ns.continue_equilibrium(s, [0, 0.5], "a", bounds=(-1, 1)).events
    real = ns.continue_bifurcation(event, ("a", "b"), bounds=BOX)
    assert np.abs(real.values[:, 0] + real.values[:, 1] ** 2).max() < 1e-12
    below = ns.find_pseudo_equilibrium(s, [0, 0], parameters={"a": -0.5, "b": 0.3}).point
    branch = ns.continue_equilibrium(
        s, below, "a", bounds=(-1, 1), side=None, parameters={"a": -0.5, "b": 0.3}
    )
    (event,) = branch.events
    pseudo = ns.continue_bifurcation(event, ("a", "b"), bounds=BOX)
    assert np.abs(pseudo.values[:, 0] + pseudo.values[:, 1] ** 2).max() < 1e-12


def test_pseudo_saddle_nodes_and_two_folds():
    """Sliding flow a - x^2 + b x on y = 0: folds on b^2 = -4 a; two-folds where L1 = L2 = 0."""
    flow = a + b * x - x**2
    s = system([flow, -1], [flow, 1], (0.5, 0.3), surface=y)
    branch = ns.continue_equilibrium(s, [0.9, 0], "a", bounds=(-1, 1), side=None)
    curve = ns.continue_bifurcation(branch.events[0], ("a", "b"), bounds=BOX)
    assert curve.kind == "pseudo-saddle-node"
    assert np.abs(curve.values[:, 1] ** 2 + 4 * curve.values[:, 0]).max() < 1e-12
    s = system([1, x], [-1, x + a - b**2], (-0.5, 0.3), surface=y)
    branch = ns.continue_equilibrium(s, [0.2, 0], "a", bounds=(-1, 1), side=None)
    curve = ns.continue_bifurcation(branch.events[0], ("a", "b"), bounds=BOX)
    assert curve.kind == "two-fold"
    assert np.abs(curve.values[:, 0] - curve.values[:, 1] ** 2).max() < 1e-12


def test_a_closed_curve_of_folds():
    """x'= a^2 + b^2 - 1/4 + x^2: folds on a circle."""
    s = system([a**2 + b**2 - 0.25 + x**2, -y], start=(0.1, 0.1))
    branch = ns.continue_equilibrium(s, [0.48, 0], "a", bounds=(-1, 1))
    event = branch.events[-1]
    curve = ns.continue_bifurcation(event, ("a", "b"), bounds=[(-1, 1), (-1, 1)])
    assert np.abs(np.hypot(*curve.values.T) - 0.5).max() < 1e-12
    assert curve.ends == (ns.orbit.BranchEnd.CLOSED, ns.orbit.BranchEnd.CLOSED)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (dict(parameters=("a", "a")), ns.DefinitionError, "parameters"),
        (dict(parameters=("a", "kappa")), ns.DefinitionError, "kappa"),
        (dict(parameters="a"), ns.DefinitionError, "parameters"),
        (dict(bounds=[(-1, 1)]), ns.OptionError, "bounds"),
        (dict(bounds=[(-1, 1), (0, 1)]), ns.OptionError, "bounds"),
        (dict(event="fold"), ns.DefinitionError, "Branch.events"),
    ],
)
def test_bad_input(takens, change, error, words):
    given = {"event": takens.events[0], "parameters": ("a", "b"), "bounds": BOX} | change
    with pytest.raises(error, match=words):
        ns.continue_bifurcation(given.pop("event"), given.pop("parameters"), **given)


# periodic orbits ------------------------------------------------------------------------------------


def test_a_ball_on_a_table_folds_and_doubles_on_closed_forms():
    """Holmes 1982: A = pi k and A^2 = (pi k)^2 + (2 (1 + r^2)/(1 + r)^2)^2 with k = (1 - r)/(1 + r)."""
    orbit = ns.periodic_orbit(table(), [0.26, 3.1], t_start=0.64, itinerary=[("", "reset")])
    for event in ns.continue_orbit(orbit, "A", bounds=(0.3, 1.2)).events:
        curve = ns.continue_bifurcation(event, ("A", "r"), bounds=[(0.1, 2), (0.5, 0.9)])
        A, r = curve.values.T
        fold = np.pi * (1 - r) / (1 + r)
        expected = fold if event.kind == "fold" else np.hypot(fold, 2 * (1 + r * r) / (1 + r) ** 2)
        assert np.abs(A - expected).max() < 1e-11 and len(curve) > 10
        assert curve.ends == (ns.orbit.BranchEnd.REACHED_BOUND,) * 2


def test_grazing_of_a_wall_is_a_resonance_curve_and_an_interrupt_keeps_its_part(monkeypatch):
    w, z = 0.8, 0.05
    system = impact_oscillator()
    at = {"F": 0.35}
    rest = ns.simulate(system, [0, 0], 300, parameters=at).x[-1]
    run = ns.simulate(system, rest, 360, t_start=300, parameters=at)
    orbit = ns.periodic_orbit(system, run, parameters=at)
    (event,) = ns.continue_orbit(orbit, "F", bounds=(0.33, 0.4)).events
    curve = ns.continue_bifurcation(event, ("F", "z"), bounds=[(0.2, 1), (0.02, 0.3)])
    F, z = curve.values.T
    interrupt(monkeypatch, type(orbit.problem), "evaluate", 39, once=True)
    cut = ns.continue_bifurcation(event, ("F", "z"), bounds=[(0.2, 1), (0.02, 0.3)], progress=True)
    assert ns.orbit.BranchEnd.INTERRUPTED in cut.ends and 1 < len(cut) < len(curve)
    assert np.abs(F - np.hypot(1 - w * w, 2 * z * w)).max() < 1e-12
    assert not any(curve.solution(k).is_virtual for k in range(len(curve)))  # a touch is no passage


@pytest.mark.slow
def test_strong_resonances_on_a_curve_of_neimark_sacker_points():
    """x' = (a + i b) x at the origin of a forced plane: the angle is 2 pi b."""
    t, b = ca.SX.sym("t"), ca.SX.sym("b")
    pull = (x * x + y * y) * (1 + 0.5 * ca.cos(t))
    system = ns.FilippovSystem(
        [x, y],
        field=[a * x - b * y - x * pull, b * x + a * y - y * pull],
        time=t,
        parameters={a: -0.1, b: 0.2},
    )
    orbit = ns.periodic_orbit(system, [0.001, 0.001], period=2 * np.pi)
    (event,) = ns.continue_orbit(orbit, "a", bounds=(-0.2, 0.2)).events
    curve = ns.continue_bifurcation(event, ("a", "b"), bounds=[(-0.2, 0.2), (0.12, 0.45)])
    assert np.abs(curve.values[:, 0]).max() < 1e-12
    found = {point.kind: point.values[1] for point in curve.special}
    assert set(found) == {"1:4 resonance", "1:3 resonance"}
    assert abs(found["1:4 resonance"] - 1 / 4) < 1e-11
    assert abs(found["1:3 resonance"] - 1 / 3) < 1e-11


def test_a_grazing_meets_a_two_fold():
    """A circle touches the surface x = -d, on which the other field pulls with u - y: up to u = 0."""
    d, u = ca.SX.sym("d"), ca.SX.sym("u")
    r = ca.sqrt(x * x + y * y)
    system = ns.FilippovSystem(
        [x, y],
        surface=x + d,
        above=[x * (1 - r) - y, y * (1 - r) + x],
        below=[u - y, 1],
        parameters={d: 1.2, u: 0.4},
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.9, 0.0], 40.0))
    (event,) = ns.continue_orbit(orbit, "d", bounds=(0.99, 1.3)).events
    curve = ns.continue_bifurcation(event, ("d", "u"), bounds=[(0.5, 1.5), (-0.4, 0.6)])
    assert np.abs(curve.values[:, 0] - 1).max() < 1e-12
    (special,) = curve.special
    assert special.kind == "grazing-sliding with two-fold"
    assert curve.ends == (BranchEnd.EVENT, BranchEnd.REACHED_BOUND)
    assert np.abs(special.values - [1, 0]).max() < 1e-11


def test_a_grazing_of_orbits_without_events_from_their_hopf_point():
    """Predators above y = T are harvested: T = max y of the smooth cycle, born at K = 27/13."""
    top, capacity = ca.SX.sym("T"), ca.SX.sym("K")
    eaten = x / (1 + x)
    prey = x * (1 - x / capacity) - eaten * y
    eco = ns.FilippovSystem(
        [x, y],
        surface=y - top,
        above=[prey, (eaten - 0.65) * y],
        below=[prey, (eaten - 0.35) * y],
        parameters={top: 3.0, capacity: 2.2},
    )
    orbit = ns.periodic_orbit(eco, ns.simulate(eco, [1.0, 1.1], 600.0))
    event = ns.continue_orbit(orbit, "T", bounds=(1.5, 3.1)).events[0]
    curve = ns.continue_bifurcation(event, ("T", "K"), bounds=[(0.5, 3.0), (2.0, 2.5)], step=0.05)
    assert curve.values[-1] == pytest.approx([2.07020393, 2.5], abs=1e-8)
    assert curve.special[0].kind == "grazing-sliding with Hopf"
    assert curve.special[0].values == pytest.approx([20 / 13 * (1 - 7 / 27), 27 / 13], abs=1e-12)


@pytest.mark.parametrize(
    ("preload", "kind"),
    [(0.0, "grazing of a soft switch"), (0.2, "grazing of a jumping force")],
)
def test_grazing_of_a_stop_that_gives_way(preload, kind):
    """Free motion reaches x = 1 where F = hypot(1 - w^2, 0.1 w); no contact of it slides, so no test of one vanishes."""
    x, v, t, force, w = symbols("x v t F w")
    drive = force * ca.cos(w * t) - x - 0.1 * v
    system = ns.FilippovSystem(
        [x, v], surface=x - 1, above=[v, drive - 5 * (x - 1) - preload], below=[v, drive], time=t,
        parameters={force: 0.3, w: 0.8},
    )  # fmt: skip
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0, 0], 300.0))
    event = ns.continue_orbit(orbit, "F", bounds=(0.3, 0.38)).events[0]
    curve = ns.continue_bifurcation(event, ("F", "w"), bounds=[(0.05, 2), (0.7, 0.9)])
    assert event.kind == kind and not curve.special
    assert curve.ends == (BranchEnd.REACHED_BOUND,) * 2
    assert (
        np.abs(
            curve.values[:, 0] - np.hypot(1 - curve.values[:, 1] ** 2, 0.1 * curve.values[:, 1])
        ).max()
        < 1e-13
    )


def test_grazing_of_relaxation_oscillations():
    """A leg of T = 72 with a minimum of 6e-9; values of alpha, the maximum, by scipy; Hopf point in closed form."""
    system = ns.textbook.harvested_prey_predator().system
    orbit = ns.periodic_orbit(system, [0.5, 1.0], parameters={"alpha": 2.6, "b": 0.33})
    assert orbit.period == pytest.approx(71.875315, abs=1e-6)
    (event,) = ns.continue_orbit(orbit, "alpha", bounds=(2.3, 2.7)).events
    for low, high, top in ((0.3, 0.34, 2.453951), (0.32, 0.4, 2.529183)):
        bounds = [(0.5, 4.0), (low, high)]
        curve = ns.continue_bifurcation(event, ("alpha", "b"), bounds=bounds)
        assert curve.ends == (BranchEnd.REACHED_BOUND,) * 2
        assert max(curve.values.tolist(), key=lambda v: v[1]) == pytest.approx(
            [top, high], abs=1e-6
        )


@pytest.mark.slow
def test_legs_are_divided_along_a_curve():
    """A relay oscillator with passengers, whose derivatives grow by 7e6 along a leg, grazes x + v = c."""
    x, v, z, w, d, c = symbols("x v z w d c")
    push = 5 * (1 + ca.sign(x + v - c))
    rate = [v - push, ca.sign(v) - x - 2 * d * v - push, x - 40 * z, 5 * w + v]
    system = ns.FilippovSystem.from_expression([x, v, z, w], rate, parameters={d: 0.1, c: 12.0})

    def top(damping: float) -> float:
        turn = np.sqrt(1 - damping**2)
        far = 2 / (1 - np.exp(-damping * np.pi / turn))  # the amplitude about the middle of a leg

        def height(t: float) -> float:
            fall = far * np.exp(-damping * t)
            moved = np.cos(turn * t) + (damping - 1) / turn * np.sin(turn * t)
            return float(fall * moved - 1)  # - (x + v)

        return -minimize_scalar(height, (1.0, 2.5, 3.1), tol=1e-13).fun

    start = [-6.3868231843577333, 0.0, -0.1595860406386929, -0.2735860335513412]
    orbit = ns.periodic_orbit(system, start, itinerary=["-+", "--"])
    (event,) = ns.continue_orbit(orbit, "c", bounds=(8.5, 12.5)).events
    curve = ns.continue_bifurcation(event, ("c", "d"), bounds=[(2, 20), (0.08, 0.2)], step=0.1)
    assert curve.ends == (BranchEnd.REACHED_BOUND,) * 2 and not curve.special
    assert np.abs(curve.values[:, 0] - [top(one) for one in curve.values[:, 1]]).max() < 1e-11
    few = ns.continue_bifurcation(
        event, ("c", "d"), bounds=[(2, 20), (0.08, 0.2)], step=0.1, max_points=20
    )
    assert few.values[19] == pytest.approx([event.parameter, 0.1], rel=1e-12)
    assert few.ends[0] is BranchEnd.TOO_MANY_POINTS


@pytest.mark.parametrize(
    ("tilt", "push", "kind"),
    [
        pytest.param(0.0, 0.0, "grazing of a jumping force", marks=pytest.mark.slow),
        (0.3, 0.4, "grazing-sliding"),
    ],
)
def test_a_grazing_curve_ends_at_the_hopf_point_and_at_the_saddle_on_the_surface(tilt, push, kind):
    """x'' = x^2 - 1 + e (mu + x) x': cycles between the Hopf point at mu = 1 and the homoclinic orbit, mu = 5/7 + O(e^2)."""
    x, y, mu, c = symbols("x y mu c")
    force = x * x - 1 + 0.2 * (mu + x) * y
    system = ns.FilippovSystem(
        [x, y],
        surface=c - x - tilt * y,
        above=[y, force],
        below=[y - push, force - 0.5],
        parameters={mu: 0.9, c: 0.5},
    )
    (hopf,) = ns.continue_equilibrium(system, [-1.0, 0.0], "mu", bounds=(0.5, 1.3)).events
    branch = ns.continue_orbit(hopf, "mu", bounds=(0.5, 1.3))
    event = next(event for event in branch.events if event.kind == kind)
    curve = ns.continue_bifurcation(event, ("mu", "c"), bounds=[(0.5, 1.3), (-2, 2)])
    assert curve.ends == (BranchEnd.EVENT, BranchEnd.PERIOD_DIVERGES)
    point, last = curve.special
    assert point.kind == f"{kind} with Hopf" and np.abs(point.values - [1, -1]).max() < 1e-12
    smooth = ns.FilippovSystem([x, y], field=[y, force], parameters={mu: 0.715})
    value = ns.find_homoclinic(smooth, [1.0, 0.0], "mu").value
    assert last.kind == f"{kind} with boundary equilibrium"
    assert np.abs(last.values - [value, 1]).max() < 1e-12 and abs(value - 5 / 7) < 2e-3
    *boundary, loop = ns.continue_bifurcation(last, ("mu", "c"), bounds=[(0.5, 1.3), (-2, 2)])
    assert [one.kind for one in boundary] == ["boundary equilibrium"] * 2
    assert max(np.abs(one.values[:, 1] - 1).max() for one in boundary) < 1e-12
    assert loop.kind == "homoclinic" and not loop.special and loop.values[-1, 1] == 2
    assert np.abs(loop.values[:, 0] - value).max() < 1e-12 and not loop.solution(5).faults
    back = ns.continue_bifurcation(loop.solution(5), ("mu", "c"), bounds=[(0.5, 1.3), (-2, 2)])
    (point,) = back.special
    assert point.kind == "homoclinic with boundary equilibrium" and BranchEnd.EVENT in back.ends
    assert np.abs(point.values - [value, 1]).max() < 1e-12
