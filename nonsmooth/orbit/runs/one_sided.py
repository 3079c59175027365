"""One-sided derivatives of a run, as limits of the derivatives of its neighbours on one side.

At a corner, a grazing or an event at the very end derivatives jump between neighbours. Those of the neighbours from
x0 + eps d, with parameters p + eps q, are series in sqrt(eps), and the limit follows by extrapolation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...flow.simulate import simulate
from ...flow.status import Status
from ...flow.trajectory import Trajectory
from ...model import (
    Array,
    DegenerateError,
    NonsmoothError,
    OptionError,
    PointError,
    real,
    real_array,
)
from .limits import extrapolation_weights

Side = Mapping[str, Any] | ArrayLike

#: Distances of neighbours, in the direction that is given, from the first to the last.
_DISTANCES = 1e-2 * 4.0 ** -np.arange(11.0)

#: Error of an extrapolation, relative to the derivatives, above which there is no limit.
_UNRESOLVED = 1e-5

_TOLERANCE = 1e-13


def one_sided(
    run: Trajectory, side: Side, values: Callable[[Trajectory], Array], needed: int | None = None
) -> Array:
    """The limits of ``values`` (k,) of a run's neighbours in a direction; NaN where there is none, but not among the
    first that are ``needed``."""
    x, p = _direction(run, side)
    found, word, reason = list[Array](), None, ""
    for distance in reversed(
        _DISTANCES
    ):  # as far as neighbours have the same events as the nearest
        try:
            near = _neighbour(run, distance * x, {k: distance * v for k, v in p.items()})
            own = values(near)
        except NonsmoothError as error:
            reason = f" {error}"
            if found:
                break
            continue
        events = near.events.column("name").tolist(), near.events.column("kind").tolist()
        word = word or events
        if events != word:
            break
        found.append(own)
    best = _limits(np.array(found[::-1])) if len(found) > 2 else np.array([np.nan])
    if np.isfinite(best[:needed]).all():
        return best
    raise DegenerateError(
        f"side={side!r}: derivatives of the neighbours on this side have no finite limit, as where an impact is grazed, or "
        f"their events differ. Give the other side, or another direction.{reason}"
    )


def _limits(rows: Array) -> Array:
    """Limits of columns, from the farthest row to the nearest; NaN where they have none."""
    best, least = np.full(rows.shape[1], np.nan), np.full(rows.shape[1], np.inf)
    for last in range(len(rows), 2, -1):
        before = rows[last - 1]
        for m in range(1, last):
            limit = extrapolation_weights(0.5, m).real @ rows[last - m - 1 : last]
            change = np.abs(limit - before)
            better = change < least
            best[better], least[better], before = limit[better], change[better], limit
    best[~(least <= _UNRESOLVED * np.maximum(1.0, np.abs(best)))] = np.nan
    return best


def _direction(run: Trajectory, side: Side) -> tuple[Array, dict[str, float]]:
    """Direction in the start (n,) and in parameters by name."""
    given = side if isinstance(side, Mapping) else {"x0": side}
    n, known = run.system.dimension, run.system.parameter_names
    unknown = [name for name in map(str, given) if name != "x0" and name not in known]
    if unknown or not given:
        raise OptionError(
            f"side has {unknown or 'no entry'}. Give a direction of the start, or a mapping with 'x0' and names among {list(known)}."
        )
    values = {str(name): value for name, value in given.items()}
    try:
        x = real_array(values.pop("x0", np.zeros(n)), "side")
    except PointError:
        raise OptionError(
            f"side is {side!r}. Give a direction of the start: {n} numbers, or a mapping with 'x0' and names among "
            f"{list(known)}."
        ) from None
    p = {name: real(value, f"side[{name!r}]") for name, value in values.items()}
    if x.shape != (n,) or not np.isfinite(x).all() or not (x.any() or any(p.values())):
        raise OptionError(
            f"side={side!r} is no direction: give {n} finite numbers, not all of which are zero."
        )
    return x, p


def _neighbour(run: Trajectory, x: Array, p: Mapping[str, float]) -> Trajectory:
    parameters = {name: value + p.get(name, 0.0) for name, value in run.parameters.items()}
    begin, end = float(run.t[0]), float(run.t[-1])
    near = simulate(
        run.system,
        run.x[0] + x,
        end if run.status is Status.REACHED_END else 2 * end - begin,
        t_start=begin,
        parameters=parameters,
        tol=_TOLERANCE,
        t_eval=run.sample_t,
    )
    if near.status is not run.status:
        raise DegenerateError(f"A neighbour ends with {near.status}, not with {run.status}.")
    return near
