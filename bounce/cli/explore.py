"""The command ``bounce explore``: one bounce in a browser, as a page that works offline."""

from __future__ import annotations

import argparse
import webbrowser
from pathlib import Path

from .report import opening, print_json

HELP = "one bounce in a browser: a page to drag, offline"
ABOUT = (
    "Write a page that opens in any browser, without a server or a network: sliders for the surface "
    "and the landing; friction cone, slip in time, outcome map and dividing curve follow."
)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("--output", type=Path, default=Path("bounce.html"), help="file to write")
    parser.add_argument("--open", action="store_true", help="open it in the browser")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(args: argparse.Namespace) -> int:
    """Write the page."""
    from ..plot.explorer import explore  # matplotlib is slow to import

    explore(path=args.output)
    if args.json:
        print_json({**opening(args), "output": str(args.output)})
    else:
        print(f"wrote {args.output}")
    if args.open:
        webbrowser.open(args.output.resolve().as_uri())
    return 0
