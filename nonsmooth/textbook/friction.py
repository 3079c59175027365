"""Oscillators with dry friction."""

from __future__ import annotations

import casadi as ca

from ..model import FilippovSystem
from .problem import Problem, problem, stated


def dry_friction() -> Problem:
    """Oscillator with Coulomb friction that comes to rest in finite time.

    $y1' = y2$, $y2' = -y1 - c sgn y2$, $c = 0.4$, from (3, 0). Half-swings are circles about $-+c$, so each
    turning point is 0.8 closer to zero than the last one: -2.2, 1.4, -0.6, -0.2 at $pi$, $2 pi$, $3 pi$,
    $4 pi$; there $abs(y1) < c$ and it sticks.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: classical (Coulomb damping); closed form.

    Examples
    --------
    >>> dry_friction().run().itinerary
    '- + - + s'
    """
    y1, y2, lam, c = (ca.SX.sym(s) for s in ("y1", "y2", "lam", "c"))
    system = FilippovSystem(
        [y1, y2], surface=y2, multipliers=lam, field=[y2, -y1 - c * lam], parameters={c: 0.4}
    )
    how = "state and time of crossing number {}"
    return problem(
        dry_friction,
        system,
        (3.0, 0.0),
        20.0,
        stated("turn 1 (y1, t)", how.format(1), "-2.2", "3.14159265358979323846"),
        stated("turn 2 (y1, t)", how.format(2), "1.4", "6.28318530717958647693"),
        stated("turn 3 (y1, t)", how.format(3), "-0.6", "9.42477796076937971539"),
        stated("rest (y1, t)", "state and time of the entry", "-0.2", "12.5663706143591729539"),
        stated("end y1", "y1 at t_end, stuck", "-0.2"),
        title="Dry friction brings an oscillator to rest",
    )


_SLIP_STICK = "simulate; length of a {} segment of the periodic orbit"


def leine_stick_slip() -> Problem:
    """Block on a belt whose friction weakens with the slip velocity.

    $x' = v$, $v' = -x + sgn(w - v)/(1 + 3 abs(v - w))$, belt velocity $w = 0.2$. Sticking orbits leave at
    $x = 1$, so every orbit that sticks once is on the periodic orbit from then on: the multipliers
    are 1 and 0.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Leine, van Campen, de Kraker & van den Steen 1998, Nonlinear Dynamics 16, 41-54.

    Examples
    --------
    >>> print(leine_stick_slip()["period"])
    period: 12.00103129483058 (to 1e-09; simulate; time between successive exits from sticking)
    """
    x, v, w, delta = (ca.SX.sym(s) for s in ("x", "v", "w", "delta"))
    slip = v - w
    system = FilippovSystem(
        [x, v],
        surface=slip,
        above=[v, -x - 1 / (1 + delta * slip)],
        below=[v, -x + 1 / (1 - delta * slip)],
        parameters={w: 0.2, delta: 3.0},
    )
    return problem(
        leine_stick_slip,
        system,
        (1.0, 0.2),
        50.0,
        stated("slip time", _SLIP_STICK.format("slip ('-')"), "4.2959995254801548834"),
        stated("stick time", _SLIP_STICK.format("stick ('s')"), "7.7050317693504237635"),
        stated("x at re-stick", "x at an entry", "-0.54100635387008475271"),
        stated(
            "period",
            "simulate; time between successive exits from sticking",
            "12.001031294830578647",
        ),
        stated(
            "multipliers",
            "eigenvalues of the monodromy matrix: smooth flow, saltation at entry and exit",
            "1",
            "0",
        ),
        title="Stick-slip with friction that weakens with velocity",
    )


def stick_slip_exponential() -> Problem:
    """Stick-slip with a friction that falls with the slip (nosnoc_py's periodic_stick_slip).

    $x1' = x2$; $x2' = -x1 + 1/(1.2 - x2)$ for $x2 < 0.2$, $-x1 - 1/(0.8 + x2)$ for $x2 > 0.2$. Sliding for
    $abs(x1) < 1$ with $x1' = 0.2$, exit at (1, 0.2).

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: the example ``periodic_stick_slip`` of nosnoc_py.

    Examples
    --------
    >>> stick_slip_exponential().run(t_end=12.0).itinerary
    '- s -'
    """
    x1, x2 = ca.SX.sym("x1"), ca.SX.sym("x2")
    system = FilippovSystem(
        [x1, x2],
        surface=x2 - 0.2,
        above=[x2, -x1 - 1 / (0.8 + x2)],
        below=[x2, -x1 + 1 / (1.2 - x2)],
    )
    return problem(
        stick_slip_exponential,
        system,
        (1.0, 0.2),
        50.0,
        stated("exit (x1, x2)", "state at an exit", "1", "0.2"),
        stated("slip time", _SLIP_STICK.format("slip ('-')"), "4.703364997942"),
        stated("landing x1", "x1 at an entry", "0.0945189079719"),
        stated("period", "time between successive exits", "9.230770458083"),
        stated("multipliers", "eigenvalues of the monodromy matrix", "1", "0"),
        title="Periodic stick-slip",
    )
