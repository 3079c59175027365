"""The enclosure of an orbit through its events; proven signs decide which mode follows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ..arithmetic.flint import arb
from ..arithmetic.intervals import precision, sign
from ..proof import DigitsError, UnprovenError
from .modes import EventFunction, Modes
from .validated_flow import ValidatedFlow


@dataclass(frozen=True)
class EnclosedEvent:
    """An event in enclosures."""

    function: EventFunction
    kind: str
    t: arb
    x: list[arb]
    before: str
    after: str


class OrbitEnclosure(ValidatedFlow):
    """A set of states that is integrated through its events."""

    def __init__(
        self,
        modes: Modes,
        x: Sequence[arb],
        p: Sequence[arb],
        on: Sequence[int] = (),
    ):
        super().__init__(modes, x, p)
        self.events: list[EnclosedEvent] = []
        self._enter(list(x), on, "start")
        self._initial_signs()

    def run(self, most: int) -> Iterator[EnclosedEvent]:
        """Integrate through the events, with so many steps at most, to a stop or the end."""
        event = None
        while event is None or event.kind not in ("stop", "end"):
            if self.steps >= most:
                raise DigitsError(f"more than {most} steps")
            with precision(self.bits):
                event = self.step_through()
            if event is not None:
                yield event

    def step_through(self) -> EnclosedEvent | None:
        """Take one step, and change the mode at an event; return the event, or the end, or None."""
        k = self.step()
        if k is None:
            return None
        function = self.now.event_functions[k]
        if function.kind == "end":
            return EnclosedEvent(function, "end", self.t, self.hull(), self.mode, self.mode)
        return self._passed(function, k) if function.signed else self._switched(function)

    # modes and signs -----------------------------------------------------------------------------

    def _enter(self, x: list[arb], on: Sequence[int], where: str) -> None:
        """Enter the mode that continues from states, of which the surfaces ``on`` are zero exactly."""
        heights = self.modes.heights(x, self.p)
        contacts = "o" * len(self.modes.system.impacts)
        mode = "".join("+" if h > 0 else "-" if h < 0 else "?" for h in heights) + contacts
        unknown = [j for j, c in enumerate(mode) if c == "?"]
        if any(j not in on for j in unknown):
            j = next(j for j in unknown if j not in on)
            raise UnprovenError(
                f"{where}: h of {self.modes.name(j)} is in {heights[j].str(5)}, so its side is undecided"
            )
        if len(unknown) > 1:
            raise UnprovenError(f"{where}: on {len(unknown)} surfaces at once, which is not proven")
        zeros = 0
        for j in unknown:
            letter, zeros = self._beyond(j, mode, x, f"{where}, on {self.modes.name(j)}")
            mode = self.modes.replaced(mode, j, letter)
        self.mode = mode
        self.zeros = self._zeros_of(unknown[0], zeros) if unknown else {}

    def _beyond(self, surface: int, mode: str, x: list[arb], where: str) -> tuple[str, int]:
        """The letter after a point of a surface, and how many coefficients of h are zero in that mode."""
        l1, l2 = self.modes.rates(surface, mode, x, self.p)
        letters = {(-1, 1): ("s", 0), (1, 1): ("+", 1), (-1, -1): ("-", 1)}
        found = letters.get((sign(l1), sign(l2)))
        if found is None:
            raise UnprovenError(
                f"{where}: L1 in {l1.str(5)}, L2 in {l2.str(5)}, so what follows is undecided"
            )
        return found

    def _zeros_of(self, surface: int, count: int) -> dict[int, int]:
        """Number of leading Taylor coefficients of a switching function that are zero after its event."""
        return {
            k: count
            for k, w in enumerate(self.now.event_functions)
            if w.kind == "surface" and w.index == surface
        }

    def _initial_signs(self) -> None:
        """Signs of stops, resets and impacts at the start."""
        x, coefficients = self.hull(), None
        values = self.now.event_values(x, self.p)
        for k, function in enumerate(self.now.event_functions):
            if not function.signed:
                continue
            self.signs[function.index] = sign(values[k])
            if values[k].is_zero():
                if coefficients is None:
                    c = self.now.series(x, self.p, 8)
                    coefficients = self.now.event_series(c, self.p)
                self._from_zero(k, function, coefficients[k])
            elif not sign(values[k]):
                raise UnprovenError(f"{function.name}: its sign is undecided at the start")
            if function.kind == "impact" and self.signs[function.index] < 0:
                raise UnprovenError(f"{function.name}: the gap is negative at the start")

    def _from_zero(self, k: int, function: EventFunction, c: Sequence[arb]) -> None:
        """Sign just after a zero, by the first coefficient that is not zero."""
        order = next((j for j, v in enumerate(c) if not v.is_zero()), 0)
        if not order or not sign(c[order]):
            raise UnprovenError(f"{function.name}: its sign after a zero is undecided")
        due = function.kind == "reset" and function.direction * sign(c[order]) >= 0
        if due or (function.kind == "impact" and not (order == 1 and c[1] > 0)):
            raise UnprovenError(
                f"the start is on the zero of {function.name} and does not leave it the other way: what "
                "happens there at once is not proven. Start from the state after it"
            )
        self.zeros[k], self.signs[function.index] = order, sign(c[order])

    # events --------------------------------------------------------------------------------------

    def _switched(self, function: EventFunction) -> EnclosedEvent:
        """Change the mode at a zero of a surface or at an end of sliding."""
        before, x, j = self.mode, self.hull(), function.index
        slides = self.modes.slides_on(before)
        if function.kind == "exit":
            l1, l2 = self.modes.rates(j, before, x, self.p)
            other = l2 if function.direction > 0 else -l1
            if not other > 0:
                raise UnprovenError(
                    f"exit at t = {self.t.str(8)}: L1 in {l1.str(5)}, L2 in {l2.str(5)}, so the "
                    "other field's sign is undecided (a two-fold?)"
                )
            letter, zeros, kind = ("+" if function.direction > 0 else "-"), 2, "exit"
        elif slides is not None:
            letter, zeros, kind = self.modes.across(j, before, x, self.p), 1, "crossing"
            if letter == before[j]:
                raise UnprovenError(f"{function.name} at t = {self.t.str(8)} is not crossed")
        else:
            where = f"{function.name} at t = {self.t.str(8)}"
            letter, zeros = self._beyond(j, before, x, where)
            kind = "entry" if letter == "s" else "crossing"
        self.mode = self.modes.replaced(before, j, letter)
        self.zeros = self._zeros_of(j, zeros)
        event = EnclosedEvent(function, kind, self.t, x, before, self.mode)
        self.events.append(event)
        return event

    def _passed(self, function: EventFunction, k: int) -> EnclosedEvent | None:
        """Pass a zero of a stop, reset or impact, which is an event only in its direction."""
        is_event = self.is_event(k)
        self.signs[function.index] = -self.signs[function.index]
        if not is_event:
            self.zeros[k] = 1
            return None
        event = EnclosedEvent(function, function.kind, self.t, self.hull(), self.mode, self.mode)
        if function.kind != "stop":
            event = self._jumped(function, event)
        self.events.append(event)
        return event

    def _jumped(self, function: EventFunction, event: EnclosedEvent) -> EnclosedEvent:
        """Map the set by a reset or an impact, and decide sides and signs again."""
        where = f"{function.name} at t = {self.t.str(8)}"
        if not self.modes.pushes(function, event.x, self.p):
            raise UnprovenError(f"{where}: the impulse is not proven to push")
        slopes = self.modes.jump_slopes(function, event.x, self.p)
        new = self.modes.jump(function, event.x, self.p)
        slides = self.modes.slides_on(event.before)
        kept = [slides] if slides is not None and self.modes.surface_kept(slides, function) else []
        own = self.modes.guard_kept(function)
        if all(v.is_finite() for v in slopes.entries()):
            self.moved(self.modes.jump(function, self.middle, self.p), slopes)
            new = [a.intersection(b) for a, b in zip(new, self.hull(), strict=True)]
        else:
            self.adopt(new)
        if not all(v.is_finite() for v in new):
            raise UnprovenError(f"{where}: the state after it is not defined")
        self._enter(new, kept, f"after {where}")
        c = self.now.event_series(self.now.series(new, self.p, 3), self.p)
        for k, w in enumerate(self.now.event_functions):
            if not w.signed:
                continue
            at_zero = own and w.kind == function.kind and w.index == function.index
            value = c[k][1 if at_zero else 0]
            if not sign(value) or (w.kind == "impact" and not value > 0):
                raise UnprovenError(f"{w.name}: its sign after {function.name} is undecided")
            carried = (
                w.kind in ("stop", "reset") and not at_zero and self.signs[w.index] * value < 0
            )
            if carried and w.direction * sign(value) >= 0:
                raise UnprovenError(
                    f"{where}: the jump carries the state across {w.name}, which happens at the same instant; "
                    "such chains of jumps are not proven"
                )
            self.signs[w.index] = sign(value)
            if at_zero:
                self.zeros[k] = 1
        return EnclosedEvent(function, function.kind, event.t, new, event.before, self.mode)
