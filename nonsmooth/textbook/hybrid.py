"""Hybrid automata: relays with hysteresis, gears, neurons that fire, and a block that rocks."""

from __future__ import annotations

import casadi as ca

from ..model import FilippovSystem, Reset
from .problem import Problem, problem, stated


def thermostat() -> Problem:
    """Room whose heating is switched with hysteresis.

    $x' = a q - x$ with $a = 30$; the heating is on ($q = 1$) from 18 to 22 degrees and off ($q = 0$) from 22 to 18. The
    period is $log((a - 18)/(a - 22)) + log(22/18)$, and its derivative by a is $1/(a - 18) - 1/(a - 22)$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: the first example of most texts on hybrid automata, such as Lunze & Lamnabhi-Lagarrigue 2009; closed form.

    Examples
    --------
    >>> thermostat().run(t_end=1.0).itinerary
    'q=0 q=1 q=0 q=1'
    """
    x, q, a = ca.SX.sym("x"), ca.SX.sym("q"), ca.SX.sym("a")
    system = FilippovSystem(
        [x],
        field=[a * q - x],
        discrete={q: (0, 1)},
        resets=[
            Reset(x - 18, {q: 1}, -1, "on", level=True, when=q == 0),
            Reset(x - 22, {q: 0}, 1, "off", level=True, when=q == 1),
        ],
        parameters={a: 30.0},
    )
    return problem(
        thermostat,
        system,
        (20.0, 0.0),
        5.0,
        stated("period", "time between two events 'on'", "0.60613580357031554325"),
        stated("slope of the period", "its derivative by a", "-0.041666666666666666667"),
        title="Thermostat: a relay with hysteresis",
    )


def gearbox() -> Problem:
    """Three gears that are shifted up at one speed and down at another.

    $w' = (u - w)/g$ in gear $g = 1, 2, 3$; up at $w = g + 1/2$, down at $w = g/2$. With $u = 4$ from rest the shifts
    are at $log(4/2.5)$ and $2 log(2.5/1.5)$ later.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: after the gear shifts of Hedlund & Rantzer 1999, IEEE CDC; closed form.

    Examples
    --------
    >>> gearbox().run().itinerary
    'g=1 g=2 g=3'
    """
    w, g, u = ca.SX.sym("w"), ca.SX.sym("g"), ca.SX.sym("u")
    system = FilippovSystem(
        [w],
        field=[(u - w) / g],
        discrete={g: (1, 2, 3)},
        resets=[
            Reset(w - (g + 0.5), {g: g + 1}, 1, "up", level=True, when=g <= 2),
            Reset(w - g / 2, {g: g - 1}, -1, "down", level=True, when=g >= 2),
        ],
        parameters={u: 4.0},
    )
    return problem(
        gearbox,
        system,
        (0.0, 1.0),
        10.0,
        stated(
            "shifts", "times of both events 'up'", "0.47000362924573555365", "1.4916548767777169201"
        ),
        stated("slowest eigenvalue", "of the equilibrium in gear 3", "-0.33333333333333333333"),
        title="Gearbox with three gears",
    )


def glacial_cycles() -> Problem:
    """Ice ages without an orbit: ice grows slowly to a threshold and melts fast to another.

    The ice volume follows $v' = (1 - v)/50$ in a glaciation ($q = 1$) up to 0.8, and $v' = -v/10$ in a deglaciation
    ($q = 0$) down to 0.2, in thousands of years. The period is $50 log 4 + 10 log 4$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: after the threshold model of Paillard 1998, Nature 391, 378-381, without its forcing, numbers from memory; closed form.

    Examples
    --------
    >>> glacial_cycles().run(t_end=120.0).itinerary
    'q=1 q=0 q=1'
    """
    v, q = ca.SX.sym("v"), ca.SX.sym("q")
    system = FilippovSystem(
        [v],
        field=[ca.if_else(q == 1, (1 - v) / 50, -v / 10)],
        discrete={q: (0, 1)},
        resets=[
            Reset(v - 0.8, {q: 0}, 1, "deglaciation", level=True, when=q == 1),
            Reset(v - 0.2, {q: 1}, -1, "glaciation", level=True, when=q == 0),
        ],
    )
    return problem(
        glacial_cycles,
        system,
        (0.2, 1.0),
        400.0,
        stated("period", "time between two events 'glaciation'", "83.17766166719343713"),
        title="Glacial cycles by two thresholds",
        note="parameters quoted from memory",
    )


def integrate_and_fire() -> Problem:
    """Leaky integrate-and-fire neuron.

    $v' = I - v$, and v falls from 1 to 0 when it fires. With $I = 1.3$ the period is $log(I/(I - 1))$, with the
    derivative $1/I - 1/(I - 1)$ by I.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Lapicque 1907; closed form.

    Examples
    --------
    >>> [event.name for event in integrate_and_fire().run(t_end=3.0).events]
    ['spike', 'spike', 'REACHED_END']
    """
    v, current = ca.SX.sym("v"), ca.SX.sym("I")
    system = FilippovSystem(
        [v],
        field=[current - v],
        resets=Reset(v - 1, [0], 1, "spike"),
        parameters={current: 1.3},
    )
    return problem(
        integrate_and_fire,
        system,
        (0.0,),
        10.0,
        stated("period", "time between two spikes", "1.4663370687934270447"),
        stated("slope of the period", "its derivative by I", "-2.5641025641025641026"),
        title="Integrate-and-fire neuron",
    )


def integrate_and_fire_pair() -> Problem:
    """Two integrate-and-fire neurons that inhibit each other and fire in turn.

    A spike of one lowers the other by $k = 0.1$. With the other at $u$ when one fires, the time to the next spike is
    $log((I - u + k)/(I - 1))$, and $u -> I (1 - (I - 1)/(I - u + k))$ after it.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: after Mirollo & Strogatz 1990, SIAM J. Appl. Math. 50, 1645-1662; fixed point of the map above.

    Examples
    --------
    >>> [event.name for event in integrate_and_fire_pair().run(t_end=3.5).events[:3]]
    ['second', 'first', 'second']
    """
    one, two, current, k = (ca.SX.sym(s) for s in ("v1", "v2", "I", "k"))
    system = FilippovSystem(
        [one, two],
        field=[current - one, current - two],
        resets=[
            Reset(one - 1, {one: 0, two: two - k}, 1, "first"),
            Reset(two - 1, {two: 0, one: one - k}, 1, "second"),
        ],
        parameters={current: 1.3, k: 0.1},
    )
    return problem(
        integrate_and_fire_pair,
        system,
        (0.0, 0.4),
        30.0,
        stated("period", "of the orbit on which they fire in turn", "1.6262946371279090707"),
        stated("multiplier", "of that orbit", "0.72621066311466411726"),
        title="Two neurons that inhibit each other",
    )


def integrate_and_fire_network() -> Problem:
    """Four integrate-and-fire neurons that excite one another, and absorb one another's spikes.

    $v_i' = I - v_i$ with $I = 1.2$. A neuron at 1 falls to 0 and raises those that are not at 0 by 0.1, which may make
    them fire at the same instant; those that have just fired take no notice. Three of them have locked from the
    second round on.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: after Mirollo & Strogatz 1990; events in closed form, computed one after the other in 30 digits.

    Examples
    --------
    >>> len(integrate_and_fire_network().run().events) - 1
    12
    """
    v, current = [ca.SX.sym(f"v{i}") for i in range(4)], 1.2
    spikes = [
        Reset(
            one - 1,
            {one: 0, **{w: ca.if_else(w > 0, w + 0.1, 0) for w in v if w is not one}},
            1,
            f"spike {i}",
        )
        for i, one in enumerate(v)
    ]
    return problem(
        integrate_and_fire_network,
        FilippovSystem(v, field=[current - one for one in v], resets=spikes),
        (0.9, 0.6, 0.35, 0.1),
        3.7,
        stated(
            "spikes of the first neuron",
            "times of its events",
            "0.40546510810816438198",
            "1.6990500711237875072",
            "3.009311531680371847",
        ),
        stated(
            "spikes of the others together",
            "times at which three neurons fire at one instant",
            "2.1233836635363346914",
            "3.689367616193437654",
        ),
        title="Network of neurons that excite one another",
    )


def rocking_block() -> Problem:
    """Rigid block that rocks on its corners until it stands.

    $x'' = x - sgn x$ with the angle in units of that at which it tips over, and $v -> e v$ where it changes corners,
    $e = 0.9$. From $x = 0.8$ at rest it first stands upright after $arccosh(1/(1 - 0.8))$ with the speed
    $v_1 = sqrt(1 - 0.2^2)$, the next times follow after $2 artanh(e^n v_1)$, and these add up: at the limit it stands.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Housner 1963, Bull. Seism. Soc. Am. 53, 403-417, for a slender block; closed form.

    Examples
    --------
    >>> [event.name for event in rocking_block().run(t_end=6.0).events if event.kind == "reset"]
    ['other corner', 'other corner']
    """
    x, v, e = ca.SX.sym("x"), ca.SX.sym("v"), ca.SX.sym("e")
    system = FilippovSystem(
        [x, v],
        surface=x,
        above=[v, x - 1],
        below=[v, x + 1],
        resets=Reset(x, {v: e * v}, 0, "other corner"),
        parameters={e: 0.9},
    )
    return problem(
        rocking_block,
        system,
        (0.8, 0.0),
        30.0,
        stated(
            "upright",
            "times of the first two events",
            "2.2924316695611776878",
            "5.0601842489786014798",
        ),
        stated("standing time", "limit of the times", "22.666568319209938749"),
        title="Rocking block",
    )
