"""Read columns of numbers, with units in their names, from a CSV file, a table or a list of rows."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ...units import MINUS, UNITS

Array = NDArray[np.float64]


#: Bytes of a CSV file that are read; a device may have no end.
LARGEST = 1 << 28


#: Units as launch monitors write them, apart from capitals.
_UNITS = {"°": "deg", "degrees": "deg", "yards": "yd", "yds": "yd"}
_UNITS |= {unit: unit for known in UNITS.values() for unit in known}


class DataError(ns.NonsmoothError, ValueError):
    """Measurements that cannot be read: missing columns, unknown units, rows that are no bounces."""


class Columns(NamedTuple):
    """The requested columns, in SI units where they have units; NaN where a cell is no number."""

    values: dict[str, Array]
    si: bool
    titles: list[str]  # of every column, as received
    units: dict[str, str | None]
    wrong_rows: dict[int, str]  # what is wrong with a row, by its number from 1


class Row(NamedTuple):
    """The numbers of a row, in the units of the columns, or what is wrong with it; and its other cells."""

    values: dict[str, float]
    error: str
    others: dict[str, str]


class Rows(NamedTuple):
    """Rows of a file, the titles of all its columns, and the units of the requested ones."""

    rows: list[Row]
    titles: list[str]
    units: dict[str, str | None]


def read_columns(data: Any, kinds: Mapping[str, str]) -> Columns:
    """Read the columns ``name [unit]`` of the names in ``kinds``, which gives what each measures."""
    table = _table(data)
    read = [(*_title(title), str(title), values) for title, values in table]
    read = [column for column in read if column[0] in kinds]
    _require_each_once([(name, title) for name, _, title, _ in read])
    units = {name: unit for name, unit, _, _ in read}
    si = _in_si([(name, unit, title) for name, unit, title, _ in read], kinds)
    columns: dict[str, Array] = {}
    wrong_rows: dict[int, str] = {}
    for name, unit, title, values in read:
        columns[name] = _numbers(values, title, wrong_rows)
        if unit is not None:
            columns[name] = columns[name] * UNITS[kinds[name]][unit]
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise DataError(f"data: the columns have different lengths, {lengths}. Fill or cut them.")
    if columns and not next(iter(lengths.values())):
        raise DataError("data: the table has no rows. Give at least one.")
    return Columns(columns, si, [str(title) for title, _ in table], units, wrong_rows)


def read_rows(
    path: str,
    kinds: Mapping[str, str],
    headings: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> Rows:
    """Read the columns ``name [unit]`` of a file row by row, also under other headings; a bad row keeps its error."""
    titles, cells = _csv(Path(path))
    read = [(*_title(title), k) for k, title in enumerate(titles)]
    positions = [(name.replace("_", ""), unit, k) for name, unit, k in read]
    there = [name for name, _, _ in positions]
    ways = {
        name: [one.replace("_", "") for one in (name, *headings.get(name, ()))] for name in kinds
    }
    known = {one: name for name, own in ways.items() for one in [o for o in own if o in there][:1]}
    positions = [(known[name], unit, k) for name, unit, k in positions if name in known]
    rest = {titles[k]: k for k in range(len(titles)) if k not in [place[2] for place in positions]}
    _require_each_once([(name, titles[k]) for name, _, k in positions])
    _in_si([(name, unit, titles[k]) for name, unit, k in positions], kinds)
    if not cells:
        raise DataError("data: the table has no rows. Give at least one.")
    rows = []
    for row in cells:
        others = {title: row[k] if k < len(row) else "" for title, k in rest.items()}
        try:
            _require_length(row, titles)
            rows.append(Row({n: _number(row[k], titles[k]) for n, _, k in positions}, "", others))
        except ValueError as wrong:
            rows.append(Row({}, str(wrong), others))
    return Rows(rows, titles, {name: unit for name, unit, _ in positions})


def _in_si(read: list[tuple[str, str | None, str]], kinds: Mapping[str, str]) -> bool:
    """Whether the columns (name, unit, title) have units; all of them must, or none."""
    si, without = False, list[str]()
    for name, unit, title in read:
        if unit is None:
            without.append(title)
            continue
        known = UNITS[kinds[name]]
        if unit not in known:
            raise DataError(
                f"column {title!r}: expected a unit among {list(known)}, received {unit!r}."
            )
        # the angles of a dimensionless model may say what they are
        si = si or kinds[name] != "angle"
    if si and without:
        raise DataError(
            f"data: the columns {without} have no unit, but others have one. Write 'speed [m/s]', "
            "'spin [rpm]'."
        )
    return si


def _title(title: Any) -> tuple[str, str | None]:
    """Name and unit of ``name [unit]``; names in lower case, with underscores."""
    match = re.fullmatch(r"\s*(.*?)\s*(?:[\[(](.*)[\])])?\s*", str(title), re.DOTALL)
    assert match is not None
    name = re.sub(r"[\s.-]+", "_", match[1].strip().lower())
    unit = None if match[2] is None else match[2].strip()
    return name, _UNITS.get(unit.lower(), unit) if unit else unit


def _require_each_once(columns: list[tuple[str, str]]) -> None:
    for name, _ in columns:
        titles = [title for other, title in columns if other == name]
        if len(titles) > 1:
            raise DataError(
                f"data: {len(titles)} columns are named {name!r}: {', '.join(map(repr, titles))}. Remove "
                "or rename all but one."
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
    titles, rows = _csv(path)
    for number, row in enumerate(rows, start=1):
        try:
            _require_length(row, titles)
        except ValueError as wrong:
            raise DataError(f"{path.name}, row {number}: {wrong}.") from None
    return [(title, [row[k] for row in rows]) for k, title in enumerate(titles)]


def _csv(path: Path) -> tuple[list[str], list[list[str]]]:
    """Names and rows of a file."""
    try:  # a path with NUL in it is a ValueError
        with path.open("rb") as file:
            content = file.read(LARGEST + 1)
        if len(content) > LARGEST:
            raise ValueError(f"it has more than {LARGEST} bytes")
        text = content.decode("utf-8-sig")
        lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
        rows = list(csv.reader(lines, strict=True))
    except (OSError, ValueError, csv.Error) as error:
        raise DataError(
            f"data: expected a readable CSV file, received {str(path)!r}: {error}."
        ) from error
    if not rows:
        raise DataError(f"data: {path} is empty. Write names in its first row, then rows.")
    titles = rows[0]
    if len(titles) == 1 and (mark := re.search("[;\t|]", titles[0])):
        raise DataError(
            f"{path.name}: {titles[0]!r} has {mark[0]!r} between the columns. Save it with commas, and with "
            "points in numbers."
        )
    if (
        len(rows) > 1
        and any(rows[1])
        and all(re.fullmatch(r"\s*(\[.*\])?\s*", own) for own in rows[1])
    ):
        titles, rows = (
            [f"{a} {b}".strip() for a, b in zip_longest(*rows[:2], fillvalue="")],
            rows[1:],
        )
    return titles, rows[1:]


def _require_length(row: list[str], titles: list[str]) -> None:
    if len(row) != len(titles):
        raise ValueError(f"expected {len(titles)} values, received {len(row)}")


def _number(value: Any, title: str) -> float:
    text = value.strip().translate(MINUS) if isinstance(value, str) else value
    try:
        return float(text) if text not in ("", None) else math.nan
    except (TypeError, ValueError):
        raise ValueError(f"expected a number, received {value!r} in column {title!r}") from None


def _numbers(values: Iterable[Any], title: str, wrong_rows: dict[int, str]) -> Array:
    """The numbers of a column; NaN, and an entry in ``wrong_rows``, where a cell is no number."""
    result = []
    for row, value in enumerate(values, start=1):
        try:
            result.append(_number(value, title))
        except ValueError as wrong:
            wrong_rows.setdefault(row, str(wrong))
            result.append(math.nan)
    return np.array(result, dtype=float)
