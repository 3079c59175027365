"""Reproduce the paper: ``python -m papers.biber_2022 [--out build/biber_2022]``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from .. import program
from ..pictures import save
from . import equations, errata, figures, report, results, table, theorems


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute everything, print the claims, write tables, figures and the report.

    Returns
    -------
    int
        0 if every check holds, else 1.
    """
    folder = program.folder_of("biber_2022", arguments)
    steps = [
        *[("erratum", lambda n=n: errata.erratum(n)) for n in range(1, len(errata.ALL) + 1)],
        *[("claim", compute) for compute in (*results.ALL, *theorems.ALL)],
        *[("equation", compute) for compute in equations.ALL],
        *[("figure", lambda p=p: save(p, folder)) for p in figures.PICTURES],
    ]
    done = program.run(steps)
    claims, found, shown = (done.get(kind, []) for kind in ("claim", "erratum", "equation"))
    written = report.build(claims, found, shown, table.recomputed(), figures.PICTURES)
    program.finish(written, claims, folder)
    failed = [c.id for c in claims if not c.holds]
    failed += [f"erratum {e.number}" for e in found if not e.confirmed]
    failed += [f"equation {e.number}" for e in shown if not e.holds]
    return program.status_of(failed)


if __name__ == "__main__":
    sys.exit(main())
