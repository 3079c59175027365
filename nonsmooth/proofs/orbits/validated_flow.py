"""Validated integration of one orbit, or of all orbits from a box.

A step has an a-priori enclosure B, the Taylor polynomial with the coefficient K + 1 over B as
remainder, and the set of states as middle + frame r with an orthogonal frame (Lohner 1987). Guards
are proven positive, or to have one simple zero; there the time is eliminated by the derivative of the
return map, (1 - f grad g/(grad g . f)) D. The end of the integration is such a zero too, of the time
that is left or of another function. ``itinerary`` decides what follows an event.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arithmetic.equations import column, entries
from ..arithmetic.flint import arb, arb_mat, ctx
from ..arithmetic.intervals import hull, radius
from ..arithmetic.krawczyk import identity
from ..arithmetic.series import horner
from ..proof import DigitsError, UnprovenError
from .first_zero import Polynomial, UnsureError, first_zero, narrowed
from .modes import EventFunction, Mode, Modes


@dataclass
class Step:
    """One step with its enclosures."""

    h: float
    natural: float  # the step without limits
    tube: list[arb]
    hull: list[arb]
    c: list[list[arb]]  # of the hull
    top: list[list[arb]]  # of the tube
    guards: list[list[arb]]
    guard_tops: list[list[arb]]


def at(c: Sequence[Sequence[arb]], top: Sequence[Sequence[arb]], time: arb) -> list[arb]:
    """States at a time from coefficients 0..K and the remainder."""
    return [horner([*a[:-1], b[-1]], time) for a, b in zip(c, top, strict=True)]


def growth(bound: float, h: float) -> float:
    """exp(bound h) - 1, rounded upward."""
    return float(((arb(bound) * arb(h)).expm1()).upper()) * (1 + 1e-12)


def orthogonal(matrix: arb_mat, sides: arb_mat) -> arb_mat:
    """An orthogonal frame of the edges of a set as exact doubles, longest edge first."""
    a = np.array([[float(v.mid()) for v in row] for row in matrix.tolist()])
    widest = max(map(radius, entries(sides)))
    a *= [radius(v) / widest for v in entries(sides)]
    order = np.argsort(-np.linalg.norm(a, axis=0))
    q = np.linalg.qr(a[:, order])[0]
    return arb_mat([[arb(float(v)) for v in row] for row in q.tolist()])


#: Bits that the terms of a Taylor polynomial may lose where they cancel.
_GUARD_BITS = 32

#: Sets of a smaller radius take longer steps.
_NARROW = 1e-4

#: How often a step is shortened so that event functions are enclosed well.
_SHORTER = 5


class ValidatedFlow:
    """A set of states that moves in one mode."""

    def __init__(self, modes: Modes, x: Sequence[arb], p: Sequence[arb]):
        self.modes, self.p, self.n = modes, list(p), len(x)
        self.bits, self.order = ctx.prec + _GUARD_BITS, max(12, int(ctx.prec * 0.3))
        self.along = identity(self.n)  # derivatives of r by the start
        self.adopt(list(x))
        self.origin = x[modes.clock]
        self.steps, self.smallest, self.mode = 0, 0.0, ""
        self.end: EventFunction | None = None
        self.zeros: dict[int, int] = {}
        self.signs: dict[int, int] = {}

    # the set -------------------------------------------------------------------------------------

    def adopt(self, x: list[arb]) -> None:
        self.middle, self.frame = [v.mid() for v in x], identity(self.n)
        self.r = column([v - m for v, m in zip(x, self.middle, strict=True)])

    def hull(self) -> list[arb]:
        """A box around the set."""
        move = entries(self.frame * self.r)
        return [m + v for m, v in zip(self.middle, move, strict=True)]

    @property
    def t(self) -> arb:
        """Time since the start."""
        return self.hull()[self.modes.clock] - self.origin

    @property
    def derivative(self) -> arb_mat:
        """Derivatives of the states by those at the start, for all states of the set."""
        return self.frame * self.along

    def moved(self, image: list[arb], derivative: arb_mat) -> None:
        """The set becomes image + derivative (x - middle), in a new orthogonal frame."""
        product = derivative * self.frame
        if not all(v.is_finite() for v in (*image, *entries(product))):
            raise UnprovenError(f"the flow has no enclosure at t = {float(self.t.mid()):.9g}")
        wide = any(radius(v) > 0 for v in entries(self.r))
        frame = orthogonal(product, self.r) if wide else identity(self.n)
        inverse = frame.inv()
        self.middle = [v.mid() for v in image]
        miss = column([v - m for v, m in zip(image, self.middle, strict=True)])
        self.r = inverse * miss + (inverse * product) * self.r
        self.along = (inverse * product) * self.along
        self.frame = frame

    @property
    def now(self) -> Mode:
        """The current mode."""
        return self.modes[self.mode]

    # steps ---------------------------------------------------------------------------------------

    def step(self) -> int | None:
        """Take one step, at most to the first event or the end; return the index of its function or None."""
        left = limit = math.inf
        if self.end is not None and self.end.index < 0:  # a time: a little longer than what is left
            (k,) = (k for k, w in enumerate(self.now.event_functions) if w is self.end)
            left = float(self.now.event_values(self.hull(), self.p)[k].upper())
            limit = (1 + 2.0**-10) * left
        for _ in range(40):
            step = self._prepare(limit)
            try:
                event = self._first_event(step)
            except UnsureError as unsure:
                if unsure.since < 0.02 * min(step.natural, left):
                    raise UnprovenError(
                        f"the sign of a guard is undecided at t = {float(self.t.mid()) + unsure.since:.9g} "
                        "(a tangency, or the set is too wide)"
                    ) from None
                limit = unsure.since
                continue
            return self._advance(step, event)
        raise UnprovenError(f"no step at t = {float(self.t.mid()):.9g}")

    def _prepare(self, limit: float) -> Step:
        """A step size with an a-priori enclosure and a small remainder."""
        mode, x = self.now, self.hull()
        wide = max(radius(v) for v in x)
        # Series of affine fields are cheap; those of wide sets are far wider than the sets after a long step.
        order = self.order * (2 if mode.affine and wide < _NARROW else 1)
        c = mode.series(x, self.p, order + 2)
        size = max(max(abs(float(v[order].mid())) for v in c), 1e-300)
        tolerance = max(2.0**-self.bits, 1e-3 * wide)
        natural = min((tolerance / size) ** (1 / order), 1e6)
        if wide >= _NARROW:
            natural = min(natural, wide / max(1e-300, *(radius(v[1]) for v in c)))
        h, shorter, guards = min(natural, limit), 0, mode.event_series(c, self.p)
        for _ in range(60):
            tube, top = self._tube(c, h, 16 * tolerance)
            rest = max(float(abs(v[-1]).upper()) for v in top) * h ** (order + 1)
            if rest <= 8 * tolerance:
                tops = mode.event_series(top, self.p)
                if not all(v[-1].is_finite() for v in tops):
                    h /= 2
                    continue
                if shorter == _SHORTER or not _coarse(guards, tops, h, tolerance):
                    break
                shorter += 1
                h *= 0.6
                continue
            ratio = (8 * tolerance / rest) ** (1 / (order + 1)) if rest < 1e300 else 0.0
            h *= min(0.9, max(0.3, 0.9 * ratio))
        else:
            raise UnprovenError(
                f"no enclosure of the motion from t = {float(self.t.mid()):.9g} (the field is not "
                "defined there, or the set is too wide)"
            )
        if min(h, natural) < self.smallest:
            raise DigitsError(
                f"steps become too small at t = {float(self.t.mid()):.9g} (a singularity is near)"
            )
        if wide > 0:
            guards = mode.narrowed(guards, self.middle, (self.frame, self.r), self.p)
        return Step(h, natural, tube, x, c, top, guards, tops)

    def _tube(self, c: list[list[arb]], h: float, margin: float) -> Any:
        """States B around the Taylor polynomials on [0, h], and the coefficients over B."""
        # Remainders over B that are less than the margin keep every orbit in B (Corliss and Rihm 1996).
        t = hull(arb(0), arb(h))
        tube = [horner(v[:-1], t) + arb(0, margin) for v in c]
        return tube, self.now.series(tube, self.p, len(c[0]))

    def _first_event(self, step: Step) -> tuple[int, arb] | None:
        """The guard with the first zero, proven, and its time."""
        events, unsure = [], float("inf")
        for k, function in enumerate(self.now.event_functions):
            if function.kind == "end" and function is not self.end:
                continue
            f = self._polynomial(step, k)
            try:
                t = first_zero(f, step.h)
            except UnsureError as error:
                unsure = min(unsure, error.since)
                continue
            if t is not None:
                events.append((t, k))
        events.sort(key=lambda event: float(event[0].upper()))
        if events and float(events[0][0].upper()) < unsure:
            return self._earliest(step, events)
        if unsure < float("inf"):
            raise UnsureError(unsure)
        return None

    def _earliest(self, step: Step, events: list[tuple[arb, int]]) -> tuple[int, arb]:
        """The first of the zeros; of those that may coincide only one may be an event."""
        time, k = events[0]
        together = [events[0], *((t, j) for t, j in events[1:] if not time < t)]
        if len(together) == 1:
            return k, time
        counting = [(t, j) for t, j in together if self.is_event(j)]
        passed = [event for event in together if not self.is_event(event[1])]
        if any(not self._stays_past(step, event, together) for event in passed):
            counting = []  # it may come back in its own direction
        if len(counting) == 1 and self.now.event_functions[counting[0][1]].kind in ("stop", "end"):
            return counting[0][1], counting[0][0]
        for t, j in counting:
            others = [event for event in together if event[1] != j]
            if all(self._comes_before(step, (j, t), other) for other in others):
                return j, t
        names = ", ".join(self.now.event_functions[j].name for _, j in together)
        when = float((self.t + time).mid())
        raise UnprovenError(f"which comes first is undecided: {names} at t = {when:.9g}")

    def _stays_past(
        self, step: Step, event: tuple[arb, int], together: list[tuple[arb, int]]
    ) -> bool:
        """Whether a guard that is passed has no second zero before the other zeros."""
        f = self._polynomial(step, event[1])
        until = event[0]
        for t, _ in together:
            until = hull(until, t)
        return bool(f.slope(until) < 0)

    def _comes_before(self, step: Step, event: tuple[int, arb], other: tuple[arb, int]) -> bool:
        """Whether every orbit reaches one event while another guard, which only falls, is positive."""
        t, j = other
        f = self._polynomial(step, j)
        if not f.slope(hull(event[1], t)) < 0:
            return False
        image, derivative = self._at_event(step, event)
        move = (derivative * self.frame) * self.r
        around = [v + w for v, w in zip(image, entries(move), strict=True)]
        row = self.now.slope(j, around, self.p)
        value = self.now.event_values(image, self.p)[j] + (arb_mat([row]) * move)[0, 0]
        tied = ((arb_mat([row]) * (derivative * self.frame)) * self.r)[0, 0]
        value = value.intersection(self.now.event_values(image, self.p)[j] + tied)
        return bool(self._turned(j) * value > 0)

    def _turned(self, k: int) -> int:
        """The sign that makes an event function positive in the current mode."""
        function = self.now.event_functions[k]
        return self.signs[function.index] if function.signed else 1

    def is_event(self, k: int) -> bool:
        """Whether a zero of a guard is an event: stops and resets have a direction."""
        function = self.now.event_functions[k]
        return not function.signed or function.direction * -self.signs[function.index] >= 0

    def _polynomial(self, step: Step, k: int) -> Polynomial:
        c, top = step.guards[k][:-1], step.guard_tops[k][-1]
        if self._turned(k) < 0:
            c, top = [-v for v in c], -top
        return Polynomial(c, top, self.zeros.get(k, 0))

    def _advance(self, step: Step, event: tuple[int, arb] | None) -> int | None:
        if event is None:
            c, time = self.now.series(self.middle, self.p, len(step.c[0])), arb(step.h)
            image, derivative = at(c, step.top, time), self._derivative(step, time)
        else:
            image, derivative = self._at_event(step, event)
        self.moved(image, derivative)
        self.steps, self.zeros = self.steps + 1, {}
        return None if event is None else event[0]

    def _at_event(self, step: Step, event: tuple[int, arb]) -> tuple[list[arb], arb_mat]:
        """Image of the middle at an event, and the derivative of the return map there."""
        c = self.now.series(self.middle, self.p, len(step.c[0]))
        image = at(c, step.top, self._own_time(c, step, event))
        derivative, x = self._derivative(step, event[1]), at(step.c, step.top, event[1])
        for _ in range(2):  # the image of the set encloses its states at the event, too
            back = self._return_map(x, event, derivative)
            move = entries(back * self.frame * self.r)
            x = [
                v.intersection(u + w) if v.overlaps(u + w) else v
                for v, u, w in zip(x, image, move, strict=True)
            ]
        return image, back

    def _derivative(self, step: Step, time: arb) -> arb_mat:
        """Derivatives of the flow to times in ``time``, for all states of the set."""
        mode = self.now
        if mode.affine:
            middle, jacobian = time.mid(), mode.jacobian(step.hull, self.p)
            return (jacobian * middle).exp() * (jacobian * (time - middle)).exp()
        jacobian = mode.jacobian(step.tube, self.p)
        if not all(v.is_finite() for v in jacobian.entries()):
            raise UnprovenError(f"the field has no derivative near t = {float(self.t.mid()):.9g}")
        bound = max(
            sum(float(abs(v).upper()) for v in row) * (1 + 1e-12) for row in jacobian.tolist()
        )
        grow = growth(bound, step.h)
        around = arb_mat([[arb(int(i == j), grow) for j in range(self.n)] for i in range(self.n)])
        low = mode.variation(step.c, self.p, identity(self.n))
        top = mode.variation(step.top, self.p, around)
        return horner([*low[:-1], top[-1]], time)

    def _own_time(self, c: list[list[arb]], step: Step, event: tuple[int, arb]) -> arb:
        """The event's time of the middle alone, narrower than that of the whole set."""
        k, time = event
        g = self.now.event_series(c, self.p)[k]
        return narrowed(Polynomial(g[:-1], step.guard_tops[k][-1]), time)

    def _return_map(self, x: list[arb], event: tuple[int, arb], derivative: arb_mat) -> arb_mat:
        """(1 - f grad g/(grad g . f)) D for the states at the event."""
        k, time = event
        f, g = self.now.field(x, self.p), self.now.slope(k, x, self.p)
        rate = sum((a * b for a, b in zip(f, g, strict=True)), arb(0))
        if rate.contains(0) or not rate.is_finite():
            return derivative if radius(time) == 0 else _not_transversal(self)
        n = self.n
        across = arb_mat([[int(i == j) - f[i] * g[j] / rate for j in range(n)] for i in range(n)])
        return across * derivative


def _coarse(guards: list[list[arb]], tops: list[list[arb]], h: float, tolerance: float) -> bool:
    """Whether the remainder of an event function is far larger than that of the motion."""
    for c, top in zip(guards, tops, strict=True):
        size = max(float(abs(v.mid())) * h**k for k, v in enumerate(c[:-1]))
        if not float(abs(top[-1]).upper()) * h ** (len(c) - 1) <= 64 * tolerance * size:
            return True
    return False


def _not_transversal(flow: ValidatedFlow) -> arb_mat:
    raise UnprovenError(f"an event at t = {flow.t.str(8)} is not proven to be transversal")
