"""Side spin, a tilted spin axis and a side slope on the command line."""

from __future__ import annotations

import argparse

import nonsmooth as ns

from ..golf import SideState, axis_spin
from ..units import Landing
from .choices import side_slope
from .values import angle_within, quantity

_NAMES = ("side_spin", "axis_tilt", "launch_angle", "side_slope", "cross_wind")

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


def require_side(args: argparse.Namespace) -> None:
    """Refuse arguments that do not go together, and angles out of their range."""
    if args.side_spin is not None and args.axis_tilt is not None:
        raise ns.OptionError("--axis-tilt: expected instead of --side-spin, received both.")
    if hasattr(args, "launch_angle") and (args.axis_tilt is None) != (args.launch_angle is None):
        raise ns.OptionError(
            "--axis-tilt: expected together with --launch-angle, received one of them. The axis is "
            "tilted in the plane normal to the launch."
        )
    for name, (least, most, closed) in _ANGLES.items():
        if (typed := getattr(args, name, None)) is not None:
            angle_within("--" + name.replace("_", "-"), typed, args.units, least, most, closed)


def with_side(args: argparse.Namespace, start: Landing) -> tuple[Landing, Landing | SideState]:
    """A start with its backspin, and the state that is followed: with side spin where one was given."""
    if all(getattr(args, name, None) is None for name in _NAMES):
        return start, start
    side, vertical = 0.0, 0.0
    if args.side_spin is not None:
        side = args.side_spin.si(args.units)
    elif args.axis_tilt is not None:
        launch = args.launch_angle.si(args.units) if hasattr(args, "launch_angle") else start.angle
        back, side, vertical = axis_spin(start.omega, args.axis_tilt.si(args.units), launch)
        start = Landing(start.xdot, start.ydot, back)
    return start, SideState.of(start, side, vertical, side_slope(args))
