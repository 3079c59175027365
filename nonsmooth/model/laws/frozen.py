"""The law h' = a - M lambda close to a set of codimension two or more, with a and M frozen, and its limit directions.

With h = r u the motion r' = u . (a - M u) leaves the set along directions with (M + s) u = a, |u| = 1 and
s = r' > 0, and reaches it along those with s < 0. They are the roots of |(M + s)^-1 a| = 1, Antali and
Stepan's limit directions. With M symmetric and positive definite all s are negative if |M^-1 a| < 1;
otherwise exactly one is positive.

Source: Antali & Stepan 2018, "Sliding and crossing dynamics in extended Filippov systems", SIAM J. Appl.
Dyn. Syst. 17.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..values import Array
from .coupled import Coupled


@dataclass(frozen=True)
class Frozen:
    """h' = a - M lambda of a set at a point, with other sliding functions eliminated."""

    a: Array
    m: Array

    @property
    def definite(self) -> bool:
        """Whether the symmetric part of M is positive definite."""
        w = np.linalg.eigvalsh(0.5 * (self.m + self.m.T))
        return bool(w.min() > 1e-13 * np.abs(self.m).max())

    @property
    def indefinite(self) -> bool:
        """Whether M is indefinite."""
        w = np.linalg.eigvalsh(0.5 * (self.m + self.m.T))
        return bool(w.min() < -1e-13 * np.abs(self.m).max())

    @property
    def attracts(self) -> bool:
        """Whether motions stay on the set and reach it from nearby: |M^-1 a| < 1."""
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


# Limit directions -----------------------------------------------------------------------------------

#: A component of ``a`` along a principal axis below this part is zero.
_ALONG = 1e-14


def limit_directions_of(a: Array, m: Array) -> list[tuple[float, Array]]:
    """All limit directions of h' = a - M u: pairs of the rate s = r' and the direction u (k,)."""
    size = float(np.abs(a).max(initial=0.0) + np.abs(m).max(initial=0.0))
    if size == 0.0 or not np.isfinite(size):
        return []
    a, m = a / size, m / size
    if _is_symmetric(m):
        found = _of_symmetric(a, m)
    else:
        found = _of_roots(_secular(a, m), a, m)
    found.sort(key=lambda pair: -pair[0])
    return [(s * size, u + 0.0) for s, u in found]


def _is_symmetric(m: Array) -> bool:
    return bool(np.abs(m - m.T).max() <= 1e-13)


def _of_symmetric(a: Array, m: Array) -> list[tuple[float, Array]]:
    """In principal axes, with the directions that have no part of ``a`` along one of them."""
    w, axes = np.linalg.eigh(0.5 * (m + m.T))
    c = axes.T @ a
    if np.ptp(w) <= 1e-13:  # isotropic
        n = float(np.linalg.norm(a))
        if n <= _ALONG:
            return [(-float(w.mean()), e * sign) for e in axes.T for sign in (1.0, -1.0)]
        return [(sign * n - float(w.mean()), sign * a / n) for sign in (1.0, -1.0)]
    found: list[tuple[float, Array]] = []
    missing = np.abs(c) <= _ALONG
    for i in np.flatnonzero(missing):
        same = np.abs(w - w[i]) <= 1e-13
        if not np.all(missing[same]):
            continue
        d = np.where(same, 0.0, c / np.where(same, 1.0, w - w[i]))
        rest = 1.0 - float(d @ d)
        if rest > 0.0:
            for sign in (1.0, -1.0):
                own = d.copy()
                own[i] = sign * np.sqrt(rest)
                found.append((-float(w[i]), axes @ own))
    kept = ~missing
    if np.any(kept):
        inner = _secular(c[kept], np.diag(w[kept]))
        for s, d in _of_roots(inner, c[kept], np.diag(w[kept])):
            whole = np.zeros(len(c))
            whole[kept] = d
            found.append((s, axes @ whole))
    return found


def _secular(a: Array, m: Array) -> Array:
    """Coefficients, highest first, of det(M + s)^2 - |adj(M + s) a|^2 (Faddeev and LeVerrier)."""
    k = len(a)
    n, adjugate, determinant = -m, [np.eye(k)], [1.0]
    for j in range(1, k + 1):
        p = n @ adjugate[-1]
        determinant.append(-float(np.trace(p)) / j)
        adjugate.append(p + determinant[-1] * np.eye(k))
    numerator = np.array([b @ a for b in adjugate[:k]])  # of s^(k-1), ..., 1
    total = np.convolve(determinant, determinant)
    squares = sum(np.convolve(column, column) for column in numerator.T)
    total[2:] -= squares
    return np.asarray(total)


def _of_roots(polynomial: Array, a: Array, m: Array) -> list[tuple[float, Array]]:
    found: list[tuple[float, Array]] = []
    for root in np.roots(polynomial):
        if abs(root.imag) > 1e-7 * (1.0 + abs(root)):
            continue
        s = _polished(float(root.real), a, m)
        if s is None or any(abs(s - other) <= 1e-9 * (1.0 + abs(s)) for other, _ in found):
            continue
        u = np.linalg.solve(m + s * np.eye(len(a)), a)
        found.append((s, u / np.linalg.norm(u)))
    return found


def _polished(s: float, a: Array, m: Array) -> float | None:
    """Newton's method on |(M + s)^-1 a| = 1; None where it diverges."""
    start, eye = s, np.eye(len(a))
    for _ in range(30):
        try:
            u = np.linalg.solve(m + s * eye, a)
            slope = -2.0 * float(u @ np.linalg.solve(m + s * eye, u))
        except np.linalg.LinAlgError:
            return None
        miss = float(u @ u) - 1.0
        if slope == 0.0 or not np.isfinite(slope):
            break
        step = miss / slope
        s -= step
        if abs(step) <= 4e-16 * (abs(s) + 1e-300):
            break
    u = np.linalg.solve(m + s * eye, a)
    good = abs(float(u @ u) - 1.0) <= 1e-6 and abs(s - start) <= 1e-4 * (1.0 + abs(start))
    return s if good else None
