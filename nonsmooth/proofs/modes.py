"""The smooth motions of a system with one surface, and what ends them, on a tape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from ..model import DefinitionError, FilippovSystem, explain
from .algebra import Difference
from .arithmetic import Enclosures, Numbers
from .described import Described
from .flint import arb, arb_mat
from .rationals import is_zero
from .series import along, coefficients
from .tape import Program, Tape

#: Exact ends of an interval.
Range = tuple[Fraction, Fraction]


@dataclass(frozen=True)
class Watch:
    """A function whose zero means something.

    Attributes
    ----------
    kind : {"surface", "exit", "stop", "reset"}
        Surfaces and exits are positive inside the mode.
    name : str
    node : int
    direction : int
        Of stops and resets: -1 falling, 0 either way, 1 rising; of exits the side.
    map : tuple of int
        Nodes of the state after a reset.
    """

    kind: str
    name: str
    node: int
    direction: int = 0
    map: tuple[int, ...] = ()


class Mode:
    """Field and watched functions of a mode, evaluated in enclosures.

    Parameters
    ----------
    tape : Tape
    field : sequence of int
    watches : sequence of Watch
    x : sequence of int
        Input nodes of the extended states.
    numbers : {"stored", "written"}
    """

    def __init__(
        self,
        tape: Tape,
        field: Sequence[int],
        watches: Sequence[Watch],
        x: Sequence[int],
        numbers: Numbers,
    ):
        self.watches, self.numbers, self.n = tuple(watches), numbers, len(x)
        rows = [tape.gradient(f, x) for f in field]
        nodes = [w.node for w in watches]
        self._field = Program(tape, [list(field)])
        self._jacobian = Program(tape, rows)
        self._both = Program(tape, [list(field), *rows])
        self._watched = Program(tape, [nodes])
        self._slopes = Program(tape, [tape.gradient(k, x) for k in nodes])
        moving = tape.ancestors(k for row in rows for k in row)
        places = [tape.nodes[k].payload for k in moving if tape.nodes[k].op == "input"]
        self.affine = all(place[0] == 1 for place in places)  # type: ignore[index]
        rows = [tape.gradient(k, x) for k in nodes]
        self.affine_watches = [
            all(
                tape.nodes[a].op != "input" or tape.nodes[a].place[0] == 1
                for a in tape.ancestors(row)
            )
            for row in rows
        ]

    def _values(self, program: Program, x: Sequence[arb], p: Sequence[arb]) -> list[list[arb]]:
        return program(Enclosures([x, p, []], self.numbers))

    def field(self, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """Rates of the extended states."""
        return self._values(self._field, x, p)[0]

    def jacobian(self, x: Sequence[arb], p: Sequence[arb]) -> arb_mat:
        """Derivatives of the rates."""
        return arb_mat(self._values(self._jacobian, x, p))

    def watched(self, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """Values of the watched functions."""
        return self._values(self._watched, x, p)[0]

    def slope(self, k: int, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """Gradient of a watched function."""
        return self._values(self._slopes, x, p)[k]

    def series(self, x: Sequence[arb], p: Sequence[arb], count: int) -> list[list[arb]]:
        """Taylor coefficients of the motion from x, ``count`` of them for each state."""
        if not self.affine:
            return coefficients(self._field, x, p, count, self.numbers)
        matrix, rate = self.jacobian(x, p), arb_mat([[f] for f in self.field(x, p)])
        result = [[v] for v in x]
        for k in range(1, count):
            for i in range(self.n):
                result[i].append(rate[i, 0] / k)
            rate = matrix * rate / k
        return result

    def narrowed(
        self,
        wide: list[list[arb]],
        middle: Sequence[arb],
        spread: tuple[arb_mat, arb_mat],
        p: Sequence[arb],
    ) -> list[list[arb]]:
        """Taylor coefficients of affine functions along an affine motion, from middle + frame r.

        They are affine in the start: those of the middle plus row A^k/k! frame r, in which the
        states keep what ties them together.
        """
        if not self.affine:
            return wide
        frame, r = spread
        own = self.watched_series(self.series(middle, p, len(wide[0])), p)
        rows = self._values(self._slopes, middle, p)
        matrix, power = self.jacobian(middle, p), frame
        result = [list(c) for c in wide]
        for k in range(len(wide[0]) - 1):  # the last one is the remainder's
            for i, row in enumerate(rows):
                if self.affine_watches[i]:
                    value = own[i][k] + ((arb_mat([row]) * power) * r)[0, 0]
                    if value.is_finite() and value.overlaps(wide[i][k]):
                        result[i][k] = value.intersection(wide[i][k])
            power = matrix * power / (k + 1)
        return result

    def watched_series(self, c: Sequence[Sequence[arb]], p: Sequence[arb]) -> list[list[arb]]:
        """Taylor coefficients of the watched functions along a motion."""
        return along(self._watched, c, p, self.numbers)[0]

    def variation(
        self, c: Sequence[Sequence[arb]], p: Sequence[arb], start: arb_mat
    ) -> list[arb_mat]:
        """Taylor coefficients of V' = J V along a motion, V(0) = ``start``."""
        rows, n, count = along(self._jacobian, c, p, self.numbers), self.n, len(c[0])
        jacobians = [
            arb_mat([[rows[i][j][k] for j in range(n)] for i in range(n)]) for k in range(count - 1)
        ]
        result = [start]
        for k in range(count - 1):
            total = jacobians[0] * result[k]
            for i in range(1, k + 1):
                total = total + jacobians[i] * result[k - i]
            result.append(total / (k + 1))
        return result


class Modes:
    """Every mode of a system, built when it is entered.

    Parameters
    ----------
    system : FilippovSystem
        With one surface, without impacts.
    numbers : {"stored", "written"}
    moving : sequence of int
        Parameters with intervals, which are followed as states: what depends on them stays so.
    """

    def __init__(self, system: FilippovSystem, numbers: Numbers, moving: Sequence[int] = ()):
        _require_supported(system)
        self.system, self.numbers = system, numbers
        self.described = Described(system, moving=moving)
        self.tape = self.described.tape
        self._ends = self._stops_and_resets()
        self._modes: dict[str, Mode] = {}

    def _stops_and_resets(self) -> list[Watch]:
        d, system = self.system.definition, self.system
        if not d.guards.numel():
            return []
        (nodes,) = self.described.insert([d.guards])
        count, result = len(system.stops), []
        for k, node in enumerate(nodes):
            if k < count:
                name, direction = system.stops[k]
                result.append(Watch("stop", name, node, direction))
            else:
                name, direction = system.resets[k - count]
                (after,) = self.described.insert([d.maps[:, k - count]])
                full = (*after, *self.described.x[len(after) :])
                result.append(Watch("reset", name, node, direction, full))
        return result

    def __getitem__(self, letter: str) -> Mode:
        """The mode of a letter: ``+``, ``-``, ``s``."""
        if letter not in self._modes:
            field, watches = self._parts(letter)
            self._modes[letter] = Mode(
                self.tape, field, [*watches, *self._ends], self.described.x, self.numbers
            )
        return self._modes[letter]

    def _parts(self, letter: str) -> tuple[list[int], list[Watch]]:
        d, tape = self.described, self.tape
        if letter == "s":
            exits = [
                Watch("exit", "sliding", tape.apply("neg", [d.lie[0]]), 1),
                Watch("exit", "sliding", d.lie[1], -1),
            ]
            return self.sliding_field, exits
        h = d.h if letter == "+" else tape.apply("neg", [d.h])
        return d.fields[0 if letter == "+" else 1], [Watch("surface", "surface", h)]

    @cached_property
    def sliding_field(self) -> list[int]:
        """F1 - (L1/b) G with the exact common factor of F1 - F2 cancelled."""
        d, tape = self.described, self.tape
        difference = Difference(tape, d.fields, d.gradient(d.h), self.numbers)
        if difference.identical:
            return d.fields[0]
        ratio = tape.apply("div", [d.lie[0], difference.transverse])
        return [
            tape.apply("sub", [f, tape.apply("mul", [ratio, g])])
            for f, g in zip(d.fields[0], difference.direction, strict=True)
        ]

    @cached_property
    def _surface(self) -> Program:
        return Program(self.tape, [[self.described.h, *self.described.lie]])

    def surface(self, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """h, L1 and L2."""
        return self._surface(Enclosures([x, p, []], self.numbers))[0]

    def starts_on_surface(self, x: Sequence[Range], p: Sequence[Range]) -> bool:
        """Whether h is zero at exact starts; what has a width counts as unknown."""
        inputs = [[a if a == b else None for a, b in vector] for vector in (x, p)]
        return is_zero(Program(self.tape, [[self.described.h]]), inputs, self.numbers)

    def jump(self, watch: Watch, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """The state after a reset."""
        return Program(self.tape, [list(watch.map)])(Enclosures([x, p, []], self.numbers))[0]

    def kept(self, watch: Watch, of: Watch) -> bool:
        """Whether a reset leaves a watched function as it is, by its instructions."""
        d = self.described
        guard = d.system.definition.guards[self._ends.index(of)]
        n = d.system.dimension
        values = [list(watch.map[:n]), list(watch.map[n : d.system.extended_dimension]), d.p]
        definition = d.system.definition
        ((node,),) = self.tape.insert(
            [guard], [definition.states, definition.time, definition.parameters], values
        )
        return bool(node == of.node)


def beyond(l1: arb, l2: arb) -> tuple[str, int] | None:
    """The mode beyond a point of the surface, and how many coefficients of h are zero in it."""
    if l1 < 0 and l2 > 0:
        return "s", 0
    if l1 > 0 and l2 > 0:
        return "+", 1
    return ("-", 1) if l1 < 0 and l2 < 0 else None


def _require_supported(system: Any) -> None:
    received = ""
    if system.surface_count != 1:
        received = f"{system.surface_count} surfaces"
    elif system.impacts:
        received = "impacts"
    elif any(system.nonlinear):
        received = "hidden dynamics"
    if received:
        raise DefinitionError(
            explain(
                "certify_orbit",
                expected="a system with one surface, and stops and resets",
                received=f"one with {received}",
                advice="Orbits on several surfaces, with impacts or hidden dynamics are not proven.",
            )
        )
