"""Status and kind of equilibria and pseudo-equilibria, by signs of h and of eigenvalues."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from intervals import CheckError, Iv, whole

Matrix = list[list[Iv]]


def equilibrium(at: Any, k: int) -> str:
    """Status and kind of a zero of one field."""
    own = (1, -1)[k]
    if at.h.v.zero:
        status = "boundary"
    else:
        status = {own: "real", -own: "virtual"}.get(at.h.v.sign(), "")
    n = len(at.fields[k])
    return f"{status} {kind([list(f.g[:n]) for f in at.fields[k]])}"


def pseudo_equilibrium(at: Any) -> str:
    """Status and kind of a zero of the sliding field F1 - a (F1 - F2), a = L1/(L1 - L2)."""
    lam, n = at.more[0].v, len(at.fields[0])
    (l1, g1), (l2, g2) = at.lie(0), at.lie(1)
    across = l1 - l2
    a = l1 / across
    slope = [(p * across - l1 * (p - q)) / across.sq() for p, q in zip(g1[:n], g2[:n], strict=True)]
    J = [
        [f.g[j] - a * (f.g[j] - g.g[j]) - slope[j] * (f.v - g.v) for j in range(n)]
        for f, g in zip(*at.fields, strict=True)
    ]
    normal = at.h.g[:n]
    k = max(range(n), key=lambda i: min(abs(normal[i].a), abs(normal[i].b)))
    rest = [i for i in range(n) if i != k]
    reduced = [[J[i][j] - J[i][k] * normal[j] / normal[k] for j in rest] for i in rest]
    one = whole(1)
    inside = (lam + one).sign() > 0 and (one - lam).sign() > 0
    outside = (lam + one).sign() < 0 or (one - lam).sign() < 0
    if not (inside or outside) or not l1.sign() or not l2.sign():
        raise CheckError("whether it slides is undecided")
    name = kind(reduced) if reduced else "stable node"
    for word in ("node", "focus", "saddle"):
        name = name.replace(word, "pseudo-" + word)
    return f"{'real' if inside else 'virtual'} {name}"


def kind(J: Matrix) -> str:
    """Kind of an equilibrium: Routh's array counts unstable eigenvalues, Sturm's chain real ones."""
    p = characteristic(J)
    unstable = _unstable(p)
    if 0 < unstable < len(J):
        return "saddle"
    shape = "node" if len(J) == 1 or _real_roots(p) == len(J) else "focus"
    return f"{'unstable' if unstable else 'stable'} {shape}"


def characteristic(J: Matrix) -> list[Iv]:
    """Coefficients of det(s - J), the highest first (Faddeev and LeVerrier)."""
    n = len(J)
    M = [[whole(0)] * n for _ in range(n)]
    c = [whole(1)]
    for k in range(1, n + 1):
        M = [
            [_dot(J[i], [row[j] for row in M]) + (c[-1] if i == j else whole(0)) for j in range(n)]
            for i in range(n)
        ]
        trace = whole(0)
        for i in range(n):
            trace = trace + _dot(J[i], [row[i] for row in M])
        c.append(-trace / whole(k))
    return c


def _dot(a: list[Iv], b: list[Iv]) -> Iv:
    total = whole(0)
    for x, y in zip(a, b, strict=True):
        total = total + x * y
    return total


def _unstable(p: list[Iv]) -> int:
    """Zeros with a positive real part, all others having a negative one."""
    rows, signs = [p[0::2], p[1::2]], [_signed(p[0])]
    for _ in range(len(p) - 1):
        top, row = rows[-2], rows[-1]
        if not row:
            raise CheckError("an eigenvalue may be on the imaginary axis")
        signs.append(_signed(row[0]))
        at = lambda r, i: r[i] if i < len(r) else whole(0)
        new = [
            (row[0] * at(top, i + 1) - top[0] * at(row, i + 1)) / row[0]
            for i in range(max(len(top) - 1, 0))
        ]
        rows.append(new)
    return sum(a != b for a, b in pairwise(signs))


def _signed(v: Iv) -> int:
    if not v.sign():
        raise CheckError("an eigenvalue may be on the imaginary axis")
    return v.sign()


def _real_roots(p: list[Iv]) -> int:
    """Real zeros of a polynomial with simple zeros, by the signs of Sturm's chain at both ends."""
    n = len(p) - 1
    chain = [p, [c * whole(n - i) for i, c in enumerate(p[:-1])]]
    while len(chain[-1]) > 1:
        rest, by = list(chain[-2]), chain[-1]
        while len(rest) >= len(by):
            q = rest[0] / by[0]
            rest = [
                a - q * b
                for a, b in zip(rest[1:], [*by[1:], *[whole(0)] * len(rest)], strict=False)
            ]
        if not rest[0].sign():
            raise CheckError("eigenvalues may be equal")
        chain.append([-c for c in rest])
    low = [c[0].sign() * (-1) ** (len(c) - 1) for c in chain]
    high = [c[0].sign() for c in chain]
    changes = lambda s: sum(a != b for a, b in pairwise(s))
    return changes(low) - changes(high)
