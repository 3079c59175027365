"""Biber, Champneys & Szalai 2022: the bounce of a hard spinning ball, reproduced and corrected.

``model`` states the equations in the paper's notation, ``printed`` formulas that the paper prints
wrongly; ``results`` and ``theorems`` compute the claims, ``figures`` draws.
"""

from __future__ import annotations

from ..record import Paper, Table, claims
from . import equations, errata, figures, table, theorems

PAPER = Paper(
    name="biber_2022",
    title="Biber, Champneys & Szalai (2022), reproduced",
    source="S. W. Biber, A. R. Champneys and R. Szalai, Analysis of point-contact models of the bounce "
    "of a hard spinning ball on a compliant frictional surface.",
    tables=(
        claims(theorems.claim),
        Table(
            "Errata",
            "Each is derived again: identities in exact rational arithmetic with free values and "
            "gradients of the paper's functions, numbers by simulation.",
            ("no.", "where", "printed", "correct", "verdict"),
            errata.ROWS,
            evidence=True,
        ),
        Table(
            "Displayed equations",
            "All of them in order of appearance, unnumbered ones included. Numbers in brackets are "
            "those of the source on arXiv (2208.11685) when it is compiled.",
            ("no.", "equation", "content", "verdict"),
            equations.ALL,
            evidence=True,
        ),
        Table(
            "Entries of Table 1",
            "The dimensionless entries recomputed from the dimensional ones: velocity over the radius "
            "21.35 mm in 1/s, and rad/s. Agrees: within the roundings, for one radius near it.",
            ("surface", "entry", "dimensional", "printed", "computed", "verdict"),
            table.ROWS,
        ),
    ),
    pictures=figures.PICTURES,
    opening=errata.opening,
)
