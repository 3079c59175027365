"""Side spin on the command line: one bounce in 3-D, of ``bounce shot --first-only``."""

from __future__ import annotations

import argparse
from typing import Any

import nonsmooth as ns

from ..golf import SideRebound, axis_spin, side_rebound
from ..units import Landing
from .choices import Chosen
from .report import Units, in_words, polar
from .values import quantity

_NAMES = ("side_spin", "axis_tilt", "launch_angle", "side_slope")


def side_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of side spin and side slope."""
    parser.add_argument(
        "--side-spin",
        type=quantity("spin"),
        help="about the direction of travel, right positive; with --first-only",
    )
    parser.add_argument(
        "--axis-tilt",
        type=quantity("angle"),
        help="of the spin axis at launch, right (fade) positive, instead of --side-spin; with "
        "--launch-angle",
    )
    parser.add_argument(
        "--launch-angle", type=quantity("angle"), help="of the launch, for --axis-tilt"
    )
    parser.add_argument(
        "--side-slope",
        type=quantity("angle"),
        help="of the ground, uphill to the right; with --first-only",
    )


def asked_for_side(args: argparse.Namespace) -> bool:
    """Whether anything of the third dimension was given.

    Raises
    ------
    nonsmooth.OptionError
        Without --first-only, or arguments that do not go together.
    """
    given = [name for name in _NAMES if getattr(args, name) is not None]
    if not given:
        return False
    said = ", ".join("--" + name.replace("_", "-") for name in given)
    if not args.first_only:
        raise ns.OptionError(
            f"{said}: expected with --first-only, because the run until rest is in one vertical plane."
        )
    if args.side_spin is not None and args.axis_tilt is not None:
        raise ns.OptionError("--axis-tilt: expected instead of --side-spin, received both.")
    if (args.axis_tilt is None) != (args.launch_angle is None):
        raise ns.OptionError(
            f"--axis-tilt: expected together with --launch-angle, received {said}. The axis is tilted in "
            "the plane normal to the launch."
        )
    return True


def side_bounce(args: argparse.Namespace, chosen: Chosen, landing: Landing) -> SideRebound:
    """Bounce a ball with side spin once."""
    side, vertical = 0.0, 0.0
    if args.side_spin is not None:
        side = args.side_spin.si(args.units)
    elif args.axis_tilt is not None:
        tilt, launch = (q.si(args.units) for q in (args.axis_tilt, args.launch_angle))
        back, side, vertical = axis_spin(landing.omega, tilt, launch)
        landing = Landing(landing.xdot, landing.ydot, back)
    slope = 0.0 if args.side_slope is None else args.side_slope.si(args.units)
    return side_rebound(
        chosen.model,
        landing,
        side,
        chosen.ball,
        vertical_spin=vertical,
        scaling=chosen.scaling,
        side_slope=slope,
    )


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
        f"lift-off  {in_words(hit.lift_off, units)} ({hit.itinerary})",
        f"kick      {units.say('angle', abs(hit.kick), digits)} {towards}, side spin "
        f"{units.say('spin', hit.side_spin, 0)} before, {units.say('spin', hit.side_spin_after, 0)} after",
    ]
