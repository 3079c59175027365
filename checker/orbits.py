"""Recorded orbits followed again: plain interval Taylor steps, events by signs, modes by Filippov."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from contacts import Place
from intervals import CheckError, Iv, whole
from series import Coefficients, Dual, constant, evaluate, minus, motion, negative, over, times

FORMAT = "nonsmooth orbit 1"
UNIT = whole(1).a
_STEPS, _HALVINGS = 4000, 40


class Guard:
    """A function of time that is positive until it ends the mode, or is passed."""

    def __init__(self, kind: str, index: int, direction: int, c: Coefficients):
        self.kind, self.index, self.direction, self.c = kind, index, direction, c


class Orbit:
    """One orbit in progress."""

    def __init__(self, record: dict[str, Any]):
        if record.get("format") != FORMAT:
            raise CheckError(f"expected the format {FORMAT!r}, received {record.get('format')!r}")
        pairs = [*record["start"], *record["parameters"]]
        if any(Fraction(a) != Fraction(b) for a, b in pairs):
            raise CheckError("orbits from boxes, or for ranges of parameters, are not checked here")
        self.record, self.graph = record, record["graph"]
        self.x = [Iv.of(a) for a, _ in record["start"]]
        self.p = [Iv.of(a) for a, _ in record["parameters"]]
        self.place = Place(record, self.p)
        self.t, self.signs = whole(0), dict[int, int]()
        self.zeros: dict[tuple[str, int], int] = {}
        claimed = [e["t"] for e in record["events"]] + list(record["end"])
        widths = [Fraction(b) - Fraction(a) for a, b in claimed]
        finest = min([w for w in widths if w > 0], default=Fraction(1, 10**20))
        digits = min(60, max(16, len(str(int(1 / finest))) + 6))
        self.tolerance, self.order = 10.0**-digits, max(14, int(0.8 * digits))
        self.word = self.place.start(self.x, record["start"], record["parameters"])
        if self.place.began is not None and "s" not in self.word:
            self.zeros[("surface", self.place.began)] = 1
        self._arm()

    # fields and guards ---------------------------------------------------------------------------

    def _values(self, c: list[Coefficients], lam: list[int], along: Any = None) -> list[Dual]:
        states = [Dual(v, None if along is None else along[i]) for i, v in enumerate(c)]
        still = [Dual(constant(v)) for v in self.p]
        signs = [Dual(constant(whole(s))) for s in lam]
        none = [Dual(constant(whole(0)))] * len(self.record["impacts"])
        return evaluate(self.graph, [states, still, [], signs, none])

    def _sides(self, c: list[Coefficients]) -> tuple[list[Any], list[Coefficients]]:
        """Both fields beside the surface that slides, and L1 and L2."""
        i, fields, lie = self.word.index("s"), [], []
        for s in (1, -1):
            lam = [
                s if j == i else (1 if w == "+" else -1)
                for j, w in enumerate(self.place.surfaces_of(self.word))
            ]
            f = [self._values(c, lam)[k].v for k in self.graph["field"]]
            d = self._values(c, lam, f)[self.graph["surfaces"][i]].d
            fields.append(f)
            lie.append(constant(whole(0)) if d is None else d)
        return fields, lie

    def rates(self, c: list[Coefficients]) -> list[Coefficients]:
        """The field of the mode along a motion."""
        if "s" not in self.word:
            lam = [1 if w == "+" else -1 for w in self.place.surfaces_of(self.word)]
            values = self._values(c, lam)
            return [values[k].v for k in self.graph["field"]]
        (f1, f2), (l1, l2) = self._sides(c)
        a = over(l1, minus(l1, l2))
        return [minus(f, times(a, minus(f, g))) for f, g in zip(f1, f2, strict=True)]

    def guards(self, c: list[Coefficients]) -> list[Guard]:
        """Everything that may end the mode, along a motion."""
        letters = self.place.surfaces_of(self.word)
        values = self._values(c, [0] * len(letters))
        found = []
        for j, letter in enumerate(letters):
            h = values[self.graph["surfaces"][j]].v
            if letter == "s":
                _, (l1, l2) = self._sides(c)
                found.append(Guard("exit", j, 1, negative(l1)))
                found.append(Guard("exit", j, -1, l2))
            else:
                found.append(Guard("surface", j, 0, h if letter == "+" else negative(h)))
        for k, (kind, _, direction, node) in enumerate(self.place.ends):
            turned = self.signs.get(k, 1)
            c_k = values[node].v if turned > 0 else negative(values[node].v)
            found.append(Guard(kind, k, direction, c_k))
        return found

    def _arm(self, jumped: int | None = None) -> None:
        """Signs of stops, resets and gaps at the start or after a jump."""
        self.signs = {}
        c = motion(self.rates, self.x, 4)
        for g in self.guards(c):
            if g.kind in ("surface", "exit"):
                continue
            order = next((k for k, v in enumerate(g.c[:4]) if not v.zero), 0)
            order = 1 if g.index == jumped else order
            s = g.c[order].sign()
            due = g.kind == "reset" and order and jumped is None and g.direction * s >= 0
            if not s or due or (g.kind == "impact" and s < 0):
                raise CheckError("the sign of a stop, reset or gap is undecided")
            self.signs[g.index] = s
            if order:
                self.zeros[(g.kind, g.index)] = order

    # steps ---------------------------------------------------------------------------------------

    def advance(self, left: Iv) -> tuple[Guard, Iv] | None:
        """One step, to the first event if one comes: its guard and its time since the step began."""
        n = self.order
        c = motion(self.rates, self.x, n + 1)
        steps = [
            (self.tolerance / max(_size([v[k] for v in c]), 1e-200)) ** (1 / k) for k in (n - 1, n)
        ]
        h = min(left.b, int(0.8 * min(*steps, 1e6) * 2**53) * (UNIT >> 53))
        for _ in range(_HALVINGS):
            try:
                hit = self._try(c, h)
            except CheckError:
                h >>= 1
                continue
            time = hit[1] if hit else Iv(h, h)
            if hit is None and h >= left.a:
                time = left
            self.x = [_value([*v[:n], top], time) for v, top in zip(c, self._top, strict=True)]
            self.t, self.zeros = self.t + time, {}
            return hit
        raise CheckError(f"no step at t = {float(Fraction(self.t.a, UNIT)):.9g}")

    def _try(self, c: list[Coefficients], h: int) -> tuple[Guard, Iv] | None:
        n = self.order
        tube = self._tube(h)
        tops = motion(self.rates, tube, n + 1)
        self._top = [v[n] for v in tops]
        scale = (h / UNIT) ** n
        if _size(self._top) * scale > 100 * self.tolerance:
            raise CheckError("the remainder is large")
        hits = []
        for g, top in zip(self.guards(c), self.guards(tops), strict=True):
            if _size([top.c[n]]) * scale > 1e4 * self.tolerance:
                raise CheckError("the remainder of a guard is large")
            series = [*g.c[:n], top.c[n]]
            t = _first_zero(series, h, self.zeros.get((g.kind, g.index), 0))
            if t is not None:
                hits.append((t, g, series))
        hits.sort(key=lambda hit: hit[0].b)
        together = [hit for hit in hits if hit[0].a <= hits[0][0].b]
        if len(together) > 1:
            return self._one_stop(together)
        return (hits[0][1], hits[0][0]) if hits else None

    def _one_stop(self, together: list[tuple[Iv, Guard, list[Iv]]]) -> tuple[Guard, Iv]:
        """Of zeros that may be at once the only one that counts, if it is a stop."""
        until = Iv(min(t.a for t, *_ in together), max(t.b for t, *_ in together))
        counting = [hit for hit in together if self._counts(hit[1])]
        passed = [hit for hit in together if not self._counts(hit[1])]
        falls = all(_value(_slope(c), until).sign() < 0 for *_, c in passed)
        if len(counting) != 1 or counting[0][1].kind != "stop" or not falls:
            raise CheckError("which event comes first is undecided")
        return counting[0][1], counting[0][0]

    def _counts(self, g: Guard) -> bool:
        """Whether a zero of a guard means anything: stops, resets and impacts have a direction."""
        passes = g.kind in ("stop", "reset", "impact")
        return not passes or g.direction * -self.signs[g.index] >= 0

    def _tube(self, h: int) -> list[Iv]:
        """A box in which every orbit stays for a time h."""
        t, box = Iv(0, h), self.x
        for _ in range(12):
            rates = self.rates([[v] for v in box])
            new = [x + t * f[0] for x, f in zip(self.x, rates, strict=True)]
            if all(b.a <= v.a and v.b <= b.b for b, v in zip(box, new, strict=True)):
                return box
            box = [Iv(v.a - (v.b - v.a) // 8 - 1, v.b + (v.b - v.a) // 8 + 1) for v in new]
        raise CheckError("no enclosure of the motion")

    # events --------------------------------------------------------------------------------------

    def serve(self, g: Guard) -> tuple[str, str] | None:
        """What happens at a guard's zero: kind and name of the event, None if it means nothing."""
        if g.kind in ("stop", "reset", "impact"):
            counts = self._counts(g)
            self.signs[g.index] = -self.signs[g.index]
            if not counts:
                self.zeros[(g.kind, g.index)] = 1
                return None
            if g.kind != "stop":
                self.x, kept = self.place.jumped(self.x, g.index)
                self.word = self.place.word(self.x)
                self._arm(g.index if kept else None)
            return g.kind, self.place.ends[g.index][1]
        self.word, zeros, kind = self.place.switched(
            self.x, self.word, g.kind, g.index, g.direction
        )
        if zeros:
            self.zeros[("surface", g.index)] = zeros
        return kind, ""


def _slope(c: list[Iv]) -> list[Iv]:
    return [v * whole(k) for k, v in enumerate(c)][1:]


def _size(values: list[Iv]) -> float:
    return max(max(abs(v.a), abs(v.b)) for v in values) / UNIT


def _value(c: list[Iv], t: Iv) -> Iv:
    total = c[-1]
    for v in reversed(c[:-1]):
        total = total * t + v
    return total


def _first_zero(c: list[Iv], h: int, drop: int) -> Iv | None:
    """The first zero in (0, h] of a function that is positive just after 0; it is simple."""
    slope = _slope(c)
    todo, count = [(0, h)], 0
    while todo:
        a, b = todo.pop()
        count += 1
        if (_value(c[drop:], Iv(a, b)) if a == 0 else _value(c, Iv(a, b))).sign() > 0:
            continue
        if (a or not drop) and _value(slope, Iv(a, b)).sign() < 0:
            at = _value(c, Iv(a, a)).sign(), _value(c, Iv(b, b)).sign()
            if at == (1, -1):
                return _newton(c, slope, Iv(a, b))
        if count > 400 or b - a < h >> 60:
            raise CheckError("the sign of a guard is undecided")
        m = (5 * a + 4 * b) // 9
        todo += [(m, b), (a, m)]
    return None


def _newton(c: list[Iv], slope: list[Iv], t: Iv) -> Iv:
    for _ in range(60):
        m = t.mid()
        new = m - _value(c, m) / _value(slope, t)
        new = Iv(max(new.a, t.a), min(new.b, t.b))
        if new.b - new.a > (t.b - t.a) * 0.9:
            return t
        t = new
    return t


def check_orbit(record: dict[str, Any]) -> str:
    """Follow a recorded orbit again and compare modes, events and end with what is claimed.

    Raises
    ------
    CheckError
    """
    if not record["proven"]:
        raise CheckError("the orbit is not claimed to be proven")
    orbit, events = Orbit(record), list(record["events"])
    end, steps = Iv.of(record["duration"]), 0
    if record["first"] != orbit.word:
        raise CheckError(f"it begins in {orbit.word!r}, claimed is {record['first']!r}")
    while True:
        left = end - orbit.t
        if left.a <= 0:
            break
        steps += 1
        if steps > _STEPS:
            raise CheckError(f"more than {_STEPS} steps")
        before, hit = orbit.word, orbit.advance(left)
        met = orbit.serve(hit[0]) if hit else None
        if met is None:
            continue
        _compare(orbit, before, met, events.pop(0) if events else None)
        if met[0] == "stop":
            break
    stopped = record["status"] != "end"
    if events or stopped != (left.a > 0):
        raise CheckError("the orbit does not end as claimed")
    _inside(orbit.x, record["end"], "the end")
    return f"the orbit goes through {len(record['events'])} events as claimed, in {steps} steps"


def _compare(orbit: Orbit, before: str, met: tuple[str, str], claim: dict[str, Any] | None) -> None:
    kind, name = met
    if claim is None:
        raise CheckError(f"an event is met that is not claimed: {kind} {name}")
    found = {"kind": kind, "before": before, "after": orbit.word}
    if name:
        found["name"] = name
    if any(claim[k] != v for k, v in found.items()):
        raise CheckError(f"claimed is {claim}, met was {found}")
    _inside([orbit.t], [claim["t"]], "the time of an event")
    _inside(orbit.x, claim["x"], "the state at an event")


def _inside(values: list[Iv], claims: list[list[str]], what: str) -> None:
    for v, claim in zip(values, claims, strict=True):
        low, high = (Fraction(c) for c in claim)
        if low == high:  # claimed exactly: enclosed to the checker's digits
            wide = Fraction(1, 10**12)
            if not (Fraction(v.a, UNIT) <= low <= Fraction(v.b, UNIT) and v.b - v.a < wide * UNIT):
                raise CheckError(f"{what} is not where it is claimed to be")
        elif not (low <= Fraction(v.a, UNIT) and Fraction(v.b, UNIT) <= high):
            raise CheckError(f"{what} is not where it is claimed to be")
