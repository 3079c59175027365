"""Welander 1982: a box of ocean with heat and salt that mixes and stops mixing by itself.

``model`` has the model and its cycle, ``results`` the claims, ``figures`` the pictures.
"""

from __future__ import annotations

from ..record import FROM_MEMORY, Paper, claims
from . import figures, results

PAPER = Paper(
    name="welander_1982",
    title="After Welander (1982): the ocean box",
    source="P. Welander, A simple heat-salt oscillator, Dyn. Atmos. Oceans 6 (1982) 233-242, in the "
    f"nonsmooth form of the later literature (J. Leifeld, 2016). {FROM_MEMORY}",
    tables=(claims(results.claim),),
    pictures=figures.picture,
)
