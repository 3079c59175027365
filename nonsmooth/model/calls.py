"""Evaluation of CasADi functions at one point or many, without losing an interrupt.

CasADi converts NumPy arrays by Python code that it calls from C++, where a KeyboardInterrupt is lost.
Lists of lists and shared memory need no such conversion.
"""

from __future__ import annotations

import threading
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from .errors import OptionError
from .values import Array

#: Columns from which on, and in blocks of which, memory is shared with a function mapped over columns.
_MANY, _BLOCK = 128, 1024


def call(function: ca.Function, *values: ArrayLike) -> list[Array]:
    """Evaluate a CasADi function of columns at one or many points.

    Parameters
    ----------
    function : casadi.Function
        Its inputs are columns (n, 1).
    *values : array_like (n,) or (n, m)
        One for each input; those with one column are used at all m points.

    Returns
    -------
    list of ndarray (r, c) or (r, c m)
        One for each output (r, c), side by side for the m points.

    Raises
    ------
    KeyboardInterrupt
        Where CasADi's own conversion of arrays would lose it.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, p = ca.SX.sym("x", 2), ca.SX.sym("p")
    >>> f = ca.Function("f", [x, p], [p * x, ca.sum1(x)])
    >>> ns.call(f, [1.0, 2.0], 3.0)
    [array([[3.],
           [6.]]), array([[3.]])]
    >>> ns.call(f, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], 2.0)[1]
    array([[5., 7., 9.]])
    """
    if not isinstance(function, ca.Function):
        raise OptionError(
            f"function: expected a casadi.Function, received {function!r}. "
            'ca.Function("f", [x], [expression]) makes one.'
        )
    columns = [_column(v) for v in values]
    count = max((v.shape[1] for v in columns), default=1)
    block = _block(function) if count >= _MANY else None
    if block is None or not block.fits:
        results = function.call([_matrix(v) for v in columns])
        return [np.array(r.elements()).reshape(r.shape, order="F") for r in results]
    return block(columns, count)


def _column(value: ArrayLike) -> Array:
    array = np.asarray(value, float)
    return array if array.ndim == 2 else array.reshape(-1, 1)


def _matrix(value: Array) -> ca.DM:
    return ca.DM(value.tolist()) if value.size else ca.DM(*value.shape)


class _Block:
    """A function mapped over a block of columns, with the memory of its arguments and results."""

    def __init__(self, function: ca.Function):
        shapes = [function.size_in(k) for k in range(function.n_in())]
        outputs = [function.sparsity_out(k) for k in range(function.n_out())]
        #: Whether inputs are columns and everything is dense.
        self.fits = all(s[1] == 1 for s in shapes) and all(o.is_dense() for o in outputs)
        self.fits = self.fits and all(
            function.sparsity_in(k).is_dense() for k in range(function.n_in())
        )
        if not self.fits:
            return
        mapped = function.map(_BLOCK)
        self._buffer, self._run = mapped.buffer()
        self._widths = [o.size2() for o in outputs]
        self._inputs = [np.zeros((_BLOCK, s[0])) for s in shapes]  # rows: CasADi's columns
        self._outputs = [np.zeros((_BLOCK * o.size2(), o.size1())) for o in outputs]
        for k, array in enumerate(self._inputs):
            if array.size:
                self._buffer.set_arg(k, array.reshape(-1).data)
        for k, array in enumerate(self._outputs):
            if array.size:
                self._buffer.set_res(k, array.reshape(-1).data)
        self._lock = threading.Lock()

    def __call__(self, columns: list[Array], count: int) -> list[Array]:
        results = [
            np.empty((count * width, array.shape[1]))
            for array, width in zip(self._outputs, self._widths, strict=True)
        ]
        for first in range(0, count, _BLOCK):
            some = min(_BLOCK, count - first)
            with self._lock:
                for array, value in zip(self._inputs, columns, strict=True):
                    one = value.shape[1] == 1
                    array[:some] = value.T if one else value[:, first : first + some].T
                    array[some:] = array[some - 1]
                self._run()
                for result, array, w in zip(results, self._outputs, self._widths, strict=True):
                    result[w * first : w * (first + some)] = array[: w * some]
        return [r.T for r in results]


@lru_cache(maxsize=32)
def _block(function: ca.Function) -> _Block:
    return _Block(function)
