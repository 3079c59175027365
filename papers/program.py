"""The program of a paper: compute the claims, draw the figures, write the report."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tqdm import tqdm

from . import report
from .claims import Claim
from .pictures import Picture, save

Step = tuple[str, Callable[[], Any]]


@dataclass(frozen=True)
class Paper:
    """What ``reproduce`` needs of a paper.

    Attributes
    ----------
    name : str
        Of its folder.
    title, source : str
    note : str
        What is not as in the paper: parameters or statements quoted from memory.
    claims : tuple of callable
        Each returns a Claim.
    pictures : tuple of Picture
    """

    name: str
    title: str
    source: str
    note: str
    claims: tuple[Callable[[], Claim], ...]
    pictures: tuple[Picture, ...]


def folder_of(name: str, arguments: Sequence[str] | None) -> Path:
    """Read ``--out`` from the command line and make that folder."""
    parser = argparse.ArgumentParser(
        prog=f"papers.{name}", description="Compute the claims, draw the figures, write the report."
    )
    parser.add_argument("--out", type=Path, default=Path("build") / name, help="folder")
    folder: Path = parser.parse_args(arguments).out
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def run(steps: Sequence[Step]) -> dict[str, list[Any]]:
    """Take steps, with a bar that shows the progress; results in order, by the kind of step."""
    done: dict[str, list[Any]] = {kind: [] for kind, _ in steps}
    for kind, compute in (bar := tqdm(steps, unit="step", leave=False)):
        bar.set_description(f"{kind:9}", refresh=False)
        done[kind].append(compute())
    return done


def finish(written: report.Report, claims: Sequence[Claim], folder: Path) -> None:
    """Write the report, print the claims and where everything is."""
    files = written.write(folder)
    print(report.claims_text(claims))
    print()
    print(written.summary)
    print(
        f"{len(files)} tables and {len(written.pictures)} figures in {folder}/; "
        f"read {folder / 'report.html'}"
    )


def status_of(failed: Sequence[str]) -> int:
    """Exit status: 0, or 1 with the names of what failed on stderr."""
    if failed:
        print(f"CHECKS FAIL: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


def reproduce(paper: Paper, arguments: Sequence[str] | None = None) -> int:
    """Compute everything, print the claims, write tables, figures and the report.

    Returns
    -------
    int
        0 if every check holds, else 1.
    """
    folder = folder_of(paper.name, arguments)
    steps: list[Step] = [("claim", compute) for compute in paper.claims]
    steps += [("figure", lambda p=p: save(p, folder)) for p in paper.pictures]  # type: ignore[misc]
    claims: list[Claim] = run(steps).get("claim", [])
    written = report.Report(
        paper.title,
        f"{paper.source} {paper.note}",
        report.verdicts(claims),
        [report.claims_section(claims)],
        paper.pictures,
        {"note": paper.note, "claims": [c.as_dict() for c in claims]},
    )
    finish(written, claims, folder)
    return status_of([c.id for c in claims if not c.holds])
