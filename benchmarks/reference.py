"""Reference solutions by Taylor series in mpmath, of order 30 with 34 digits.

Fields, guards and the rules at the surface are independent of the library and share only the constants
with ``problems``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np

from .problems import D1, D2, ETA, KAPPA, MINUS, MU, PLUS, SLIDING, SPIN, Array, Codes, G

ORDER = 30
_DIGITS = 34
_LOCAL_ERROR = mp.mpf(10) ** -24
Series = list[Any]


@dataclass(frozen=True)
class Ends:
    """Times (n,), states (n, d) and itinerary codes (n,) at lift-off."""

    t: Array
    x: Array
    itinerary: Codes


def error(ends: Ends, reference: Ends) -> Array:
    """Largest error of time and state, for each start; infinite where a run failed."""
    e = np.maximum(np.abs(ends.t - reference.t), np.abs(ends.x - reference.x).max(axis=1))
    return np.where(np.isfinite(e), e, np.inf)


def _convolve(a: Series, b: Series, k: int) -> Any:
    return mp.fdot(a[: k + 1], b[k::-1])


class _Expansion:
    """Series of the states, the load and the tangential force from one point in one mode."""

    def __init__(self, name: str, x: Series, mode: int):
        self.X, self.V, self.Y, self.W, self.O = self.states = [[v] for v in x]
        self.load: Series = []
        self.along: Series = []
        forces = self._linear if name == "linear" else self._nonlinear
        self._products: tuple[Series, ...] = tuple([] for _ in range(6))
        for k in range(ORDER + 1):
            load, along = forces(k)
            self.load.append(load)
            self.along.append(along)
            friction = -along / mp.mpf(KAPPA)
            if mode != SLIDING:
                friction = (-1 if mode == PLUS else 1) * mp.mpf(MU) * load
            if k < ORDER:
                rates = (self.V[k], along + friction, self.W[k], load, mp.mpf(SPIN) * friction)
                for state, rate in zip(self.states, rates, strict=True):
                    state.append(rate / (k + 1))

    def _linear(self, k: int) -> tuple[Any, Any]:
        constant = mp.mpf(G) if k == 0 else 0
        load = -2 * mp.mpf(D2) * self.W[k] - self.Y[k] - constant
        along = -2 * mp.mpf(D1) * mp.mpf(ETA) * self.V[k] - mp.mpf(ETA) ** 2 * self.X[k]
        return load, along

    def _nonlinear(self, k: int) -> tuple[Any, Any]:
        one, constant = (mp.mpf(1), mp.mpf(G)) if k == 0 else (0, 0)
        gap, speed2, depth2, gv, cubic, _ = self._products
        gap.append(one - self.Y[k])
        speed2.append(one + _convolve(self.V, self.V, k))
        depth2.append(one + 2 * _convolve(self.Y, self.Y, k))
        gv.append(_convolve(gap, self.V, k))
        cubic.append(_convolve(depth2, self.Y, k))
        load = -2 * mp.mpf(D2) * _convolve(gap, self.W, k) - cubic[k] - constant
        along = -2 * mp.mpf(D1) * mp.mpf(ETA) * _convolve(speed2, gv, k)
        return load, along - mp.mpf(ETA) ** 2 * _convolve(gap, self.X, k)

    def guards(self, mode: int) -> list[Series]:
        """Functions that are positive inside a mode; the load is the last."""
        if mode == SLIDING:
            push = mp.mpf(KAPPA) * mp.mpf(MU)
            pairs = list(zip(self.along, self.load, strict=True))
            first = [[push * n - a for a, n in pairs], [push * n + a for a, n in pairs]]
        else:
            sign = 1 if mode == PLUS else -1
            first = [[sign * (v + o) for v, o in zip(self.V, self.O, strict=True)]]
        return [*first, self.load]

    def at(self, t: Any) -> Series:
        """States after a time t."""
        return [mp.polyval(c, t, asc=True) for c in self.states]

    def step(self) -> Any:
        """Step that the last two coefficients allow."""
        last = max(abs(c[-1]) for c in self.states)
        before = max(abs(c[-2]) for c in self.states)
        tiny = mp.mpf(10) ** -300
        return min(
            (_LOCAL_ERROR / (last + tiny)) ** (mp.mpf(1) / ORDER),
            (_LOCAL_ERROR / (before + tiny)) ** (mp.mpf(1) / (ORDER - 1)),
            mp.mpf(2),
        )


def first_fall(c: Series, h: Any, drop: int) -> Any | None:
    """First zero in (0, h] where a series goes from positive to negative; None without one."""
    high = c[drop:]
    slope = [k * v for k, v in enumerate(high)][1:]
    times = [mp.mpf(0), *sorted(_extrema(slope, h)), h]
    values = [mp.polyval(high, time, asc=True) for time in times]
    for k in range(len(times) - 1):
        if values[k] > 0 >= values[k + 1]:
            return _zero(high, times[k], times[k + 1])
    return None


def _extrema(slope: Series, h: Any) -> list[Any]:
    """Zeros of a series in (0, h): found in double precision, polished in high precision."""
    scaled = [float(v * h**k) for k, v in enumerate(slope)]
    size = max(map(abs, scaled))
    while len(scaled) > 1 and abs(scaled[-1]) < 1e-26 * size:
        scaled.pop()
    roots = np.roots(scaled[::-1])
    near = (abs(roots.imag) < 1e-6) & (roots.real > -1e-6) & (roots.real < 1 + 1e-6)
    found = []
    for guess in roots[near].real:
        root = mp.mpf(float(guess)) * h
        for _ in range(60):
            value, rate = mp.polyval(slope, root, derivative=1, asc=True)
            change = value / rate
            root -= change
            if abs(change) < 1000 * mp.eps:
                found.append(root)
                break
    return [root for root in found if 0 < root < h]


def _zero(c: Series, low: Any, high: Any) -> Any:
    """Zero of a series that falls from a positive value at ``low`` to none at ``high``."""
    while high - low > mp.eps * (1 + high):
        middle = (low + high) / 2
        if not low < middle < high:
            break
        low, high = (middle, high) if mp.polyval(c, middle, asc=True) > 0 else (low, middle)
    return high


def _lift_off(name: str, x: Series) -> tuple[Any, Series, int]:
    mode = PLUS if x[1] + x[4] > 0 else MINUS
    t, code, drop = mp.mpf(0), mode + 1, 0
    while True:
        e = _Expansion(name, x, mode)
        h, hit = e.step(), -1
        guards = e.guards(mode)
        for j, c in enumerate(guards):
            root = first_fall(c, h, drop if j == 0 else 0)
            if root is not None:
                h, hit = root, j
        t, x, drop = t + h, e.at(h), 0
        if hit < 0:
            continue
        if hit == len(guards) - 1:
            return t, x, code
        x[4] = -x[1]
        if mode == SLIDING:
            mode, drop = (PLUS, 2) if hit == 0 else (MINUS, 2)
        else:
            first = _Expansion(name, x, SLIDING)
            low, high = first.guards(SLIDING)[0][0], first.guards(SLIDING)[1][0]
            mode, drop = (SLIDING, 0) if low > 0 and high > 0 else (2 - mode, 1)
        code = 4 * code + mode + 1


def solve(name: str, starts: Array) -> Ends:
    """Lift-offs of the ``linear`` or ``nonlinear`` bounce to about 20 digits, rounded."""
    with mp.workdps(_DIGITS):
        ends = [_lift_off(name, [mp.mpf(float(v)) for v in x]) for x in starts]
    return Ends(
        np.array([float(t) for t, _, _ in ends]),
        np.array([[float(v) for v in x] for _, x, _ in ends]),
        np.array([c for _, _, c in ends], np.int64),
    )


def kept(name: str, starts: Array, folder: Path) -> Ends:
    """``solve``, kept in a file of the folder: it takes a minute."""
    path = folder / f"reference_{name}_{len(starts)}.npz"
    if path.exists():
        with np.load(path) as data:
            if np.array_equal(data["starts"], starts):
                return Ends(data["t"], data["x"], data["itinerary"])
    ends = solve(name, starts)
    folder.mkdir(parents=True, exist_ok=True)
    np.savez(path, starts=starts, t=ends.t, x=ends.x, itinerary=ends.itinerary)
    return ends
