"""``classify`` where several surfaces meet: what goes on there, and how clearly."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..model import FilippovSystem, Parameters, layer_of, require_system
from .equilibria import equilibrium_distance
from .intersection_equilibria import along_intersection, equilibrium_of
from .intersections import Intersection, Meeting
from .local_object import LocalObject, spectrum
from .read_only import ReadOnly
from .search import Found


def meeting_at(
    system: FilippovSystem,
    point: ArrayLike,
    parameters: Parameters | None,
    t: float,
    mode: str | None,
    tol: float,
) -> Meeting | None:
    """The intersection that a question is about, or None if it is about one surface.

    Raises
    ------
    PointError
        The point is not on the surfaces that slide in ``mode``.
    """
    require_system(system)
    if system.surface_count < 2:
        return None
    asked = None
    if mode is not None:
        asked = [i for i, sign in enumerate(system.parse_mode(mode)) if sign == 0]
        if len(asked) < 2:
            return None
    x, p = system.extended_point(point, t), system.parameter_vector(parameters)
    if asked is None:
        at = layer_of(system).at(x, np.zeros(system.surface_count), p)
        lengths = np.linalg.norm(at.h_x, axis=1) * (1.0 + np.linalg.norm(x))
        if np.count_nonzero(np.abs(at.h) <= tol * lengths) < 2:
            return None
    return Meeting.at_point(system, x, p, asked, tol)


def classify_intersection(meeting: Meeting, tol: float, margin: float) -> LocalObject:
    """Name what goes on where several surfaces meet."""
    found = meeting.intersection()
    margins = {"a change of the modes that can go on": found.distance}
    whole = found.sliding
    evidence: dict[str, float] = {}
    if whole is not None:
        evidence.update({f"multiplier {i}": float(whole.multipliers[i]) for i in found.surfaces})
    kind, label = _named(found)
    detail: object = found
    if whole is not None and len(found.continuations) == 1 and not meeting.system.time_dependent:
        at = meeting.at(whole.multipliers)
        matrix, basis = along_intersection(at, meeting.surfaces)
        along = basis.T @ at.field if basis.size else np.zeros(0)
        away = equilibrium_distance(along, matrix, meeting.x) if along.size else 0.0
        if away <= tol:
            here = Found(meeting.x)
            rest = equilibrium_of(meeting, whole.multipliers[meeting.surfaces], here)
            kind, label, detail = "pseudo-equilibrium", rest.kind, rest
            evidence.update(spectrum(rest.eigenvalues))
            if rest.eigenvalues.size:
                scale = float(np.linalg.norm(at.field_x, 2)) or 1.0
                slowest = float(np.abs(rest.eigenvalues.real).min())
                margins["a sliding eigenvalue without real part"] = slowest / scale
        else:
            margins["a pseudo-equilibrium"] = away
    nearest = min(margins, key=lambda name: margins[name])
    if margins[nearest] < margin:
        kind, label = "degenerate", f"near {nearest}"
    return LocalObject(
        kind,
        label,
        "",
        found.point,
        margins[nearest],
        nearest,
        ReadOnly(margins),
        ReadOnly(evidence),
        detail,
    )


def _named(found: Intersection) -> tuple[str, str]:
    """Kind and label of an intersection that is no pseudo-equilibrium."""
    modes = [c.mode for c in found.continuations]
    if found.sliding is not None and found.attraction in ("repelling", "spiralling out"):
        return "sliding", "repelling sliding"
    if len(modes) == 1:
        if found.sliding is not None:
            attracts = found.attraction in ("attracting", "spiralling in")
            return "sliding", "attracting sliding" if attracts else f"sliding, {found.attraction}"
        still = any(modes[0][i] == "s" for i in found.surfaces)
        return (
            ("sliding", f"sliding on in {modes[0]}")
            if still
            else ("crossing", f"crossing to {modes[0]}")
        )
    if not modes:
        return "intersection", "no mode can go on"
    return "intersection", f"several modes can go on: {', '.join(modes)}"
