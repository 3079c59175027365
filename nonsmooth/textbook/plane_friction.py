"""Coulomb friction in the plane: blocks, balls and a disc that slide in two directions."""

from __future__ import annotations

from typing import Any

import casadi as ca

from ..model import FilippovSystem
from .problem import Problem, problem, stated


def _symbols(*names: str) -> list[Any]:
    return [ca.SX.sym(name) for name in names]


def block_on_incline() -> Problem:
    """Block on an inclined plane that slides down and across, turns, and comes to rest.

    $v' = (sin s, 0) - mu cos(s) v/abs(v)$, with slope $s = 0.4$, $mu = 0.7$, and gravity 1. With $a = sin s$,
    $c = mu cos s$ and $r = abs(v)$ the sum $c r + a v1$ falls at the rate $c^2 - a^2$: the block stops at
    $(c r + a v1)/(c^2 - a^2)$, with its velocity turned downhill.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: classical; closed form.

    Examples
    --------
    >>> block_on_incline().run().itinerary
    '* s'
    """
    x1, x2, v1, v2, slope, mu = _symbols("x1", "x2", "v1", "v2", "slope", "mu")
    lam = ca.vertcat(*_symbols("lam1", "lam2"))
    load = mu * ca.cos(slope)
    system = FilippovSystem(
        [x1, x2, v1, v2],
        field=[v1, v2, ca.sin(slope) - load * lam[0], -load * lam[1]],
        surfaces=[ca.vertcat(v1, v2)],
        multipliers=[lam],
        parameters={slope: 0.4, mu: 0.7},
    )
    return problem(
        block_on_incline,
        system,
        (0.0, 0.0, 0.5, 1.2),
        6.0,
        stated("rest (t)", "time of the entry", "3.9117151021004261582"),
        stated("rest (x1, x2)", "x1, x2 at t_end", "1.5088602745103876547", "1.4858114548629446"),
        title="A block slides across an incline and stops",
    )


def block_on_belt() -> Problem:
    """Block that comes from the side onto a moving belt and is carried away.

    $v' = -mu_g (v - b)/abs(v - b)$ with the belt's velocity $b = (1.2, 0)$ and $mu_g = 0.5$. Relative to
    the belt it slides straight; over the ground it runs along a parabola, and after
    $abs(v - b)/mu_g = 4$ with the belt.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: classical; closed form.

    Examples
    --------
    >>> print(block_on_belt()["carried away (x1, x2, t)"])
    carried away (x1, x2, t): 2.4, 3.2, 4 (to 1e-09; state and time of the entry)
    """
    x1, x2, v1, v2, belt, mu_g = _symbols("x1", "x2", "v1", "v2", "belt", "mu_g")
    lam = ca.vertcat(*_symbols("lam1", "lam2"))
    system = FilippovSystem(
        [x1, x2, v1, v2],
        field=[v1, v2, -mu_g * lam[0], -mu_g * lam[1]],
        surfaces=[ca.vertcat(v1 - belt, v2)],
        multipliers=[lam],
        parameters={belt: 1.2, mu_g: 0.5},
    )
    return problem(
        block_on_belt,
        system,
        (0.0, 0.0, 0.0, 1.6),
        5.0,
        stated("carried away (x1, x2, t)", "state and time of the entry", "2.4", "3.2", "4"),
        stated("halfway (x1, x2)", "x1, x2 at t = 2", "0.6", "2.4"),
        stated("end (x1, x2)", "x1, x2 at t_end", "3.6", "3.2"),
        title="A block on a moving belt: a parabola, then a ride",
    )


def block_on_disc() -> Problem:
    """Block that is put on a spinning disc and rides with it, or slides off.

    $v' = -mu lambda$ with the slip $h = v - spin (-x2, x1)$, $mu = 0.5$ and gravity 1. On the disc friction
    has to be $spin^2 abs(x)$: at spin 1 the block stays where $abs(x) < 0.5$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: classical; the values were computed with 66 digits.

    Examples
    --------
    >>> block_on_disc().run().itinerary, block_on_disc().run({"x1": 0.6, "v1": 0, "v2": 0.6}).itinerary
    ('* s', '*')
    """
    x1, x2, v1, v2, spin, mu = _symbols("x1", "x2", "v1", "v2", "spin", "mu")
    lam = ca.vertcat(*_symbols("lam1", "lam2"))
    system = FilippovSystem(
        [x1, x2, v1, v2],
        field=[v1, v2, -mu * lam[0], -mu * lam[1]],
        surfaces=[ca.vertcat(v1 + spin * x2, v2 - spin * x1)],
        multipliers=[lam],
        parameters={spin: 1.0, mu: 0.5},
    )
    return problem(
        block_on_disc,
        system,
        (0.1, 0.0, 0.1, 0.3),
        4.0,
        stated("sticks (t)", "time of the entry", "0.59032684814857328464"),
        stated(
            "end (x1, x2)", "x1, x2 at t_end", "-0.068615334375328191576", "-0.13580414257916187"
        ),
        stated("friction on the disc", "smallest abs(x) that slides off, spin 1", "0.5"),
        title="A block rides on a disc or slides off",
    )


def cue_ball() -> Problem:
    """Billiard ball with side spin: it slips along a parabola, then rolls straight on.

    $v' = -mu g lambda$, $w' = -(5/2) mu g lambda$ with the slip $h = v + w$ of its lowest point, where w is the
    part of its spin. The slip keeps its direction; after $2 abs(h)/(7 mu g)$ the ball rolls at
    $v - (2/7) h$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Coriolis 1835, "Theorie mathematique des effets du jeu de billard"; closed form.

    Examples
    --------
    >>> cue_ball().run().itinerary
    '* s'
    """
    x1, x2, v1, v2, w1, w2, mu, g = _symbols("x1", "x2", "v1", "v2", "w1", "w2", "mu", "g")
    force = -mu * g * (lam := ca.vertcat(*_symbols("lam1", "lam2")))
    system = FilippovSystem(
        [x1, x2, v1, v2, w1, w2],
        field=[v1, v2, force[0], force[1], 2.5 * force[0], 2.5 * force[1]],
        surfaces=[ca.vertcat(v1 + w1, v2 + w2)],
        multipliers=[lam],
        parameters={mu: 0.2, g: 9.81},
    )
    return problem(
        cue_ball,
        system,
        (0.0, 0.0, 3.0, 0.0, 1.0, 2.0),
        1.0,
        stated("rolls (t)", "time of the entry", "0.65125032110085618069"),
        stated(
            "rolls (x1, x2)", "x1, x2 at the entry", "1.581607922673507867", "-0.1860715203145303"
        ),
        stated("rolls (v1, v2)", "v1, v2 at t_end", "1.857142857142857142", "-0.5714285714285714"),
        title="A cue ball curves, then rolls",
    )


def turntable() -> Problem:
    """Sphere rolling on a turntable: it runs in circles, at two sevenths of the table's rate.

    $v' = -mu lambda$, $w' = -(5/2) mu lambda$ with the slip $h = v + w - spin (-x2, x1)$, spin 1.3 and gravity 1.
    While it rolls v turns at 2/7 of the table's spin, wherever the sphere is: it does not fly off.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Earnshaw 1844, "Dynamics"; Weltner 1979, Am. J. Phys. 47, 984; closed form.

    Examples
    --------
    >>> print(turntable()["period"])
    period: 16.91626813471427 (to 1e-09; time of a circle)
    """
    x1, x2, v1, v2, w1, w2, spin, mu = _symbols("x1", "x2", "v1", "v2", "w1", "w2", "spin", "mu")
    force = -mu * (lam := ca.vertcat(*_symbols("lam1", "lam2")))
    system = FilippovSystem(
        [x1, x2, v1, v2, w1, w2],
        field=[v1, v2, force[0], force[1], 2.5 * force[0], 2.5 * force[1]],
        surfaces=[ca.vertcat(v1 + w1 + spin * x2, v2 + w2 - spin * x1)],
        multipliers=[lam],
        parameters={spin: 1.3, mu: 2.0},
    )
    return problem(
        turntable,
        system,
        (0.4, 0.2, 0.3, -0.5, -0.56, 1.02),
        20.0,
        stated("period", "time of a circle", "16.916268134714271284"),
        stated(
            "opposite point (x1, x2)",
            "x1, x2 after half a period",
            "3.0923076923076923077",
            "1.8153846153846154",
        ),
        title="A sphere rolls in circles on a turntable",
    )


def pivoting_disc() -> Problem:
    """Disc that slides and spins on a table: both stop at the same time.

    An ellipsoidal limit surface: force and moment of friction are one multiplier of three components,
    $v' = -mu (lambda1, lambda2)$, $omega' = -2 mu r lambda3$, with $h = (v1, v2, r omega)$, $mu = 0.3$ and
    the radius $r = 0.6$. In the time s with $dt = abs(h) ds$ each component falls exponentially.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Goyal, Ruina & Papadopoulos 1991, Wear 143, 307-330 (limit surface); Farkas, Bartels,
    Unger & Wolf 2003, Phys. Rev. Lett. 90, 248302 (sliding and spinning end together); quadrature.

    Examples
    --------
    >>> pivoting_disc().run().itinerary
    '* s'
    """
    x1, x2, phi, v1, v2, omega = _symbols("x1", "x2", "phi", "v1", "v2", "omega")
    mu, radius = _symbols("mu", "radius")
    lam = ca.vertcat(*_symbols("lam1", "lam2", "lam3"))
    system = FilippovSystem(
        [x1, x2, phi, v1, v2, omega],
        field=[v1, v2, omega, -mu * lam[0], -mu * lam[1], -2 * mu * radius * lam[2]],
        surfaces=[ca.vertcat(v1, v2, radius * omega)],
        multipliers=[lam],
        parameters={mu: 0.3, radius: 0.6},
    )
    return problem(
        pivoting_disc,
        system,
        (0.0, 0.0, 0.0, 0.5, 0.2, 1.3),
        6.0,
        stated("rest (t)", "time of the entry", "4.0610305700787107825"),
        stated(
            "rest (x1, x2, phi)",
            "x1, x2, phi at t_end",
            "0.88077702581641480342",
            "0.35231081032656592",
            "2.7183921471252567",
        ),
        title="A disc stops sliding and spinning at once",
    )


def shaken_block() -> Problem:
    """Block on a plate that is shaken in circles: it sticks, or slides for ever in a smaller circle.

    $v' = -mu_g lambda$ with the slip $h = v - shake (cos omega t, sin omega t)$, shake 1, $omega = 2$. Where
    $mu_g < omega shake$ the block ends in a circle with velocity $mu_g/omega$, and slips at
    $sqrt(shake^2 - (mu_g/omega)^2)$: 0.6 and 0.8 for $mu_g = 1.2$. All motions end in this one.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: classical (orbital shakers); closed form.

    Examples
    --------
    >>> shaken_block().run().itinerary, shaken_block().run({"mu_g": 2.5}).itinerary
    ('*', '* s')
    """
    x1, x2, v1, v2, t = _symbols("x1", "x2", "v1", "v2", "t")
    shake, omega, mu_g = _symbols("shake", "omega", "mu_g")
    lam = ca.vertcat(*_symbols("lam1", "lam2"))
    system = FilippovSystem(
        [x1, x2, v1, v2],
        field=[v1, v2, -mu_g * lam[0], -mu_g * lam[1]],
        surfaces=[ca.vertcat(v1 - shake * ca.cos(omega * t), v2 - shake * ca.sin(omega * t))],
        multipliers=[lam],
        parameters={shake: 1.0, omega: 2.0, mu_g: 1.2},
        time=t,
    )
    return problem(
        shaken_block,
        system,
        (0.0, 0.0, 0.0, 0.0),
        30.0,
        stated("speed in the end", "abs(v) at t_end", "0.6"),
        stated("slip in the end", "abs(h) at t_end", "0.8"),
        stated("least friction that holds", "largest mu_g that slides for ever", "2"),
        title="A block on a plate that is shaken in circles",
    )
