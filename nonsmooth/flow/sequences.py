"""Sequences whose entries are arrays, and which make an object where one is looked at."""

from __future__ import annotations

import operator
from abc import abstractmethod
from collections.abc import Sequence
from typing import Self, TypeVar, overload

T = TypeVar("T")


class LazySequence(Sequence[T]):
    """A sequence like a list, whose objects are made when they are looked at."""

    __slots__ = ()

    @abstractmethod
    def _made(self, k: int) -> T:
        """Make the object of a number from 0."""

    @abstractmethod
    def _part(self, which: slice) -> Self:
        """Return a slice of it."""

    @overload
    def __getitem__(self, k: int) -> T: ...
    @overload
    def __getitem__(self, k: slice) -> Self: ...
    def __getitem__(self, k: int | slice) -> T | Self:
        if isinstance(k, slice):
            return self._part(k)
        number, size = operator.index(k), len(self)
        if not -size <= number < size:
            raise IndexError(f"index {number} is out of range for {size} entries")
        return self._made(number % size)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, (list, LazySequence)):
            return NotImplemented
        return len(self) == len(other) and all(map(operator.eq, self, other))

    __hash__ = None  # type: ignore[assignment]  # as that of a list

    def __add__(self, other: Sequence[T]) -> list[T]:
        return [*self, *other]

    def __radd__(self, other: Sequence[T]) -> list[T]:
        return [*other, *self]

    def __repr__(self) -> str:
        return repr([*self])

