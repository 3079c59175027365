"""What was built for a system and may be needed again: the last so many things, by their content."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

import casadi as ca

T = TypeVar("T")

#: Enough for the motions and jets of a system's modes at a few tolerances.
CAPACITY = 256


class Cache:
    """A mapping from keys to what they stand for; the least recently used leaves first."""

    # Two threads may use it at once: at worst both build the same thing.

    def __init__(self, capacity: int = CAPACITY):
        self._capacity = capacity
        self._things: OrderedDict[Hashable, Any] = OrderedDict()

    def get(self, key: Hashable, build: Callable[[], T]) -> T:
        """Return what a key stands for, built when it is not (any more) there."""
        try:
            thing: T = self._things[key]
            self._things.move_to_end(key)
        except KeyError:
            thing = self._things[key] = build()
            while len(self._things) > self._capacity:
                self._things.popitem(last=False)
        return thing

    def __contains__(self, key: Hashable) -> bool:
        return key in self._things

    def __len__(self) -> int:
        return len(self._things)


class Content:
    """An expression as a key: equal to another one with the same graph over the same symbols."""

    def __init__(self, symbols: list[ca.SX], expression: ca.SX):
        self._text = ca.Function("content", symbols, [expression]).serialize()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Content) and self._text == other._text

    def __hash__(self) -> int:
        return hash(self._text)
