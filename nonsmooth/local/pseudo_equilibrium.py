"""A pseudo-equilibrium, a zero of the sliding flow: what the searches for one return."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from ..model import Array
from .regions import Region


@dataclass(frozen=True, eq=False)
class PseudoEquilibrium:
    """A zero of the sliding field.

    Attributes
    ----------
    point : ndarray (n,)
        The point, in the order of the states.
    alpha : float
        Weight of $F2$; in (0, 1) for a real one. NaN on several surfaces.
    status : {"real", "virtual"}
        Virtual if $alpha$ is outside (0, 1): the fields are parallel there, not opposite. On several
        surfaces: if a multiplier is outside (-1, 1).
    region : Region
        On several surfaces: whether sliding along their intersection attracts or repels, else MIXED.
    kind : str
        ``"stable pseudo-node"``, ``"unstable pseudo-node"``, ``"pseudo-saddle"``, with complex
        eigenvalues ``"stable pseudo-focus"``, ...; ``"pseudo-saddle-node"`` or ``"degenerate"``
        where the sliding flow decides nothing.
    eigenvalues : ndarray (n - k,)
        Of the sliding field on the tangent space of the surface ($k = 1$) or of k that meet, by real part.
    stable : bool
        Attracting from the surface and along it.
    margin : float
        Smallest of: $alpha$, $1 - alpha$, the real parts relative to the largest modulus of $D F_i$.
    distance, residual : float
        Distance from the start of the search, and what is left of the equations.
    iterations : int
        Iterations that Newton's method took; 0 where nothing was searched.
    mode : str
        One letter for each surface, ``s`` for those that slide.
    multipliers : ndarray (k,)
        Of those, $1 - 2 alpha$ on one surface.
    """

    point: Array
    alpha: float
    status: str
    region: Region
    kind: str
    eigenvalues: NDArray[Any]
    stable: bool
    margin: float
    distance: float
    residual: float
    iterations: int
    mode: str
    multipliers: Array

    def __str__(self) -> str:
        values = ", ".join(f"{v:.6g}" for v in self.eigenvalues) or "none"
        weights, place = f"alpha = {self.alpha:.6g}", "the surface"
        if self.multipliers.size > 1:
            weights = f"multipliers {', '.join(f'{v:.6g}' for v in self.multipliers)}"
            place = f"the intersection {self.mode}"
        return (
            f"{self.status} {self.kind} at {self.point.tolist()} in {self.region}, "
            f"{weights}, eigenvalues along {place} {values}."
        )


def pseudo_kind(kind: str, region: Region) -> str:
    """Kind of the sliding flow and stability across the surface, together."""
    if kind == "degenerate":
        return "pseudo-saddle-node"
    stability, _, shape = kind.partition(" ")
    across = {Region.ATTRACTING: "stable", Region.REPELLING: "unstable"}.get(region, stability)
    return f"{stability} pseudo-{shape}" if stability == across else "pseudo-saddle"
