"""Eigenvalues of a product of matrices by QR decompositions of its factors, as logarithms.

The product itself would lose the small eigenvalues beside the large ones, and overflow. Orthonormal bases are
multiplied by the factors cyclically until the sizes of the columns converge.

Source: Bojanczyk, Golub & Van Dooren 1992 (periodic Schur decomposition); Dieci & Van Vleck 1995.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...model import Array

#: A direction that a factor shrinks to this part or less is lost.
_LOST = 1e-12

#: Passes through all factors. Eigenvalues that these do not separate differ by no more than a factor of 12.
_PASSES = 12

#: Rounding of a factor, relative to its norm.
_ROUNDED = 16.0 * 2.0**-52

#: Sine of the angle of a pair of eigenvalues above which they are not two real ones with rounding.
_TURNED = 1e-3

#: Coupling of columns below which eigenvalues are separate.
_SEPARATE = 1e-13


@dataclass(frozen=True, eq=False)
class Factor:
    """A factor (n, n) of a product."""

    matrix: Array
    #: (n, n) or None: A factor may lose directions beside those that this matrix carries; without one it
    #: is regular.
    beside: Array | None = None

    def image(self, basis: Array) -> Array:
        """Orthonormal basis of the image of some directions (n, r)."""
        if not basis.shape[1] or (self.beside is None and len(basis) == basis.shape[1]):
            return basis  # all directions, or none
        moved = self.matrix @ basis
        if self.beside is None:
            return _decomposed(moved)[0]
        size = math.sqrt(float(np.vdot(carried := self.beside @ basis, carried)))
        u, sizes, _ = np.linalg.svd(moved, full_matrices=False)
        return np.asarray(u[:, sizes > _LOST * max(float(sizes[0]), size)])


@dataclass(frozen=True, eq=False)
class Product:
    """A product of matrices, the last factor leftmost, on the directions that the factors do not lose."""

    factors: Sequence[Factor]

    @cached_property
    def basis(self) -> Array:
        """Orthonormal basis (n, r) of the directions that no power of the product loses."""
        basis: Array = np.eye(len(self.factors[0].matrix))
        while True:
            before = basis.shape[1]
            for factor in self.factors:
                basis = factor.image(basis)
            if basis.shape[1] in (before, 0):
                return basis

    @cached_property
    def _triangles(self) -> tuple[Array, list[Array]]:
        """The product is similar to the first (r, r) after those of the list, which are triangular."""
        basis = self.basis
        for k in range(_PASSES):
            first, triangles = basis, list[Array]()
            for factor in self.factors:
                basis, triangle = _decomposed(factor.matrix @ basis)
                triangles.append(triangle)
            turned = first.T @ basis
            separate = np.abs(np.tril(turned, -1)).max() < _SEPARATE
            if separate or (k == 0 and len(turned) == 2 and _is_complex(turned, triangles)):
                break
        return turned, triangles

    @cached_property
    def logarithms(self) -> NDArray[np.complex128]:
        """Logarithms (r,) of the eigenvalues that are not zero, those of the largest first."""
        if not self.basis.shape[1]:
            return np.zeros(0, complex)
        found = _of_blocks(*self._triangles)
        return found[np.lexsort((found.imag, -found.real.round(12)))]

    @property
    def reversed(self) -> Product:
        """The transposed factors in reverse order, with the same eigenvalues."""
        transposed = [
            Factor(f.matrix.T, None if f.beside is None else _like(f.matrix))
            for f in reversed(self.factors)
        ]
        return Product(transposed)

    @property
    def error(self) -> float:
        """Error of the eigenvalues, relative to those beyond 1, estimated by the transposed factors in reverse order."""
        # the difference does not include the rounding of the factors themselves, which is ten times as large, and at
        # least that of their entries
        found = self.logarithms
        other = self.reversed.logarithms if found.size else found
        n = min(
            found.size, other.size
        )  # directions that only one of them loses are as small as that
        lost = np.exp(np.minimum([*found.real[n:], *other.real[n:]], 0.0)).max(initial=0.0)
        apart = np.exp(np.minimum(found.real[:n], 0.0)) * np.abs(found.real[:n] - other.real[:n])
        return max(10.0 * float(max(apart.max(initial=0.0), lost)), self._rounding)

    @property
    def _rounding(self) -> float:
        """Error of the eigenvalues, relative to those beyond 1, by the rounding of the factors."""
        if not self.logarithms.size:
            return 0.0
        kept = np.abs([np.diagonal(triangle) for triangle in self._triangles[1]])
        sizes = np.array([np.linalg.norm(factor.matrix) for factor in self.factors])
        parts = _ROUNDED * np.linalg.norm(
            sizes[:, None] / kept, axis=0
        )  # independent of each other
        return float((parts * np.exp(np.minimum(np.log(kept).sum(axis=0), 0.0))).max())


def _decomposed(matrix: Array) -> tuple[Array, Array]:
    """QR decomposition; of one column by its length."""
    largest = float(np.abs(matrix).max()) if matrix.shape[1] == 1 else 0.0
    if not 0.0 < largest < math.inf:
        q, r = np.linalg.qr(matrix)
        return q, r
    matrix = matrix / largest  # whose square does not overflow
    size = math.sqrt(float(np.vdot(matrix, matrix)))
    return matrix / size, np.array([[largest * size]])


def _like(matrix: Array) -> Array:
    """The identity in the size of a matrix."""
    return np.asarray(np.linalg.norm(matrix) * np.eye(len(matrix)))


def _is_complex(turned: Array, triangles: Sequence[Array]) -> bool:
    """Whether two eigenvalues are a pair of equal size, which no pass separates."""
    with np.errstate(divide="ignore"):  # the smaller of two real ones may be lost
        return bool(np.abs(np.sin(_of_blocks(turned, triangles).imag)).min() > _TURNED)


def _of_blocks(turned: Array, triangles: Sequence[Array]) -> NDArray[np.complex128]:
    """Logarithms of the eigenvalues of ``turned`` after a product of triangular matrices, block by block."""
    count, found = len(turned), list[NDArray[np.complex128]]()
    cuts = [k for k in range(1, count) if np.linalg.norm(turned[k:, :k]) < _SEPARATE]
    for a, b in zip([0, *cuts], [*cuts, count], strict=True):
        product, size = np.eye(b - a), 0.0
        for triangle in triangles:
            product = triangle[a:b, a:b] @ product
            largest = float(np.abs(product).max())
            product, size = product / largest, size + math.log(largest)
        values = np.linalg.eigvals(turned[a:b, a:b] @ product).astype(complex)
        found.append(np.log(values) + size)
    return np.concatenate(found)
