"""What a point is: the answer of ``classify``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from ..model import Array
from .point.sides import FIELDS


@dataclass(frozen=True, eq=False)
class LocalObject:
    """What a point is.

    Attributes
    ----------
    kind : str
        ``"crossing"``, ``"sliding"``, ``"fold"``, ``"cusp"``, ``"fold-fold"`` (plane),
        ``"two-fold"``, ``"equilibrium"``, ``"pseudo-equilibrium"``, ``"boundary equilibrium"``,
        ``"intersection"`` (of surfaces, where no mode or several can go on) or ``"degenerate"``.
    label : str
        Its class: ``"crossing up"``, ``"attracting sliding"``, ``"visible"``, ``"II2"``,
        ``"VV-C1"``, ``"stable focus"``, ``"pseudo-saddle"``, ``"BF3"``, ``"crossing to +-"``, ...
    side : {"+", "-", ""}
        The field to which a fold, cusp, equilibrium or boundary equilibrium belongs.
    point : ndarray (n,)
        The point, in the order of the states.
    distance : float
        To the nearest degenerate case; below the margin the kind is ``"degenerate"``.
    nearest : str
        Which condition that is, e.g. ``"L1 = 0"``.
    margins : mapping
        Distance from each condition that was looked at.
    evidence : mapping
        Numbers: ``h``, ``L1``, ``L2``, and what decided the class.
    detail : object
        The Fold, TwoFold, FoldFold, BoundaryEquilibrium, PseudoEquilibrium or Intersection, if there is
        one.
    """

    kind: str
    label: str
    side: str
    point: Array
    distance: float
    nearest: str
    margins: Mapping[str, float]
    evidence: Mapping[str, float]
    detail: Any = None

    def __str__(self) -> str:
        field = f" of {FIELDS[self.side]}" if self.side else ""
        name = self.label if self.label == self.kind else f"{self.kind}: {self.label}"
        numbers = ", ".join(f"{k} = {v:.6g}" for k, v in self.evidence.items())
        away = f"{self.distance:.3g} from {self.nearest}" if self.nearest else "nothing is near"
        return f"{name}{field} at {self.point.tolist()} ({away}). {numbers}"


def spectrum(eigenvalues: NDArray[Any]) -> dict[str, float]:
    """Eigenvalues as numbers: real parts, and imaginary parts where they are not zero."""
    values: dict[str, float] = {}
    for i, v in enumerate(eigenvalues, 1):
        values[f"Re lambda{i}"] = float(v.real)
        if v.imag:
            values[f"Im lambda{i}"] = float(v.imag)
    return values
