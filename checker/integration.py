"""Validated integration of orbits from points or boxes, by interval Taylor steps with events."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from forcing import forcing_period
from intervals import CheckError, Iv, number, whole
from mean_value_forms import States, covers, span, tube
from modes import Modes
from polynomials import is_factored
from series import Coefficients, Dual, constant, evaluate, minus, motion, negative, over, times
from zeros import UnsureError, first_zero, passed, slope, value

UNIT = whole(1).a
_HALVINGS = 40

#: Numbers have no more digits than this.
_DIGITS = 192

#: Ranges of the start and of the parameters.
Box = list[tuple[Fraction, Fraction]]


class Guard:
    """A function of time that is positive up to its event."""

    def __init__(self, kind: str, index: int, direction: int, c: Coefficients):
        self.kind, self.index, self.direction, self.c = kind, index, direction, c


class Orbit:
    """One orbit in progress, or all from a box: states, time and varying parameters."""

    def __init__(self, record: dict[str, Any], box: Box):
        self.record, self.graph, self.n = record, record["graph"], len(record["start"])
        self.plane: tuple[int, Iv, int] | None = (
            None  # x_k = c, where it ends, and the side it comes from
        )
        self._tried = 0  # the last step
        self.smooth = False  # whether the derivatives of the motion are enclosed
        start, given = box[: self.n], box[self.n :]
        self.given = [Iv.of(*pair) for pair in given]
        self.moving = [k for k, (a, b) in enumerate(given) if a < b]
        nodes, jumps = self.graph["nodes"], max(map(len, self.graph["maps"]), default=0)
        clocks = [i for i, k in enumerate(self.graph["field"]) if nodes[k] == ["const", "1"]]
        self.time = next((i for i in clocks if i >= jumps), None)  # a state that is the time
        values = [Iv.of(*pair) for pair in start] + [whole(0)]
        values += [self.given[k] for k in self.moving]
        self.states = States(values, any(a < b for a, b in box))
        self.modes, self._factored = Modes(record), set[str]()
        self.signs, self.zeros = dict[int, int](), dict[tuple[str, int], int]()
        claimed = [e["t"] for e in record["events"]] + list(record["end"])
        widths = [number(b) - number(a) for a, b in claimed]
        self._digits(max((b - a for a, b in box), default=Fraction(0)), widths)
        self.mode = self.modes.start(self.x, self.p, box)
        if self.modes.start_surface is not None and "s" not in self.mode:
            self.zeros[("surface", self.modes.start_surface)] = 1
        self._initial_signs()

    def _digits(self, wide: Fraction, widths: list[Fraction]) -> None:
        """Set tolerance and order of the steps by the digits that are claimed."""
        finest = min([w for w in widths if w > wide / 10**6], default=Fraction(1, 10**20))
        digits = len(str(int(1 / finest)))
        digits = min(60, max(16, digits + 6)) if not wide else min(_DIGITS, digits + 6)
        self.tolerance, self.order = 10.0**-digits, max(16, int(0.8 * digits))

    def aim(self, width: float) -> None:
        """Set tolerance and order of the steps for a width of the end."""
        digits = min(_DIGITS, max(12, 8 - math.floor(math.log10(width))))
        self.tolerance, self.order = 10.0**-digits, max(16, int(0.8 * digits))

    @property
    def x(self) -> list[Iv]:
        return self.states.values[: self.n]

    @property
    def t(self) -> Iv:
        return self.states.values[self.n]

    @property
    def p(self) -> list[Iv]:
        return self._parameters(self.states.values)

    def _parameters(self, values: list[Any]) -> list[Any]:
        own = dict(zip(self.moving, values[self.n + 1 :], strict=True))
        return [own.get(k, v) for k, v in enumerate(self.given)]

    def forcing_period(self) -> Iv:
        """The period of the system, which depends on time."""
        if self.time is None:
            raise CheckError("no state is the time")
        c: list[Coefficients] = [[v] for v in self.states.values]
        return forcing_period(self.graph, self.time, self._values(c, [0] * self.modes.count))

    # fields and guards ---------------------------------------------------------------------------

    def _values(self, c: list[Coefficients], lam: list[int], along: Any = None) -> list[Dual]:
        states = [Dual(v, None if along is None else along[i]) for i, v in enumerate(c[: self.n])]
        still = [Dual(constant(v) if isinstance(v, Iv) else v) for v in self._parameters(c)]
        signs = [Dual(constant(whole(s))) for s in lam]
        none = [Dual(constant(whole(0)))] * len(self.record["impacts"])
        return evaluate(self.graph, [states, still, [], signs, none])

    def _sides(self, c: list[Coefficients]) -> tuple[list[Any], list[Coefficients]]:
        """Both fields beside the sliding surface, and L1 and L2."""
        fields, lie = [], []
        for lam in self._beside():
            f = [self._values(c, lam)[k].v for k in self.graph["field"]]
            fields.append(f)
            lie.append(self._along(c, f))
        return fields, lie

    def _beside(self) -> tuple[list[int], list[int]]:
        """Multipliers on both sides of the sliding surface."""
        letters, i = self.modes.surfaces_of(self.mode), self.mode.index("s")
        lam = [1 if w == "+" else -1 for w in letters]
        return [1 if j == i else s for j, s in enumerate(lam)], lam

    def _along(self, c: list[Coefficients], f: list[Coefficients]) -> Coefficients:
        """Rate of the switching function of the sliding surface in a direction."""
        node = self.graph["surfaces"][self.mode.index("s")]
        d = self._values(c, [0] * self.modes.count, f)[node].d
        return constant(whole(0)) if d is None else d

    def rates(self, c: list[Coefficients]) -> list[Coefficients]:
        """Rates of states, time and varying parameters in the mode."""
        still = [constant(whole(0))] * len(self.moving)
        return [*self._field(c), constant(whole(1)), *still]

    def _field(self, c: list[Coefficients]) -> list[Coefficients]:
        if "s" not in self.mode:
            lam = [1 if w == "+" else -1 for w in self.modes.surfaces_of(self.mode)]
            values = self._values(c, lam)
            return [values[k].v for k in self.graph["field"]]
        hint = self.graph["sliding"][self.mode]
        if self.mode not in self._factored:  # F1 - F2 = g G, so that g cancels
            self._factored.add(self.mode)
            if not is_factored(self.graph, self._beside(), hint["factor"], hint["direction"]):
                raise CheckError("F1 - F2 is not the multiple that is claimed")
        values = self._values(c, self._beside()[0])
        f, g = ([values[k].v for k in n] for n in (self.graph["field"], hint["direction"]))
        a = over(self._along(c, f), self._along(c, g))
        return [minus(p, times(a, q)) for p, q in zip(f, g, strict=True)]

    def guards(self, c: list[Coefficients]) -> list[Guard]:
        """The guards of the mode along a motion."""
        letters = self.modes.surfaces_of(self.mode)
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
        for k, (kind, _, direction, node) in enumerate(self.modes.ends):
            turned = self.signs.get(k, 1)
            c_k = values[node].v if turned > 0 else negative(values[node].v)
            found.append(Guard(kind, k, direction, c_k))
        if self.plane is not None:
            k, value, direction = self.plane
            left = minus(constant(value), c[k])
            found.append(Guard("end", 0, 0, left if direction > 0 else negative(left)))
        return found

    def _initial_signs(self, jumped: int | None = None, own: int | None = None) -> None:
        """Signs of stops, resets and gaps at the start or after a jump, of the guard ``own``."""
        before, self.signs = self.signs if own is not None else {}, {}
        c = motion(self.rates, self.states.values, 4)
        for g in self.guards(c):
            if g.kind in ("surface", "exit", "end"):
                continue
            order = next((k for k, v in enumerate(g.c[k] for k in range(4)) if not v.zero), 0)
            order = 1 if g.index == jumped else order
            s = g.c[order].sign()
            due = g.kind == "reset" and order and jumped is None and g.direction * s >= 0
            if not s or due or (g.kind == "impact" and s < 0):
                raise CheckError("the sign of a stop, reset or gap is undecided")
            carried = g.kind != "impact" and g.index != own and before.get(g.index, s) * s < 0
            if carried and g.direction * s >= 0:
                raise CheckError(
                    "a jump across a stop or reset, which happens at once, is not checked"
                )
            self.signs[g.index] = s
            if order:
                self.zeros[(g.kind, g.index)] = order

    # steps ---------------------------------------------------------------------------------------

    def advance(self, end: Iv) -> tuple[Guard | None, bool]:
        """Take one step, at most to the first event; return its guard, and whether the end is reached."""
        n, left = self.order, end - self.t
        c = motion(self.rates, self.states.values, n + 1)
        steps = [
            (self.tolerance / max(_size([v[k] for v in c]), 1e-200)) ** (1 / k) for k in (n - 1, n)
        ]
        guards = self.guards(c)
        h = natural = min(left.b, int(0.8 * min(*steps, 1e6) * 2**53) * (UNIT >> 53))
        if self._tried:  # far from the step before, most of the first trials fail
            h = min(h, self._tried * 5 // 4)
        for _ in range(_HALVINGS):
            if left.a < h < left.b:  # some orbits would be past the end
                h = left.a
            if h <= 0:
                break
            try:
                candidate = self._try(c, guards, h)
            except UnsureError as unsure:
                if unsure.since < natural // 50:
                    raise
                h = unsure.since * 7 // 8  # so that the guard is positive there
                continue
            except CheckError:
                h = h * 5 // 8
                continue
            self._tried = h
            last = h >= left.b
            if candidate is not None and last and (left - candidate[1]).b < 0:
                candidate = None
            if candidate is not None and last and (left - candidate[1]).a < 0:
                raise CheckError("whether an event is before the end is undecided")
            time = candidate[1] if candidate else left if last else Iv(h, h)
            series = [[*v[:n], top] for v, top in zip(c, self._top, strict=True)]
            self.states.become([passed(v, time) for v in series])
            self.zeros = {}
            return (candidate[0] if candidate else None), last and candidate is None
        raise CheckError(f"no step at t = {self.t.a / UNIT:.9g}")

    def _try(self, c: list[Coefficients], guards: list[Guard], h: int) -> tuple[Guard, Iv] | None:
        n, t = self.order, Iv(0, h)
        box = self._tube([value(v[:n], t) for v in c])
        tops = motion(self.rates, box, n + 1)
        self._top = [v[n] for v in tops]
        # An orbit that is in the box as long as its remainder is over the box does not leave it (Corliss and Rihm 1996).
        for b, v, top in zip(box, c, self._top, strict=True):
            if not covers(b, value([*v[:n], top], t)):
                raise CheckError("no enclosure of the motion")
        scale = (h / UNIT) ** n
        if _size(self._top) * scale > 100 * self.tolerance:
            raise CheckError("the remainder is large")
        candidates = []
        for g, top in zip(guards, self.guards(tops), strict=True):
            if _size([top.c[n]]) * scale > 1e4 * self.tolerance:
                raise CheckError("the remainder of a guard is large")
            series = [*(g.c[k] for k in range(n)), top.c[n]]
            t = first_zero(series, h, self.zeros.get((g.kind, g.index), 0))
            if t is not None:
                candidates.append((t, g, series))
        for t, g, _ in candidates:
            if all(g is other or (t - s).b < 0 for s, other, _ in candidates):
                return g, t
        return self._one_stop(candidates) if candidates else None

    def _one_stop(self, candidates: list[tuple[Iv, Guard, list[Iv]]]) -> tuple[Guard, Iv]:
        """The stop among zeros that may coincide, if no other is an event."""
        soonest = min(t.b for t, *_ in candidates)
        together = [candidate for candidate in candidates if candidate[0].a <= soonest]
        until = Iv(min(t.a for t, *_ in together), max(t.b for t, *_ in together))
        counting = [candidate for candidate in together if self._is_event(candidate[1])]
        passed = [candidate for candidate in together if not self._is_event(candidate[1])]
        falls = all(value(slope(c), until).sign() < 0 for *_, c in passed)
        if len(counting) != 1 or counting[0][1].kind != "stop" or not falls:
            raise CheckError("which event comes first is undecided")
        return counting[0][1], counting[0][0]

    def _is_event(self, g: Guard) -> bool:
        """Whether a zero of a guard is an event: stops, resets and impacts have a direction."""
        passes = g.kind in ("stop", "reset", "impact")
        return not passes or g.direction * -self.signs[g.index] >= 0

    def _tube(self, x: list[Iv]) -> list[Iv]:
        """A box around ranges of Taylor polynomials; with derivatives by the set, if they are enclosed."""
        margin = Iv.of(200 * self.tolerance).b
        if not self.smooth:
            return [tube(span(v), margin) for v in x]
        slope = max(max(abs(s.a), abs(s.b)) for v in x for s in getattr(v, "g", [])) >> 10
        return [tube(v, margin, slope + 1) for v in x]

    # events --------------------------------------------------------------------------------------

    def apply(self, g: Guard) -> tuple[str, str] | None:
        """Apply a guard's zero; return kind and name of the event, None if it is not one."""
        if g.kind == "end":
            return "end", "end"
        if g.kind in ("stop", "reset", "impact"):
            counts = self._is_event(g)
            self.signs[g.index] = -self.signs[g.index]
            if not counts:
                self.zeros[(g.kind, g.index)] = 1
                return None
            if g.kind != "stop":
                x, kept, slides = self.modes.jumped(self.x, self.p, self.mode, g.index)
                self.states.become([*x, *self.states.values[self.n :]])
                self.mode = self.modes.mode_at(self.x, self.p, slides)
                self._initial_signs(g.index if kept else None, g.index)
            return g.kind, self.modes.ends[g.index][1]
        self.mode, zeros, kind = self.modes.switched(
            (self.x, self.p), self.mode, g.kind, g.index, g.direction
        )
        if zeros:
            self.zeros[("surface", g.index)] = zeros
        name = "surface" if self.modes.count == 1 else f"surface {g.index}"
        return kind, f"sliding on {name}" if g.kind == "exit" else name


def _size(values: list[Iv]) -> float:
    return max(max(abs(v.a), abs(v.b)) for v in values) / UNIT
