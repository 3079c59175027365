"""First zeros of polynomials of time, whose coefficients may be functions on a set."""

from __future__ import annotations

from intervals import CheckError, Iv, whole
from mean_value_forms import ZERO, Form, middle, span


class UnsureError(CheckError):
    """A sign is undecided from a time on."""

    def __init__(self, since: int):
        super().__init__("the sign of a guard is undecided")
        self.since = since


def slope(c: list[Iv]) -> list[Iv]:
    return [v * whole(k) for k, v in enumerate(c)][1:]


def value(c: list[Iv], t: Iv) -> Iv:
    total = c[-1]
    for v in reversed(c[:-1]):
        total = total * t + v
    return total


def first_zero(c: list[Iv], h: int, drop: int) -> Iv | None:
    """The first zero in (0, h] of a polynomial that is positive just after 0; it is simple."""
    # The first ``drop`` coefficients are zero, whatever their enclosures are.
    rough, falls = [span(v) for v in c], slope([span(v) for v in c])
    todo, count = [(0, h)], 0
    while todo:
        a, b = todo.pop()
        count += 1
        if any(value(v[0 if a else drop :], Iv(a, b)).sign() > 0 for v in (rough, c)):
            continue
        if a or not drop:
            end = _fallen(c, falls, (a, b, h))
            if end is not None:
                return _narrowed(c, Iv(a, end))
        if count > 200 or b - a < h >> 40:
            raise UnsureError(a)
        m = (5 * a + 4 * b) // 9
        todo += [(m, b), (a, m)]
    return None


def _fallen(c: list[Iv], falls: list[Iv], times: tuple[int, int, int]) -> int | None:
    """A time at which a polynomial that falls from a on is negative; None if not proven."""
    a, b, h = times
    if value(c, Iv(a, a)).sign() <= 0:
        return None
    while value(falls, Iv(a, b)).sign() < 0:
        if value(c, Iv(b, b)).sign() < 0:
            return b
        if b >= h:
            return None
        b = min(h, 2 * b - a)
    return None


def _narrowed(c: list[Iv], t: Iv) -> Iv:
    """The zero inside of an interval where there is exactly one, as a function on the set."""
    wide = _newton([span(v) for v in c], t)
    if not any(type(v) is Form for v in c):
        return wide
    own, rates = _newton([middle(v) for v in c], wide), slope(c)
    r, rows = _slopes(c)
    along = [value(row, wide) for row in rows]
    time: Iv = wide
    for _ in range(3):  # the rate is a function on the set, too: narrower with the time
        rate = span(value(rates, time))
        time = Form(own, [ZERO if v.zero else -v / rate for v in along], r, span(time))
    return time


def passed(c: list[Iv], time: Iv) -> Iv:
    """A polynomial at a time that may be a function on the set."""
    if type(time) is Iv or all(type(v) is Iv for v in c):
        return value(c, time)
    rate = span(value(slope(c), time))
    r, rows = _slopes(c)
    g = [value(row, span(time)) + rate * t for row, t in zip(rows, time.g, strict=True)]
    within = value([span(v) for v in c], span(time))
    return Form(value([middle(v) for v in c], time.m), g, r, within)


def _slopes(c: list[Iv]) -> tuple[list[Iv], list[list[Iv]]]:
    """The box of a set, and the coefficients' derivatives by each of its directions."""
    r = next(v.r for v in c if type(v) is Form)
    return r, [[v.g[j] if type(v) is Form else ZERO for v in c] for j in range(len(r))]


def _newton(c: list[Iv], t: Iv) -> Iv:
    rates = slope(c)
    for _ in range(60):
        m = t.mid()
        new = m - value(c, m) / value(rates, t)
        new = Iv(max(new.a, t.a), min(new.b, t.b))
        if new.b - new.a > (t.b - t.a) * 0.9:
            return t
        t = new
    return t
