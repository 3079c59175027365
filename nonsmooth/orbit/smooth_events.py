"""What branches off at the smooth bifurcations of a periodic orbit, and whether it is stable."""

from __future__ import annotations

import numpy as np

from ..local.read_only import ReadOnly
from ..model import Array
from .boundary import BoundaryProblem, Evaluation
from .branch import FarSide
from .map_derivatives import normal_form
from .multipliers import return_map

_WORDS = {
    "fold": "two orbits meet and vanish",
    "branch point": "branches cross",
    "period doubling": "an orbit of twice the period branches off",
    "pitchfork": "two orbits without the symmetry branch off",
    "Neimark-Sacker": "an invariant torus is born",
}

#: Angles that are this close to a strong resonance have normal forms of their own.
_RESONANT = 1e-4


def smooth_side(problem: BoundaryProblem, at: Evaluation, p: Array, kind: str) -> FarSide | None:
    """Classify a smooth bifurcation; None for a neutral saddle in place of a Neimark-Sacker point.

    Parameters
    ----------
    problem : BoundaryProblem
    at : Evaluation
    p : ndarray
    kind : str
    """
    words, numbers = _WORDS[kind], dict[str, float]()
    if kind in ("fold", "branch point"):
        return FarSide("", words)
    values = np.linalg.eigvals(return_map(problem, at))
    critical = [int(np.argmin(np.abs(values + 1.0)))]
    if kind == "Neimark-Sacker":
        k, l = np.triu_indices(values.size, 1)
        near = int(np.argmin(np.abs(values[k] * values[l] - 1.0)))
        critical = [int(k[near]), int(l[near])]
        pair = values[k[near]]
        if abs(pair.imag) < 1e-9:
            return None  # a neutral saddle: two real multipliers with the product 1
        numbers["angle"] = angle = float(abs(np.angle(pair)))
        if min(abs(3.0 * angle - 2.0 * np.pi), abs(4.0 * angle - 2.0 * np.pi)) < _RESONANT:
            return FarSide("", f"{words}; not classified: a strong resonance", ReadOnly(numbers))
    found = normal_form(problem, at, p, kind)
    if not found:
        return FarSide("", f"{words}; not classified: no orbits beside it", ReadOnly(numbers))
    value, error = found.values()
    numbers |= found
    if abs(value) <= 10.0 * error:
        return FarSide("", f"{words}; degenerate to rounding", ReadOnly(numbers))
    grows = (value < 0.0) if kind == "Neimark-Sacker" else (value > 0.0)
    rest = np.delete(values, critical)
    stable = grows and bool(np.all(np.abs(rest) < 1.0))
    what = "supercritical" if grows else "subcritical"
    return FarSide("", f"{words} ({what}{', stable' if stable else ''})", ReadOnly(numbers))
