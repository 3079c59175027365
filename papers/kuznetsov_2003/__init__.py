"""Kuznetsov, Rinaldi & Gragnani 2003: bifurcations of planar Filippov systems, the harvest model.

``model`` has the model and its sliding cycles, ``results`` the claims, ``figures`` the pictures.
"""

from __future__ import annotations

from ..record import FROM_MEMORY, Paper, claims
from . import figures, results

PAPER = Paper(
    name="kuznetsov_2003",
    title="After Kuznetsov, Rinaldi & Gragnani (2003): a harvested predator",
    source="Yu. A. Kuznetsov, S. Rinaldi and A. Gragnani, One-parameter bifurcations in planar Filippov "
    f"systems, Int. J. Bifurcation Chaos 13 (2003) 2157-2188. {FROM_MEMORY}",
    tables=(claims(results.claim),),
    pictures=figures.picture,
)
