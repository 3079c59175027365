"""The law h' = a - M lambda close to a set of codimension two or more, with a and M frozen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..values import Array
from .coupled import Coupled


@dataclass(frozen=True)
class Frozen:
    """h' = a - M lambda of a set at a point, with what slides elsewhere eliminated."""

    a: Array
    m: Array

    @property
    def definite(self) -> bool:
        """Whether the symmetric part of M is positive definite."""
        w = np.linalg.eigvalsh(0.5 * (self.m + self.m.T))
        return bool(w.min() > 1e-13 * np.abs(self.m).max())

    @property
    def indefinite(self) -> bool:
        """Whether it has a negative direction."""
        w = np.linalg.eigvalsh(0.5 * (self.m + self.m.T))
        return bool(w.min() < -1e-13 * np.abs(self.m).max())

    @property
    def attracts(self) -> bool:
        """Whether the set holds what is on it and must be reached from nearby: |M^-1 a| < 1."""
        return self.definite and bool(np.linalg.norm(np.linalg.solve(self.m, self.a)) < 1.0)


def frozen(
    coupled: Coupled, mode: str, x: Array, unknowns: Array, p: Array, own: Sequence[int]
) -> Frozen:
    """The rates of the switching functions ``own`` as a - M lambda."""
    system, held = coupled.system, coupled.held(mode)
    for members in system.sets:  # off which the mode is, or which it leaves
        if (letter := system.widened(mode)[members[0]]) in "*bl":
            h = coupled.heights_at(x, p) if letter == "*" else unknowns
            held[list(members)] = unit(h[list(members)])
    held[list(own)] = 0.0
    at = coupled.layer_at(x, held, np.zeros(coupled.count), p)
    slope = at.slope * at.factors
    others = [i for i in coupled.sliding(mode) if i not in own]
    chosen = list(own)
    a, d = at.layer[chosen], slope[np.ix_(chosen, chosen)]
    if others:
        back = np.linalg.lstsq(
            at.slope[np.ix_(others, others)],
            np.column_stack([at.layer[others], slope[np.ix_(others, chosen)]]),
            rcond=None,
        )[0]
        through = at.slope[np.ix_(chosen, others)] @ back
        a, d = a - through[:, 0], d - through[:, 1:]
    return Frozen(a, -d)


def unit(h: Array) -> Array:
    """Direction of a vector of any size; NaN for zero."""
    with np.errstate(invalid="ignore", divide="ignore"):
        scaled = h / np.abs(h).max()
        return np.asarray(scaled / np.linalg.norm(scaled))
