"""What can happen at the zero of a function besides a switch: stops, resets and impacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..reading import Expression


@dataclass(frozen=True)
class Stop:
    """A surface that ends a run, with the status STOPPED.

    Parameters
    ----------
    function : expression
        The run ends where it is zero.
    direction : {-1, 0, 1}
        Only when falling, either way, only when rising.
    name : str
        Shown in events and messages.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x = ca.SX.sym("x")
    >>> falling = ns.FilippovSystem([x], field=[-1], stops=ns.Stop(x - 2, name="floor"))
    >>> run = ns.simulate(falling, [5.0], t_end=10.0)
    >>> run.status.name, run.events[-1].name, run.events[-1].t
    ('STOPPED', 'floor', 3.0)
    """

    function: Expression
    direction: int = 0
    name: str = "stop"


@dataclass(frozen=True)
class Reset:
    """A surface on which the state jumps to ``map``.

    Parameters
    ----------
    function : expression
        The jump happens where it is zero.
    map : sequence of expressions
        The new state, in the order of the states.
    direction : {-1, 0, 1}
        Only when falling, either way, only when rising.
    name : str
        Shown in events and messages.

    Examples
    --------
    A mass that keeps four fifths of its speed at the floor:

    >>> import casadi as ca, nonsmooth as ns
    >>> y, v = ca.SX.sym("y"), ca.SX.sym("v")
    >>> hit = ns.Reset(y, [y, -0.8 * v], direction=-1, name="floor")
    >>> mass = ns.FilippovSystem([y, v], field=[v, -2.0], resets=hit)
    >>> run = ns.simulate(mass, [1.0, 0.0], t_end=1.5)
    >>> round(run.events[0].t, 12), (run.events[0].x_after.round(12) + 0.0).tolist()
    (1.0, [0.0, 1.6])
    """

    function: Expression
    map: Sequence[Expression]
    direction: int = 0
    name: str = "reset"


@dataclass(frozen=True)
class Impact:
    """A gap that is never negative: bodies hit it, come to rest on it, and are let go.

    The contact is open (letter ``o``) or closed (``c``). Where the gap falls to zero with a rate v,
    an impulse along the reaction turns it into -restitution v. Impacts that accumulate end in the
    closed contact, in which the reaction keeps the gap at zero; it opens when the reaction falls to
    zero.

    Parameters
    ----------
    gap : expression
        Of states, parameters and time; not negative. Its rate must not depend on multipliers.
    restitution : expression or number, optional
        Newton's coefficient, from 0 to 1.
    reaction : SX symbol, optional
        A multiplier in the field, not negative and linear there: how the reaction acts. Unless given,
        one is added that acts along the gradient of the gap's rate (unit masses). Friction at the
        contact is a surface whose multiplier is multiplied with it.
    name : str, optional
        Shown in events and messages.

    Examples
    --------
    A mass on a shaken table, and a block that slides on a floor with friction:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, u, v, t, lam, r = (ca.SX.sym(s) for s in ("x", "y", "u", "v", "t", "lam", "r"))
    >>> gap = y - 0.1 * ca.sin(5 * t)
    >>> ns.FilippovSystem([y, v], field=[v, -9.81], impacts=ns.Impact(gap, restitution=0.5), time=t)
    FilippovSystem(2 states: y, v; 0 surfaces; time t; impact 'impact')
    >>> block = ns.FilippovSystem(
    ...     [x, y, u, v], field=[u, v, -0.3 * lam * r, r - 9.81], surface=u, multipliers=lam,
    ...     impacts=ns.Impact(y, reaction=r))
    """

    gap: Expression
    restitution: Expression = 0.0
    reaction: Expression | None = None
    name: str = "impact"
