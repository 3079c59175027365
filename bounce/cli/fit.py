"""The command ``bounce fit``: parameters from a CSV file of measured bounces."""

from __future__ import annotations

import argparse
import math

from ..golf import DataError, fit
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
    """Fit the parameters and print the result."""
    chosen = chosen_model(args)
    try:
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
    except DataError as error:  # what it advises is an option of the function
        raise DataError(str(error).replace("bad_rows='leave out'", "--leave-out")) from error
    ends = found.profile() if found.narrow else {}
    profile = {name: ends[name] for name in found.narrow}
    if args.json:
        shown = {n: [v if math.isfinite(v) else None for v in pair] for n, pair in profile.items()}
        print_json({**opening(args), **found.to_dict(), "profile_95": shown})
    else:
        print(repr(found))
        for name, (low, high) in profile.items():
            print(f"  {name}: as far as the data allow, 95 % in [{low:.6g}, {high:.6g}]")
    if args.residuals:
        import matplotlib

        from ..plot import residuals

        matplotlib.use("Agg")  # a file, no window
        residuals(found).savefig(args.residuals, dpi=150)
    return UNDETERMINED if found.undetermined else 0
