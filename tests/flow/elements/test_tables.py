"""Runs through tables: cells in the driver, beside the same system with a surface for each breakpoint."""

from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.model.laws.motion import motion
from tests.differences import require

x, v, t, q = (ca.SX.sym(s) for s in ("x", "v", "t", "q"))

XS = np.array([-1.7, -1.1, -0.6, -0.2, 0.1, 0.7, 1.2, 1.6])
YS = np.array([-1.0, -1.3, -0.4, -0.5, 0.2, 0.3, 1.4, 1.1])


def labels(run):
    return [(e.kind, e.name, e.mode_before, e.mode_after, e.element, e.side) for e in run.events]


def agree(system, x0, t_end, **options):
    run = ns.simulate(system, x0, t_end, tol=1e-11, **options)
    other = ns.simulate(system.of_breakpoints, x0, t_end, tol=1e-11, **options)
    assert labels(run) == labels(other) and run.itinerary == other.itinerary
    assert run.status == other.status
    np.testing.assert_allclose([e.t for e in run.events], [e.t for e in other.events], atol=1e-8)
    np.testing.assert_allclose(run.x[-1], other.x[-1], atol=1e-8)
    return run


def lifted(rhs, states=(x, v), **parts):
    return ns.FilippovSystem.from_expression([*states], [*rhs], **parts)


CURVE, SPLINE = ns.table(x, XS, YS), ns.table(x, XS, YS, 3)
SLIP = ns.table(ca.fabs(v - 0.3), [0.0, 0.05, 0.1, 0.3, 1.0], [0.6, 0.45, 0.4, 0.36, 0.35])
SIGNAL = ns.table(t, np.linspace(0, 9, 19), np.tile([0.3, -0.6], 10)[:19])

SYSTEMS = {
    "a spring": lifted([v, -x - CURVE - 0.1 * v + ca.cos(t)], time=t),
    "a spline": lifted([v, -x - SPLINE - 0.1 * v + ca.cos(t)], time=t),
    "friction": lifted([v, -x - SLIP * ca.sign(v - 0.3)]),
    "a signal": lifted([v, -x + SIGNAL - 0.2 * ca.sign(v)], time=t),
    "two arguments": lifted([v, -x - CURVE - ns.table(v, XS / 2, -YS) + ca.sin(t)], time=t),
    "a kink where friction sticks": lifted([v, -ns.table(x, [-1, 0, 1], [1, -1, 1]) - ca.sign(x)]),
    "a jump over cells": lifted(
        [v, -x - CURVE - 0.3 * v + ca.cos(t)], time=t, resets=ns.Reset(v, {x: 0.3 - 1.5 * x}, -1)
    ),
    "impacts": lifted([v, -1 - 0.3 * CURVE], impacts=ns.Impact(x + 1.5, restitution=0.8)),
    "a diode": lifted(
        [v, -x - CURVE + ca.cos(t) + q],
        time=t,
        complementarity=ns.Complementarity(v + 1, multiplier=q),
    ),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_runs_are_those_with_a_surface_for_each_breakpoint(name):
    assert len(agree(SYSTEMS[name], [0.8, 0.4], 10.0).events) > 4


@pytest.mark.parametrize("speed", [0.7, -0.7, 0.0])
def test_a_start_at_a_breakpoint(speed):
    run = agree(lifted([v, -x - CURVE]), [0.7, speed], 1.0)
    assert run.events[0].t > 1e-3
    assert run.events[0].mode_before == ("+++++---" if speed <= 0 else "++++++--")


@pytest.mark.parametrize("restitution", [0.5, 0.0])
def test_rest_on_a_contact_at_a_breakpoint(restitution):
    # the driver does not decide on breakpoints: their letter there is that of a cell, not s
    push = 1.6 * ca.sin(t) - 1 - 0.3 * ns.table(x, [-1.0, 0.0, 0.5, 1.5], [0.7, 0.4, 0.2, 0.9])
    system = lifted([v, push], time=t, impacts=ns.Impact(x, restitution=restitution))
    run, other = (
        ns.simulate(s, [1.0, 0.3], 20.0, tol=1e-11) for s in (system, system.of_breakpoints)
    )
    kinds = [
        [e.kind for e in one.events if e.kind in ("impact", "contact", "release")]
        for one in (run, other)
    ]
    assert kinds[0] == kinds[1] and "release" in kinds[0]
    np.testing.assert_allclose(
        run(np.linspace(0, 20, 101)), other(np.linspace(0, 20, 101)), atol=1e-8
    )


def test_breakpoints_that_come_closer_and_closer_are_passed():
    halves = 2.0 ** -np.arange(12, 0, -1.0)
    agree(lifted([-1 - 0.01 * ns.table(x, halves, np.cos(9 * halves))], [x]), [1.0], 2.0)


def test_runs_go_on_from_their_events():
    system = SYSTEMS["a spring"]
    run = ns.simulate(system, [0.8, 0.4], 10.0)
    for event in run.events[:6]:
        rest = ns.simulate(system, start=event, t_end=10.0)
        assert [e.name for e in rest.events] == [e.name for e in run.events if e.t > event.t]
        np.testing.assert_allclose(rest.x[-1], run.x[-1], atol=1e-8)


def test_energy_is_kept_through_a_thousand_breakpoints():
    xs = np.linspace(-2, 2, 1000)
    ys = xs + 0.5 * np.sin(7 * xs)
    run = ns.simulate(lifted([v, -ns.table(x, xs, ys)]), [1.5, 0.0], 3.0, tol=1e-12)
    area = np.concatenate([[0.0], np.cumsum(np.diff(xs) * (ys[1:] + ys[:-1]) / 2)])

    def energy(a, b):
        k = min(np.searchsorted(xs, a) - 1, len(xs) - 2)
        return b**2 / 2 + area[k] + (a - xs[k]) * (ys[k] + np.interp(a, xs, ys)) / 2

    kept = [energy(*event.x) for event in run.events]
    assert len(kept) > 500
    np.testing.assert_allclose(kept, energy(1.5, 0.0), atol=1e-10)
    # each breakpoint that is passed is one event, at the breakpoint
    for event in run.events[:-1]:
        assert abs(event.x[0] - xs[event.element]) < 1e-14 and event.name == f"h{event.element}"


def test_a_noisy_spline_is_integrated_piece_by_piece():
    xs, ys = np.linspace(-1, 1, 300), np.random.default_rng(0).normal(size=300)
    system = ns.FilippovSystem.from_expression([x], [2 + 0.1 * ns.table(x, xs, ys, 3)])
    run = ns.simulate(system, [-0.99], 0.9, tol=1e-12)
    from scipy.integrate import quad
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(xs, ys, bc_type="clamped")
    inner = xs[(xs > -0.99) & (xs < run.x[-1, 0])]
    ends = [-0.99, *inner, run.x[-1, 0]]
    times = [quad(lambda s: 1 / (2 + 0.1 * spline(s)), a, b)[0] for a, b in pairwise(ends)]
    assert sum(times) == pytest.approx(0.9, abs=1e-9)
    assert len(run.events) == len(inner) + 1


def closed(argument=x, xs=(0.0, 1.0, 2.0)):
    return ns.table(argument, xs, [0.0, 1.0, 3.0], outside="error")


def test_a_table_has_no_value_beyond_its_ends():
    value = ca.Function("value", [x], [closed()])
    assert float(value(1.5)) == 2.0 and np.isnan(float(value(2.5))) and np.isnan(float(value(-0.5)))


@pytest.mark.parametrize(
    ("rhs", "words"),
    [
        (lambda: ca.sign(closed() - 0.5), "within another switch"),
        (lambda: ca.jacobian(closed(), x), "not for its derivative"),
        (lambda: closed(3 + x**2), "from 3 to inf, and its breakpoints from 0 to 2"),
    ],
)
def test_ends_that_cannot_be_watched_are_refused(rhs, words):
    with pytest.raises(ns.DefinitionError, match=words):
        lifted([rhs()], [x])


def test_sections_ensembles_and_files(tmp_path):
    system = SYSTEMS["a spring"]
    section = ns.simulate(system, [0.8, 0.4], 30.0, at=ns.Section("h4", direction=1))
    other = ns.simulate(system.of_breakpoints, [0.8, 0.4], 30.0, at=ns.Section("h4", direction=1))
    np.testing.assert_allclose(section.sample_x, other.sample_x, atol=1e-7)
    assert len(section.sample_t) > 2 and abs(section.sample_x[:, 0] - 0.1).max() < 1e-12
    starts = np.random.default_rng(0).uniform(-1, 1, (9, 2))
    many = ns.ensemble(system, starts, 8.0)
    for k, start in enumerate(starts):
        run = ns.simulate(system, start, 8.0)
        assert many.itinerary[k] == run.itinerary and (many.x[k] == run.x[-1]).all()
    run.save(tmp_path / "run.npz")
    again = ns.load(tmp_path / "run.npz")
    assert again.system == system and labels(again) == labels(run)
    assert (ns.simulate(again.system, starts[-1], 8.0).x == run.x).all()


def test_stiff_runs_pass_breakpoints_too():
    slope = ns.table(x, np.linspace(-1, 1, 21), 2e4 * np.linspace(-1, 1, 21) ** 3)
    system = lifted([-slope - 1e4 * (x - ca.cos(t))], [x], time=t)
    stiff = ns.simulate(system, [0.9], 3.0, tol=1e-9, method="stiff")
    taylor = ns.simulate(system, [0.9], 3.0, tol=1e-9, method="taylor")
    assert [e.name for e in stiff.events] == [e.name for e in taylor.events]
    assert stiff.facts.implicit_steps > 0 and abs(stiff.x[-1] - taylor.x[-1]).max() < 1e-7


def test_derivatives_and_orbits_pass_breakpoints():
    k = ca.SX.sym("k")
    system = lifted([v, -k * x - CURVE - 0.2 * v + ca.cos(t)], time=t, parameters={k: 1.0})
    require(system, [0.8, 0.4], 6.0, of=[0, 1], h=1e-6, within=1e-7)
    orbits = [
        ns.periodic_orbit(one, ns.simulate(one, [0.8, 0.4], 40 * np.pi), period=2 * np.pi)
        for one in (system, system.of_breakpoints)
    ]
    assert orbits[0].itinerary == orbits[1].itinerary and "+" in orbits[0].itinerary
    np.testing.assert_allclose(orbits[0].start, orbits[1].start, atol=1e-8)
    np.testing.assert_allclose(*[np.sort_complex(o.multipliers) for o in orbits], atol=1e-6)


@pytest.mark.parametrize("name", SYSTEMS)
def test_derivatives_are_those_with_a_surface_for_each_breakpoint(name):
    system = SYSTEMS[name]
    run = ns.simulate(system, [0.8, 0.4], 3.0, tol=1e-12, t_eval=np.linspace(0.1, 2.9, 8))
    other = replace(run, system=system.of_breakpoints)
    found, exact = ns.sensitivity(run), ns.sensitivity(other)
    assert len(found.event_times) == len(run.events) - 1 > 0
    size = 1 + abs(exact.dx_dx0).max()
    for of in ("dx_dx0", "event_times", "dt_dx0", "dsample_dx0"):
        np.testing.assert_allclose(getattr(found, of), getattr(exact, of), atol=1e-11 * size)
    assert found.nearest == exact.nearest
    np.testing.assert_allclose(found.clearance, exact.clearance, rtol=1e-9)
    rows = [1.0, 0.5], np.random.default_rng(1).normal(size=(8, 2))
    pulled = [ns.vjp(one, rows[0], samples=rows[1])[0] for one in (run, other)]
    np.testing.assert_allclose(*pulled, atol=1e-11 * size)


@pytest.mark.parametrize("order", [1, 3])
def test_derivatives_through_a_thousand_breakpoints(order):
    a, c = ca.SX.sym("a"), ca.SX.sym("c")
    xs = np.linspace(-2, 2, 1000)
    curve = ns.table(a * x + c, xs, np.sin(3 * xs) + 0.3 * xs, order)
    system = lifted([v, -curve - 0.1 * v], parameters={a: 1.1, c: 0.1})
    run = ns.simulate(system, [1.5, 0.3], 6.0, tol=1e-12)
    assert len(run.events) > 200
    found = require(system, [1.5, 0.3], 6.0, ends=True, h=1e-5, within=1e-7)
    grown = ns.gradient(run, x**2 + v)
    row = np.array([2 * run.x[-1, 0], 1.0])
    np.testing.assert_allclose(grown.x0, row @ found.dx_dx0, atol=1e-11)
    np.testing.assert_allclose([*grown.parameters.values()], row @ found.dx_dp, atol=1e-11)
    assert 0 < found.clearance < 4e-3 and found.nearest.startswith("h")


def test_exponents_and_returns_pass_breakpoints():
    system = SYSTEMS["a spring"]
    both = system, system.of_breakpoints
    found, exact = (
        ns.lyapunov_spectrum(one, [0.8, 0.4], 20.0, tol=1e-11, progress=False) for one in both
    )
    np.testing.assert_allclose(found.exponents, exact.exponents, atol=1e-8)
    np.testing.assert_allclose(found.sum_check, exact.sum_check, atol=1e-8)
    returns = [ns.orbit.poincare(one, "h4", [0.8, 0.4], count=3, tol=1e-12) for one in both]
    np.testing.assert_allclose(*[one.jacobian(2) for one in returns], atol=1e-9)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("speed", [-1.0, 0.0, 1.0])
def test_starts_and_jumps_at_both_ends_of_a_range(side, speed):
    line, s = ns.table(x, [-1, 0, 1], [-1.0, 0.0, 1.0], outside="error"), ca.SX.sym("s")
    landing = ns.Reset(s - 1, {x: side, v: side * speed, s: 0.0}, direction=1)
    still = ns.simulate(lifted([v, line - x]), [side, 0.0], 1.5)
    assert still.status == ns.Status.REACHED_END and still.x[-1].tolist() == [side, 0.0]
    start = ns.simulate(lifted([v, line - 2 * x]), [side, side * speed], 1.5, tol=1e-11)
    jumping = lifted([v, line - 2 * x, 1], (x, v, s), resets=landing)
    jump = ns.simulate(jumping, [0.0, 0.0, 0.0], 1.5, tol=1e-11)
    for run, begin in ((start, 0.0), (jump, 1.0)):
        if speed > 0:
            assert run.status == ns.Status.NOT_FINITE and abs(run.t[-1] - begin) < 1e-9
            continue
        gone = 1.5 - begin
        assert run.status == ns.Status.REACHED_END
        assert abs(run.x[-1, 0] - side * (np.cos(gone) + speed * np.sin(gone))) < 1e-9


@pytest.mark.parametrize("count", [40, pytest.param(300, marks=pytest.mark.slow)])
def test_an_orbit_through_many_breakpoints(count):
    xs = np.linspace(-2, 2, count)
    curve = ns.table(x, xs, np.sin(3 * xs) + 0.3 * xs)
    system = lifted([v, -curve - x - 0.2 * v + ca.cos(t)], time=t)
    run = ns.simulate(system, [0.8, 0.4], 40 * np.pi)
    orbit = ns.periodic_orbit(system, run, period=2 * np.pi)
    assert orbit.itinerary.count(" ") > count
    again = orbit.trajectory
    np.testing.assert_allclose(again.x[-1], orbit.start, atol=1e-9)
    by_run = np.linalg.eigvals(ns.sensitivity(again).dx_dx0)
    np.testing.assert_allclose(*map(np.sort_complex, (orbit.multipliers, by_run)), atol=1e-8)


@pytest.mark.parametrize("direction", [1, -1, 0])
def test_a_table_is_the_guard_of_a_reset_whatever_it_is_beyond_its_ends(direction):
    """It is 0.7 at x = 0.7 and x = 1.6."""
    events = []
    for outside in ("constant", "linear"):
        guard = ns.table(x, [0, 1, 2], [0, 1, 0.5], outside=outside) - 0.7
        count = ns.Reset(guard, {v: 0.9 * v}, direction=direction)
        system = ns.FilippovSystem.from_expression([x, v], [v, -x], resets=count)
        run = ns.simulate(system, [-0.5, 2.2], 6.0, tol=1e-12)
        events.append([(e.t, e.x[0]) for e in run.events if e.kind == "reset"])
    assert np.array(events[0]) == pytest.approx(np.array(events[1]), abs=1e-9)
    rising = [x for _, x in events[0]]
    own = {1: [0.7, 1.6], -1: [1.6, 0.7], 0: [0.7, 1.6, 1.6, 0.7]}[direction]
    assert rising == pytest.approx(own, abs=1e-10)


def test_modes_of_tables_watch_the_breakpoints_beside_their_cell():
    system = SYSTEMS["two arguments"]
    run = ns.simulate(system, [0.8, 0.4], 3.0)
    for event in [*run.events][:-1]:
        guards = motion(system, event.mode_before).guards
        assert 2 <= len(guards) <= 4 and event.element in [g.element for g in guards]
        letters = event.mode_before
        assert all(letters[g.element] == "-+"[g.side > 0] for g in guards)


@pytest.mark.parametrize("begin", [0.0, 1.0, 2.5])
def test_a_run_over_the_whole_range_of_a_signal_reaches_its_end(begin):
    at, values = [0, 1, 2, 3], [0.0, 1.0, -1.0, 0.5]
    system = lifted([ns.table(t, at, values, outside="error")], (x,), time=t)
    run = ns.simulate(system, [0.0], 3.0, t_start=begin)
    own = np.append(begin, [s for s in at if s > begin])
    true = np.trapezoid(np.interp(own, at, values), own)
    assert run.status == ns.Status.REACHED_END and run.t[-1] == 3.0
    assert abs(run.x[-1, 0] - true) < 1e-14
    many = ns.ensemble(system, [[0.0]], 3.0, t_start=begin)
    assert many.status[0] == ns.Status.REACHED_END and many.x[0, 0] == run.x[-1, 0]
    later = ns.simulate(system, [0.0], 3.001, t_start=begin)
    assert later.status == ns.Status.NOT_FINITE and later.t[-1] == 3.0
