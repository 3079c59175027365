"""Where a system is affine: its polynomials are exact there, and no step needs to be checked."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True)
class Linearity:
    """What of a system is affine.

    Attributes
    ----------
    everywhere, free : bool
        Field and guards: in states and unknown multipliers together, and in the states where nothing
        slides.
    bent_rows, bent_free_rows : list of bool
        Rows of the field that are not, in any mode and where nothing slides.
    bent_guards : list of bool
        Surfaces and gaps, then stops and resets, that are not affine in the states.
    """

    everywhere: bool
    free: bool
    bent_rows: list[bool]
    bent_free_rows: list[bool]
    bent_guards: list[bool]


def linearity(
    field: ca.SX,
    layer: ca.SX,
    guards: ca.SX,
    factors: ca.SX,
    x: ca.SX,
    unknowns: ca.SX,
    smooth: bool = True,
) -> Linearity:
    """Return what is affine.

    Parameters
    ----------
    field, layer, guards, factors : SX
        Field, rates of surfaces and gaps, surfaces, gaps, stops and resets, factors of multipliers.
    x, unknowns : SX
        States, and unknown multipliers.
    smooth : bool
        Whether multipliers that are known are constant in every mode: not off a set.
    """
    every = ca.vertcat(x, unknowns)
    return Linearity(
        everywhere=smooth and bool(ca.is_linear(ca.vertcat(field, layer, guards, factors), every)),
        free=smooth and bool(ca.is_linear(ca.vertcat(field, guards), x)),
        bent_rows=_bent(field, every) if smooth else [True] * field.numel(),
        bent_free_rows=_bent(field, x) if smooth else [True] * field.numel(),
        bent_guards=_bent(guards, x),
    )


def _bent(expressions: ca.SX, x: ca.SX) -> list[bool]:
    return [not ca.is_linear(e, x) for e in ca.vertsplit(ca.densify(expressions))]
