"""Curves of bifurcations end at points of codimension two known in closed form, from which others leave.

CT1, CT5 and CT7 of ``tests/cases/orbits_2.json``; the other rows are of closed form too.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.orbit import BifurcationCurve, BranchEnd
from tests.orbit.periodic_cases import symbols, values_of

CASES = values_of("cases/orbits_2.json")
x, y, t, s, a, b = symbols("x y t s a b")

#: Values and residual of a curve: the parameters are its columns.
Known = dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]]


def forced(m: float, amplitude: float) -> ns.FilippovSystem:
    """CT1 and CT4, with the parameters m and A as a and b."""
    drive = a + b * ca.cos(t) - x / 2
    given: dict[Any, float] = {a: m, b: amplitude}
    above, below = [drive - 1], [drive + 1]
    return ns.FilippovSystem([x], surface=x, above=above, below=below, time=t, parameters=given)


def repeated(rate: ca.SX, start: Any, **values: float) -> ns.FilippovSystem:
    """One flight from s = -1 to 1 with its landings, made periodic by a reset."""
    reset = ns.Reset(s - 1, [start, -1.0], direction=1)
    given = {a: values["a"], b: values["b"]}
    return ns.FilippovSystem(
        [x, s], surface=x, above=[rate, 1], below=[5, 1], parameters=given, resets=[reset]
    )


def circle(mu: float, radius: float) -> ns.FilippovSystem:
    """CT7, with the parameters mu and a as a and b."""
    w = a - (ca.sqrt(x**2 + y**2) - b) ** 2
    above = [x * w - y, y * w + x]
    given = {a: mu, b: radius}
    return ns.FilippovSystem([x, y], surface=1 - x, above=above, below=[-3, 0], parameters=given)


CUBIC, RISING = b - 3 * s**2, a + b * s + s**3
GRAZING: Known = {"grazing-sliding": lambda p, q: p - 2 * (np.maximum(q, 0) / 3) ** 1.5}
ADDING: Known = {"adding-sliding": lambda p, q: p + 2 * (np.maximum(-q, 0) / 3) ** 1.5}
LINE: Known = {"adding-sliding": lambda p, q: np.abs(p) - np.abs(q - 1)}
LANDING = "landing at a degenerate tangency of"
ONE = float(CASES["CT1"]["A"])

#: System, guess, free parameter, event, the curve, bounds, the point, its kind, the curves that leave it.
ROWS = {
    "CT1": (
        forced(0.3, 2.0), [0.0], "a", LINE, [(-3, 3), (0.5, 4)], (1 - ONE, ONE),
        f"{LANDING} the other field", {"switching-sliding": 1, "crossing-sliding": 1},
    ),
    "CT4": (
        forced(0.05, 0.9), [0.0], "a", LINE, [(-3, 3), (0.05, 4)], (0.0, 1.0),
        "adding-sliding with adding-sliding", {"adding-sliding": 3},
    ),
    "CT5": (
        repeated(CUBIC, 1 + a - b, a=0.05, b=0.12), [1.0, -1.0], "a", GRAZING,
        [(-0.3, 0.3), (-0.5, 0.5)], (0.0, 0.0), f"{LANDING} its own field", {"adding-sliding": 1},
    ),
    "CT5 from the other curve": (
        repeated(CUBIC, 1 + a - b, a=-0.1, b=-0.03), [1.0, -1.0], "b",
        {"adding-sliding": lambda p, q: q}, [(-0.3, 0.3), (-0.5, 0.5)], (0.0, 0.0),
        f"{LANDING} its own field", {"grazing-sliding": 1},
    ),
    "CT7": (
        circle(0.005, 0.9), [-0.97, 0.0], "a", {"grazing-sliding": lambda p, q: p - (1 - q) ** 2},
        [(-0.05, 0.1), (0.7, 1.3)], (0.0, 1.0), "grazing-sliding with fold", {"fold": 1},
    ),
    "CT7 from the fold": (
        circle(0.005, 0.9), [-0.97, 0.0], "a", {"fold": lambda p, q: p},
        [(-0.05, 0.1), (0.7, 1.3)], (0.0, 1.0), "fold with grazing-sliding", {"grazing-sliding": 2},
    ),
    "CT8": (
        repeated(RISING, 0.05, a=-0.1, b=-0.27), [0.05, -1.0], "a", ADDING,
        [(-0.5, 0.5), (-0.6, 0.3)], (0.0, 0.0), "exit at a degenerate tangency",
        {"grazing-sliding": 1},
    ),
    "CT8 from the other curve": (
        repeated(RISING, 0.05, a=-0.1, b=-0.27), [0.05, -1.0], "a",
        {"grazing-sliding": lambda p, q: p}, [(-0.5, 0.5), (-0.5, 0.3)], (0.0, 0.0),
        "exit at a degenerate tangency", {"adding-sliding": 1},
    ),
}  # fmt: skip


def assert_real(curve: BifurcationCurve) -> None:
    """No point of a curve violates a guard."""
    virtual = [k for k in range(len(curve)) if curve.solution(k).is_virtual]
    assert not virtual, (curve, virtual)


_FAST = ("CT1", "CT5", "CT7")


@pytest.mark.parametrize(
    "name", [name if name in _FAST else pytest.param(name, marks=pytest.mark.slow) for name in ROWS]
)
def test_curves_end_where_others_leave(name: str) -> None:
    system, guess, free, known, bounds, values, kind, leaving = ROWS[name]
    orbit = ns.periodic_orbit(system, ns.simulate(system, guess, 60.0))
    branch = ns.continue_orbit(orbit, free, bounds=bounds["ab".index(free)])
    ((event_kind, residual),) = known.items()
    event = next(e for e in branch.events if e.kind == event_kind)
    curve = ns.continue_bifurcation(event, ("a", "b"), bounds=bounds, step=0.05)
    assert_real(curve)
    assert np.abs(residual(*curve.values.T)).max() < 1e-10
    point = next(p for p in curve.special if p.kind == kind)
    assert np.abs(np.abs(point.values) - np.abs(values)).max() < 1e-9
    if not name.startswith("CT7"):
        assert BranchEnd.EVENT in curve.ends
    found = ns.continue_bifurcation(point, ("a", "b"), bounds=bounds, step=0.05)
    kinds = [one.kind for one in found]
    assert {one: kinds.count(one) for one in kinds} == leaving
    every = LINE | GRAZING | ADDING if name.startswith("CT") else known
    for one in found:
        assert_real(one)
        assert len(one) > 5 and np.abs(one.values[0] - point.values).max() < 1e-15
        closed = known if one.kind == event_kind else _CLOSED.get(name, every)
        if one.kind in closed:
            assert np.abs(closed[one.kind](*one.values.T)).max() < 1e-10, one


#: Curves that leave and are of another kind than the one followed first.
_CLOSED: dict[str, Known] = {
    "CT1": {},
    "CT5": {"adding-sliding": lambda p, q: q},
    "CT7": {"fold": lambda p, q: p},
    "CT7 from the fold": {"grazing-sliding": lambda p, q: p - (1 - q) ** 2},
    "CT8": {"grazing-sliding": lambda p, q: p},
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "key", "k"),
    [("crossing-sliding", "crossing-sliding (landing at t = pi + s, s < 0), s = -0.3, -0.1: (A, m)", k) for k in (0, 1)]
    + [("switching-sliding", "switching-sliding (s > 0), s = 0.1, 0.3: (A, m)", k) for k in (0, 1)],
)  # fmt: skip
def test_curves_beside_a_degenerate_landing(kind: str, key: str, k: int) -> None:
    """A curve that is cut off at a value of A ends at the m of the case."""
    amplitude, m = (float(v) for v in CASES["CT1"][key][k])
    bounds = [(m, 3.0), (1.2, 4.0)] if kind == "crossing-sliding" else [(-3, 3), (1.2, amplitude)]
    system = forced(0.3, 2.0)
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.0], 60.0))
    event = next(
        e for e in ns.continue_orbit(orbit, "a", bounds=(-2.5, 2.5)).events if e.parameter > 0.5
    )
    curve = ns.continue_bifurcation(event, ("a", "b"), bounds=[(-3, 3), (1.2, 4.0)])
    point = next(p for p in curve.special if p.kind.startswith(LANDING))
    found = ns.continue_bifurcation(point, ("a", "b"), bounds=bounds)
    (one,) = (one for one in found if one.kind == kind)
    assert np.abs(one.values[-1] - [m, amplitude]).max() < 1e-11


def test_boundary_equilibria_meet_the_fold() -> None:
    """CT6: x = +-sqrt(mu) of x' = mu - x^2 on x = a: boundary where mu = a^2, fold mu = 0 for a < 0 only."""
    system = ns.FilippovSystem(
        [x, y],
        surface=x - b,
        above=[a - x**2, -2 * y],
        below=[1, -y],
        parameters={a: 0.25, b: -0.3},
    )
    box = [(-0.5, 0.5), (-0.9, 0.9)]
    branch = ns.continue_equilibrium(system, [0.5, 0], "a", bounds=(-0.5, 0.5))
    boundary, fold = sorted(branch.events, key=lambda e: e.kind)
    for event, other, count in ((boundary, "fold", 1), (fold, "boundary equilibrium", 2)):
        curve = ns.continue_bifurcation(event, ("a", "b"), bounds=box)
        point = next(p for p in curve.special if p.kind == "boundary saddle-node")
        assert np.abs(point.values).max() < 1e-12
        assert [p.kind for p in curve.special] == ["boundary saddle-node"]  # no neutral saddle
        found = ns.continue_bifurcation(point, ("a", "b"), bounds=box)
        assert [one.kind for one in found] == [other] * count
        for one in (curve, *found):
            m, edge = one.values.T
            assert np.abs(m if one.kind == "fold" else m - edge**2).max() < 1e-12
            assert one.kind != "fold" or edge.max() < 1e-9


def test_a_half_orbit_that_loses_its_stop() -> None:
    """Den Hartog's motion stops first where the acceleration at a turn is zero; at W = 1/2 in phase with the drive."""
    v, w, friction = symbols("v w f")
    drive = ca.cos(w * t) - x
    system = ns.FilippovSystem(
        [x, v], surface=v, above=[v, drive - friction], below=[v, drive + friction], time=t,
        parameters={friction: 0.6, w: 0.6},
    )  # fmt: skip
    orbit = ns.periodic_orbit(system, ns.simulate(system, [1.5, 0.0], 300.0), symmetry="odd")
    (event,) = ns.continue_orbit(orbit, "f", bounds=(0.2, 0.95)).events
    stiff = 1 / (1 - 0.6**2)
    turn = np.sin(np.pi / 0.6) / (0.6 * (1 + np.cos(np.pi / 0.6)))
    first_stop = (stiff - 1) / np.hypot(1, (stiff - 1) / stiff * turn)
    assert event.kind == "crossing-sliding" and len(event.orbit.problem.legs) == 1
    assert event.parameter == pytest.approx(first_stop, abs=1e-12)
    curve = ns.continue_bifurcation(event, ("f", "w"), bounds=[(0.1, 1.0), (0.3, 0.95)], step=0.1)
    assert_real(curve)
    assert np.abs(curve.special[0].values - [1 / 3, 1 / 2]).max() < 1e-9
    box = [(0.25, 1.0), (0.3, 0.95)]
    (one,) = ns.continue_bifurcation(curve.special[0], ("f", "w"), bounds=box, step=0.1)
    assert one.kind == "switching-sliding" and len(one) > 5
    assert_real(one)


@pytest.mark.slow
def test_the_tongue_of_a_forced_neuron():
    """TO1: two orbits of one spike a period meet on a fold in closed form; it ends where they touch the threshold before."""
    v, amplitude, period = symbols("v A T")
    values, current = CASES["TO1"], 1.2
    system = ns.FilippovSystem(
        [v], field=[current + amplitude * ca.cos(2 * ca.pi * t / period) - v], time=t,
        resets=[ns.Reset(v - 1, [0 * v], 1)], parameters={amplitude: float(values["A used"]), period: 1.9},
    )  # fmt: skip
    branch = ns.continue_orbit(
        ns.periodic_orbit(system, ns.simulate(system, [0.0], 60.0)), "A", bounds=(0.05, 0.3)
    )
    found = sorted(
        (o.legs[0].t % 1.9, float(o.multipliers[0].real))
        for o in branch.at(float(values["A used"]))
    )
    exact = [
        [float(v) for v in row] for row in values["firing phases and multipliers (two orbits)"]
    ]
    assert np.abs(np.array(found) - exact).max() < 1e-11
    (fold,) = (e for e in branch.events if e.kind == "fold")
    assert fold.parameter == pytest.approx(float(values["A at the edge, T=1.9"]), abs=1e-14)
    curve = ns.continue_bifurcation(fold, ("A", "T"), bounds=[(0.0, 2.0), (1.0, 3.0)])
    a_edge, t_edge = curve.values.T
    w = 2 * np.pi / t_edge
    level = 1 / (1 - np.exp(-t_edge))
    assert np.abs(a_edge - np.abs(level - current) * np.hypot(1, w)).max() < 1e-13
    (point,) = curve.special
    assert point.kind == "fold with grazing of a reset" and BranchEnd.EVENT in curve.ends
    amplitude, period = point.values
    w = 2 * np.pi / period
    since = np.linspace(0.0, 0.98 * period, 20001)  # after a spike at the extremum of the drive
    sign = np.sign(1 / (1 - np.exp(-period)) - current)
    wave = sign * amplitude / np.hypot(1, w) * (np.cos(w * since) - np.exp(-since))
    before = current * (1 - np.exp(-since)) + wave
    inside = before[1:-1][(before[1:-1] > before[:-2]) & (before[1:-1] > before[2:])]
    assert inside.max() == pytest.approx(1.0, abs=1e-8)


@pytest.mark.slow
def test_the_orbit_with_contact_doubles_and_folds_beside_a_grazing() -> None:
    """x = u + s^2 slides for sigma = sqrt(-u), in which y grows by 5 sigma - 12.5 ln(1 + 0.4 sigma); a reset feeds it back."""
    kept = x - 1 - a
    reset = ns.Reset(s - 1, [1 + a + kept / 2 + b * y - y**3, 0 * y, -1.0], direction=1)
    system = ns.FilippovSystem(
        [x, y, s], surface=x, above=[2 * s, 0, 1], below=[5, 5, 1], parameters={a: 0.2, b: 0.5},
        resets=[reset],
    )  # fmt: skip
    orbit = ns.periodic_orbit(system, ns.simulate(system, [1.2, 0.0, -1.0], 60.0))
    (event,) = ns.continue_orbit(orbit, "a", bounds=(-0.5, 0.5)).events
    box = [(-0.5, 0.5), (-1.5, 1.2)]
    curve = ns.continue_bifurcation(event, ("a", "b"), bounds=box, step=0.1)
    assert {p.kind: round(p.values[1], 9) for p in curve.special} == {
        "grazing-sliding with fold with contact": -1.0,
        "grazing-sliding with period doubling with contact": 1.0,
    }
    for point in curve.special:
        (one,) = ns.continue_bifurcation(point, ("a", "b"), bounds=box, step=0.1)
        assert_real(one)
        sigma = 1 - np.array([one.solution(k).legs[0].duration for k in range(1, len(one))])
        grown = 5 * sigma - 12.5 * np.log1p(0.4 * sigma)
        sign = 1 if one.kind == "period doubling" else -1
        b_true = sign * (1 + 0.4 * sigma) + 3 * grown**2
        a_true = 2 * (grown**3 - sigma**2 - b_true * grown)
        assert (
            len(one) > 3 and np.abs(one.values[1:] - np.column_stack([a_true, b_true])).max() < 1e-9
        )


@pytest.mark.slow
def test_a_double_crossing_sliding() -> None:
    """Both landings of the symmetric orbit at their tangencies: A = sqrt(1 + (2.5 (1 - q)/(1 + q) + 1/2)^2)."""
    q = np.exp(-np.pi / 2)
    top = np.sqrt(1 + (2.5 * (1 - q) / (1 + q) + 0.5) ** 2)
    system = forced(0.3, 3.0)
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.0], 60.0))
    first, *_ = (
        e for e in ns.continue_orbit(orbit, "b", bounds=(2.4, 4)).events if e.parameter > 2.5
    )
    box = [(-1.0, 1.0), (2.0, 3.0)]
    curve = ns.continue_bifurcation(first, ("a", "b"), bounds=box, step=0.1)
    (point,) = curve.special
    assert point.kind == "crossing-sliding with crossing-sliding" and BranchEnd.EVENT in curve.ends
    assert point.values == pytest.approx([0.0, top], abs=1e-12)
    found = ns.continue_bifurcation(point, ("a", "b"), bounds=box, step=0.1)
    assert [one.kind for one in found] == ["crossing-sliding"] * 3
    ends = sorted(one.values[-1].round(9).tolist() for one in (curve, *found))
    assert len({tuple(np.abs(end)) for end in ends}) == 2  # mirror images in pairs
    for one in found:
        assert_real(one)


@pytest.mark.slow
def test_grazing_of_cycles_begins_where_their_focus_is_on_the_surface() -> None:
    """Cycles of radius sqrt(a) touch x = b at a = b^2; at a = b = 0 the focus does, at a Hopf point."""
    grown = a - x**2 - y**2
    system = ns.FilippovSystem(
        [x, y], surface=b - x, above=[x * grown - y, y * grown + x], below=[-1, 0.3],
        parameters={a: 0.25, b: 0.7},
    )  # fmt: skip
    box = [(-0.2, 0.9), (-0.5, 1.0)]
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.1, 0.1], 100.0))
    event = ns.continue_orbit(orbit, "a", bounds=(0.2, 0.6)).events[0]
    curve = ns.continue_bifurcation(event, ("a", "b"), bounds=box, step=0.1)
    (point,) = curve.special
    assert point.kind == "grazing-sliding with Hopf" and np.abs(point.values).max() < 1e-12
    found = ns.continue_bifurcation(point, ("a", "b"), bounds=box, step=0.1)
    assert sorted(one.kind for one in found) == ["Hopf", *["boundary equilibrium"] * 2]
    for one in found:
        assert np.abs(one.values[:, 0 if one.kind == "Hopf" else 1]).max() < 1e-12
    assert min(one.values[:, 1].min() for one in found if one.kind == "Hopf") > -1e-12


@pytest.mark.slow
def test_an_orbit_with_contact_doubles_up_to_its_grazing() -> None:
    """y = 0.1 + b Y - Y^3 grows to Y by sigma^2 + ..., sigma^2 = -(a + Y/2): doubling there at b = 3 Y^2 - 1/2."""
    reset = ns.Reset(s - 1, [1 + a + y / 2, 0.1 + b * y - y**3, -1.0], direction=1)
    system = ns.FilippovSystem(
        [x, y, s], surface=x, above=[2 * s, 0, 1], below=[5, 5, 1], parameters={a: 0.2, b: -0.5},
        resets=[reset],
    )  # fmt: skip
    box = [(-0.06, 0.06), (-0.6, -0.4)]
    orbit = ns.periodic_orbit(system, ns.simulate(system, [1.2, 0.05, -1.0], 80.0))
    event = ns.continue_orbit(orbit, "a", bounds=(-0.06, 0.3)).events[0]
    assert event.kind == "period doubling"
    curve = ns.continue_bifurcation(event, ("a", "b"), bounds=box, step=0.1)
    edge = next(z.real for z in np.roots([2, 0, -1.5, 0.1]) if 0 < z.real < 0.5)
    (point,) = curve.special
    assert point.kind == "period doubling with grazing-sliding"
    assert point.values == pytest.approx([-edge / 2, 3 * edge**2 - 0.5], abs=1e-12)
    found = ns.continue_bifurcation(point, ("a", "b"), bounds=box, step=0.1)
    assert [one.kind for one in found] == ["grazing-sliding"] * 2  # both ways
    for one in found:
        assert_real(one)
        z = -2 * one.values[:, 0]  # touches at a + Y/2 = 0
        assert np.abs(0.1 + one.values[:, 1] * z - z**3 - z).max() < 1e-12


@pytest.mark.slow
def test_curves_leave_a_point_found_from_orbits_with_a_short_leg() -> None:
    """CT4 from A > 1, where the flight that vanishes at A = 1 lasts like a cube root."""
    system = forced(0.5, 3.0)
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.0], 60.0))
    branch, box = ns.continue_orbit(orbit, "b", bounds=(0.2, 4.0)), [(-3, 3), (0.05, 4.0)]
    event = next(e for e in branch.events if abs(e.parameter - 1.5) < 1e-9)
    curve = ns.continue_bifurcation(event, ("a", "b"), bounds=box, step=0.05)
    point = next(p for p in curve.special if p.kind == "adding-sliding with adding-sliding")
    assert point.values == pytest.approx([0.0, 1.0], abs=1e-12)
    found = ns.continue_bifurcation(point, ("a", "b"), bounds=box, step=0.05)
    assert [one.kind for one in found] == ["adding-sliding"] * 3
    assert all(np.abs(LINE["adding-sliding"](*one.values.T)).max() < 1e-10 for one in found)


def test_pseudo_saddle_nodes_have_no_pairs() -> None:
    """The sliding flow of the plane has one eigenvalue."""
    system = ns.FilippovSystem(
        [x, y], surface=y - b, above=[x - a, x**2 - y], below=[1, 1], parameters={a: 1.2, b: 0.5}
    )
    branch = ns.continue_equilibrium(system, [1.2, 1.44], "a", bounds=(0.1, 2))
    for event in branch.events:
        curve = ns.continue_bifurcation(event, ("a", "b"), bounds=[(-2, 2), (-1, 3)])
        if event.kind == "boundary equilibrium":
            assert np.abs(curve.values[:, 1] - curve.values[:, 0] ** 2).max() < 1e-13
        else:  # (x - a) = x^2 - b twice
            assert np.abs(curve.values[:, 0] - curve.values[:, 1] - 0.25).max() < 1e-13
