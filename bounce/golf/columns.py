"""Columns of numbers from a CSV file, a table or a list of rows, with units in their names."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..units import MINUS, UNITS

Array = NDArray[np.float64]

_COUNTS = {2: "two", 3: "three"}


class DataError(ns.NonsmoothError, ValueError):
    """Measurements that cannot be read: missing columns, unknown units, rows that are no bounces."""


class Columns(NamedTuple):
    """Columns that were asked for.

    Attributes
    ----------
    values : dict of str to ndarray (n,)
        By name, in m/s, rad/s and rad, or as they are where there are no units.
    si : bool
        Whether they have units.
    titles : list of str
        Of every column, as received.
    units : dict of str to str or None
        Of the columns that were asked for, as received.
    """

    values: dict[str, Array]
    si: bool
    titles: list[str]
    units: dict[str, str | None]


def read_columns(data: Any, kinds: Mapping[str, str]) -> Columns:
    """Read the columns ``name [unit]`` of the names asked for; others are ignored.

    Parameters
    ----------
    data : path, mapping of str to array_like, table or sequence of dicts
        A CSV file with names in its first row, columns, or rows.
    kinds : mapping of str to str
        Names, in lower case with underscores, and what they measure: a key of ``UNITS``.

    Returns
    -------
    Columns

    Raises
    ------
    DataError

    Examples
    --------
    >>> read_columns({"Speed (km/h)": [36, 72], "note": "ab"}, {"speed": "speed"}).values["speed"]
    array([10., 20.])
    """
    table = _table(data)
    read = [(*_title(title), str(title), values) for title, values in table]
    read = [column for column in read if column[0] in kinds]
    _require_each_once([(name, title) for name, _, title, _ in read])
    columns: dict[str, Array] = {}
    si, without = False, list[str]()
    for name, unit, title, values in read:
        columns[name] = _numbers(values, title)
        if unit is None:
            without.append(title)
            continue
        known = UNITS[kinds[name]]
        if unit not in known:
            raise DataError(
                f"column {title!r}: expected a unit among {list(known)}, received {unit!r}."
            )
        si = (
            si or kinds[name] != "angle"
        )  # the angles of a dimensionless model may say what they are
        columns[name] = columns[name] * known[unit]
    if si and without:
        raise DataError(
            f"data: expected units in all columns or in none, received none in {without}. Write "
            "'speed [m/s]', 'spin [rpm]'."
        )
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise DataError(f"data: expected columns of one length, received {lengths}.")
    if columns and not next(iter(lengths.values())):
        raise DataError("data: expected at least one row, received none.")
    units = {name: unit for name, unit, _, _ in read}
    return Columns(columns, si, [str(title) for title, _ in table], units)


def _title(title: Any) -> tuple[str, str | None]:
    """Name and unit of ``name [unit]``; names in lower case, with underscores."""
    match = re.fullmatch(r"\s*(.*?)\s*(?:[\[(](.*)[\])])?\s*", str(title), re.DOTALL)
    assert match is not None
    name = re.sub(r"[\s-]+", "_", match[1].strip().lower())
    return name, None if match[2] is None else match[2].strip()


def _require_each_once(columns: list[tuple[str, str]]) -> None:
    """Refuse two columns of one name: whichever were taken, it could be the wrong one."""
    for name, _ in columns:
        titles = [title for other, title in columns if other == name]
        if len(titles) > 1:
            raise DataError(
                f"data: expected one column {name!r}, received {_COUNTS.get(len(titles), len(titles))}: "
                f"{', '.join(map(repr, titles))}. Remove or rename all but one."
            )


def _table(data: Any) -> list[tuple[Any, Any]]:
    """Titles and columns; a title may occur twice."""
    if isinstance(data, str | Path):
        return _read_csv(Path(data))
    if isinstance(data, Mapping):
        return list(data.items())
    if isinstance(data, Sequence) and all(isinstance(row, Mapping) for row in data) and len(data):
        titles = list(dict.fromkeys(title for row in data for title in row))
        return [(title, [row.get(title, math.nan) for row in data]) for title in titles]
    try:  # a data frame iterates over its columns
        return [(title, np.asarray(data[title])) for title in data]
    except (TypeError, KeyError, IndexError, ValueError):
        raise DataError(
            "data: expected a path to a CSV file, a mapping of columns, a table or a list of dicts, "
            f"received {type(data).__name__}."
        ) from None


def _read_csv(path: Path) -> list[tuple[str, list[str]]]:
    try:  # a path with NUL in it is a ValueError
        text = path.read_text(encoding="utf-8-sig")
        lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
        rows = list(csv.reader(lines, strict=True))
    except (OSError, ValueError, csv.Error) as error:
        raise DataError(
            f"data: expected a readable CSV file, received {str(path)!r}: {error}."
        ) from error
    if not rows:
        raise DataError(f"data: expected names and rows in {path}, received an empty file.")
    titles = rows[0]
    if len(titles) == 1 and (mark := re.search("[;\t|]", titles[0])):
        raise DataError(
            f"{path.name}: expected commas between the columns, received {mark[0]!r} in {titles[0]!r}. Save "
            "it with commas, and with points in numbers."
        )
    for number, row in enumerate(rows[1:], start=1):
        if len(row) != len(titles):
            raise DataError(
                f"{path.name}, row {number}: expected {len(titles)} values, received {len(row)}."
            )
    return [(title, [row[k] for row in rows[1:]]) for k, title in enumerate(titles)]


def _numbers(values: Iterable[Any], title: Any) -> Array:
    result = []
    for row, value in enumerate(values, start=1):
        text = value.strip().translate(MINUS) if isinstance(value, str) else value
        try:
            result.append(float(text) if text not in ("", None) else math.nan)
        except (TypeError, ValueError):
            raise DataError(
                f"column {title!r}, row {row}: expected a number, received {value!r}."
            ) from None
    return np.array(result, dtype=float)
