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
from numpy.typing import NDArray

from ...flow.constants import LAGS
from ...model import Array, DegenerateError, FilippovSystem
from ...model.derivatives.event_maps import rest_maps
from .legs import Leg, Stretch

#: Largest ratio of durations from one point to the next; most of them; repetitions of a block that make a pattern.
_RATIO, _MOST, _REPEATS = 0.6, 14, 3

#: Events before those of an extrapolation from which its ratio may be taken too.
_MORE = 3

#: Durations of the last block, relative to the longest, at which an extrapolation may end.
_LASTS = tuple(10.0**-k for k in range(3, 7))

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
    #: Estimated error of derivatives, relative to the change of the events.
    error: float

    def arrive(self, dt: Array, dx: Array) -> tuple[Array, Array]:
        """Derivatives of the time (c,) and state (N, c) at the limit, from those of the events (m + 1, c), (m + 1, N, c)."""
        ratio = self.by_times @ dt
        time = self.weights @ dt + self.by_ratio[0] * ratio
        return time, np.tensordot(self.weights, dx, 1) + np.outer(self.by_ratio[1:], ratio)

    def pull(self, time: float, row: Array) -> tuple[Array, Array]:
        """The transpose: derivatives by the times (m + 1,) and states (m + 1, N) of the events."""
        ratio = self.by_ratio[0] * time + float(self.by_ratio[1:] @ row)
        return self.weights * time + self.by_times * ratio, np.outer(self.weights, row)


class Nearest(NamedTuple):
    """A nearest state (N,), with derivatives by a state (N, N) and by all parameters (N, np)."""

    x: Array
    by_state: Array
    by_parameters: Array


@dataclass(frozen=True, eq=False)
class AtLimit:
    """Map of derivatives through a limit of events."""

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
    lasts, found = times[block:] - times[:-block], list[_Estimate]()
    if len(lasts) > 1 and lasts.min() > 0.0:
        ratio = min(max(lasts[-1] / lasts[max(len(lasts) - 1 - block, 0)], 1e-300), 0.9999)
        stride = block * max(1, math.ceil(math.log(_RATIO) / math.log(ratio) - 1e-9))
        longest = float(lasts.max())
        ends = [int(np.flatnonzero(lasts >= part * longest)[-1]) + block for part in _LASTS]
        q = np.column_stack([times, states])
        for end in {*ends, len(times) - 1}:
            noise = _EPSILON * longest / float(lasts[end - block])
            rows = np.arange(end % stride, end + 1, stride)[-_MOST - 1 :]
            found += _estimates(q[rows], rows, longest, noise)
    best = min(found, key=lambda estimate: estimate.error, default=None)
    if best is not None and best.error < _UNRESOLVED:
        value = min(found, key=lambda estimate: estimate.change).value
        least, limit = math.inf, None
        for m in range(
            best.m, min(best.m + _MORE, len(best.rows) - 1) + 1
        ):  # the ratio needs more events than the limit
            points = best.rows[-m - 1 :]
            own = _extrapolated(q[points], tuple(int(tail[k]) for k in points), best.error)
            miss = (
                math.inf if own is None else float(np.max(np.abs(own.value - value) / best.scale))
            )
            if miss < least:
                least, limit = miss, own
        if limit is not None:
            return replace(limit, value=value)
    raise DegenerateError(
        f"{what}: events accumulate, and the last {len(tail)} of them do not give the derivatives of their limit. "
        "Simulate with a smaller tol, or end the run before."
    )


def geometric_limit(values: Array) -> tuple[float, float]:
    """The limit of values (k,) whose changes fall nearly by a ratio, and its change by more of them, relative to them."""
    change = np.diff(values)
    if len(change) < 2 or not (change.all() and (change * change[0] > 0.0).all()):
        return math.nan, math.inf
    q = (np.sign(change[0]) * values)[:, None]
    found = _estimates(q, np.arange(len(q)), float(np.abs(change).max()), 0.0)
    best = min(found, key=lambda estimate: estimate.change, default=None)
    if best is None:
        return math.nan, math.inf
    return float(np.sign(change[0]) * best.value[0]), best.change


class _Estimate(NamedTuple):
    """An extrapolation of the last m + 1 events of ``rows`` to a limit, with errors of the limit and of its derivatives."""

    rows: NDArray[np.intp]
    m: int
    value: Array
    scale: Array
    change: float
    error: float


def _estimates(q: Array, rows: NDArray[np.intp], longest: float, noise: float) -> list[_Estimate]:
    """Limits by the last three events q (k, 1 + N), by four, and so on."""
    size = np.maximum(np.ptp(q, axis=0), _EPSILON * np.abs(q).max(axis=0))
    size[0], spans = longest, np.diff(q[:, 0])
    scale, found, before = np.where(size > 0.0, size, 1.0), list[_Estimate](), q[-1]
    sigma = _ratio(spans[1:] / spans[:-1]) if len(spans) > 1 else None
    if sigma is None:
        return found
    for w in _all_weights(sigma, len(spans))[1:]:
        value = q[-1] + w.real @ (q[-len(w) :] - q[-1])
        change = max(float(np.max(np.abs(value - before) / scale)), _EPSILON)
        error = change + noise * float(np.abs(w).sum())
        found.append(_Estimate(rows, len(w) - 1, value, scale, change, error))
        before = value
    return found


def _ratio(ratios: Array) -> float | None:
    """The limit of ratios (k,) that are a series in powers of it; None where they do not fall below 1."""
    sigma = float(ratios[-1])
    for _ in range(8):
        if not 0.0 < sigma < 1.0:
            return None
        best, least, before = sigma, math.inf, float(ratios[-1])
        for w in _all_weights(sigma, len(ratios) - 1):
            value = float(w.real @ ratios[-len(w) :])
            if abs(value - before) < least:
                best, least = value, abs(value - before)
            before = value
        if abs(best - sigma) <= _EPSILON:
            break
        sigma = best
    return sigma if 0.0 < sigma < 1.0 else None


def _extrapolated(q: Array, points: tuple[int, ...], error: float) -> Limit | None:
    """Extrapolate m + 1 events q (m + 1, 1 + N), in equal steps, to their limit; None where they have none."""
    spans = np.diff(q[:, 0])
    ratios = spans[1:] / spans[:-1]
    sigma, steps = float(ratios[-1]), len(ratios) - 1
    for _ in range(8):
        if not 0.0 < sigma < 1.0:
            return None
        own = extrapolation_weights(sigma, steps)
        sigma, last = float(own.real @ ratios), sigma
        if abs(sigma - last) <= _EPSILON:
            break
    if not 0.0 < sigma < 1.0:
        return None
    own = extrapolation_weights(sigma, steps)
    of_ratios = own.real / (1.0 - own.imag @ (ratios - ratios[-1]) / _STEP)
    of_spans = np.append(0.0, of_ratios / spans[:-1])
    of_spans[:-1] -= of_ratios * ratios / spans[:-1]
    w, moved = extrapolation_weights(sigma, len(spans)), q - q[-1]
    by_times = np.append(0.0, of_spans) - np.append(of_spans, 0.0)
    value, by_ratio = q[-1] + w.real @ moved, w.imag @ moved / _STEP
    return Limit(points, value, w.real, by_times, by_ratio, error)


def extrapolation_weights(sigma: float, m: int) -> NDArray[np.complex128]:
    """Weights w_i of m + 1 values, with their derivatives by the ratio, times ``_STEP``, as imaginary parts."""
    return _all_weights(sigma, m)[-1] if m else np.ones(1, complex)


def _all_weights(sigma: float, m: int) -> list[NDArray[np.complex128]]:
    """Those of two values, of three, up to m + 1."""
    w, power, step, found = [1.0 + 0.0j], 1.0 + 0.0j, complex(sigma, _STEP), []
    for _ in range(m):
        power *= step
        part = 1.0 / (1.0 - power)
        w = [(a - power * b) * part for a, b in zip([0.0, *w], [*w, 0.0], strict=True)]
        found.append(np.array(w))
    return found


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
