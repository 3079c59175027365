"""Reproduce the paper: ``python -m papers.biber_2022 [--out build/biber_2022]``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from . import equations, errata, figures, report, results, table


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute everything, print the claims, write tables, figures and the report.

    Returns
    -------
    int
        0 if every check holds, else 1.
    """
    parser = argparse.ArgumentParser(prog="papers.biber_2022", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("build/biber_2022"), help="folder")
    folder = parser.parse_args(arguments).out
    folder.mkdir(parents=True, exist_ok=True)
    steps = [
        *[("erratum", lambda n=n: errata.erratum(n)) for n in range(1, len(errata.ALL) + 1)],
        *[("claim", compute) for compute in results.ALL],
        *[("equation", compute) for compute in equations.ALL],
        *[("figure", lambda p=p: figures.save(p, folder)) for p in figures.PICTURES],
    ]
    done: dict[str, list] = {"erratum": [], "claim": [], "equation": [], "figure": []}
    for kind, compute in (bar := tqdm(steps, unit="step", leave=False)):
        bar.set_description(f"{kind:9}", refresh=False)
        done[kind].append(compute())
    claims, found, shown = done["claim"], done["erratum"], done["equation"]
    written = report.write(folder, claims, found, shown, table.recomputed(), figures.PICTURES)
    print(report.claims_text(claims))
    print()
    print(report.summary(claims, found, shown))
    print(
        f"{len(written)} tables and {len(figures.PICTURES)} figures in {folder}/; "
        f"read {folder / 'report.html'}"
    )
    failed = [c.id for c in claims if not c.holds]
    failed += [f"erratum {e.number}" for e in found if not e.confirmed]
    failed += [f"equation {e.number}" for e in shown if not e.holds]
    if failed:
        print(f"CHECKS FAIL: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
