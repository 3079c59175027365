"""Starts on the command line: one speed, angle and spin, or a table of them."""

from __future__ import annotations

import argparse
import math
from types import MappingProxyType
from typing import NamedTuple

import nonsmooth as ns

from ..golf.fits.columns import Row, read_rows
from ..units import Landing
from .values import KINDS, Quantity, quantity

NAMES = ("speed", "angle", "spin")
#: Headings of launch monitors, for launches and for landings; the first that is there counts.
_LAUNCHED = {
    "speed": ("ball_speed", "ballspeed", "launch_speed"),
    "angle": (
        "launch_angle",
        "vertical_launch_angle",
        "vertical_launch",
        "vla",
        "launch_v",
        "launch",
    ),
    "spin": ("backspin", "back_spin", "spin_rate", "spinrate", "total_spin"),
}
_LANDED = {
    "speed": ("landing_speed", "land_speed", "impact_speed"),
    "angle": ("landing_angle", "land_angle", "descent_angle", "angle_of_descent"),
    "spin": ("landing_spin", "backspin", "back_spin"),
}
_HELP = dict(
    speed="such as 28.5, 64mph or 103km/h",
    angle="between path and ground, such as 37.3 or 0.65rad",
    spin="backspin positive, such as 2094 or 219rad/s",
)


class Start(NamedTuple):
    """A start and its speed, angle and spin as typed; or no start, and what is wrong with it."""

    state: Landing | None
    typed: dict[str, Quantity]
    error: str
    others: dict[str, str] = MappingProxyType({})  # type: ignore[assignment]


def start_arguments(parser: argparse.ArgumentParser, what: str) -> None:
    """Add the arguments of a start."""
    for name in NAMES:
        parser.add_argument(f"--{name}", type=quantity(name), help=f"of the {what}: {_HELP[name]}")
    parser.add_argument(
        "--input",
        metavar="FILE",
        help="CSV instead of one start: columns speed, angle, spin, with units as in 'speed [mph]', or a launch "
        "monitor's headings; other columns are kept",
    )
    parser.add_argument(
        "--output", metavar="FILE", help="of --input: CSV, to the terminal if not given"
    )
    parser.add_argument(
        "--resume", action="store_true", help="continue after the rows that --output has already"
    )


def read_starts(args: argparse.Namespace, up: bool) -> list[Start]:
    """Return one start, or the rows of a table with what is wrong with each."""
    given = {name: getattr(args, name) for name in NAMES}
    missing = [name for name, value in given.items() if value is None]
    if args.input is None:
        if missing:
            raise ns.OptionError(
                f"{', '.join('--' + m for m in missing)}: expected a number, or --input FILE, received "
                "none."
            )
        if args.resume:
            raise ns.OptionError("--resume: expected with --input and --output, received neither.")
        return [Start(_start(given, args.units, up, "--"), given, "")]
    if len(missing) < len(NAMES):
        raise ns.OptionError(
            f"--input: expected instead of {', '.join('--' + n for n in NAMES)}, received both."
        )
    kinds = {name: KINDS[name] for name in NAMES}
    table = read_rows(args.input, kinds, _LAUNCHED if up else _LANDED)
    absent = [name for name in NAMES if name not in table.units]
    if absent:
        raise ns.OptionError(f"--input: expected columns {absent}, received {table.titles}.")
    return [_of_row(row, table.units, args.units, up) for row in table.rows]


def _of_row(row: Row, units: dict[str, str | None], system: str, up: bool) -> Start:
    if row.error:
        return Start(None, {}, row.error + ".", row.others)
    typed = {name: Quantity(row.values[name], units[name], name) for name in NAMES}
    try:
        return Start(_start(typed, system, up, ""), typed, "", row.others)
    except ns.OptionError as error:
        return Start(None, typed, " ".join(str(error).split()), row.others)


def _start(given: dict[str, Quantity], system: str, up: bool, prefix: str) -> Landing:
    speed, angle, spin = (given[name].si(system) for name in NAMES)
    if not 0.0 < speed < math.inf:
        raise ns.OptionError(
            f"{prefix}speed: expected a positive speed, received {given['speed'].text(system)}."
        )
    if not 0.0 < angle <= math.pi / 2 * (1 + 1e-12):
        most = "pi/2 rad" if given["angle"].named(system) == "rad" else "90 deg"
        raise ns.OptionError(
            f"{prefix}angle: expected an angle between path and ground, above 0 and at most {most}, "
            f"received {given['angle'].text(system)}."
        )
    if not math.isfinite(spin):
        raise ns.OptionError(f"{prefix}spin: expected a number, received {given['spin'].value!r}.")
    start = Landing.polar(speed, min(angle, math.pi / 2), spin * 30 / math.pi)
    return Landing(start.xdot, -start.ydot, start.omega) if up else start
