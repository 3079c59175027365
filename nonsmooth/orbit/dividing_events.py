"""What a dividing surface of orbits that end at an event needs of the event."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..local.two_fold import TwoFold
from ..model import Array, DegenerateError, FilippovSystem, OptionError, explain
from ..model.event_maps import function_map
from .itinerary import read_word

#: Relative distance of a two-fold from its event, and sine of the angle of both zeros there.
_AT_EVENT = 1e-7


def require_event(
    system: FilippovSystem, until: object, fold: TwoFold, parameters: dict[str, float]
) -> None:
    """Refuse an event unless at it both fields have the same component across the surface.

    Parameters
    ----------
    system : FilippovSystem
    until : object
    fold : TwoFold
        At the event.
    parameters : dict

    Raises
    ------
    OptionError
        No stop has that name.
    DegenerateError
        The two-fold is not at the event, or the components differ there beside it.
    """
    names = [name for name, _ in system.stops]
    if until not in names:
        raise OptionError(
            explain(
                "until",
                expected=f"the name of a stop of the system, among {names}",
                received=repr(until),
                advice="Stops are given with stops=[nonsmooth.Stop(function, name=...)].",
            )
        )
    event = system.definition.guards[names.index(until)]
    jump = system.lie_derivative("+") - system.lie_derivative("-")
    p = system.parameter_vector(parameters)
    at, gap = (function_map(system, "+", of)(fold.point, p) for of in (event, jump))
    sizes = np.array([np.linalg.norm(row.gradient) for row in (at, gap)])
    unit = np.array([at.gradient, gap.gradient]) / np.where(sizes > 0.0, sizes, 1.0)[:, None]
    aside = abs(at.value) / (sizes[0] or 1.0) / (1.0 + float(np.linalg.norm(fold.point)))
    angle = float(np.linalg.svd(unit)[1][1])
    if not sizes.min() > 0.0 or aside > _AT_EVENT or angle > _AT_EVENT:
        raise DegenerateError(
            f"of: expected a two-fold at the event {until!r}, and fields with the same component across "
            f"the surface wherever it happens, received {fold.point.round(9).tolist()}, where the event's "
            f"function is {at.value:.3g} and its zeros turn from those of the difference by {angle:.3g}. "
            "Leave until out where orbits go on and two-folds part them."
        )


def read_begin(system: FilippovSystem, begin: Any) -> list[tuple[str, Array]]:
    """Points of a curve with their itineraries, one letter for each leg.

    Parameters
    ----------
    system : FilippovSystem
    begin : sequence of (str, array_like (2,)), or None

    Raises
    ------
    OptionError
    """
    if begin is None:
        return []
    try:
        pairs = [("".join(read_word(system, word)), np.array(u, dtype=float)) for word, u in begin]
    except (TypeError, ValueError):
        pairs = []
    if len(pairs) < 2 or any(u.shape != (2,) or not np.isfinite(u).all() for _, u in pairs):
        raise OptionError(
            explain(
                "begin",
                expected="two points or more of a curve, each as its itinerary and its two coordinates",
                received=repr(begin),
                advice="For example begin=[('+ s', (0.1, -0.5)), ('+ s', (0.11, -0.5))].",
            )
        )
    return pairs
