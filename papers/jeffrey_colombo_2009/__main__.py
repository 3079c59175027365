"""Reproduce the paper: ``python -m papers.jeffrey_colombo_2009 [--out FOLDER]``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from ..program import Paper, reproduce
from . import figures, results

PAPER = Paper(
    name="jeffrey_colombo_2009",
    title="Jeffrey & Colombo (2009), reproduced",
    source="M. R. Jeffrey and A. Colombo, The two-fold singularity of discontinuous vector fields, "
    "SIAM J. Appl. Dyn. Syst. 8 (2009) 624-640.",
    note="Statements and notation are quoted from memory; the paper was not at hand.",
    claims=results.ALL,
    pictures=figures.PICTURES,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute the claims, draw the figures, write the report; 0 if every check holds."""
    return reproduce(PAPER, arguments)


if __name__ == "__main__":
    sys.exit(main())
