"""The command ``bounce land``: a landing, the bounce, and the run until rest."""

from __future__ import annotations

import argparse
import math
import warnings
from typing import Any

from ..golf import GREEN_ROLLING_FRICTION, Rebound, Run, SideState, play, rebound
from ..units import Landing
from .batch import answer
from .choices import (
    Chosen,
    air_arguments,
    chosen_model,
    ground_arguments,
    require_scale,
    side_slope,
    surroundings,
)
from .report import Units, echoed, in_words, polar, sideways, with_meaning
from .side import require_side, side_arguments, with_side
from .starts import Start, start_arguments
from .values import number, quantity

_FAST, _FLAT = 45.0, math.radians(25.0)  # of a launch: no ball lands so fast and so flat
HELP = "a landing: the bounce, and the run until rest"
NOT_VALIDATED = "not validated"  # of a number that has not been compared with measurements
UNVALIDATED = (
    "How a run splits into bounces and roll has not been compared with measurements: the laws of turf "
    "were fitted to single bounces."
)
ABOUT = f"Bounce a ball that lands, and follow it until it rests. {UNVALIDATED}"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    start_arguments(parser, "landing")
    ground_arguments(parser)
    air_arguments(parser, "none", "during the hops")
    run_arguments(parser)
    parser.add_argument("--first-only", action="store_true", help="the first bounce only")
    side_arguments(parser)


def run_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the run until rest."""
    parser.add_argument(
        "--slope", type=quantity("angle"), default="0", help="of the ground, uphill positive"
    )
    parser.add_argument(
        "--rolling-friction", type=number, default=GREEN_ROLLING_FRICTION, help="of the ground"
    )


def run(args: argparse.Namespace) -> int:
    """Bounce the ball and print the results."""
    chosen = chosen_model(args)
    require_scale(args, chosen)
    require_side(args)

    def report_on(start: Start) -> dict[str, Any]:
        assert start.state is not None
        landing, state = with_side(args, start.state)
        report = _report(chosen, landing, *_bounce(args, chosen, state))
        return {**report, "landing": echoed(report["landing"], start.typed, args.units)}

    def lines(landing: Landing, units: Units) -> list[str]:
        _hint(landing)
        return _lines(*_bounce(args, chosen, with_side(args, landing)[1]), chosen, units)

    return answer(args, False, report_on, lines)


def _hint(landing: Landing) -> None:
    """Warn of a start that is rather the launch of a shot than its landing."""
    if landing.speed > _FAST and landing.angle < _FLAT:
        warnings.warn(
            f"a landing at {landing.speed:.0f} m/s and {math.degrees(landing.angle):.0f} deg looks like a "
            "launch. For a shot from the tee: bounce launch.",
            UserWarning,
            stacklevel=2,
        )


def _bounce(
    args: argparse.Namespace, chosen: Chosen, state: Landing | SideState
) -> tuple[Rebound[Any], Run[Any] | None]:
    if args.first_only:
        options: dict[str, Any] = dict(scaling=chosen.scaling, side_slope=side_slope(args))
        return rebound(chosen.model, state, chosen.ball, **options), None
    rest = to_rest(args, chosen, state)
    return rest.bounces[0].rebound, rest


def to_rest(args: argparse.Namespace, chosen: Chosen, state: Landing | SideState) -> Run[Any]:
    """Follow a shot from its first touch-down to rest."""
    return play(
        chosen.model,
        state,
        chosen.ball,
        scaling=chosen.scaling,
        **surroundings(args),
        rolling_friction=args.rolling_friction,
    )


def _report(
    chosen: Chosen, landing: Landing, hit: Rebound[Any], rest: Run[Any] | None
) -> dict[str, Any]:
    """Results of a landing in SI units; angles right positive."""
    off, report = hit.lift_off, dict[str, Any](model=repr(chosen.model), landing=polar(landing))
    if isinstance(off, SideState):
        report |= dict(
            side_spin=float(hit.landing.spin[0]),
            lift_off=polar(off.in_plane),
            side_spin_after=off.side_spin,
            kick=off.heading,
            slip_angle=hit.slip_angle,
        )
    else:
        report |= dict(lift_off=polar(off), slip=off.xdot + chosen.ball.radius * off.omega)
    report |= dict(itinerary=hit.itinerary, contact_time=hit.time)
    if rest is not None:
        report |= dict(run=run_report(rest), cautions=list(rest.cautions))
    return report


def run_report(rest: Run[Any]) -> dict[str, float]:
    """Numbers of a run until rest, in SI units; right is positive."""
    report: dict[str, float] = dict(
        bounces=len(rest.bounces),
        extrapolated=rest.extrapolated,
        first_height=rest.first_height,
        bounced=rest.bounced,
        rolled=rest.rolled,
        run_out=rest.run_out,
        time=rest.time,
    )
    if isinstance(rest.bounces[0].rebound.landing, SideState):
        report |= dict(kick=rest.kick, run_side=rest.side)
    return report


def _lines(hit: Rebound[Any], rest: Run[Any] | None, chosen: Chosen, units: Units) -> list[str]:
    off, course = hit.lift_off, with_meaning(hit.itinerary)
    if isinstance(off, SideState):
        digits = 4 if units.names["angle"] == "rad" else 1
        turn = off.heading
        towards = "right" if turn > 0 else "left" if turn < 0 else "to neither side"
        lines = [
            f"lift-off  {in_words(off.in_plane, units)} ({course})",
            f"kick      {units.say('angle', abs(turn), digits)} {towards}, side spin "
            f"{units.say('spin', hit.landing.spin[0], 0)} before, {units.say('spin', off.side_spin, 0)} "
            "after",
        ]
    else:
        slip = units.show("speed", off.xdot + chosen.ball.radius * off.omega)
        shown = f"slip {slip:.3g} {units.names['speed']}"
        lines = [f"lift-off  {in_words(off, units)}, {shown} ({course})"]
    if hit.time:
        lines.append(f"contact   {1e3 * hit.time:.3g} ms")
    return lines if rest is None else [*lines, run_line(rest, units)]


def run_line(rest: Run[Any], units: Units) -> str:
    """A run until rest in words."""
    way, count = units.say("length", rest.run_out), len(rest.bounces)
    if isinstance(rest.bounces[0].rebound.landing, SideState):
        way += f" on and {sideways(rest.side, units)}"
    bounces = "1 bounce" if count == 1 else f"{count} bounces"
    bounces += f" ({rest.extrapolated} of them outside the fit)" if rest.extrapolated else ""
    return (
        f"run       {way} in {rest.time:.1f} s ({NOT_VALIDATED}): {bounces}, the first "
        f"{units.say('height', rest.first_height)} high, over {units.say('length', rest.bounced)}; "
        f"rolls {units.say('length', rest.rolled)}"
    )
