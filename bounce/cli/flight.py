"""``bounce flight``: a launch, or a table of them: carry and landing, and the run until rest."""

from __future__ import annotations

import argparse
from typing import Any

from ..golf import AIRS, Flight, Run, SideFlight, SideRun, flight
from ..units import Landing
from .batch import tabulate
from .choices import Chosen, chosen_model, ground_arguments, require_scale, surroundings
from .report import Units, echoed, in_words, opening, polar, print_json
from .shot import UNVALIDATED, run_arguments, run_lines, run_report, to_rest
from .side import (
    asked_for_side,
    side_arguments,
    side_carry,
    side_run_lines,
    side_run_report,
    side_to_rest,
    sideways,
)
from .starts import Start, start_arguments, starts

HELP = "a launch: carry and landing, and with a ground the run until rest"
ABOUT = f"Fly a ball to the ground; with --turf or --model also to rest. {UNVALIDATED}"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    start_arguments(parser, "launch")
    parser.add_argument(
        "--air", choices=["none", *AIRS], default="smits-smith", help="during flight and hops"
    )
    ground_arguments(parser, turf=None)
    run_arguments(parser)
    side_arguments(parser, launched=True)


def run(args: argparse.Namespace) -> int:
    """Fly the ball, and print where it lands and comes to rest."""
    chosen = chosen_model(args)
    require_scale(args, chosen)
    side = asked_for_side(args)

    def report_on(start: Start) -> dict[str, Any]:
        assert start.state is not None
        if side:
            report = _side_report(start.state, *_fly_aside(args, chosen, start.state))
        else:
            report = _report(*_fly(args, chosen, start.state))
        return {**report, "launch": echoed(report["launch"], start.typed, args.units)}

    given = starts(args, up=True)
    if args.input is not None:
        return tabulate(args, given, report_on)
    units, launch = Units(args.units), given[0].state
    assert launch is not None
    if args.json:
        report = units.report(report_on(given[0]))
        print_json({**opening(args), "units": units.names, **report})
        return 0
    if side:
        return _print_side(args, chosen, launch)
    path, rest = _fly(args, chosen, launch)
    print(
        f"carry     {units.say('length', path.range)} in {path.time:.2f} s, "
        f"{units.say('height', path.height)} high\nlanding   {in_words(path.landing, units)}"
    )
    if rest is not None:
        print("\n".join(run_lines(rest, units)))
        print(f"total     {units.say('length', path.range + rest.run_out)}")
    return 0


def _fly(args: argparse.Namespace, chosen: Chosen, launch: Landing) -> tuple[Flight, Run | None]:
    path = flight(launch, chosen.ball, **surroundings(args))
    to_ground = args.turf is not None or args.model is not None
    return path, to_rest(args, chosen, path.landing) if to_ground else None


def _report(path: Flight, rest: Run | None) -> dict[str, Any]:
    """What becomes of a launch, in SI units."""
    report: dict[str, Any] = dict(
        launch=polar(path.launch),
        carry=path.range,
        time=path.time,
        height=path.height,
        landing=polar(path.landing),
    )
    if rest is not None:
        report |= dict(run=run_report(rest), total=path.range + rest.run_out)
    return report | dict(cautions=_cautions(path, rest))


def _print_side(args: argparse.Namespace, chosen: Chosen, launch: Landing) -> int:
    """Fly a ball with side spin, and print where it lands and comes to rest."""
    units, (path, rest) = Units(args.units), _fly_aside(args, chosen, launch)
    heading = units.say("angle", abs(path.landing.heading), 1)
    print(
        f"carry     {units.say('length', path.range)}, {sideways(path.side, units)}, in {path.time:.2f} s, "
        f"{units.say('height', path.height)} high\n"
        f"landing   {in_words(path.landing.in_plane, units)}, heading {heading} to the "
        f"{'left' if path.landing.heading < 0 else 'right'}"
    )
    if rest is not None:
        print("\n".join(side_run_lines(rest, units)))
        print(
            f"total     {units.say('length', path.range + float(rest.rest[0]))}, "
            f"{sideways(path.side + float(rest.rest[1]), units)}"
        )
    return 0


def _fly_aside(
    args: argparse.Namespace, chosen: Chosen, launch: Landing
) -> tuple[SideFlight, SideRun | None]:
    path = side_carry(args, chosen, launch)
    to_ground = args.turf is not None or args.model is not None
    return path, side_to_rest(args, chosen, path.landing) if to_ground else None


def _side_report(launch: Landing, path: SideFlight, rest: SideRun | None) -> dict[str, Any]:
    """What becomes of a launch with side spin, in SI units; right is positive."""
    report: dict[str, Any] = dict(
        launch=polar(launch),
        carry=path.range,
        side=path.side,
        time=path.time,
        height=path.height,
        landing=polar(path.landing.in_plane),
        heading=path.landing.heading,
    )
    if rest is not None:
        report |= dict(
            run=side_run_report(rest),
            total=path.range + float(rest.rest[0]),
            total_side=path.side + float(rest.rest[1]),
        )
    return report | dict(cautions=_cautions(path, rest))


def _cautions(path: Flight | SideFlight, rest: Run | SideRun | None) -> list[str]:
    return [*path.cautions, *(() if rest is None else rest.cautions)]
