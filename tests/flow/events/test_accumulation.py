"""Events that accumulate end at their limit, and nothing before it is passed over."""

import math

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

y, v, s, w, lam, force, t = (ca.SX.sym(n) for n in ("y", "v", "s", "w", "lam", "force", "t"))

_G, _E = 9.81, 0.8
#: A ball dropped from height 1 is at rest after this time, by the geometric series of its flights.
_LIMIT = math.sqrt(2 / _G) * (1 + 2 * _E / (1 - _E))

#: A ball on a table that is accelerated by ``force`` from rest at the height s and the time w.
_TABLE = ns.FilippovSystem(
    [y, v], field=[v, -2], time=t, parameters={force: 0, s: 0, w: 0, lam: 0.5},
    impacts=ns.Impact(y - s - force * (t - w) ** 2 / 2, restitution=lam),
)  # fmt: skip


def _ball(restitution=_E, **more):
    """Build a ball with a state that is the time."""
    impact = ns.Impact(y, restitution=restitution)
    return ns.FilippovSystem([y, v, s], field=[v, -_G, 1], impacts=impact, **more)


def _end(system, start, t_end):
    """End of a run, by both drivers."""
    run = ns.simulate(system, start, t_end)
    many = ns.ensemble(system, [start] * 3, t_end)
    assert (many.status == run.status).all()
    np.testing.assert_allclose(many.t, run.t[-1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(many.x, np.tile(run.x[-1], (3, 1)), rtol=1e-9, atol=1e-9)
    return run


@pytest.mark.parametrize(
    ("restitution", "growth"), [(0.3, -4.0), (0.527, -2.3), (0.5, -2.4), (0.7, 20.0)]
)
@pytest.mark.parametrize("tol", [1e-7, 1e-9, 1e-11])
def test_the_limit_of_flights_whose_ratio_still_changes(tol, restitution, growth):
    """The load changes with time, so that flights are longer or shorter than the geometric series says."""
    load = 2.0
    system = ns.FilippovSystem(
        [y, v],
        field=[v, -(load + growth * t)],
        impacts=ns.Impact(y, restitution=restitution),
        time=t,
    )
    limit, speed = 0.0, 0.2
    while speed > 1e-18:
        pull = load + growth * limit
        flight = 2 * speed / (pull / 2 + math.sqrt(pull**2 / 4 + 2 * growth * speed / 3))
        speed = restitution * (flight * (pull + growth * flight / 2) - speed)
        limit += flight
    run = ns.simulate(system, [0, 0.2], limit + 0.02, tol=tol)
    contact = [event.t for event in run.events if event.kind == "contact"]
    assert contact == pytest.approx([limit], abs=tol)


@pytest.mark.parametrize("begin", [0.0, 1e3])
@pytest.mark.parametrize("place", [0.0, 1.0, 1e3])
@pytest.mark.parametrize("restitution", [0.3, 0.7, 0.95])
@pytest.mark.parametrize("push", [-0.7, 0.5, 3.0])
def test_rounding_of_a_gap_from_a_moving_table_moves_no_limit(push, restitution, place, begin):
    """The limit is that of a heavier ball."""
    given = {force: push, s: place, w: begin, lam: restitution}
    pull, last = 2.0 + push, 1.0 - restitution
    limit = (0.3 + math.sqrt(0.09 + 2 * pull) * (1 + restitution) / last) / pull
    start, t_end = [place + 1.0, 0.3], begin + limit + 1
    run = ns.simulate(_TABLE, start, t_end, t_start=begin, parameters=given, tol=1e-12)
    contact = next(event.t for event in run.events if event.kind == "contact")
    near = 1e-13 + (begin + place) * 1e-15 + 1e-13 / last**2
    assert contact == pytest.approx(begin + limit, abs=near, rel=0) and run.facts.t_error == 0


def test_run_that_ends_before_the_limit_does_not_reach_it():
    for early in (1e-2, 3e-6, 1e-9):
        run = _end(_ball(), [1, 0, 0], _LIMIT - early)
        assert run.t[-1] == _LIMIT - early and run.itinerary == "o"


@pytest.mark.parametrize("early", [1e-6, 1e-9])
def test_stop_and_kick_before_the_limit_happen(early):
    stop = ns.Stop(s - (_LIMIT - early))
    run = _end(_ball(stops=stop), [1, 0, 0], _LIMIT + 1)
    assert run.status is ns.Status.STOPPED
    assert run.t[-1] == pytest.approx(_LIMIT - early, abs=1e-14)
    kick = ns.Reset(s - (_LIMIT - early), [y, v + 5, s], direction=1)
    run = _end(_ball(resets=kick), [1, 0, 0], _LIMIT + 0.5)
    after = 0.5 + early
    assert run.x[-1][0] == pytest.approx(5 * after - _G / 2 * after**2, abs=2e-6)


def test_surface_before_the_limit_is_crossed_in_time():
    system = ns.FilippovSystem(
        [y, v, s], field=[v, -_G, 1 + 0 * s + (lam + 1) / 2], surfaces=[s - (_LIMIT - 3e-6)],
        multipliers=[lam], impacts=ns.Impact(y, restitution=_E),
    )  # fmt: skip
    run = _end(system, [1, 0, 0], _LIMIT + 1)
    assert run.x[-1][2] == pytest.approx(_LIMIT - 3e-6 + 2 * (1 + 3e-6), abs=1e-12)
    crossing = next(event for event in run.events if event.kind == "crossing")
    assert crossing.t == pytest.approx(_LIMIT - 3e-6, abs=1e-14)


def test_speeds_at_requested_times_are_those_of_the_impacts():
    times = _LIMIT - np.array([1e-5, 1e-6, 1e-9])
    run = ns.simulate(_ball(), [1, 0, 0], _LIMIT + 1, t_eval=times)
    many = ns.ensemble(_ball(), [[1, 0, 0]], _LIMIT + 1, t_eval=times)
    for time, *found in zip(times, run.sample_x, many.sample_x[0], strict=True):
        begin, speed = math.sqrt(2 / _G), math.sqrt(2 * _G) * _E
        while begin + 2 * speed / _G <= time:
            begin, speed = begin + 2 * speed / _G, speed * _E
        for x in found:
            assert x[1] == pytest.approx(speed - _G * (time - begin), abs=1e-9)


def test_age_of_a_run_does_not_lengthen_what_is_replaced():
    clock = ns.Clock(20.0, map=[y, v + 5.0])
    impact = ns.Impact(y, restitution=_E)
    system = ns.FilippovSystem([y, v], field=[v, -_G], impacts=impact, clocks=clock)
    run = ns.simulate(system, [0, 0, 0], 20.0 * 1000 + 19, max_events=10**6)
    impacts = np.array([event.t for event in run.events if event.kind == "impact"])
    contacts = np.array([event.t for event in run.events if event.kind == "contact"])
    last = impacts[np.searchsorted(impacts, contacts) - 1]
    assert len(contacts) == 1000 and (contacts - last).max() < 2e-5
    since = contacts - 20.0 * np.arange(1, 1001)
    np.testing.assert_allclose(since, 10 / _G / (1 - _E), rtol=0, atol=1e-9)
    for kick in (1, 100, 1000):  # the ball rests there: every kick is as the first
        at = last[kick - 1] + 0.3 * (contacts[kick - 1] - last[kick - 1])
        time, speed = 20.0 * kick, 5.0
        while time + 2 * speed / _G <= at:
            time, speed = time + 2 * speed / _G, speed * _E
        assert run(at)[1] == pytest.approx(speed - _G * (at - time), abs=2e-5)


@pytest.mark.parametrize(("gravities", "restitution"), [(1.05, 0.8), (1.1, 0.7)])
def test_shaken_table_after_waiting(gravities, restitution):
    def at_end(wait):
        drive = gravities * _G * ca.sin(s)
        system = ns.FilippovSystem(
            [y, v, s, w], field=[v * w, (-_G + drive) * w + force, w, 0],
            impacts=ns.Impact(y, restitution=restitution, reaction=force), resets=ns.Reset(t - wait, [y, v, s, 1], direction=1), time=t,
        )  # fmt: skip
        return ns.simulate(system, [0.1, 0, 0, 0], wait + 40, max_events=10**6).x[-1]

    np.testing.assert_allclose(at_end(1e4), at_end(1.0), rtol=0, atol=1e-8)


def test_ball_on_a_sprung_plate_after_waiting():
    plate, speed = ca.SX.sym("plate"), ca.SX.sym("speed")

    def at_end(wait):
        field = [v, -1 + force, speed, -plate - 0.2 * speed - 0.5 * force]
        system = ns.FilippovSystem(
            [y, v, plate, speed, w], field=[*[w * f for f in field], 0],
            impacts=ns.Impact(y - plate, restitution=0.8, reaction=force),
            resets=ns.Reset(t - wait, [y, v, plate, speed, 1], direction=1), time=t,
        )  # fmt: skip
        return ns.simulate(system, [1.0, 0, -0.3, 0, 0], wait + 15, max_events=10**6).x[-1]

    np.testing.assert_allclose(at_end(1e5), at_end(1.0), rtol=0, atol=1e-8)


def _turning():
    """The surface is crossed at 1 - 2**(-k / 2 - 1 / 4), and has no series at the limit 1."""
    turns = ca.cos(2 * ca.pi * ca.log(1 - v) / np.log(2.0))
    return ns.FilippovSystem([y, v], surface=turns, above=[1, 1], below=[-1, 1])


def test_a_surface_without_a_series_at_the_limit_ends_the_run_there():
    run = _end(_turning(), [0, 0], 2.0)
    assert run.status is ns.Status.ACCUMULATION and run.t[-1] < 1
    assert run.accumulation_time == pytest.approx(1.0, abs=1e-10)
    times = [event.t for event in run.events if event.kind == "crossing"]
    first = [1 - 2 ** (-k / 2 - 1 / 4) for k in range(7)]
    assert len(times) > 50 and times[:7] == pytest.approx(first, abs=1e-12)


def test_a_run_that_is_read_at_the_limit_does_not_stand_still_there():
    run = ns.simulate(_turning(), [0, 0], 2.0, t_eval=[1.0], max_steps=2000)
    assert run.status in (ns.Status.STEP_TOO_SMALL, ns.Status.ACCUMULATION)


@pytest.mark.parametrize("phase", [0.0, 0.7, 1.4, 2.9])
@pytest.mark.parametrize("kind", ["reset", "crossing"])
def test_events_end_where_the_field_has_no_series(kind, phase):
    """cos(log x + phase) is zero at exp(-pi (k + 1/2) - phase); v' is infinite at the limit."""
    x = ca.SX.sym("x")
    guard, steep = ca.cos(ca.log(x) + phase), 1 / ca.sqrt(x)
    if kind == "reset":
        resets = ns.Reset(guard, [x, -v])
        system = ns.FilippovSystem([x, v], field=[-1, steep], resets=resets)
    else:
        system = ns.FilippovSystem([x, v], surface=guard, above=[-1, steep], below=[-1, -steep])
    run = ns.simulate(system, [1, 0.5], 2.0)
    assert run.status is ns.Status.ACCUMULATION
    assert run.accumulation_time == pytest.approx(1, abs=1e-12)
    times = [event.t for event in run.events if event.kind == kind]
    zeros = [math.exp(-math.pi * (k + 0.5) - phase) for k in range(-1, len(times))]
    assert times == pytest.approx([1 - at for at in zeros if at < 1][: len(times)], abs=1e-12)
