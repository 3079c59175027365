"""Cycles that are born where an equilibrium of a planar continuous system passes the surface.

With X = h and Y = T X - X', each side is X' = T X - Y, Y' = D X - mu, with trace T and determinant D of its
linear part. On a focus' side an orbit meets X = 0 at Y_in and, after a time t, at Y_out, both proportional
to mu; a cycle is where those of both sides agree. mu drops out: times are constant, lengths linear in mu.

Source: Freire, Ponce & Torres 1998, "Bifurcation sets of continuous piecewise linear systems with two
zones"; Simpson 2010, Bifurcations in Piecewise-Smooth Continuous Systems, chapter 3.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from ..point.surface_point import SIDES, Side

#: Least distance of the time around the equilibrium from half a turn in the search, relative to it.
_NEAREST = 1e-13

#: Longest time on the side of a node.
_LONGEST = 1e15


@dataclass(frozen=True)
class BoundaryCycle:
    """A cycle that is born at a boundary equilibrium of a planar continuous system.

    Attributes
    ----------
    side : {"+", "-"}
        On which side the equilibrium is that it surrounds.
    stable : bool
        Whether it attracts.
    period : float
        To leading order.
    durations : tuple of float
        On that side and on the other one.
    multiplier : float
        Of a turn.
    speeds : tuple of float
        Rates of $|h|$, away from the surface, where it enters that side and the other one, over the height
        $|h|$ of the equilibrium.
    """

    side: Side
    stable: bool
    period: float
    durations: tuple[float, float]
    multiplier: float
    speeds: tuple[float, float]

    def __str__(self) -> str:
        kind = "stable" if self.stable else "unstable"
        return (
            f"a {kind} cycle of period {self.period:.6g} and multiplier {self.multiplier:.6g} around the "
            f"equilibrium where h {'>' if self.side == '+' else '<'} 0, its size proportional to the distance of "
            "the equilibrium from the surface"
        )


@dataclass(frozen=True)
class _Side:
    """One linear side for mu = 1."""

    trace: float
    determinant: float

    @property
    def frequency(self) -> float:
        """Imaginary part of the eigenvalues; of a node, negative, half their distance."""
        bend = self.determinant - 0.25 * self.trace**2
        return math.copysign(math.sqrt(abs(bend)), bend)

    def at(self, t: float) -> tuple[float, float]:
        """Y_in and Y_out of an orbit that takes a time t, of a focus beyond half a turn."""
        w, half = self.frequency, 0.5 * self.trace
        if w > 0:
            c, s, whole, scale = -math.cos(w * t), -math.sin(w * t) / w, t + math.pi / w, 0.0
        elif w == 0:
            c, s, whole, scale = 1.0, t, t, 0.0
        else:  # over exp(scale t)
            c, s = 0.5 + 0.5 * math.exp(2 * w * t), -0.5 * math.expm1(2 * w * t) / -w
            whole, scale = t, -w
        into = half + (_exp(-half * whole - scale * t) - c) / s
        out = half - (_exp(half * whole - scale * t) - c) / s
        return into / self.determinant, out / self.determinant


def _exp(power: float) -> float:
    return math.exp(min(power, 700.0))


def born_cycle(
    traces: tuple[float, float], determinants: tuple[float, float]
) -> BoundaryCycle | None:
    """The cycle of two linear parts, of F1 and F2; None if there is none, or none that doubles resolve."""
    sides = [_Side(t, d) for t, d in zip(traces, determinants, strict=True)]
    if min(determinants) <= 0 or traces[0] * traces[1] >= 0:
        return None
    foci = [side.frequency > 0 for side in sides]
    if not any(foci):
        return None
    unstable = 0 if traces[0] > 0 else 1
    own = foci.index(True)  # a node is not surrounded
    if all(foci):
        growth = sum(s.trace / s.frequency for s in sides)  # of a turn, over pi
        if growth == 0:
            return None
        own = unstable if growth < 0 else 1 - unstable
    stable = own == unstable
    # the cycle round a stable focus is that round an unstable one in reversed time
    inner, outer = (
        _Side(s.trace if stable else -s.trace, s.determinant) for s in (sides[own], sides[1 - own])
    )
    try:
        times = _times(inner, outer)
    except ValueError:  # no change of sign: the cycle is smaller or larger than rounding lets it be
        return None
    into, out = inner.at(times[0])
    turned = math.pi / outer.frequency if foci[1 - own] else 0.0
    durations = times[0] + math.pi / inner.frequency, times[1] + turned
    multiplier = _exp(inner.trace * durations[0] + outer.trace * durations[1])
    speeds = (-into, out) if stable else (out, -into)
    height = inner.determinant
    return BoundaryCycle(
        SIDES[own],
        stable,
        sum(durations),
        durations,
        multiplier if stable else 1.0 / max(multiplier, 1e-300),
        (speeds[0] * height, speeds[1] * height),
    )


def _times(inner: _Side, outer: _Side) -> tuple[float, float]:
    """Times of the cycle round the unstable focus ``inner`` and on the other side, as ``at`` takes them."""
    half_turn = math.pi / inner.frequency
    longest = _root(lambda t: inner.at(t)[0], _NEAREST * half_turn, half_turn * (1 - 1e-9))

    def beyond(t: float) -> float:
        """Time on the other side of the orbit that leaves after t."""
        height = inner.at(t)[1]
        if outer.frequency > 0:
            most = math.pi / outer.frequency
            return -_root(lambda u: outer.at(-u)[0] - height, 1e-16 * most, most * (1 - 1e-9))
        end = 1.0
        while outer.at(end)[0] < height:
            end *= 2.0
            if end > _LONGEST:
                raise ValueError
        return _root(lambda u: outer.at(u)[0] - height, 1e-9 * end, end)

    t = _root(
        lambda t: outer.at(beyond(t))[1] - inner.at(t)[0],
        _NEAREST * half_turn,
        longest * (1 - 1e-12),
    )
    return t, beyond(t)


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """Root between two positive numbers, by their logarithm."""
    from scipy.optimize import brentq

    found = brentq(
        lambda u: function(math.exp(u)), math.log(low), math.log(high), xtol=1e-15, rtol=1e-15
    )
    return math.exp(float(found))
