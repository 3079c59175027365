"""Other scales, exact boundaries, several things at once: what a user may write and no example does, each at
its closed form."""

from math import cos, erf, exp, log, pi, sin, sqrt, tan

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, z, u, v, w, t, lam, kap, mul, r, q = (
    ca.SX.sym(s) for s in ("x", "y", "z", "u", "v", "w", "t", "lam", "kap", "mul", "r", "q")
)
G = 9.81


def smooth(states, field, **more):
    return ns.FilippovSystem(states, field=field, **more)


def two(surface, above, below, states=(x, y), **more):
    return ns.FilippovSystem([*states], surface=surface, above=above, below=below, **more)


def lifted(states, rhs):
    return ns.FilippovSystem.from_expression(states, rhs)


def falling(e, g=G):
    return smooth([y, v], [v, -g], impacts=ns.Impact(y, restitution=e))


def balls(e):
    """Two equal balls on a line; the first runs into the second."""
    impact = ns.Impact(y - x, restitution=e, reaction=r)
    return smooth([x, y, u, v], [u, v, -r, r], impacts=impact)


def cradle():
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    impacts = [
        ns.Impact(y - x, restitution=1.0, reaction=a),
        ns.Impact(z - y, restitution=1.0, reaction=b),
    ]
    return smooth([x, y, z, u, v, w], [u, v, w, -a, a - b, b], impacts=impacts)


def walls(*gaps, e=0.5, push=(0, 0)):
    impacts = [ns.Impact(gap, restitution=e, name=f"wall {i}") for i, gap in enumerate(gaps)]
    return smooth([x, y, u, v], [u, v, *push], impacts=impacts)


def incline(slope, mu=0.3):
    """A block on the ground with friction, pulled along it by a part ``slope`` of its weight."""
    return ns.FilippovSystem(
        [x, y, u, v],
        field=[u, v, G * slope - mu * lam * r, r - G],
        surface=u,
        multipliers=lam,
        impacts=ns.Impact(y, reaction=r),
    )


def relays(*signs):
    states = [x, y, z][: len(signs)]
    multipliers = [lam, kap, mul][: len(signs)]
    field = [s + b * m for (s, b), m in zip(signs, multipliers, strict=True)]
    return ns.FilippovSystem(states, field=field, multipliers=multipliers, surfaces=states)


#: Name: system, start, t_end, last state (NaN: not asked), itinerary (None: not asked), options.
CASES = {
    "a big state decays onto a surface": (
        lambda: two(x - 1e8, [-x - 1e9], [-x + 1e9], [x]), [1e12], 20.0, [1e8], "+ s", {}),
    "a slow oscillator": (
        lambda: smooth([x, v], [v, -1e-18 * x]), [1.0, 0.0], 1e9 * pi, [-1.0, 0.0], None, {}),
    "a run that starts at 1e6": (
        lambda: smooth([y], [cos(1.0) * ca.cos(t - 1e6)], time=t),
        [0.0], 1e6 + 5, [cos(1.0) * sin(5.0)], None, {"t_start": 1e6}),
    "a start on a surface that is crossed": (
        lambda: two(x, [1], [1], [x]), [0.0], 1.0, [1.0], "+", {}),
    "an end on a surface": (lambda: two(x - 1, [2], [1], [x]), [0.0], 1.0, [1.0], None, {}),
    "an end at an entry": (lambda: two(x - 1, [-2], [1], [x]), [0.0], 1.0, [1.0], None, {}),
    "a run of no time": (lambda: two(x, [1], [2], [x]), [0.0], 0.0, [0.0], None, {}),
    "three surfaces reached at once": (
        lambda: relays((0, -1), (0, -1), (0, -1)), [1.0] * 3, 2.0, [0.0] * 3, "+++ sss", {}),
    "two surfaces crossed at once": (
        lambda: relays((2, 1), (2, 1)), [-1.0, -1.0], 2.0, [3.0, 3.0], "-- ++", {}),
    "a parabola that touches": (
        lambda: two(y, [1, 2 * x], [1, -5]), [-1.0, 1.0], 2.0, [1.0, 1.0], "+", {}),
    "a cubic that passes without slope": (
        lambda: two(y, [1, 3 * x**2], [1, 3 * x**2]), [-1.0, -1.0], 2.0, [1.0, 1.0], None, {}),
    "close to a pole": (lambda: smooth([x], [1 + x**2]), [0.0], 1.5, [tan(1.5)], None, {}),
    "a kick": (
        lambda: smooth([y], [ca.exp(-(((t - 20) / 0.3) ** 2))], time=t),
        [0.0], 40.0, [0.3 * sqrt(pi)], None, {}),
    "a surface with a bump": (
        lambda: two(y - 1 + ca.exp(-((x - 30) ** 2)) / 2, [1, 0], [1, 0]),
        [0.0, 0.7], 60.0, [60.0, 0.7], "- + -", {}),
    "a wave packet of no area": (
        lambda: smooth([y], [ca.exp(-(((t - 30) / 3) ** 2)) * ca.cos(20 * (t - 30))], time=t),
        [0.0], 60.0, [0.0], None, {}),
    "a logistic that starts at 1e-30": (
        lambda: smooth([x], [x * (1 - x)]),
        [1e-30], 100.0, [1 / (1 + (1e30 - 1) * exp(-100.0))], None, {"atol": 1e-45}),
    "a late exponential": (
        lambda: smooth([x, y], [1, ca.exp(20 * (x - 10))]), [0.0, 0.0], 10.0, [10.0, 0.05], None, {}),
    "a steep step": (
        lambda: smooth([x, y], [1, ca.erf(50 * (x - 20)) + 1]), [0.0, 0.0], 40.0, [40.0, 40.0], None, {}),
    "a steep surface": (
        lambda: two(ca.tanh(10 * (x - 20)), [1, 1], [1, -1]), [0.0, 0.0], 40.0, [40.0, 0.0], "- +", {}),
    "a ball of a micrometre": (lambda: falling(0.5, G * 1e-6), [1e-6, 0.0], 10.0, [0.0, 0.0], "o c", {}),
    "a fall of a million kilometres": (lambda: falling(0.5), [1e9, 0.0], 1e6, [0.0, 0.0], "o c", {}),
    "no restitution": (lambda: falling(0.0), [1.0, 0.0], 3.0, [0.0, 0.0], "o c", {}),
    "two balls that exchange speeds": (
        lambda: balls(1.0), [0.0, 1.0, 1.0, 0.0], 3.0, [1.0, 3.0, 0.0, 1.0], None, {}),
    "two balls that lose some": (
        lambda: balls(0.5), [0.0, 1.0, 1.0, 0.0], 3.0, [1.5, 2.5, 0.25, 0.75], None, {}),
    "a cradle": (
        cradle, [0.0, 1.0, 1.5, 1.0, 0.0, 0.0], 3.0, [1.0, 1.5, 3.0, 0.0, 0.0, 1.0], None, {}),
    "into a corner": (
        lambda: walls(x, y), [1.0, 1.0, -1.0, -1.0], 2.0, [0.5] * 4, None, {}),
    "into a wedge": (
        lambda: walls(y - x / 2, y + x / 2, e=0.0, push=(0, -G)),
        [0.0, 1.0, 0.0, 0.0], 3.0, [0.0] * 4, "oo cc", {}),
    "down an incline from rest": (
        lambda: walls(y + x, push=(0, -G)),
        [0.0] * 4, 1.0, [G / 4, -G / 4, G / 2, -G / 2], "c", {}),
    "friction stops it": (
        lambda: incline(0.2), [0.0, 0.0, 1.0, 0.0], 3.0, [1 / (0.2 * G), 0.0, 0.0, 0.0], "+c sc", {}),
    "friction does not hold it": (
        lambda: incline(0.4), [0.0] * 4, 3.0, [0.45 * G, 0.0, 0.3 * G, 0.0], "+c", {}),
    "a jump in units of 1e-9": (
        lambda: smooth([x, y], [1, 0], resets=ns.Reset(x - 1e-9, [0, y + 1])),
        [0.0, 0.0], 3.5e-9, [0.5e-9, 3.0], None, {}),
    "two jumps at one place": (
        lambda: smooth(
            [x, y], [1, 0], resets=[ns.Reset(x - 1, [0, y + 1]), ns.Reset(x - 1, [0, y + 10])]
        ),
        [0.0, 0.0], 3.5, [0.5, 3.0], None, {}),
    "a logarithm of the other side": (
        lambda: two(y - 0.1, [1, 1], [ca.log(1 - x), 1]), [0.5, 0.2], 3.0, [3.5, 3.2], "+", {}),
    "a root of the other side, beside friction": (
        lambda: lifted([x, y], [ca.sign(x) * ca.sqrt(0.01 + ca.fabs(x)), -ca.sign(y)]),
        [0.005, 1.0], 3.0, [(sqrt(0.015) + 1.5) ** 2 - 0.01, 0.0], "++ +s", {}),
    "an exponential of the other side that overflows": (
        lambda: lifted([x, y], [-ca.if_else(x < 0.7, 1e-9 * ca.exp(x / 0.025), x), -ca.sign(y)]),
        [50.0, 1.0], 3.0, [50 * exp(-3.0), 0.0], None, {}),
    "nothing moves": (lambda: smooth([x], [0.0]), [1.0], 1e9, [1.0], None, {}),
    "sixty states": (
        lambda: smooth(ca.vertsplit(ca.SX.sym("s", 60)), [1.0] * 60), [0.0] * 60, 1.0, [1.0] * 60,
        None, {}),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_closed_form(name):
    make, start, t_end, expected, itinerary, options = CASES[name]
    run = ns.simulate(make(), start, t_end, **options)
    assert run.status is ns.Status.REACHED_END
    assert itinerary is None or run.itinerary == itinerary
    size = max(np.abs(expected).max(), np.abs(start).max() * 1e-3) or 1.0
    assert np.abs(run.x[-1] - expected).max() <= 1e-8 * size


@pytest.mark.parametrize("length", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("time", [1e-9, 1e9])
def test_friction_in_any_units(length, time):
    """An oscillator of amplitude 2.2 loses 0.6 at each swing and rests at -0.2."""
    k, force = 1 / time**2, 0.3 * length / time**2
    system = two(v, [v, -k * x - force], [v, -k * x + force], [x, v])
    options = {"atol": 1e-10 * min(length, length / time), "rtol": 1e-10}
    run = ns.simulate(system, [2.2 * length, 0.0], 13 * time, **options)
    assert run.itinerary == "- + - + s"
    assert abs(run.x[-1, 0] / length + 0.2) < 1e-8
    crossing = run.events[0].t / time
    assert abs(crossing - pi) < 1e-8


def test_elastic_bounces_keep_their_energy():
    run = ns.simulate(falling(1.0), [1.0, 0.0], 200.0)
    assert len(run.events) > 200
    assert np.abs(run.x[:, 0] * G + run.x[:, 1] ** 2 / 2 - G).max() < 1e-7


def test_a_pulse_that_breaks_friction_late():
    system = two(v, [v, 3 * ca.exp(-((t - 30) ** 2)) - 0.4], [v, 3 * ca.exp(-((t - 30) ** 2)) + 0.4],
                 [x, v], time=t)  # fmt: skip
    run = ns.simulate(system, [0.0, 0.0], 60.0)
    starts = 30 - sqrt(log(3 / 0.4))
    assert run.itinerary.startswith("s +") and abs(run.events[0].t - starts) < 1e-9
    stops = next(e.t for e in run.events if e.kind == "entry")
    impulse = 3 * sqrt(pi) / 2 * (erf(stops - 30) - erf(starts - 30)) - 0.4 * (stops - starts)
    assert abs(impulse) < 1e-8


FAST = 1e15  # in a unit of time of a femtosecond


def test_what_happens_soon_after_the_end_does_not_happen():
    system = ns.FilippovSystem([x], field=[FAST], stops=ns.Stop(x - 1.5))
    starts = np.linspace(-0.1, 0.1, 80)[:, None]
    found = ns.ensemble(system, starts, 1 / FAST, work=ns.Work(progress=False))
    assert (found.status == ns.Status.REACHED_END).all()
    np.testing.assert_allclose(found.x, starts + 1, rtol=0, atol=1e-12)
    assert ns.simulate(system, [0.0], 1 / FAST).status is ns.Status.REACHED_END
    assert ns.simulate(system, [0.0], 1.5 / FAST).status is ns.Status.STOPPED


def test_events_that_a_short_time_divides_are_two():
    resets = [ns.Reset(x - 1, {y: y + 1}), ns.Reset(x - 1.5, {y: 2 * y})]
    system = ns.FilippovSystem([x, y], field=[FAST, -0.5 * FAST], resets=resets)
    run = ns.simulate(system, [0.0, 0.0], 2 / FAST, at=ns.Section("reset"))
    np.testing.assert_allclose([e.t * FAST for e in run.events], [1, 1.5, 2], rtol=1e-12)
    np.testing.assert_allclose(run.x[-1], [2, 2 * (0.5 - 0.25) - 0.25], rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.sample_t * FAST, [1, 1.5], rtol=1e-12)
