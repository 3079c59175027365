"""Jeffrey & Colombo 2009: the invisible two-fold (Teixeira singularity) and its nonsmooth diabolo.

``model`` has the normal form and its crossing orbits, ``results`` the claims, ``figures`` the
pictures.
"""

from __future__ import annotations

from ..record import FROM_MEMORY, Paper, claims
from . import figures, results

PAPER = Paper(
    name="jeffrey_colombo_2009",
    title="After Jeffrey & Colombo (2009): the invisible two-fold",
    source="M. R. Jeffrey and A. Colombo, The two-fold singularity of discontinuous vector fields, "
    f"SIAM J. Appl. Dyn. Syst. 8 (2009) 624-640. {FROM_MEMORY}",
    tables=(claims(results.claim),),
    pictures=figures.picture,
)
