"""Output of the commands: numbers in the chosen units, and every input."""

from __future__ import annotations

import argparse
import json
import math
from typing import Any

import nonsmooth as ns

from ..laws.law import CASES
from ..units import Landing
from .values import SYSTEMS, Quantity, Span, factor

#: Names in the parsed arguments that are no inputs of the computation.
_NO_INPUTS = ("run", "json", "command", "output", "resume", "usual_turf")


#: Kinds of the quantities in a report.
_MEASURES = dict(
    speed="speed", angle="angle", spin="spin", slip="speed", carry="length", bounced="length",
    rolled="length", run_out="length", total="length", height="height", first_height="height",
    time="time", contact_time="time", kick="angle", slip_angle="angle", side_spin="spin",
    side_spin_after="spin", run_side="length", side="length", total_side="length", heading="angle",
)  # fmt: skip


class Units:
    def __init__(self, system: str):
        self.names = SYSTEMS[system]
        self._system = system

    def show(self, kind: str, value: float | Quantity) -> float:
        """Return a value in SI units, or as it was typed, in the chosen units."""
        if isinstance(value, Quantity):
            if value.named(self._system) == self.names[kind]:
                return value.value
            value = value.si(self._system)
        return value / factor(kind, self.names[kind])

    def cell(self, kind: str, value: float | Quantity) -> float:
        """Return a value in the chosen units with six digits, more than a launch monitor measures, or as typed."""
        shown = self.show(kind, value)
        typed = isinstance(value, Quantity) and value.named(self._system) == self.names[kind]
        return shown if typed else float(f"{shown:.6g}")

    def say(self, kind: str, value: float, digits: int | None = None) -> str:
        """Return a value in SI units as text in the chosen unit; by default two digits, and all before the point."""
        shown = self.show(kind, value)
        digits = int(abs(shown) < 9.95) if digits is None else digits
        return f"{shown:.{digits}f} {self.names[kind]}"

    def report(self, report: dict[str, Any]) -> dict[str, Any]:
        """Return a report in SI units in the chosen units."""
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
                row[f"{name} [{self.names[kind]}]"] = self.cell(kind, value)
            else:
                row[name] = "; ".join(value) if isinstance(value, (list, tuple)) else value
        return row


def polar(state: Landing) -> dict[str, float]:
    """Speed, angle from the positive x axis towards up or down, and spin of a state."""
    angle = math.atan2(abs(state.ydot), state.xdot)
    return dict(speed=state.speed, angle=angle, spin=state.omega)


def echoed(report: dict[str, float], typed: dict[str, Quantity], system: str) -> dict[str, Any]:
    """A reported state in SI units, with its numbers as they were typed where they are the same."""
    # a speed or angle computed from components differs in its last digit
    shown: dict[str, Any] = dict(report)
    for name, given in typed.items():
        if math.isclose(given.si(system), report[name], rel_tol=1e-12):
            shown[name] = given
    return shown


def in_words(state: Landing, units: Units) -> str:
    """Speed, angle and spin of a state in a line."""
    digits = dict(speed=1, angle=4 if units.names["angle"] == "rad" else 1, spin=0)
    return ", ".join(units.say(name, value, digits[name]) for name, value in polar(state).items())


def sideways(way: float, units: Units) -> str:
    """A way to the side in words."""
    return f"{units.say('length', abs(way))} to the {'left' if way < 0 else 'right'}"


def with_meaning(itinerary: str) -> str:
    """An itinerary, or the case of a rigid impact, with its meaning in words."""
    cases = itinerary.rstrip("+-").split("/")
    if all(case in CASES for case in cases):
        return f"{itinerary}: {' or '.join(CASES[case] for case in cases)}"
    return f"{itinerary}: {', '.join(_MODES.get(mode, mode) for mode in itinerary.split())}"


#: Modes in words, of an itinerary and of a map.
_MODES = {
    "+": "slips forward", "-": "slips in reverse", "*": "slips", "s": "rolls",
    "S+": "slips forward", "S-": "slips in reverse", "R": "rolls",
}  # fmt: skip


def opening(args: argparse.Namespace) -> dict[str, Any]:
    """Return the head of a JSON report: version, command, and every input with its unit."""
    given = {name: value for name, value in vars(args).items() if name not in _NO_INPUTS}
    if given.get("turf") is None and given.get("model") is None and "turf" in given:
        given["turf"] = args.usual_turf
    system = given.get("units", "golf")
    inputs = {name: _plain(value, system) for name, value in given.items()}
    return dict(version=ns.__version__, command=args.command, inputs=inputs)


def _plain(value: Any, system: str) -> Any:
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
    print(json.dumps(report, indent=2, allow_nan=False))
