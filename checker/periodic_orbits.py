"""Check of a recorded periodic orbit: one zero of its return map, its period, multipliers and stability."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from integration import UNIT, Orbit
from intervals import CheckError, Iv, number, sqrt, whole
from mean_value_forms import Matrix, product
from orbit_proofs import inside
from records import require_periodic
from special_points import krawczyk, zero_near

FORMAT = "nonsmooth periodic orbit 1"
_STEPS = 4000

#: By how much errors may grow along a piece from a point.
_LOST = 1e6

Complex = tuple[Iv, Iv]


class Pieces:
    """The motion from plane to plane; ``system`` is the ends less the starts that follow."""

    def __init__(self, record: dict[str, Any]):
        require_periodic(record)
        self.record, self.sections = record, record["sections"]
        self.given = [(number(a), number(b)) for a, b in record["parameters"]]
        self.size = len(record["graph"]["field"])
        widths = [number(b) - number(a) for a, b in record["point"]]
        self.finest = max(1e-170, float(min(widths, default=0)))
        self.multiplicity: int = record.get("multiplicity", 0)  # periods of the forcing
        self.period: Iv | None = None  # all of them
        self._known: dict[Any, tuple[list[Iv], Matrix]] = {}
        self.planes = [(s["position"], number(s["value"])) for s in self.sections]

    def system(self, u: list[Iv]) -> tuple[list[Iv], Matrix]:
        """Values and Jacobian of the equations; no Jacobian at a point."""
        key = tuple((v.a, v.b) for v in u)
        if key not in self._known:
            self._known[key] = self._system(u)
        return self._known[key]

    def _system(self, u: list[Iv]) -> tuple[list[Iv], Matrix]:
        count, m = len(self.sections), self.size - 1
        J = [[whole(0)] * len(u) for _ in u]
        f: list[Iv] = []
        for i in range(count):
            j = (i + 1) % count
            end, D, _ = self.piece(i, u[i * m : (i + 1) * m])
            f += [v - w for v, w in zip(end, u[j * m : (j + 1) * m], strict=True)]
            for a in range(m if D else 0):
                J[i * m + a][i * m : (i + 1) * m] = D[a]
                J[i * m + a][j * m + a] = J[i * m + a][j * m + a] - whole(1)
        return f, J

    def piece(self, i: int, u: list[Iv]) -> tuple[list[Iv], Matrix, Iv]:
        """End of a piece, its derivatives by the start, and its duration."""
        point, found = all(v.a == v.b for v in u), None
        try:
            found = self._piece(i, u)
        except CheckError:
            if not point:
                raise
        if found and not (point and _lost(found[0]) > _LOST * self.finest):
            return found
        # Where errors of intervals grow, a set around the point is followed in frames.
        return self._piece(i, [Iv(v.a - 1, v.b + 1) for v in u], False)

    def _piece(self, i: int, u: list[Iv], smooth: bool = True) -> tuple[list[Iv], Matrix, Iv]:
        j = (i + 1) % len(self.sections)
        own, other = self.sections[i], self.sections[j]
        (k, value), (k2, value2) = self.planes[i], self.planes[j]
        start = [(Fraction(v.a, UNIT), Fraction(v.b, UNIT)) for v in u]
        start.insert(k, (value, value))
        orbit = Orbit(
            self.record | {"start": start, "events": [], "end": []}, [*start, *self.given]
        )
        orbit.smooth = smooth and any(v.a < v.b for v in u)
        orbit.aim(min((v.b - v.a) / UNIT for v in u) if orbit.smooth else self.finest)
        if orbit.mode != own["mode"]:
            raise CheckError(f"piece {i + 1} begins in {orbit.mode!r}")
        end = Iv.of(value2)
        if self.multiplicity and j == 0:
            if orbit.time != k2 or k2 != self.size - 1:
                raise CheckError("the first plane is none of the time")
            period = whole(self.multiplicity) * orbit.forcing_period()
            self.period, end = Iv(period.a, period.b), end + period
        events, far = list(self.record["claims"]["events"][i]), Iv.of(self.record["longest"])
        for _ in range(_STEPS):
            if not events:
                orbit.plane = k2, end, other["direction"]
            guard, ended = orbit.advance(far)
            event = orbit.apply(guard) if guard else None
            if ended or (event is not None and event[0] == "end"):
                break
            if event is not None and (not events or events.pop(0) != [*event, orbit.mode]):
                raise CheckError(f"an event of piece {i + 1} is not the claimed one: {event}")
        if event is None or event[0] != "end" or orbit.mode != other["mode"]:
            raise CheckError(f"piece {i + 1} does not end on its plane in {other['mode']!r}")
        last = [Iv(v.a, v.b) for a, v in enumerate(orbit.x) if a != k2]
        if not orbit.smooth:
            return last, [], Iv(orbit.t.a, orbit.t.b)
        D = orbit.states.derivatives()
        rows = [[v for b, v in enumerate(D[a][: self.size]) if b != k] for a in range(self.size)]
        return last, [row for a, row in enumerate(rows) if a != k2], Iv(orbit.t.a, orbit.t.b)


def check_periodic(record: dict[str, Any]) -> str:
    """Check the claims about one periodic orbit; return a summary."""
    if record.get("format") != FORMAT:
        raise CheckError(f"expected the format {FORMAT!r}, received {record.get('format')!r}")
    pieces, claims = Pieces(record), record["claims"]
    box = [Iv.of(*pair) for pair in record["box"]]
    matrix = [[Iv.of(v) for v in row] for row in record["matrix"]]
    image = krawczyk(pieces, box, matrix)
    if not all(k.inside(b) for k, b in zip(image, box, strict=True)):
        raise CheckError("Krawczyk's operator does not map the box into its interior")
    point = [Iv(v.a - 1, v.b + 1) for v in zero_near(pieces, record, box)[0]]
    m, period = pieces.size - 1, whole(0)
    D = [[whole(int(i == j)) for j in range(m)] for i in range(m)]
    for i in range(len(pieces.sections)):
        _, own, time = pieces.piece(i, point[i * m : (i + 1) * m])
        period, D = period + time, product(own, D)
    inside([pieces.period or period], [claims["period"]], "the period")
    summary = (
        f"exactly one periodic orbit in the box, with {sum(map(len, claims['events']))} events"
    )
    if claims["label"]:
        known = claims.get("multipliers")
        found = "asymptotically stable" if known is None and contracts(D) else ""
        if known is not None:
            found = stability(multipliers(D, known))
        if found != claims["label"]:
            raise CheckError(f"it is not proven to be {claims['label']}")
        summary += f"; {claims['label']}"
    return summary


def _lost(values: list[Iv]) -> float:
    return max(v.b - v.a for v in values) / UNIT


# Multipliers -------------------------------------------------------------------------------------


def multipliers(D: Matrix, claimed: list[list[list[str]]]) -> list[Complex]:
    """The claimed enclosures of all eigenvalues of a matrix."""
    # A disc around z of the radius m |p(z)/p'(z)| holds a zero of a polynomial p of degree m.
    m, p = len(D), _characteristic(D)
    rates = [whole(k) * v for k, v in enumerate(p)][1:]
    boxes = [(Iv.of(*re), Iv.of(*im)) for re, im in claimed]
    discs: list[tuple[Complex, int]] = []
    for re, im in boxes:
        z = re.mid(), im.mid()
        for _ in range(4):  # Newton's method; any z would do
            step = _over(_value(p, z), _value(rates, z))
            z = (z[0] - step[0]).mid(), (z[1] - step[1]).mid()
            z = (z[0], whole(0)) if im.zero else z
        step = _over(_value(p, z), _value(rates, z))
        r = m * (_size(step[0]) + _size(step[1]))
        held = all(b.a <= v.a - r and v.a + r <= b.b for b, v in zip((re, im), z, strict=True))
        if not held and not (im.zero and re.a <= z[0].a - r and z[0].a + r <= re.b):
            raise CheckError("a multiplier is not proven to be where it is claimed to be")
        discs.append((z, r))
    for k, (z, r) in enumerate(discs):
        for w, s in discs[:k]:
            if max(abs(z[0].a - w[0].a), abs(z[1].a - w[1].a)) <= r + s:
                raise CheckError("two multipliers are not proven to be apart")
    if len(discs) != m:
        raise CheckError("there are not as many multipliers as claimed")
    return boxes


def contracts(D: Matrix) -> bool:
    """Whether a power of a matrix makes all vectors shorter."""
    for _ in range(12):
        if all(sum(_size(v) for v in row) < UNIT for row in D):
            return True
        D = product(D, D)
    return False


def stability(boxes: list[Complex]) -> str:
    """Stability by enclosures of all multipliers but the 1 of the flow."""
    signs = [(sqrt(re.sq() + im.sq()) - whole(1)).sign() for re, im in boxes]
    if not all(signs):
        raise CheckError("whether a multiplier is inside of the unit circle is undecided")
    outside = signs.count(1)
    plural = "s" * (outside > 1)
    return (
        f"unstable, {outside} multiplier{plural} outside the unit circle"
        if outside
        else "asymptotically stable"
    )


def _characteristic(D: Matrix) -> list[Iv]:
    """Coefficients of det(z - D), that of 1 first (Faddeev and LeVerrier)."""
    m = len(D)
    N = [[whole(int(i == j)) for j in range(m)] for i in range(m)]
    c = [whole(1)]
    for k in range(1, m + 1):
        N = product(D, N)
        trace = sum((N[i][i] for i in range(1, m)), N[0][0])
        c.append(-trace / whole(k))
        for i in range(m):
            N[i][i] = N[i][i] + c[-1]
    return c[::-1]


def _value(p: list[Iv], z: Complex) -> Complex:
    re, im = p[-1], whole(0)
    for v in reversed(p[:-1]):
        re, im = re * z[0] - im * z[1] + v, re * z[1] + im * z[0]
    return re, im


def _over(a: Complex, b: Complex) -> Complex:
    size = b[0].sq() + b[1].sq()
    return (a[0] * b[0] + a[1] * b[1]) / size, (a[1] * b[0] - a[0] * b[1]) / size


def _size(v: Iv) -> int:
    return max(abs(v.a), abs(v.b))
