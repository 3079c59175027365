"""A special-point problem with its unknowns, held states and ranges of parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from ...local import Equilibrium, Fold, PseudoEquilibrium, TwoFold
from ...local.searches.search import unknowns
from ...model import FilippovSystem, OptionError
from ..arithmetic.decimals import given
from ..arithmetic.enclosure import Enclosure
from ..arithmetic.equations import Equations, plane
from ..arithmetic.flint import arb
from ..arithmetic.intervals import Numbers, exact, exact_range, radius
from ..arithmetic.krawczyk import Zero, inverse
from ..proof import READ, Classification, intervals, listed, paragraph
from ..record import record_of
from ..surface_functions import SurfaceFunctions, enclosed, parameter_ranges
from .special_points import PROBLEMS, PointProblem


@dataclass(frozen=True)
class ProblemInstance:
    """A problem with a start, unknowns, held states and ranges of parameters."""

    problem: PointProblem
    start: list[float]
    unknowns: list[tuple[int, int]]
    names: list[str]
    values: list[tuple[Fraction, Fraction]]
    normals: list[list[Fraction]]
    through: list[Fraction]
    parameters: list[tuple[Fraction, Fraction]]
    numbers: Numbers

    most_bits = 2**16  # that may help to decide the class

    @property
    def kind(self) -> str:
        return self.problem.kind

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return self.problem.functions.system.parameter_names

    @property
    def held(self) -> list[int]:
        """Extended states that are not unknowns."""
        free = {i for vector, i in self.unknowns if vector == 0}
        return [i for i in range(len(self.values)) if i not in free]

    @property
    def wide_held(self) -> dict[str, Enclosure]:
        """Ranges of held states that are not single values."""
        names = [*self.problem.functions.system.state_names, "t"]
        return {
            names[i]: given(*self.values[i])
            for i in self.held
            if self.values[i][0] < self.values[i][1]
        }

    @property
    def ranges(self) -> list[tuple[Fraction, Fraction]]:
        """Ranges of the parameters, then of the held states."""
        return [*self.parameters, *(self.values[i] for i in self.held)]

    def over(self, ranges: Sequence[tuple[Fraction, Fraction]]) -> ProblemInstance:
        """The same problem for other parameters and held states."""
        count, values = len(self.parameters), list(self.values)
        for i, pair in zip(self.held, ranges[count:], strict=True):
            values[i] = pair
        return replace(self, parameters=list(ranges[:count]), values=values)

    def halves(self, start: list[float], exists: bool) -> list[ProblemInstance]:
        """The same problem over both halves of the range that matters most."""
        # That is the one that moves the equations, or where the point is known to exist its class.
        wide = [k for k, (a, b) in enumerate(self.ranges) if a < b]
        matters = lambda k: (self._in_class(k, start) if exists else 0.0, self._influence(k, start))
        k = max(wide, key=matters)
        low, high = self.ranges[k]
        middle = (low + high) / 2
        parts = ((low, middle), (middle, high))
        changed = [[p if j == k else v for j, v in enumerate(self.ranges)] for p in parts]
        return [replace(self.over(ranges), start=start) for ranges in changed]

    def _middles(self) -> list[tuple[Fraction, Fraction]]:
        return [((a + b) / 2, (a + b) / 2) for a, b in self.ranges]

    def _alone(self, k: int) -> ProblemInstance:
        """The same problem with one range, and the middles of the others."""
        parts = zip(self.ranges, self._middles(), strict=True)
        return self.over([own if j == k else middle for j, (own, middle) in enumerate(parts)])

    def _in_class(self, k: int, start: list[float]) -> float:
        """Relative width of the values that decide the class, due to one range alone."""
        inputs = self._alone(k).equations().inputs([arb(v) for v in start])
        values = [v for v in self.problem.classification(inputs).values.values() if v.is_finite()]
        return sum(radius(v) / (radius(v) + abs(float(v.mid())) or 1.0) for v in values)

    def _influence(self, k: int, start: list[float]) -> float:
        """Width of values and Jacobian of the equations due to one range, times the inverse Jacobian."""
        at = [arb(v) for v in start]
        _, jacobian = self.over(self._middles()).equations().with_jacobian(at)
        matrix = inverse(jacobian)
        values, slopes = self._alone(k).equations().with_jacobian(at)
        if matrix is None:
            return radius_of([*values.entries(), *slopes.entries()])
        return radius_of([*(matrix * values).entries(), *(matrix * slopes).entries()])

    def equations(self) -> Equations:
        """The square system with enclosures of what is held."""
        graph = self.problem.functions.graph
        inputs = [graph.symbol(*index) for index in self.unknowns if index[0] == 0]
        nodes = [*self.problem.nodes, *plane(graph, inputs, self.normals, self.through)]
        held = [enclosed(self.values), enclosed(self.parameters)]
        held.append([arb(0)] * len(self.problem.further))
        return Equations(graph, nodes, self.unknowns, self.names, held, self.numbers)

    def failure(self, equations: Any) -> str:
        """Why no zero was proven."""
        return (
            "Krawczyk's operator mapped no box into itself: the zero is not simple (dependent "
            "gradients, a double zero, a curve of zeros), a field is not defined there, or the "
            "parameters are too wide."
        )

    def classification(self, equations: Any, zero: Zero) -> Classification:
        """The class of a proven zero."""
        return self.problem.classification(equations.inputs(zero.point))

    def record(self, zero: Zero, classification: Classification, bits: int) -> dict[str, Any]:
        """Everything that a checker needs about a proven zero."""
        return record_of(self, zero, classification, bits)

    def statement(
        self,
        classification: Classification,
        condition: str,
        point: Mapping[str, Any],
        box: Mapping[str, Any],
        values: Mapping[str, Any],
    ) -> str:
        """The theorem in words."""
        kind = self.kind
        article = "an" if classification.title[0] in "aeiou" else "a"
        shown = {k: v for k, v in values.items() if not (k[0] == "L" and k[1:].isdigit())}
        classed = (
            f", class {classification.label}" if kind == "two-fold" and classification.label else ""
        )
        if classification.label.startswith("boundary Delta") or classification.label.startswith(
            "boundary disc"
        ):
            classed = f", exactly on the {classification.label}"
        head = (
            "Theorem" if classification.label else "Theorem on existence, with the class undecided"
        )
        return paragraph(
            f"{head}. {condition}The box {intervals(box)} contains exactly one {kind}{self.where}.",
            f"It is {article} {classification.title}{classed}, at {listed(point)}.",
            f"{listed(shown)}." if shown else "",
            *classification.lines,
            f"Not decided: {classification.why}."
            if classification.why and not classification.label
            else "",
            READ[self.numbers],
        )

    @property
    def where(self) -> str:
        """Held states, the plane and the sides of other surfaces, in words."""
        functions = self.problem.functions
        free = {i for vector, i in self.unknowns if vector == 0}
        names = [*functions.system.state_names, "t"]
        held = [
            intervals({names[i]: given(*v)})
            for i, v in enumerate(self.values)
            if i not in free and v[0] == v[1]
        ]
        text = f" with {', '.join(held)}" if held else ""
        if functions.system.surface_count > 1:
            text += f" in mode {functions.mode!r}"
        if self.normals:
            text += (
                f" on the plane through the given point across the set of such points (of codimension "
                f"{len(self.normals)})"
            )
        return text


def radius_of(values: Sequence[arb]) -> float:
    """Sum of radii."""
    return sum(map(radius, values))


def instance_of(
    found: Any,
    system: FilippovSystem | None,
    hold: Sequence[str] | Mapping[str, Any],
    numbers: Numbers,
    parameters: Mapping[Any, Any] | None,
) -> ProblemInstance:
    kinds = {TwoFold: "two-fold", Fold: "fold", Equilibrium: "equilibrium"}
    kind = {**kinds, PseudoEquilibrium: "pseudo-equilibrium"}.get(type(found))
    if kind is None:
        raise OptionError(
            f"certify cannot prove {found!r} ({type(found).__name__}): it is not a TwoFold, Fold, Equilibrium or "
            "PseudoEquilibrium. Find one first, for example with find_two_fold(system, near=...)."
        )
    surface, mode, values = 0, None, dict(parameters or {})
    if isinstance(found, TwoFold):
        system, surface = found.system, found.surface
        where = found.chart.where
        mode = where.mode if system.surface_count > 1 else None
        names = {k if isinstance(k, str) else str(k) for k in values}
        values |= {k: v for k, v in found.parameters.items() if k not in names}
    if system is None:
        raise OptionError(
            "system is missing: only two-folds carry theirs. Write certify(found, system=system)."
        )
    functions = SurfaceFunctions(system, surface, mode)
    problem = PROBLEMS[kind](functions, numbers, getattr(found, "side", "+"))
    point = [float(v) for v in found.point]
    point += [float(getattr(found, "t", 0.0))] if system.time_dependent else []
    free = unknowns(system, list(hold) if not isinstance(hold, str) else hold, 1, kind)
    held = _held(system, hold, numbers)
    for i, (low, high) in held.items():
        point[i] = float((low + high) / 2)
    extra = [1 - 2 * found.alpha] if isinstance(found, PseudoEquilibrium) else []
    normals = _across(problem, point, free, parameter_ranges(system, values, numbers), numbers)
    return ProblemInstance(
        problem,
        [point[i] for i in free] + extra,
        [(0, i) for i in free] + [(2, k) for k in range(len(extra))],
        [system.state_names[i] for i in free] + [name for name, *_ in problem.further],
        [held.get(i, (exact(v, numbers),) * 2) for i, v in enumerate(point)],
        normals,
        [exact(point[i], numbers) for i in free],
        parameter_ranges(system, values, numbers),
        numbers,
    )


def _held(
    system: FilippovSystem, hold: Sequence[str] | Mapping[str, Any], numbers: Numbers
) -> dict[int, tuple[Fraction, Fraction]]:
    """Values and ranges given for held states."""
    found = {}
    for name, value in hold.items() if isinstance(hold, Mapping) else ():
        index = system.state_names.index(name)
        found[index] = exact_range(value, numbers, f"hold of {name!r}")
    return found


def _across(
    problem: PointProblem,
    point: list[float],
    free: list[int],
    parameters: Sequence[tuple[Fraction, Fraction]],
    numbers: Numbers,
) -> list[list[Fraction]]:
    """Normals of the plane across the set of zeros; none if the zeros are isolated points."""
    unknown = len(free) + len(problem.further)
    missing = unknown - len(problem.nodes)
    if missing < 0:
        raise OptionError(
            f"hold leaves {len(free)} free states, but a {problem.kind} needs at least "
            f"{len(problem.nodes) - len(problem.further)}. Hold fewer states."
        )
    if missing == 0:
        return []
    functions = problem.functions
    held = [
        [arb(v) for v in point],
        [a.mid() for a in enclosed(parameters)],
        [arb(0)] * len(problem.further),
    ]
    inputs = [(0, i) for i in free]
    flat = Equations(functions.graph, problem.nodes, inputs, [""] * len(free), held, numbers)
    _, jacobian = flat.with_jacobian([held[0][i] for i in free])
    rows = np.array([[float(v.mid()) for v in row] for row in jacobian.tolist()])
    normals = np.linalg.svd(rows)[2][len(problem.nodes) :]
    return [[Fraction(float(v)) for v in row] for row in normals]
