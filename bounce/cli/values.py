"""Read arguments of the command line: numbers with units, assignments and ranges."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable
from typing import NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..units import MINUS, UNITS

#: Units of each system, for numbers without a unit and for the output.
SYSTEMS: dict[str, dict[str, str]] = {
    "golf": dict(speed="m/s", angle="deg", spin="rpm", length="m", height="m", time="s"),
    "us": dict(speed="mph", angle="deg", spin="rpm", length="yd", height="ft", time="s"),
    "si": dict(speed="m/s", angle="rad", spin="rad/s", length="m", height="m", time="s"),
}
#: Kinds of the names that have units; a height is a length with its own unit.
KINDS = dict(speed="speed", angle="angle", spin="spin", slope="angle", tilt="angle")
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([^\d\s].*?)?\s*")


def factor(kind: str, unit: str) -> float:
    """Return the size of a unit in SI units."""
    return UNITS["length" if kind == "height" else kind][unit]


class Quantity(NamedTuple):
    """A number as it was typed, with its unit or without."""

    value: float
    unit: str | None
    kind: str

    def named(self, system: str) -> str:
        """Return its unit; without one that of the system."""
        return SYSTEMS[system][self.kind] if self.unit is None else self.unit

    def si(self, system: str) -> float:
        """Return it in SI units."""
        return self.value * factor(self.kind, self.named(system))

    def text(self, system: str) -> str:
        """Return it with its unit."""
        return f"{self.value:g} {self.named(system)}"


def angle_within(
    option: str, typed: Quantity, system: str, least: float, most: float, closed: bool = True
) -> float:
    """Return an angle in radians, if it is from ``least`` to ``most`` degrees."""
    angle = math.degrees(typed.si(system))
    if not (least <= angle <= most if closed else least < angle < most):
        within = f"from {least} to {most}" if closed else f"between {least} and {most}"
        raise ns.OptionError(
            f"{option}: expected an angle {within} deg, received {typed.text(system)}."
        )
    return typed.si(system)


class Span(NamedTuple):
    """NAME=LOW:HIGH:COUNT as it was typed."""

    name: str
    low: float
    high: float
    points: int
    unit: str | None

    def values(self, system: str) -> NDArray[np.float64]:
        """Return the values, in SI units where the name has units."""
        ends = (Quantity(end, self.unit, KINDS.get(self.name, "")) for end in (self.low, self.high))
        low, high = (in_si(self.name, end, system) for end in ends)
        return np.linspace(low, high, self.points)


def in_si(name: str, typed: Quantity, system: str) -> float:
    """Return the value of a name that may have units, such as ``tilt``, in SI units."""
    if name in KINDS:
        return Quantity(typed.value, typed.unit, KINDS[name]).si(system)
    if typed.unit is not None:
        raise ns.OptionError(f"{name}: expected a number without a unit, received {typed.unit!r}.")
    return typed.value


def number(text: str) -> float:
    """Read a finite number."""
    try:
        value = float(text)
    except ValueError:
        fail(text, "a number")
    if not math.isfinite(value):
        fail(text, "a number that is finite, so between -1.8e308 and 1.8e308")
    return value


def quantity(kind: str) -> Callable[[str], Quantity]:
    """Return what reads a number with a unit of a kind, or without."""
    known = UNITS["length" if kind == "height" else kind]
    units = ", ".join(known)

    def read(text: str) -> Quantity:
        found = _NUMBER.fullmatch(text.translate(MINUS))
        unit = None if found is None or found[2] is None else found[2].replace("°", "deg")
        if found is None or (unit is not None and unit not in known):
            example = f"1{next(iter(known))}"
            article = "an" if kind[0] in "aeiou" else "a"
            fail(text, f"{article} {kind} such as 1 or {example} (units: {units})")
        return Quantity(number(found[1]), unit, kind)

    return read


def assignment(text: str) -> tuple[str, Quantity]:
    """Read NAME=VALUE, the value with a unit or without."""
    name, equals, value = text.partition("=")
    found = _NUMBER.fullmatch(value.translate(MINUS))
    if not equals or found is None:
        fail(text, "NAME=VALUE")
    name, unit = name.strip(), found[2]
    _require_unit(text, name, unit)
    return name, Quantity(number(found[1]), unit, KINDS.get(name, ""))


def span(text: str) -> Span:
    """Read NAME=LOW:HIGH:COUNT; a unit behind HIGH is that of both."""
    name, _, values = text.partition("=")
    try:
        low, high, count = values.split(":")
        ends = [_NUMBER.fullmatch(end.translate(MINUS)) for end in (low, high)]
        if ends[0] is None or ends[1] is None or int(count) < 1:
            raise ValueError(text)
        units = {end[2] for end in ends if end is not None} - {None}
        if len(units) > 1:
            raise ValueError(text)
    except ValueError:
        fail(text, "NAME=LOW:HIGH:COUNT")
    unit = units.pop() if units else None
    _require_unit(text, name.strip(), unit)
    return Span(name.strip(), number(ends[0][1]), number(ends[1][1]), int(count), unit)


def _require_unit(text: str, name: str, unit: str | None) -> None:
    known = UNITS[KINDS[name]] if name in KINDS else {}
    if unit is not None and unit not in known:
        fail(text, f"a unit among {', '.join(known)}" if known else f"{name} without a unit")


def fail(text: str, form: str) -> NoReturn:
    raise argparse.ArgumentTypeError(f"expected {form}, received {text!r}")
