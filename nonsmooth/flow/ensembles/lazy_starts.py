"""Grids and random starts, computed from their numbers, so that a billion of them needs no memory."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...model import Array, PointError

Index = NDArray[np.int64]


class Grid:
    """All combinations of some values of the states, computed where they are needed.

    Parameters
    ----------
    axes : sequence of n array_like () or (k,)
        Values of each state; a single number is no axis of the results.

    Attributes
    ----------
    shape : tuple of int
        Lengths of the axes, in the order of the states.
    dimension : int
        Number of states n.
    axes : tuple of ndarray () or (k,)
        The values.

    Raises
    ------
    PointError
        No axes; an axis that is neither a number nor a row of numbers, or is not finite.

    Examples
    --------
    >>> import casadi as ca, numpy as np, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> system = ns.FilippovSystem([x, v], surface=v, above=[v, -x - 1], below=[v, -x + 1])
    >>> starts = ns.Grid([np.linspace(-3, 3, 7), 0.0])
    >>> np.round(ns.ensemble(system, starts, t_end=50.0).x[:, 0], 9) + 0.0
    array([ 1.,  0., -1.,  0.,  1.,  0., -1.])
    """

    def __init__(self, axes: Sequence[ArrayLike]):
        if not isinstance(axes, Iterable):
            raise PointError(f"axes is {axes!r}. Give the values of each state.")
        self._axes = [_axis(values, i) for i, values in enumerate(axes)]
        if not self._axes:
            raise PointError("axes is empty. Give the values of each state.")

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the axes, in the order of the states; single numbers have none."""
        return tuple(len(a) for a in self._axes if a.ndim)

    @property
    def dimension(self) -> int:
        """Number of states n."""
        return len(self._axes)

    @property
    def axes(self) -> tuple[Array, ...]:
        """Values () or (k,) of each state."""
        return tuple(self._axes)

    def at(self, index: Index) -> Array:
        """Return some of the starts.

        Parameters
        ----------
        index : ndarray of int (m,)
            Their numbers, counted along the last axis first.

        Returns
        -------
        ndarray (m, n)
            Their states.
        """
        where = iter(np.unravel_index(index, self.shape) if self.shape else ())
        columns = [a[next(where)] if a.ndim else np.full(len(index), a) for a in self._axes]
        return np.column_stack(columns)

    def __repr__(self) -> str:
        return f"Grid(shape {self.shape}, {self.dimension} states)"

    def state(self) -> tuple[Any, ...]:
        """Return everything that the starts depend on, for the hash of a store."""
        return "grid", [(a.shape, a.tobytes()) for a in self._axes]


@dataclass(frozen=True)
class RandomStarts:
    """Starts distributed uniformly in a box, each computed from its number and the seed alone.

    They do not depend on the process that computes them, or on how many it computes at a time.

    Parameters
    ----------
    count : int
        Number of starts.
    low, high : array_like (n,)
        Corners of the box; equal numbers hold a state.
    seed : int, optional
        Seed of the generator, from 0 to $2^64 - 1$.

    Attributes
    ----------
    shape : tuple of int
        ``(count,)``.
    dimension : int
        Number of states n.

    Raises
    ------
    PointError
        Corners of different lengths or in the wrong order; a ``seed`` out of its range.

    Notes
    -----
    Component j of start i is output $i n + j$ of SplitMix64 (Steele, Lea & Flood 2014, "Fast
    splittable pseudorandom number generators", fig. 17), of which the upper 53 bits are divided by $2^53$.

    Examples
    --------
    >>> import nonsmooth as ns
    >>> starts = ns.RandomStarts(10**9, low=[-1.0, 0.0], high=[1.0, 0.0], seed=7)
    >>> starts.shape, starts.dimension
    ((1000000000,), 2)
    """

    count: int
    low: ArrayLike
    high: ArrayLike
    seed: int = 0

    def __post_init__(self) -> None:
        low, high = _axis(self.low, "low"), _axis(self.high, "high")
        if low.ndim != 1 or low.shape != high.shape or not np.all(low <= high) or not len(low):
            raise PointError(
                f"low is {self.low!r} and high is {self.high!r}. Give one number for each state in both, "
                "with low <= high."
            )
        if not np.all(high / 2 - low / 2 <= np.finfo(float).max / 2):
            raise PointError(
                f"low is {self.low!r} and high is {self.high!r}. Give a box of finite size."
            )
        for name, least, most in (("count", 0, 2**53), ("seed", 0, 2**64 - 1)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
                raise PointError(f"{name} is {value!r}. Give an integer from {least} to {most}.")
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of starts, ``(count,)``."""
        return (self.count,)

    @property
    def dimension(self) -> int:
        """Number of states n."""
        return len(np.asarray(self.low))

    def at(self, index: Index) -> Array:
        """Return some of the starts.

        Parameters
        ----------
        index : ndarray of int (m,)
            Their numbers, from 0.

        Returns
        -------
        ndarray (m, n)
            Their states.
        """
        low, high, n = np.asarray(self.low), np.asarray(self.high), self.dimension
        number = np.asarray(n * index[:, None] + np.arange(n), np.uint64)
        part = (_split_mix(np.uint64(self.seed), number) >> np.uint64(11)) * 2.0**-53
        return low + (high - low) * part

    def state(self) -> tuple[Any, ...]:
        """Return everything that the starts depend on, for the hash of a store."""
        low, high = np.asarray(self.low), np.asarray(self.high)
        return "random", self.count, low.tobytes(), high.tobytes(), self.seed


LazyStarts = Grid | RandomStarts


def _split_mix(seed: np.uint64, number: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Outputs of SplitMix64 by their number from 0."""
    with np.errstate(over="ignore"):
        z = seed + (number + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return z ^ (z >> np.uint64(31))


def _axis(values: ArrayLike, which: int | str) -> Array:
    name = which if isinstance(which, str) else f"axes[{which}]"
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise PointError(f"{name} is {values!r}. Give numbers.") from error
    if array.ndim > 1:
        raise PointError(f"{name} has shape {array.shape}. Give a number or shape (k,).")
    if not np.all(np.isfinite(array)):
        raise PointError(f"{name} is {values!r}. Give finite numbers.")
    array.flags.writeable = False
    return array


def part_of(lazy: LazyStarts, shape: tuple[int, ...], index: Index) -> Array:
    """States (m, n) of lazy starts broadcast to ``shape``, by their numbers in that shape."""
    if lazy.shape == shape:
        return lazy.at(index)
    own = (1,) * (len(shape) - len(lazy.shape)) + lazy.shape
    where = np.unravel_index(index, shape)
    stay = [np.zeros_like(w) if size == 1 else w for w, size in zip(where, own, strict=True)]
    number = np.ravel_multi_index(tuple(stay), own) if math.prod(own) else index
    return lazy.at(np.asarray(number, np.int64))
