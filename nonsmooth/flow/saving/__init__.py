"""Saving of results, exact to the last bit, in files that also hold their systems.

A file is an archive of NumPy arrays, one for each type of number, and of a tree in JSON that refers to parts
of them. It has no pickle. A result consists of numbers, texts, arrays, sequences, mappings, systems, statuses
and the classes registered here.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...model import FilippovSystem, NonsmoothError, OptionError, instruction_form
from ...model.schema import CLASSES, Validator, savable
from ...result_tables import Tabular
from ..status import Status
from . import archive, files

_FORMAT = 4

#: Longest axis of an array; one beside an axis of length zero costs nothing else.
_LONGEST = 1 << 48


class Savable(Tabular):
    """A result that can be written to a file; :func:`load` reads it."""

    def __init_subclass__(cls, **schema: Any) -> None:
        super().__init_subclass__()
        savable(**schema)(cls)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the result to a file, with its system; :func:`nonsmooth.load` reads it.

        Parameters
        ----------
        path : path-like
            Replaced if it is there; ``.npz`` is a good ending.

        Raises
        ------
        OptionError
            It cannot be written.
        """
        data = _packed(self)
        try:
            files.replace(Path(path), data)
        except (OSError, TypeError, ValueError) as error:
            raise OptionError(
                f"path {path!r} cannot be written ({error}). Choose another folder."
            ) from error

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a result of this type from a file.

        Raises
        ------
        OptionError
        """
        result = load(path)
        if not isinstance(result, cls):
            raise OptionError(
                f"path has a {type(result).__name__}, not a {cls.__name__}. Use nonsmooth.load, which "
                "reads every type."
            )
        return result


def load(path: str | os.PathLike[str]) -> Any:
    """Read a result that was written with its method ``save``.

    Parameters
    ----------
    path : path-like
        All that is in it is checked, and what a file can make this process allocate is bounded.

    Returns
    -------
    Trajectory, Ensemble or another result
        Equal to the last bit to what was saved.

    Raises
    ------
    OptionError
        No such file, or none that was written by ``save``.

    Examples
    --------
    >>> import os, tempfile
    >>> import casadi as ca, nonsmooth as ns
    >>> x = ca.SX.sym("x")
    >>> run = ns.simulate(ns.FilippovSystem([x], surface=x, above=[-1], below=[3]), [1.0], t_end=2.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run.save(os.path.join(folder, "run.npz"))
    ...     again = ns.load(os.path.join(folder, "run.npz"))
    >>> again, again.system == run.system
    (Trajectory(t = 0 .. 2, 3 points, 2 events, itinerary '+ s', REACHED_END), True)
    """
    if not isinstance(path, (str, bytes, os.PathLike)):
        raise OptionError(
            f"path is {path!r} ({type(path).__name__}). Give a text or a pathlib.Path."
        )
    try:
        return _read(path)
    except Exception as error:  # whatever a damaged file raises in the readers of its formats
        reason = error
    raise OptionError(
        f"path {path!r} is no file written by save ({type(reason).__name__}: {reason}). "
        "Save the result again."
    ) from reason


# Writing -----------------------------------------------------------------------------------------


class _Writer:
    """Conversion of values to a tree; arrays go end to end into one row for each type."""

    def __init__(self) -> None:
        self.rows: dict[str, list[NDArray[Any]]] = {}
        self.sizes: dict[str, int] = {}
        self.written: dict[
            int, tuple[NDArray[Any], Any]
        ] = {}  # arrays by identity, as long as they live
        self.systems: list[FilippovSystem] = []

    def tree(self, value: Any) -> Any:
        """Return a value as JSON can represent it."""
        if value is None or isinstance(value, (bool, str)):
            return value
        if isinstance(value, Status):
            return {"status": int(value)}
        if isinstance(value, (int, float, np.integer, np.floating, np.bool_)):
            return value.item() if isinstance(value, np.generic) else value
        if isinstance(value, np.ndarray):
            return self._array(value)
        if isinstance(value, FilippovSystem):
            return {"system": self._number(value)}
        if isinstance(value, list):
            return [self.tree(v) for v in value]
        if isinstance(value, tuple):
            return {"tuple": [self.tree(v) for v in value]}
        if isinstance(value, Mapping):
            return {"mapping": [[self.tree(k), self.tree(v)] for k, v in value.items()]}
        name = type(value).__name__
        if name in CLASSES and dataclasses.is_dataclass(value):
            fields = dataclasses.fields(value)
            return {
                "of": name,
                "fields": {f.name: self.tree(getattr(value, f.name)) for f in fields},
            }
        raise OptionError(f"save cannot write {value!r}. Save a result of numbers and systems.")

    def _array(self, value: NDArray[Any]) -> Any:
        if value.dtype.kind not in "biufc":
            raise OptionError(
                f"save cannot write an array of {value.dtype}. Save arrays of numbers."
            )
        if id(value) in self.written:
            return self.written[id(value)][1]
        kind = value.dtype.name
        start = self.sizes.get(kind, 0)
        self.rows.setdefault(kind, []).append(np.ascontiguousarray(value).ravel())
        self.sizes[kind] = start + value.size
        made = {"array": [kind, start, list(value.shape)]}
        self.written[id(value)] = value, made
        return made

    def _number(self, system: FilippovSystem) -> int:
        for k, known in enumerate(self.systems):
            if known is system:
                return k
        self.systems.append(system)
        return len(self.systems) - 1


def _packed(result: Any) -> bytes:
    writer = _Writer()
    tree = writer.tree(result)
    try:
        systems = [writer.tree(instruction_form.written(s)) for s in writer.systems]
    except NonsmoothError as error:
        raise OptionError(f"save: {error}") from error
    head = json.dumps({"format": _FORMAT, "result": tree, "systems": systems}).encode()
    return archive.packed(head, {k: np.concatenate(rows) for k, rows in writer.rows.items()})


# Reading -----------------------------------------------------------------------------------------


def _read(path: str | bytes | os.PathLike[Any]) -> Any:
    tree, rows = archive.unpacked(os.fsdecode(path))
    head = json.loads(tree)
    if head["format"] != _FORMAT:
        raise ValueError(f"format {head['format']}, not {_FORMAT}")
    reader = _Reader(rows)
    systems = [instruction_form.read_system(reader.value(s)) for s in head["systems"]]
    reader.systems = systems
    result = reader.value(head["result"])
    if not isinstance(result, Savable):
        raise ValueError(f"a {type(result).__name__} is no result")
    Validator().require(result)
    return result


class _Reader:
    """Values from a tree and rows of numbers, of which each is in one array."""

    def __init__(self, rows: Mapping[str, NDArray[Any]]):
        self.rows = rows
        self.left = {kind: row.size for kind, row in rows.items()}
        self.arrays: dict[tuple[Any, ...], NDArray[Any]] = {}  # one array may be in several places
        self.systems: list[FilippovSystem] = []

    def value(self, tree: Any) -> Any:
        """Return the value of a part of the tree."""
        if isinstance(tree, list):
            return [self.value(part) for part in tree]
        if not isinstance(tree, dict):
            return tree
        match tree:
            case {"array": [str(kind), int(start), list(shape)], **rest} if not rest:
                return self._array(kind, start, shape)
            case {"tuple": list(parts), **rest} if not rest:
                return tuple(self.value(part) for part in parts)
            case {"mapping": list(pairs), **rest} if not rest:
                return {self.value(key): self.value(part) for key, part in pairs}
            case {"status": int(status), **rest} if not rest:
                return Status(status)
            case {"system": int(number), **rest} if not rest and number >= 0:
                return self.systems[number]
            case {"of": str(name), "fields": dict(fields), **rest} if not rest:
                return self._object(CLASSES[name], fields)
        raise ValueError(f"{', '.join(map(repr, tree))} in the tree")

    def _array(self, kind: str, start: int, shape: list[Any]) -> NDArray[Any]:
        if not all(type(k) is int and 0 <= k <= _LONGEST for k in shape):
            raise ValueError(f"an array of shape {shape}")
        if (kind, start, *shape) in self.arrays:
            return self.arrays[kind, start, *shape]
        size = math.prod(shape)
        self.left[kind] -= size
        if start < 0 or start + size > self.rows[kind].size or self.left[kind] < 0:
            raise ValueError("arrays that are larger than what the file holds")
        made = self.rows[kind][start : start + size].reshape(shape).copy()
        self.arrays[kind, start, *shape] = made
        return made

    def _object(self, cls: type[Any], fields: dict[str, Any]) -> Any:
        if {*fields} != {field.name for field in dataclasses.fields(cls)}:
            raise ValueError(f"a {cls.__name__} with other fields")
        return cls(**{name: self.value(part) for name, part in fields.items()})
