"""Enclosures of eigenvalues, and the kind of an equilibrium by their signs."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
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
    values = numbered("eigenvalue", sorted(found, key=lambda v: (float(v[0]), float(v[1]))))
    if 0 in real:
        return "", "the real part of an eigenvalue has no proven sign", values
    if len(set(real)) > 1:
        return "saddle", "", values
    shape = "focus" if any(not im.contains(0) for _, im in found) else "node"
    return f"{'stable' if real[0] < 0 else 'unstable'} {shape}", "", values


def eigenvalues(matrix: arb_mat) -> list[tuple[arb, arb]] | None:
    """Eigenvalues as (real part, imaginary part); None where they are not proven to be apart."""
    return _small(matrix) if matrix.nrows() <= 2 else _isolated(matrix)


def numbered(name: str, found: Sequence[tuple[arb, arb]], first: int = 1) -> dict[str, arb]:
    """Names of numbers in order, with one for each part of those that are not real."""
    values = {}
    for k, (re, im) in enumerate(found, first):
        values[f"{name}{k}" + ("" if im.is_zero() else "_real")] = re
        if not im.is_zero():
            values[f"{name}{k}_imaginary"] = im
    return values


def _small(matrix: arb_mat) -> list[tuple[arb, arb]] | None:
    """Eigenvalues of a 1 x 1 or 2 x 2 matrix in closed form, also double ones."""
    if matrix.nrows() == 1:
        return [(matrix[0, 0], arb(0))]
    (a, b), (c, d) = matrix.tolist()
    half, lean = (a + d) / 2, (a - d) / 2
    return roots(half, lean * lean + b * c, a * d - b * c, sign(half))


def roots(half: arb, disc: arb, product: arb, side: int) -> list[tuple[arb, arb]] | None:
    """Two numbers by half of their sum, whose sign is ``side``, its square less the product, and the product."""
    if disc < 0:
        r = (-disc).sqrt()
        return [(half, -r), (half, r)]
    if not (disc > 0 or disc.is_zero()):
        return None
    r = disc.sqrt()
    low, high = half - r, half + r
    if side > 0:  # the small one from the product, without cancellation
        low = product / high
    elif side < 0:
        high = product / low
    return [(low, arb(0)), (high, arb(0))]


def _isolated(matrix: arb_mat) -> list[tuple[arb, arb]] | None:
    """Isolated eigenvalues of a real matrix as (real part, imaginary part)."""
    values: list[Any] = []
    for several in ({}, {"multiple": True}):  # enclosures that are apart have one eigenvalue each
        with suppress(ValueError, ArithmeticError):
            values = matrix.eig(**several)
            break
    if not values or any(v.overlaps(w) for i, v in enumerate(values) for w in values[:i]):
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
