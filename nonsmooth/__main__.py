"""The command line ``python -m nonsmooth``: list, show NAME, explore [NAME] (textbook problems, or two-folds)."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
import webbrowser
from collections.abc import Sequence
from pathlib import Path

from .model import NonsmoothError
from .textbook import PROBLEMS, Problem, by_name


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m nonsmooth",
        description="Textbook problems of nonsmooth dynamics, run and explored in a browser.",
    )
    version = f"nonsmooth {importlib.import_module('nonsmooth').__version__}"
    parser.add_argument("--version", action="version", version=version)
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("list", help="names and titles of the problems")
    show = verbs.add_parser("show", help="a problem: system, start, known values, one run")
    show.add_argument("name", help="a name from the list")
    show.add_argument("--output", type=Path, help="draw the run into this file (.png, .svg, .pdf)")
    explore = verbs.add_parser(
        "explore", help="a problem in a browser, or the two-folds: one page, without a network"
    )
    explore.add_argument("name", nargs="?", help="a name from the list; two-folds without one")
    explore.add_argument("--output", type=Path, help="file to write (default: NAME.html)")
    explore.add_argument("--open", action="store_true", help="open it in the browser")
    return parser


def _explore(name: str | None, path: Path | None, show: bool) -> None:
    path = path or Path(f"{name or 'two_folds'}.html")
    if name is None:
        page = importlib.import_module("nonsmooth.plot").two_fold_explorer()
    else:
        problem = by_name(name)
        explorer = importlib.import_module("nonsmooth.plot.explorer")
        given = dict(start=problem.start, t_end=problem.t_end, title=problem.title)
        page = explorer.explore(problem.system, **given).html
    path.write_text(page, encoding="utf-8")
    print(f"wrote {path}")
    if show:
        webbrowser.open(path.resolve().as_uri())


def _draw(problem: Problem, path: Path) -> None:
    plot = importlib.import_module("nonsmooth.plot")  # matplotlib is slow to import
    importlib.import_module("matplotlib").use("Agg")  # a file, no window
    plot.trajectory(problem.run()).savefig(path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; the exit status is 0, or 2 for a mistake in it."""
    given = _parser().parse_args(arguments)
    if given.verb == "list":
        width = max(map(len, PROBLEMS))
        for name, make in PROBLEMS.items():
            print(f"{name:{width}}  {make().title}")
        return 0
    try:
        if given.verb == "explore":
            _explore(given.name, given.output, given.open)
            return 0
        problem = by_name(given.name)
        run = problem.run()
        print(problem, f"  run: {run!r}", f"  {run.message}", sep="\n")
        if given.output:
            _draw(problem, given.output)
            print(f"  drawn: {given.output}")
    except (NonsmoothError, OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    try:
        code = main()
        sys.stdout.flush()
    except BrokenPipeError:  # the reader, such as `head`, has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    raise SystemExit(code)
