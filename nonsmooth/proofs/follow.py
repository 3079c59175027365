"""Validated steps along one orbit, or along all orbits from a box.

A step: an a-priori enclosure B (Picard), the Taylor polynomial with the coefficient K + 1 over B as
remainder, and the set of states as middle + frame r with an orthogonal frame (Lohner 1987). Guards
are proven positive, or to have one simple zero; there the time is eliminated by the derivative of the
return map, (1 - f grad g/(grad g . f)) D. Modes follow from proven signs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from .arithmetic import hull, radius, sign
from .equations import column, entries
from .flint import arb, arb_mat, ctx
from .krawczyk import identity
from .modes import Mode, Modes, Watch, beyond
from .proof import UnprovenError
from .roots import Polynomial, UnsureError, first_zero, narrowed
from .series import horner
from .steps import Step, at, growth, orthogonal


@dataclass(frozen=True)
class Met:
    """An event in enclosures."""

    watch: Watch
    kind: str
    t: arb
    x: list[arb]
    before: str
    after: str


class Follower:
    """A set of states that moves.

    Parameters
    ----------
    modes : Modes
    x : sequence of arb
        Extended states at the start.
    p : sequence of arb
        Parameters.
    order : int
    on_surface : bool
        Whether every start is on the surface, exactly.
    """

    def __init__(
        self, modes: Modes, x: Sequence[arb], p: Sequence[arb], order: int, on_surface: bool
    ):
        self.modes, self.p, self.order, self.n = modes, list(p), order, len(x)
        self._adopt(list(x))
        self.t, self.steps, self.events, self.smallest = arb(0), 0, list[Met](), 0.0
        self.mode, zeros = self._first_mode(list(x), on_surface)
        self.zeros: dict[int, int] = {}
        self.signs: dict[int, int] = {}
        self._watch_afresh(zeros)

    # the set -------------------------------------------------------------------------------------

    def _adopt(self, x: list[arb]) -> None:
        self.middle, self.frame = [v.mid() for v in x], identity(self.n)
        self.r = column([v - m for v, m in zip(x, self.middle, strict=True)])

    def hull(self) -> list[arb]:
        """A box around the set."""
        move = entries(self.frame * self.r)
        return [m + v for m, v in zip(self.middle, move, strict=True)]

    def _moved(self, image: list[arb], derivative: arb_mat) -> None:
        """The set becomes image + derivative (x - middle), in a new orthogonal frame."""
        product = derivative * self.frame
        wide = any(radius(v) > 0 for v in entries(self.r))
        frame = orthogonal(product) if wide else identity(self.n)
        inverse = frame.inv()
        self.middle = [v.mid() for v in image]
        miss = column([v - m for v, m in zip(image, self.middle, strict=True)])
        self.r = inverse * miss + (inverse * product) * self.r
        self.frame = frame

    # modes and guards ----------------------------------------------------------------------------

    def _first_mode(self, x: list[arb], on_surface: bool) -> tuple[str, int]:
        h, l1, l2 = self.modes.surface(x, self.p)
        if sign(h):
            return "+" if h > 0 else "-", 0
        if on_surface:
            found = beyond(l1, l2)
            if found:
                return found
        raise UnprovenError(
            f"start: h in {h.str(5)}, L1 in {l1.str(5)}, L2 in {l2.str(5)}: where it goes is undecided"
        )

    @property
    def now(self) -> Mode:
        """The mode that it is in."""
        return self.modes[self.mode]

    def _watch_afresh(self, surface_zeros: int) -> None:
        """Signs of stops and resets at the start, or after a jump."""
        x = self.hull()
        self.zeros, values = {}, self.now.watched(x, self.p)
        coefficients = None
        for k, watch in enumerate(self.now.watches):
            if watch.kind == "surface":
                self.zeros[k] = surface_zeros
            if watch.kind not in ("stop", "reset"):
                continue
            self.signs[k - self._first()] = sign(values[k])
            if values[k].is_zero():
                if coefficients is None:
                    c = self.now.series(x, self.p, 8)
                    coefficients = self.now.watched_series(c, self.p)
                self._from_zero(k, coefficients[k])
            elif not sign(values[k]):
                raise UnprovenError(f"{watch.name}: its sign is undecided at the start")

    def _from_zero(self, k: int, c: Sequence[arb]) -> None:
        """Sign just after a zero, by the first coefficient that is not zero."""
        order = next((j for j, v in enumerate(c) if not v.is_zero()), 0)
        if not order or not sign(c[order]):
            raise UnprovenError(f"{self.now.watches[k].name}: its sign after a zero is undecided")
        self.zeros[k], self.signs[k - self._first()] = order, sign(c[order])

    def _first(self) -> int:
        """Number of the first stop or reset among the mode's watches."""
        return sum(w.kind in ("surface", "exit") for w in self.now.watches)

    # steps ---------------------------------------------------------------------------------------

    def step(self, t_end: arb) -> Met | None:
        """One step, to an event if one comes first; the event or None."""
        left = math.nextafter(float((t_end - self.t).upper()), math.inf)
        limit = left
        for _ in range(40):
            made = self._prepare(limit, t_end)
            try:
                hit = self._first_event(made)
            except UnsureError as unsure:
                if unsure.since < 0.02 * min(made.natural, left):
                    raise UnprovenError(
                        f"the sign of a guard is undecided at t = {float(self.t.mid()) + unsure.since:.9g} "
                        "(a tangency, or the set is too wide)"
                    ) from None
                limit = unsure.since
                continue
            return self._advance(made, hit, t_end)
        raise UnprovenError(f"no step at t = {float(self.t.mid()):.9g}")

    def _prepare(self, limit: float, t_end: arb) -> Step:
        """A step size with an a-priori enclosure and a small remainder."""
        mode, x, count = self.now, self.hull(), self.order + 2
        c = mode.series(x, self.p, count)
        size = max(max(abs(float(v[self.order].mid())) for v in c), 1e-300)
        wide = max(radius(v) for v in x)
        tolerance = max(2.0 ** (2 - ctx.prec), 1e-3 * wide)
        natural = min((tolerance / size) ** (1 / self.order), 1e6)
        h = min(natural, limit)
        for _ in range(60):
            tube = self._tube(x, h)
            if tube is not None:
                top = mode.series(tube, self.p, count)
                rest = max(float(abs(v[-1]).upper()) for v in top) * h ** (self.order + 1)
                if rest <= 8 * tolerance:
                    break
                ratio = (8 * tolerance / rest) ** (1 / (self.order + 1)) if rest < 1e300 else 0.0
                h *= min(0.9, max(0.3, 0.9 * ratio))
            else:
                h /= 2
        else:
            raise UnprovenError(
                f"no enclosure of the motion from t = {float(self.t.mid()):.9g} (the field is not "
                "defined there, or the set is too wide)"
            )
        if min(h, natural) < self.smallest:
            raise UnprovenError(
                f"steps become too small at t = {float(self.t.mid()):.9g} (a singularity is near)"
            )
        guards = mode.watched_series(c, self.p)
        if wide > 0:
            guards = mode.narrowed(guards, self.middle, (self.frame, self.r), self.p)
        return Step(h, natural, tube, x, c, top, guards, mode.watched_series(top, self.p))

    def _tube(self, x: list[arb], h: float) -> list[arb] | None:
        """B with x + [0, h] F(B) inside B: every orbit from x exists on [0, h] and stays in B."""
        t, b = hull(arb(0), arb(h)), x
        for _ in range(12):
            f = self.now.field(b, self.p)
            new = [v + t * w for v, w in zip(x, f, strict=True)]
            if not all(v.is_finite() for v in new):
                return None
            if all(u.contains(v) for u, v in zip(b, new, strict=True)):
                return b
            b = [v + arb(0, 0.1 * radius(v) + 1e-300) for v in new]
        return None

    def _first_event(self, made: Step) -> tuple[int, arb] | None:
        """The guard that comes first, proven, and its time."""
        hits, unsure = [], float("inf")
        for k, watch in enumerate(self.now.watches):
            f = self._polynomial(made, k, watch)
            try:
                t = first_zero(f, made.h)
            except UnsureError as error:
                unsure = min(unsure, error.since)
                continue
            if t is not None:
                hits.append((t, k))
        hits.sort(key=lambda hit: float(hit[0].upper()))
        if hits and float(hits[0][0].upper()) < unsure:
            return self._earliest(made, hits)
        if unsure < float("inf"):
            raise UnsureError(unsure)
        return None

    def _earliest(self, made: Step, hits: list[tuple[arb, int]]) -> tuple[int, arb]:
        """The first of the zeros; of zeros that may be at once only one may mean anything."""
        time, k = hits[0]
        together = [hits[0], *((t, j) for t, j in hits[1:] if not time < t)]
        if len(together) == 1:
            return k, time
        counting = [(t, j) for t, j in together if self._counts(j)]
        if len(counting) == 1 and self.now.watches[counting[0][1]].kind == "stop":
            return counting[0][1], counting[0][0]
        for t, j in counting:
            others = [hit for hit in together if hit[1] != j]
            if all(self._comes_before(made, (j, t), other) for other in others):
                return j, t
        names = ", ".join(self.now.watches[j].name for _, j in together)
        when = float((self.t + time).mid())
        raise UnprovenError(f"which comes first is undecided: {names} at t = {when:.9g}")

    def _comes_before(self, made: Step, hit: tuple[int, arb], other: tuple[arb, int]) -> bool:
        """Whether every orbit meets one event while another guard, which only falls, is positive."""
        t, j = other
        f = self._polynomial(made, j, self.now.watches[j])
        if not f.slope(hull(hit[1], t)) < 0:
            return False
        image, derivative = self._at_event(made, hit)
        move = (derivative * self.frame) * self.r
        around = [v + w for v, w in zip(image, entries(move), strict=True)]
        row = self.now.slope(j, around, self.p)
        value = self.now.watched(image, self.p)[j] + (arb_mat([row]) * move)[0, 0]
        tied = ((arb_mat([row]) * (derivative * self.frame)) * self.r)[0, 0]
        value = value.intersection(self.now.watched(image, self.p)[j] + tied)
        watch = self.now.watches[j]
        falling = watch.kind not in ("stop", "reset") or self.signs[j - self._first()] > 0
        return bool((value if falling else -value) > 0)

    def _counts(self, k: int) -> bool:
        """Whether a zero of a guard is an event: stops and resets have a direction."""
        watch = self.now.watches[k]
        if watch.kind not in ("stop", "reset"):
            return True
        return watch.direction * -self.signs[k - self._first()] >= 0

    def _polynomial(self, made: Step, k: int, watch: Watch) -> Polynomial:
        c, top = made.guards[k][:-1], made.guard_tops[k][-1]
        if watch.kind in ("stop", "reset") and self.signs[k - self._first()] < 0:
            c, top = [-v for v in c], -top
        return Polynomial(c, top, self.zeros.get(k, 0))

    def _advance(self, made: Step, hit: tuple[int, arb] | None, t_end: arb) -> Met | None:
        mode = self.now
        time = arb(made.h) if hit is None else hit[1]
        if hit is None and (t_end - self.t) <= made.h:
            time = t_end - self.t  # the end itself, also where it is no double
        if hit is None:
            c = mode.series(self.middle, self.p, self.order + 2)
            image, derivative = at(c, made.top, time), self._derivative(made, time)
        else:
            image, derivative = self._at_event(made, hit)
        self._moved(image, derivative)
        self.t, self.steps, self.zeros = self.t + time, self.steps + 1, {}
        return None if hit is None else self._serve(mode.watches[hit[0]], hit[0])

    def _at_event(self, made: Step, hit: tuple[int, arb]) -> tuple[list[arb], arb_mat]:
        """Where the middle meets an event, and the derivative of the return map there."""
        c = self.now.series(self.middle, self.p, self.order + 2)
        image = at(c, made.top, self._own_time(c, made, hit))
        derivative = self._derivative(made, hit[1])
        return image, self._return_map(made, hit[0], hit[1], derivative)

    def _derivative(self, made: Step, time: arb) -> arb_mat:
        """Derivatives of the flow to times in ``time``, for all states of the set."""
        mode = self.now
        if mode.affine:
            return (mode.jacobian(made.hull, self.p) * time).exp()
        jacobian = mode.jacobian(made.tube, self.p)
        if not all(v.is_finite() for v in jacobian.entries()):
            raise UnprovenError(f"the field has no derivative near t = {float(self.t.mid()):.9g}")
        bound = max(
            sum(float(abs(v).upper()) for v in row) * (1 + 1e-12) for row in jacobian.tolist()
        )
        grow = growth(bound, made.h)
        around = arb_mat([[arb(int(i == j), grow) for j in range(self.n)] for i in range(self.n)])
        low = mode.variation(made.c, self.p, identity(self.n))
        top = mode.variation(made.top, self.p, around)
        return horner([*low[:-1], top[-1]], time)

    def _own_time(self, c: list[list[arb]], made: Step, hit: tuple[int, arb]) -> arb:
        """The event's time of the middle alone, narrower than that of the whole set."""
        k, time = hit
        g = self.now.watched_series(c, self.p)[k]
        return narrowed(Polynomial(g[:-1], made.guard_tops[k][-1]), time)

    def _return_map(self, made: Step, k: int, time: arb, derivative: arb_mat) -> arb_mat:
        """(1 - f grad g/(grad g . f)) D where the event is met."""
        x = at(made.c, made.top, time)
        f, g = self.now.field(x, self.p), self.now.slope(k, x, self.p)
        rate = sum((a * b for a, b in zip(f, g, strict=True)), arb(0))
        if rate.contains(0) or not rate.is_finite():
            return derivative if radius(time) == 0 else _not_transversal(self)
        n = self.n
        across = arb_mat([[int(i == j) - f[i] * g[j] / rate for j in range(n)] for i in range(n)])
        return across * derivative

    # events --------------------------------------------------------------------------------------

    def _serve(self, watch: Watch, k: int) -> Met | None:
        before, x = self.mode, self.hull()
        if watch.kind in ("stop", "reset"):
            return self._end(watch, k, x)
        _, l1, l2 = self.modes.surface(x, self.p)
        if watch.kind == "exit":
            self.mode, zeros, kind = ("+" if watch.direction > 0 else "-"), 2, "exit"
            other = l2 if watch.direction > 0 else -l1
            if not other > 0:
                raise UnprovenError(
                    f"exit at t = {self.t.str(8)}: L1 in {l1.str(5)}, L2 in {l2.str(5)}, so the "
                    "other field's sign is undecided (a two-fold?)"
                )
        else:
            found = beyond(l1, l2)
            if found is None:
                raise UnprovenError(
                    f"surface at t = {self.t.str(8)}: L1 in {l1.str(5)}, L2 in {l2.str(5)}, so what "
                    "follows is undecided"
                )
            self.mode, zeros = found
            kind = "entry" if self.mode == "s" else "crossing"
        self.zeros = {j: zeros for j, w in enumerate(self.now.watches) if w.kind == "surface"}
        met = Met(watch, kind, self.t, x, before, self.mode)
        self.events.append(met)
        return met

    def _end(self, watch: Watch, k: int, x: list[arb]) -> Met | None:
        """A stop or a reset was met; it counts if its direction does."""
        place = k - self._first()
        counts = self._counts(k)
        self.signs[place] = -self.signs[place]
        if not counts:
            self.zeros[k] = 1
            return None
        before = self.mode
        met = Met(watch, watch.kind, self.t, x, before, before)
        if watch.kind == "reset":
            met = self._jump(watch, met)
        self.events.append(met)
        return met

    def _jump(self, watch: Watch, met: Met) -> Met:
        """After a reset: a new state, whose side and signs must be decided anew."""
        new = self.modes.jump(watch, met.x, self.p)
        own = self.modes.kept(watch, watch)
        self._adopt(new)
        h, *_ = self.modes.surface(new, self.p)
        if not sign(h):
            raise UnprovenError(
                f"{watch.name} at t = {self.t.str(8)}: the side after it is undecided"
            )
        self.mode = "+" if h > 0 else "-"
        self.zeros = {}
        c = self.now.watched_series(self.now.series(new, self.p, 3), self.p)
        for k, w in enumerate(self.now.watches):
            if w.kind not in ("stop", "reset"):
                continue
            at_zero = w is watch and own
            value = c[k][1 if at_zero else 0]
            if not sign(value):
                raise UnprovenError(f"{w.name}: its sign after {watch.name} is undecided")
            self.signs[k - self._first()] = sign(value)
            if at_zero:
                self.zeros[k] = 1
        return Met(watch, "reset", met.t, new, met.before, self.mode)


def _not_transversal(follower: Follower) -> arb_mat:
    raise UnprovenError(f"an event at t = {follower.t.str(8)} is not proven to be transversal")
