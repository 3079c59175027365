"""Impacts: jumps of the state, and a compliant contact with Coulomb friction."""

from __future__ import annotations

import casadi as ca

from ..model import FilippovSystem, Reset, Stop
from .problem import Problem, problem, stated


def bouncing_ball() -> Problem:
    """Impacts that accumulate in finite time.

    $y' = v$, $v' = -g$; at $y = 0$, $v -> -r v$. From height 1 with $g = 9.81$, $r = 0.9$: first impact at
    $t1 = sqrt(2/g)$, then intervals $2 t1 r^k$, which add up to $t1 (1 + r)/(1 - r) = 19 t1$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: classical; closed form.

    Examples
    --------
    >>> run = bouncing_ball().run()
    >>> run.status.name, round(run.accumulation_time, 9)
    ('ACCUMULATION', 8.578949179)
    """
    y, v, g, r = (ca.SX.sym(s) for s in ("y", "v", "g", "r"))
    system = FilippovSystem(
        [y, v],
        field=[v, -g],
        resets=[Reset(y, [0, -r * v], direction=-1, name="impact")],
        parameters={g: 9.81, r: 0.9},
    )
    return problem(
        bouncing_ball,
        system,
        (1.0, 0.0),
        10.0,
        stated("first impact", "time of the first reset", "0.45152364098573090445"),
        stated("Zeno time", "Trajectory.accumulation_time", "8.5789491787288871846"),
        title="Bouncing ball",
    )


def impact_oscillator() -> Problem:
    """Forced oscillator whose periodic motion grazes a wall.

    $x'' + c x' + x = A cos w t$, wall at $x = 1$ with $v -> -r v$; $c = 0.1$, $w = 0.8$. The motion without
    impacts has amplitude $a = A/sqrt((1 - w^2)^2 + (c w)^2)$ and grazes the wall when $a = 1$. The parameter
    ``phase`` shifts time so that this motion starts at (-a, 0); the start given is the grazing one.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: the standard impact oscillator (Nordmark 1991, J. Sound Vib. 145, 279-297), with
    numbers chosen for this library; grazing amplitude in closed form. The coefficient of
    restitution $r = 0.8$ does not enter the reference value.

    Examples
    --------
    >>> run = impact_oscillator().run({"A": 0.3})
    >>> len(run.events)
    1
    """
    x, v, t = ca.SX.sym("x"), ca.SX.sym("v"), ca.SX.sym("t")
    amplitude, c, w, r, phase = (ca.SX.sym(s) for s in ("A", "c", "w", "r", "phase"))
    system = FilippovSystem(
        [x, v],
        field=[v, amplitude * ca.cos(w * t + phase) - c * v - x],
        time=t,
        resets=[Reset(x - 1, [1, -r * v], direction=1, name="wall")],
        parameters={amplitude: 0.35, c: 0.1, w: 0.8, r: 0.8, phase: 3.3602615994637352},
    )
    return problem(
        impact_oscillator,
        system,
        (-1.0, 0.0),
        7.853981633974483,
        stated(
            "grazing amplitude",
            "A at which the periodic motion without impacts touches x = 1: "
            "sqrt((1 - w^2)^2 + (c w)^2)",
            "0.3687817782917154924",
        ),
        title="Impact oscillator at grazing",
    )


def kelvin_voigt_bounce() -> Problem:
    """Spinning ball pressed into compliant ground, with Coulomb friction, until it separates.

    $X'' = A + T$, $Y'' = N$, $W' = (5/2) T$ with $A = -(2 d1 eta X' + eta^2 X)$,
    $T = -lambda mu N$, $N = -2 d2 Y' - Y - G$, $lambda in Sgn(X' + W)$: at $X' + W = 0$ slip reverses or stops
    (rolling). The run ends when the load N falls to zero. $d1 = 0.3$, $d2 = 0.2$, $eta = 0.3$,
    $mu = 0.3$, $G = 0.01$, $X = Y = 0$, $Y' = -1$, and $X'$ and W given.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Biber, Champneys & Szalai 2022, linear Kelvin-Voigt law with corrected equations;
    the load is net of the weight, as in the paper.

    Examples
    --------
    >>> kelvin_voigt_bounce().run().itinerary
    '+ s -'
    """
    x, u, y, v, spin, lam = (ca.SX.sym(s) for s in ("X", "Xdot", "Y", "Ydot", "Omega", "lam"))
    d1, d2, eta, mu, weight = (ca.SX.sym(s) for s in ("d1", "d2", "eta", "mu", "G"))
    load = -2 * d2 * v - y - weight
    friction = -lam * mu * load
    system = FilippovSystem(
        [x, u, y, v, spin],
        surface=u + spin,
        multipliers=lam,
        field=[u, -(2 * d1 * eta * u + eta**2 * x) + friction, v, load, ca.SX(5) / 2 * friction],
        stops=[Stop(load, direction=-1, name="separation")],
        parameters={d1: 0.3, d2: 0.2, eta: 0.3, mu: 0.3, weight: 0.01},
    )
    slips = {"Xdot": 1.0, "Omega": 2.0}
    return problem(
        kelvin_voigt_bounce,
        system,
        (0.0, 1.0, 0.0, -1.0, 0.0),
        10.0,
        stated("separation time", "time of the stop", "2.8053741589056785987"),
        stated("Y' at separation", "Ydot at the stop", "0.56948169195034287377"),
        stated("sticking time", "time of the entry", "1.10002359853743845"),
        stated("slip restarts", "time of the exit, to mode '-'", "2.47845549499308424"),
        stated("slip at separation", "Xdot + Omega at the stop", "-0.0340870447107"),
        stated(
            "slip at separation, fast spin", "Xdot + Omega at the stop", "0.883480608935", at=slips
        ),
        stated(
            "critical spin",
            "Omega at the start for which A = 0 where N = 0 on the rolling motion",
            "0.5212841137471098897507",
            at={"Xdot": 0.2},
        ),
        title="Kelvin-Voigt bounce with friction",
    )
