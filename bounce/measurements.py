"""Measured bounces from a CSV file, a table or a list, with units in the names of the columns.

Columns are ``name [unit]``. A landing is ``xdot, ydot, omega`` or ``speed, angle, spin`` (angle of
descent from the ground); a lift-off is the same with ``lift_off_`` before it, any part of it that
was measured (speed and angle together; its angle is from the positive x axis, above 90 degrees for
a ball that bounces back). Without units the numbers are those of a dimensionless model. Other
columns are ignored.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from .units import GOLF, Ball

Array = NDArray[np.float64]

#: Factor of each unit to m/s, rad/s or rad.
UNITS: dict[str, dict[str, float]] = {
    "speed": {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.44704, "ft/s": 0.3048},
    "spin": {
        "rad/s": 1.0,
        "rpm": 2 * math.pi / 60,
        "rev/s": 2 * math.pi,
        "deg/s": math.pi / 180,
    },
    "angle": {"rad": 1.0, "deg": math.pi / 180},
}
_KIND = dict(xdot="speed", ydot="speed", speed="speed", omega="spin", spin="spin", angle="angle")
COMPONENTS = ("xdot", "ydot", "omega")
_POLAR = ("speed", "angle", "spin")
_PREFIX = "lift_off_"


class DataError(ns.NonsmoothError, ValueError):
    """Measurements that cannot be read: missing columns, unknown units, rows that are no bounces."""


@dataclass(frozen=True)
class Measurements:
    """Bounces as speeds: spins are surface speeds (spin times radius).

    Attributes
    ----------
    landing : ndarray (n, 3)
        xdot, ydot and the spin's surface speed: in m/s, or as the dimensionless model has them.
    lift_off : dict of str to ndarray (n,)
        What was measured of xdot, ydot, omega.
    rows : ndarray of int (n,)
        Numbers of the rows, from 1 (for a file, the first row under the names).
    si : bool
        Whether the columns had units.
    left_out : tuple of (int, str)
        Rows that are not here and why.
    """

    landing: Array
    lift_off: dict[str, Array]
    rows: NDArray[np.int_]
    si: bool
    left_out: tuple[tuple[int, str], ...]

    def keep(self, rows: NDArray[np.bool_], reasons: Mapping[int, str]) -> Measurements:
        """Return a part of the rows; ``reasons`` says why the others are left out."""
        return Measurements(
            self.landing[rows],
            {name: values[rows] for name, values in self.lift_off.items()},
            self.rows[rows],
            self.si,
            tuple(sorted([*self.left_out, *reasons.items()])),
        )


def read_measurements(data: Any, ball: Ball = GOLF, *, bad_rows: str = "raise") -> Measurements:
    """Read landings and lift-offs.

    Parameters
    ----------
    data : path, mapping of str to array_like, table or sequence of dicts
        A CSV file with names in its first row, columns, or rows.
    ball : Ball, optional
        Whose radius turns spins into surface speeds.
    bad_rows : {"raise", "leave out"}
        What to do with rows that have a NaN or no landing: name them in an error, or in
        ``left_out``.

    Returns
    -------
    Measurements

    Raises
    ------
    DataError

    Examples
    --------
    >>> rows = [{"speed [m/s]": 20, "angle [deg]": 30, "spin [rpm]": 3000,
    ...          "lift_off_xdot [m/s]": 9.0, "lift_off_spin [rpm]": -1500}]
    >>> bounces = read_measurements(rows)
    >>> bounces.landing.round(3), {name: v.round(3).tolist() for name, v in bounces.lift_off.items()}
    (array([[ 17.321, -10.   ,   6.703]]), {'xdot': [9.0], 'omega': [-3.351]})
    """
    if bad_rows not in ("raise", "leave out"):
        raise ns.OptionError(f"bad_rows: expected 'raise' or 'leave out', received {bad_rows!r}.")
    columns, units = _columns(data)
    si = bool(units)
    radius = ball.radius if si else 1.0
    landing, lift_off = _landing(columns, radius), _lift_off(columns, radius)
    rows = np.arange(1, len(landing) + 1)
    reasons = _bad_rows(columns, landing)
    if reasons and bad_rows == "raise":
        listed = "; ".join(f"row {row}: {why}" for row, why in list(reasons.items())[:8])
        more = f" and {len(reasons) - 8} more" if len(reasons) > 8 else ""
        raise DataError(
            f"data: expected complete bounces, received {listed}{more}. Correct them, or leave them "
            "out with bad_rows='leave out'."
        )
    everything = Measurements(landing, lift_off, rows, si, ())
    good = np.array([row not in reasons for row in rows], dtype=bool)
    return everything.keep(good, reasons)


def _bad_rows(columns: Mapping[str, Array], landing: Array) -> dict[int, str]:
    reasons: dict[int, str] = {}
    for row, (_, ydot, _) in enumerate(landing, start=1):
        bad = [name for name, values in columns.items() if not math.isfinite(values[row - 1])]
        if bad:
            reasons[row] = f"no number in {', '.join(bad)}"
        elif ydot >= 0.0:
            reasons[row] = f"it does not approach the ground (ydot = {ydot:g})"
    return reasons


def _columns(data: Any) -> tuple[dict[str, Array], set[str]]:
    """Columns that we know, in m/s, rad/s and rad, and the units seen."""
    table = _table(data)
    columns: dict[str, Array] = {}
    units: set[str] = set()
    without: list[str] = []
    for title, values in table.items():
        match = re.fullmatch(r"\s*(.*?)\s*(?:[\[(](.*)[\])])?\s*", str(title))
        assert match is not None
        name = re.sub(r"[\s-]+", "_", match[1].strip().lower())
        kind = _KIND.get(name.removeprefix(_PREFIX))
        if kind is None:
            continue
        if name in columns:
            raise DataError(f"data: expected one column {name!r}, received two.")
        numbers = _numbers(values, title)
        unit = match[2]
        if unit is None:
            without.append(str(title))
            columns[name] = numbers
            continue
        unit = unit.strip()
        if unit not in UNITS[kind]:
            raise DataError(
                f"column {title!r}: expected a unit among {list(UNITS[kind])}, received {unit!r}."
            )
        units |= {unit} if kind != "angle" else set()
        columns[name] = numbers * UNITS[kind][unit]
    if units and without:
        raise DataError(
            f"data: expected units in all columns or in none, received none in {without}. Write "
            "'speed [m/s]', 'spin [rpm]'."
        )
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise DataError(f"data: expected columns of one length, received {lengths}.")
    if columns and not next(iter(lengths.values())):
        raise DataError("data: expected at least one row, received none.")
    _check_names(columns, list(map(str, table)))
    return columns, units


def _check_names(columns: Mapping[str, Array], received: list[str]) -> None:
    for names in (COMPONENTS, _POLAR):
        if all(name in columns for name in names):
            break
    else:
        raise DataError(
            f"data: expected columns {list(COMPONENTS)} or {list(_POLAR)} for the landing, received "
            f"{received}. Units go in brackets: 'speed [m/s]'."
        )
    measured = [name for name in columns if name.startswith(_PREFIX)]
    if not measured:
        raise DataError(
            f"data: expected columns of the lift-off, such as '{_PREFIX}speed [m/s]', "
            f"'{_PREFIX}angle [deg]' and '{_PREFIX}spin [rpm]', received {received}."
        )
    pair = {f"{_PREFIX}speed", f"{_PREFIX}angle"} & set(measured)
    if len(pair) == 1:
        raise DataError(
            f"data: expected '{_PREFIX}speed' and '{_PREFIX}angle' together, received only "
            f"{pair.pop()!r}."
        )


def _table(data: Any) -> dict[Any, Any]:
    if isinstance(data, str | Path):
        return _read_csv(Path(data))
    if isinstance(data, Mapping):
        return dict(data)
    if isinstance(data, Sequence) and all(isinstance(row, Mapping) for row in data) and len(data):
        titles = list(dict.fromkeys(title for row in data for title in row))
        return {title: [row.get(title, math.nan) for row in data] for title in titles}
    try:  # a data frame iterates over its columns
        return {title: np.asarray(data[title]) for title in data}
    except (TypeError, KeyError, IndexError, ValueError):
        raise DataError(
            "data: expected a path to a CSV file, a mapping of columns, a table or a list of dicts, "
            f"received {type(data).__name__}."
        ) from None


def _read_csv(path: Path) -> dict[str, list[str]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"data: expected a readable CSV file, received {path}: {error}.") from error
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not lines:
        raise DataError(f"data: expected names and rows in {path}, received an empty file.")
    rows = list(csv.reader(lines))
    titles = rows[0]
    for number, row in enumerate(rows[1:], start=1):
        if len(row) != len(titles):
            raise DataError(
                f"{path.name}, row {number}: expected {len(titles)} values, received {len(row)}."
            )
    return {title: [row[k] for row in rows[1:]] for k, title in enumerate(titles)}


def _numbers(values: Iterable[Any], title: Any) -> Array:
    result = []
    for row, value in enumerate(values, start=1):
        text = value.strip() if isinstance(value, str) else value
        try:
            result.append(float(text) if text not in ("", None) else math.nan)
        except (TypeError, ValueError):
            raise DataError(
                f"column {title!r}, row {row}: expected a number, received {value!r}."
            ) from None
    return np.array(result, dtype=float)


def _landing(columns: Mapping[str, Array], radius: float) -> Array:
    if all(name in columns for name in COMPONENTS):
        u, v, w = (columns[name] for name in COMPONENTS)
    else:
        speed, angle, w = (columns[name] for name in _POLAR)
        u, v = speed * np.cos(angle), -speed * np.sin(angle)
    return np.column_stack([u, v, w * radius])


def _lift_off(columns: Mapping[str, Array], radius: float) -> dict[str, Array]:
    get = {name.removeprefix(_PREFIX): v for name, v in columns.items() if name.startswith(_PREFIX)}
    result: dict[str, Array] = {}
    if "speed" in get:
        result["xdot"] = get["speed"] * np.cos(get["angle"])
        result["ydot"] = get["speed"] * np.sin(get["angle"])
    for name in ("xdot", "ydot"):
        if name in get:
            result[name] = get[name]
    for name in ("spin", "omega"):
        if name in get:
            result["omega"] = get[name] * radius
    return {name: result[name] for name in COMPONENTS if name in result}
