"""Colombo & Jeffrey 2011: every two-fold in three dimensions, and chaos without determinism.

``model`` has the normal form of all kinds and a system whose orbits return to the singularity,
``results`` the claims, ``figures`` the pictures.
"""

from __future__ import annotations

from ..record import FROM_MEMORY, Paper, claims
from . import figures, results

PAPER = Paper(
    name="colombo_jeffrey_2011",
    title="After Colombo & Jeffrey (2011): two-folds of every kind, and recurrence",
    source="A. Colombo and M. R. Jeffrey, Nondeterministic chaos, and the two-fold singularity in "
    "piecewise smooth flows, SIAM J. Appl. Dyn. Syst. 10 (2011) 423-451. "
    f"{FROM_MEMORY} The recurrent system is an example of our own.",
    tables=(claims(results.claim),),
    pictures=figures.picture,
)
