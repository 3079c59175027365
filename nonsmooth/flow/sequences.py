"""Sequences whose entries are arrays, and which make an object where one is looked at."""

from __future__ import annotations

import operator
from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields
from typing import Any, Self, TypeVar, overload

T = TypeVar("T")


class LazySequence(Sequence[T]):
    """A sequence like a list. Subclasses are dataclasses of the arrays from which its objects are made."""

    # ``_make`` makes the arrays when one of them is first looked at; ``_list`` makes the objects of a short one,
    # for which arrays do not pay.

    @classmethod
    def when_read(
        cls, make: Callable[[], Self], listed: Callable[[], list[T]] | None = None
    ) -> Self:
        """Return a sequence whose arrays, or else whose objects, are made when they are looked at."""
        made = object.__new__(cls)
        vars(made).update(_make=make, _list=listed)
        return made

    @property
    def _objects(self) -> list[T] | None:
        own = vars(self)
        if own.get("_list") is not None:
            own["_made_objects"], own["_list"] = own["_list"](), None
        return own.get("_made_objects")

    def __getattr__(self, name: str) -> Any:
        own = vars(self)
        if name.startswith("_") or "_make" not in own:
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
        if own["_make"] is not None:
            own.update(_state(own["_make"]()))
            own["_make"] = None
        if name not in own:
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
        return own[name]

    def __getstate__(self) -> dict[str, Any]:
        return _state(self)

    @classmethod
    @abstractmethod
    def of(cls, objects: Sequence[T]) -> Self:
        """Return a sequence of objects."""

    @abstractmethod
    def _size(self) -> int:
        """Number of objects."""

    @abstractmethod
    def _made(self, k: int) -> T:
        """Make the object of a number from 0."""

    @abstractmethod
    def _part(self, which: slice) -> Self:
        """Return a slice of it."""

    def __len__(self) -> int:
        objects = self._objects
        return self._size() if objects is None else len(objects)

    @overload
    def __getitem__(self, k: int) -> T: ...
    @overload
    def __getitem__(self, k: slice) -> Self: ...
    def __getitem__(self, k: int | slice) -> T | Self:
        objects = self._objects
        if isinstance(k, slice):
            return self._part(k) if objects is None else self.of(objects[k])
        number, size = operator.index(k), len(self)
        if not -size <= number < size:
            raise IndexError(f"index {number} is out of range for {size} entries")
        return self._made(number % size) if objects is None else objects[number]

    def __iter__(self) -> Iterator[T]:
        objects = self._objects
        return self._each() if objects is None else iter(objects)

    def _each(self) -> Iterator[T]:
        """Make all objects in turn."""
        return map(self._made, range(self._size()))

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


def _state(made: Any) -> dict[str, Any]:
    """The arrays of a sequence by name."""
    return {field.name: getattr(made, field.name) for field in fields(made)}
