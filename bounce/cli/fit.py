"""``bounce fit``: parameters from a CSV file of measured bounces."""

from __future__ import annotations

import argparse

from ..golf import fit
from .choices import chosen_model, ground_arguments
from .report import opening, print_json

HELP = "parameters from a CSV file of measured bounces"
ABOUT = "Fit parameters to measured bounces. Exit code 3: the data do not determine one of them."
#: Exit code of a fit whose data do not determine a parameter.
UNDETERMINED = 3


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("data", help="columns such as 'speed [m/s]', 'lift_off_spin [rpm]'")
    ground_arguments(parser)
    parser.add_argument("--parameters", required=True, help="names to fit, with commas")
    parser.add_argument("--starts", type=int, default=16, help="points compared")
    parser.add_argument("--leave-out", action="store_true", help="leave out (and name) bad rows")
    parser.add_argument("--residuals", metavar="FILE", help="picture of the residuals")


def run(args: argparse.Namespace) -> int:
    """Fit, and print what was found."""
    chosen = chosen_model(args)
    found = fit(
        chosen.model,
        args.data,
        parameters=[name.strip() for name in args.parameters.split(",") if name.strip()],
        ball=chosen.ball,
        scaling=chosen.scaling,
        starts=args.starts,
        bad_rows="leave out" if args.leave_out else "raise",
        progress=True,
    )
    if args.json:
        print_json({**opening(args), **found.to_dict()})
    else:
        print(repr(found))
    if args.residuals:
        from ..plot import residuals

        residuals(found).savefig(args.residuals, dpi=150)
    return UNDETERMINED if found.undetermined else 0
