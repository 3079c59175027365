"""The law h' = a - M lambda close to a set of codimension two or more, with a and M frozen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..values import Array
from .coupled import Coupled, unit


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

    def time_left(self, h: Array) -> float:
        """Time until h = 0 is reached; exact for isotropic M, else for the present direction."""
        r, c = float(np.linalg.norm(h)), float(np.trace(self.m)) / len(h)
        if np.abs(self.m - c * np.eye(len(h))).max() <= 1e-12 * c:
            return (c * r + float(self.a @ h)) / (c * c - float(self.a @ self.a))
        return self.straight(h)

    def mean(self, h: Array, dt: float) -> Array:
        """Mean multiplier until h = 0 is reached after a time: h + a dt = M (mean) dt."""
        return np.asarray(np.linalg.solve(self.m, self.a + h / dt))

    def straight(self, h: Array) -> float:
        """Time until h = 0 if its direction stays; infinite where |h| does not fall."""
        u = unit(h)
        rate = float(u @ (self.a - self.m @ u))
        return float(np.linalg.norm(h)) / -rate if rate < 0.0 else np.inf


def frozen(
    coupled: Coupled, mode: str, x: Array, unknowns: Array, p: Array, own: Sequence[int]
) -> Frozen:
    """The rates of the switching functions ``own`` as a - M lambda."""
    held = coupled.known_multipliers(mode, x, unknowns, p)
    held[list(own)] = 0.0
    marks = coupled.error_scales(x, held, np.zeros(coupled.count), p)
    slope = marks.slope * marks.factors
    others = [i for i in coupled.sliding(mode) if i not in own]
    chosen = list(own)
    a, d = marks.layer[chosen], slope[np.ix_(chosen, chosen)]
    if others:
        back = np.linalg.lstsq(
            marks.slope[np.ix_(others, others)],
            np.column_stack([marks.layer[others], slope[np.ix_(others, chosen)]]),
            rcond=None,
        )[0]
        through = marks.slope[np.ix_(chosen, others)] @ back
        a, d = a - through[:, 0], d - through[:, 1:]
    return Frozen(a, -d)


def field_at(
    coupled: Coupled,
    mode: str,
    x: Array,
    unknowns: Array,
    p: Array,
    own: Sequence[int],
    lam: Array,
) -> Array:
    """The field (N,) with given multipliers of a set, and what slides elsewhere in balance."""
    held = coupled.known_multipliers(mode, x, unknowns, p)
    held[list(own)] = lam
    acting = np.zeros(coupled.count)
    others = [i for i in coupled.sliding(mode) if i not in own]
    if others:
        marks = coupled.error_scales(x, held, acting, p)
        slope = marks.slope[np.ix_(others, others)]
        acting[others] = -np.linalg.lstsq(slope, marks.layer[others], rcond=None)[0]
    return coupled.values(x, held, acting, p)[0]
