"""What a validated step is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .flint import arb, arb_mat
from .series import horner


@dataclass
class Step:
    """What one step is made of."""

    h: float
    natural: float  # the step without limits
    tube: list[arb]
    hull: list[arb]
    c: list[list[arb]]  # of the hull
    top: list[list[arb]]  # of the tube
    guards: list[list[arb]]
    guard_tops: list[list[arb]]


def at(c: Sequence[Sequence[arb]], top: Sequence[Sequence[arb]], time: arb) -> list[arb]:
    """States at a time from coefficients 0..K and the remainder."""
    return [horner([*a[:-1], b[-1]], time) for a, b in zip(c, top, strict=True)]


def growth(bound: float, h: float) -> float:
    """exp(bound h) - 1, rounded upward."""
    return float(((arb(bound) * arb(h)).expm1()).upper()) * (1 + 1e-12)


def orthogonal(matrix: arb_mat) -> arb_mat:
    """An orthogonal factor of the midpoints as exact doubles, longest column first."""
    a = np.array([[float(v.mid()) for v in row] for row in matrix.tolist()])
    order = np.argsort(-np.linalg.norm(a, axis=0))
    q = np.linalg.qr(a[:, order])[0]
    return arb_mat([[arb(float(v)) for v in row] for row in q.tolist()])
