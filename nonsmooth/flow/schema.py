"""Validation of values read from files against the types and shapes that their classes declare.

The types are the annotations of the fields. The shapes are texts such as ``"m n"``, one word for each axis:

- a letter is a length, the same in all fields of one object; ``n`` and ``N`` are the numbers of states, and of
  states and time, in the whole result; a number is itself, ``*`` any length, ``...`` any number of leading axes;
- ``|`` separates alternatives; what stands before ``;`` is the length of a sequence of arrays, or the first axis
  of one array in its place;
- ``nan`` allows numbers that are not finite, ``<points`` requires positions in the field ``points``, ``status``
  values of ``Status``.
"""

from __future__ import annotations

import dataclasses
import math
import types
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from ..model import FilippovSystem
from .status import Status

#: Lengths that are the same in a whole result.
_SHARED = ("n", "N")


@dataclasses.dataclass(frozen=True)
class Schema:
    """The shapes of a class's fields, and a check of what shapes cannot say."""

    shapes: Mapping[str, str]
    check: Callable[[Any], None] | None


class Validator:
    """Checks the objects of one result; ValueError where one does not fit."""

    def __init__(self, schemas: Mapping[type[Any], Schema]):
        self.schemas = schemas
        self.shared: dict[str, Any] = {}
        self.hints: dict[type[Any], dict[str, Any]] = {}

    def require(self, value: Any) -> None:
        """Check a result and all objects in it."""
        cls = type(value)
        schema = self.schemas[cls]
        if cls not in self.hints:
            self.hints[cls] = get_type_hints(cls)
        hints = self.hints[cls]
        lengths = dict[str, Any]()
        for field in dataclasses.fields(value):
            where = f"{cls.__name__}.{field.name}"
            try:
                spec = _Spec(self, schema.shapes.get(field.name, ""), lengths, value)
                spec.require(getattr(value, field.name), hints[field.name])
            except ValueError as error:
                raise ValueError(f"{where}: {error}") from error
        if schema.check is not None:
            schema.check(value)


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
            self._any(value, args)
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
            _demand(kind is not tuple or args[1:] == (...,), "tuples of one type are known")
            if self.count:
                self._length(self.count, len(value))
            for part in value:
                self.require(part, args[0], True)
        else:
            self._one(value, hint)

    def _any(self, value: Any, hints: Sequence[Any]) -> None:
        """Check that a value fits one of several types."""
        errors = []
        for hint in hints:
            try:
                return self.require(value, hint)
            except ValueError as error:
                errors.append(error)
        raise errors[0]

    def _one(self, value: Any, hint: Any) -> None:
        """Check a number, a text, a system or an object of a registered class."""
        if hint is Any:  # what is given to a section, as a file can hold it
            _demand(isinstance(value, str) or _is_number(value), "it is no text or number")
        elif hint is float:
            _demand(_is_number(value), "it is no number")
            _demand("nan" in self.words or math.isfinite(value), "it is not finite")
        elif hint is FilippovSystem:
            _demand(type(value) is hint, "it is no system")
            self._length("n", value.dimension)
            self._length("N", value.extended_dimension)
        else:
            _demand(type(value) is hint, f"it is no {getattr(hint, '__name__', hint)}")
            if hint in self.validator.schemas:
                self.validator.require(value)

    def _array(self, value: Any, scalar: Any, inside: bool) -> None:
        _demand(isinstance(value, np.ndarray), "it is no array")
        _demand(value.dtype == scalar, f"it has numbers of type {value.dtype}")
        shapes, flags = [list[str]()], list[str]()
        for word in self.words:
            if word == "|":
                shapes.append([])
            elif word in ("nan", "status") or word[0] == "<":
                flags.append(word)
            else:
                shapes[-1].append(word)
        errors = []
        for shape in shapes:
            try:
                self._shape(
                    value.shape, shape if inside or not self.count else [self.count, *shape]
                )
                break
            except ValueError as error:
                errors.append(error)
        else:
            raise errors[0]
        self._values(value, flags)

    def _shape(self, found: tuple[int, ...], words: Sequence[str]) -> None:
        leading = words[:1] == ["..."]
        wanted = words[1:] if leading else words
        first = len(found) - len(wanted)
        _demand(first >= 0 if leading else not first, f"it has the shape {found}")
        if leading:
            self._length("...", found[:first])
        for word, length in zip(wanted, found[first:], strict=True):
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
            if flag == "status":
                _demand(bool(np.isin(value, [int(s) for s in Status]).all()), "it has no status")
            elif flag[0] == "<":
                most = len(getattr(self.owner, flag[1:]))
                within = bool(np.all((value >= 0) & (value < most)))
                _demand(within, f"it has numbers that are not of {flag[1:]}")


def _is_number(value: Any) -> bool:
    return type(value) in (int, float)


def _demand(holds: bool, otherwise: str) -> None:
    if not holds:
        raise ValueError(otherwise)
