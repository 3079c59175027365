"""Functions along a smooth flow: their extrema on the way, and when one passes zero.

Along a step a function is a polynomial, so its extrema are roots of a polynomial's derivative, and none
is overlooked.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ..model import Array
from ..model.derivatives.variational import GuardedField
from .compiled.smooth import WatchProgram
from .fixed import MOST_STEPS, TOLERANCE, flow_for, has_interpreter, program_of, steps_for, stuck
from .reference.polynomial import first_crossing, first_root, sign_changes


def watched(field: GuardedField, y: Array, p: Array, duration: float, margin: float) -> Array:
    """Extrema of the guards of a mode along its flow, and their values at the ends of its steps
    and beside its own."""
    if not has_interpreter():
        return _watched(field, y, p, duration, margin)
    if not field.motion.guards:
        return np.zeros((0, 4 + len(y)))
    program = program_of(field)
    found, end, left = program.watch(y, p, duration, TOLERANCE, MOST_STEPS, margin)
    if left:
        raise stuck(duration, left, end)
    return found


class LegsWatch:
    """Guards along many legs at once; legs of no positive duration are not followed."""

    def __init__(self, fields: Sequence[GuardedField]):
        self._fields = list(fields)

    @cached_property
    def _program(self) -> WatchProgram:
        return WatchProgram([program_of(field) for field in self._fields])

    def __call__(
        self, starts: Sequence[Array], p: Array, durations: Array, ends: float
    ) -> tuple[list[Array], list[Array], list[Array]]:
        """Watch them."""
        if has_interpreter():
            found = self._program(starts, p, durations, TOLERANCE, MOST_STEPS, ends)
            if found.failed >= 0:
                raise stuck(float(durations[found.failed]), found.left, starts[found.failed])
            return found.rows, found.begins, found.values
        rows, begins, values = list[Array](), list[Array](), list[Array]()
        for field, y, duration in zip(self._fields, starts, durations.tolist(), strict=True):
            begins.append(np.vstack([part[:, :4] for part in field.starts.copied(y, p)]))
            rows.append(np.zeros((0, 4 + len(y))))
            values.append(np.zeros(len(field.motion.guards)))
            if duration > 0.0:
                rows[-1] = _watched(field, y, p, duration, ends * duration)
                values[-1] = field.starts.copied(flow_for(field, y, p, duration), p)[1][:, 0]
        return rows, begins, values


def _watched(field: GuardedField, y: Array, p: Array, duration: float, margin: float) -> Array:
    found: list[Array] = []
    t = 0.0
    for h, states, end in steps_for(field, y, p, duration):
        rows = field.jets.outputs[1].copy()
        degrees = np.arange(rows.shape[1])
        slopes = rows[:, 1:] * degrees[1:]
        changes = sign_changes(slopes, h).tolist() if len(rows) else []
        points = [(s, k) for k, c in enumerate(changes) if c for s in _extrema(slopes[k], h, c)]
        points = [(s, k) for s, k in points if margin < t + s < duration - margin]
        extrema = len(points)
        last = duration - margin - t if t + h >= duration - margin else h
        for s in (last, margin) if t == 0.0 else (last,):
            points += [(s, k) for k in range(len(rows)) if 0.0 < s <= h]
        for i, (s, k) in enumerate(points):
            powered = s**degrees
            bend = float(slopes[k, 1:] * degrees[1:-1] @ powered[:-2]) if i < extrema else 0.0
            at = end if s == h else states @ powered
            found.append(np.array([k, t + s, rows[k] @ powered, bend, *at]))
        t += h
    return np.array(found).reshape(-1, 4 + len(y))


def _extrema(slope: Array, h: float, changes: int) -> list[float]:
    """Zeros in (0, h] of a polynomial whose Bernstein coefficients change sign so many times."""
    if changes == 1:
        root = first_root((slope if slope[0] > 0.0 else -slope).tolist(), h)
        return [] if root is None else [root]
    d = slope * h ** np.arange(len(slope))
    size = np.abs(d)
    if size[0] > size[1:].sum() or not np.all(np.isfinite(d)):
        return []
    kept = np.flatnonzero(size > 1e-17 * size.max()) if size.max() > 0.0 else np.zeros(0, int)
    if not kept.size or kept[-1] == 0:
        return []
    roots = np.roots(d[kept[-1] :: -1])
    real = roots.real[np.abs(roots.imag) <= 1e-8]
    return [float(r) * h for r in real if 0.0 < r <= 1.0]


def passing(
    field: GuardedField,
    row: int,
    y: Array,
    p: Array,
    t_max: float,
    *,
    direction: int,
    still: float,
) -> float | None:
    """Time at which a guard passes zero, whatever the others say; None if it does not."""
    if has_interpreter():
        program = program_of(field)
        t = program.march(y, p, t_max, TOLERANCE, MOST_STEPS, row, direction, still)
        if t == -2.0:
            raise stuck(t_max, t_max, y)
        return None if t < 0.0 else t
    t = 0.0
    for h, _, _ in steps_for(field, y, p, t_max):
        c = field.jets.outputs[1][row].copy()
        if t == 0.0:
            c = c[int(np.argmax(np.abs(c) > still)) :]
        found = first_crossing(c.tolist(), h, direction)
        if found is not None and t + found > 0.0:
            return t + found
        t += h
    return None
