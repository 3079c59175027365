"""Proof of exactly one zero in a box by Krawczyk's operator.

K(X) = m - C f(m) + (1 - C J(X)) (X - m) with the midpoint m and any matrix C. Where K(X) lies in the
interior of X, every function whose values and Jacobian are enclosed has exactly one zero in X, in
K(X), and its Jacobian is regular all over X (Krawczyk 1969; Moore 1977; Neumaier 1990, ch. 5).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .equations import Equations, column, entries
from .flint import arb, arb_mat, ctx
from .intervals import inside, precision, radius, within


@dataclass(frozen=True)
class Zero:
    """A proven zero."""

    point: list[arb]  # encloses the zero
    box: list[arb]  # in which it is the only one; its interior contains ``image``
    image: list[arb]  # Krawczyk's operator of the box
    matrix: arb_mat  # C, exact


def operator(
    equations: Equations, box: Sequence[arb], matrix: arb_mat | None = None
) -> tuple[list[arb], arb_mat] | None:
    """Krawczyk's operator and its matrix; None where the Jacobian at the middle has no inverse."""
    middle = [x.mid() for x in box]
    if matrix is None:
        _, jacobian = equations.with_jacobian(middle)
        matrix = inverse(jacobian)
        if matrix is None:
            return None
    values, slopes = equations.with_jacobian(box)
    if not all(v.is_finite() for v in values.entries()):
        return None  # without finite values f may jump, even if its derivative is finite
    move = column([x - m for x, m in zip(box, middle, strict=True)])
    image = (identity(equations.n) - matrix * slopes) * move - matrix * equations.values(middle)
    return [m + k for m, k in zip(middle, entries(image), strict=True)], matrix


def inverse(jacobian: arb_mat) -> arb_mat | None:
    """The inverse of the midpoints as exact numbers, None where there is none."""
    try:
        found = jacobian.mid().inv().mid()
    except ZeroDivisionError:
        return None
    return found if all(v.is_finite() for v in found.entries()) else None


def identity(n: int) -> arb_mat:
    """The unit matrix."""
    return arb_mat([[int(i == j) for j in range(n)] for i in range(n)])


def polish(equations: Equations, start: Sequence[arb], steps: int = 40) -> list[arb] | None:
    """Newton's method to the working precision; no proof."""
    points = equations.holding([[a.mid() for a in v] for v in equations.held])
    u, last = [v.mid() for v in start], float("inf")
    for _ in range(steps):
        values, jacobian = points.with_jacobian(u)
        try:
            step = [s.mid() for s in entries(jacobian.mid().solve(values.mid()))]
        except ZeroDivisionError:
            return None
        u = [(a - b).mid() for a, b in zip(u, step, strict=True)]
        if not all(v.is_finite() for v in u):
            return None
        size = max(abs(float(s)) for s in step)
        relative = size / (1 + max(abs(float(v)) for v in u))
        if relative < 2.0 ** (4 - ctx.prec) or (size >= last / 2 and relative < 1e-9):
            break
        last = size
    return u


def prove_zero(
    equations: Equations,
    start: Sequence[arb],
    scales: Sequence[float] | None = None,
    known: Zero | None = None,
) -> Zero | None:
    """Prove one zero near the start, in as large a box as a few trials find, or narrow a known one."""
    u = polish(equations, start)
    if u is None or known is not None:
        return None if u is None or known is None else _narrowed(equations, u, known)
    sizes = list(scales) if scales else [max(1.0, abs(float(v))) for v in u]
    found = None
    with precision(64):
        for exponent in (-2, -5, -8, -12, -16, -20, -26, -32):  # large boxes first
            found = _attempt(equations, u, sizes, 2.0**exponent)
            if found:
                found = _grown(equations, u, sizes, 2.0**exponent, found)
                break
    if found is None:
        held = max([radius(a) for v in equations.held for a in v], default=0.0)
        tiny = 2.0 ** (12 - ctx.prec)
        for r in (tiny, 2.0**8 * tiny, 2.0**16 * tiny, 4 * held, 16 * held):
            found = _attempt(equations, u, sizes, r) if r > 0 else None
            if found:
                break
    return _narrowed(equations, u, found) if found else None


def _attempt(equations: Equations, u: list[arb], sizes: list[float], r: float) -> Zero | None:
    box = [arb(v, r * s) for v, s in zip(u, sizes, strict=True)]
    result = operator(equations, box)
    if result is None or not all(inside(k, x) for k, x in zip(result[0], box, strict=True)):
        return None
    return Zero(result[0], box, *result)


def _grown(equations: Equations, u: list[arb], sizes: list[float], r: float, found: Zero) -> Zero:
    """Enlarge a box of uniqueness a little, by halving the step of its exponent."""
    for step in (8.0, 2.0, 1.4) if r < 0.25 else (2.0, 2.0, 2.0):
        larger = _attempt(equations, u, sizes, r * step)
        if larger:
            found, r = larger, r * step
        elif r >= 0.25:
            break
    # A little inside the limit, so that other arithmetics than this one find it proven too.
    return _attempt(equations, u, sizes, 0.5 * r) or found


def _narrowed(equations: Equations, u: list[arb], found: Zero) -> Zero:
    """Contract the enclosure to the working precision; an exact zero has radius 0."""
    for guess in _exact_guesses(u):
        values = entries(equations.values(guess))
        if all(v.is_zero() for v in values) and within(guess, found.box):
            return Zero(guess, found.box, found.image, found.matrix)
    point = found.point
    held = max([radius(a) for v in equations.held for a in v], default=0.0)
    small = [arb(v, max(2.0 ** (12 - ctx.prec), 16 * held) * max(1.0, abs(float(v)))) for v in u]
    if all(inside(a, b) for a, b in zip(small, found.box, strict=True)):
        result = operator(equations, small)
        # A box of existence inside the box of uniqueness: the zero is the one in it.
        if result and all(inside(k, x) for k, x in zip(result[0], small, strict=True)):
            point = result[0]
    for _ in range(60):
        result = operator(equations, point)
        if result is None or not all(k.is_finite() for k in result[0]):
            break
        if not all(k.overlaps(p) for k, p in zip(result[0], point, strict=True)):
            break  # cannot be: the zero is in both
        new = [k.intersection(p) for k, p in zip(result[0], point, strict=True)]
        gain = max(map(radius, new)) <= 0.5 * max(map(radius, point))
        point = new
        if not gain:
            break
    return Zero(point, found.box, found.image, found.matrix)


def _exact_guesses(u: Sequence[arb]) -> list[list[arb]]:
    """Short binary numbers near a point, at which a zero may lie exactly."""
    guesses = []
    for parts in (1, 2**10):
        scaled = [(v * parts + arb(0.5)).mid().floor() for v in u]
        if all(s.is_exact() for s in scaled):
            guesses.append([(s / parts).mid() for s in scaled])
    return guesses
