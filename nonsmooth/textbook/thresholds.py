"""Threshold policies of biology, and a threshold of the ocean's circulation."""

from __future__ import annotations

import casadi as ca

from ..model import FilippovSystem
from .problem import Problem, problem, stated


def threshold_harvesting() -> Problem:
    """Fish that are caught where there are many.

    $x' = x (1 - x) - h x (1 + lambda)/2$, $lambda = sgn(x - T)$, with $h = 1$, $T = 0.6$. From 0.1 the threshold is
    reached at $log(T (1 - x_0)/(x_0 (1 - T)))$, and kept with $lambda = 2 (1 - T)/h - 1$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: threshold policies after Meza, Costa, Bhaya & Kaszkurewicz 2005, Theor. Popul. Biol. 67, 273-284; closed form.

    Examples
    --------
    >>> threshold_harvesting().run().itinerary
    '- s'
    """
    x, h, threshold = ca.SX.sym("x"), ca.SX.sym("h"), ca.SX.sym("T")
    system = FilippovSystem(
        [x],
        surface=x - threshold,
        above=[x * (1 - x) - h * x],
        below=[x * (1 - x)],
        parameters={h: 1.0, threshold: 0.6},
    )
    return problem(
        threshold_harvesting,
        system,
        (0.1,),
        5.0,
        stated("threshold time", "time of the entry", "2.6026896854443837648"),
        stated("effort", "part (1 + lambda)/2 of the time in which fish are caught", "0.4"),
        stated("least h", "at which the threshold can be kept", "0.4"),
        title="Harvesting above a threshold",
    )


def sir_threshold() -> Problem:
    """Epidemic in which contacts are cut where the infected are too many.

    $S' = -b S I$, $I' = b S I - I$ with $b = 2$ below $I = 0.05$ and $0.8$ above it. Sliding keeps I, so that S falls
    at the rate 0.05 down to $1/2$; from there the infection dies out by itself.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: after Xiao, Xu & Tang 2012, Bull. Math. Biol. 74, 2403-2422; closed form by $I + S - log(S)/b$.

    Examples
    --------
    >>> sir_threshold().run().itinerary
    '- s -'
    """
    s, i, lam = ca.SX.sym("S"), ca.SX.sym("I"), ca.SX.sym("lam")
    contacts = (2 * (1 - lam) / 2 + 0.8 * (1 + lam) / 2) * s * i
    system = FilippovSystem(
        [s, i], surface=i - 0.05, multipliers=lam, field=[-contacts, contacts - i]
    )
    return problem(
        sir_threshold,
        system,
        (0.999, 0.001),
        80.0,
        stated("susceptibles at the entry", "S where sliding begins", "0.89507809817505603018"),
        stated("duration of the policy", "of the slide", "7.9015619635011206036"),
        stated("final size", "S at the end", "0.30840841589585258262"),
        title="Epidemic with a threshold policy",
    )


def stommel_box() -> Problem:
    """Stommel's two boxes of the ocean.

    $T' = 3 - T (1 + abs(T - S))$, $S' = e - S (0.3 + abs(T - S))$. Two equilibria meet in a nonsmooth fold where the flow
    $T - S$ vanishes, at $e = 0.9$, and in a smooth one at the largest of $(0.3 + q)(3/(1 + q) - q)$ over $q > 0$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Stommel 1961, Tellus 13, 224-230, as Dijkstra 2013 scales it; closed form.

    Examples
    --------
    >>> stommel_box().system
    FilippovSystem(2 states: T, S; 1 surface (continuous of order 1): (T-S); parameters: e)
    """
    t, s, e = ca.SX.sym("T"), ca.SX.sym("S"), ca.SX.sym("e")
    flow = ca.fabs(t - s)
    system = FilippovSystem.from_expression(
        [t, s], [3 - t * (1 + flow), e - s * (0.3 + flow)], parameters={e: 1.0}
    )
    return problem(
        stommel_box,
        system,
        (2.0, 1.0),
        50.0,
        stated("nonsmooth fold", "e of the boundary equilibrium at T = S", "0.9"),
        stated("smooth fold", "largest e with an equilibrium with T > S", "1.2201153171955243011"),
        title="Stommel's box model",
    )
