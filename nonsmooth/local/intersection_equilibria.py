"""Pseudo-equilibria where several surfaces meet: f(x, lambda) = 0 with a multiplier for each of them.

Along the intersection their stability is that of the n - k eigenvalues of D(f(x, lambda(x))) on its tangent
space, with lambda(x) from grad h_i . f = 0; across it, that of the sliding there (``intersections``).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..model import (
    Array,
    DefinitionError,
    FilippovSystem,
    LayerNumbers,
    Parameters,
    PointError,
    explain,
    layer_of,
)
from .equilibria import by_real_part, kind_of
from .intersections import Meeting
from .place import TOLERANCE
from .pseudo_equilibrium import PseudoEquilibrium, pseudo_kind
from .regions import Region
from .search import Found, search

#: What sliding does across the intersection, as one surface would name it.
_REGIONS = {
    "attracting": Region.ATTRACTING,
    "spiralling in": Region.ATTRACTING,
    "repelling": Region.REPELLING,
    "spiralling out": Region.REPELLING,
}


def sliding_in(system: FilippovSystem, mode: str) -> int:
    """Number of sliding surfaces of a mode, checked."""
    return system.parse_mode(mode).count(0)


def find_on_intersection(
    system: FilippovSystem,
    near: ArrayLike,
    mode: str,
    parameters: Parameters | None,
    *,
    tol: float,
    max_iterations: int,
) -> PseudoEquilibrium:
    """Find a pseudo-equilibrium on the surfaces that slide in a mode."""
    x, p = system.extended_point(near, 0.0), system.parameter_vector(parameters)
    letters = np.array(system.parse_mode(mode), float)
    chosen, n = np.flatnonzero(letters == 0.0), x.size
    if chosen.size > n:
        raise DefinitionError(
            explain(
                f"mode {mode!r}",
                expected=f"at most {n} surfaces that meet in a space of {n} states",
                received=f"{chosen.size}",
                advice="Give + or - to the others.",
            )
        )
    layer = layer_of(system)

    def multipliers(u: Array) -> Array:
        values = letters.copy()
        values[chosen] = u[n:]
        return values

    def equations(u: Array) -> tuple[Array, Array]:
        at = layer.at(u[:n], multipliers(u), p)
        matrix = np.zeros((n + chosen.size, n + chosen.size))
        matrix[:n, :n], matrix[:n, n:] = at.field_x, at.field_l[:, chosen]
        matrix[n:, :n] = at.h_x[chosen]
        return np.concatenate([at.field, at.h[chosen]]), matrix

    first = layer.at(x, letters, p)
    slope = first.rates_l[np.ix_(chosen, chosen)]
    guess = np.clip(np.linalg.lstsq(slope, -first.rates[chosen], rcond=None)[0], -1.0, 1.0)
    what = "pseudo-equilibrium"
    start = np.concatenate([x, guess])
    found = search(equations, start, tol=tol, max_iterations=max_iterations, what=what)
    away = float(np.linalg.norm(found.x[:n] - x))
    place = Meeting(system, found.x[:n], p, chosen.tolist(), letters)
    return equilibrium_of(place, found.x[n:], replace(found, x=found.x[:n], distance=away))


def equilibrium_of(place: Meeting, multipliers: Array, found: Found) -> PseudoEquilibrium:
    """Describe the pseudo-equilibrium at a point of an intersection where the sliding flow vanishes."""
    chosen = place.surfaces
    lam = place.held.copy()
    lam[chosen] = multipliers
    at = place.at(lam)
    eigenvalues = by_real_part(along_intersection(at, chosen)[0])
    across = place.attraction(lam)
    region = _REGIONS.get(across, Region.MIXED)
    scale = float(np.linalg.norm(at.field_x, 2)) or 1.0
    layer = np.linalg.eigvals(at.rates_l[np.ix_(chosen, chosen)])
    kind, margin = _kind(eigenvalues, layer, region, scale)
    inside = float(np.min(1.0 - np.abs(multipliers)))
    return PseudoEquilibrium(
        point=found.x,
        alpha=float("nan"),
        status="real" if inside > 0.0 else "virtual",
        region=region,
        kind=kind if region is not Region.MIXED else f"{kind}, {across}",
        eigenvalues=eigenvalues,
        stable=region is Region.ATTRACTING and inside > 0.0 and kind.startswith("stable"),
        margin=min(abs(inside), margin),
        distance=found.distance,
        residual=found.residual,
        iterations=found.iterations,
        mode="".join("s" if i in chosen else "+" if v > 0 else "-" for i, v in enumerate(lam)),
        multipliers=multipliers,
    )


def _kind(
    eigenvalues: NDArray[Any], layer: NDArray[Any], region: Region, scale: float
) -> tuple[str, float]:
    """Name by the eigenvalues along the intersection; where there are none, by what is across."""
    if eigenvalues.size:
        along, margin = kind_of(eigenvalues, scale)
        return pseudo_kind(along, region), margin
    shape = "focus" if np.any(np.abs(layer.imag) > 0.0) else "node"
    stability = {Region.ATTRACTING: "stable ", Region.REPELLING: "unstable "}.get(region, "")
    return f"{stability}pseudo-{shape}", float("inf")


def along_intersection(at: LayerNumbers, surfaces: list[int]) -> tuple[Array, Array]:
    """D(f(x, lambda(x))) on the tangent space (N - k, N - k), where f = 0, and its basis (N, N - k).

    lambda_x = -(dG/dlambda)^-1 dG/dx, with G the rates of the surfaces.

    Raises
    ------
    PointError
        Where dG/dlambda is singular.
    """
    gradient = at.h_x[surfaces]
    basis = np.linalg.svd(gradient)[2][len(surfaces) :].T
    if not basis.size:
        return np.zeros((0, 0)), basis
    slope = at.rates_l[np.ix_(surfaces, surfaces)]
    if np.linalg.cond(slope) * TOLERANCE > 1.0:
        raise PointError(
            explain(
                "pseudo-equilibrium on an intersection",
                expected="multipliers that are determined by the rates of the surfaces",
                received=f"d(rates)/d(multipliers) = {slope.tolist()}, singular",
                advice="The sliding flow is not defined there.",
            )
        )
    drift = np.linalg.solve(slope, at.rates_x[surfaces])
    whole = at.field_x - at.field_l[:, surfaces] @ drift
    return basis.T @ whole @ basis, basis
