"""The mode at a point of several surfaces, as a box-constrained complementarity problem.

At a point of several surfaces the rates are w = a + M lambda. A surface is left upward with
lambda_i = +1 and w_i >= 0, downward with lambda_i = -1 and w_i <= 0, and it slides with w_i = 0 and
lambda_i between. A contact is open with reaction 0 and closed with a positive one and no acceleration:
the same with the bounds 0 and infinity and the opposite sign of its row. If -M is a P-matrix (all
principal minors positive) there is exactly one solution, and exchanging letters finds it at the cost of
a few factorisations.

Source: Cottle, Pang & Stone 1992, "The linear complementarity problem", ch. 3 (P-matrices), 4.2
(Murty's least-index rule); Judice & Pires 1994 for exchanging blocks of letters.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ..values import Array

#: What is below this, relative to its terms, is rounding.
_ROUNDING = 64 * sys.float_info.epsilon

#: Minors of all subsets are computed up to this size.
_MINORS = 8

#: Exchanges of blocks that do not help before letters are exchanged one by one.
_PATIENCE = 10


def solve(
    a: Array,
    m: Array,
    start: Array,
    contact: Sequence[bool] | None = None,
    iterations: int = 10_000,
) -> Array | None:
    """Find lambda with the complementarity above, where -M is a P-matrix."""
    letters = np.array(start, float)
    touches = np.zeros(len(letters), bool) if contact is None else np.array(contact)
    low, high = np.where(touches, 0.0, -1.0), np.where(touches, np.inf, 1.0)
    best, patience = len(letters) + 1, _PATIENCE
    for _ in range(iterations):
        lam = _held(a, m, letters, low)
        if lam is None:
            return None
        wanted = _wanted(lam, a + m @ lam, letters, low, high)
        wrong = np.flatnonzero(wanted != letters)
        if not wrong.size:
            return np.clip(lam, low, high)
        if len(wrong) < best:
            best, patience = len(wrong), _PATIENCE
        patience -= 1
        change = wrong if patience > 0 else wrong[:1]
        letters[change] = wanted[change]
    return None


def _held(a: Array, m: Array, letters: Array, low: Array) -> Array | None:
    """Lambda for given letters: those that slide keep their rates at zero."""
    slides = letters == 0.0
    fixed = np.where(slides, 0.0, np.where(letters > 0.0, 1.0, low))
    lam = fixed.copy()
    if slides.any():
        try:
            lam[slides] = np.linalg.solve(m[np.ix_(slides, slides)], -(a + m @ fixed)[slides])
        except np.linalg.LinAlgError:
            return None
    return lam if np.all(np.isfinite(lam)) else None


def _wanted(lam: Array, rates: Array, letters: Array, low: Array, high: Array) -> Array:
    """Letters after every violation was mended."""
    slides = letters == 0.0
    wanted = np.where(slides & (lam > high), 1.0, np.where(slides & (lam < low), -1.0, letters))
    return np.where(~slides & (rates * letters < 0.0), 0.0, wanted)


def is_unique(m: Array) -> bool:
    """Whether -M is shown to be a P-matrix, so that there is one solution for every a."""
    # Shown for a matrix that attracts (``attracts``), and by its minors if it is small.
    a = _scaled(m)
    return a is not None and (_is_stable(a) or (len(a) <= _MINORS and _has_positive_minors(a)))


def attracts(m: Array) -> bool:
    """Whether the intersection of the surfaces is shown to attract where all of them can slide."""
    a = _scaled(m)
    return a is not None and (_is_stable(a) or (len(a) <= 2 and _has_positive_minors(a)))


def _scaled(m: Array) -> Array | None:
    """Return -M with unit diagonal, which leaves P-matrices what they are; None where it cannot be one."""
    if not np.all(np.isfinite(m)) or np.any(np.diag(m) >= 0.0):
        return None
    scale = np.sqrt(-np.diag(m))
    return np.asarray(-m / np.outer(scale, scale), float)


def _is_stable(a: Array) -> bool:
    """Whether a positive diagonal D with D A + A^T D definite is found."""
    if _is_definite(_symmetrised(a)) or _is_definite((a + a.T) / 2):
        return True
    off = np.abs(a - np.eye(len(a))).sum(axis=1)
    return bool(np.all(off < 1.0 - _ROUNDING))


def _has_positive_minors(a: Array) -> bool:
    return all(
        np.linalg.det(a[np.ix_(s, s)]) > _ROUNDING
        for size in range(2, len(a) + 1)
        for s in combinations(range(len(a)), size)
    )


def _is_definite(a: Array | None) -> bool:
    if a is None:
        return False
    return bool(np.linalg.eigvalsh(a)[0] > _ROUNDING * len(a))


def _symmetrised(a: Array) -> Array | None:
    """Return D^-1 A D for the positive diagonal D that makes it symmetric, if there is one."""
    d = np.zeros(len(a))
    for root in range(len(a)):
        if d[root]:
            continue
        d[root], pending = 1.0, [root]
        while pending:
            i = pending.pop()
            for j in np.flatnonzero((a[i] != 0.0) | (a[:, i] != 0.0)):
                if d[j] or not a[i, j] * a[j, i] > 0.0:
                    continue
                d[j] = d[i] * np.sqrt(a[j, i] / a[i, j])
                pending.append(int(j))
    symmetric = a * d[None, :] / d[:, None]
    if np.abs(symmetric - symmetric.T).max(initial=0.0) > 1e-12 * np.abs(symmetric).max():
        return None
    return (symmetric + symmetric.T) / 2
