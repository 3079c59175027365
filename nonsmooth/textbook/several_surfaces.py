"""Systems with several surfaces, and choices that Filippov's convention leaves open."""

from __future__ import annotations

import casadi as ca

from ..model import FilippovSystem
from .problem import Problem, problem, stated


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
    return problem(
        two_relay_spiral,
        system,
        (1.0, 0.5),
        2.0,
        stated(
            "switch times 1 to 4",
            "times of the first four crossings: 1/6, 5/9, 37/54, 59/81",
            "0.16666666666666666667",
            "0.55555555555555555556",
            "0.68518518518518518519",
            "0.72839506172839506173",
        ),
        stated("time of rest", "time of the event 'rest'", "0.75"),
        title="Filippov's spiral of two relays",
    )


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
    return problem(
        glass_loop,
        system,
        (0.75, 0.75),
        3.0,
        stated(
            "crossing times 1 to 4",
            "times of the first four crossings: log(3/2), log(5/2), log(7/2), log(9/2)",
            "0.40546510810816438198",
            "0.91629073187415506518",
            "1.25276296849536799569",
            "1.50407739677627407337",
        ),
        stated(
            "distance at crossing 4",
            "abs(x - 1/2) + abs(y - 1/2) there: 1/9",
            "0.11111111111111111111",
        ),
        title="A negative loop of two genes",
    )


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
    return problem(
        ambiguous_exit,
        system,
        (0.0, 0.0, 0.0),
        3.0,
        stated(
            "exit time, bilinear",
            "time at which x1 = 0 is left: 4 atan(1/2)",
            "1.85459043600322446",
        ),
        stated(
            "exit times allowed",
            "over the convex hull: 8 log(6/5) and (8/3) log(5/2)",
            "1.45857245435163701",
            "2.44344195166441351",
        ),
        title="Exit of codimension two that is ambiguous",
        note="a run takes the bilinear law; the convex hull leaves the exit open",
    )


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
    return problem(
        hidden_dynamics,
        system,
        (0.0, 0.0),
        1.0,
        stated("x2' off the surface", "second component of either field", "1"),
        stated("x2' sliding, nonlinear", "x2(1) of a run; 2 lam^2 - 1 at lam = b", "-0.92"),
        stated("x2' sliding, linear", "x2(1) of a run with nonlinear=False", "1"),
        title="Hidden dynamics",
    )
