"""The first zero of an enclosed function of time, or the proof that there is none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..arithmetic.flint import arb
from ..arithmetic.intervals import hull, radius
from ..arithmetic.series import horner

_MANY = 1500  # pieces of a step


class UnsureError(Exception):
    """The sign of a function is undecided from some time of the step on."""

    def __init__(self, since: float):
        super().__init__(f"undecided since {since}")
        self.since = since


@dataclass(frozen=True)
class Polynomial:
    """A function of time in [0, h] as Taylor polynomial with enclosed remainder."""

    c: Sequence[arb]
    top: arb
    zeros: int = 0

    def value(self, t: arb) -> arb:
        """Enclose the values at times."""
        return horner([*self.c, self.top], t)

    def reduced(self, t: arb) -> arb:
        """Enclose the values divided by t^zeros."""
        return horner([*self.c[self.zeros :], self.top], t)

    def slope(self, t: arb) -> arb:
        """Enclose the derivative; the remainder is (K + 1) times its coefficient t^K."""
        slopes = [(k + 1) * v for k, v in enumerate(self.c[1:])]
        return horner([*slopes, len(self.c) * self.top], t)


def first_zero(f: Polynomial, h: float) -> arb | None:
    """The first zero in (0, h] of a function that is positive just after 0."""
    todo, count = [(0.0, h)], 0
    while todo:
        a, b = todo.pop()
        count += 1
        t = hull(arb(a), arb(b))
        if (f.reduced(t) if a == 0.0 else f.value(t)) > 0:
            continue
        if a > 0.0 or not f.zeros:
            found = _falling(f, a, b, h)
            if found is not None:
                return found
        if count > _MANY or b - a < 1e-13 * h:
            raise UnsureError(a)
        m = a + (b - a) * 0.4871
        todo += [(m, b), (a, m)]
    return None


def _falling(f: Polynomial, a: float, b: float, h: float) -> arb | None:
    """The only zero at which the function falls, in (a, b] or a little beyond; None if not proven."""
    if not f.value(arb(a)) > 0:
        return None
    width = b - a
    for _ in range(6):
        t = hull(arb(a), arb(b))
        if not f.slope(t) < 0:
            return None
        if f.value(arb(b)) < 0:
            return narrowed(f, t)
        if f.value(arb(b)) > 0 or b >= h:
            return None
        width *= 2
        b = min(a + width, h)
    return None


def narrowed(f: Polynomial, t: arb) -> arb:
    """Interval Newton: m - f(m)/f'(T) holds the zero of every function enclosed."""
    for _ in range(60):
        m, slope = t.mid(), f.slope(t)
        if slope.contains(0):
            break
        new = (m - f.value(m) / slope).intersection(t)
        if not new.is_finite() or radius(new) > 0.9 * radius(t):
            break
        t = new
    return t
