"""Saving of results, exact to the last bit, in files that also hold their systems.

A file is an archive of NumPy arrays, one for each type of number, and of a tree in JSON that refers to parts
of them. It has no pickle. A result consists of numbers, texts, arrays, sequences, mappings, systems, statuses
and the classes registered here.
"""

from __future__ import annotations

import dataclasses
import io
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self, TypeVar
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from ..model import FilippovSystem, LiftedSwitch, OptionError
from . import files
from .status import Status

_FORMAT = 1
_FIELDS: dict[str, type[Any]] = {}
C = TypeVar("C", bound=type[Any])


def savable(cls: C) -> C:
    """Register a dataclass whose instances may be part of a saved result."""
    _FIELDS[cls.__name__] = cls
    return cls


class Savable:
    """A result that can be written to a file; :func:`load` reads it."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        savable(cls)

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
        try:
            files.replace(Path(path), _packed(self))
        except OSError as error:
            raise OptionError(
                f"path {os.fspath(path)!r} cannot be written ({error}). Choose another folder."
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
        A file that you trust: CasADi reads the system in it.

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
    try:
        with np.load(path, allow_pickle=False) as data:
            arrays = {name: data[name] for name in data.files}
        head = json.loads(arrays.pop("tree").tobytes())
        if head["format"] != _FORMAT:
            raise ValueError(f"format {head['format']}")
        systems = [_system(_decoded(s, arrays, [])) for s in head["systems"]]
        return _decoded(head["result"], arrays, systems)
    except OSError as error:
        reason: Exception = error
    except (ValueError, KeyError, TypeError, IndexError, EOFError, AttributeError) as error:
        reason = error
    except (RuntimeError, BadZipFile, RecursionError) as error:  # of CasADi, of the archive
        reason = error
    raise OptionError(
        f"path {os.fspath(path)!r} is no file written by save ({type(reason).__name__}: {reason}). "
        "Save the result again."
    ) from reason


# Writing -----------------------------------------------------------------------------------------


class _Writer:
    """Conversion of values to a tree; arrays go end to end into one row for each type."""

    def __init__(self) -> None:
        self.rows: dict[str, list[NDArray[Any]]] = {}
        self.sizes: dict[str, int] = {}
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
        if name in _FIELDS and dataclasses.is_dataclass(value):
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
        kind = value.dtype.name
        start = self.sizes.get(kind, 0)
        self.rows.setdefault(kind, []).append(np.ascontiguousarray(value).ravel())
        self.sizes[kind] = start + value.size
        return {"array": [kind, start, list(value.shape)]}

    def _number(self, system: FilippovSystem) -> int:
        for k, known in enumerate(self.systems):
            if known is system:
                return k
        self.systems.append(system)
        return len(self.systems) - 1


def _packed(result: Any) -> bytes:
    writer = _Writer()
    tree = writer.tree(result)
    systems = [writer.tree(s.__getstate__()) for s in writer.systems]
    head = json.dumps({"format": _FORMAT, "result": tree, "systems": systems}).encode()
    arrays: dict[str, Any] = {k: np.concatenate(rows) for k, rows in writer.rows.items()}
    memory = io.BytesIO()
    np.savez_compressed(memory, tree=np.frombuffer(head, np.uint8), **arrays)
    return memory.getvalue()


# Reading -----------------------------------------------------------------------------------------


def _system(state: dict[str, Any]) -> FilippovSystem:
    system = FilippovSystem.__new__(FilippovSystem)
    system.__setstate__(state)
    return system


def _decoded(tree: Any, arrays: Mapping[str, NDArray[Any]], systems: list[FilippovSystem]) -> Any:
    again = lambda part: _decoded(part, arrays, systems)
    if isinstance(tree, list):
        return [again(part) for part in tree]
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        kind, start, shape = tree["array"]
        size = int(np.prod(shape, dtype=np.int64))
        return arrays[kind][start : start + size].reshape(shape).copy()
    if "tuple" in tree:
        return tuple(again(part) for part in tree["tuple"])
    if "mapping" in tree:
        return {again(key): again(value) for key, value in tree["mapping"]}
    if "status" in tree:
        return Status(tree["status"])
    if "system" in tree:
        return systems[tree["system"]]
    cls = _FIELDS[tree["of"]]
    made = object.__new__(cls)
    for name, part in tree["fields"].items():
        object.__setattr__(made, name, again(part))
    return made


savable(LiftedSwitch)
