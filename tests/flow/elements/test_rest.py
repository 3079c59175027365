"""Rest on h = h' = 0, where the multiplier enters the second derivative of h first."""

import math

import casadi as ca
import pytest

import nonsmooth as ns

x, v, a, z, t, lam, kap = (ca.SX.sym(n) for n in ("x", "v", "a", "z", "t", "lam", "kap"))


def _relay(force, *more, **options):
    """Build x'' = force with one relay in the position, and more states."""
    return ns.FilippovSystem(
        [x, v, *[s for s, _ in more]], field=[v, force, *[f for _, f in more]], surfaces=[x],
        multipliers=[lam], time=t, **options,
    )  # fmt: skip


def _twisting(one, two, push=0.0):
    return ns.FilippovSystem(
        [x, v], field=[v, push - one * lam - two * kap], surfaces=[x, v], multipliers=[lam, kap],
        time=t,
    )  # fmt: skip


def _limit_of_twisting(one, two, start):
    """Time until x'' = -one sgn x - two sgn v rests, and after its first zero."""
    time, far = 0.0, start
    for _ in range(200):
        time += math.sqrt(2 * far / (one - two))
        speed = math.sqrt(2 * far * (one - two))
        time, far = time + speed / (one + two), speed**2 / (2 * (one + two))
    return time


@pytest.mark.parametrize(("one", "two"), [(5.0, 2.0), (1.0, 0.3), (3.0, 2.9)])
def test_twisting_comes_to_rest_at_its_limit(one, two):
    run = ns.simulate(_twisting(one, two), [0.2, 0], 40.0)
    limit = _limit_of_twisting(one, two, 0.2)
    assert run.itinerary.endswith("ss") and run.x[-1].tolist() == [0, 0]
    (rest,) = [event for event in run.events if "s" in event.mode_after and event.kind != "end"]
    assert rest.t == pytest.approx(limit, abs=1e-8)


def test_nothing_before_the_limit_is_passed_over():
    limit = _limit_of_twisting(5.0, 2.0, 0.2)
    for early in (1e-3, 1e-6):
        run = ns.simulate(_twisting(5.0, 2.0), [0.2, 0], limit - early)
        assert run.t[-1] == limit - early and not run.itinerary.endswith("s")


def test_slow_relay_rests_below_a_speed():
    # Speeds at zeros fall by 2/3 v^2 each: 3/(2 v) of them down to v.
    run = ns.simulate(_relay(-lam - v), [1, 0], 100.0, rest_below=1e-2)
    last = run.events[-2]
    assert (last.kind, last.name, last.mode_after) == ("rest_below", "h0", "s")
    assert len(run.events) == pytest.approx(150, abs=5) and run.x[-1].tolist() == [0, 0]
    crossings = [abs(event.x[1]) for event in run.events if event.kind == "crossing"]
    assert crossings[-1] < 1e-2 and crossings[-3] >= 1e-2
    assert run.facts.rested_below == ("h0",)
    none = ns.simulate(_relay(-lam - v), [1, 0], 1.0, rest_below=1e-2)
    assert none.facts.rested_below == ()
    many = ns.ensemble(_relay(-lam - v), [[1, 0]], 100.0, rest_below=1e-2)
    assert many.itinerary[0] == run.itinerary


def test_endless_switching_names_rest_below():
    run = ns.simulate(_relay(-lam - v), [1, 0], 100.0, max_events=50)
    assert run.status is ns.Status.TOO_MANY_EVENTS and "rest_below=" in run.message
    # speeds that do not fall are no rest
    run = ns.simulate(_relay(-lam), [1e-4, 0], 1.0, rest_below=1.0, max_events=30)
    assert run.status is ns.Status.TOO_MANY_EVENTS


@pytest.mark.parametrize("speed", [0.0, -1.0, math.nan, "slow"])
def test_speed_of_rest_is_positive(speed):
    with pytest.raises(ns.OptionError, match="rest_below"):
        ns.simulate(_relay(-lam), [1, 0], 1.0, rest_below=speed)
