"""An orbit from its start through its events: which mode follows is told by proven signs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..arithmetic.flint import arb
from ..arithmetic.intervals import sign
from ..proof import UnprovenError
from .modes import Modes, Range, beyond
from .motion import Watch
from .validated_flow import Follower


@dataclass(frozen=True)
class Met:
    """An event in enclosures."""

    watch: Watch
    kind: str
    t: arb
    x: list[arb]
    before: str
    after: str


class Journey(Follower):
    """A set of states followed through its events."""

    def __init__(
        self,
        modes: Modes,
        x: Sequence[arb],
        p: Sequence[arb],
        order: int,
        exact: tuple[Sequence[Range], Sequence[Range]],
    ):
        super().__init__(modes, x, p, order)
        self.events: list[Met] = []
        start = [
            j
            for j, h in enumerate(modes.heights(x, p))
            if not sign(h) and modes.on_surface(j, *exact)
        ]
        self._enter(list(x), start, "start")
        self._watch_afresh()

    def travel(self, t_end: arb) -> Met | None:
        """One step, and what follows the event if one comes; the event or None."""
        k = self.step(t_end)
        if k is None:
            return None
        watch = self.now.watches[k]
        return self._passed(watch, k) if watch.passes else self._switched(watch)

    # places --------------------------------------------------------------------------------------

    def _enter(self, x: list[arb], on: Sequence[int], where: str) -> None:
        """The mode that continues from states of which those surfaces are zero exactly."""
        heights = self.modes.heights(x, self.p)
        contacts = "o" * len(self.modes.system.impacts)
        word = "".join("+" if h > 0 else "-" if h < 0 else "?" for h in heights) + contacts
        unknown = [j for j, c in enumerate(word) if c == "?"]
        if any(j not in on for j in unknown):
            j = next(j for j in unknown if j not in on)
            raise UnprovenError(
                f"{where}: h of {self.modes.name(j)} is in {heights[j].str(5)}, so its side is undecided"
            )
        if len(unknown) > 1:
            raise UnprovenError(f"{where}: on {len(unknown)} surfaces at once, which is not proven")
        zeros = 0
        for j in unknown:
            l1, l2 = self.modes.rates(j, word, x, self.p)
            found = beyond(l1, l2)
            if found is None:
                raise UnprovenError(
                    f"{where}: on {self.modes.name(j)} with L1 in {l1.str(5)}, L2 in {l2.str(5)}: "
                    "where it goes is undecided"
                )
            letter, zeros = found
            word = self.modes.replaced(word, j, letter)
        self.mode = word
        self.zeros = self._zeros_of(unknown[0], zeros) if unknown else {}

    def _zeros_of(self, surface: int, count: int) -> dict[int, int]:
        """Coefficients of a surface's function that are zero just after it was met."""
        return {
            k: count
            for k, w in enumerate(self.now.watches)
            if w.kind == "surface" and w.index == surface
        }

    def _watch_afresh(self) -> None:
        """Signs of stops, resets and impacts at the start."""
        x, coefficients = self.hull(), None
        values = self.now.watched(x, self.p)
        for k, watch in enumerate(self.now.watches):
            if not watch.passes:
                continue
            self.signs[watch.index] = sign(values[k])
            if values[k].is_zero():
                if coefficients is None:
                    c = self.now.series(x, self.p, 8)
                    coefficients = self.now.watched_series(c, self.p)
                self._from_zero(k, watch, coefficients[k])
            elif not sign(values[k]):
                raise UnprovenError(f"{watch.name}: its sign is undecided at the start")
            if watch.kind == "impact" and self.signs[watch.index] < 0:
                raise UnprovenError(f"{watch.name}: the gap is negative at the start")

    def _from_zero(self, k: int, watch: Watch, c: Sequence[arb]) -> None:
        """Sign just after a zero, by the first coefficient that is not zero."""
        order = next((j for j, v in enumerate(c) if not v.is_zero()), 0)
        if not order or not sign(c[order]):
            raise UnprovenError(f"{watch.name}: its sign after a zero is undecided")
        due = watch.kind == "reset" and watch.direction * sign(c[order]) >= 0
        if due or (watch.kind == "impact" and not (order == 1 and c[1] > 0)):
            raise UnprovenError(
                f"the start is on the zero of {watch.name} and does not leave it the other way: what "
                "happens there at once is not proven. Start from the state after it"
            )
        self.zeros[k], self.signs[watch.index] = order, sign(c[order])

    # events --------------------------------------------------------------------------------------

    def _switched(self, watch: Watch) -> Met:
        """A surface was met or left."""
        before, x, j = self.mode, self.hull(), watch.index
        slides = self.modes.slides_on(before)
        if watch.kind == "exit":
            l1, l2 = self.modes.rates(j, before, x, self.p)
            other = l2 if watch.direction > 0 else -l1
            if not other > 0:
                raise UnprovenError(
                    f"exit at t = {self.t.str(8)}: L1 in {l1.str(5)}, L2 in {l2.str(5)}, so the "
                    "other field's sign is undecided (a two-fold?)"
                )
            letter, zeros, kind = ("+" if watch.direction > 0 else "-"), 2, "exit"
        elif slides is not None:
            letter, zeros, kind = self.modes.across(j, before, x, self.p), 1, "crossing"
            if letter == before[j]:
                raise UnprovenError(f"{watch.name} at t = {self.t.str(8)} is not crossed")
        else:
            l1, l2 = self.modes.rates(j, before, x, self.p)
            found = beyond(l1, l2)
            if found is None:
                raise UnprovenError(
                    f"{watch.name} at t = {self.t.str(8)}: L1 in {l1.str(5)}, L2 in {l2.str(5)}, so "
                    "what follows is undecided"
                )
            letter, zeros = found
            kind = "entry" if letter == "s" else "crossing"
        self.mode = self.modes.replaced(before, j, letter)
        self.zeros = self._zeros_of(j, zeros)
        met = Met(watch, kind, self.t, x, before, self.mode)
        self.events.append(met)
        return met

    def _passed(self, watch: Watch, k: int) -> Met | None:
        """The zero of a stop, reset or impact was passed; it counts if its direction does."""
        counts = self.counts(k)
        self.signs[watch.index] = -self.signs[watch.index]
        if not counts:
            self.zeros[k] = 1
            return None
        met = Met(watch, watch.kind, self.t, self.hull(), self.mode, self.mode)
        if watch.kind != "stop":
            met = self._jumped(watch, met)
        self.events.append(met)
        return met

    def _jumped(self, watch: Watch, met: Met) -> Met:
        """After a reset or an impact: a new state, whose sides and signs must be decided anew."""
        where = f"{watch.name} at t = {self.t.str(8)}"
        if not self.modes.pushes(watch, met.x, self.p):
            raise UnprovenError(f"{where}: the impulse is not proven to push")
        slopes = self.modes.jump_slopes(watch, met.x, self.p)
        new = self.modes.jump(watch, met.x, self.p)
        slides = self.modes.slides_on(met.before)
        kept = [slides] if slides is not None and self.modes.surface_kept(slides, watch) else []
        own = self.modes.guard_kept(watch)
        if all(v.is_finite() for v in slopes.entries()):
            self.moved(self.modes.jump(watch, self.middle, self.p), slopes)
            new = [a.intersection(b) for a, b in zip(new, self.hull(), strict=True)]
        else:
            self.adopt(new)
        if not all(v.is_finite() for v in new):
            raise UnprovenError(f"{where}: the state after it is not defined")
        self._enter(new, kept, f"after {where}")
        c = self.now.watched_series(self.now.series(new, self.p, 3), self.p)
        for k, w in enumerate(self.now.watches):
            if not w.passes:
                continue
            at_zero = own and w.kind == watch.kind and w.index == watch.index
            value = c[k][1 if at_zero else 0]
            if not sign(value) or (w.kind == "impact" and not value > 0):
                raise UnprovenError(f"{w.name}: its sign after {watch.name} is undecided")
            self.signs[w.index] = sign(value)
            if at_zero:
                self.zeros[k] = 1
        return Met(watch, watch.kind, met.t, new, met.before, self.mode)
