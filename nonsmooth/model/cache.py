"""A cache of objects built for a system, by content; the least recently used entry is dropped first."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

import casadi as ca

T = TypeVar("T")

#: Enough for the motions and jets of a system's modes at a few tolerances.
CAPACITY = 256


class Cache:
    """A mapping from keys to values; two threads may build the same value at once."""

    def __init__(self, capacity: int = CAPACITY):
        self._capacity = capacity
        self._values: OrderedDict[Hashable, Any] = OrderedDict()

    def get(self, key: Hashable, build: Callable[[], T]) -> T:
        """Return the value of a key, built if it is not there."""
        try:
            value: T = self._values[key]
            self._values.move_to_end(key)
        except KeyError:
            value = self._values[key] = build()
            while len(self._values) > self._capacity:
                self._values.popitem(last=False)
        return value

    def __contains__(self, key: Hashable) -> bool:
        return key in self._values

    def __len__(self) -> int:
        return len(self._values)


class Content:
    """An expression as a key: equal to another one with the same graph over the same symbols."""

    def __init__(self, symbols: list[ca.SX], expression: ca.SX):
        self._text = ca.Function("content", symbols, [expression]).serialize()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Content) and self._text == other._text

    def __hash__(self) -> int:
        return hash(self._text)
