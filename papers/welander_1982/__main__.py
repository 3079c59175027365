"""Follow the model after the paper: ``python -m papers.welander_1982 [--out FOLDER]``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from ..program import Paper, reproduce
from . import figures, results

PAPER = Paper(
    name="welander_1982",
    title="After Welander (1982): the ocean box",
    source="P. Welander, A simple heat-salt oscillator, Dyn. Atmos. Oceans 6 (1982) 233-242, in the "
    "nonsmooth form of the later literature (J. Leifeld, 2016).",
    note="Statements and parameters are quoted from memory; the paper was not at hand, so this is a model after it and no reproduction of it.",
    claims=results.ALL,
    pictures=figures.PICTURES,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute the claims, draw the figures, write the report; 0 if every check holds."""
    return reproduce(PAPER, arguments)


if __name__ == "__main__":
    sys.exit(main())
