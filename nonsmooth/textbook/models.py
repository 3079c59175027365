"""Models from applications: a harvested population, an ocean box, a state-dependent jump."""

from __future__ import annotations

import casadi as ca

from ..model import FilippovSystem
from .problem import Problem, problem


def harvested_prey_predator() -> Problem:
    """Predator that is harvested only where it is abundant.

    $x1' = x1 (1 - x1) - psi x2$, $x2' = psi x2 - d x2 - E x2 [x2 > alpha]$, $psi = a x1/(b + x1)$. On
    $x2 = alpha$ the fields are tangent where $psi = d + E$ (above, at $x1 = 0.72$) and $psi = d$ (below, at
    $x1 = 0.043$). Their equilibria reach the surface at a boundary node (above) and a boundary focus
    (below); two pseudo-equilibria merge at $alpha = (1 + b)^2/(4 a)$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Kuznetsov, Rinaldi & Gragnani 2003, Int. J. Bifurcation Chaos 13, 2157-2188; the
    parameters a, d, E, b are quoted from memory. Their $f2$ is the harvested field, $F1$ (above) here.

    Examples
    --------
    >>> problem = harvested_prey_predator()
    >>> problem.system.evaluate(problem.system.lie_derivative("+"), [0.7208612440191388, 0.9]).round(15)
    array([[0.]])
    """
    x1, x2 = ca.SX.sym("x1"), ca.SX.sym("x2")
    a, d, effort, b, alpha = (ca.SX.sym(s) for s in ("a", "d", "E", "b", "alpha"))
    psi = a * x1 / (b + x1)
    prey = x1 * (1 - x1) - psi * x2
    system = FilippovSystem(
        [x1, x2],
        surface=x2 - alpha,
        above=[prey, (psi - d - effort) * x2],
        below=[prey, (psi - d) * x2],
        parameters={a: 0.3556, d: 0.0444, effort: 0.2067, b: 0.3, alpha: 0.9},
    )
    return problem(harvested_prey_predator, system)


def welander_box() -> Problem:
    """Heat and salt in a box of ocean that mixes with the deep when it is dense.

    $T' = 1 - T - k T$, $S' = b (1 - S) - k S$, with $k = 5$ where $S - a T > eps$ and $k = 0$ elsewhere;
    $a = 0.8$, $b = 0.5$. The equilibria of the two fields reach the surface at $eps = 0.2$ ($k = 0$) and
    $eps = -7/165$ ($k = 5$); in between the box oscillates or slides.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Welander 1982, Dyn. Atmos. Oceans 6, 233-242, in the nonsmooth form of the later
    literature; parameters quoted from memory.

    Examples
    --------
    >>> welander_box().run(t_end=6.0).itinerary
    '- + - + - + -'
    """
    temperature, salt, a, b, k, eps = (ca.SX.sym(s) for s in ("T", "S", "a", "b", "k", "eps"))
    system = FilippovSystem(
        [temperature, salt],
        surface=salt - a * temperature - eps,
        above=[1 - temperature - k * temperature, b * (1 - salt) - k * salt],
        below=[1 - temperature, b * (1 - salt)],
        parameters={a: 0.8, b: 0.5, k: 5.0, eps: -0.01},
    )
    return problem(welander_box, system)


def state_dependent_jump() -> Problem:
    """A right-hand side that jumps while a state is in a window (IFDIFF's example).

    $x1' = 0.01 t^2 + x2^3$; $x2' = 5$ if $p <= x1 < p + 0.5$, else 0; $p = 5.437$, from (1, 0): two
    surfaces, $x1 = p$ and $x1 = p + 1/2$. The sensitivities of x(20) jump at the switches.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: the canonical example of IFDIFF (Heidelberg), the start and p as there.

    Examples
    --------
    >>> state_dependent_jump().run().itinerary
    '-- +- ++'
    """
    x1, x2, t, p = (ca.SX.sym(s) for s in ("x1", "x2", "t", "p"))
    lam1, lam2 = ca.SX.sym("lam1"), ca.SX.sym("lam2")
    inside = (1 + lam1) / 2 * (1 - lam2) / 2
    system = FilippovSystem(
        [x1, x2],
        surfaces=[x1 - p, x1 - p - 0.5],
        multipliers=[lam1, lam2],
        field=[0.01 * t**2 + x2**3, 5 * inside],
        time=t,
        parameters={p: 5.437},
    )
    return problem(state_dependent_jump, system)
