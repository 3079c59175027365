"""Homoclinic orbits as two parameters vary, and at the ends of branches of periodic orbits."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...local import Equilibrium, PseudoEquilibrium
from ...model import Array, DefinitionError, NonsmoothError
from ...solvers.continuation import Point
from ..homoclinic.homoclinic_orbits import (
    Connection,
    by_projections,
    connection_of,
    find_homoclinic,
    in_parts,
    saddle_at,
)
from ..homoclinic.loops import NEAR, Loop, spectrum_of
from ..periodic.boundary_value_problem import BoundaryProblem
from ..periodic.orbit import PeriodicOrbit
from ..runs.legs import Leg, integrate_leg
from .branch import BranchCurve, BranchEvent, FarSide

#: Largest distance of the parameters of a periodic and a homoclinic orbit, relative to the bounds.
_SAME = 0.05

#: Distance of an orbit from a saddle, relative to its size, at which it is close to a homoclinic orbit.
_PASSES = 1e-3


class ConnectionCurve(BranchCurve):
    """A homoclinic orbit with one free parameter, or a curve of them with two."""

    parameter = None
    branching = False
    name = "homoclinic"

    def __init__(self, loop: Loop, u: Array):
        self.loop, self.system, self.free = loop, loop.system, loop.free
        self.scale = loop.scales(u)
        self.scale[: loop.chained] *= len(loop.legs)  # many parts of one orbit move as one

    @property
    def base(self) -> ConnectionCurve:
        """Itself: no further test is added to its equations."""
        return self

    def parameters_at(self, u: Array) -> Array:
        return self.loop.parameters_at(u)

    def freed(self, u: Array, free: tuple[int, ...], widths: Array) -> tuple[BranchCurve, Array]:
        p, k = self.parameters_at(u), u.size - len(self.free)
        start = np.append(u[:k], p[list(free)])
        curve = ConnectionCurve(self.loop.with_free(free, p), start)
        curve.scale = np.append(curve.scale[:k], widths)
        return curve, start

    def equations(self, u: Array) -> tuple[Array, Array]:
        with np.errstate(all="ignore"):  # a trial may diverge
            return self.loop.equations(u)

    def ends(self, name: str) -> bool:
        return name.startswith("boundary equilibrium")

    def tests(self, point: Point) -> Mapping[str, float]:
        return {k: v for k, v in self.loop.tests(point.u).items() if np.isfinite(v)}

    def describe(self, u: Array) -> Connection:
        return connection_of(self.loop, u, self.system.parameter_names[self.free[-1]])


def event_of(connection: Connection) -> BranchEvent:
    """A connection as an event that two parameters unfold."""
    u = connection.unknowns
    curve = ConnectionCurve(connection.loop, u)
    quantity = connection.saddle_quantity
    verdict = "the period diverges"
    if np.isfinite(quantity):
        verdict += f"; saddle quantity {quantity:.4g}"
    point = Point(u, np.zeros(u.size))
    return BranchEvent(
        "homoclinic",
        connection.value,
        connection,
        FarSide("", verdict),
        curve=curve,
        point=point,
        test="homoclinic",
    )


def boundary_homoclinic(
    problem: BoundaryProblem,
    u: Array,
    p: Array,
    free: tuple[int, ...],
    leg: int,
    touch: float,
    surface: int,
) -> Connection | None:
    """The homoclinic orbit to a saddle on a surface, beside a long orbit whose leg touches the surface there; None if
    there is none."""
    system, n, (starts, durations) = problem.system, problem.dimension, problem.split(u)
    whole = [(*one, False) for one in zip(problem.legs, starts, durations.tolist(), strict=True)]
    own, x, duration, _ = whole[leg]
    flow = lambda x, t: integrate_leg(system, own, x, t, p).end[:n]
    y, smooth = flow(x, touch), len(whole) == 1 and own.timed
    if smooth:  # it begins anywhere
        x, touch = flow(y, duration / 2.0), duration / 2.0
    try:
        here = spectrum_of(system, own.mode, y, p)
        after, before = (np.linspace(0.0, end, 401)[1:] for end in (duration - touch, touch))
        out, back = (
            np.array([flow(z, t) - here.point for t in ts]) for z, ts in ((y, after), (x, before))
        )
        far = [np.linalg.norm(each, axis=1) for each in (out, back)]
        size = float(max(each.max() for each in far))
        middle = np.log(np.linalg.norm(y - here.point) * size) / 2.0
        i, j = (int(np.argmin(np.abs(np.log(each) - middle))) for each in far)
        away = here.unstable @ (here.left_unstable @ out[i])
        length, near = float(np.linalg.norm(away)), NEAR * size
        beside = here.point + near / length * away
        parts = [
            (own, beside, float(np.log(length / near)) / here.leading(False), True),
            (own, here.point + out[i], float(duration - touch - after[i]), smooth),
            *whole[leg + 1 :],
            *whole[:leg],
            (Leg(own.mode), x, float(before[j]), False),
        ]
        start = in_parts(system, parts, p, here, float(far[1][j]), size)
        return by_projections(system, own.mode, start, p, free, surface=surface)
    except (NonsmoothError, np.linalg.LinAlgError, ValueError):
        return None


def homoclinic_end(orbit: PeriodicOrbit, parameter: str, width: float) -> BranchEvent | None:
    """The homoclinic orbit that a long periodic orbit is close to; None if none is found."""
    given = orbit.parameters
    try:
        saddle = _saddle_beside(orbit)[0]
        found = find_homoclinic(orbit.system, saddle, parameter, parameters=given)
    except NonsmoothError:
        return None
    return event_of(found) if abs(found.value - given[parameter]) < _SAME * width else None


def passed_saddle(orbit: PeriodicOrbit, size: float) -> str:
    """That an orbit of a size passes close to a saddle, as beside a homoclinic orbit; empty if it does not."""
    try:
        saddle, near = _saddle_beside(orbit)
    except NonsmoothError:
        return ""
    if not near < _PASSES * size:
        return ""
    return f"The orbit passes within {near:.1e} of the saddle {saddle.point.tolist()}."


def _saddle_beside(orbit: PeriodicOrbit) -> tuple[Equilibrium | PseudoEquilibrium, float]:
    """The saddle next to the slowest point of an orbit, and its distance from there."""
    system, p, best, near = orbit.system, orbit.parameter_vector, np.inf, orbit.start
    if system.time_dependent or system.coupled or system.surface_count > 1:
        raise DefinitionError(
            "system: such saddles have no homoclinic orbits that are searched for."
        )
    n = system.dimension
    for leg, x, duration in zip(
        orbit.problem.legs, orbit.evaluation.starts, orbit.evaluation.durations, strict=True
    ):
        for part in np.linspace(0.0, 1.0, 41):
            flow = integrate_leg(system, leg, x, float(part * duration), p)
            speed = float(np.linalg.norm(flow.rate[:n]))
            if speed < best:
                best, near = speed, flow.end[:n]
    saddle = saddle_at(system, near, p)[1]
    return saddle, float(np.abs(saddle.point - near).max())
