"""Periodic orbit with multipliers, stability, margins, derivatives, and its run over one period."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...flow.names import described
from ...flow.simulate import simulate
from ...flow.trajectory import Trajectory
from ...model import Array, FilippovSystem, ParameterError, Surfaces
from ...notebook import circle, representation
from ...result_tables import ResultTable, Tabular, stacked
from ..runs.guards import violations_of_legs, watch
from ..runs.legs import Leg, integrate_leg, shown_itinerary
from .boundary_value_problem import BoundaryProblem, Evaluation, mirrored
from .multipliers import Multipliers, monodromy
from .orbit_run import OrbitLeg, orbit_leg, orbit_run


@dataclass(frozen=True)
class Margin:
    """Distance of an orbit from a change of its itinerary.

    Attributes
    ----------
    leg : int
        Its number, from 0.
    what : str
        In words.
    value : float
        In the units of what it measures; zero at the change.
    relative : float
        Relative to the period, to the size of the orbit, or to a right angle.
    t : float
        Of the event or of the nearest approach: of the forcing, or since the start of the orbit.
    """

    leg: int
    what: str
    value: float
    relative: float
    t: float


class OrbitDerivative(NamedTuple):
    """How a periodic orbit changes with a parameter.

    Attributes
    ----------
    period : float
        Derivative of the period.
    start : ndarray (n,)
        Derivative of the start of the first leg.
    starts : ndarray (N, n)
        Of all legs.
    durations : ndarray (N,)
        Derivatives of the durations of all legs.
    """

    period: float
    start: Array
    starts: Array
    durations: Array


@dataclass(frozen=True, eq=False, repr=False)
class PeriodicOrbit(Tabular):
    """A periodic orbit with a fixed itinerary.

    Attributes
    ----------
    system : FilippovSystem
        The system that has the orbit.
    parameters : dict of str to float
        Values of all parameters.
    problem : BoundaryProblem
        Its equations; with ``unknowns`` what continuation needs.
    unknowns : ndarray (m,)
        Starts and durations of the legs; with a symmetry, of the first half.
    evaluation : Evaluation
        Residual, Jacobian and the legs with their derivatives.
    iterations : int
        Newton steps that it took.
    faults : tuple of str
        Violations of guards; empty unless the orbit is virtual.
    """

    system: FilippovSystem
    parameters: dict[str, float]
    problem: BoundaryProblem
    unknowns: Array
    evaluation: Evaluation
    iterations: int
    faults: tuple[str, ...] = ()

    row: ClassVar[tuple[str, ...]] = ("period", "start", "itinerary", "stability", "multipliers")

    def _tables(self) -> dict[str, ResultTable]:
        names = self.system.state_names
        legs = stacked(self.legs, {"leg": len(self.legs)}, names)
        multipliers = ResultTable(
            {"multiplier": len(self.multipliers)}, {"value": self.multipliers}
        )
        return {**self.trajectory._tables(), "legs": legs, "multipliers": multipliers}

    # properties ---------------------------------------------------------------------------------

    @cached_property
    def parameter_vector(self) -> Array:
        """Values of all parameters."""
        return np.array([self.parameters[name] for name in self.system.parameter_names])

    @property
    def is_virtual(self) -> bool:
        """Whether guards are violated, so that no motion follows the orbit."""
        return bool(self.faults)

    @property
    def symmetric(self) -> bool:
        """Whether it was solved for as a half, which a symmetry maps to the other one."""
        return self.problem.symmetry is not None

    @property
    def period(self) -> float:
        """Duration of the whole orbit, in the system's unit of time."""
        return float(self.evaluation.durations.sum()) * (2 if self.symmetric else 1)

    @property
    def start(self) -> Array:
        """State (n,) where its first leg begins."""
        return np.asarray(self.evaluation.starts[0, : self.system.dimension])

    @cached_property
    def legs(self) -> tuple[OrbitLeg, ...]:
        """Legs of the whole orbit, in order."""
        return self._legs_of(self.problem, self.evaluation)

    def _legs_of(self, problem: BoundaryProblem, at: Evaluation) -> tuple[OrbitLeg, ...]:
        n, result = self.system.dimension, list[OrbitLeg]()
        t = float(at.starts[0, n]) if self.system.time_dependent else 0.0
        flips = (None, self.problem.symmetry) if self.symmetric else (None,)
        for flip in flips:
            for leg, x, duration in zip(problem.legs, at.starts, at.durations, strict=True):
                start = x[:n]
                if flip is not None:
                    start = flip @ start
                    mode = mirrored_mode(self, leg, x, float(duration))
                    leg = replace(mirrored(self.problem, leg), mode=mode)
                result.append(orbit_leg(self.system, leg, start, t, float(duration)))
                t += float(duration)
        return tuple(result)

    @property
    def itinerary(self) -> str:
        """Modes of the whole orbit in order, separated by blanks."""
        n, count = self.system.dimension, len(self.system.definition.discrete)
        values = [tuple(leg.start[n - count :].tolist()) for leg in self.legs]
        legs = [
            Leg(leg.mode, leg.kind, discrete=own)
            for leg, own in zip(self.legs, values, strict=True)
        ]
        return shown_itinerary(self.system, legs)

    @cached_property
    def trajectory(self) -> Trajectory:
        """One period as a run, with dense output."""
        at = self.evaluation.parts or self.evaluation
        legs, ends = self._legs_of(self.problem.of_parts, at), at.flows.end[:, : len(self.start)]
        return orbit_run(self.system, self.parameters, legs, ends)

    # stability ----------------------------------------------------------------------------------

    @cached_property
    def floquet(self) -> Multipliers:
        """Multipliers with their logarithms and structure."""
        return Multipliers(self.problem, self.evaluation, self.parameter_vector)

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """Floquet multipliers, (n,), the structural ones exact.

        Of an autonomous system with the 1 of the flow, first; then by size. Of a forced one those of
        the stroboscopic map: the 1 of the time is left out. NaN where an event is grazed, so that the
        return map has no derivative; ``stability`` says which.
        """
        rest = self.floquet.values
        return rest if self.system.time_dependent else np.concatenate([[1.0 + 0.0j], rest])

    @property
    def half_multipliers(self) -> NDArray[np.complex128]:
        """Multipliers of the map of the legs that were solved for.

        Of an orbit with a symmetry these are those of half the orbit, mapped back by it; otherwise
        ``multipliers``.
        """
        return self.floquet.of_map

    @property
    def monodromy(self) -> Array:
        """Derivative of the flow over one period by the start, (n, n); with the time if there is forcing."""
        matrix = monodromy(self.problem, self.evaluation)
        return matrix @ matrix if self.symmetric else matrix

    @property
    def structural(self) -> tuple[str, ...]:
        """Which multipliers are known exactly, and why, in words."""
        of = "the time" if self.system.time_dependent else "the flow"
        result = [f"1: along {of}"]
        if self.floquet.zeros:
            result.append(f"0 ({self.floquet.zeros} times): directions lost by sliding or resets")
        return tuple(result)

    @property
    def error_estimate(self) -> float:
        """Error of the multipliers, estimated; relative to those outside of the unit circle."""
        return self.floquet.error

    @property
    def stability(self) -> str:
        """Stability in words, such as ``"asymptotically stable"``."""
        return self.floquet.stability

    @property
    def residual(self) -> float:
        """Largest residual of the equations that were solved."""
        return float(np.abs(self.evaluation.residual).max())

    # derivatives and margins ---------------------------------------------------------------------------------

    def derivative(self, parameter: str) -> OrbitDerivative:
        """Derivatives of the orbit by a parameter.

        Parameters
        ----------
        parameter : str
            Its name.

        Raises
        ------
        ParameterError
            Unknown name.
        """
        names = self.system.parameter_names
        if parameter not in names:
            raise ParameterError(
                f"parameter: expected a name among {list(names)}, received {parameter!r}."
            )
        at = self.problem.evaluate(self.unknowns, self.parameter_vector, (names.index(parameter),))
        change = -self.problem.solve(at.jacobian, at.by_parameters[:, 0])
        starts, durations = self.problem.split(change)
        n = self.system.dimension
        period = float(durations.sum()) * (2 if self.symmetric else 1)
        return OrbitDerivative(period, starts[0, :n], starts[:, :n], durations)

    @cached_property
    def margins(self) -> tuple[Margin, ...]:
        """Distances from changes of the itinerary, the nearest first."""
        return tuple(sorted(_margins(self), key=lambda m: abs(m.relative)))

    def __str__(self) -> str:
        kind = "Virtual periodic orbit" if self.is_virtual else "Periodic orbit"
        modes = self.itinerary
        shown = modes if len(modes) <= 40 else modes[:36] + " ..."
        odd = ", found as a half by its symmetry" if self.symmetric else ""
        lines = [
            f"{kind} of period {self.period:.13g}, itinerary {shown!r} "
            f"({len(self.legs)} leg{'s' * (len(self.legs) != 1)}{odd}), {self.stability}",
            f"  multipliers {', '.join(_number(m) for m in self.multipliers)}"
            f" (structural ones are exact; the estimated error is {self.error_estimate:.1e})",
        ]
        if self.floquet.repeats:
            lines.append("  the multiplier 1 twice: one of a family of orbits, or at a fold")
        if self.margins:
            near = self.margins[0]
            lines.append(f"  nearest change: leg {near.leg + 1} {near.what} {near.value:.6g}")
        lines += [f"  virtual: {fault}" for fault in self.faults]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Notebook representation: period, itinerary and multipliers."""
        rows = (
            ("period", f"{self.period:.12g}"),
            ("itinerary", self.itinerary),
            ("stability", self.stability),
            ("multipliers", ", ".join(_number(m) for m in self.multipliers)),
            ("virtual", "; ".join(self.faults)),
        )
        return representation("PeriodicOrbit", rows, circle(self.multipliers))

    def __repr__(self) -> str:
        return f"PeriodicOrbit(period {self.period:.10g}, {len(self.legs)} legs, {self.stability})"


def _number(m: complex) -> str:
    if not m.imag:
        return f"{m.real:.12g}"
    return f"{m.real:.12g}{m.imag:+.12g}i"


def mirrored_mode(orbit: PeriodicOrbit, leg: Leg, x: Array, duration: float) -> str:
    """The mode of a leg's mirror image."""
    system, p = orbit.system, orbit.parameter_vector
    mode, n = leg.mode, system.extended_dimension
    middle = integrate_leg(system, leg, x, 0.5 * duration, p).end[:n]
    surfaces = Surfaces(system)
    image = orbit.problem.wrap @ middle
    if system.time_dependent:
        image[-1] += orbit.problem.advance(p)[0]
    h, gradient = surfaces.values(image, p)
    letters = ""
    for k, (i, *more) in enumerate(system.entries):
        near = abs(h[i]) <= 1e-10 * float(np.abs(gradient[i]) @ (1e-3 + np.abs(image)))
        letters += mode[k] if more else "s" if near else "+" if h[i] > 0 else "-"
    return letters + mode[len(system.entries) :]


def violations_of(problem: BoundaryProblem, at: Evaluation, p: Array) -> list[str]:
    """Violations of guards along a solution, leg by leg."""
    speeds = (at.flows.gradient * at.flows.rate).sum(axis=1)
    closes = problem.symmetry is None
    found = violations_of_legs(
        problem.system, problem.legs, at.starts, at.durations, speeds, p, closes
    )
    return found if found or problem.system.definition.plain else _violation_of_run(problem, at, p)


def _violation_of_run(problem: BoundaryProblem, at: Evaluation, p: Array) -> list[str]:
    """Whether the motion, with all conditions of events, has the events of the legs."""
    system, legs = problem.system, problem.legs
    if problem.symmetry is not None or any(leg.timed or leg.repeats for leg in legs):
        return []
    half, n = 0.5 * float(at.durations[0]), system.dimension
    start = integrate_leg(system, legs[0], at.starts[0], half, p).end
    t = float(start[n]) if system.time_dependent else 0.0
    run = simulate(
        system, start[:n], t + float(at.durations.sum()), t_start=t, parameters=named(system, p)
    )
    found = [event.name for event in run.events if event.kind != "end"]
    target = [one.name(system) for leg in legs for one in (leg, *leg.further)]
    if found == target:
        return []
    return [f"a run from the middle of leg 1 has the events {found} instead of {target}"]


def _margins(orbit: PeriodicOrbit) -> list[Margin]:
    problem, at, p = orbit.problem, orbit.evaluation, orbit.parameter_vector
    inside = None if np.any(at.starts[:, : orbit.system.dimension]) else p
    size = problem.scales(orbit.unknowns, inside)[: problem.dimension]  # units do not matter
    result: list[Margin] = []
    for i, leg in enumerate(problem.legs):
        duration, begins = float(at.durations[i]), orbit.legs[i].t
        ends = begins + duration
        verb = "slides" if "s" in leg.mode else "lasts"
        if not leg.timed:
            result.append(Margin(i, f"{verb} for", duration, duration / orbit.period, ends))
            gradient, rate = at.events[i].gradient[: size.size], at.by_leg[i].rate[: size.size]
            length = float(np.linalg.norm(gradient * size) * np.linalg.norm(rate / size)) or 1.0
            name = leg.name(problem.system)
            angle = float(at.events[i].gradient @ at.by_leg[i].rate) / length
            result.append(Margin(i, f"meets {name} at the angle", angle, angle, ends))
        if duration <= 0.0 or leg.repeats:
            continue
        for near in watch(problem.system, leg, at.starts[i], duration, p).approaches:
            what = f"keeps {described(problem.system, near.guard)} at its nearest by"
            relative = near.distance / float(np.abs(size[: orbit.system.dimension]).max())
            result.append(Margin(i, what, near.distance, relative, begins + near.t))
    return result


def named(system: FilippovSystem, values: Array) -> dict[str, float]:
    """Parameters by name."""
    return dict(zip(system.parameter_names, np.asarray(values).tolist(), strict=True))


__all__ = ["Margin", "OrbitDerivative", "OrbitLeg", "PeriodicOrbit", "named", "violations_of"]
