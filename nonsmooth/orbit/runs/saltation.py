"""Saltation matrices, by one formula for every kind of event.

At an event e(x, p) = 0 the field changes from f- to f+, the field of the mode after everything that
happens at that instant, and the state jumps by a reset g (the identity if there is none). A neighbour
x + dx reaches the event at another time, so

    dt = -(e_x dx + e_p dp)/(e_x f-),    dx+ = g_x dx + g_p dp + (g_x f- - f+) dt,

    S = g_x + (f+ - g_x f-) e_x/(e_x f-),    S_p = g_p + (f+ - g_x f-) e_p/(e_x f-).

It holds for crossings, entries to sliding (S loses one rank), exits (f+ = f-, so S = 1), resets,
impacts, stops, clocks that are states, and surfaces that move with the time, which is a state then.

Source: Aizerman & Gantmakher 1958; Leine & Nijmeijer 2004, "Dynamics and bifurcations of non-smooth
mechanical systems", ch. 7; di Bernardo et al. 2008, "Piecewise-smooth dynamical systems", sec. 2.5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...model import Array, DegenerateError
from ...model.derivatives.event_maps import AtEvent

#: Angle between orbit and surface below which an event is a grazing.
GRAZING = 1e-8

#: Relative difference of two fields below which they are one.
_CONTINUOUS = 1e-10


@dataclass(eq=False)
class Saltation:
    """Derivatives through an event, or stacked through many: S = g_x - (f+ - g_x f-) dt_x."""

    after_state: Array  # g_x (N, N + k)
    after_parameters: Array  # g_p (N, np)
    jump: Array  # f+ - g_x f- (N,), zero where the derivative is continuous
    time_by_state: Array  # dt_x of the event, (N + k,)
    time_by_parameters: Array  # dt_p (np,)
    angle: Any  # |e_x f-|/(|e_x| |f-|), zero at a grazing
    kept: Any = False  # whether the jump is zero
    smooth: bool = False  # whether g is the identity

    def _after(self, map_by: Array, time_by: Array) -> Array:
        if np.all(self.kept):
            return map_by
        moved = np.where(np.asarray(self.kept)[..., None], 0.0, time_by)
        return np.asarray(map_by - self.jump[..., :, None] * moved[..., None, :])

    @cached_property
    def matrix(self) -> Array:
        """S (N, N + k)."""
        return self._after(self.after_state, self.time_by_state)

    @cached_property
    def by_parameters(self) -> Array:
        """S_p (N, np)."""
        return self._after(self.after_parameters, self.time_by_parameters)

    def of(self, k: int, smooth: bool) -> Saltation:
        """One of many; ``smooth``: its g is the identity."""
        return Saltation(
            self.after_state[k],
            self.after_parameters[k],
            self.jump[k],
            self.time_by_state[k],
            self.time_by_parameters[k],
            float(self.angle[k]),
            bool(self.kept[k]),
            smooth,
        )

    def pull(self, row: Array, by_parameters: Array) -> Array:
        """A row (N,) after the event as one before it; what it gives by all parameters is added."""
        back = row if self.smooth else row @ self.after_state
        if not self.smooth:
            by_parameters += row @ self.after_parameters
        if self.kept:
            return back
        later = float(row @ self.jump)
        by_parameters -= later * self.time_by_parameters
        return np.asarray(back - later * self.time_by_state)


def saltation(
    at: AtEvent, before: Array, after: Array, what: str = "event", slow: bool = False
) -> Saltation:
    """Saltation matrix of an event, which may be ``slow``."""
    rows = (before, at.after_state, at.after_parameters, at.gradient, at.by_parameters)
    ends, may_be = Ended(*[row[None] for row in rows]), np.array([slow])
    found = saltations(ends, after[None], lambda _: what, slow=may_be)
    return found.of(0, at.smooth)


class Ended(NamedTuple):
    """Ends of legs with their events, stacked: fields, maps and functions of the events with derivatives."""

    rate: Array
    after_state: Array
    after_parameters: Array
    gradient: Array
    value_parameters: Array


class Passed(NamedTuple):
    """How legs pass their events: speeds across them, angles, jumps of the field, and where it has none."""

    speed: Array
    angle: Array
    jump: Array
    kept: NDArray[np.bool_]


def passages(
    ends: Ended,
    after: Array,
    named: Callable[[int], str],
    events: NDArray[np.bool_] | None = None,
    slow: NDArray[np.bool_] | None = None,
    units: Array | None = None,
) -> Passed:
    """Passages of the events of many legs, none of which may be grazed but those that are ``slow``, as they accumulate.

    Angles are in the units (N,) of the states."""
    e, rate, g = ends.gradient, ends.rate, ends.after_state
    n = after.shape[1]
    own = np.append(np.ones(n) if units is None else units, np.ones(e.shape[1] - n))
    speed = (e * rate).sum(axis=1)
    carried = (g @ rate[:, :, None])[:, :, 0]
    jump = after - carried
    with np.errstate(over="ignore"):
        scaled = (e * own, rate / own, *(v / own[:n] for v in (jump, after, carried)))
        of_e, of_rate, of_jump, of_after, of_carried = map(_norms, scaled)
    size = of_e * of_rate
    angle = np.abs(speed) / np.where(size > 0.0, size, np.inf)
    kept = of_jump <= _CONTINUOUS * np.maximum(of_after, of_carried)
    if events is not None:
        kept |= ~events
    flat = (angle < GRAZING) & ~kept
    grazed = np.flatnonzero(flat if slow is None else flat & ~slow)
    if grazed.size:  # except by a clock: its phase has the rate 1
        ticks = ((e != 0.0).sum(axis=1) == 1) & (np.abs(speed) == np.abs(e).max(axis=1))
        grazed = grazed[~ticks[grazed]]
    if grazed.size:
        i = int(grazed[0])
        raise DegenerateError(_grazing(named(i), float(angle[i]), ends, i, jump[i]))
    return Passed(speed, angle, jump, kept)


def saltations(
    ends: Ended,
    after: Array,
    named: Callable[[int], str],
    events: NDArray[np.bool_] | None = None,
    slow: NDArray[np.bool_] | None = None,
) -> Saltation:
    """Saltation matrices of the events of many legs, stacked."""
    speed, angle, jump, kept = passages(ends, after, named, events, slow)
    with np.errstate(divide="ignore", invalid="ignore"):
        time_x = -ends.gradient / speed[:, None]
        time_p = -ends.value_parameters / speed[:, None]
    if events is not None:
        time_x[~events], time_p[~events] = 0.0, 0.0
    jump[kept] = 0.0
    return Saltation(ends.after_state, ends.after_parameters, jump, time_x, time_p, angle, kept)


def _norms(rows: Array) -> Array:
    """Lengths of rows, also of those whose squares overflow."""
    found: Array = np.sqrt((rows * rows).sum(axis=1))
    if not np.isinf(found).any():
        return found
    largest = np.abs(rows).max(axis=1)
    scaled = rows / np.where(largest > 0.0, largest, 1.0)[:, None]
    return np.asarray(largest * np.sqrt((scaled * scaled).sum(axis=1)))


def _grazing(what: str, angle: float, ends: Ended, i: int, jump: Array) -> str:
    """Message for a grazing at the end of leg i."""
    n = jump.size
    moved = not np.array_equal(ends.after_state[i, :, :n], np.eye(n))
    if moved:
        kind = (
            "a grazing of a reset or impact: the map has a square root there, whose derivative is "
            "infinite"
        )
    elif float(ends.gradient[i, :n] @ jump) > 0.0:
        kind = "a grazing of a sliding surface: the derivative jumps between neighbours that miss it and slide"
    else:
        kind = "a grazing of a surface beyond which the field leads away: the map is discontinuous there"
    return (
        f"{what}: the event is not transversal, with the angle {angle:.1e} between orbit and surface. It is "
        f"{kind}. Move the start or a parameter away from the grazing."
    )
