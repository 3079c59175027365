"""Reproduce all papers, or those named: ``python -m papers [NAME ...] [--out build]``."""

from __future__ import annotations

import argparse
import importlib
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from tqdm import tqdm

from .claims import Row, failures
from .pictures import Picture
from .record import Done, Paper

#: In the order in which they run.
NAMES = (
    "biber_2022",
    "jeffrey_colombo_2009",
    "colombo_jeffrey_2011",
    "kuznetsov_2003",
    "welander_1982",
)


def paper_of(name: str) -> Paper:
    """The paper of a folder."""
    paper = importlib.import_module(f"{__package__}.{name}").PAPER
    assert isinstance(paper, Paper)
    return paper


def reproduce(paper: Paper, folder: Path) -> list[str]:
    """Compute a paper into ``folder``, saved after each step; return the names of rows that do not hold."""
    folder.mkdir(parents=True, exist_ok=True)
    done, wrong = Done(paper), list[str]()

    def row(title: str, compute: Callable[[], Row]) -> None:
        found = compute()
        done.rows.setdefault(title, []).append(found)
        tqdm.write(f"{found.verdict:16}{found.name}: {found.value}")
        for check in failures(found):
            tqdm.write(check, file=sys.stderr)
            wrong.append(found.name)

    def draw(picture: Picture) -> None:
        picture.save(folder)
        done.pictures.append(picture)

    steps = [(row, (part.title, compute)) for part in paper.tables for compute in part.rows]
    steps += [(draw, (picture,)) for picture in paper.pictures]  # type: ignore[list-item]
    for step, given in tqdm(steps, unit="step", leave=False):
        step(*given)
        (folder / "results.md").write_text(done.markdown(), encoding="utf-8")
    print(f"\n{done.summary()}; {folder / 'results.md'}", flush=True)
    return list(dict.fromkeys(wrong))


def main(arguments: Sequence[str] | None = None) -> int:
    """Reproduce papers one after the other; return 0 if every check of every paper holds, else 1."""
    parser = argparse.ArgumentParser(prog="papers", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"among {', '.join(NAMES)}")
    parser.add_argument("--out", type=Path, default=Path("build"), help="folder of their folders")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.names if name not in NAMES]
    if unknown:
        parser.error(f"no paper named {', '.join(unknown)}; there are {', '.join(NAMES)}")
    names, wrong = options.names or list(NAMES), list[str]()
    for k, name in enumerate(names):
        started = time.perf_counter()
        print(f"== {name}", flush=True)
        try:
            wrong += [f"{name}: {row}" for row in reproduce(paper_of(name), options.out / name)]
        except KeyboardInterrupt:
            print(
                f"Interrupted. What was computed is in {options.out}/. To continue:",
                file=sys.stderr,
            )
            print(f"  python -m papers {' '.join(names[k:])}", file=sys.stderr)
            return 130
        print(f"{time.perf_counter() - started:.0f} s\n", flush=True)
    if wrong:
        print(f"These do not hold: {'; '.join(wrong)}.", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
