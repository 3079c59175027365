"""Follow the model after the paper: ``python -m papers.jeffrey_colombo_2009 [--out FOLDER]``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from ..program import Paper, reproduce
from . import figures, results

PAPER = Paper(
    name="jeffrey_colombo_2009",
    title="After Jeffrey & Colombo (2009): the invisible two-fold",
    source="M. R. Jeffrey and A. Colombo, The two-fold singularity of discontinuous vector fields, "
    "SIAM J. Appl. Dyn. Syst. 8 (2009) 624-640.",
    note="Statements and notation are quoted from memory; the paper was not at hand, so this is a model after it and no reproduction of it.",
    claims=results.ALL,
    pictures=figures.PICTURES,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute the claims, draw the figures, write the report; 0 if every check holds."""
    return reproduce(PAPER, arguments)


if __name__ == "__main__":
    sys.exit(main())
