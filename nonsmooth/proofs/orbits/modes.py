"""The smooth motions of a system and what ends them: modes with at most one surface that slides."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from ...model import DefinitionError, FilippovSystem, explain
from ..arithmetic.algebra import Difference
from ..arithmetic.flint import arb, arb_mat
from ..arithmetic.instructions import Program
from ..arithmetic.intervals import Enclosures, Numbers, hull, sign
from ..arithmetic.rationals import is_zero
from ..proof import UnprovenError
from ..surface_functions import Described, Written
from .jumps import jumps_of
from .motion import Mode, Watch

#: Exact ends of an interval.
Range = tuple[Fraction, Fraction]


class Modes:
    """Every mode of a system, built when it is entered."""

    # A mode is a word of one letter for each surface, of which at most one is ``s``, and an ``o`` for
    # each impact.

    def __init__(self, system: FilippovSystem, numbers: Numbers, moving: Sequence[int] = ()):
        if any(system.nonlinear):
            raise DefinitionError(
                explain(
                    "certify_orbit",
                    expected="multipliers that enter linearly",
                    received="hidden dynamics",
                    advice="Orbits with hidden dynamics are not proven.",
                )
            )
        self.system, self.numbers = system, numbers
        self.written = Written(system, moving)
        self.tape = self.written.tape
        surfaces = system.definition.surfaces
        (self.h,) = self.written.insert([surfaces]) if system.surface_count else ([],)
        self.ends = jumps_of(self.written)
        self._modes: dict[str, Mode] = {}
        self._programs: dict[Any, Program] = {}

    def __getitem__(self, word: str) -> Mode:
        """The mode of a word."""
        if word not in self._modes:
            field, watches = self._parts(word)
            self._modes[word] = Mode(
                self.tape, field, [*watches, *self.ends], self.written.x, self.numbers
            )
        return self._modes[word]

    def replaced(self, word: str, surface: int, letter: str) -> str:
        """The word with another letter for one surface."""
        return word[:surface] + letter + word[surface + 1 :]

    def slides_on(self, word: str) -> int | None:
        """The surface that slides."""
        return word.index("s") if "s" in word else None

    def name(self, surface: int) -> str:
        """How a surface is called."""
        return "surface" if self.system.surface_count == 1 else f"surface {surface}"

    def described(self, surface: int, word: str) -> Described:
        """Both fields at a surface where the others are on the sides of a word."""
        mode = self.replaced(word, surface, "s")
        return Described(self.system, surface, mode, self.written)

    def _parts(self, word: str) -> tuple[list[int], list[Watch]]:
        tape, slides = self.tape, self.slides_on(word)
        watches = [
            Watch("surface", self.name(j), tape.apply("neg", [h]) if c == "-" else h, index=j)
            for j, (h, c) in enumerate(zip(self.h, word, strict=False))
            if c != "s"
        ]
        if slides is None:
            signs = [tape.constant(1.0 if c == "+" else -1.0) for c in word[: len(self.h)]]
            return self.written.field(signs), watches
        d = self.described(slides, word)
        name = f"sliding on {self.name(slides)}"
        exits = [
            Watch("exit", name, tape.apply("neg", [d.lie[0]]), 1, index=slides),
            Watch("exit", name, d.lie[1], -1, index=slides),
        ]
        return _sliding(self.written, d.h, d.fields, self.numbers), [*exits, *watches]

    # places on surfaces --------------------------------------------------------------------------

    def heights(self, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """The switching functions."""
        return self._values("h", lambda: [self.h], x, p)[0] if self.h else []

    def rates(self, surface: int, word: str, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """L1 and L2 at a surface, the others on the sides of a word."""
        mode = self.replaced(word, surface, "s")
        return self._values(mode, lambda: [list(self.described(surface, word).lie)], x, p)[0]

    def on_surface(self, surface: int, x: Sequence[Range], p: Sequence[Range]) -> bool:
        """Whether h is zero at exact starts; what has a width counts as unknown."""
        inputs = [[a if a == b else None for a, b in vector] for vector in (x, p)]
        return is_zero(Program(self.tape, [[self.h[surface]]]), inputs, self.numbers)

    def across(self, surface: int, word: str, x: Sequence[arb], p: Sequence[arb]) -> str:
        """The side that is reached where a surface is met while another slides, and goes on to."""
        # For every multiplier of the surface that is met, sliding attracts to the other one and leads
        # to one and the same side: then no other motion can continue.
        slides = self.slides_on(word)
        assert slides is not None

        def rows() -> list[list[int]]:
            tape, w = self.tape, self.written
            signs = [tape.constant(1.0 if c == "+" else -1.0) for c in word[: len(self.h)]]
            signs[surface] = tape.symbol(3, 0)
            fields = []
            for s in (1.0, -1.0):
                signs[slides] = tape.constant(s)
                fields.append(w.field(signs))
            gradient = w.gradient(self.h[slides])
            lie = [tape.dot(f, gradient) for f in fields]
            field = _sliding(w, self.h[slides], fields, self.numbers)
            return [[*lie, tape.dot(field, w.gradient(self.h[surface]))]]

        ((l1, l2, rate),) = self._values(("across", surface, word), rows, x, p)
        if l1 < 0 and l2 > 0 and sign(rate):
            return "+" if rate > 0 else "-"
        raise UnprovenError(
            f"{self.name(surface)} is met while sliding on {self.name(slides)}, and for the multiplier "
            f"between -1 and 1 the rates are in {l1.str(5)}, {l2.str(5)} and {rate.str(5)}: sliding on "
            "several surfaces at once is not proven here"
        )

    def _values(self, key: Any, rows: Any, x: Sequence[arb], p: Sequence[arb]) -> list[list[arb]]:
        if key not in self._programs:
            self._programs[key] = Program(self.tape, rows())
        any_ = [hull(arb(-1), arb(1))]
        return self._programs[key](Enclosures([x, p, [], any_], self.numbers))

    # jumps ---------------------------------------------------------------------------------------

    def jump(self, watch: Watch, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """The state after a reset or an impact."""
        key = ("jump", watch.index)
        return self._values(key, lambda: [list(watch.map)], x, p)[0]

    def jump_slopes(self, watch: Watch, x: Sequence[arb], p: Sequence[arb]) -> arb_mat:
        """Derivatives of the state after a reset or an impact."""
        rows = lambda: [self.written.gradient(k) for k in watch.map]
        return arb_mat(self._values(("slopes", watch.index), rows, x, p))

    def pushes(self, watch: Watch, x: Sequence[arb], p: Sequence[arb]) -> bool:
        """Whether the impulse of an impact is positive; resets have none."""
        if watch.impulse is None:
            return True
        node = watch.impulse
        ((impulse,),) = self._values(("impulse", watch.index), lambda: [[node]], x, p)
        return bool(impulse > 0)

    def guard_kept(self, watch: Watch) -> bool:
        """Whether a jump leaves its own guard at zero, by its instructions."""
        d, count = self.system.definition, len(self.system.stops) + len(self.system.resets)
        k = watch.index
        guard = d.guards[k] if k < count else d.gaps[k - count]
        return self.written.inserted_at(guard, watch.map) == watch.node

    def surface_kept(self, surface: int, watch: Watch) -> bool:
        """Whether a jump leaves a switching function as it is, by its instructions."""
        h = self.system.definition.surfaces[surface]
        return self.written.inserted_at(h, watch.map) == self.h[surface]


def _sliding(
    written: Written, h: int, fields: Sequence[Sequence[int]], numbers: Numbers
) -> list[int]:
    """F1 - (L1/b) G with the exact common factor of F1 - F2 cancelled."""
    tape, gradient = written.tape, written.gradient(h)
    difference = Difference(tape, fields, gradient, numbers)
    if difference.identical:
        return list(fields[0])
    ratio = tape.apply("div", [tape.dot(fields[0], gradient), difference.transverse])
    return [
        tape.apply("sub", [f, tape.apply("mul", [ratio, g])])
        for f, g in zip(fields[0], difference.direction, strict=True)
    ]


def beyond(l1: arb, l2: arb) -> tuple[str, int] | None:
    """The mode beyond a point of the surface, and how many coefficients of h are zero in it."""
    if l1 < 0 and l2 > 0:
        return "s", 0
    if l1 > 0 and l2 > 0:
        return "+", 1
    return ("-", 1) if l1 < 0 and l2 < 0 else None
