"""Systems with periodic orbits and their bifurcations."""

from __future__ import annotations

import math

import casadi as ca

from ..model import FilippovSystem, Reset
from .problem import Problem, problem, stated

_FROM_RUN = "periodic_orbit from a run; {}"
_FROM_STATE = "periodic_orbit with the itinerary of one reset, from the start; {}"


def multi_sliding_relay() -> Problem:
    """Relay feedback of a third-order system whose orbit slides fourteen times a period.

    $x' = A x - B sgn(x1)$ with $A = [[-(2 xi w + 1), 1, 0], [-(2 xi w + w^2), 0, 1], [-w^2, 0, 0]]$,
    $B = (1, -2, 1)$, $xi = 0.05$, $w = 25$. The orbit is odd: half a period later it is its mirror image.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: di Bernardo, Johansson & Vasca 2001, Int. J. Bifurcation Chaos 11, 1121-1140.

    Examples
    --------
    >>> import nonsmooth as ns
    >>> relay = multi_sliding_relay()
    >>> orbit = ns.periodic_orbit(relay.system, relay.run(), symmetry="odd")
    >>> len(orbit.legs), relay["period"].agrees(orbit.period)
    (28, True)
    """
    x1, x2, x3, w = (ca.SX.sym(s) for s in ("x1", "x2", "x3", "w"))
    linear = [x2 - (0.1 * w + 1) * x1, x3 - (0.1 * w + w**2) * x1, -(w**2) * x1]
    system = FilippovSystem(
        [x1, x2, x3],
        surface=x1,
        above=[linear[0] - 1, linear[1] + 2, linear[2] - 1],
        below=[linear[0] + 1, linear[1] - 2, linear[2] + 1],
        parameters={w: 25.0},
    )
    return problem(
        multi_sliding_relay,
        system,
        (0.0, -0.001, -0.02),
        40.0,
        stated("period", _FROM_RUN.format("its period"), "5.961836942613702773842"),
        stated(
            "multiplier",
            _FROM_RUN.format("the one that is not structural"),
            "0.001805112240591306036108",
        ),
        title="Relay feedback with a multi-sliding orbit",
    )


def forced_dry_friction() -> Problem:
    """Forced oscillator with Coulomb friction: it turns without a stop, or sticks twice a period.

    $x'' + x + f sgn(x') = cos(W t)$, $W = 0.6$. For $f = 0.2$ it never sticks, for $f = 0.6$ it sticks once
    every half period. The orbit is odd: half a forcing period later it is its mirror image.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Den Hartog 1931, Trans. ASME 53, 107-115; Shaw 1986, J. Sound Vib. 108, 305-325.

    Examples
    --------
    >>> forced_dry_friction().run({"f": 0.6}, t_end=40.0).itinerary[-7:]
    's - s +'
    """
    x, v, t, f, W = (ca.SX.sym(s) for s in ("x", "v", "t", "f", "W"))
    drive = ca.cos(W * t) - x
    system = FilippovSystem(
        [x, v],
        surface=v,
        above=[v, drive - f],
        below=[v, drive + f],
        parameters={f: 0.2, W: 0.6},
        time=t,
    )
    sticks = {"f": 0.6}
    return problem(
        forced_dry_friction,
        system,
        (1.5, 0.0),
        100.0,
        stated("turning point", _FROM_RUN.format("largest x"), "1.550602854686835330206"),
        stated(
            "multiplier (re, im)",
            _FROM_RUN.format("of the pair, im > 0"),
            "-0.2014342020122446992105",
            "0.4273523322033219195279",
        ),
        stated(
            "stick time",
            _FROM_RUN.format("duration of a sliding leg"),
            "0.3031679627151890008652",
            at=sticks,
        ),
        stated(
            "multiplier",
            _FROM_RUN.format("the one that is not zero"),
            "0.04780783649795189025117",
            at=sticks,
        ),
        title="Forced oscillator with dry friction",
    )


def belt_oscillator() -> Problem:
    """Block on a moving belt, forced, whose orbit of four forcing periods grazes the belt's velocity.

    $u'' + u = c(1 - u') + F cos(nu t)$, $c(v) = a0 sgn v - a1 v + a2 v^3$, $a0 = a1 = 1.5$, $a2 = 0.45$,
    $F = 0.1$. At $nu = 1.7077997$ it touches the sliding region (grazing-sliding); below there is chaos.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Kowalczyk & di Bernardo 2005, Physica D 204, 204-229 (there $nu = 1.7078$).

    Examples
    --------
    >>> import nonsmooth as ns
    >>> belt = belt_oscillator()
    >>> orbit = ns.periodic_orbit(belt.system, belt.start)
    >>> orbit.problem.periods, bool(abs(orbit.margins[0].value) < 1e-12)
    (4.0, True)
    """
    u, v, t = (ca.SX.sym(s) for s in ("u", "v", "t"))
    nu, F, a0, a1, a2 = (ca.SX.sym(s) for s in ("nu", "F", "a0", "a1", "a2"))
    slip = 1 - v
    rest = -a1 * slip + a2 * slip**3 - u + F * ca.cos(nu * t)
    system = FilippovSystem(
        [u, v],
        surface=slip,
        above=[v, rest + a0],
        below=[v, rest - a0],
        parameters={nu: 1.707799714885060333284, F: 0.1, a0: 1.5, a1: 1.5, a2: 0.45},
        time=t,
    )
    return problem(
        belt_oscillator,
        system,
        (2.193338910366844980359, -0.4233606899180944085419),
        14.7,
        stated(
            "multipliers",
            "periodic_orbit from the start",
            "0.8407253925431134112291",
            "0.007192336124639061603273",
        ),
        title="Friction oscillator at its grazing-sliding",
    )


def simplest_walker() -> Problem:
    """The simplest walking model: two legs on a gentle slope, in the limit of light feet.

    $theta'' = sin(theta - g)$, $phi'' = theta'' + theta'^2 sin phi - cos(theta - g) sin phi$; at
    heelstrike, $phi = 2 theta$: $theta -> -theta$, $theta' -> cos(2 theta) theta'$, $phi -> -2 theta$,
    $phi' -> cos(2 theta) (1 - cos 2 theta) theta'$. For the slope
    $g = 0.009$ there are two gaits, a stable one of long steps and an unstable one of short steps.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Garcia, Chatterjee, Ruina & Coleman 1998, J. Biomech. Eng. 120, 281-288.

    Examples
    --------
    >>> import nonsmooth as ns
    >>> walker = simplest_walker()
    >>> gait = ns.periodic_orbit(walker.system, walker.start, itinerary=[("", "heelstrike")])
    >>> walker["long step"].agrees(gait.period), gait.stability
    (True, 'asymptotically stable')
    """
    th, rate, ph, swing, g = (ca.SX.sym(s) for s in ("th", "thdot", "ph", "phdot", "gamma"))
    field = [
        rate,
        ca.sin(th - g),
        swing,
        ca.sin(th - g) + rate**2 * ca.sin(ph) - ca.cos(th - g) * ca.sin(ph),
    ]
    c = ca.cos(2 * th)
    strike = Reset(ph - 2 * th, [-th, c * rate, -2 * th, c * (1 - c) * rate], 1, "heelstrike")
    system = FilippovSystem(
        [th, rate, ph, swing], field=field, parameters={g: 0.009}, resets=strike
    )
    angle, speed = 0.2003109005442470893602, -0.1998324730049523545376
    short = {"th": 0.194, "thdot": -0.204, "ph": 0.388, "phdot": -0.204 * (1 - math.cos(0.388))}
    return problem(
        simplest_walker,
        system,
        (angle, speed, 2 * angle, (1 - math.cos(2 * angle)) * speed),
        3.8,
        stated("long step", _FROM_STATE.format("its period"), "3.88246375285137413757"),
        stated(
            "multiplier (re, im)",
            _FROM_STATE.format("of the pair, im > 0"),
            "-0.1900998410658881460666",
            "0.5575987766820682687652",
        ),
        stated("short step", _FROM_STATE.format("its period"), "3.096105868078163699902", at=short),
        stated(
            "multiplier of short steps",
            _FROM_STATE.format("the largest"),
            "4.003864358929707178753",
            at=short,
        ),
        title="Simplest walking model",
    )


def buck_converter() -> Problem:
    """Voltage-mode buck converter: a switch that is closed below a voltage ramp of a fixed period.

    $v' = (i - v/R)/C$, $i' = (E s - v)/L$, $s = 1$ where $a (v - V_r)$ is below the
    ramp $V_L + (V_U - V_L) c/T$; $c' = 1$ is a clock that returns to 0 at T. R is 22 Ohm, L 20 mH, C 47 uF,
    T 400 us, a 8.4, $V_r$ 11.3 V, $V_L$ 3.8 V, $V_U$ 8.2 V. As the input voltage E grows, the
    orbit of one period doubles at 24.5166 V.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Fossas & Olivar 1996, IEEE Trans. Circuits Syst. I 43, 13-25; parameters of Hamill, Deane &
    Jefferies 1992, IEEE Trans. Power Electron. 7, 25-36.

    Examples
    --------
    >>> import nonsmooth as ns
    >>> buck = buck_converter()
    >>> print(ns.periodic_orbit(buck.system, buck.start).itinerary)
    - +
    """
    v, i, c, E = (ca.SX.sym(s) for s in ("v", "i", "c", "E"))
    ramp = 3.8 + 4.4 * c / 4e-4
    charge = (i - v / 22) / 47e-6
    system = FilippovSystem(
        [v, i, c],
        surface=8.4 * (v - 11.3) - ramp,
        above=[charge, -v / 0.02, 1],
        below=[charge, (E - v) / 0.02, 1],
        parameters={E: 22.0},
        resets=Reset(c - 4e-4, [v, i, 0], 1, "clock"),
    )
    return problem(
        buck_converter,
        system,
        (12.0, 0.55, 0.0),
        0.02,
        stated(
            "multiplier (re, im)",
            _FROM_RUN.format("of the pair, im > 0"),
            "-0.7527983687386007668290",
            "0.3353945246294842963954",
        ),
        stated(
            "multiplier at the period doubling",
            _FROM_RUN.format("the larger one in modulus"),
            "-1.0",
            at={"E": 24.51657282856337870174},
        ),
        title="Buck converter up to its first period doubling",
    )
