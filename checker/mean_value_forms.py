"""Sets of states as parallelepipeds, and functions on them in mean value form.

The set is c + B r, r in a box that is symmetric around zero (Lohner 1987). A function on it is its value
in the middle and its derivatives by r everywhere, which keeps the dependence between states. Every
operation on ``Iv`` works on ``Form`` too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from intervals import BITS, CheckError, Iv, whole

ZERO, UNIT = whole(0), whole(1).a
Matrix = list[list[Iv]]


class Form(Iv):
    """A function on a set: its range, its value ``m`` in the middle, its derivatives ``g`` by r."""

    __slots__ = ("g", "m", "r")

    def __init__(self, m: Iv, g: Sequence[Iv], r: Sequence[Iv], within: Iv | None = None):
        reach = 0
        for slope, side in zip(g, r, strict=True):
            if slope is not ZERO:
                reach += max(-slope.a, slope.b) * side.b
        reach = -(-reach >> BITS)
        low, high = m.a - reach, m.b + reach
        if within is not None:
            low, high = max(low, within.a), min(high, within.b)
        if low > high:
            raise CheckError("nothing is left of a set")
        super().__init__(low, high)
        self.m, self.g, self.r = m, g, r

    def __add__(self, o: Iv) -> Iv:
        g = self.g if type(o) is Iv else [_plus(s, t) for s, t in zip(self.g, o.g, strict=True)]
        return Form(self.m + middle(o), g, self.r, Iv(self.a + o.a, self.b + o.b))

    def __sub__(self, o: Iv) -> Iv:
        g = self.g if type(o) is Iv else [_minus(s, t) for s, t in zip(self.g, o.g, strict=True)]
        return Form(self.m - middle(o), g, self.r, Iv(self.a - o.b, self.b - o.a))

    def __neg__(self) -> Iv:
        return Form(-self.m, [s if s is ZERO else -s for s in self.g], self.r)

    def __mul__(self, o: Iv) -> Iv:
        own, other = span(self), span(o)
        g = [_scaled(s, other) for s in self.g]
        if type(o) is not Iv:
            g = [_plus(s, _scaled(t, own)) for s, t in zip(g, o.g, strict=True)]
        return Form(self.m * middle(o), g, self.r, own * other)

    def __truediv__(self, o: Iv) -> Iv:
        other = span(o)
        value = span(self) / other
        g = list(self.g)
        if type(o) is not Iv:
            g = [_minus(s, _scaled(t, value)) for s, t in zip(g, o.g, strict=True)]
        g = [s if s is ZERO else s / other for s in g]
        return Form(self.m / middle(o), g, self.r, value)

    __radd__, __rmul__ = __add__, __mul__

    def __rsub__(self, o: Iv) -> Iv:
        return -(self - o)

    def __rtruediv__(self, o: Iv) -> Iv:
        return Form(o, [ZERO] * len(self.g), self.r) / self

    def sq(self) -> Iv:
        own = span(self)
        twice = own + own
        return Form(self.m.sq(), [_scaled(s, twice) for s in self.g], self.r, own.sq())

    def chained(self, f: Callable[[Iv], Iv], slope: Callable[[Iv], Iv]) -> Iv:
        """A function of this one, by its values and its slope."""
        own = span(self)
        by = slope(own)
        return Form(f(self.m), [_scaled(s, by) for s in self.g], self.r, f(own))


def _plus(s: Iv, t: Iv) -> Iv:
    return t if s is ZERO else s if t is ZERO else s + t


def _minus(s: Iv, t: Iv) -> Iv:
    return s if t is ZERO else s - t


def _scaled(s: Iv, by: Iv) -> Iv:
    return s if s is ZERO else s * by


def span(v: Iv) -> Iv:
    """The range of a function."""
    return Iv(v.a, v.b)


def middle(v: Any) -> Iv:
    """The value in the middle of the set."""
    return v if type(v) is Iv else v.m


def tube(v: Iv, more: int, slopes: int = 0) -> Iv:
    """A function that may be anywhere in a range, with its derivatives; both wider by so much."""
    own = Iv(v.a - more, v.b + more)
    if type(v) is Iv:
        return own
    return Form(own, [Iv(s.a - slopes, s.b + slopes) for s in v.g], v.r, own)


def covers(b: Iv, v: Iv) -> bool:
    """Whether a range with its derivatives holds another."""
    pairs = [(b, v), *(zip(b.g, v.g, strict=True) if type(b) is Form else ())]
    return all(p.a <= q.a and q.b <= p.b for p, q in pairs)


# Sets --------------------------------------------------------------------------------------------


class States:
    """All c + B r, r in a box around zero; ``values`` are the functions that give the states."""

    def __init__(self, box: list[Iv], wide: bool):
        n = len(box)
        self.values: list[Iv] = box
        self.wide = wide
        self.along = [[whole(int(i == j)) for j in range(n)] for i in range(n)]
        if wide:
            c = [v.mid() for v in box]
            frame = [[whole(1) if i == j else ZERO for j in range(n)] for i in range(n)]
            self._set(c, frame, [v - m for v, m in zip(box, c, strict=True)], box)

    def _set(self, c: list[Iv], frame: Matrix, r: list[Iv], within: list[Iv]) -> None:
        rows = [
            [ZERO if v.zero or s.zero else v for v, s in zip(row, r, strict=True)] for row in frame
        ]
        around = [Iv(min(w.a, m.a), max(w.b, m.b)) for w, m in zip(within, c, strict=True)]
        self.values = [Form(m, row, r, w) for m, row, w in zip(c, rows, around, strict=True)]

    def become(self, image: list[Iv]) -> None:
        """Replace the set by its image; errors are put into r."""
        if not self.wide:
            self.values = image
            return
        r = next(v.r for v in image if type(v) is Form)
        g = [list(v.g) if type(v) is Form else [ZERO] * len(r) for v in image]
        c = [middle(v).mid() for v in image]
        miss = [middle(v) - m for v, m in zip(image, c, strict=True)]
        found = []
        for skew in (True, False):
            frame = _frame(g, r, skew)
            try:
                back = inverse(frame)
            except CheckError:
                continue
            parts = zip(applied(product(back, g), r), applied(back, miss), strict=True)
            new = [a + b for a, b in parts]
            found.append((_size(frame, new), not skew, frame, new, back))
        if not found:
            raise CheckError("no frame for a set")
        _, _, frame, new, back = min(found, key=lambda f: f[:2])
        self._frame, self.along = frame, product(product(back, g), self.along)
        self._set(c, frame, new, [span(v) for v in image])

    def derivatives(self) -> Matrix:
        """Derivatives of the states by those at the start, where forms have those of the motion."""
        return product(self._frame, self.along)


def _size(frame: Matrix, r: list[Iv]) -> int:
    return sum(abs(s.a) * (t.b - t.a) for row in frame for s, t in zip(row, r, strict=True))


def applied(matrix: Matrix, vector: list[Iv]) -> list[Iv]:
    """A matrix times a vector."""
    return [sum((s * t for s, t in zip(row, vector, strict=True)), ZERO) for row in matrix]


def product(a: Matrix, b: Matrix) -> Matrix:
    """A matrix times a matrix."""
    return [applied(list(map(list, zip(*b, strict=True))), row) for row in a]


def inverse(matrix: Matrix) -> Matrix:
    """An enclosure of the inverse, by elimination."""
    n = len(matrix)
    rows = [[*row, *(whole(int(i == j)) for j in range(n))] for i, row in enumerate(matrix)]
    for c in range(n):
        pivot = max(range(c, n), key=lambda k, c=c: min(abs(rows[k][c].a), abs(rows[k][c].b)))
        rows[c], rows[pivot] = rows[pivot], rows[c]
        rows[c] = [v / rows[c][c] for v in rows[c]]
        for k in range(n):
            if k != c:
                rows[k] = [v - rows[k][c] * w for v, w in zip(rows[k], rows[c], strict=True)]
    return [row[n:] for row in rows]


def _frame(g: Matrix, r: list[Iv], skew: bool) -> Matrix:
    """Directions of the longest edges of a set, or orthogonal ones near them, as exact points."""
    # Edges that nearly depend on longer ones are replaced by what is orthogonal to those.
    n = len(g)
    wide = max(v.b - v.a for v in r)
    share = [(v.b - v.a) / wide for v in r]
    edges = [([(row[j].a + row[j].b) / UNIT * share[j] for row in g], j) for j in range(len(r))]
    edges.sort(key=lambda e: -_length(e[0]))
    edges += [([float(i == j) for i in range(n)], -1) for j in range(n)]
    straight: list[list[float]] = []
    columns: Matrix = []
    for edge, j in edges:
        rest, length = edge, _length(edge)
        for q in [*straight, *straight]:
            along = sum(a * b for a, b in zip(rest, q, strict=True))
            rest = [a - along * b for a, b in zip(rest, q, strict=True)]
        if len(columns) == n or _length(rest) <= (1e-3 if skew else 1e-8) * length:
            continue
        straight.append([v / _length(rest) for v in rest])
        own = [row[j].mid() for row in g] if skew and j >= 0 else None
        columns.append(own or [Iv.of(v).mid() for v in straight[-1]])
    return [list(row) for row in zip(*columns, strict=True)]


def _length(edge: list[float]) -> float:
    return sum(v * v for v in edge) ** 0.5
