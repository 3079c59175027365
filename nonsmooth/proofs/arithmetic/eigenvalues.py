"""Enclosures of eigenvalues, and the kind of an equilibrium by their signs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .flint import arb, arb_mat
from .intervals import sign


def eigenvalue_kind(jacobian: Sequence[Sequence[arb]]) -> tuple[str, str, dict[str, arb]]:
    """Kind of an equilibrium by the signs of its eigenvalues, why it is undecided, and eigenvalues."""
    if not jacobian:
        return "stable node", "", {}  # nothing to move along
    matrix = arb_mat([list(row) for row in jacobian])
    if not all(v.is_finite() for v in matrix.entries()):
        return "", "the Jacobian is not finite", {}
    found = eigenvalues(matrix)
    if found is None:
        return "", "the eigenvalues are not proven to be apart", {}
    real = [sign(re) for re, _ in found]
    values: dict[str, arb] = {}
    for k, (re, im) in enumerate(sorted(found, key=lambda v: (float(v[0]), float(v[1])))):
        values[f"eigenvalue{k + 1}" + ("" if im.is_zero() else "_real")] = re
        if not im.is_zero():
            values[f"eigenvalue{k + 1}_imaginary"] = im
    if 0 in real:
        return "", "the real part of an eigenvalue has no proven sign", values
    if len(set(real)) > 1:
        return "saddle", "", values
    shape = "focus" if any(not im.contains(0) for _, im in found) else "node"
    return f"{'stable' if real[0] < 0 else 'unstable'} {shape}", "", values


def eigenvalues(matrix: arb_mat) -> list[tuple[arb, arb]] | None:
    """Eigenvalues as (real part, imaginary part); None where they are not proven to be apart."""
    return _small(matrix) if matrix.nrows() <= 2 else _isolated(matrix)


def _small(matrix: arb_mat) -> list[tuple[arb, arb]] | None:
    """Eigenvalues of a 1 x 1 or 2 x 2 matrix in closed form, also double ones."""
    if matrix.nrows() == 1:
        return [(matrix[0, 0], arb(0))]
    half = (matrix[0, 0] + matrix[1, 1]) / 2
    lean = (matrix[0, 0] - matrix[1, 1]) / 2
    disc = lean * lean + matrix[0, 1] * matrix[1, 0]
    if disc < 0:
        r = (-disc).sqrt()
        return [(half, -r), (half, r)]
    if disc > 0 or disc.is_zero():
        r = disc.sqrt()
        det = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
        low, high = half - r, half + r
        if half > 0:  # the small one from the product, without cancellation
            low = det / high
        elif half < 0:
            high = det / low
        return [(low, arb(0)), (high, arb(0))]
    return None


def _isolated(matrix: arb_mat) -> list[tuple[arb, arb]] | None:
    """Isolated eigenvalues of a real matrix as (real part, imaginary part)."""
    try:
        values: list[Any] = matrix.eig()
    except (ValueError, ArithmeticError):
        return None
    result = []
    for v in values:
        # The conjugate of an eigenvalue is one too: if no other enclosure overlaps it, the eigenvalue
        # is real.
        mirrored = v.conjugate()
        own = not any(w is not v and w.overlaps(mirrored) for w in values)
        if not own and v.imag.contains(0):
            return None
        result.append((v.real, arb(0) if own else v.imag))
    return result
