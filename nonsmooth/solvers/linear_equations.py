"""Linear equations and determinants, by sparse factors where a large matrix is mostly zero."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..model import Array

if TYPE_CHECKING:
    from scipy.sparse.linalg import SuperLU

#: Fewest rows of a matrix that is factored as a sparse one, and the largest part of its entries that is not zero.
_MANY, _FILLED = 100, 0.15


def solve(matrix: Array, right: Array) -> Array:
    """Solve ``matrix @ x = right``; raises numpy.linalg.LinAlgError where the matrix is singular."""
    if _is_sparse(matrix):
        return np.asarray(_factors(matrix).solve(right), float)
    return np.asarray(np.linalg.solve(matrix, right), float)


def determinant(matrix: Array) -> float:
    """Determinant; its sign is right where its size overflows."""
    if not _is_sparse(matrix):
        sign, size = np.linalg.slogdet(matrix)
        return float(sign) * float(np.exp(size))
    try:
        factors = _factors(matrix)
    except np.linalg.LinAlgError:
        return 0.0
    pivots = factors.U.diagonal()
    turns = _parity(factors.perm_r) * _parity(factors.perm_c)
    with np.errstate(over="ignore", under="ignore"):
        return turns * float(np.prod(np.sign(pivots))) * float(np.exp(np.log(np.abs(pivots)).sum()))


def _is_sparse(matrix: Array) -> bool:
    return len(matrix) >= _MANY and int(np.count_nonzero(matrix)) <= _FILLED * matrix.size


def _factors(matrix: Array) -> SuperLU:
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    try:
        return splu(csc_array(matrix))
    except RuntimeError as error:  # exactly singular
        raise np.linalg.LinAlgError(str(error)) from None


def _parity(permutation: Array) -> int:
    """Sign of a permutation."""
    seen, sign = np.zeros(len(permutation), bool), 1
    for start in range(len(permutation)):
        length, at = 0, start
        while not seen[at]:
            seen[at], at, length = True, int(permutation[at]), length + 1
        sign = -sign if length and length % 2 == 0 else sign
    return sign
