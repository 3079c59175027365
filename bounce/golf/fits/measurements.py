"""Read measured bounces from a CSV file, a table or a list, with units in the column names.

Columns are ``name [unit]``. A landing is ``xdot, ydot, omega`` or ``speed, angle, spin`` (angle of
descent from the ground); a lift-off is the same with ``lift_off_`` before it, any part of it that
was measured (speed and angle together; its angle is from the positive x axis, above 90 degrees for
a ball that bounces back). Without units the numbers are those of a dimensionless model. Other
columns are ignored.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ...units import GOLF, Ball
from .columns import DataError, read_columns

Array = NDArray[np.float64]

_KIND = dict(xdot="speed", ydot="speed", speed="speed", omega="spin", spin="spin", angle="angle")
COMPONENTS = ("xdot", "ydot", "omega")
_POLAR = ("speed", "angle", "spin")
_PREFIX = "lift_off_"
_KINDS = {**_KIND, **{_PREFIX + name: kind for name, kind in _KIND.items()}}


@dataclass(frozen=True)
class Measurements(ns.result_tables.Tabular):
    """Bounces as speeds: spins are surface speeds (spin times radius).

    Attributes
    ----------
    landing : ndarray (n, 3)
        xdot, ydot and the spin's surface speed: in m/s, or as the dimensionless model has them.
    lift_off : dict of str to ndarray (n,)
        What was measured of ``xdot``, ``ydot``, ``omega``.
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

    def _tables(self) -> dict[str, ns.result_tables.ResultTable]:
        landing = dict(zip(("xdot", "ydot", "omega"), self.landing.T, strict=True))
        lift_off = {f"lift_off_{name}": values for name, values in self.lift_off.items()}
        return {"rows": ns.result_tables.ResultTable({"row": self.rows}, landing | lift_off)}

    def keep(self, rows: NDArray[np.bool_], reasons: Mapping[int, str]) -> Measurements:
        """Return a part of the rows.

        Parameters
        ----------
        rows : ndarray of bool (n,)
            Which rows to keep.
        reasons : mapping of int to str
            Why the others, by their numbers, are left out.
        """
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
        What to do with rows that have no number or no landing: name them in an error, or in
        ``left_out``.

    Returns
    -------
    Measurements
        Landings and lift-offs, row by row.

    Raises
    ------
    DataError
        Measurements that cannot be read.

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
    columns, si, titles, _, wrong_rows = read_columns(data, _KINDS)
    _check_names(columns, titles)
    radius = ball.radius if si else 1.0
    landing, lift_off = _landing(columns, radius), _lift_off(columns, radius)
    rows = np.arange(1, len(landing) + 1)
    reasons = dict(sorted({**_bad_rows(columns, landing), **wrong_rows}.items()))
    if reasons and bad_rows == "raise":
        raise DataError(
            f"data: some rows are no complete bounces ({listed(reasons)}). Correct them, or leave them "
            "out with bad_rows='leave out'."
        )
    everything = Measurements(landing, lift_off, rows, si, ())
    good = np.array([row not in reasons for row in rows], dtype=bool)
    return everything.keep(good, reasons)


def listed(problems: Mapping[int, str], most: int = 8) -> str:
    """Rows and reasons in one line."""
    items = [f"row {row}: {why}" for row, why in list(problems.items())[:most]]
    more = f"; and {len(problems) - most} more" if len(problems) > most else ""
    return "; ".join(items) + more


def _bad_rows(columns: Mapping[str, Array], landing: Array) -> dict[int, str]:
    reasons: dict[int, str] = {}
    for row, (_, ydot, _) in enumerate(landing, start=1):
        bad = [name for name, values in columns.items() if not math.isfinite(values[row - 1])]
        if bad:
            reasons[row] = f"no number in {', '.join(bad)}"
        elif ydot >= 0.0:
            reasons[row] = f"it does not approach the ground (ydot = {ydot:g})"
    return reasons


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
