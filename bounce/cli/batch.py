"""Results of one start, or a table of them: rows are written as they are computed and can be resumed."""

from __future__ import annotations

import argparse
import csv
import io
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, TextIO

from tqdm import tqdm

import nonsmooth as ns

from ..golf.fits.columns import LARGEST
from ..units import Landing
from .report import Units, opening, print_json
from .starts import Start, read_starts

#: Exit code after Ctrl-C, as shells give it.
INTERRUPTED = 130
Report = Callable[[Start], dict[str, Any]]


def answer(
    args: argparse.Namespace, up: bool, report: Report, lines: Callable[[Landing, Units], list[str]]
) -> int:
    """Print what becomes of one start, or of each in a table, and return the exit code."""
    given = read_starts(args, up)
    if args.input is not None:
        return _tabulate(args, given, report)
    units, state = Units(args.units), given[0].state
    assert state is not None
    if args.json:
        shown = units.report(report(given[0]))
        print_json({**opening(args), "units": units.names, **shown})
    else:
        print("\n".join(lines(state, units)))
    return 0


def _tabulate(args: argparse.Namespace, starts: Sequence[Start], report: Report) -> int:
    """Write a report on each start as CSV or JSON, with the error of a row in that row."""
    if args.resume and (args.output is None or args.json):
        raise ns.OptionError("--resume: expected with --output FILE and without --json.")
    if args.json:
        return _as_json(args, starts, report)
    if args.output is None:
        return _as_csv(args, starts, report, sys.stdout, _Kept([], [], 0))
    kept = _kept(args, starts, report) if args.resume else _Kept([], [], 0)
    with open(args.output, "r+" if kept.rows else "w", newline="", encoding="utf-8") as file:
        file.seek(kept.size)
        file.truncate()
        return _as_csv(args, starts, report, file, kept)


class _Kept(NamedTuple):
    """What a file already holds: names, rows, and the size of its whole rows in bytes."""

    names: list[str]
    rows: list[dict[str, str]]
    size: int


def _as_json(args: argparse.Namespace, starts: Sequence[Start], report: Report) -> int:
    units, count, rows = Units(args.units), _Count(len(starts)), list[dict[str, Any]]()
    try:
        for start, row in _rows(starts, report, 0):
            kept = {"others": dict(start.others)} if start.others else {}
            rows.append({**units.report(row), **kept})
            count.add(row)
    except KeyboardInterrupt:
        count.interrupted = True
    print_json({**opening(args), "units": units.names, "rows": rows})
    return count.finish("they are printed. To have them all, begin again")


def _as_csv(
    args: argparse.Namespace, starts: Sequence[Start], report: Report, file: TextIO, kept: _Kept
) -> int:
    """Write the missing rows; the names are those of the first row that has results."""
    units, count, names = Units(args.units), _Count(len(starts)), kept.names
    for old in kept.rows:
        count.add(old)
    waiting: list[dict[str, Any]] = []
    try:
        for start, row in _rows(starts, report, len(kept.rows)):
            waiting.append(_flat(units, start, row))
            if not names and not row["error"]:
                names = list(waiting[-1])
                file.write(_line(names, dict(zip(names, names, strict=True))))
            if names:
                file.write("".join(_line(names, one) for one in waiting))
                file.flush()
                waiting.clear()
            count.add(row)
    except KeyboardInterrupt:
        count.interrupted = True
    if waiting and not names:  # nothing but errors
        bare = _bare(starts)
        file.write(
            "".join(_line(bare, one) for one in [dict(zip(bare, bare, strict=True)), *waiting])
        )
    if args.output is None:
        return count.finish("they are printed. With --output FILE the next time --resume continues")
    return count.finish(f"they are in {args.output}. To continue, add --resume to the same command")


def _bare(starts: Sequence[Start]) -> list[str]:
    """The names of a row that has no results."""
    return ["row", *starts[0].others, "error"]


def _flat(units: Units, start: Start, row: dict[str, Any]) -> dict[str, Any]:
    """A row of a table: its number, the columns that were kept, and the results."""
    flat = units.row(row)
    kept = {name if name not in flat else f"given {name}": v for name, v in start.others.items()}
    return {"row": flat.pop("row"), **kept, **flat}


def _rows(
    starts: Sequence[Start], report: Report, done: int
) -> Iterator[tuple[Start, dict[str, Any]]]:
    """The rows behind those that are done, with a bar on a terminal where they take long."""
    bar = tqdm(
        total=len(starts), initial=done, disable=None, delay=1.0, unit="row", unit_scale=True
    )
    with bar:
        for k, start in enumerate(starts[done:], start=done + 1):
            yield start, _row(k, start, report)
            bar.update()


def _row(number: int, start: Start, report: Report) -> dict[str, Any]:
    found, error = dict[str, Any](), start.error
    if start.state is not None:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # in the column of cautions
                found = report(start)
        except ns.NonsmoothError as failure:
            error = " ".join(str(failure).split())
    return {"row": number, **found, "error": error}


def _line(names: list[str], row: dict[str, Any]) -> str:
    text = io.StringIO()
    csv.DictWriter(text, names, restval="", lineterminator="\n").writerow(row)
    return text.getvalue()


def _kept(args: argparse.Namespace, starts: Sequence[Start], report: Report) -> _Kept:
    """Read the rows of an earlier output; its first and last results must come out again."""
    if not os.path.exists(args.output):
        return _Kept([], [], 0)
    try:
        with open(args.output, newline="", encoding="utf-8") as file:
            text = file.read(LARGEST + 1)
        whole = text[: text.rfind("\n") + 1]
        lines = list(csv.reader(io.StringIO(whole)))
    except (ValueError, csv.Error) as error:
        raise _others(args, f"what is no CSV ({error})") from error
    if len(text) > LARGEST or any(len(line) != len(lines[0]) for line in lines):
        raise _others(args, f"more than {LARGEST} characters, or rows of different lengths")
    names = lines[0] if lines else []
    if not lines or names == _bare(
        starts
    ):  # nothing, or nothing but errors: the names were not known
        return _Kept([], [], 0)
    rows = [dict(zip(names, line, strict=False)) for line in lines[1:]]
    units = Units(args.units)
    if len(rows) > len(starts):
        raise _others(args, f"{len(rows)} rows for {len(starts)}")
    results = [k for k, row in enumerate(rows) if not row.get("error")]
    again = sorted({*results[:1], *results[-1:], *range(len(rows))[-1:]})
    for k, old in enumerate(rows):
        if not _begins(old, starts[k], units):
            raise _others(args, f"another start in row {k + 1}")
        if k in again:
            row = _flat(units, starts[k], _row(k + 1, starts[k], report))
            if not {*row} <= {*names} or _line(names, row) != _line(names, old):
                raise _others(args, f"other results in row {k + 1}")
    return _Kept(names, rows, len(whole.encode()))


def _begins(row: dict[str, str], start: Start, units: Units) -> bool:
    """Whether a row has the speed and the angle of a start (its spin depends on a tilted axis)."""
    for name in ("speed", "angle"):
        column = f"{name} [{units.names[name]}]"
        value = row.get(f"launch_{column}") or row.get(f"landing_{column}")
        if value and (start.state is None or value != str(units.cell(name, start.typed[name]))):
            return False
    return True


def _others(args: argparse.Namespace, received: str) -> ns.OptionError:
    return ns.OptionError(
        f"--resume: expected in {args.output} the first rows of what {args.input} gives with these "
        f"options, received {received}. Name another file, or leave out --resume to begin again."
    )


class _Count:
    def __init__(self, total: int):
        self.total, self.done, self.wrong, self.warned = total, 0, 0, 0
        self.interrupted = False

    def add(self, row: dict[str, Any]) -> None:
        self.done += 1
        self.wrong += bool(row["error"])
        self.warned += bool(row.get("cautions"))

    def finish(self, kept: str) -> int:
        """Print the counts of errors and cautions, and return the exit code."""
        lines = []
        if self.warned:
            lines.append(f"bounce: caution: {self.warned} of {self.done} rows: see cautions")
        if self.wrong:
            lines.append(f"bounce: error: {self.wrong} of {self.done} rows: see the column error")
        if self.interrupted:
            lines.append(f"bounce: interrupted after {self.done} of {self.total} rows; {kept}.")
        for line in lines:
            print(line, file=sys.stderr)
        return INTERRUPTED if self.interrupted else int(self.wrong > 0)
