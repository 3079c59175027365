"""What a command prints: numbers in the units asked for, and everything that it was given."""

from __future__ import annotations

import argparse
import csv
import json
import math
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TextIO

import nonsmooth as ns

from ..units import Landing
from .values import SYSTEMS, Quantity, Span, factor

#: What argparse keeps that is no input of the computation.
_NO_INPUTS = ("run", "json", "command", "output", "usual_turf")


#: What the names of a report measure.
_MEASURES = dict(
    speed="speed", angle="angle", spin="spin", slip="speed", carry="length", bounced="length",
    rolled="length", run_out="length", total="length", height="height", first_height="height",
    time="time", contact_time="time", kick="angle", slip_angle="angle", side_spin="spin",
    side_spin_after="spin", run_side="length", side="length", total_side="length", heading="angle",
)  # fmt: skip


class Units:
    """The units of the output."""

    def __init__(self, system: str):
        self.names = SYSTEMS[system]

    def show(self, kind: str, value: float) -> float:
        """Return a value in SI units in those asked for."""
        return value / factor(kind, self.names[kind])

    def say(self, kind: str, value: float, digits: int = 2) -> str:
        """Return a value in SI units with the unit asked for."""
        return f"{self.show(kind, value):.{digits}f} {self.names[kind]}"

    def report(self, report: dict[str, Any]) -> dict[str, Any]:
        """Return a report in SI units in those asked for."""
        shown: dict[str, Any] = {}
        for name, value in report.items():
            kind = _MEASURES.get(name)
            shown[name] = self.report(value) if isinstance(value, dict) else value
            if kind is not None:
                shown[name] = self.show(kind, value)
        return shown

    def row(self, report: dict[str, Any]) -> dict[str, Any]:
        """Return a report in SI units as a row: nested names joined, units in brackets."""
        row: dict[str, Any] = {}
        for name, value in report.items():
            kind = _MEASURES.get(name)
            if isinstance(value, dict):
                row |= {f"{name}_{inner}": v for inner, v in self.row(value).items()}
            elif kind is not None:
                row[f"{name} [{self.names[kind]}]"] = self.show(kind, value)
            else:
                row[name] = "; ".join(value) if isinstance(value, (list, tuple)) else value
        return row


def polar(state: Landing) -> dict[str, float]:
    """Speed, angle from the positive x axis towards up or down, and spin of a state."""
    angle = math.atan2(abs(state.ydot), state.xdot)
    return dict(speed=state.speed, angle=angle, spin=state.omega)


def in_words(state: Landing, units: Units) -> str:
    """Speed, angle and spin of a state in a line."""
    digits = dict(speed=2, angle=4 if units.names["angle"] == "rad" else 1, spin=0)
    return ", ".join(units.say(name, value, digits[name]) for name, value in polar(state).items())


def in_course(itinerary: str) -> str:
    """An itinerary of modes, or the case of a rigid impact, with what it means in words."""
    cases = itinerary.rstrip("+-").split("/")
    if all(case in _CASES for case in cases):
        return f"{itinerary}: {' or '.join(_CASES[case] for case in cases)}"
    return f"{itinerary}: {', '.join(_MODES.get(mode, mode) for mode in itinerary.split())}"


#: What the letters of a mode and the cases of a rigid impact mean.
_MODES = {"+": "slips forward", "-": "slips in reverse", "*": "slips", "s": "rolls"}
_CASES = {
    "I": "slips throughout",
    "II": "slips, then rolls from restitution on",
    "III": "slips, then rolls from compression on",
    "grip": "slips, then grips the ground",
}


def opening(args: argparse.Namespace) -> dict[str, Any]:
    """Return what every JSON report begins with: version, command, and every input with its unit."""
    given = {name: value for name, value in vars(args).items() if name not in _NO_INPUTS}
    if given.get("turf") is None and given.get("model") is None and "turf" in given:
        given["turf"] = args.usual_turf
    system = given.get("units", "golf")
    inputs = {name: _plain(value, system) for name, value in given.items()}
    return dict(version=ns.__version__, command=args.command, inputs=inputs)


def _plain(value: Any, system: str) -> Any:
    """An input as JSON can have it."""
    if isinstance(value, Quantity):
        if not value.kind:
            return value.value
        return dict(value=value.value, unit=value.named(system))
    if isinstance(value, Span):
        return {**value._asdict(), "unit": value.unit}
    if isinstance(value, list):
        return [_plain(v, system) for v in value]
    if isinstance(value, tuple):
        name, one = value
        return {name: _plain(one, system)}
    return value


def print_json(report: dict[str, Any]) -> None:
    """Print a report that any reader of JSON can read."""
    print(json.dumps(report, indent=2, allow_nan=False))


def tabulate(
    args: argparse.Namespace,
    starts: Iterable[tuple[Landing | None, str]],
    report: Callable[[Landing], dict[str, Any]],
) -> int:
    """Report on each start, as CSV or JSON; what is wrong with one is said in its row.

    Returns
    -------
    int
        0, or 1 if something is wrong with one.
    """
    units, reports, wrong, warned = Units(args.units), list[dict[str, Any]](), 0, 0
    for start, error in starts:
        found: dict[str, Any] = {}
        if start is not None:
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", UserWarning)  # in the column of cautions
                    found = report(start)
            except ns.NonsmoothError as failure:
                error = " ".join(str(failure).split())
        reports.append({"row": len(reports) + 1, **found, "error": error})
        wrong += bool(error)
        warned += bool(found.get("cautions"))
    if args.json:
        rows = [units.report(r) for r in reports]
        print_json({**opening(args), "units": units.names, "rows": rows})
    else:
        write_rows([units.row(r) for r in reports], args.output)
    if warned:
        print(f"bounce: caution: {warned} of {len(reports)} rows: see cautions", file=sys.stderr)
    if wrong:
        print(
            f"bounce: error: {wrong} of {len(reports)} rows: see the column error", file=sys.stderr
        )
    return 1 if wrong else 0


def write_rows(rows: Sequence[dict[str, Any]], path: str | None) -> None:
    """Write rows as CSV, to a file or to the terminal; a name that is missing in a row stays empty."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    if path is None:
        _write(rows, names, sys.stdout)
        return
    with open(path, "w", newline="", encoding="utf-8") as file:
        _write(rows, names, file)


def _write(rows: Sequence[dict[str, Any]], names: list[str], file: TextIO) -> None:
    writer = csv.DictWriter(file, names, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
