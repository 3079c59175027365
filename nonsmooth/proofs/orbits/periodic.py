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

from ...flow.trajectory import Trajectory
from ...model import Array, OptionError, require_plain
from ...orbit import PeriodicOrbit
from ...orbit.periodic.orbit_run import OrbitLeg
from ..arithmetic.decimals import given
from ..arithmetic.eigenvalues import eigenvalues, numbered
from ..arithmetic.enclosure import Enclosure
from ..arithmetic.equations import Equations, column
from ..arithmetic.flint import arb, arb_mat, ctx
from ..arithmetic.intervals import Numbers, ends, radius
from ..arithmetic.krawczyk import Zero, identity
from ..proof import READ, Classification, UnprovenError, intervals, listed, paragraph
from ..record import interval, motion_of, text, zero_record
from ..surface_functions import enclosed, parameter_ranges
from .forcing import forcing_period
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
    """A plane x_k = c or t = c that a leg crosses, and the part of the orbit from there to the next plane."""

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
    passed = first = 0  # events since the last plane, and those before the first one
    for leg in orbit.legs:
        if leg.duration <= 0:
            passed += bool(leg.event)
            continue
        if orbit.system.time_dependent:
            k, direction = n, 1
            value = _short(leg.t + leg.duration / 2, leg.duration)
            state = run(value)[:n]
        else:
            k, value, direction, state = _plane(run, leg, size, n)
        if found:
            found[-1] = replace(found[-1], events=passed)
        else:
            first = passed
        passed = int(bool(leg.event))
        found.append(Section(leg.mode, k, Fraction(value), direction, state.tolist(), 0))
    return [*found[:-1], replace(found[-1], events=passed + first)]


def _short(value: float, width: float) -> float:
    """A number with few digits near another."""
    unit = 2.0 ** np.floor(np.log2(width / 4))
    return float(unit * np.round(value / unit))


def _plane(run: Trajectory, leg: OrbitLeg, size: Array, n: int) -> tuple[int, float, int, Array]:
    """A state, its value on a plane across a leg, the sign of its rate, and the point of the orbit there."""
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
    value = _short(x[at[k], k], np.ptp(x[around, k]))
    before, after = t[around][[0, -1]]
    state = run(brentq(lambda s: run(s)[k] - value, before, after, xtol=1e-15))[:n]
    return k, value, 1 if steps[0, k] > 0 else -1, state


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
        n = modes.system.extended_dimension
        self.free = [[i for i in range(n) if i != s.position] for s in sections]
        self.n, self.held = sum(map(len, self.free)), []
        self._known: dict[Any, tuple[arb_mat, arb_mat]] = {}

    def holding(self, held: list[list[Any]]) -> Shooting:
        """The same equations, as nothing is held."""
        return self

    def values(self, u: Sequence[arb]) -> arb_mat:
        """The equations as a column."""
        return self.with_jacobian(u)[0]

    def with_jacobian(self, u: Sequence[arb]) -> tuple[arb_mat, arb_mat]:
        """The equations and their Jacobian; not finite where a piece is undecided."""
        key = (ctx.prec, *map(ends, u))
        if key not in self._known:
            self._known[key] = self._evaluated(u)
        return self._known[key]

    def _evaluated(self, u: Sequence[arb]) -> tuple[arb_mat, arb_mat]:
        try:
            pieces = self.pieces(u)
        except UnprovenError:
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
        flow = OrbitEnclosure(self.modes, x, enclosed(self.ranges))
        if flow.mode != own.mode:
            raise UnprovenError(f"leg {i + 1} is in mode {flow.mode!r}, not {own.mode!r}")
        flow.end = None if own.events else self.ends[j]
        for event in flow.run(_STEPS):
            if len(flow.events) == own.events:
                flow.end = self.ends[j]
            if len(flow.events) > own.events or event.kind == "stop":
                name = event.function.name
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
    multiplicity: int = 0  # periods of the forcing
    span: int = -1  # node of its period, if there is a forcing
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
        n = range(self.orbit.system.extended_dimension)
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
        try:
            equations.pieces([arb(v) for v in self.start])
        except UnprovenError as error:
            return f"{str(error)[:1].upper()}{str(error)[1:]}."
        return (
            "Krawczyk's operator mapped no box into itself: a multiplier is 1, or the parameters "
            "are too wide."
        )

    def classification(self, equations: Any, zero: Zero) -> Classification:
        """Period, multipliers and stability."""
        pieces = equations.pieces(zero.point)
        period = sum((p.duration for p in pieces), arb(0))
        values, label = {"period": period, "multiplier1": arb(1)}, ""
        if self.multiplicity:
            values = {"period": self.multiplicity * self.modes.constant(self.span, self.parameters)}
            period = values["period"]
        away = self._distance(zero, period) if self.near else 0.0
        if away > _NEAR:
            why = f"the periodic orbit nearby is {away:.1e} of its size away from the given one"
            return Classification("", self.kind, why, applies=False, final=True)
        product = identity(len(equations.free[0]))
        for piece in pieces:
            product = piece.derivative * product
        found = eigenvalues(product)
        events = [[[e.kind, e.function.name, e.after] for e in p.events] for p in pieces]
        claims = {"label": label, "period": interval(period), "events": events}
        if found is None:  # a multiple one, perhaps
            label = "asymptotically stable" if contracts(product) else ""
            why = "" if label else "the multipliers are not proven to be apart"
            claims["label"] = label
            return Classification(label, self.kind, why, values=values, claims=claims)
        sizes = [re * re + im * im for re, im in found]
        order = sorted(range(len(found)), key=lambda k: -float(sizes[k].mid()))
        values |= numbered("multiplier", [found[j] for j in order], len(values))
        outside = sum(bool(s > 1) for s in sizes)
        if all(s < 1 for s in sizes):
            label = "asymptotically stable"
        elif outside:
            label = f"unstable, {outside} multiplier{'s' * (outside > 1)} outside the unit circle"
        if not all(s < 1 or s > 1 for s in sizes):
            label = ""
        why = "" if label else "whether a multiplier is inside of the unit circle is undecided"
        # Wider than they are, since they follow from the same matrix to fewer digits in other arithmetics.
        slack = arb(0, 2.0 ** (16 - ctx.prec) * (1 + max(float(s.upper()) for s in sizes) ** 0.5))
        wide = [[v if v.is_zero() else v + slack for v in found[j]] for j in order]
        claims |= {"label": label, "multipliers": [[interval(v) for v in pair] for pair in wide]}
        return Classification(label, self.kind, why, values=values, claims=claims)

    def _distance(self, zero: Zero, period: arb) -> float:
        """Of the proven orbit from the given one, relative to its size."""
        x = self.orbit.trajectory.x
        size = np.maximum(np.ptp(x, axis=0), _NEAR * np.maximum(1.0, np.abs(x[0])))
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
        states, m = [*self.orbit.system.state_names, "t"], len(box) // len(self.sections)
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
            f"It takes {self.multiplicity} of the forcing's periods." * (self.multiplicity > 0),
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
            "multiplicity": self.multiplicity,
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
    refusal, multiplicity, span, sections = _refusal(orbit), 0, -1, list[Section]()
    if system.time_dependent and not refusal:
        try:
            multiplicity, span = _forcing(orbit, modes, ranges)
        except UnprovenError as error:
            refusal = f"{str(error)[:1].upper()}{str(error)[1:]}."
    n, graph, ends = system.extended_dimension, modes.graph, []
    for k, s in enumerate([] if refusal else sections_of(orbit)):
        sections.append(s)
        value, timed = graph.constant(s.value), s.position == modes.clock
        if timed and not k:
            whole = graph.apply("mul", [graph.constant(multiplicity), span])
            value = graph.add(value, whole)
        ends.append(modes.end_at("plane", s.position, value, s.direction, -1 if timed else k))
    start = [s.start[i] for s in sections for i in range(n) if i != s.position]
    near = not names
    return OrbitInstance(
        *(orbit, sections, modes, ends, ranges, start, numbers, near),
        *(multiplicity, span, refusal),
    )


def _forcing(orbit: PeriodicOrbit, modes: Modes, ranges: Sequence[Any]) -> tuple[int, int]:
    """The number of the forcing's periods that an orbit takes, and the node of one."""
    span = forcing_period(modes)
    value = modes.constant(span, ranges)
    if value < 0:
        span, value = modes.graph.apply("neg", [span]), -value
    if not value > 0:
        raise UnprovenError("the period of the forcing is not finite for all of these parameters")
    ratio, share = orbit.period / float(value.mid()), radius(value) / float(value.mid())
    count = round(ratio)
    if not count or abs(ratio / count - 1) > _NEAR + 2 * share:
        raise UnprovenError(
            f"the orbit takes {ratio:.9g} of the periods of the forcing, {value.str(12)}, not a whole number; "
            'frequencies such as 0.1 and 0.3 have a rational ratio with numbers="written"'
        )
    return count, span


def _refusal(orbit: PeriodicOrbit) -> str:
    """Why no theorem covers an orbit."""
    if orbit.is_virtual:
        return f"The orbit is virtual: {orbit.faults[0]}."
    for i, leg in enumerate(orbit.legs):
        if set(leg.mode) - set("+-o"):
            return f"Leg {i + 1} slides or is in contact (mode {leg.mode!r}), and only crossing orbits are proven."
    if orbit.system.time_dependent:
        return ""
    if not any(leg.event for leg in orbit.legs):
        return "The orbit has no events, so no plane of a leg comes after one."
    if orbit.system.dimension < 2:
        return (
            "An orbit of one state crosses its planes in points, so nothing is left to be proven."
        )
    return ""
