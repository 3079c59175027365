"""Problems that others brought: systems that are not generic, curved guards, close events after Hipparchus, static
friction, dependent friction, neurons, many parts, each beside a closed form or an integrator of its own."""

import math

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

h, k, x, y, u, v, w, z, t, a, b = (ca.SX.sym(name) for name in "hkxyuvwztab")
th, l1, l2, r1, r2 = (ca.SX.sym(name) for name in ("th", "l1", "l2", "r1", "r2"))
REACHED = ns.Status.REACHED_END


def losing_stability(start, **options):
    field = [0.2 - (l1 - 3 * l2), 0.1 - (3 * l1 - z * l2), 1]
    system = ns.FilippovSystem([x, y, z], field=field, surfaces=[x, y], multipliers=[l1, l2])
    return ns.simulate(system, [0, 0, start], 3.0, **options)


def test_sliding_on_two_surfaces_ends_where_the_layer_loses_stability():
    """Its trace vanishes at z = 1."""
    for start in np.random.default_rng(1).uniform(-1, 0.9, 20):
        run = losing_stability(start)
        assert run.status == ns.Status.INTERSECTION and abs(run.t[-1] + start - 1) < 1e-9
        assert [event.kind for event in run.events] == ["stability", "end"]
    assert losing_stability(-0.5, max_step=0.3).status == ns.Status.INTERSECTION


@pytest.mark.parametrize(("count", "arm"), [(5, 0), (6, 0), (24, 0), (24, 0.05)])
def test_equal_blocks_that_leave_sticking_at_one_instant(count, arm):
    """Alone, or in a ring of arms whose forces cancel."""
    velocities = [ca.SX.sym(f"v{i}") for i in range(count)]
    multipliers = [ca.SX.sym(f"m{i}") for i in range(count)]
    right, left = (multipliers[i:] + multipliers[:i] for i in (1, -1))
    field = [
        *[
            z - 0.3 * m + arm * (a + b - 2 * m)
            for m, a, b in zip(multipliers, right, left, strict=True)
        ],
        1,
    ]
    system = ns.FilippovSystem(
        [*velocities, z], field=field, surfaces=velocities, multipliers=multipliers
    )
    run = ns.simulate(system, [0] * (count + 1), 2.0)
    assert (run.status, run.itinerary) == (REACHED, "s" * count + " " + "+" * count)
    assert np.allclose(run.x[-1, :count], 1.7**2 / 2, rtol=0, atol=1e-9)


def network(count, strength):
    potentials = [ca.SX.sym(f"v{k}") for k in range(count)]
    resets = []
    for k in range(count):
        pushed = [w + strength / count for w in potentials]
        pushed[k] = ca.SX(0)
        resets.append(ns.Reset(potentials[k] - 1, pushed, direction=1, name=f"spike{k}"))
    return ns.FilippovSystem(potentials, field=[1.2 - w for w in potentials], resets=resets)


def spikes(start, strength, t_end):
    """Exact: all potentials tend to 1.2; what a spike pushes over 1 fires next, in order of definition."""
    potential, t, fired = np.array(start), 0.0, []
    while True:
        wait = np.log((1.2 - potential) / 0.2)
        k = int(np.argmin(wait))
        if t + wait[k] > t_end:
            return 1.2 - (1.2 - potential) * np.exp(t - t_end), fired
        potential, t = 1.2 - (1.2 - potential) * np.exp(-wait[k]), t + wait[k]
        due = [k]
        while due:
            k = due.pop(0)
            under = potential < 1
            potential = potential + strength / len(potential)
            potential[k] = 0.0
            fired.append((t, f"spike{k}"))
            due = sorted({*due, *np.flatnonzero(under & (potential >= 1))})


@pytest.mark.parametrize(("count", "strength"), [(2, 0.02), (5, 0.05), (20, 0.02)])
def test_neurons_that_excite_one_another(count, strength):
    start = [0.0, 0.4] if count == 2 else np.random.default_rng(0).random(count) * 0.99
    run = ns.simulate(network(count, strength), start, 20.0)
    end, fired = spikes(start, strength, 20.0)
    assert run.status == REACHED
    assert [e.name for e in run.events if e.kind == "reset"] == [name for _, name in fired]
    assert np.allclose(run.x[-1], end, rtol=0, atol=1e-8)


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
    assert abs(run.x[-1, 0] - 0.18580935277892597 * (speed > 0)) < 1e-8
    assert np.abs(run.x[-1, 1:]).max() < 1e-12


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


def at(*roots):
    return math.prod([t - root for root in roots])


#: After CloseEventsTest of Hipparchus: guards by name, end, and what is expected.
CLOSE = {
    "close": ({"a": at(5), "b": at(5.5)}, 20, [("a", 5), ("b", 5.5)]),
    "simultaneous": ({"a": at(5), "b": at(5)}, 20, [("a", 5), ("b", 5)]),
    "nearly": (
        {"a": at(9), "b": at(9 + 1e-15, 9 + 4.9)}, 20, [("a", 9), ("b", 9 + 1e-15), ("b", 9 + 4.9)]
    ),
    "fast": ({"a": at(9.9, 10.1, 12)}, 20, [("a", 9.9), ("a", 10.1), ("a", 12)]),
    "tricky": (
        {"A": at(16), "B": at(-10, 1, 15, 18), "C": at(17)},
        30,
        [("B", 1), ("B", 15), ("A", 16), ("C", 17), ("B", 18)],
    ),
    "tolerance": ({"a": at(11), "b": at(11 + 1e-5)}, 30, [("a", 11), ("b", 11 + 1e-5)]),
    "between": ({"A": at(11.1), "B": at(11, 11.2)}, 30, [("B", 11), ("A", 11.1), ("B", 11.2)]),
    "pi": (
        {"A": at(math.pi), "B": at(math.pi + 1e-12)}, 10, [("A", math.pi), ("B", math.pi + 1e-12)]
    ),
    "twenty": (
        {"A": at(*[0.5 + n for n in range(20)])}, 20, [("A", 0.5 + n) for n in range(20)]
    ),
}  # fmt: skip


@pytest.mark.parametrize("moves", [0, 1])
@pytest.mark.parametrize("case", CLOSE)
def test_close_events_of_hipparchus(case, moves):
    guards, t_end, expected = CLOSE[case]
    resets = [ns.Reset(g, [x + moves], name=name) for name, g in guards.items()]
    system = ns.FilippovSystem([x], field=[1 + 0 * t], resets=resets, time=t)
    run = ns.simulate(system, [0.0], t_end, tol=1e-12)
    found = [(e.name, e.t) for e in run.events if e.kind == "reset"]
    assert [name for name, _ in found] == [name for name, _ in expected]
    error = np.abs([one[1] - other[1] for one, other in zip(found, expected, strict=True)])
    # twenty roots: a product known to rounding, so ill-conditioned as Wilkinson's
    assert error.max() < (1e-9 if case == "twenty" else 1e-12)
