"""Enclosures of the smooth motions of a system, with at most one sliding surface, and of their events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from ...model import DefinitionError, FilippovSystem
from ..arithmetic.algebra import Difference
from ..arithmetic.flint import arb, arb_mat
from ..arithmetic.instructions import ExpressionGraph, Program
from ..arithmetic.intervals import Enclosures, Numbers, Rationals, hull, sign
from ..arithmetic.series import along, coefficients
from ..proof import UnprovenError
from ..surface_functions import SurfaceFunctions, SystemGraph, enclosed


@dataclass(frozen=True)
class EventFunction:
    """A function of the state whose zeros are events."""

    kind: str
    name: str
    node: int
    direction: int = 0
    map: tuple[int, ...] = ()
    index: int = 0
    impulse: int | None = None

    @property
    def signed(self) -> bool:
        """Whether it may have either sign, and only zeros in its direction are events."""
        return self.kind in ("stop", "reset", "impact")


class Mode:
    """Field and event functions of a mode, evaluated in enclosures."""

    def __init__(
        self,
        graph: ExpressionGraph,
        field: Sequence[int],
        event_functions: Sequence[EventFunction],
        x: Sequence[int],
        numbers: Numbers,
    ):
        self.event_functions, self.numbers, self.n = tuple(event_functions), numbers, len(x)
        rows = [graph.gradient(f, x) for f in field]
        nodes = [w.node for w in event_functions]
        self._field = Program(graph, [list(field)])
        self._jacobian = Program(graph, rows)
        self._event_values = Program(graph, [nodes])
        self._slopes = Program(graph, [graph.gradient(k, x) for k in nodes])
        still = lambda rows: {v for v, _ in graph.inputs(k for row in rows for k in row)} <= {1}
        self.affine = still(rows)
        self.affine_functions = [still([graph.gradient(k, x)]) for k in nodes]

    def _values(self, program: Program, x: Sequence[arb], p: Sequence[arb]) -> list[list[arb]]:
        return program(Enclosures([x, p, []], self.numbers))

    def field(self, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """Rates of the extended states."""
        return self._values(self._field, x, p)[0]

    def jacobian(self, x: Sequence[arb], p: Sequence[arb]) -> arb_mat:
        """Derivatives of the rates."""
        return arb_mat(self._values(self._jacobian, x, p))

    def event_values(self, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """Values of the event functions."""
        return self._values(self._event_values, x, p)[0]

    def slope(self, k: int, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """Gradient of an event function."""
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
        """Taylor coefficients of affine functions along an affine motion, from middle + frame r."""
        # They are affine in the start, those of the middle plus row A^k/k! frame r, which keeps the
        # dependence between states.
        if not self.affine or not wide:
            return wide
        frame, r = spread
        own = self.event_series(self.series(middle, p, len(wide[0])), p)
        rows = self._values(self._slopes, middle, p)
        matrix, power = self.jacobian(middle, p), frame
        result = [list(c) for c in wide]
        for k in range(len(wide[0]) - 1):  # the last one is the remainder's
            for i, row in enumerate(rows):
                if self.affine_functions[i]:
                    value = own[i][k] + ((arb_mat([row]) * power) * r)[0, 0]
                    if value.is_finite() and value.overlaps(wide[i][k]):
                        result[i][k] = value.intersection(wide[i][k])
            power = matrix * power / (k + 1)
        return result

    def event_series(self, c: Sequence[Sequence[arb]], p: Sequence[arb]) -> list[list[arb]]:
        """Taylor coefficients of the event functions along a motion."""
        return along(self._event_values, c, p, self.numbers)[0]

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


# Stops, resets and impacts -----------------------------------------------------------------------


def jumps_of(system_graph: SystemGraph) -> list[EventFunction]:
    """Event functions of stops, then resets, then impacts."""
    d, system = system_graph.system.definition, system_graph.system
    result: list[EventFunction] = []
    if d.guards.numel():
        (nodes,) = system_graph.insert([d.guards])
        for k, node in enumerate(nodes):
            if k < len(system.stops):
                name, direction = system.stops[k]
                result.append(EventFunction("stop", name, node, direction, index=k))
            else:
                name, direction = system.resets[k - len(system.stops)]
                (after,) = system_graph.insert([d.maps[:, k - len(system.stops)]])
                full = (*after, *system_graph.x[len(after) :])
                result.append(EventFunction("reset", name, node, direction, full, k))
    count = len(result)
    return result + [_impact(system_graph, k, count) for k in range(len(system.impacts))]


def _impact(system_graph: SystemGraph, k: int, count: int) -> EventFunction:
    """Newton's impact law: x + c P with P = -(1 + e) v/(grad v . c), c the reaction's column."""
    d, graph = system_graph.system.definition, system_graph.graph
    name = system_graph.system.impacts[k]
    (gaps,) = system_graph.insert([d.gaps])
    (restitutions,) = system_graph.insert([d.restitutions])
    still = [graph.constant(0)] * d.multipliers.numel()
    rate = graph.dot(system_graph.field(still), system_graph.gradient(gaps[k]))
    multipliers = [graph.symbol(3, i) for i in range(len(still))]
    reactions = [graph.constant(0)] * len(gaps)
    reactions[k] = graph.symbol(4, 0)
    field = system_graph.field(multipliers, reactions)
    column = [graph.gradient(f, [reactions[k]])[0] for f in field]
    if any(vector in (3, 4) for vector, _ in graph.inputs(column)):
        raise DefinitionError(
            f"A multiplier enters the impulse of {name!r} (friction), or a reaction enters nonlinearly. "
            "certify_orbit proves impacts without friction only."
        )
    effect = graph.dot(system_graph.gradient(rate), column)
    jump = graph.apply("mul", [graph.apply("add", [graph.constant(1), restitutions[k]]), rate])
    impulse = graph.apply("neg", [graph.apply("div", [jump, effect])])
    n = d.states.numel()
    after = [
        graph.apply("add", [x, graph.apply("mul", [impulse, c])])
        for x, c in zip(system_graph.x[:n], column[:n], strict=True)
    ]
    return EventFunction(
        "impact", name, gaps[k], -1, (*after, *system_graph.x[n:]), count + k, impulse
    )


#: Exact ends of an interval.
Range = tuple[Fraction, Fraction]


class Modes:
    """The modes of a system, each built on first use."""

    # A mode is one letter for each surface, at most one of them ``s``, and an ``o`` for each impact.

    def __init__(self, system: FilippovSystem, numbers: Numbers, moving: Sequence[int] = ()):
        if any(system.nonlinear):
            raise DefinitionError(
                "A multiplier enters nonlinearly (hidden dynamics). certify_orbit proves orbits of systems with "
                "linear multipliers only."
            )
        self.system, self.numbers = system, numbers
        self.system_graph = SystemGraph(system, moving, clock=True)
        self.clock = system.dimension
        self.graph = self.system_graph.graph
        surfaces = system.definition.surfaces
        (self.h,) = self.system_graph.insert([surfaces]) if system.surface_count else ([],)
        self.ends = jumps_of(self.system_graph)
        self._modes: dict[str, Mode] = {}
        self._programs: dict[Any, Program] = {}

    def __getitem__(self, mode: str) -> Mode:
        """A mode by its letters."""
        if mode not in self._modes:
            field, event_functions = self._parts(mode)
            self._modes[mode] = Mode(
                self.graph, field, [*event_functions, *self.ends], self.system_graph.x, self.numbers
            )
        return self._modes[mode]

    def replaced(self, mode: str, surface: int, letter: str) -> str:
        """The mode with another letter for one surface."""
        return mode[:surface] + letter + mode[surface + 1 :]

    def slides_on(self, mode: str) -> int | None:
        """The surface that slides."""
        return mode.index("s") if "s" in mode else None

    def name(self, surface: int) -> str:
        """Name of a surface in messages."""
        return "surface" if self.system.surface_count == 1 else f"surface {surface}"

    def functions(self, surface: int, mode: str) -> SurfaceFunctions:
        """Both fields at a surface, with the others on the sides of a mode."""
        mode = self.replaced(mode, surface, "s")
        return SurfaceFunctions(self.system, surface, mode, self.system_graph)

    def _parts(self, mode: str) -> tuple[list[int], list[EventFunction]]:
        graph, slides = self.graph, self.slides_on(mode)
        event_functions = [
            EventFunction(
                "surface", self.name(j), graph.apply("neg", [h]) if c == "-" else h, index=j
            )
            for j, (h, c) in enumerate(zip(self.h, mode, strict=False))
            if c != "s"
        ]
        if slides is None:
            signs = [graph.constant(1.0 if c == "+" else -1.0) for c in mode[: len(self.h)]]
            return self.system_graph.field(signs), event_functions
        d = self.functions(slides, mode)
        name = f"sliding on {self.name(slides)}"
        exits = [
            EventFunction("exit", name, graph.apply("neg", [d.lie[0]]), 1, index=slides),
            EventFunction("exit", name, d.lie[1], -1, index=slides),
        ]
        return _sliding(self.system_graph, d.h, d.fields, self.numbers), [*exits, *event_functions]

    # points on surfaces --------------------------------------------------------------------------

    def heights(self, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """The switching functions."""
        return self._values("h", lambda: [self.h], x, p)[0] if self.h else []

    def rates(self, surface: int, mode: str, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """L1 and L2 at a surface, with the others on the sides of a mode."""
        mode = self.replaced(mode, surface, "s")
        return self._values(mode, lambda: [list(self.functions(surface, mode).lie)], x, p)[0]

    def surfaces_at(self, x: Sequence[Range], p: Sequence[Range]) -> list[int]:
        """The surfaces on which exact starts lie; inputs with a width are unknown."""
        inputs = [[a if a == b else None for a, b in vector] for vector in (x, p)]
        (values,) = Program(self.graph, [self.h])(Rationals(inputs, self.numbers))
        return [j for j, h in enumerate(values) if h == 0]

    def end_at(
        self, name: str, position: int, value: int, direction: int = 1, index: int = -1
    ) -> EventFunction:
        """Add an end of orbits, where a state has a value (a node); of a time the index is -1."""
        left = self.graph.apply("sub", [value, self.system_graph.x[position]])
        node = left if direction > 0 else self.graph.apply("neg", [left])
        self.ends.append(EventFunction("end", name, node, index=index))
        return self.ends[-1]

    def constant(self, node: int, ranges: Sequence[Range]) -> arb:
        """The value of a node that depends on parameters alone."""
        x = [arb(0)] * (self.clock + 1) + enclosed([r for r in ranges if r[0] < r[1]])
        return self._values(("constant", node), lambda: [[node]], x, enclosed(ranges))[0][0]

    def across(self, surface: int, mode: str, x: Sequence[arb], p: Sequence[arb]) -> str:
        """The side to which a surface is crossed while another slides."""
        # If for every multiplier of the crossed surface sliding on the other one attracts and leads to
        # the same side, no other motion can continue.
        slides = self.slides_on(mode)
        assert slides is not None

        def rows() -> list[list[int]]:
            graph, w = self.graph, self.system_graph
            signs = [graph.constant(1.0 if c == "+" else -1.0) for c in mode[: len(self.h)]]
            signs[surface] = graph.symbol(3, 0)
            fields = []
            for s in (1.0, -1.0):
                signs[slides] = graph.constant(s)
                fields.append(w.field(signs))
            gradient = w.gradient(self.h[slides])
            lie = [graph.dot(f, gradient) for f in fields]
            field = _sliding(w, self.h[slides], fields, self.numbers)
            return [[*lie, graph.dot(field, w.gradient(self.h[surface]))]]

        ((l1, l2, rate),) = self._values(("across", surface, mode), rows, x, p)
        if l1 < 0 and l2 > 0 and sign(rate):
            return "+" if rate > 0 else "-"
        raise UnprovenError(
            f"{self.name(surface)} is reached while sliding on {self.name(slides)}, and for the multiplier "
            f"between -1 and 1 the rates are in {l1.str(5)}, {l2.str(5)} and {rate.str(5)}: sliding on "
            "several surfaces at once is not proven here"
        )

    def _values(self, key: Any, rows: Any, x: Sequence[arb], p: Sequence[arb]) -> list[list[arb]]:
        if key not in self._programs:
            self._programs[key] = Program(self.graph, rows())
        any_ = [hull(arb(-1), arb(1))]
        return self._programs[key](Enclosures([x, p, [], any_], self.numbers))

    # jumps ---------------------------------------------------------------------------------------

    def jump(self, function: EventFunction, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """The state after a reset or an impact."""
        key = ("jump", function.index)
        return self._values(key, lambda: [list(function.map)], x, p)[0]

    def jump_slopes(self, function: EventFunction, x: Sequence[arb], p: Sequence[arb]) -> arb_mat:
        """Derivatives of the state after a reset or an impact."""
        rows = lambda: [self.system_graph.gradient(k) for k in function.map]
        return arb_mat(self._values(("slopes", function.index), rows, x, p))

    def pushes(self, function: EventFunction, x: Sequence[arb], p: Sequence[arb]) -> bool:
        """Whether the impulse of an impact is positive; resets have none."""
        if function.impulse is None:
            return True
        node = function.impulse
        ((impulse,),) = self._values(("impulse", function.index), lambda: [[node]], x, p)
        return bool(impulse > 0)

    def guard_kept(self, function: EventFunction) -> bool:
        """Whether a jump leaves its own guard at zero, by its instructions."""
        d, count = self.system.definition, len(self.system.stops) + len(self.system.resets)
        k = function.index
        guard = d.guards[k] if k < count else d.gaps[k - count]
        return self.system_graph.inserted_at(guard, function.map) == function.node

    def surface_kept(self, surface: int, function: EventFunction) -> bool:
        """Whether a jump leaves a switching function as it is, by its instructions."""
        h = self.system.definition.surfaces[surface]
        return self.system_graph.inserted_at(h, function.map) == self.h[surface]


def _sliding(
    system_graph: SystemGraph, h: int, fields: Sequence[Sequence[int]], numbers: Numbers
) -> list[int]:
    """F1 - (L1/b) G with the exact common factor of F1 - F2 cancelled."""
    graph, gradient = system_graph.graph, system_graph.gradient(h)
    difference = Difference(graph, fields, gradient, numbers)
    if difference.identical:
        return list(fields[0])
    ratio = graph.apply("div", [graph.dot(fields[0], gradient), difference.transverse])
    return [
        graph.apply("sub", [f, graph.apply("mul", [ratio, g])])
        for f, g in zip(fields[0], difference.direction, strict=True)
    ]
