"""Sliding-mode control, brakes, drills and tanks."""

from __future__ import annotations

import casadi as ca

from ..model import FilippovSystem, Stop
from .problem import Problem, problem, stated


def twisting() -> Problem:
    """Twisting controller, which brings a double integrator to rest in finite time.

    $x'' = -3 sgn x - sgn x'$. The speeds at $x = 0$ fall by $q = sqrt((3 - 1)/(3 + 1))$, and from (0, 1) the rest is
    reached at $(1/4 + q/2)/(1 - q)$, after infinitely many switches.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Levant 1993, Int. J. Control 58, 1247-1263; closed form.

    Examples
    --------
    >>> twisting().run(t_end=1.0).itinerary
    '++ +- -- -+'
    """
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    system = FilippovSystem.from_expression([x, v], [v, -3 * ca.sign(x) - ca.sign(v)])
    return problem(
        twisting,
        system,
        (0.0, 1.0),
        3.0,
        stated("first switch", "time of the first event", "0.25"),
        stated(
            "speed ratio", "of two speeds at x = 0, one after the other", "0.70710678118654752440"
        ),
        stated("limit", "time at which the switches accumulate", "2.0606601717798212866"),
        title="Twisting controller",
    )


def super_twisting() -> Problem:
    """Super-twisting controller, which is continuous.

    $x' = v - 1.5 sqrt(abs(x)) sgn x$, $v' = -1.1 sgn x$. It is linear in $sqrt(abs(x))$ and v, in a time of its own.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Levant 1993, Int. J. Control 58, 1247-1263; limit by matrix exponentials.

    Examples
    --------
    >>> super_twisting().run().itinerary[-1]
    's'
    """
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    root = 1.5 * ca.sign(x) * ca.sqrt(ca.fabs(x))
    return problem(
        super_twisting,
        FilippovSystem.from_expression([x, v], [v - root, -1.1 * ca.sign(x)]),
        (1.0, 0.0),
        3.0,
        stated("limit", "time at which it comes to rest", "1.74166272512746531"),
        title="Super-twisting controller",
    )


def abs_brake() -> Problem:
    """Anti-lock brake: a relay keeps the wheel at the slip with the largest friction.

    The speed follows $v' = -9.81 m(s)$ with $m = 2 m_0 s_0 s/(s_0^2 + s^2)$, $m_0 = 0.8$, $s_0 = 0.2$; the slip s has
    $s' = 30/v (0.4 - 0.8 lambda - m/2)$ with the relay $lambda = sgn(s - s_0)$. Sliding keeps $s = s_0$: from 30 m/s the speed
    is 1 m/s after $29/(9.81 m_0)$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: after Drakunov, Ozguner, Dix & Ashrafi 1995, IEEE Trans. Control Syst. Technol. 3, 79-85, simplified; closed form.

    Examples
    --------
    >>> abs_brake().run().itinerary
    's'
    """
    v, s, lam = ca.SX.sym("v"), ca.SX.sym("s"), ca.SX.sym("lam")
    grip = 2 * 0.8 * 0.2 * s / (0.2**2 + s**2)
    system = FilippovSystem(
        [v, s],
        surface=s - 0.2,
        multipliers=lam,
        field=[-9.81 * grip, 30 / v * (0.4 - 0.8 * lam - grip / 2)],
        stops=[Stop(v - 1, -1, "slow")],
    )
    return problem(
        abs_brake,
        system,
        (30.0, 0.2),
        5.0,
        stated("braking time", "time of the stop", "3.6952089704383282365"),
        stated("mean of the relay", "lambda while sliding", "0"),
        title="Anti-lock brake",
    )


def drill_string() -> Problem:
    """Drill string whose bit sticks and slips.

    The twist x has $x' = W - v$, the bit $v' = x + c (W - v) - T(v)$ with $T = (1 + 2/(1 + abs(v))) sgn v$ and
    $c = 0.08$. Steady drilling $v = W$ loses its stability below $W = sqrt(2/c) - 1$; the torque that breaks the bit
    loose is 3.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: after Leine, van Campen & Keultjes 2002, J. Vib. Acoust. 124, 209-220, one degree of freedom; closed form.

    Examples
    --------
    >>> drill_string().run(t_end=20.0).itinerary
    's + s + s +'
    """
    x, v, speed, c, lam = (ca.SX.sym(s) for s in ("x", "v", "W", "c", "lam"))
    torque = (1 + 2 / (1 + lam * v)) * lam
    system = FilippovSystem(
        [x, v],
        surface=v,
        above=[speed - v, ca.substitute(x + c * (speed - v) - torque, lam, 1)],
        below=[speed - v, ca.substitute(x + c * (speed - v) - torque, lam, -1)],
        parameters={speed: 1.0, c: 0.08},
    )
    return problem(
        drill_string,
        system,
        (0.0, 0.0),
        60.0,
        stated("critical speed", "W at the Hopf point of steady drilling", "4"),
        stated("break-away", "x + c W where the bit starts", "3"),
        title="Drill string that sticks and slips",
    )


def tank_cascade() -> Problem:
    """Two tanks that empty into one another.

    $x' = -sqrt(x)$, $y' = sqrt(x) - sqrt(y)$ from (1, 1): the first is empty at $t = 2$, the second
    $2 sqrt(y(2))$ later.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Torricelli's law; y(2) by a Taylor method in 30 digits.

    Examples
    --------
    >>> tank_cascade().run().x[-1].tolist()
    [0.0, 0.0]
    """
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    first, second = ca.sqrt(ca.fmax(x, 0)), ca.sqrt(ca.fmax(y, 0))
    return problem(
        tank_cascade,
        FilippovSystem.from_expression([x, y], [-first, first - second]),
        (1.0, 1.0),
        4.0,
        stated("empty", "times at which they are empty", "2", "3.0925860317472027549"),
        title="Tanks in cascade",
    )
