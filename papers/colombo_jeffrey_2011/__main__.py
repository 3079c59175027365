"""Follow the model after the paper: ``python -m papers.colombo_jeffrey_2011 [--out FOLDER]``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from ..program import Paper, reproduce
from . import figures, results

PAPER = Paper(
    name="colombo_jeffrey_2011",
    title="After Colombo & Jeffrey (2011): two-folds of every kind, and recurrence",
    source="A. Colombo and M. R. Jeffrey, Nondeterministic chaos, and the two-fold singularity in "
    "piecewise smooth flows, SIAM J. Appl. Dyn. Syst. 10 (2011) 423-451.",
    note="Statements and notation are quoted from memory; the paper was not at hand, so this is a model after it and no reproduction of it. The recurrent "
    "system is an example of our own.",
    claims=results.ALL,
    pictures=figures.PICTURES,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute the claims, draw the figures, write the report; 0 if every check holds."""
    return reproduce(PAPER, arguments)


if __name__ == "__main__":
    sys.exit(main())
