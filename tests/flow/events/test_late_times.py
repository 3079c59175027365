"""Runs that begin late: time is two numbers, so that a motion does not depend on when it begins."""

import math

import casadi as ca
import mpmath
import numpy as np
import pytest

import nonsmooth as ns

x, v, w, y = (ca.SX.sym(name) for name in "xvwy")
t, lam, phase = (ca.SX.sym(name) for name in ("t", "lam", "phase"))
LATE = [1.7e9, 1e15]

SYSTEMS = {
    "oscillator": (ns.FilippovSystem([x, v, w], field=[1, w, -9 * v]), [0, 0, 1]),
    "ball": (
        ns.FilippovSystem([y, v, x], field=[v, -9.81, 1], impacts=ns.Impact(y, restitution=0.9)),
        [1, 0, 0],
    ),
    "relay": (
        ns.FilippovSystem([x, v], surface=x + 0.1 * v, above=[v, -1], below=[v, 1]),
        [0.7, 0.1],
    ),
}


@pytest.mark.parametrize("t_start", LATE)
@pytest.mark.parametrize("name", SYSTEMS)
def test_an_autonomous_motion_does_not_depend_on_when_it_begins(name, t_start):
    system, start = SYSTEMS[name]
    early = ns.simulate(system, start, 5.0)
    late = ns.simulate(system, start, t_start + 5.0, t_start=t_start)
    assert late.status is early.status and late.itinerary == early.itinerary
    assert [e.kind for e in late.events] == [e.kind for e in early.events]
    assert np.abs(late.x[-1] - early.x[-1]).max() < 1e-12


@pytest.mark.parametrize(
    ("name", "t_start"), [*((name, 1.7e9) for name in SYSTEMS), ("oscillator", 1e15)]
)
def test_dense_output_and_samples_are_at_the_times_that_were_requested(name, t_start):
    """Steps that begin at an event begin between two numbers."""
    system, start = SYSTEMS[name]
    requested = np.arange(1, 20) * 0.25  # numbers of their own at both starts
    early = ns.simulate(system, start, 5.0)(requested)
    times = t_start + requested
    late = ns.simulate(system, start, t_start + 5.0, t_start=t_start, t_eval=times)
    assert np.abs(late.sample_x - early).max() < 1e-11
    assert np.abs(late(times) - early).max() < 1e-11


def test_rows_of_an_ensemble_that_begins_late_are_single_runs():
    system, start = SYSTEMS["relay"]
    starts = np.array(start) + 0.01 * np.arange(80)[:, None]
    early = ns.ensemble(system, starts, 5.0, work=ns.Work(progress=False))
    late = ns.ensemble(system, starts, 1.7e9 + 5.0, t_start=1.7e9, work=ns.Work(progress=False))
    assert np.array_equal(early.status, late.status)
    assert np.abs(early.x - late.x).max() < 1e-9


OMEGA = 2.3


def block_with_friction(t_start):
    """A block under cos(omega t), and what its phase is where time starts at zero."""
    forced = -x + 1.3 * ca.cos(OMEGA * t + phase) - 0.4 * lam
    system = ns.FilippovSystem(
        [x, v],
        field=[v, forced],
        multipliers=lam,
        surface=v,
        time=t,
        parameters=[phase],
        clocks=ns.Clock(0.7, {x: x + 0.01 * ca.sin(t - t_start)}),
    )
    with mpmath.workdps(50):
        early = float(mpmath.fmod(mpmath.mpf(OMEGA) * mpmath.mpf(t_start), 2 * mpmath.pi))
    return system, early


@pytest.mark.parametrize("t_start", LATE)
def test_a_forced_motion_has_the_phase_of_its_time(t_start):
    (late, early), (shifted, _) = block_with_friction(t_start), block_with_friction(0.0)
    start, options = [1.0, 0.2, 0.1], {"tol": 1e-12}
    base = ns.simulate(shifted, start, 50.0, parameters={phase: early + 0.3}, **options)
    options["parameters"] = {phase: 0.3}
    run = ns.simulate(late, start, t_start + 50.0, t_start=t_start, **options)
    assert run.itinerary == base.itinerary and len(run.events) == len(base.events) > 100
    assert np.abs(run.x[-1] - base.x[-1]).max() < 1e-12
    for other in (run.events[11], run.events[12], run.events[60]):  # its time is no number
        again = ns.simulate(late, t_end=t_start + 50.0, start=other, **options)
        assert np.abs(again.x[-1] - base.x[-1]).max() < 1e-12
    first = ns.simulate(late, start, t_start + 17.125, t_start=t_start, **options)
    second = ns.simulate(late, t_end=t_start + 50.0, start=first, **options)
    assert np.abs(second.x[-1] - base.x[-1]).max() < 1e-12


def test_formulas_of_the_time_at_late_times():
    """By closed forms; what is not smooth is in a reset alone."""
    late, period = 1.7e9, 0.3
    since = t - late
    parts = [since**2, 1 / (1 + since), ca.tan(t), ca.sin(2 * t) * ca.cos(t / phase)]
    found = ns.FilippovSystem(
        [x, v, w, y],
        field=parts,
        time=t,
        parameters={phase: 3.0},
        resets=ns.Reset(
            ca.sin(ca.pi * since / period),
            {
                x: ca.fmod(t, period),
                v: ca.floor(t / period) - math.floor(late / period),
                w: ca.fmin(since, 5),
            },
            direction=1,
            initially=False,
        ),
    )
    run = ns.simulate(found, [0, 0, 0, 0], late + 0.25, t_start=late, tol=1e-13)
    with mpmath.workdps(40):
        begun, end = mpmath.mpf(late), mpmath.mpf(late) + mpmath.mpf(0.25)
        product = lambda s: mpmath.sin(2 * s) * mpmath.cos(s / 3)
        exact = [
            0.25**3 / 3,
            math.log(1.25),
            mpmath.log(abs(mpmath.cos(begun) / mpmath.cos(end))),
            mpmath.quad(product, [begun, end]),
        ]
        np.testing.assert_allclose(run.x[-1], [float(e) for e in exact], rtol=0, atol=1e-14)
        run = ns.simulate(found, [0, 0, 0, 0], late + 0.7, t_start=late, tol=1e-13)
        reset = [e for e in run.events if e.kind == "reset"]
        assert len(reset) == 1
        at = begun + 2 * mpmath.mpf(period)
        expected = [mpmath.fmod(at, period), mpmath.floor(at / period) - math.floor(late / period)]
        found = reset[0].x_after
        np.testing.assert_allclose(found[:3], [*map(float, expected), 0.6], rtol=0, atol=1e-12)


@pytest.mark.parametrize("end", [20.0, 1e30])
def test_rows_of_a_forced_ensemble_that_begins_late_are_single_runs(end):
    t_start = 1.7e9
    field = [v, -x + 1.3 * ca.cos(OMEGA * (t - t_start)) - 0.4 * lam]
    system = ns.FilippovSystem(
        [x, v], field=field, multipliers=lam, surface=v, time=t, stops=ns.Stop(t - t_start - 20)
    )
    starts = np.random.default_rng(0).normal(size=(80, 2))
    many = ns.ensemble(system, starts, t_start + end, t_start=t_start, work=ns.Work(progress=False))
    for start, x_end, word in zip(starts, many.x, many.itinerary, strict=True):
        run = ns.simulate(system, start, t_start + 20, t_start=t_start)
        assert run.itinerary == word
        assert np.abs(run.x[-1] - x_end).max() < 1e-12


@pytest.mark.parametrize(
    ("omega", "restitution"),
    [(4.42961710635, 0.21679278766), (3.91862178572, 0.28782781013), (4.1483932299, 0.3196847215)],
)
def test_low_flights_on_a_shaken_table_do_not_depend_on_when_time_starts(omega, restitution):
    """Flights end where they do, though they are no higher than the rounding of a late time in the gap."""
    table = 0.2 * ca.sin(omega * (t - phase))
    impact = ns.Impact(y - table, restitution=restitution)
    system = ns.FilippovSystem(
        [y, v], field=[v, -1.5 - 0.5 * y], impacts=impact, time=t, parameters=[phase]
    )
    runs = [
        ns.simulate(system, [1, 0], s + 6, t_start=s, parameters={"phase": s}, tol=1e-10)
        for s in (0.0, 1.7e9)
    ]
    assert np.abs(runs[1].x[-1] - runs[0].x[-1]).max() < 1e-8
