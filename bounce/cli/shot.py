"""``bounce shot``: one landing, or a table of them: the bounce, and the run until rest."""

from __future__ import annotations

import argparse
from typing import Any

from ..golf import AIRS, GREEN_ROLLING_FRICTION, Rebound, Run, SideRebound, SideRun, play, rebound
from ..units import Landing
from .batch import tabulate
from .choices import Chosen, chosen_model, ground_arguments, require_scale, surroundings
from .report import Units, echoed, in_course, in_words, opening, polar, print_json
from .side import (
    asked_for_side,
    counted,
    side_arguments,
    side_bounce,
    side_lines,
    side_report,
    side_run_lines,
    side_run_report,
    side_state,
    side_to_rest,
)
from .starts import Start, start_arguments, starts
from .values import number, quantity

HELP = "a landing: the bounce, and the run until rest"
#: What every run until rest must be read with.
UNVALIDATED = (
    "How a run splits into bounces and roll has not been compared with measurements: the laws of turf "
    "were fitted to single bounces."
)
ABOUT = f"Bounce a ball that lands, and follow it until it rests. {UNVALIDATED}"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    start_arguments(parser, "landing")
    ground_arguments(parser)
    parser.add_argument("--air", choices=["none", *AIRS], default="none", help="during the hops")
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
    """Bounce the ball, and print what becomes of it."""
    chosen = chosen_model(args)
    require_scale(args, chosen)
    side = asked_for_side(args)

    def report_on(start: Start) -> dict[str, Any]:
        assert start.state is not None
        if side:
            report = _side_report(chosen, *_bounce_aside(args, chosen, start.state))
        else:
            report = _report(chosen, *_bounce(args, chosen, start.state))
        return {**report, "landing": echoed(report["landing"], start.typed, args.units)}

    given = starts(args, up=False)
    if args.input is not None:
        return tabulate(args, given, report_on)
    units, landing = Units(args.units), given[0].state
    assert landing is not None
    if args.json:
        report = units.report(report_on(given[0]))
        print_json({**opening(args), "units": units.names, **report})
    elif side:
        kick, run_aside = _bounce_aside(args, chosen, landing)
        lines = side_lines(kick, units)
        print("\n".join(lines + (side_run_lines(run_aside, units) if run_aside else [])))
    else:
        print("\n".join(_lines(*_bounce(args, chosen, landing), chosen, units)))
    return 0


def _bounce_aside(
    args: argparse.Namespace, chosen: Chosen, landing: Landing
) -> tuple[SideRebound, SideRun | None]:
    hit = side_bounce(args, chosen, landing)
    if args.first_only:
        return hit, None
    return hit, side_to_rest(args, chosen, side_state(args, landing))


def _side_report(chosen: Chosen, hit: SideRebound, rest: SideRun | None) -> dict[str, Any]:
    """What becomes of a landing with side spin, in SI units."""
    report = side_report(chosen, hit)
    if rest is not None:
        report |= dict(run=side_run_report(rest), cautions=list(rest.cautions))
    return report


def _bounce(
    args: argparse.Namespace, chosen: Chosen, landing: Landing
) -> tuple[Rebound, Run | None]:
    if args.first_only:
        return rebound(chosen.model, landing, chosen.ball, scaling=chosen.scaling), None
    rest = to_rest(args, chosen, landing)
    return rest.bounces[0].rebound, rest


def to_rest(args: argparse.Namespace, chosen: Chosen, landing: Landing) -> Run:
    """Follow a shot from its first touch-down to rest."""
    return play(
        chosen.model,
        landing,
        chosen.ball,
        scaling=chosen.scaling,
        **surroundings(args),
        rolling_friction=args.rolling_friction,
    )


def _report(chosen: Chosen, hit: Rebound, rest: Run | None) -> dict[str, Any]:
    """What becomes of a landing, in SI units."""
    report: dict[str, Any] = dict(
        model=repr(chosen.model),
        landing=polar(hit.landing),
        lift_off=polar(hit.lift_off),
        slip=hit.lift_off.xdot + chosen.ball.radius * hit.lift_off.omega,
        itinerary=hit.itinerary,
        contact_time=hit.time,
    )
    if rest is not None:
        report |= dict(run=run_report(rest), cautions=list(rest.cautions))
    return report


def run_report(rest: Run) -> dict[str, float]:
    """Numbers of a run until rest, in SI units."""
    return dict(
        bounces=len(rest.bounces),
        extrapolated=rest.extrapolated,
        first_height=rest.first_height,
        bounced=rest.bounced,
        rolled=rest.rolled,
        run_out=rest.run_out,
        time=rest.time,
    )


def _lines(hit: Rebound, rest: Run | None, chosen: Chosen, units: Units) -> list[str]:
    slip = hit.lift_off.xdot + chosen.ball.radius * hit.lift_off.omega
    shown = f"{units.show('speed', slip):.3g} {units.names['speed']}"
    lines = [
        f"lift-off  {in_words(hit.lift_off, units)}, slip {shown} ({in_course(hit.itinerary)})"
    ]
    if hit.time:
        lines.append(f"contact   {1e3 * hit.time:.3g} ms")
    return lines if rest is None else [*lines, *run_lines(rest, units)]


def run_lines(rest: Run, units: Units) -> list[str]:
    """A run until rest in words."""
    return [
        f"run       {units.say('length', rest.run_out)} in {rest.time:.2f} s: {counted(rest)}, "
        f"the first {units.say('height', rest.first_height)} high, over "
        f"{units.say('length', rest.bounced)}; rolls {units.say('length', rest.rolled)}"
    ]
