"""Reading sets of codimension two and three: vectors among the surfaces and the multipliers.

A vector h of k switching functions with a vector of k multipliers is one set h = 0, off which the
multiplier is h/|h| and on which its length is at most 1: Coulomb friction in the plane (k = 2),
or with drilling (k = 3). With k = 1 it is a surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import casadi as ca

from ..errors import DefinitionError, explain
from ..reading import listed, scalar
from ..values import Array
from .form import Definition

if TYPE_CHECKING:
    from .system import FilippovSystem

#: Largest codimension of a set: slip has two components, three with drilling.
LARGEST = 3


def read_entry(value: Any, what: str) -> list[ca.SX]:
    """Read a surface (a scalar) or a set (a vector of two or three) as a list of expressions."""
    if not isinstance(value, (list, tuple)) and not (
        isinstance(value, (ca.SX, ca.DM)) and ca.SX(value).numel() > 1
    ):
        return [scalar(value, what)]
    entries = listed(value)
    if isinstance(value, (ca.SX, ca.DM)) and 1 not in value.shape:
        raise DefinitionError(
            f"{what}: expected a scalar or a column, received a matrix of shape {value.shape}."
        )
    if not 1 <= len(entries) <= LARGEST:
        raise DefinitionError(
            explain(
                what,
                expected=f"a scalar, or a vector of at most {LARGEST} switching functions",
                received=f"{len(entries)} of them",
                advice="A vector is one set on which all of them vanish, as slip in the plane does; "
                "surfaces that do not belong together are entries of their own.",
            )
        )
    return [scalar(e, f"{what}[{i}]") for i, e in enumerate(entries)]


def require_alike(sizes: Sequence[int], multipliers: Any) -> None:
    """Refuse multipliers that are not shaped as the surfaces."""
    entries = [len(listed(entry)) for entry in listed(multipliers)]
    if max((*sizes, *entries), default=1) == 1 or list(sizes) == entries:
        return
    raise DefinitionError(
        explain(
            "multipliers",
            expected=f"one for each surface, as many components as it has: {list(sizes)}",
            received=str(entries),
            advice="surfaces=[casadi.vertcat(h1, h2)] goes with multipliers=[casadi.vertcat(l1, l2)].",
        )
    )


def require_linear_sets(d: Definition) -> None:
    """Refuse sets whose multipliers do not enter linearly together, or are multiplied by a
    reaction."""
    first = 0
    for i, size in enumerate(d.sizes):
        lam = d.multipliers[first : first + size]
        first += size
        if size == 1:
            continue
        if not ca.is_linear(d.field, lam):
            raise DefinitionError(
                f"multiplier {lam}: expected a field linear in all of its components together, "
                "received a nonlinear one. Hidden dynamics has one multiplier for each surface."
            )
        if d.reactions.numel() and ca.depends_on(ca.jacobian(d.field, lam), d.reactions):
            raise DefinitionError(
                explain(
                    f"multiplier {lam} of surface {i}",
                    expected="a load in states, time and parameters",
                    received="the reaction of an impact",
                    advice="Impulses with friction in the plane are not treated: give the contact a "
                    "compliance, whose force is the load, or friction in one direction.",
                )
            )


def multiplier_enters(system: FilippovSystem, members: Sequence[int], p: Array) -> bool:
    """Whether the multiplier of a set enters the field with given parameters."""
    d = system.definition
    columns = ca.jacobian(d.field, d.multipliers[list(members)])
    if d.parameters.numel():
        columns = ca.substitute(columns, d.parameters, ca.SX(p.tolist()))
    return not ca.densify(columns).is_zero()
