"""Proofs about special points and orbits, in interval arithmetic of any precision.

A theorem here rests on the user's expressions as they are stored: gradients and Hessians are taken
of the stored instructions, constants are exact, and every number is an enclosure (python-flint, the
extra ``nonsmooth-dynamics[proofs]``). Where no enclosure exists, an error is raised.
"""

from __future__ import annotations

from typing import Any

from ..model.errors import MissingError
from ..result_tables import add_views
from .arithmetic.enclosure import Enclosure
from .orbits.orbit_proof import OrbitProof, ProvenEvent
from .points.census import Census, Undecided
from .proof import Proof, UnprovenError

try:
    from .orbits.certify_orbit import certify_orbit
    from .points.certify import certify
    from .points.prove_all import prove_all
except MissingError as error:  # the names are there, and say what is missing when they are called
    _reason = str(error)

    def _refuse(*args: Any, **options: Any) -> Any:
        raise MissingError(_reason)

    certify = certify_orbit = prove_all = _refuse

__all__ = [
    "Census",
    "Enclosure",
    "MissingError",
    "OrbitProof",
    "Proof",
    "ProvenEvent",
    "Undecided",
    "UnprovenError",
    "certify",
    "certify_orbit",
    "prove_all",
]

add_views(globals(), __all__)
