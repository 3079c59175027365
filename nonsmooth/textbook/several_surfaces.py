"""Systems with several surfaces, and choices that Filippov's convention leaves open."""

from __future__ import annotations

import casadi as ca

from ..model import FilippovSystem
from .problem import Problem, problem


def two_relay_spiral() -> Problem:
    """Infinitely many switches on the way to the origin (Zeno).

    $x1' = -s1 + 2 s2$, $x2' = -2 s1 - s2$, $s_i = sgn x_i$: $abs(x1) + abs(x2)$ falls at rate 2. From
    (1, 0.5) the switches are at $1/6$, $5/9$, $37/54$, $59/81$, ... and the orbit reaches 0 at $t = 3/4$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Filippov 1988; closed form.

    Examples
    --------
    >>> run = two_relay_spiral().run()
    >>> run.status.name, run.events[-2].kind, round(run.events[-2].t, 9)
    ('REACHED_END', 'rest', 0.75)
    """
    x1, x2, s1, s2 = (ca.SX.sym(s) for s in ("x1", "x2", "s1", "s2"))
    system = FilippovSystem(
        [x1, x2], surfaces=[x1, x2], multipliers=[s1, s2], field=[-s1 + 2 * s2, -2 * s1 - s2]
    )
    return problem(two_relay_spiral, system)


def glass_loop() -> Problem:
    """Two genes, one switched on and one off by the other: a loop that spirals into its thresholds.

    $x' = [y > 1/2] - x$, $y' = [x < 1/2] - y$, a Glass network. Orbits are straight in each quadrant of the
    thresholds; at distance $r/2$ from the intersection a quarter turn takes $log(1 + r)$ and leads to
    $r/(1 + r)$. From $(3/4, 3/4)$ the k-th crossing is at $log(k + 1/2)$, and $|x - 1/2| + |y - 1/2|$ falls as
    $exp(-t)$: the intersection attracts though no layer does, and no orbit leaves it.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Glass & Pasternack 1978, J. Math. Biology 6, 207-223, for the loops; closed form of this one
    derived for this library.

    Examples
    --------
    >>> import nonsmooth as ns
    >>> glass = glass_loop()
    >>> found = ns.classify(glass.system, [0.5, 0.5])
    >>> found.kind, found.label
    ('pseudo-equilibrium', 'stable pseudo-focus')
    >>> stays = ns.simulate(glass.system, [0.5, 0.5], 10.0)
    >>> stays.itinerary, stays.x[-1].tolist()
    ('ss', [0.5, 0.5])
    """
    x, y, a, b = (ca.SX.sym(s) for s in ("x", "y", "a", "b"))
    system = FilippovSystem(
        [x, y],
        surfaces=[x - 0.5, y - 0.5],
        multipliers=[a, b],
        field=[(1 + b) / 2 - x, (1 - a) / 2 - y],
    )
    return problem(glass_loop, system)


def ambiguous_exit() -> Problem:
    """Sliding on the intersection of two surfaces whose exit Filippov's set leaves open.

    $x1' = -s1 + x3/2$, $x2' = -s2 + x3/4$, $x3' = 1 + s1 s2/2$ from 0. On $x1 = x2 = 0$ the multipliers are
    $x3/2$ and $x3/4$; $x1 = 0$ is left when $x3 = 2$. With the bilinear law $x3' = 1 + x3^2/16$, so at
    $t = 4 arctan(1/2)$. The convex hull of the four fields allows $x3'$ from $1/2 + 3 x3/8$ to
    $3/2 - x3/8$, so any time from $8 log(6/5)$ to $(8/3) log(5/2)$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: derived for this library; the bilinear law, which a run follows, is the canopy of
    Jeffrey 2014, SIAM J. Appl. Dyn. Syst. 13, 1082-1105.

    Examples
    --------
    >>> run = ambiguous_exit().run()
    >>> run.itinerary, round(run.events[0].t, 9)
    ('ss +s', 1.854590436)
    """
    x1, x2, x3, s1, s2 = (ca.SX.sym(s) for s in ("x1", "x2", "x3", "s1", "s2"))
    system = FilippovSystem(
        [x1, x2, x3],
        surfaces=[x1, x2],
        multipliers=[s1, s2],
        field=[-s1 + x3 / 2, -s2 + x3 / 4, 1 + s1 * s2 / 2],
    )
    return problem(ambiguous_exit, system)


def hidden_dynamics(*, nonlinear: bool = True) -> Problem:
    """Sliding whose speed depends on what happens inside the switch.

    $x1' = -lambda + b$, $x2' = 2 lambda^2 - 1$: off the surface $x1 = 0$, $lambda^2 = 1$ and $x2' = 1$. The
    nonlinear law keeps $lambda = b$ on the surface and slides with $x2' = 2 b^2 - 1$; Filippov's convex combination
    of the two fields slides with $x2' = 1$.

    Parameters
    ----------
    nonlinear : bool
        Define it with the nonlinear multiplier; otherwise with the two fields alone.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Jeffrey 2018, Hidden Dynamics.

    Examples
    --------
    >>> [round(float(hidden_dynamics(nonlinear=n).run().x[-1, 1]), 12) for n in (True, False)]
    [-0.92, 1.0]
    """
    x1, x2, lam, b = (ca.SX.sym(s) for s in ("x1", "x2", "lam", "b"))
    if nonlinear:
        system = FilippovSystem(
            [x1, x2],
            surface=x1,
            multipliers=lam,
            field=[-lam + b, 2 * lam**2 - 1],
            parameters={b: 0.2},
            hidden=True,
        )
    else:
        system = FilippovSystem(
            [x1, x2], surface=x1, above=[b - 1, 1], below=[b + 1, 1], parameters={b: 0.2}
        )
    return problem(hidden_dynamics, system)
