"""Systems on the line and in the plane: crossing, sliding, repelling, cycles."""

from __future__ import annotations

import casadi as ca

from ..model import FilippovSystem
from .problem import Problem, problem, stated


def spiral_oscillator() -> Problem:
    """Spiral that turns the other way outside the unit circle (nosnoc's FESD test).

    $x' = A1 x$ for $abs(x) < 1$ and $A2 x$ for $abs(x) > 1$, $A1 = [[1, w], [-w, 1]]$, $A2 = [[1, -w], [w, 1]]$,
    $w = 2 pi$, from $(1/e, 0)$. The distance is $abs(x) = exp(t - 1)$; the circle is crossed at $t = 1$ at (1, 0), and
    $x(t) = exp(t - 1) (cos w(t - 1), sin w(t - 1))$ from then on.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Nurkanovic, Sperl, Albrecht & Diehl 2024, "Finite elements with switch detection".

    Examples
    --------
    >>> [event.kind for event in spiral_oscillator().run().events]
    ['crossing', 'end']
    """
    x1, x2, w = ca.SX.sym("x1"), ca.SX.sym("x2"), ca.SX.sym("w")
    system = FilippovSystem(
        [x1, x2],
        surface=x1**2 + x2**2 - 1,
        above=[x1 - w * x2, w * x1 + x2],
        below=[x1 + w * x2, -w * x1 + x2],
        parameters={w: 6.283185307179586},
    )
    return problem(
        spiral_oscillator,
        system,
        (0.36787944117144233, 0.0),
        1.5707963267948966,
        stated("crossing time", "time of the crossing", "1"),
        stated("crossing state", "state at the crossing", "1", "0"),
        stated(
            "state at pi/2",
            "simulate to t = pi/2",
            "-1.5974603774506981221",
            "-0.76149362060601145276",
        ),
        title="Spiral oscillator",
    )


def scalar_sliding() -> Problem:
    """One state that reaches the surface and stays.

    $x' = 3$ for $x < 0$ and -1 for $x > 0$, from -1: at 0 from $t = 1/3$ on, where $alpha = 1/4$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: classical; closed form.

    Examples
    --------
    >>> scalar_sliding().run().itinerary
    '- s'
    """
    x = ca.SX.sym("x")
    return problem(
        scalar_sliding,
        FilippovSystem([x], surface=x, above=[-1], below=[3]),
        (-1.0,),
        1.0,
        stated("switch time", "time of the entry", "0.33333333333333333333"),
        stated("end", "x at t_end, sliding", "0"),
        stated("alpha", "weight of the field below while sliding", "0.25"),
        title="Scalar system that slides at 0",
    )


def scalar_repelling() -> Problem:
    """One state that can leave to either side, or stay: the continuation is not unique.

    $x' = sgn x$ from 0. A run must stop with NON_UNIQUE at once; with ``start_mode`` it continues.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: classical; closed form.

    Examples
    --------
    >>> scalar_repelling().run().status.name
    'NON_UNIQUE'
    """
    x = ca.SX.sym("x")
    return problem(
        scalar_repelling,
        FilippovSystem([x], surface=x, above=[1], below=[-1]),
        (0.0,),
        1.0,
        stated("time of the status", "t of the run that ends with NON_UNIQUE", "0"),
        stated("x(1) leaving up", "simulate with start_mode='+'", "1"),
        stated("x(1) leaving down", "simulate with start_mode='-'", "-1"),
        title="Repelling start",
    )


def planar_relay() -> Problem:
    """Relay feedback of a linear planar system, with a pseudo-node.

    $x' = -x + y$, $y' = 3 y - 10 sgn(x + y)$. On $y = -x$: $L1 = -5 x - 10$, $L2 = -5 x + 10$, so sliding for
    $abs(x) < 2$, with $x' = -2 x$: a stable pseudo-node at 0. Both folds are visible.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: derived for this library; closed form.

    Examples
    --------
    >>> planar_relay().run().x[-1].round(9)
    array([ 0.02747346, -0.02747346])
    """
    x, y, lam = (ca.SX.sym(s) for s in ("x", "y", "lam"))
    system = FilippovSystem(
        [x, y], surface=x + y, multipliers=lam, field=[-x + y, 3 * y - 10 * lam]
    )
    return problem(
        planar_relay,
        system,
        (1.5, -1.5),
        2.0,
        stated("fold of F1", "x where L1 = 0 on the surface", "-2"),
        stated("fold of F2", "x where L2 = 0 on the surface", "2"),
        stated("x(2)", "slide from (1.5, -1.5): 1.5 exp(-4)", "0.027473458333101270441"),
        stated("pseudo-node", "zero of the sliding field", "0", "0"),
        stated("slope of the sliding field", "along x at the pseudo-node", "-2"),
        title="Planar relay system",
    )


def pseudo_hopf() -> Problem:
    """Crossing cycle born at a fused focus (pseudo-Hopf bifurcation).

    The field is $(1, -x)$ where $y > 0$, and $(-1, -(x - alpha) - r (x - alpha)^2)$ where $y < 0$. Above,
    x returns as $-x$. Below, orbits are level
    curves of an integral, so the cycle is at $x0^2 = 3 (alpha/r - alpha^2)$. Both folds are invisible, with
    opposite directions (II2): a pseudo-node on the sliding segment between them.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: the fused focus of Filippov 1988 and Kuznetsov, Rinaldi & Gragnani 2003, with a
    quadratic term added for this library.

    Examples
    --------
    >>> pseudo_hopf().run(t_end=3.0).itinerary[:7]
    '+ - + -'
    """
    x, y, al, r = (ca.SX.sym(s) for s in ("x", "y", "al", "r"))
    u = x - al
    system = FilippovSystem(
        [x, y], surface=y, above=[1, -x], below=[-1, -u - r * u**2], parameters={al: -0.03, r: -1.0}
    )
    return problem(
        pseudo_hopf,
        system,
        (-0.3, 0.0),
        20.0,
        stated("x0", "fixed point of the return map x -> x on y = 0", "0.29546573405388314165"),
        stated("period", "time of one return, 4 x0", "1.1818629362155325666"),
        stated("multiplier", "slope of the return map at x0", "0.65350727586702943"),
        stated("pseudo-node", "x where the sliding field is zero", "-0.01488578017961046"),
        title="Pseudo-Hopf bifurcation of a fused focus",
    )


def piecewise_cycle() -> Problem:
    """Cycle that crosses a line without any kink in r (COCO's piecewise-linear example).

    In polar coordinates $r' = r (1 - r)$, $theta' = 1$ where $x < 0$, and $r' = alpha r (beta - r)$,
    $theta' = gamma + beta - r$ where $x > 0$. With $alpha = beta = 1$, $gamma = 1.5$ the cycle is $r = 1$ with period $pi + pi/1.5$ and
    multiplier $exp(-5 pi/3)$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Dankowicz & Schilder 2013, Recipes for Continuation (``pwlin``). Singular at the origin.

    Examples
    --------
    >>> piecewise_cycle().run(t_end=6.0).itinerary
    '+ - +'
    """
    x, y, al, be, ga = (ca.SX.sym(s) for s in ("x", "y", "al", "be", "ga"))
    r = ca.sqrt(x**2 + y**2)
    outer, turn = al * (be - r), ga + be - r
    system = FilippovSystem(
        [x, y],
        surface=x,
        above=[outer * x - turn * y, outer * y + turn * x],
        below=[(1 - r) * x - y, (1 - r) * y + x],
        parameters={al: 1.0, be: 1.0, ga: 1.5},
    )
    return problem(
        piecewise_cycle,
        system,
        (0.5, 0.0),
        20.0,
        stated("radius", "abs(x) on the cycle", "1"),
        stated("period", "time of one return, 5 pi/3", "5.2359877559829887308"),
        stated("multiplier", "slope of the return map, exp(-5 pi/3)", "0.0053215654788005829731"),
        title="Piecewise-smooth planar cycle",
    )
