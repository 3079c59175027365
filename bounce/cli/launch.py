"""The command ``bounce launch``: a launch, carry and landing, and the run until rest."""

from __future__ import annotations

import argparse
from typing import Any

from ..golf import Flight, Run, SideState, flight
from ..units import Landing
from .batch import answer
from .choices import (
    Chosen,
    air_arguments,
    chosen_model,
    ground_arguments,
    require_scale,
    surroundings,
)
from .land import NOT_VALIDATED, UNVALIDATED, run_arguments, run_line, run_report, to_rest
from .report import Units, echoed, in_words, polar, sideways
from .side import require_side, side_arguments, with_side
from .starts import Start, start_arguments

HELP = "a launch: carry and landing, and with a ground the run until rest"
ABOUT = f"Fly a ball to the ground; with --turf or --model also to rest. {UNVALIDATED}"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    start_arguments(parser, "launch")
    air_arguments(parser, "tour-2023", "during flight and hops")
    ground_arguments(parser, turf=None)
    run_arguments(parser)
    side_arguments(parser, launched=True)


def run(args: argparse.Namespace) -> int:
    """Compute the flight and print where the ball lands and comes to rest."""
    chosen = chosen_model(args)
    require_scale(args, chosen)
    require_side(args)

    def report_on(start: Start) -> dict[str, Any]:
        assert start.state is not None
        report = _report(start.state, *_fly(args, chosen, start.state))
        return {**report, "launch": echoed(report["launch"], start.typed, args.units)}

    def lines(launch: Landing, units: Units) -> list[str]:
        return _lines(*_fly(args, chosen, launch), units)

    return answer(args, True, report_on, lines)


def _fly(
    args: argparse.Namespace, chosen: Chosen, launch: Landing
) -> tuple[Flight[Any], Run[Any] | None]:
    _, state = with_side(args, launch)
    path = flight(state, chosen.ball, **surroundings(args))
    to_ground = args.turf is not None or args.model is not None
    return path, to_rest(args, chosen, path.landing) if to_ground else None


def _report(launch: Landing, path: Flight[Any], rest: Run[Any] | None) -> dict[str, Any]:
    """Results of a launch in SI units; right is positive."""
    report: dict[str, Any] = dict(launch=polar(launch), carry=path.range)
    hit, aside = path.landing, isinstance(path.landing, SideState)
    if aside:
        report |= dict(side=path.side)
    report |= dict(
        time=path.time, height=path.height, landing=polar(hit.in_plane if aside else hit)
    )
    if aside:
        report |= dict(heading=hit.heading)
    if rest is not None:
        report |= dict(run=run_report(rest), total=path.range + rest.run_out)
        if aside:
            report |= dict(total_side=path.side + rest.side)
    return report | dict(cautions=[*path.cautions, *(() if rest is None else rest.cautions)])


def _lines(path: Flight[Any], rest: Run[Any] | None, units: Units) -> list[str]:
    hit, carry, way, heading = path.landing, units.say("length", path.range), "", ""
    total = "" if rest is None else units.say("length", path.range + rest.run_out)
    if isinstance(hit, SideState):
        way = f", {sideways(path.side, units)},"
        total += "" if rest is None else f", {sideways(path.side + rest.side, units)}"
        side = "left" if hit.heading < 0 else "right"
        heading = f", heading {units.say('angle', abs(hit.heading), 1)} to the {side}"
        hit = hit.in_plane
    lines = [
        f"carry     {carry}{way} in {path.time:.1f} s, {units.say('height', path.height)} high",
        f"landing   {in_words(hit, units)}{heading}",
    ]
    return (
        lines
        if rest is None
        else [*lines, run_line(rest, units), f"total     {total} ({NOT_VALIDATED})"]
    )
