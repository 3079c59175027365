"""Follow the model after the paper: ``python -m papers.kuznetsov_2003 [--out FOLDER]``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from ..program import Paper, reproduce
from . import figures, results

PAPER = Paper(
    name="kuznetsov_2003",
    title="After Kuznetsov, Rinaldi & Gragnani (2003): a harvested predator",
    source="Yu. A. Kuznetsov, S. Rinaldi and A. Gragnani, One-parameter bifurcations in planar Filippov "
    "systems, Int. J. Bifurcation Chaos 13 (2003) 2157-2188.",
    note="Statements and parameters are quoted from memory; the paper was not at hand, so this is a model after it and no reproduction of it.",
    claims=results.ALL,
    pictures=figures.PICTURES,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute the claims, draw the figures, write the report; 0 if every check holds."""
    return reproduce(PAPER, arguments)


if __name__ == "__main__":
    sys.exit(main())
