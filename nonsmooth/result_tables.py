"""Results as DataFrames of pandas and Datasets of xarray, which are imported on use."""

from __future__ import annotations

import dataclasses
import importlib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from itertools import product
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from .model import OptionError
from .notebook import shown_fields

#: Attributes that are states.
_STATES = ("point", "points", "start", "starts", "x", "x0", "x_after")
#: Axes whose labels name columns.
_PLAIN = {"state", "start", "parameter"}
#: Arrays of a result that are longer are tables of their own.
_LONG = 12


def library(name: str, what: str, extra: str = "tables") -> Any:
    """Import an optional library."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise OptionError(
            f"{what} needs {name}, which cannot be imported ({error}). Install it with "
            f"python -m pip install 'nonsmooth-dynamics[{extra}]'."
        ) from error


@dataclass(frozen=True)
class ResultTable:
    """Columns over the same rows.

    Attributes
    ----------
    index : mapping
        Axes of the rows: the name of each, and its number of rows, its coordinate, or the name of that and
        the coordinate.
    columns : mapping
        An array over the axes of the index, and over ``"state"`` if it has one more; or the name of that
        axis and the array.
    labels : mapping
        Labels of the axes that are not rows.
    """

    index: Mapping[str, Any]
    columns: Mapping[str, Any]
    labels: Mapping[str, Sequence[Any]] = field(default_factory=dict)

    def coordinates(self) -> list[tuple[str, str, Any]]:
        """Axis, name and values of each axis of the rows; None for a number of rows."""
        found = []
        for axis, own in self.index.items():
            pair = isinstance(own, tuple) and np.ndim(own[1])  # not the labels of two rows
            name, values = own if pair else (axis, own)
            found.append((axis, name, None if isinstance(values, int) else np.asarray(values)))
        return found

    def variables(self) -> Iterable[tuple[str, tuple[str, ...], NDArray[Any]]]:
        """Name, further axes and values of each column; a name that an axis has gets an underscore."""
        rows = len(self.index)
        for given, column in self.columns.items():
            axis, values = column if isinstance(column, tuple) else ("state", column)
            array, name = np.asarray(values), given + "_" * (given in self.index)
            more = array.ndim - rows
            yield name, (axis,) if more == 1 else tuple(f"{axis}_{k}" for k in range(more)), array

    def frame(self, pandas: Any) -> Any:
        """The DataFrame: a column for each entry along further axes."""
        axes, data = self.coordinates(), dict[str, Any]()
        sizes = [own if isinstance(own, int) else len(v) for own, (_, _, v) in
                 zip(self.index.values(), axes, strict=True)]  # fmt: skip
        single = {name for name, more, _ in self.variables() if not more}
        for name, more, array in self.variables():
            if not more:
                data[name] = array.ravel()
                continue
            shape = array.shape[len(sizes) :]
            flat = array.reshape(math.prod(sizes), math.prod(shape))
            labels = [self.labels.get(a, range(s)) for a, s in zip(more, shape, strict=True)]
            plain = {*more} <= self.labels.keys() & _PLAIN
            for label, column in zip(product(*labels), flat.T, strict=True):
                key = "_".join(map(str, label))
                rest = f"{key}_{name.removeprefix('x_')}" if key in {*data, *single} else key
                data[rest if plain else f"{name}_{key}"] = column
        index = None
        if len(axes) > 1:
            values = [
                range(s) if v is None else v for s, (_, _, v) in zip(sizes, axes, strict=True)
            ]
            index = pandas.MultiIndex.from_product(values, names=[name for _, name, _ in axes])
        elif axes and axes[0][2] is not None:
            index = pandas.Index(axes[0][2], name=axes[0][1])
        return pandas.DataFrame(data, index=index)

    def put(self, variables: dict[str, Any], coordinates: dict[str, Any], own: str) -> None:
        """Add the columns to those of a Dataset, with the name of one of them before theirs."""
        for axis, name, values in self.coordinates():
            if values is not None:
                coordinates[name if name == axis or not own else f"{own}_{name}"] = (axis, values)
        for name, more, array in self.variables():
            values = array.astype(str) if array.dtype == object else array
            full = name if not own or _singular(name) == own else f"{own}_{name}"
            variables[full] = ((*self.index, *more), values)
            coordinates |= {a: list(self.labels[a]) for a in more if a in self.labels}


def stacked(
    results: Sequence[Any], index: Mapping[str, Any], states: Sequence[str] = ()
) -> ResultTable:
    """A row for each of several results: short attributes that all of them have (:attr:`Tabular.row`)."""
    columns = dict[str, Any]()
    rows = [dict(_flat(result)) for result in results]
    for name in rows[0] if rows else ():
        values: list[Any] = [row.get(name) for row in rows]
        if any(v is None for v in values) or len({np.shape(v) for v in values}) > 1:
            continue
        if np.ndim(values[0]) > 1 or np.size(values[0]) > _LONG:
            continue
        of_states = name in _STATES and np.size(values[0]) == len(states)
        columns[name] = ("state" if of_states else f"{_singular(name)}_number", values)
    return ResultTable(index, columns, {"state": states} if states else {})


def _row(result: Any) -> Sequence[str]:
    """Attributes of a result that are in its row: those it names, or its public fields."""
    names: Sequence[str] = getattr(result, "row", ())
    return names or [f.name for f in dataclasses.fields(result) if not f.name.startswith("_")]


def _flat(result: Any) -> Iterable[tuple[str, Any]]:
    """Numbers, texts and arrays of a result by name, those of mappings by their keys."""
    for name in _row(result):
        value = getattr(result, name, None)
        for key, own in value.items() if isinstance(value, Mapping) else ((name, value),):
            yield str(key), _plain(own)


def _plain(value: Any) -> Any:
    """A number, a text or an array of numbers; None for what is neither."""
    if isinstance(value, (Enum, str)):
        return str(value)
    if isinstance(value, (list, tuple)):
        value = (
            np.array(value) if value and all(isinstance(v, (int, float)) for v in value) else None
        )
    if not isinstance(value, (bool, int, float, complex, np.generic, np.ndarray)):
        return None
    return value if np.asarray(value).dtype.kind in "biufc" else None


def _singular(name: str) -> str:
    """A name without its plural."""
    if name.endswith("ies"):
        return name[:-3] + "y"
    return name[:-1] if name.endswith("s") and not name.endswith(("us", "is")) else name


def joined(
    name: str, parts: Sequence[Mapping[str, Any]], states: Sequence[str] = ()
) -> ResultTable:
    """The points of several curves, with the number of the curve from 0."""
    columns = {
        key: np.concatenate([part[key] for part in parts]) for key in (parts[0] if parts else ())
    }
    sizes = [len(next(iter(part.values()))) for part in parts]
    columns = {name: np.repeat(np.arange(len(parts)), sizes), **columns}
    return ResultTable({"point": sum(sizes)}, columns, {"state": states} if len(states) else {})


class Tabular:
    """A result that becomes tables of pandas and data sets of xarray."""

    #: Attributes in its row of a table; the public fields if there are none.
    row: ClassVar[tuple[str, ...]] = ()

    def _tables(self) -> dict[str, ResultTable]:
        """Tables by name, the first of which is the usual one."""
        names = getattr(getattr(self, "system", self), "state_names", ())
        tables = {"values": stacked([self], {"result": 1}, names)}
        for name, array in _flat(self):
            if np.ndim(array) > 1 or np.size(array) > _LONG:
                tables[name] = ResultTable(
                    {f"{name}_row": len(array)}, {name: (f"{name}_column", array)}
                )
        return tables

    def _attributes(self) -> dict[str, Any]:
        """What is true of a whole table: fields with one number or text, itinerary, parameters."""
        names = (*_row(self), "itinerary")
        given = getattr(self, "parameters", None)
        found = {name: _plain(getattr(self, name, None)) for name in names}
        found |= given if isinstance(given, Mapping) else {}
        return {
            k: np.asarray(v).item() for k, v in found.items() if v is not None and not np.ndim(v)
        }

    def to_pandas(self, what: str = "") -> Any:
        """Return a DataFrame with a row for each point, run or event of the result.

        Arrays over the states have a column for each state, under its name; of a second one, such as
        ``x_after``, the columns are ``v_after``.

        Parameters
        ----------
        what : str, optional
            Which table, such as ``"points"``, ``"events"`` or ``"samples"`` of a run. A name that the result does
            not have is answered with those that it has; the first is the default.

        Returns
        -------
        pandas.DataFrame
            Its ``attrs`` have the status, itinerary, parameters and other single values.

        Raises
        ------
        OptionError
            pandas is not installed; the result has no such table.
        """
        pandas, tables = library("pandas", "to_pandas"), self._tables()
        if what and what not in tables:
            raise OptionError(
                f"to_pandas: what is {what!r}. {type(self).__name__} has {', '.join(map(repr, tables))}"
                f"{self._missing(what)}."
            )
        frame = tables[what or next(iter(tables))].frame(pandas)
        frame.attrs.update(self._attributes())
        return frame

    def _missing(self, what: str) -> str:
        """How to compute a table that this result does not have."""
        return ""

    def to_xarray(self) -> Any:
        """Return a Dataset with the arrays of all tables of :meth:`to_pandas` and named axes.

        Returns
        -------
        xarray.Dataset
            Variables of other tables than the first have its name before theirs, such as ``sample_x``.

        Raises
        ------
        OptionError
            xarray is not installed.
        """
        xarray, tables = library("xarray", "to_xarray"), self._tables()
        variables, coordinates = dict[str, Any](), dict[str, Any]()
        for k, (what, one) in enumerate(tables.items()):
            one.put(variables, coordinates, _singular(what) if k else "")
        return xarray.Dataset(variables, coordinates, attrs=self._attributes())


def add_views(names: Mapping[str, object], exported: Iterable[str]) -> None:
    """Let exported results show their fields in notebooks and become tables, unless they have their own ways."""
    for name in exported:
        kind = names.get(name)
        if isinstance(kind, type) and dataclasses.is_dataclass(kind):
            for method in ("_tables", "_attributes", "_missing", "to_pandas", "to_xarray"):
                if not hasattr(kind, method):
                    setattr(kind, method, getattr(Tabular, method))
            if not hasattr(kind, "_repr_html_"):
                kind._repr_html_ = shown_fields  # type: ignore[attr-defined]
