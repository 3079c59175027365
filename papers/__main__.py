"""Reproduce all papers, or those named: ``python -m papers [NAME ...] [--out build]``."""

from __future__ import annotations

import argparse
import importlib
import sys
import time
from collections.abc import Sequence
from pathlib import Path

#: In the order in which they run.
NAMES = (
    "biber_2022",
    "jeffrey_colombo_2009",
    "colombo_jeffrey_2011",
    "kuznetsov_2003",
    "welander_1982",
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the programs of the papers one after the other.

    Returns
    -------
    int
        0 if every check of every paper holds, else 1.
    """
    parser = argparse.ArgumentParser(prog="papers", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"among {', '.join(NAMES)}")
    parser.add_argument("--out", type=Path, default=Path("build"), help="folder of their folders")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.names if name not in NAMES]
    if unknown:
        parser.error(f"no paper named {', '.join(unknown)}; there are {', '.join(NAMES)}")
    worst = 0
    for name in options.names or NAMES:
        started = time.perf_counter()
        print(f"== {name}", flush=True)
        program = importlib.import_module(f"{__package__}.{name}.__main__")
        worst = max(worst, program.main(["--out", str(options.out / name)]))
        print(f"{time.perf_counter() - started:.0f} s\n", flush=True)
    return worst


if __name__ == "__main__":
    sys.exit(main())
