"""The error of events, end states and dense output falls in step with the tolerance, 1e-4 to 1e-13."""

from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

TOLERANCES = [10.0**-k for k in range(4, 14)]
ROUNDING = 2e-13  # of a few dozen steps and events, at states and times of order ten


@dataclass(frozen=True)
class Case:
    """A system, its start, and the events in closed form or to twenty digits."""

    system: ns.FilippovSystem
    start: tuple
    t_end: float
    itinerary: str
    times: tuple
    states: tuple


def dry_friction():
    """Problem 1: turning points -2.2, 1.4, -0.6 of an oscillator; it sticks at -0.2."""
    return Case(
        ns.textbook.dry_friction().system,
        (3.0, 0.0),
        20.0,
        "- + - + s",
        (np.pi, 2 * np.pi, 3 * np.pi, 4 * np.pi, 20.0),
        ((-2.2, 0.0), (1.4, 0.0), (-0.6, 0.0), (-0.2, 0.0), (-0.2, 0.0)),
    )


def spiral():
    """Problem 2: a spiral that reverses on the unit circle at t = 1."""
    end = (-1.5974603774506981221, -0.76149362060601145276)
    system = ns.textbook.spiral_oscillator().system
    return Case(system, (np.exp(-1.0), 0.0), np.pi / 2, "- +", (1.0, np.pi / 2), ((1.0, 0.0), end))


def stick_slip():
    """Problem 3: friction 1/(1 + 3 |v_rel|); one period and a second landing."""
    slipping, period, landing = (
        4.2959995254801548834,
        12.001031294830578647,
        -0.54100635387008475271,
    )
    return Case(
        ns.textbook.leine_stick_slip().system,
        (1.0, 0.2),
        period + slipping + 2.0,
        "- s - s",
        (slipping, period, period + slipping, period + slipping + 2.0),
        ((landing, 0.2), (1.0, 0.2), (landing, 0.2), (landing + 0.4, 0.2)),
    )


def impact():
    """Problem 16: compliant impact with friction; slips, sticks, slips the other way, separates."""
    nan = np.nan
    return Case(
        ns.textbook.kelvin_voigt_bounce().system,
        (0.0, 1.0, 0.0, -1.0, 0.0),
        10.0,
        "+ s -",
        (1.10002359853743845, 2.47845549499308424, 2.8053741589056785987),
        ((nan,) * 5, (nan,) * 5, (nan, nan, nan, 0.56948169195034287377, nan)),
    )


CASES = {f.__name__: f for f in (dry_friction, spiral, stick_slip, impact)}


@cache
def case(name):
    return CASES[name]()


@cache
def run(name, tol):
    c = case(name)
    return ns.simulate(c.system, c.start, c.t_end, tol=tol)


def event_error(name, tol):
    c = case(name)
    events = run(name, tol).events
    assert run(name, tol).itinerary == c.itinerary
    times = np.array([e.t for e in events])
    states = np.array([e.x for e in events])
    assert times.shape == (len(c.times),)
    return max(np.max(np.abs(times - c.times)), np.nanmax(np.abs(states - np.array(c.states))))


@pytest.mark.parametrize("tol", TOLERANCES)
@pytest.mark.parametrize("name", CASES)
def test_events_and_end_are_within_the_tolerance(name, tol):
    assert event_error(name, tol) <= tol + ROUNDING


@pytest.mark.parametrize("tol", TOLERANCES)
@pytest.mark.parametrize("name", CASES)
def test_dense_output_is_within_the_tolerance(name, tol):
    exact, found = run(name, 1e-15), run(name, tol)
    t = np.linspace(0.0, min(exact.t[-1], found.t[-1]), 501)
    assert np.max(np.abs(found(t) - exact(t))) <= 2 * tol + ROUNDING


@pytest.mark.parametrize("name", CASES)
def test_error_falls_in_proportion_to_the_tolerance(name):
    """Over the whole range the error is a power of the tolerance with exponent close to one."""
    usable = [tol for tol in TOLERANCES if tol >= 1e-11]  # below, rounding takes part
    errors = [max(event_error(name, tol), 1e-16) for tol in usable]
    slope = np.polyfit(np.log(usable), np.log(errors), 1)[0]
    assert 0.85 < slope < 1.25


def test_slip_at_separation_is_reached_to_its_digits():
    final = run("impact", 1e-13).x[-1]
    assert final[1] + final[4] == pytest.approx(-0.0340870447107, abs=5e-14)


@pytest.mark.parametrize("tol", [1e-6, 1e-8, 1e-10, 1e-13])
@pytest.mark.parametrize("count", [1, 70])
def test_a_series_with_gaps_has_its_tolerance(tol, count):
    """x' = sin t - x from 0: of x = (sin t - cos t + exp(-t))/2 two of four terms vanish, the last two at some orders."""
    x, t = ca.SX.sym("x"), ca.SX.sym("t")
    system = ns.FilippovSystem([x], field=[ca.sin(t) - x], time=t)
    many = ns.ensemble(system, np.zeros((count, 1)), 9.0, tol=tol)
    assert many.engine == ("core" if count == 1 else "lanes")
    exact = (np.sin(9.0) - np.cos(9.0) + np.exp(-9.0)) / 2
    assert np.max(np.abs(many.x - exact)) < tol


@pytest.mark.parametrize("tol", [1e-6, 1e-8, 1e-10, 1e-12, 1e-13])
def test_a_diode_opens_where_the_current_vanishes(tol):
    """The same current through a diode, from t = 2 pi on: it is back at zero at t = 2 pi + 3.9407."""
    i, u, t = (ca.SX.sym(name) for name in ("i", "u", "t"))
    diode = ns.Complementarity(i, multiplier=u)
    system = ns.FilippovSystem([i], field=[ca.sin(t) - i + u], complementarity=diode, time=t)
    run = ns.simulate(system, [0.0], 12.0, tol=tol)
    times = [event.t for event in run.events[:-1]]
    assert abs(times[2] - times[0] - 2 * np.pi) < max(100 * tol, 1e-12)
