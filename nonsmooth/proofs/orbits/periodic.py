"""Proofs about periodic orbits: their equations of multiple shooting, period, multipliers and stability.

In each leg the orbit crosses a plane x_k = c. Validated flows from plane to plane, with their derivatives, give
equations whose zero is proven by Krawczyk's operator; the product of the derivatives is that of the return map.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.optimize import brentq

from ...model import OptionError, require_plain
from ...orbit import PeriodicOrbit
from ..arithmetic.decimals import given
from ..arithmetic.eigenvalues import eigenvalues, numbered
from ..arithmetic.enclosure import Enclosure
from ..arithmetic.equations import Equations, column
from ..arithmetic.flint import arb, arb_mat, ctx
from ..arithmetic.intervals import Numbers
from ..arithmetic.krawczyk import Zero, identity
from ..proof import READ, Classification, UnprovenError, intervals, listed, paragraph
from ..record import interval, motion_of, text, zero_record
from ..surface_functions import enclosed, parameter_ranges
from .itinerary import EnclosedEvent, OrbitEnclosure
from .modes import EventFunction, Modes

#: Samples of a leg, and shares of it, among which its plane is chosen: the first with a monotone state.
_SAMPLES, _SHARES = 24, (0.6, 0.1, 0.01, 0.001)

#: An orbit farther than this from the given one, relative to its size, is another one.
_NEAR = 1e-6

#: Steps of a piece.
_STEPS = 2000


@dataclass(frozen=True)
class Section:
    """A plane x_k = c that a leg crosses, and the part of the orbit from there to the next plane."""

    mode: str
    position: int
    value: Fraction
    direction: int
    start: list[float]
    events: int


class Piece(NamedTuple):
    """The flow from one plane to the next: its end, derivatives by the start, duration and events."""

    end: list[arb]
    derivative: arb_mat
    duration: arb
    events: list[EnclosedEvent]


def sections_of(orbit: PeriodicOrbit) -> list[Section]:
    """A plane for each leg, across the state that changes fastest there, which it reaches once only."""
    run, found, n = orbit.trajectory, list[Section](), orbit.system.dimension
    size = np.ptp(run.x, axis=0)
    size[size == 0] = np.inf
    passed = 0
    for leg in orbit.legs:
        passed += 1
        if leg.duration <= 0:
            continue
        for share in _SHARES:
            t = leg.t + leg.duration * np.linspace(1e-6, share, _SAMPLES)
            x = run(t)[:, :n]
            steps = np.diff(x, axis=0) / size
            same = np.sign(steps) == np.sign(steps[0])
            count = np.where(same.all(axis=0), len(steps), same.argmin(axis=0))
            if np.any(count > 4):
                break
        at = np.maximum(count * 2 // 3, 1)  # the states are monotone up to there and beyond
        k = int(np.argmax(np.abs(steps[at - 1, np.arange(n)]) * (count > 4)))
        around = slice(at[k] - 1, at[k] + 2)
        unit = 2.0 ** np.floor(np.log2(np.ptp(x[around, k]) / 4))  # a number with few digits
        value = unit * np.round(x[at[k], k] / unit)
        direction = 1 if steps[0, k] > 0 else -1
        before, after = t[around][[0, -1]]
        state = run(brentq(lambda s, k=k, c=value: run(s)[k] - c, before, after, xtol=1e-15))[:n]
        if found:
            found[-1] = replace(found[-1], events=passed)
        passed = 0
        found.append(Section(leg.mode, k, Fraction(value), direction, state.tolist(), 0))
    return [*found[:-1], replace(found[-1], events=passed + 1)]


class Shooting(Equations):
    """The equations of an orbit: ends of its pieces minus starts of the next ones."""

    def __init__(
        self,
        modes: Modes,
        sections: Sequence[Section],
        ends: Sequence[EventFunction],
        ranges: Sequence[Any],
    ):
        self.modes, self.sections, self.ends, self.ranges = modes, sections, ends, ranges
        n = modes.system.dimension
        self.free = [[i for i in range(n) if i != s.position] for s in sections]
        self.n, self.held = sum(map(len, self.free)), []
        self.why = ""
        self._last: tuple[Any, Any] = (None, None)

    def holding(self, held: list[list[Any]]) -> Shooting:
        """The same equations, as nothing is held."""
        return self

    def values(self, u: Sequence[arb]) -> arb_mat:
        """The equations as a column."""
        return self.with_jacobian(u)[0]

    def with_jacobian(self, u: Sequence[arb]) -> tuple[arb_mat, arb_mat]:
        """The equations and their Jacobian; not finite where a piece is undecided."""
        if self._last[0] is not u:
            self._last = u, self._evaluated(u)
        return self._last[1]

    def _evaluated(self, u: Sequence[arb]) -> tuple[arb_mat, arb_mat]:
        try:
            pieces, self.why = self.pieces(u), ""
        except UnprovenError as error:
            self.why = str(error)
            unknown = arb.nan()
            return column([unknown] * self.n), arb_mat([[unknown] * self.n] * self.n)
        m = len(self.free[0])
        rest = [*u[m:], *u[:m]]  # starts of the next pieces
        values = [v for piece in pieces for v in piece.end]
        jacobian = [[arb(0)] * self.n for _ in range(self.n)]
        for i, piece in enumerate(pieces):
            for a in range(m):
                for b in range(m):
                    jacobian[i * m + a][i * m + b] += piece.derivative[a, b]
                jacobian[i * m + a][(i + 1) % len(pieces) * m + a] -= 1
        return column([a - b for a, b in zip(values, rest, strict=True)]), arb_mat(jacobian)

    def pieces(self, u: Sequence[arb]) -> list[Piece]:
        """The pieces from points or boxes."""
        m = len(self.free[0])
        return [self._piece(i, u[i * m : (i + 1) * m]) for i in range(len(self.sections))]

    def _piece(self, i: int, u: Sequence[arb]) -> Piece:
        """Integrate from one plane to the next, through the events between them."""
        own, j = self.sections[i], (i + 1) % len(self.sections)
        x = [arb(0)] * (self.modes.system.dimension + 1)  # and the time since the start
        x[own.position] = enclosed([(own.value, own.value)])[0]
        for k, v in zip(self.free[i], u, strict=True):
            x[k] = v
        x += enclosed([r for r in self.ranges if r[0] < r[1]])
        flow = OrbitEnclosure(self.modes, x, enclosed(self.ranges), max(12, int(ctx.prec * 0.3)))
        if flow.mode != own.mode:
            raise UnprovenError(f"leg {i + 1} is in mode {flow.mode!r}, not {own.mode!r}")
        event = None
        while event is None or event.kind != "end":
            if flow.steps >= _STEPS:
                raise UnprovenError(f"leg {i + 1} needs more than {_STEPS} steps")
            if len(flow.events) == own.events:
                flow.end = self.ends[j]
            event = flow.step_through()
            if len(flow.events) > own.events or (event is not None and event.kind == "stop"):
                name = event.function.name if event is not None else ""
                raise UnprovenError(f"{name} is reached before the plane of leg {j + 1}")
        if flow.mode != self.sections[j].mode:
            raise UnprovenError(f"leg {j + 1} is in mode {flow.mode!r}")
        rows = flow.derivative.tolist()
        derivative = arb_mat([[rows[a][b] for b in self.free[i]] for a in self.free[j]])
        hull = flow.hull()
        end = [hull[k] for k in self.free[j]]
        return Piece(end, derivative, flow.t, flow.events)


def contracts(matrix: arb_mat) -> bool:
    """Whether a power of a matrix makes all vectors shorter, so that its eigenvalues are inside of the unit circle."""
    for _ in range(12):
        if all(sum((abs(v) for v in row), arb(0)) < 1 for row in matrix.tolist()):
            return True
        matrix = matrix * matrix
    return False


@dataclass(frozen=True)
class OrbitInstance:
    """A periodic orbit with ranges of parameters."""

    orbit: PeriodicOrbit
    sections: list[Section]
    modes: Modes
    ends: list[EventFunction]
    parameters: list[tuple[Fraction, Fraction]]
    start: list[float]
    numbers: Numbers
    near: bool  # whether only the given orbit will do
    refusal: str = ""

    kind = "periodic orbit"
    most_bits = 256  # each try is a run of the flow
    wide_held: ClassVar[dict[str, Enclosure]] = {}

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return self.orbit.system.parameter_names

    @property
    def ranges(self) -> list[tuple[Fraction, Fraction]]:
        """Ranges of the parameters."""
        return self.parameters

    @property
    def unknowns(self) -> list[tuple[int, int]]:
        """Leg and state of each unknown."""
        n = range(self.orbit.system.dimension)
        return [(i, k) for i, s in enumerate(self.sections) for k in n if k != s.position]

    @property
    def names(self) -> list[str]:
        """Names of the unknowns: states at the planes."""
        states = self.orbit.system.state_names
        return [states[k] + (f" in leg {i + 1}" if i else "") for i, k in self.unknowns]

    def halves(self, start: list[float], exists: bool) -> list[OrbitInstance]:
        """The same orbit over both halves of the widest range."""
        k = max(range(len(self.ranges)), key=lambda i: self.ranges[i][1] - self.ranges[i][0])
        low, high = self.ranges[k]
        parts = ((low, (low + high) / 2), ((low + high) / 2, high))
        both = [[p if j == k else v for j, v in enumerate(self.ranges)] for p in parts]
        return [replace(self, parameters=ranges, start=start) for ranges in both]

    def equations(self) -> Shooting:
        """Its equations."""
        return Shooting(self.modes, self.sections, self.ends, self.parameters)

    def failure(self, equations: Any) -> str:
        """Why nothing was proven."""
        equations.with_jacobian([arb(v) for v in self.start])
        if equations.why:
            return f"{equations.why[:1].upper()}{equations.why[1:]}."
        return (
            "Krawczyk's operator mapped no box into itself: a multiplier is 1, or the parameters "
            "are too wide."
        )

    def classification(self, equations: Any, zero: Zero) -> Classification:
        """Period, multipliers and stability."""
        pieces = equations.pieces(zero.point)
        period = sum((p.duration for p in pieces), arb(0))
        away = self._distance(zero, period) if self.near else 0.0
        if away > _NEAR:
            why = f"the periodic orbit nearby is {away:.1e} of its size away from the given one"
            return Classification("", self.kind, why, applies=False, final=True)
        product = identity(len(equations.free[0]))
        for piece in pieces:
            product = piece.derivative * product
        found = eigenvalues(product)
        events = [[[e.kind, e.function.name, e.after] for e in p.events] for p in pieces]
        values, label = {"period": period, "multiplier1": arb(1)}, ""
        claims = {"label": label, "period": interval(period), "events": events}
        if found is None:  # a multiple one, perhaps
            label = "asymptotically stable" if contracts(product) else ""
            why = "" if label else "the multipliers are not proven to be apart"
            claims["label"] = label
            return Classification(label, self.kind, why, values=values, claims=claims)
        sizes = [re * re + im * im for re, im in found]
        order = sorted(range(len(found)), key=lambda k: -float(sizes[k].mid()))
        values |= numbered("multiplier", [found[j] for j in order], 2)
        outside = sum(bool(s > 1) for s in sizes)
        if all(s < 1 for s in sizes):
            label = "asymptotically stable"
        elif outside:
            label = f"unstable, {outside} multiplier{'s' * (outside > 1)} outside the unit circle"
        if not all(s < 1 or s > 1 for s in sizes):
            label = ""
        why = "" if label else "whether a multiplier is inside of the unit circle is undecided"
        claims |= {"label": label, "multipliers": [[interval(v) for v in found[j]] for j in order]}
        return Classification(label, self.kind, why, values=values, claims=claims)

    def _distance(self, zero: Zero, period: arb) -> float:
        """Of the proven orbit from the given one, relative to its size."""
        size = np.maximum(np.ptp(self.orbit.trajectory.x, axis=0), 1e-300)
        found = np.array([float(v.mid()) for v in [*zero.point, period]])
        scale = [*(size[k] for _, k in self.unknowns), self.orbit.period]
        return float(np.max(np.abs(found - [*self.start, self.orbit.period]) / scale))

    def statement(
        self,
        classification: Classification,
        condition: str,
        point: Mapping[str, Enclosure],
        box: Mapping[str, Enclosure],
        values: Mapping[str, Enclosure],
    ) -> str:
        """The theorem in words."""
        states, m = self.orbit.system.state_names, len(box) // len(self.sections)
        parts, boxes = list[str](), list(box.values())
        for i, s in enumerate(self.sections):
            free = [k for k in range(m + 1) if k != s.position]
            own = zip((states[k] for k in free), boxes[i * m :], strict=False)
            plane = intervals({states[s.position]: given(s.value, s.value)})
            parts.append(f"{plane} in the box {intervals(dict(own))}")
        head = "Theorem" if classification.label else "Theorem on existence"
        first = dict(list(point.items())[:m])
        return paragraph(
            f"{head}. {condition}There is exactly one periodic orbit with the itinerary "
            f"{self.orbit.itinerary} that crosses, leg by leg, {'; '.join(parts[:6])}"
            + (f"; and so on through {len(parts)} legs." if len(parts) > 6 else "."),
            f"It is {classification.label}." if classification.label else "",
            f"{listed(values)}.",
            f"In leg 1 {listed(first)}.",
            f"Not decided: {classification.why}." if classification.why else "",
            READ[self.numbers],
        )

    def record(self, zero: Zero, classification: Classification, bits: int) -> dict[str, Any]:
        """Everything that a checker needs."""
        return {
            **motion_of(self.orbit.system, self.numbers, ()),
            "format": "nonsmooth periodic orbit 1",
            "kind": self.kind,
            "sections": [
                {"mode": s.mode, "position": s.position, "direction": s.direction}
                | {"value": text(s.value)}
                for s in self.sections
            ],
            "parameters": [[text(v) for v in pair] for pair in self.parameters],
            "longest": text(Fraction(8 * self.orbit.period)),
            **zero_record(zero, classification, bits),
        }


def orbit_instance(
    orbit: PeriodicOrbit,
    hold: Any,
    numbers: Numbers,
    parameters: Mapping[Any, Any] | None,
) -> OrbitInstance:
    """A periodic orbit for given ranges of parameters, or for those that it has."""
    if hold:
        raise OptionError("hold applies to special points. A periodic orbit has no held states.")
    system = orbit.system
    require_plain(system, "certify")
    names = {k if isinstance(k, str) else str(k) for k in parameters or {}}
    own = {k: v for k, v in orbit.parameters.items() if k not in names}
    ranges = parameter_ranges(system, {**own, **(parameters or {})}, numbers)
    modes = Modes(system, numbers, [i for i, (a, b) in enumerate(ranges) if a < b])
    refusal = _refusal(orbit)
    sections = [] if refusal else sections_of(orbit)
    n, constant = system.dimension, modes.graph.constant
    ends = [
        modes.end_at("section", s.position, constant(s.value), s.direction, k)
        for k, s in enumerate(sections)
    ]
    start = [s.start[i] for s in sections for i in range(n) if i != s.position]
    return OrbitInstance(orbit, sections, modes, ends, ranges, start, numbers, not names, refusal)


def _refusal(orbit: PeriodicOrbit) -> str:
    """Why no theorem covers an orbit."""
    if orbit.is_virtual:
        return f"The orbit is virtual: {orbit.faults[0]}."
    if orbit.system.time_dependent:
        return "The system depends on time."
    for i, leg in enumerate(orbit.legs):
        if set(leg.mode) - set("+-o"):
            return f"Leg {i + 1} slides or is in contact (mode {leg.mode!r}), and only crossing orbits are proven."
    if not any(leg.event for leg in orbit.legs):
        return "The orbit has no events, so no plane of a leg comes after one."
    if orbit.system.dimension < 2:
        return (
            "An orbit of one state crosses its planes in points, so nothing is left to be proven."
        )
    return ""
