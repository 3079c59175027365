"""Guards along a leg: where they come near to zero, and whether the leg can be left as it says.

Along a step a guard is a polynomial, so its least values inside a leg are roots of a polynomial's
derivative: an itinerary is judged by them, not by samples.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..flow.watched import passing, watched
from ..model import Array, FilippovSystem, Guard
from ..model.variational import guarded_field, variational_field
from .legs import Leg

#: Part of a leg's duration beside its ends that belongs to the ends, where guards are zero.
_ENDS = 1e-6

#: A guard is negative below this part of its scale.
_NEGATIVE = 1e-9


@dataclass(frozen=True)
class Approach:
    """A guard's extremum inside a leg that comes nearest to zero.

    Attributes
    ----------
    guard : Guard
    t : float
        Since the start of the leg.
    value : float
        Of the guard.
    distance : float
        ``value/|grad|``, in the units of the states.
    """

    guard: Guard
    t: float
    value: float
    distance: float


@dataclass(frozen=True)
class Watch:
    """What the guards of a leg do inside it.

    Attributes
    ----------
    approaches : list of Approach
        Interior minima of guards that are positive in the mode; extrema of stops and resets.
    faults : list of str
        Guards that are negative, stops and resets that are passed.
    """

    approaches: list[Approach]
    faults: list[str]


def watch(system: FilippovSystem, mode: str, x: Array, duration: float, p: Array) -> Watch:
    """Look at all guards inside a leg.

    Parameters
    ----------
    system : FilippovSystem
    mode : str
    x : ndarray (N,)
    duration : float
        Positive.
    p : ndarray
    """
    field = guarded_field(system, mode)
    guards = field.motion.guards
    y = variational_field(system, mode).states_at(x, p)
    approaches: list[Approach] = []
    seen: list[list[tuple[float, float, float]]] = [[] for _ in guards]  # time, value, scale
    for row in watched(field, y, p, duration, _ENDS * duration):
        k, (t, value, bend) = int(row[0]), row[1:4].tolist()
        guard, scale = guards[k], 0.0
        passed = guard.kind in ("stop", "reset")
        if (bend and (passed or bend > 0.0)) or (value < 0.0 and not passed):
            at = row[4:]
            slope = field.gradients.copied(at, p)[0][k]
            size = math.sqrt(float(slope @ slope))
            scale = float(np.abs(slope) @ np.abs(at)) + size * 1e-3
            if size > 0.0 and bend and (passed or bend > 0.0):
                approaches.append(Approach(guard, t, value, value / size))
        seen[k].append((t, value, scale))
    faults = [f for g, values in zip(guards, seen, strict=True) for f in _faults(g, values)]
    return Watch(approaches, faults)


def _faults(guard: Guard, values: Sequence[tuple[float, float, float]]) -> list[str]:
    """What a guard's values inside a leg contradict, earliest first."""
    ordered = sorted(values)
    if guard.kind in ("stop", "reset", "zero"):
        for (_, a, _), (t, b, _) in pairwise(ordered):
            if a * b < 0.0 and guard.side in (0, 1 if b > a else -1) and guard.kind != "zero":
                return [f"{guard.kind} {guard.name!r} is met {t:.6g} after its start"]
        return []
    low = [(t, v) for t, v, scale in ordered if v < -_NEGATIVE * scale]
    if not low:
        return []
    t, v = min(low, key=lambda entry: entry[1])
    return [f"{described(guard)} is violated {t:.6g} after its start (by {abs(v):.3g})"]


def described(guard: Guard) -> str:
    """A guard's condition in words."""
    if guard.kind == "surface":
        return f"h{guard.index} {'>' if guard.side > 0 else '<'} 0"
    if guard.kind == "exit":
        condition = "<= 0" if guard.side > 0 else ">= 0"
        if guard.name.startswith("lambda"):
            return f"{guard.name} {'<= 1' if guard.side > 0 else '>= -1'}"
        return f"the condition {guard.name} {condition} of sliding"
    if guard.kind == "impact":
        return f"the gap of {guard.name!r} >= 0"
    return f"the reaction of {guard.name!r} >= 0" if guard.kind == "release" else guard.name


def change_fault(
    system: FilippovSystem, leg: Leg, following: str, end: Array, after: Array, p: Array
) -> str:
    """Why a leg cannot be followed by a mode as its event says; empty if it can.

    Parameters
    ----------
    system : FilippovSystem
    leg : Leg
    following : str
        The mode after it.
    end, after : ndarray (N + k,), (N,)
        States before and after the event.
    p : ndarray
    """
    field = leg.field(system)
    own = leg.map(system)
    if own is None:
        return ""
    at, rate = own(end, p), field.rate.copied(end, p)[0][:, 0]
    speed = float(at.gradient @ rate)
    guard = own.guard
    if guard.kind in ("surface", "exit", "impact", "release") and speed > 0.0:
        return f"at its end {described(guard)} is about to hold, not to fail ({leg.name})"
    if guard.kind in ("stop", "reset") and guard.side * speed < 0.0:
        return f"{guard.kind} {guard.name!r} is met from the wrong side at its end"
    return _following_fault(system, following, after, p, moved=not own.smooth)


def _following_fault(
    system: FilippovSystem, following: str, after: Array, p: Array, moved: bool
) -> str:
    """A guard of the next mode that is negative, or zero and falling, where the mode begins."""
    field = guarded_field(system, following)
    y = variational_field(system, following).states_at(after, p)
    states, rows = field.starts.copied(y, p)
    slopes = field.gradients.copied(y, p)[0]
    for k, guard in enumerate(field.motion.guards):
        if guard.kind in ("stop", "reset", "zero", "branch"):
            continue
        length = float(np.linalg.norm(slopes[k]))
        scale = length * np.abs(states[:, :4]).max(axis=0)
        scale[0] += 1e-3 * length
        for value, size in zip(rows[k, :4], scale, strict=False):
            if abs(value) > _NEGATIVE * size:
                if value < 0.0:
                    return f"where mode {following!r} begins after it, {described(guard)} fails"
                break
    return ""


def march(system: FilippovSystem, leg: Leg, x: Array, p: Array, t_max: float) -> float | None:
    """Time until the event of a leg, whatever other guards say; None if it does not come.

    A zero where the leg starts is not counted.
    """
    field = guarded_field(system, leg.mode)
    guards = field.motion.guards
    row = next(
        k
        for k, g in enumerate(guards)
        if g.name == leg.name and (g.kind != "exit" or leg.side in (0, g.side))
    )
    direction = guards[row].side if guards[row].kind in ("stop", "reset") else -1
    y = variational_field(system, leg.mode).states_at(x, p)
    size = float(np.linalg.norm(field.gradients.copied(y, p)[0][row])) * float(np.abs(y).max())
    return passing(field, row, y, p, t_max, direction=direction, still=1e-9 * size)
