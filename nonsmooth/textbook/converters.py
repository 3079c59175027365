"""Circuits with ideal diodes, and converters."""

from __future__ import annotations

import casadi as ca

from ..model import Clock, FilippovSystem
from ..model.definition.elements import Complementarity
from .problem import Problem, problem, stated


def diode_bridge() -> Problem:
    """Resonant circuit that a bridge of four diodes loads with a resistance.

    $C v' = d - c - i$, $L i' = v$. The load has the voltage $a + b$, the sum of the reverse voltages of two diodes, and c, d
    are the currents of the others: $c = d = 0$ but for one, which carries $abs(v)/R$. So v is that of a circuit without
    diodes, $10 exp(-k t)(cos w t - k/w sin w t)$ with $k = 1/(2 R C)$, $w^2 = 1/(L C) - k^2$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Acary & Brogliato 2008, Numerical Methods for Nonsmooth Dynamical Systems (Springer), with the numbers of the
    Siconos example; closed form.

    Examples
    --------
    >>> diode_bridge().run(t_end=5e-4).itinerary
    'coco ococ coco'
    """
    v, i, load, coil, capacity = (ca.SX.sym(s) for s in ("v", "i", "R", "L", "C"))
    a, b, c, d = (ca.SX.sym(s) for s in "abcd")
    conditions = (((a + b) / load - c, a), ((a + b) / load - d, b), (a - v, c), (b + v, d))
    system = FilippovSystem(
        [v, i],
        field=[(d - c - i) / capacity, v / coil],
        complementarity=[
            Complementarity(y, multiplier=own, name=str(own)) for y, own in conditions
        ],
        parameters={load: 1e3, coil: 1e-2, capacity: 1e-6},
    )
    return problem(
        diode_bridge,
        system,
        (10.0, 0.0),
        5e-3,
        stated("first change", "time at which v = 0", "1.5226800110860625411e-4"),
        stated("interval", "time between two changes", "3.1455270228880017137e-4"),
        stated("end", "state at t_end", "0.79032281964435576567", "-0.0026478501600952450155"),
        title="Diode bridge",
    )


def boost_converter() -> Problem:
    """Boost converter in discontinuous conduction.

    $L i' = E - (1 - q) v + u$, $C v' = (1 - q) i - v/R$ with $E = C = 1$, $L = 0.1$. The switch conducts, $q = 1$, for
    the part D of the period 1; the diode keeps $i >= 0$ by its reverse voltage u. The coil is empty at each tick, so
    the map from tick to tick has one state, v. The mean of v is near $(1 + sqrt(1 + 2 D^2 R/L))/2$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Erickson & Maksimovic 2001, Fundamentals of Power Electronics (Springer), ch. 5; values by matrix exponentials.

    Examples
    --------
    >>> boost_converter().run(t_end=3.0).itinerary
    '-o +o +c -o +o +c -o +o +c'
    """
    i, v, load, duty = (ca.SX.sym(s) for s in ("i", "v", "R", "D"))
    s, u, clock = ca.SX.sym("s"), ca.SX.sym("u"), Clock(1.0, name="tick")
    on = (1 - s) / 2
    system = FilippovSystem(
        [i, v],
        field=[10 * (1 - (1 - on) * v + u), (1 - on) * i - v / load],
        surfaces=[clock.phase - duty],
        multipliers=[s],
        complementarity=Complementarity(i, multiplier=u, name="diode"),
        clocks=clock,
        parameters={load: 20.0, duty: 0.3},
    )
    return problem(
        boost_converter,
        system,
        (0.0, 1.0, 0.0),
        12.0,
        stated("end", "state at t_end", "0", "3.2140208123474236465", "0"),
        stated("voltage", "v at the ticks of the orbit", "3.5122925905757211918"),
        stated(
            "conduction", "time in which the diode conducts, a period", "0.11684696806758321095"
        ),
        stated("multiplier", "of the orbit, the one that is not 0", "0.88690327967341458803"),
        title="Boost converter in discontinuous conduction",
    )


def resonant_converter() -> Problem:
    """Series resonant converter that is switched by the sign of its own current.

    $i' = E sgn i - v - R i$, $v' = i$ with $E = 1$, $R = 1/2$. With $rho = exp(-pi a/w)$, $a = R/2$,
    $w = sqrt(1 - a^2)$ the capacitor swings between $E (1 + rho)/(1 - rho)$ and its negative; the period is $2 pi/w$, the
    multiplier $rho^2$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: classical self-oscillating (LLC) drive; closed form.

    Examples
    --------
    >>> resonant_converter().run(t_end=10.0).itinerary
    '+ - + -'
    """
    i, v, source, load = (ca.SX.sym(s) for s in ("i", "v", "E", "R"))
    system = FilippovSystem(
        [i, v],
        surface=i,
        above=[source - v - load * i, i],
        below=[-source - v - load * i, i],
        parameters={source: 1.0, load: 0.5},
    )
    return problem(
        resonant_converter,
        system,
        (0.0, -1.5),
        60.0,
        stated("period", "of its orbit", "6.4892458815577790351"),
        stated("amplitude", "largest voltage on the orbit", "2.59935069570455208"),
        stated("multiplier", "of its orbit, next to 1", "0.19744179036948955834"),
        title="Series resonant converter",
    )
