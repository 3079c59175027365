"""Problems on which a run once ended early or fired nothing: dependent friction, a tank, second-order sliding,
loads fed by slip, a hump of friction."""

import math

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, u, v, w, p, q, t = (ca.SX.sym(name) for name in "xyuvwpqt")
th, a, b, r1, r2 = (ca.SX.sym(name) for name in ("th", "a", "b", "r1", "r2"))
REACHED = ns.Status.REACHED_END


def block(slips, multipliers, first, second):
    """A flat block on two feet, pushed by 2 sin t, with Coulomb friction at each foot."""
    half, low, friction = 0.5, 0.1, 0.3
    feet = [
        ns.Impact(y - half * ca.sin(th), reaction=r1, name="f1"),
        ns.Impact(y + half * ca.sin(th), reaction=r2, name="f2"),
    ]
    drag = friction * (first * r1 + second * r2)
    turn = 12 * (half * ca.cos(th) * (r2 - r1) - low * drag)
    return ns.FilippovSystem(
        [x, y, th, u, v, w],
        field=[u, v, w, 2 * ca.sin(t) - drag, r1 + r2 - 9.81, turn],
        surfaces=slips,
        multipliers=multipliers,
        impacts=feet,
        time=t,
    )


SLIP = u + 0.1 * w
FEET = {"each": ([SLIP, SLIP], [a, b], a, b), "common": ([SLIP], [a], a, a)}


@pytest.mark.parametrize("feet", FEET)
@pytest.mark.parametrize("speed", [1.0, 0.0])
def test_a_flat_block_on_two_feet_slides_and_stays(feet, speed):
    """It slows by 0.3 g - 2 sin t, stops at t = 0.391106 and stays, as 2 < 0.3 g."""
    run = ns.simulate(block(*FEET[feet]), [0, 0, 0, speed, 0, 0], 2.0)
    assert run.status == REACHED
    assert abs(run.x[-1, 0] - 0.185809 * (speed > 0)) < 1e-6
    assert np.abs(run.x[-1, 1:]).max() < 1e-12


@pytest.mark.parametrize("push", [0, 1])
def test_a_tank_empties(push):
    """x = (1 - t/2)^2 until t = 2; a push below the surface changes nothing: it slides there."""
    system = ns.FilippovSystem([p], surface=p, above=[-ca.sqrt(p)], below=[push])
    run = ns.simulate(system, [1.0], 5.0)
    assert run.status == REACHED and abs(run.x[-1, 0]) < 1e-12
    assert abs(run.events[0].t - 2.0) < 1e-9


def twisting():
    return ns.FilippovSystem([p, q], field=[q, -a - 0.3 * b], surfaces=[p, q], multipliers=[a, b])


def super_twisting():
    above, below = [q - 1.5 * ca.sqrt(p), -1.1], [q + 1.5 * ca.sqrt(-p), 1.1]
    return ns.FilippovSystem([p, q], surface=p, above=above, below=below)


def test_twisting_comes_to_rest_and_stays():
    run = ns.simulate(twisting(), [10.0, 10.0], 150.0)
    assert run.status == REACHED and np.abs(run.x[-1]).max() < 1e-10
    assert run.itinerary.endswith(" ss")
    assert abs(run.events[-2].t - 75.6975) < 1e-4 or abs(run.events[-1].t - 75.6975) < 1e-4


@pytest.mark.parametrize("system", [twisting, super_twisting])
def test_second_order_sliding_rests_from_its_limit(system):
    run = ns.simulate(system(), [0.0, 0.0], 5.0)
    assert run.status == REACHED and np.abs(run.x).max() == 0.0


@pytest.mark.parametrize("start", ["free", "+"])
def test_a_load_that_slip_feeds_starts_from_rest(start):
    """u' = t - q, q' = u: u = 1 - cos t in mode +."""
    fed = ns.FilippovSystem([u, p, q], field=[p - a * q, 1, a * u], surfaces=[u], multipliers=[a])
    options = {} if start == "free" else {"start_mode": start}
    run = ns.simulate(fed, [0, 0, 0], 1.0, **options)
    assert run.status == REACHED and run.itinerary.split()[-1] == "+"
    assert np.allclose(run.x[-1], [1 - math.cos(1), 1, 1 - math.sin(1)], rtol=0, atol=1e-9)


@pytest.mark.parametrize("hump", [0.2, 0.6495, 1.5])
def test_a_hump_of_friction_releases_at_the_same_force_each_time(hump):
    """The law 0.4 a (1 + c (1 - a^2)) has its maximum at a^2 = (1 + c)/(3 c) if c > 1/2, else 0.4."""
    law = 0.4 * a * (1 + hump * (1 - a**2))
    system = ns.FilippovSystem(
        [x, v], field=[v, -x - law], surfaces=[v - 0.3], multipliers=[a], hidden=True
    )
    run = ns.simulate(system, [0.0, 0.3], 30.0)
    assert run.status == REACHED
    top = (1 + hump) * (2 / 3) * math.sqrt((1 + hump) / (3 * hump)) if hump > 0.5 else 1.0
    left = [-e.x[0] for e in run.events if e.mode_before == "s" and e.mode_after != "s"]
    assert len(left) >= 3 and np.abs(np.array(left) + 0.4 * top).max() < 1e-8
