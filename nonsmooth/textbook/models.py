"""Models from applications: a harvested population, an ocean box, a state-dependent jump."""

from __future__ import annotations

import casadi as ca

from ..model import FilippovSystem
from .problem import Problem, problem, stated


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
    zero = "alpha for which the equilibrium of the field {} is on the surface"
    return problem(
        harvested_prey_predator,
        system,
        (0.5, 0.5),
        100.0,
        stated("fold of F2", "x1 where L2 = 0 on the surface", "0.04280205655526992"),
        stated("fold of F1", "x1 where L1 = 0 on the surface", "0.7208612440191388"),
        stated("boundary focus", zero.format("below"), "0.9227486601330945"),
        stated("boundary node", zero.format("above"), "0.8013552803278313"),
        stated(
            "pseudo-saddle-node",
            "alpha for which the sliding field has a double zero, (1 + b)^2/(4 a)",
            "1.188132733408324",
        ),
        title="Harvested prey-predator model",
        note="parameters from memory",
    )


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
    return problem(
        welander_box,
        system,
        (0.5, 0.3),
        30.0,
        stated("boundary equilibrium, k = 0", "eps with F2 = 0 on the surface", "0.2"),
        stated(
            "boundary equilibrium, k = 5",
            "eps with F1 = 0 on the surface, -7/165",
            "-0.042424242424242424242",
        ),
        stated(
            "period",
            "time of one return of the cycle",
            "1.573348798772239528671",
            at={"eps": -0.01},
        ),
        stated(
            "multiplier",
            "slope of the return map of the cycle",
            "0.0794560287002",
            at={"eps": -0.01},
        ),
        stated(
            "pseudo-equilibrium T",
            "where a run slides to; zero of the sliding field",
            "0.836866682439359",
            at={"eps": 0.05},
        ),
        title="Welander's ocean box",
        note="parameters from memory",
    )


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
    how = "derivative of x(20), through the saltation at both switches"
    return problem(
        state_dependent_jump,
        system,
        (1.0, 0.0),
        20.0,
        stated(
            "switch times", "times of the two crossings", "11.000275475194824", "11.270040323650827"
        ),
        stated("x(20)", "simulate to t = 20", "49.2550674190591", "1.34882424228"),
        stated("dx1(20)/dx0", how, "6.20409075", "16.74159857"),
        stated("dx2(20)/dx0", how, "0.06665833", "0.34105997"),
        stated("dx(20)/dp", how, "-5.20409072", "-0.06665833"),
        title="State-dependent jump with a parameter",
    )
