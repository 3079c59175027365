"""Validation of values read from files against the types and shapes that their classes declare.

The types are the annotations of the fields. The shapes are texts such as ``"m n"``, one word for each axis:

- a letter is a length, the same in all fields of one object; ``n`` and ``N`` are the numbers of states, and of
  states and time, in the whole result; a number is itself, ``*`` any length, ``...`` any number of leading axes;
- ``|`` separates alternatives; what stands before ``;`` is the length of a sequence of arrays, or the first axis
  of one array in its place;
- ``nan`` allows numbers that are not finite, ``<points`` requires positions in the field ``points``.
"""

from __future__ import annotations

import dataclasses
import math
import types
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

C = TypeVar("C", bound=type[Any])

#: Lengths that are the same in a whole result.
_SHARED = ("n", "N")

#: Classes whose objects may be in a file, by name; shapes of their fields, and a check of what shapes cannot say.
CLASSES: dict[str, type[Any]] = {}
_HINTS: dict[type[Any], dict[str, Any]] = {}
_SCHEMAS: dict[type[Any], tuple[Mapping[str, str], Callable[[Any], None] | None]] = {}


def type_hints(cls: type[Any]) -> dict[str, Any]:
    """Return the types of a class's fields."""
    if cls not in _HINTS:
        _HINTS[cls] = get_type_hints(cls)
    return _HINTS[cls]


def savable(*, check: Callable[[Any], None] | None = None, **shapes: str) -> Callable[[C], C]:
    """Register a dataclass whose instances may be part of a saved result, with the shapes of its fields."""

    def register(cls: C) -> C:
        CLASSES[cls.__name__], _SCHEMAS[cls] = cls, (shapes, check)
        return cls

    return register


class Validator:
    """Checks the objects of one result; ValueError where one does not fit."""

    def __init__(self) -> None:
        self.shared: dict[str, Any] = {}

    def require(self, value: Any) -> None:
        """Check a result and all objects in it."""
        cls = type(value)
        shapes, check = _SCHEMAS[cls]
        parts = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        self.require_parts(cls.__name__, parts, type_hints(cls), shapes)
        if check is not None:
            check(value)

    def require_parts(
        self,
        owner: str,
        parts: Mapping[str, Any],
        hints: Mapping[str, Any],
        shapes: Mapping[str, str],
    ) -> None:
        """Check the parts of an object by their types and shapes."""
        lengths = dict[str, Any]()
        for name, value in parts.items():
            try:
                _Spec(self, shapes.get(name, ""), lengths, parts).require(value, hints[name])
            except ValueError as error:
                raise ValueError(f"{owner}.{name}: {error}") from error


class _Spec:
    """The shape of a field in an object, with the lengths that are known so far."""

    def __init__(self, validator: Validator, text: str, lengths: dict[str, Any], owner: Any):
        self.validator, self.lengths, self.owner = validator, lengths, owner
        count, separator, rest = text.partition(";")
        self.count = count.strip() if separator else ""
        self.words = (rest if separator else text).replace("|", " | ").split()

    def require(self, value: Any, hint: Any, inside: bool = False) -> None:
        """Check a value, or one ``inside`` of a sequence whose length has a name."""
        kind, args = get_origin(hint), get_args(hint)
        if kind in (Union, types.UnionType):
            _any(lambda one: self.require(value, one), args)
        elif kind is np.ndarray:
            self._array(value, get_args(args[1])[0], inside)
        elif kind is dict:
            _demand(type(value) is dict, "it is no mapping")
            for key, part in value.items():
                self.require(key, args[0])
                self.require(part, args[1])
        elif kind in (list, tuple, Sequence):
            types_of = (list, tuple) if kind is Sequence else (kind,)
            _demand(type(value) in types_of, f"it is no {kind.__name__}")
            if kind is tuple and args[-1] is not ...:
                _demand(len(value) == len(args), f"it has {len(value)} parts")
                for part, own in zip(value, args, strict=True):
                    self.require(part, own)
                return
            if self.count:
                self._length(self.count, len(value))
            for part in value:
                self.require(part, args[0], True)
        else:
            self._one(value, hint)

    def _one(self, value: Any, hint: Any) -> None:
        """Check a number, a text, a system or an object of a registered class."""
        if hint is Any:  # what is given to a section, as a file can hold it
            _demand(isinstance(value, str) or _is_number(value), "it is no text or number")
        elif hint is float:
            _demand(_is_number(value), "it is no number")
            _demand("nan" in self.words or math.isfinite(value), "it is not finite")
        else:
            _demand(type(value) is hint, f"it is no {getattr(hint, '__name__', hint)}")
            if hint in _SCHEMAS:
                self.validator.require(value)
            elif hasattr(value, "extended_dimension"):  # a system
                self._length("n", value.dimension)
                self._length("N", value.extended_dimension)

    def _array(self, value: Any, scalar: Any, inside: bool) -> None:
        _demand(isinstance(value, np.ndarray), "it is no array")
        _demand(value.dtype == scalar, f"it has numbers of type {value.dtype}")
        shapes, flags = [list[str]()], list[str]()
        for word in self.words:
            if word == "|":
                shapes.append([])
            elif word == "nan" or word[0] == "<":
                flags.append(word)
            else:
                shapes[-1].append(word)
        before = [] if inside or not self.count else [self.count]
        _any(lambda shape: self._shape(value.shape, [*before, *shape]), shapes)
        self._values(value, flags)

    def _shape(self, found: tuple[int, ...], words: Sequence[str]) -> None:
        leading = words[:1] == ["..."]
        target = words[1:] if leading else words
        first = len(found) - len(target)
        _demand(first >= 0 if leading else not first, f"it has the shape {found}")
        if leading:
            self._length("...", found[:first])
        for word, length in zip(target, found[first:], strict=True):
            if word != "*":
                self._length(word, length)

    def _length(self, word: str, length: Any) -> None:
        known = self.validator.shared if word in _SHARED else self.lengths
        expected = int(word) if word.isdigit() else known.setdefault(word, length)
        _demand(expected == length, f"it has the length {length} where {word} is {expected}")

    def _values(self, value: NDArray[Any], flags: Sequence[str]) -> None:
        if value.dtype.kind in "fc" and "nan" not in flags:
            _demand(bool(np.isfinite(value).all()), "not all of its numbers are finite")
        for flag in flags:
            if flag[0] == "<":
                most = len(self.owner[flag[1:]])
                within = bool(np.all((value >= 0) & (value < most)))
                _demand(within, f"it has numbers that are not of {flag[1:]}")


def _is_number(value: Any) -> bool:
    return type(value) in (int, float)


def _demand(holds: bool, otherwise: str) -> None:
    if not holds:
        raise ValueError(otherwise)


def _any(check: Callable[[Any], None], choices: Sequence[Any]) -> None:
    """Check that something fits one of several types or shapes."""
    errors = []
    for one in choices:
        try:
            return check(one)
        except ValueError as error:
            errors.append(error)
    raise errors[0]
