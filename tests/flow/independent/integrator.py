"""Filippov trajectories of many systems at once, in extended precision, by extrapolation.

It shares nothing with the package: the midpoint rule extrapolated to the step size zero (Gragg 1965;
Hairer, Norsett & Wanner 1993, sec. II.9) steps all systems together, each with its own step size. A
guard that is negative at the end of a step is approached by shortening the step. At an event every
combination of letters is tried, and the one whose rates agree with it continues.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product

import numpy as np

from .family import Many

LETTERS = {1: "+", -1: "-", 0: "s"}
_ORDER = 8  # columns of the extrapolation
_TOLERANCE = 1e-17
_NUMBERS = 2 * np.arange(1, _ORDER + 1)
_TINY = 1e-7  # rates and multipliers closer than this to a limit decide nothing


@dataclass
class Path:
    """One trajectory.

    Attributes
    ----------
    itinerary : str
    times : list of float
        Of the events.
    x : ndarray (n,)
        Last state.
    trouble : str
        Why it ended early: a case too close to call, or a continuation that is not unique.
    """

    itinerary: str
    times: list[float] = field(default_factory=list)
    x: np.ndarray = field(default_factory=lambda: np.zeros(0))
    trouble: str = ""


class Flow:
    """Rates, multipliers and guards of many systems in given modes."""

    def __init__(self, many: Many, mode: np.ndarray):
        self.many, self.mode = many, mode

    def part(self, chosen: np.ndarray) -> Flow:
        """Return some of the systems."""
        return Flow(self.many.part(chosen), self.mode[chosen])

    def layer(self, x: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, ...]:
        """Rates of h without multipliers (S, m), their derivatives by them (S, m, m), f0 and g."""
        f, g = self.many.field(x, t)
        _, gradient = self.many.surfaces(x)
        a = (gradient * f[:, None, :]).sum(axis=2)
        slope = (gradient[:, :, None, :] * g[:, None, :, :]).sum(axis=3)
        return a, slope, f, g

    def rates(self, x: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Field (S, n) and multipliers (S, m)."""
        a, slope, f, g = self.layer(x, t)
        lam = multipliers(a, slope, self.mode)
        return f + (lam[:, :, None] * g).sum(axis=1), lam

    def guards(self, x: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Positive in the mode: s h, or 1 - lambda and 1 + lambda; (S, 2 m)."""
        h, _ = self.many.surfaces(x)
        _, lam = self.rates(x, t)
        slides = self.mode == 0
        above = np.where(slides, 1 - lam, self.mode * h)
        return np.concatenate([above, np.where(slides, 1 + lam, 1.0)], axis=1)


def multipliers(a: np.ndarray, slope: np.ndarray, mode: np.ndarray) -> np.ndarray:
    """Multipliers in given modes, by Gauss-Jordan elimination of at most three unknowns; (S, m)."""
    slides = (mode == 0)[:, :, None]
    size = a.shape[1]
    matrix = np.where(slides, slope, np.eye(size, dtype=np.longdouble))
    right = np.where(mode == 0, -a, mode.astype(np.longdouble))
    rows = np.arange(len(a))
    for k in range(size):
        pivot = k + np.argmax(np.abs(matrix[:, k:, k]), axis=1)
        matrix[rows, pivot], matrix[:, k] = matrix[:, k].copy(), matrix[rows, pivot]
        right[rows, pivot], right[:, k] = right[:, k].copy(), right[rows, pivot]
        head = matrix[:, k, k].copy()
        matrix[:, k] /= head[:, None]
        right[:, k] /= head
        for i in range(size):
            if i != k:
                factor = matrix[:, i, k].copy()
                matrix[:, i] -= factor[:, None] * matrix[:, k]
                right[:, i] -= factor * right[:, k]
    return right


def step(flow: Flow, x: np.ndarray, t: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One extrapolated step of each system: state and relative error (S,)."""
    table: list[np.ndarray] = []
    start = flow.rates(x, t)[0]
    error = np.zeros(len(x))
    for j, n in enumerate(_NUMBERS):
        small = (h / n)[:, None]
        before, now = x, x + small * start
        for k in range(1, n):
            slope = flow.rates(now, t + k * (h / n))[0]
            before, now = now, before + 2 * small * slope
        row = [(now + before + small * flow.rates(now, t + h)[0]) / 2]
        for k in range(j):
            ratio = np.longdouble(n) / _NUMBERS[j - k - 1]
            row.append(row[k] + (row[k] - table[k]) / (ratio * ratio - 1))
        if j:
            error = (np.abs(row[-1] - row[-2]) / (1 + np.abs(x))).max(axis=1)
        table = row
    return table[-1], error.astype(float)


def project(many: Many, x: np.ndarray, mode: np.ndarray) -> np.ndarray:
    """Newton's steps onto the sliding surfaces, along their gradients."""
    slides = (mode == 0)[:, :, None]
    size = mode.shape[1]
    for _ in range(3):
        h, gradient = many.surfaces(x)
        normal = (gradient[:, :, None, :] * gradient[:, None, :, :]).sum(axis=3)
        normal = np.where(slides & np.swapaxes(slides, 1, 2), normal, np.eye(size))
        weights = multipliers(np.where(mode == 0, h, 0.0), normal, np.zeros_like(mode))
        x = x + (weights[:, :, None] * gradient * slides).sum(axis=1)
    return x


class Run:
    """All trajectories of many systems to one time.

    Parameters
    ----------
    many : Many
    t_end : float
    """

    def __init__(self, many: Many, t_end: float):
        self.many, self.t_end = many, np.longdouble(t_end)
        count = many.count
        self.x, self.t = many.x0.copy(), np.zeros(count, np.longdouble)
        self.mode = np.sign(many.surfaces(self.x)[0]).astype(int)
        self.h = np.full(count, 0.01 * t_end, np.longdouble)  # the step to try
        self.low = np.zeros(count, np.longdouble)  # while an event is looked for: it is later,
        self.high = np.full(count, np.inf, np.longdouble)  # and before this
        self.low_value, self.high_value = np.zeros(count), np.zeros(count)
        self.fresh = np.zeros((count, 2 * self.mode.shape[1]), bool)  # guards that start at zero
        self.paths = [Path(self._word(s)) for s in range(count)]
        self.rounds = 0

    def run(self) -> list[Path]:
        """Run to the end."""
        active = np.arange(self.many.count)
        while active.size:
            self._round(active)
            self.rounds += 1
            active = np.array([s for s in active if not self._done(s)], int)
        for s, path in enumerate(self.paths):
            path.x = self.x[s, : self.many.n[s]].astype(float)
        return self.paths

    def _done(self, s: int) -> bool:
        return bool(self.paths[s].trouble) or self.t[s] >= self.t_end

    def _word(self, s: int) -> str:
        return "".join(LETTERS[int(v)] for v in self.mode[s, : self.many.m[s]])

    def _round(self, active: np.ndarray) -> None:
        """Try a step of each system."""
        flow = Flow(self.many.part(active), self.mode[active])
        x, t = self.x[active], self.t[active]
        h = np.minimum(self.h[active], self.t_end - t)
        y, error = step(flow, x, t, h)
        g0, g1 = flow.guards(x, t), flow.guards(y, t + h)
        dips = _dips(flow, x, t, g0, y, h, g1, self.fresh[active])
        lowest = g1.min(axis=1).astype(float)
        for k, s in enumerate(active):
            if not np.all(np.isfinite(y[k])) or (error[k] > _TOLERANCE and h[k] > 1e-6):
                self.h[s] = h[k] * (0.2 if not np.isfinite(error[k]) else _change(error[k]))
            elif dips[k] and h[k] > 1e-5 and np.isinf(self.high[s]):
                self.h[s] = h[k] / 2
            elif lowest[k] < 0.0 or np.isfinite(self.high[s]):
                self._narrow(s, h[k], y[k], lowest[k], g1[k])
            else:
                one = self.many.part(active[[k]])
                self.x[s] = project(one, y[[k]], self.mode[[s]])[0]
                if growth(Flow(one, self.mode[[s]]), self.x[[s]], t[[k]] + h[k]) >= 0.0:
                    self.paths[s].trouble = "sliding that stops attracting: a two-fold was passed"
                self.t[s] = self.t[s] + h[k]
                self.h[s] = min(h[k] * _change(error[k]), 0.03 * self.t_end)
                self.fresh[s] = False

    def _narrow(self, s: int, h: np.longdouble, y: np.ndarray, value: float, g: np.ndarray) -> None:
        """Narrow the interval that holds an event, or take the event."""
        if value < 0.0:
            self.high[s], self.high_value[s] = h, value
            if self.low[s] == 0.0 and np.any(self.fresh[s]):  # one that starts at zero
                self.h[s] = h / 3
                if h < 1e-9:
                    self.paths[s].trouble = "a guard that should leave zero does not"
                return
        else:
            self.low[s], self.low_value[s] = h, value
        width = self.high[s] - self.low[s]
        if abs(value) < 1e-17 or width < 1e-17:
            return self._event(s, h, y, g)
        if self.low[s] == 0.0:
            g0 = Flow(self.many.part(np.array([s])), self.mode[[s]]).guards(
                self.x[[s]], self.t[[s]]
            )
            self.low_value[s] = float(g0.min())
        a, b = self.low_value[s], self.high_value[s]
        part = np.longdouble(a) / (a - b) if a > b else 0.5
        # the secant, kept off the ends; now and then a bisection
        part = 0.5 if self.rounds % 4 == 0 else min(max(part, 1e-9), 1 - 1e-9)
        self.h[s] = self.low[s] + part * width

    def _event(self, s: int, h: np.longdouble, y: np.ndarray, g: np.ndarray) -> None:
        """Take a step to an event and choose the mode after it."""
        path, row = self.paths[s], int(np.argmin(g))
        size = self.mode.shape[1]
        surface, second = row % size, row >= size
        active = sorted({surface, *np.flatnonzero(self.mode[s] == 0)})
        landed = self.mode[s].copy()
        landed[surface] = 0
        one = self.many.part(np.array([s]))
        self.x[s] = project(one, y[None], landed[None])[0]
        self.t[s] += h
        others = np.sort(g)
        if others[1] < 1e-10:
            path.trouble = "two events at once"
            return
        fixed = {surface: -1 if second else 1} if self.mode[s, surface] == 0 else {}
        found, near = continuations(one, self.x[[s]], self.t[[s]], self.mode[s], active, fixed)
        if len(found) != 1 or near:
            path.trouble = "too close to call" if near else f"{len(found)} continuations"
            return
        before, self.mode[s] = self.mode[s].copy(), found[0]
        if np.any(before != self.mode[s]):
            path.itinerary += " " + self._word(s)
            path.times.append(float(self.t[s]))
        self.h[s], self.low[s], self.high[s] = 0.003 * self.t_end, 0.0, np.inf
        zero = Flow(one, self.mode[[s]]).guards(self.x[[s]], self.t[[s]])[0]
        self.fresh[s] = np.abs(zero) < 1e-13


def continuations(
    one: Many,
    x: np.ndarray,
    t: np.ndarray,
    mode: np.ndarray,
    active: list[int],
    fixed: dict[int, int],
) -> tuple[list[np.ndarray], bool]:
    """Modes that can continue from a point, and whether any is too close to call."""
    found, near = [], False
    a, slope, _, _ = Flow(one, mode[None]).layer(x, t)
    for letters in product(*[(fixed[i],) if i in fixed else (1, -1, 0) for i in active]):
        candidate = mode.copy()
        candidate[active] = letters
        lam = multipliers(a, slope, candidate[None])[0]
        w = a[0] + slope[0] @ lam
        room = [
            1 - abs(lam[i]) if letter == 0 else letter * w[i]
            for i, letter in zip(active, letters, strict=True)
            if i not in fixed
        ]
        least = min(room, default=1.0)
        rate = growth(Flow(one, candidate[None]), x, t)
        if least > -_TINY and rate < _TINY:
            near |= bool(least < _TINY or rate > -_TINY)
            found.append(candidate)
    return found, near


def growth(flow: Flow, x: np.ndarray, t: np.ndarray) -> float:
    """Growth across the layer of the surfaces on which one system slides; negative if it attracts."""
    slides = np.flatnonzero(flow.mode[0] == 0)
    matrix = flow.layer(x, t)[1][0][np.ix_(slides, slides)].astype(float)
    return float(np.linalg.eigvals(matrix).real.max()) if slides.size else -1.0


def _change(error: float) -> float:
    """Factor of the next step size."""
    return float(
        np.clip(0.85 * (_TOLERANCE / max(error, 1e-30)) ** (1 / (2 * _ORDER - 1)), 0.2, 2.5)
    )


def _dips(
    flow: Flow,
    x: np.ndarray,
    t: np.ndarray,
    g0: np.ndarray,
    y: np.ndarray,
    h: np.ndarray,
    g1: np.ndarray,
    fresh: np.ndarray,
) -> np.ndarray:
    """Whether a guard may be negative inside a step that it begins and ends positive (S,)."""
    slope0, slope1 = _slopes(flow, x, t), _slopes(flow, y, t + h)
    length = h[:, None]
    turns = (slope0 < 0) & (slope1 > 0) & (g1 > 0) & ~fresh
    turns |= fresh & (g1 > 0) & (g1 < length * np.abs(slope1) / 50)
    lowest = np.full(g0.shape, np.inf)
    for u in np.linspace(0.05, 0.95, 19):  # the cubic with these values and slopes
        value = (1 + 2 * u) * (1 - u) ** 2 * g0 + u * (1 - u) ** 2 * length * slope0
        value = value + u**2 * (3 - 2 * u) * g1 + u**2 * (u - 1) * length * slope1
        lowest = np.minimum(lowest, value.astype(float))
    suspicious = turns & (lowest < 0.5 * np.minimum(g0, g1))
    return suspicious.any(axis=1)


def _slopes(flow: Flow, x: np.ndarray, t: np.ndarray) -> np.ndarray:
    small = np.longdouble(1e-6)
    f, _ = flow.rates(x, t)
    return (flow.guards(x + small * f, t + small) - flow.guards(x - small * f, t - small)) / (
        2 * small
    )
