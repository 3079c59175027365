"""Side spin on the command line: one bounce in 3-D, a run until rest, a flight that curves."""

from __future__ import annotations

import argparse
from typing import Any

import nonsmooth as ns

from ..golf import (
    Run,
    SideFlight,
    SideRebound,
    SideRun,
    SideState,
    axis_spin,
    side_flight,
    side_play,
    side_rebound,
)
from ..units import Landing
from .choices import Chosen, surroundings
from .report import Units, in_course, in_words, polar
from .values import angle_within, quantity

_NAMES = ("side_spin", "axis_tilt", "launch_angle", "side_slope")

#: Angles in degrees: least and most, and whether these are among them.
_ANGLES = {
    "axis_tilt": (-90, 90, True),
    "launch_angle": (0, 90, True),
    "side_slope": (-90, 90, False),
}


def side_arguments(parser: argparse.ArgumentParser, launched: bool = False) -> None:
    """Add the arguments of side spin and side slope; ``launched`` where the start is the launch."""
    parser.add_argument(
        "--side-spin",
        type=quantity("spin"),
        help="about the direction of travel, right positive",
    )
    more = "" if launched else "; with --launch-angle"
    parser.add_argument(
        "--axis-tilt",
        type=quantity("angle"),
        help=f"of the spin axis at launch, right (fade) positive, instead of --side-spin{more}",
    )
    if not launched:
        parser.add_argument(
            "--launch-angle", type=quantity("angle"), help="of the launch, for --axis-tilt"
        )
    parser.add_argument(
        "--side-slope", type=quantity("angle"), help="of the ground, uphill to the right"
    )


def asked_for_side(args: argparse.Namespace) -> bool:
    """Whether anything of the third dimension was given.

    Raises
    ------
    nonsmooth.OptionError
        Arguments that do not go together, an angle out of its range.
    """
    given = [name for name in _NAMES if getattr(args, name, None) is not None]
    if not given:
        return False
    said = ", ".join("--" + name.replace("_", "-") for name in given)
    if args.side_spin is not None and args.axis_tilt is not None:
        raise ns.OptionError("--axis-tilt: expected instead of --side-spin, received both.")
    if hasattr(args, "launch_angle") and (args.axis_tilt is None) != (args.launch_angle is None):
        raise ns.OptionError(
            f"--axis-tilt: expected together with --launch-angle, received {said}. The axis is tilted in "
            "the plane normal to the launch."
        )
    for name, (least, most, closed) in _ANGLES.items():
        if (typed := getattr(args, name, None)) is not None:
            angle_within("--" + name.replace("_", "-"), typed, args.units, least, most, closed)
    return True


def _spins(args: argparse.Namespace, start: Landing) -> tuple[Landing, float, float]:
    """A start with its backspin, side spin and spin about the vertical."""
    if args.side_spin is not None:
        return start, args.side_spin.si(args.units), 0.0
    if args.axis_tilt is None:
        return start, 0.0, 0.0
    launch = args.launch_angle.si(args.units) if hasattr(args, "launch_angle") else start.angle
    back, side, vertical = axis_spin(start.omega, args.axis_tilt.si(args.units), launch)
    return Landing(start.xdot, start.ydot, back), side, vertical


def _side_slope(args: argparse.Namespace) -> float:
    return 0.0 if args.side_slope is None else float(args.side_slope.si(args.units))


def side_state(args: argparse.Namespace, start: Landing) -> SideState:
    """A landing or launch with its spins, in the axes of the ground."""
    return SideState.of(*_spins(args, start), _side_slope(args))


def side_bounce(args: argparse.Namespace, chosen: Chosen, landing: Landing) -> SideRebound:
    """Bounce a ball with side spin once."""
    plane, side, vertical = _spins(args, landing)
    return side_rebound(
        chosen.model,
        plane,
        side,
        chosen.ball,
        vertical_spin=vertical,
        scaling=chosen.scaling,
        side_slope=_side_slope(args),
    )


def side_to_rest(args: argparse.Namespace, chosen: Chosen, landing: SideState) -> SideRun:
    """Follow a shot with side spin from its first touch-down to rest."""
    return side_play(
        chosen.model,
        landing,
        chosen.ball,
        scaling=chosen.scaling,
        **surroundings(args),
        side_slope=_side_slope(args),
        rolling_friction=args.rolling_friction,
    )


def side_carry(args: argparse.Namespace, chosen: Chosen, launch: Landing) -> SideFlight:
    """Fly a ball with side spin."""
    return side_flight(
        side_state(args, launch),
        chosen.ball,
        **surroundings(args),
        side_slope=_side_slope(args),
    )


def side_run_report(rest: SideRun) -> dict[str, float]:
    """Numbers of a run with side spin until rest, in SI units; right is positive."""
    return dict(
        bounces=len(rest.bounces),
        extrapolated=rest.extrapolated,
        first_height=rest.first_height,
        kick=rest.kick,
        run_out=float(rest.rest[0]),
        run_side=float(rest.rest[1]),
        time=rest.time,
    )


def counted(rest: Run | SideRun) -> str:
    """How many bounces, and how many of them the law does not cover."""
    count = len(rest.bounces)
    many = "1 bounce" if count == 1 else f"{count} bounces"
    return f"{many} ({rest.extrapolated} of them outside the fit)" if rest.extrapolated else many


def side_run_lines(rest: SideRun, units: Units) -> list[str]:
    """A run with side spin until rest in words."""
    return [
        f"run       {units.say('length', float(rest.rest[0]))} on and "
        f"{sideways(float(rest.rest[1]), units)} in {rest.time:.2f} s: {counted(rest)}, the first "
        f"{units.say('height', rest.first_height)} high"
    ]


def sideways(way: float, units: Units) -> str:
    """A way to the side in words."""
    return f"{units.say('length', abs(way))} to the {'left' if way < 0 else 'right'}"


def side_report(chosen: Chosen, hit: SideRebound) -> dict[str, Any]:
    """What becomes of a landing with side spin, in SI units; angles right positive."""
    return dict(
        model=repr(chosen.model),
        landing=polar(hit.landing),
        side_spin=hit.side_spin,
        lift_off=polar(hit.lift_off),
        side_spin_after=hit.side_spin_after,
        kick=hit.kick,
        slip_angle=hit.slip_angle,
        itinerary=hit.itinerary,
    )


def side_lines(hit: SideRebound, units: Units) -> list[str]:
    """A bounce with side spin in words."""
    digits = 4 if units.names["angle"] == "rad" else 1
    towards = "right" if hit.kick > 0 else "left" if hit.kick < 0 else "to neither side"
    return [
        f"lift-off  {in_words(hit.lift_off, units)} ({in_course(hit.itinerary)})",
        f"kick      {units.say('angle', abs(hit.kick), digits)} {towards}, side spin "
        f"{units.say('spin', hit.side_spin, 0)} before, {units.say('spin', hit.side_spin_after, 0)} after",
    ]
