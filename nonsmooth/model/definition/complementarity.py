"""Checks of complementarity conditions: how their multipliers enter, and relative degrees 0 and 1."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from ..errors import DefinitionError
from ..expressions.identity import vanish_on
from ..reading import listed

if TYPE_CHECKING:
    from .parse_definition import Definition


def require_complementarity(d: Definition) -> None:
    """Refuse conditions whose multipliers enter nonlinearly, or neither y nor its rate."""
    which = list(d.half_lines)
    if not which:
        return
    rest = [i for i in range(d.surfaces.numel()) if i not in which]
    own, others = d.multipliers[which], ca.vertcat(d.multipliers[rest], d.reactions)
    every = ca.vertcat(d.multipliers, d.reactions)
    if not ca.is_linear(d.field, every) or d.hidden or any(size > 1 for size in d.sizes):
        raise DefinitionError(
            "field: with complementarity= it has to be linear in all multipliers and reactions together, received "
            f"{d.field}. Products of multipliers, hidden dynamics, vector multipliers and friction by a reaction do "
            "not go with it yet."
        )
    for name, y, lam in zip(d.complementarity, listed(d.surfaces[which]), listed(own), strict=True):
        if ca.depends_on(y, others) or not ca.is_linear(y, own):
            raise DefinitionError(
                f"y of {name!r}: {y} is not linear in the multipliers of complementarity conditions alone. A "
                "characteristic that bends, as an exponential one, is an ordinary function of the states."
            )
        if not (ca.depends_on(d.field, lam) or ca.depends_on(d.surfaces, lam)):
            raise DefinitionError(
                f"multiplier {lam} of {name!r} is not in the field. Add the term by which it acts, for example the "
                f"current {lam} divided by a capacity."
            )
        _require_degree(d, name, y, own)


def _require_degree(d: Definition, name: str, y: ca.SX, own: ca.SX) -> None:
    if holds(y, own, d.extended_states):
        return
    if not ca.depends_on(y, d.extended_states):
        raise DefinitionError(
            f"y of {name!r}: {y} depends on no state, time or multiplier, so that it never changes."
        )
    rate = rate_of(d, y)
    if holds(rate, own, d.extended_states):
        return
    again = ca.depends_on(rate_of(d, rate), own)
    what = (
        "the multipliers of complementarity conditions enter neither y nor its rate, but only its second "
        f"derivative. That is a contact: Impact({y}, reaction={own[0] if own.numel() == 1 else '...'}), whose "
        "restitution says what happens to the rate."
        if again
        else "no multiplier of a complementarity condition enters it, its rate or its second derivative, so that "
        "y can become negative."
    )
    raise DefinitionError(f"y of {name!r}: {what}")


def rate_of(d: Definition, function: ca.SX) -> ca.SX:
    """The rate of a function of states and time along the field."""
    rates = ca.vertcat(d.field, ca.SX.ones(d.time.numel(), 1))
    return ca.densify(ca.jtimes(function, d.extended_states, rates))


def holds(function: ca.SX, own: ca.SX, x: ca.SX) -> bool:
    """Whether multipliers enter a function, linear in them, with a factor that is not zero everywhere."""
    if not ca.depends_on(function, own):
        return False
    column = [e for e in ca.jacobian(function, own).nonzeros() if not e.is_zero()]
    return any(not ca.depends_on(e, x) or not vanish_on([e], ca.SX(0), x) for e in column)
