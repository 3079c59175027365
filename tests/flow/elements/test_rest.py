"""Rest on h = h' = 0, where the multiplier enters the second derivative of h first."""

import math

import casadi as ca
import numpy as np
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


@pytest.mark.parametrize("force", [-lam - v, -lam, -lam + v, 0.9 * ca.sin(t) - lam - v])
def test_rest_is_the_only_future_whatever_the_damping(force):
    run = ns.simulate(_relay(force), [0, 0], 5.0)
    assert (run.status, run.itinerary) == (ns.Status.REACHED_END, "s")
    assert run.x[-1].tolist() == [0, 0]
    many = ns.ensemble(_relay(force), [[0, 0]], 5.0)
    assert many.status[0] == run.status and many.x[0].tolist() == [0, 0]


def test_rest_ends_where_the_load_exceeds_the_multiplier():
    run = ns.simulate(_relay(t - lam), [0, 0], 3.0)
    assert run.itinerary == "s +" and run.events[0].t == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(run.x[-1], [4 / 3, 2], rtol=0, atol=1e-9)


def test_larger_load_leaves_at_once():
    run = ns.simulate(_relay(2 - lam), [0, 0], 3.0)
    assert run.itinerary == "+" and run.x[-1] == pytest.approx([4.5, 3])
    run = ns.simulate(_relay(-2 - lam), [0, 0], 3.0)
    assert run.itinerary == "-" and run.x[-1] == pytest.approx([-4.5, -3])


def test_load_that_equals_the_multiplier_is_decided_by_its_rate():
    assert ns.simulate(_relay(1 + t - lam), [0, 0], 1.0).itinerary == "+"
    assert ns.simulate(_relay(1 - t - lam), [0, 0], 1.0).itinerary == "s"


def test_relay_that_repels_has_several_motions():
    assert ns.simulate(_relay(lam), [0, 0], 1.0).status is ns.Status.NON_UNIQUE


@pytest.mark.parametrize(("two", "push"), [(-1, 0.0), (-1, 1.5), (-1, 2.5), (-2.9, 0.0)])
def test_twisting_that_spirals_out_has_several_motions(two, push):
    """Half a turn multiplies the speed by sqrt((3 - push - two) / (3 - push + two)) > 1, or a side is left for good."""
    run = ns.simulate(_twisting(3, two, push), [0, 0], 1.0)
    assert (run.status, run.t[-1]) == (ns.Status.NON_UNIQUE, 0)
    many = ns.ensemble(_twisting(3, two, push), [[0, 0]], 1.0)
    assert many.status[0] == ns.Status.NON_UNIQUE
    if push < 2:
        rests = ns.simulate(_twisting(3, two, push), [0, 0], 1.0, start_mode="ss")
        assert rests.status is ns.Status.REACHED_END and rests.x[-1].tolist() == [0, 0]


@pytest.mark.parametrize("push", [0.0, 0.5])
def test_third_degree_is_not_unique(push):
    system = ns.FilippovSystem([x, v, a], field=[v, a, push - lam], surfaces=[x], multipliers=[lam])
    run = ns.simulate(system, [0, 0, 0], 1.0)
    assert run.status is ns.Status.NON_UNIQUE and "third derivative" in run.message
    run = ns.simulate(system, [0, 0, 0], 1.0, start_mode="s")
    assert run.status is ns.Status.REACHED_END and run.x[-1].tolist() == [0, 0, 0]
    run = ns.simulate(system, [0, 0, 1], 0.5)
    assert run.itinerary == "+"


def test_passage_with_speed_is_a_crossing():
    run = ns.simulate(_relay(-lam), [0, 1], 3.0)
    assert run.itinerary == "+ -" and run.events[0].t == pytest.approx(2.0, abs=1e-12)
    run = ns.simulate(_relay(-lam), [0, -1], 1.0)
    assert run.itinerary == "-"


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


def test_twisting_holds_a_disturbance():
    run = ns.simulate(_twisting(3.0, 1.2, 0.3 * ca.sin(t)), [1.0, 0.0], 20.0)
    assert run.status is ns.Status.REACHED_END and abs(run.x[-1]).max() < 1e-12


def test_twisting_rests_until_the_sum_of_both_is_reached():
    run = ns.simulate(_twisting(1.0, 0.3, 0.02 * t), [0, 0], 70.0)
    assert run.itinerary == "ss ++"
    assert run.events[0].t == pytest.approx(65.0, abs=2e-8)  # the sum is 1.3 to 4e-10
    np.testing.assert_allclose(run.x[-1], [0.02 * 125 / 6, 0.01 * 25], rtol=0, atol=1e-8)


def test_nothing_before_the_limit_is_passed_over():
    limit = _limit_of_twisting(5.0, 2.0, 0.2)
    for early in (1e-3, 1e-6):
        run = ns.simulate(_twisting(5.0, 2.0), [0.2, 0], limit - early)
        assert run.t[-1] == limit - early and not run.itinerary.endswith("s")


def test_rocking_block_comes_to_rest():
    block = ns.FilippovSystem(
        [x, v], surface=x, above=[v, -4 * ca.sin(0.25 - x)], below=[v, -4 * ca.sin(-0.25 - x)],
        resets=ns.Reset(x, [x, 0.925 * v], name="impact"),
    )  # fmt: skip
    run = ns.simulate(block, [0.2, 0.0], 20.0)
    assert run.status is ns.Status.REACHED_END and run.x[-1].tolist() == [0, 0]
    rest = run.events[-2]
    assert (rest.kind, rest.name, rest.mode_after) == ("rest", "h0", "s")


def test_two_relays_rest_at_the_limit_of_their_spiral():
    spiral = ns.FilippovSystem(
        [x, v, z], field=[-lam + 2 * kap, -2 * lam - kap, 1 + x], multipliers=[lam, kap], surfaces=[x, v]
    )  # fmt: skip
    run = ns.simulate(spiral, [1.0, 0.5, 0.0], 2.0)
    rest = next(event for event in run.events if event.kind == "rest")
    assert rest.t == pytest.approx(0.75, abs=1e-9) and rest.name == "h0 and h1"
    assert run.itinerary.endswith("ss") and run.x[-1][:2].tolist() == [0, 0]


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
