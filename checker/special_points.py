"""Check of a recorded special point: one zero in a box, its position and its class."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from derivatives import D, run
from equilibria import equilibrium, pseudo_equilibrium
from intervals import CheckError, Iv, number, whole
from polynomials import is_multiple
from records import require_point
from series import along_field

FORMAT = "nonsmooth proof 1"
Matrix = list[list[Iv]]


class Equations:
    """The equations of a special point and their derivatives, from a record."""

    def __init__(self, record: dict[str, Any]):
        if record.get("format") != FORMAT:
            raise CheckError(f"expected the format {FORMAT!r}, received {record.get('format')!r}")
        require_point(record)
        self.record, self.graph = record, record["graph"]
        self.n, self.unknowns = record["states"], [tuple(u) for u in record["unknowns"]]
        self.extra = sum(vector == 2 for vector, _ in self.unknowns)
        self.p = [D(Iv.of(*pair)) for pair in record["parameters"]]

    def variables(self, u: list[Iv]) -> tuple[list[D], list[D]]:
        """States and further unknowns with their derivatives."""
        size = self.n + self.extra
        unit = [[whole(int(i == j)) for j in range(size)] for i in range(size)]
        zero = [[whole(0)] * size for _ in range(size)]
        x = [D(Iv.of(*v), unit[i], zero) for i, v in enumerate(self.record["held"])]
        more = [D(whole(0), unit[self.n + k], zero) for k in range(self.extra)]
        for (vector, i), value in zip(self.unknowns, u, strict=True):
            target = x if vector == 0 else more
            target[i] = D(value, target[i].g, zero)
        return x, more

    def local(self, u: list[Iv]) -> Local:
        """h, both fields and Lie derivatives on a box."""
        x, more = self.variables(u)
        values = run(self.graph, x, self.p, more)
        return Local(self, values, more)

    def is_cusp(self, u: list[Iv]) -> bool:
        """Whether h rises or falls with the third power of time along the field, exactly."""
        side = ("above", "below")["+-".index(self.record["side"])]
        states = [Iv.of(*pair) for pair in self.record["held"]]
        for (vector, i), value in zip(self.unknowns, u, strict=True):
            if vector == 0:
                states[i] = value
        c = along_field(
            self.graph, self.graph[side], self.graph["surface"], states, [d.v for d in self.p]
        )
        return c[2].zero and c[3].sign() != 0

    def system(self, u: list[Iv]) -> tuple[list[Iv], Matrix]:
        """Values and Jacobian of the square system."""
        at = self.local(u)
        kind = self.record["kind"]
        rows = getattr(at, kind.replace("-", "_"))()
        columns = [i if vector == 0 else self.n + i for vector, i in self.unknowns]
        f = [v for v, _ in rows]
        J = [[g[c] for c in columns] for _, g in rows]
        free = [i for vector, i in self.unknowns if vector == 0]
        for normal in self.record["normals"]:
            total = whole(0)
            for c, through, (_, value) in zip(
                normal, self.record["through"], zip(free, u, strict=False), strict=True
            ):
                total = total + Iv.of(c) * (value - Iv.of(through))
            f.append(total)
            J.append([Iv.of(c) for c in normal])
        return f, J


class Local:
    """h, both fields and Lie derivatives on a box of points."""

    def __init__(self, equations: Equations, values: list[D], more: list[D]):
        graph, self.size = equations.graph, equations.n + equations.extra
        self.more, self.side = more, equations.record["side"]
        self.h = self._full(values[graph["surface"]])
        self.fields = [[self._full(values[k]) for k in graph[s]] for s in ("above", "below")]
        self.factor = [self._full(values[k]) for k in graph.get("direction", [])]
        self.positive = [self._full(values[k]) for k in graph["positive"]]

    def _full(self, d: D) -> D:
        zero = [whole(0)] * self.size
        return d if d.g else D(d.v, zero, [zero] * self.size)

    def lie(self, k: int) -> tuple[Iv, list[Iv]]:
        """L_k and its gradient."""
        F, n = self.fields[k], len(self.fields[k])
        value = whole(0)
        gradient = [whole(0)] * self.size
        for j in range(n):
            value = value + F[j].v * self.h.g[j]
            for i in range(self.size):
                gradient[i] = gradient[i] + self.h.H[i][j] * F[j].v + F[j].g[i] * self.h.g[j]
        return value, gradient

    def second(self, i: int, j: int) -> Iv:
        """L_ij = F_i . grad L_j."""
        _, gradient = self.lie(j)
        total = whole(0)
        for f, g in zip(self.fields[i], gradient, strict=False):
            total = total + f.v * g
        return total

    def two_fold(self) -> list[tuple[Iv, list[Iv]]]:
        return [(self.h.v, self.h.g), self.lie(0), self.lie(1)]

    def fold(self) -> list[tuple[Iv, list[Iv]]]:
        return [(self.h.v, self.h.g), self.lie("+-".index(self.side))]

    def equilibrium(self) -> list[tuple[Iv, list[Iv]]]:
        return [(f.v, f.g) for f in self.fields["+-".index(self.side)]]

    def pseudo_equilibrium(self) -> list[tuple[Iv, list[Iv]]]:
        lam, two, rows = self.more[0], whole(2), [(self.h.v, self.h.g)]
        for a, b in zip(*self.fields, strict=True):
            half = (a.v - b.v) / two
            g = [
                (p + q) / two + lam.v * ((p - q) / two) + lam.g[i] * half
                for i, (p, q) in enumerate(zip(a.g, b.g, strict=True))
            ]
            rows.append(((a.v + b.v) / two + lam.v * half, g))
        return rows


# Krawczyk ----------------------------------------------------------------------------------------


def krawczyk(equations: Any, box: list[Iv], matrix: Matrix) -> list[Iv]:
    """m - C f(m) + (1 - C J(X)) (X - m)."""
    n, m = len(box), [b.mid() for b in box]
    f, _ = equations.system(m)
    _, J = equations.system(box)
    image = []
    for i in range(n):
        total = m[i]
        for j in range(n):
            total = total - matrix[i][j] * f[j]
            entry = whole(int(i == j))
            for k in range(n):
                entry = entry - matrix[i][k] * J[k][j]
            total = total + entry * (box[j] - m[j])
        image.append(total)
    return image


def inverse(J: Matrix) -> Matrix:
    """An inverse of the middles, by elimination in fractions; any matrix would do for a proof."""
    n = len(J)
    middles = [[Fraction(v.a + v.b, 2 * whole(1).a) for v in row] for row in J]
    rows = [row + [Fraction(int(i == j)) for j in range(n)] for i, row in enumerate(middles)]
    for c in range(n):
        pivot = max(range(c, n), key=lambda r, c=c: abs(rows[r][c]))
        if rows[pivot][c] == 0:
            raise CheckError("the Jacobian has no inverse")
        rows[c], rows[pivot] = rows[pivot], rows[c]
        rows[c] = [v / rows[c][c] for v in rows[c]]
        for r in range(n):
            if r != c:
                rows[r] = [v - rows[r][c] * w for v, w in zip(rows[r], rows[c], strict=True)]
    return [[Iv.of(v).mid() for v in row[n:]] for row in rows]


def check(record: dict[str, Any]) -> str:
    """Check one proof; return a summary."""
    equations = Equations(record)
    box = [Iv.of(*pair) for pair in record["box"]]
    matrix = [[Iv.of(v) for v in row] for row in record["matrix"]]
    image = krawczyk(equations, box, matrix)
    if not all(k.inside(b) for k, b in zip(image, box, strict=True)):
        raise CheckError("Krawczyk's operator does not map the box into its interior")
    point, exactly = zero_near(equations, record, box)
    summary = f"exactly one {record['kind']} in the box, at the claimed point"
    summary += " exactly" if exactly else ""
    label = record["claims"].get("label", "")
    if record["kind"] == "two-fold" and label:
        _two_fold_class(equations, record, point)
        summary += f"; class {label}"
    elif record["kind"] == "fold" and label in ("visible", "invisible"):
        k = "+-".index(record["side"])
        s = equations.local(point).second(k, k).sign() * (1 - 2 * k)
        if s == 0 or (s > 0) != (label == "visible"):
            raise CheckError(f"the fold is not proven to be {label}")
        summary += f"; {label}"
    elif label:
        _kind(equations, record, point)
        summary += f"; {label}"
    if any(v.v.sign() <= 0 for v in equations.local(point).positive):
        raise CheckError("it is not proven to be on the sides of the mode")
    return summary


def _kind(equations: Equations, record: dict[str, Any], point: list[Iv]) -> None:
    """Check the claimed kind of an equilibrium or a cusp."""
    at, label = equations.local(point), record["claims"]["label"]
    if record["kind"] == "equilibrium":
        found = equilibrium(at, "+-".index(record["side"]))
    elif record["kind"] == "pseudo-equilibrium":
        found = pseudo_equilibrium(at)
    elif record["kind"] == "fold" and label == "cusp":
        found = "cusp" if equations.is_cusp(point) else "no cusp"
    else:
        raise CheckError(f"the label {label!r} is not known")
    if found != label:
        raise CheckError(f"it is claimed to be a {label}, and found to be a {found}")


def zero_near(equations: Any, record: dict[str, Any], box: list[Iv]) -> tuple[list[Iv], bool]:
    """An enclosure of the zero near the claimed one, proven again in a small box around it."""
    claimed = [Iv.of(*pair) for pair in record["point"]]
    if all(number(a) == number(b) for a, b in record["point"]):
        f, _ = equations.system(claimed)
        within = all(b.a <= c.a and c.b <= b.b for c, b in zip(claimed, box, strict=True))
        if within and all(v.zero for v in f):
            return claimed, True
    tiny = whole(1).a >> max(40, int(record["bits"]) - 20)
    small = [Iv(c.a - 4 * (c.b - c.a) - tiny, c.b + 4 * (c.b - c.a) + tiny) for c in claimed]
    small = [Iv(max(s.a, b.a), min(s.b, b.b)) for s, b in zip(small, box, strict=True)]
    _, J = equations.system(small)
    image = krawczyk(equations, small, inverse(J))
    if not all(k.inside(s) for k, s in zip(image, small, strict=True)):
        raise CheckError("the zero is not proven to be at the claimed point")
    return image, False


def _two_fold_class(equations: Equations, record: dict[str, Any], point: list[Iv]) -> None:
    """Check the class of a two-fold by signs."""
    at = equations.local(point)
    l11, l12, l21, l22 = (at.second(i, j) for i in (0, 1) for j in (0, 1))
    s = l11.sign(), l22.sign()
    delta, trace = l11 * l22 - l12 * l21, l12 - l21
    d, t, flat = delta.sign(), trace.sign(), delta.zero
    if record["claims"]["coincident"]:
        _coincident(equations, at)
        d, flat = 0, True
        t = (l22 - l11).sign()
    folds = {(1, -1): "VV", (-1, 1): "II", (1, 1): "mix", (-1, -1): "mix"}.get(s)
    if folds is None:
        raise CheckError("a sign of L11 or L22 is undecided")
    lean = whole(s[0]) * (-l21 - l12)
    gap = (lean * lean - whole(4 * s[0] * s[1]) * l11 * l22).sign()
    found = {
        "VV-C1": folds == "VV" and (d < 0 or t < 0),
        "VV-F": folds == "VV" and d > 0 and t > 0,
        "II-C": folds == "II" and d > 0 and t < 0,
        "II-F": folds == "II" and (d < 0 or t > 0),
        "mix-0": folds == "mix"
        and (lean.sign() < 0 or gap < 0 or bool(record["claims"]["coincident"])),
        "mix-S": folds == "mix" and lean.sign() > 0 and gap > 0 and d < 0,
        "mix-C": folds == "mix" and lean.sign() > 0 and gap > 0 and d > 0 and t < 0,
        "mix-F": folds == "mix" and lean.sign() > 0 and gap > 0 and d > 0 and t > 0,
        "boundary Delta=0: VV-C1|VV-F": folds == "VV" and flat and t > 0,
        "boundary Delta=0: II-C|II-F": folds == "II" and flat and t < 0,
    }
    label = record["claims"]["label"]
    if not found.get(label):
        raise CheckError(f"the class {label} does not follow from the signs")


def _coincident(equations: Equations, at: Local) -> None:
    """F1 - F2 = g G as polynomials, with grad h . G not zero: F1 = F2 at the two-fold."""
    graph = equations.graph
    if not is_multiple(graph):
        raise CheckError("F1 - F2 is not the multiple that is claimed")
    total = whole(0)
    for g, v in zip(at.h.g, at.factor, strict=False):
        total = total + g * v.v
    if total.sign() == 0:
        raise CheckError("grad h . G is not proven to be nonzero")
