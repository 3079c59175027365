"""Bilateral constraints: functions that a joint keeps at zero, and the reaction with which it does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca

from ..errors import DefinitionError
from ..reading import Expression, listed, scalar
from .complementarity import rate_of
from .elements import Entry

if TYPE_CHECKING:
    from .parse_definition import Definition


@dataclass(frozen=True)
class Constraint:
    """A joint: a function that a reaction of any size and sign keeps at zero.

    It has the letter ``s`` in every mode and no events. A start must satisfy it, with the derivatives that the
    reaction does not enter: for a joint between positions also the rate of ``function``.

    Parameters
    ----------
    function : expression
        Of states, parameters and time; it may contain reactions of constraints linearly.
    reaction : SX symbol, optional
        A multiplier in the field, linear there: how the joint acts. Unless given, one is added that acts along the
        gradient of the function's rate (unit masses).
    name : str, optional
        Shown in messages.

    Notes
    -----
    Each step is projected onto the constraints and their lower derivatives, so that they do not drift. Where constraints
    depend on one another, as those of parallel links, the motion is determined and the reactions are not; those with the
    least change are taken. Impulses of impacts act through joints at once.

    Source: Hairer & Wanner 1996, Solving Ordinary Differential Equations II, chapter VII; Ascher & Petzold 1998.

    Examples
    --------
    A pendulum of unit length, and the same by its angle:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, u, v, r = (ca.SX.sym(s) for s in "xyuvr")
    >>> rod = ns.Constraint(x**2 + y**2 - 1, reaction=r)
    >>> pendulum = ns.FilippovSystem([x, y, u, v], field=[u, v, r * x, r * y - 1], constraints=rod)
    >>> angle, rate = ca.SX.sym("angle"), ca.SX.sym("rate")
    >>> plain = ns.FilippovSystem([angle, rate], field=[rate, -ca.sin(angle)])
    >>> end = ns.simulate(pendulum, [1.0, 0.0, 0.0, 0.0], t_end=5.0).x[-1]
    >>> bool(abs(end[0] - ca.sin(ns.simulate(plain, [ca.pi / 2, 0.0], t_end=5.0).x[-1, 0])) < 1e-8)
    True
    """

    function: Expression
    reaction: Expression | None = None
    name: str = "constraint"


@dataclass(frozen=True)
class Joints:
    """The constraints of a system: their entries and names, and the field without reactions of degree 0."""

    entries: tuple[Entry, ...]
    names: tuple[str, ...]
    field: Any


def joints_of(items: Sequence[Constraint], reactions: Sequence[ca.SX], field: ca.SX) -> Joints:
    """Entries of constraints whose function contains no reaction; the others give their reactions at once."""
    functions = [scalar(own.function, f"function of {own.name!r}") for own in items]
    every = ca.vertcat(*reactions)
    at_once = [i for i, g in enumerate(functions) if items and ca.depends_on(g, every)]
    if at_once:
        field, functions = _eliminated(items, functions, reactions, at_once, field)
    rest = [i for i in range(len(items)) if i not in at_once]
    entries = [Entry("joint", (functions[i],), (ca.SX(0),), reactions[i]) for i in rest]
    return Joints(tuple(entries), tuple(items[i].name for i in rest), field)


def _eliminated(
    items: Sequence[Constraint],
    functions: Sequence[ca.SX],
    reactions: Sequence[ca.SX],
    at_once: Sequence[int],
    field: ca.SX,
) -> tuple[ca.SX, list[ca.SX]]:
    """Field and functions with the reactions that algebraic constraints determine."""
    own = ca.vertcat(*[reactions[i] for i in at_once])
    residual = ca.vertcat(*[functions[i] for i in at_once])
    names = ", ".join(repr(items[i].name) for i in at_once)
    slope = ca.densify(ca.jacobian(residual, own))
    if not ca.is_linear(residual, own) or ca.depends_on(slope, own):
        raise DefinitionError(
            f"function of {names}: its reaction enters nonlinearly. Give a function that is linear in it, or make the "
            "reaction a state."
        )
    if ca.sprank(ca.sparsify(slope)) < len(at_once):
        raise DefinitionError(
            f"function of {names}: it does not determine its own reaction. Exchange the reactions, or leave out "
            "dependent constraints."
        )
    value = -ca.solve(slope, ca.substitute(residual, own, 0))
    field, *rest = (ca.substitute(e, own, value) for e in (field, *functions))
    return field, rest


def require_constraints(d: Definition) -> None:
    """Refuse reactions of constraints that enter nonlinearly, in products, or not in two derivatives."""
    first, names = d.multipliers.numel() - len(d.constraints), d.constraints
    joints, others = d.multipliers[first:], ca.vertcat(d.multipliers[:first], d.reactions)
    every = ca.vertcat(joints, others)
    for name, reaction in zip(names, listed(joints), strict=True):
        effect = ca.jacobian(d.field, reaction)
        if ca.depends_on(effect, every):
            raise DefinitionError(
                f"reaction of {name!r}: {reaction} is multiplied with {reaction} or another unknown. A joint's reaction enters "
                "linearly. Give friction at a joint a load of its own: with the reaction as an expression rho of the states, "
                "Friction(slip, load=side*rho) beside surfaces=[rho], multipliers=[side], or make the joint of contacts with "
                "a clearance."
            )
        if effect.is_zero():
            raise DefinitionError(
                f"reaction of {name!r}: {reaction} is not in the field. Write the force of the joint as reaction "
                "times its direction."
            )
    for name, g in zip(names, listed(d.surfaces)[first:], strict=True):
        rate = rate_of(d, g)
        if not ca.depends_on(rate, every):
            rate = rate_of(d, rate)
        if not ca.depends_on(rate, joints):
            held = ca.depends_on(rate, others)
            raise DefinitionError(
                f"function of {name!r}: {g} {'changes by other multipliers first' if held else 'has two derivatives'} without "
                "a reaction of a constraint. Give a function of positions, or of velocities, on which the reaction acts."
            )
