"""Limits of events that accumulate in a finite time, with derivatives.

Impacts, resets or crossings repeat in blocks. The end of block k, at the time t_k with the state x_k after its event, is
analytic in rho^k, where rho is the limit of the ratio of the durations of consecutive blocks (Koenigs). So

    q_inf = prod_(j = 1..m) (E - sigma^j)/(1 - sigma^j) q = sum_i w_i(sigma) q_i,    q = (t, x),    E q_i = q_(i+1),

for m + 1 ends of blocks in steps of s, sigma = rho^s, with sigma from the same formula for ratios of durations. The
derivative of this formula is linear in those of the events, which stay bounded although an impact at the speed v has
a saltation matrix of the size 1/v. Behind the limit, where the field is F and L = h' for every h that is zero from
there,

    dx(t) = X(t, t_inf) (dx_inf - F dt_inf),    dh = dL = 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...flow.constants import LAGS
from ...model import Array, DegenerateError, FilippovSystem
from ...model.derivatives.event_maps import rest_maps
from .legs import Leg, Stretch

#: Largest ratio of durations from one point to the next; most of them; repetitions of a block that make a pattern.
_RATIO, _MOST, _REPEATS = 0.6, 14, 3

#: Durations of the last block, relative to the longest, at which an extrapolation may end.
_LASTS = tuple(10.0**-k for k in range(2, 9))

#: Error of an extrapolation, relative to the change of the events, above which it has no derivatives.
_UNRESOLVED = 1e-3

_STEP = 1e-30  # of a complex difference, which is exact

_EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Limit:
    """A limit of events, as a function of m + 1 of them."""

    #: (m + 1,): Numbers of the legs that these events end.
    points: tuple[int, ...]
    #: (1 + N,): Time and state at the limit.
    value: Array
    #: weights, by_times (m + 1,): w; derivatives of the ratio sigma by the times of the events.
    weights: Array
    by_times: Array
    #: (1 + N,): Derivative of ``value`` by the ratio.
    by_ratio: Array
    #: Estimated errors, relative to the change of the events: of ``value``, and of derivatives.
    change: float
    error: float

    def arrive(self, dt: Array, dx: Array) -> tuple[Array, Array]:
        """Derivatives of the time (c,) and state (N, c) at the limit, from those of the events (m + 1, c), (m + 1, N, c)."""
        ratio = self.by_times @ dt
        time = self.weights @ dt + self.by_ratio[0] * ratio
        return time, np.tensordot(self.weights, dx, 1) + np.outer(self.by_ratio[1:], ratio)

    def pull(self, time: float, row: Array) -> tuple[Array, Array]:
        """The transpose: what it gives by the times (m + 1,) and states (m + 1, N) of the events."""
        ratio = self.by_ratio[0] * time + float(self.by_ratio[1:] @ row)
        return self.weights * time + self.by_times * ratio, np.outer(self.weights, row)


class Nearest(NamedTuple):
    """A nearest state (N,), with derivatives by a state (N, N) and by all parameters (N, np)."""

    x: Array
    by_state: Array
    by_parameters: Array


@dataclass(frozen=True, eq=False)
class AtLimit:
    """What happens to derivatives at a limit of events."""

    limit: Limit
    #: (m + 1, N): Fields after its events.
    rates: Array
    #: The state there, at which what rests is at rest.
    rest: Nearest | None
    #: (N,): The field behind it, None where the run ends there.
    after: Array | None

    def through(self, seen: Sequence[tuple[Array, Array]], given: Array) -> tuple[Array, Array]:
        """Derivatives (c,) of its time and (N, c) of the state behind it, from those of its events: times, and states after
        them at fixed times; ``given``: derivatives (np, c) of all parameters."""
        dt = np.array([t for t, _ in seen])
        dx = np.array([x for _, x in seen]) + self.rates[:, :, None] * dt[:, None, :]
        time, state = self.limit.arrive(dt, dx)
        if self.after is not None:
            state = state - np.outer(self.after, time)
        if self.rest is not None:
            state = self.rest.by_state @ state + self.rest.by_parameters @ given
        return time, state

    def pull(self, row: Array, by_parameters: Array) -> dict[int, tuple[Array, float]]:
        """A row (N,) behind it as rows after its events, by their legs, with derivatives by their times."""
        if self.rest is not None:
            by_parameters += row @ self.rest.by_parameters
            row = row @ self.rest.by_state
        time = 0.0 if self.after is None else -float(row @ self.after)
        times, rows = self.limit.pull(time, row)
        times = times + (rows * self.rates).sum(axis=1)
        return dict(zip(self.limit.points, zip(rows, times.tolist(), strict=True), strict=True))


def tail_of(parts: Sequence[Stretch]) -> tuple[range, int]:
    """The last legs whose events repeat, of those before a limit, and how many make one block."""
    events = [(p.leg.mode, p.leg.kind, p.leg.element, p.leg.side, p.leg.letters) for p in parts]
    count, best = len(events), (range(0), 1)
    for lag in LAGS:
        first = count - lag
        while first > 0 and events[first - 1] == events[first - 1 + lag]:
            first -= 1
        if count - first >= _REPEATS * lag + (lag > 1):
            return range(first, count), lag
        if count - first > len(best[0]) and count - first > lag:
            best = range(first, count), lag
    return best


def limits_of(parts: Sequence[Stretch]) -> dict[int, tuple[Limit, range]]:
    """Limits of events by the legs that they end, with the legs whose events accumulate."""
    found = dict[int, tuple[Limit, range]]()
    for i, part in enumerate(parts):
        if part.leg.kind != "limit":
            continue
        first = 1 + max(found, default=-1)
        tail, block = tail_of(parts[first:i])
        tail = range(first + tail.start, first + tail.stop)
        what = f"limit of events at t = {part.t + part.duration:.10g}"
        found[i] = limit_of(parts, tail, block, what), tail
    return found


def limit_of(parts: Sequence[Stretch], tail: range, block: int, what: str) -> Limit:
    """The limit of the events that end the legs of a tail: the best of extrapolations that end sooner and later."""
    times = np.array([parts[i].t + parts[i].duration for i in tail])
    states = np.array([parts[i].after for i in tail])
    lasts = times[block:] - times[:-block]
    found = list[Limit]()
    if len(lasts) > 1 and lasts.min() > 0.0:
        ratio = min(max(lasts[-1] / lasts[max(len(lasts) - 1 - block, 0)], 1e-300), 0.9999)
        stride = block * max(1, math.ceil(math.log(_RATIO) / math.log(ratio) - 1e-9))
        longest = float(lasts.max())
        ends = [int(np.flatnonzero(lasts >= part * longest)[-1]) + block for part in _LASTS]
        for end in {*ends, len(times) - 1}:
            noise = _EPSILON * longest / float(lasts[end - block])
            rows = np.arange(end % stride, end + 1, stride)[-_MOST - 1 :]
            points = [int(tail[k]) for k in rows]
            found += _extrapolations(times[rows], states[rows], points, longest, noise)
    best = min(found, key=lambda limit: limit.error, default=None)
    if best is None or not best.error < _UNRESOLVED:
        raise DegenerateError(
            f"{what}: events accumulate, and the last {len(tail)} of them do not give the derivatives of their limit. "
            "Simulate with a smaller tol, or end the run before."
        )
    return replace(best, value=min(found, key=lambda limit: limit.change).value)


def _extrapolations(
    times: Array, states: Array, points: Sequence[int], longest: float, noise: float
) -> list[Limit]:
    """Limits by the last three events, four, and so on, with estimates of their errors."""
    size = np.maximum(np.ptp(states, axis=0), _EPSILON * np.abs(states).max(axis=0))
    scale = np.append(longest, np.where(size > 0.0, size, 1.0))
    found, before = list[Limit](), np.append(times[-1], states[-1])
    for m in range(2, len(times)):
        limit = _extrapolated(times[-m - 1 :], states[-m - 1 :], tuple(points[-m - 1 :]))
        if limit is None:
            break
        change = float(np.max(np.abs(limit.value - before) / scale))
        error = max(change, _EPSILON) + noise * float(np.abs(limit.weights).sum())
        found.append(replace(limit, change=change, error=error))
        before = limit.value
    return found


def _extrapolated(times: Array, states: Array, points: tuple[int, ...]) -> Limit | None:
    """Extrapolate m + 1 events, in equal steps, to their limit; None where they have none."""
    spans = np.diff(times)
    ratios = spans[1:] / spans[:-1]
    sigma, steps = float(ratios[-1]), len(ratios) - 1
    for _ in range(8):
        if not 0.0 < sigma < 1.0:
            return None
        own = extrapolation_weights(complex(sigma, _STEP), steps)
        sigma, last = float(own.real @ ratios), sigma
        if abs(sigma - last) <= _EPSILON:
            break
    if not 0.0 < sigma < 1.0:
        return None
    own = extrapolation_weights(complex(sigma, _STEP), steps)
    of_ratios = own.real / (1.0 - own.imag @ (ratios - ratios[-1]) / _STEP)
    of_spans = np.append(0.0, of_ratios / spans[:-1])
    of_spans[:-1] -= of_ratios * ratios / spans[:-1]
    w = extrapolation_weights(complex(sigma, _STEP), len(spans))
    q = np.column_stack([times, states])
    moved = q - q[-1]
    by_times = np.append(0.0, of_spans) - np.append(of_spans, 0.0)
    return Limit(points, q[-1] + w.real @ moved, w.real, by_times, w.imag @ moved / _STEP, 0.0, 0.0)


def extrapolation_weights(sigma: complex, m: int) -> Array:
    """Weights w_i of m + 1 values, with their derivatives by the ratio as imaginary parts."""
    w, power = np.ones(1, complex), 1.0 + 0.0j
    for _ in range(m):
        power *= sigma
        w = (np.append(0.0, w) - power * np.append(w, 0.0)) / (1.0 - power)
    return w


def rest_at(
    system: FilippovSystem, leg: Leg, elements: Sequence[int], x: Array, p: Array
) -> Nearest | None:
    """The nearest state of a time at which elements of a leg rest, with derivatives; None without elements."""
    if not len(elements):
        return None
    n = system.extended_dimension
    y = x if system.sets else leg.field(system).states_at(x, p)
    at = [own(y, p) for own in rest_maps(system, leg.mode, elements)]
    rows, back = np.array([row.gradient[:n] for row in at]), np.zeros((n, len(at)))
    back[: system.dimension] = np.linalg.pinv(rows[:, : system.dimension])
    by_parameters = -back @ np.array([row.by_parameters for row in at])
    nearest = x - back @ [row.value for row in at]
    return Nearest(nearest, np.eye(n) - back @ rows, by_parameters)
