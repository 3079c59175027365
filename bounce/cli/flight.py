"""``bounce flight``: a launch, or a table of them: carry and landing, and the run until rest."""

from __future__ import annotations

import argparse
from typing import Any

from ..golf import AIRS, Flight, Run, flight
from ..units import Landing
from .choices import Chosen, chosen_model, ground_arguments, require_scale
from .report import Units, in_words, opening, polar, print_json, tabulate
from .shot import UNVALIDATED, run_arguments, run_lines, run_report, to_rest
from .starts import start_arguments, starts

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


def run(args: argparse.Namespace) -> int:
    """Fly the ball, and print where it lands and comes to rest."""
    chosen = chosen_model(args)
    require_scale(args, chosen)
    if args.input is not None:
        return tabulate(
            args, starts(args, up=True), lambda launch: _report(*_fly(args, chosen, launch))
        )
    ((launch, _),) = starts(args, up=True)
    assert launch is not None
    units, (path, rest) = Units(args.units), _fly(args, chosen, launch)
    if args.json:
        print_json({**opening(args), "units": units.names, **units.report(_report(path, rest))})
        return 0
    print(
        f"carry     {units.say('length', path.range)} in {path.time:.2f} s, "
        f"{units.say('height', path.height)} high\nlanding   {in_words(path.landing, units)}"
    )
    if rest is not None:
        print("\n".join(run_lines(rest, units)))
        print(f"total     {units.say('length', path.range + rest.run_out)}")
    return 0


def _fly(args: argparse.Namespace, chosen: Chosen, launch: Landing) -> tuple[Flight, Run | None]:
    air = None if args.air == "none" else AIRS[args.air]
    path = flight(launch, chosen.ball, air=air, slope=args.slope.si(args.units))
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
        report |= dict(
            run=run_report(rest), total=path.range + rest.run_out, cautions=list(rest.cautions)
        )
    return report
