"""Connections: orbits that leave a pseudo-saddle along the surface and come back to it.

In the plane the unstable manifold of a pseudo-saddle on attracting sliding is the surface itself. It leads
to a visible fold, from where the orbit flies and, at one value of a parameter, lands on the pseudo-saddle
in finite time: a homoclinic orbit of codimension one with regular equations and no asymptotics. For the
legs i = 1 .. N of the flight, the fold point x_1, the pseudo-saddle P with its weight alpha and the
parameter mu,

    h(x_1) = 0,  L_i(x_1) = 0,  phi_i(x_i, T_i) = x_(i+1),  h(x_(i+1)) = 0,  phi_N(x_N, T_N) = P,
    h(P) = 0,  (1 - alpha) F1(P) + alpha F2(P) = 0.

Source: Kuznetsov, Rinaldi & Gragnani 2003, "One-parameter bifurcations in planar Filippov systems".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..flow.simulate import simulate
from ..flow.trajectory import Trajectory
from ..local.folds import find_fold
from ..local.newton import converge
from ..local.pseudo_equilibria import PseudoEquilibrium, find_pseudo_equilibrium
from ..model import (
    Array,
    ConvergenceError,
    DegenerateError,
    FilippovSystem,
    NonsmoothError,
    OptionError,
    ParameterError,
    Parameters,
    explain,
    require_system,
)
from ..model.event_maps import event_map, surface_map
from ..model.variational import variational_field
from .guards import watch
from .legs import Leg, fly, stretches
from .orbit_run import orbit_run
from .periodic import OrbitLeg, named

#: A flight that is to become homoclinic lands within this part of its size from the pseudo-saddle.
_CLOSE = 0.5


@dataclass(frozen=True, eq=False, repr=False)
class Connection:
    """A homoclinic orbit to a pseudo-saddle.

    Attributes
    ----------
    system : FilippovSystem
        The system that has the connection.
    parameter : str
        Name of the parameter that was varied.
    value : float
        Of that parameter at the connection.
    parameters : dict of str to float
        All of them there.
    pseudo_saddle : PseudoEquilibrium
        There.
    side : str
        On which the flight begins, ``"+"`` or ``"-"``.
    fold : ndarray (n,)
        Where the orbit leaves the surface.
    legs : tuple of OrbitLeg
        Of the flight.
    iterations : int
        Iterations that Newton's method took; 0 where nothing was searched.
    residual : float
        What is left of the equations at the point.
    faults : tuple of str
        What its guards contradict; empty unless it is virtual.
    """

    system: FilippovSystem
    parameter: str
    value: float
    parameters: dict[str, float]
    pseudo_saddle: PseudoEquilibrium
    side: str
    fold: Array
    legs: tuple[OrbitLeg, ...]
    iterations: int
    residual: float
    faults: tuple[str, ...] = ()

    @property
    def flight(self) -> float:
        """Time from the fold to the pseudo-saddle."""
        return float(sum(leg.duration for leg in self.legs))

    @property
    def eigenvalue(self) -> float:
        """Of the sliding flow at the pseudo-saddle: periods of nearby orbits diverge as
        -ln|mu - mu*|/eigenvalue."""
        return float(self.pseudo_saddle.eigenvalues[0].real)

    @cached_property
    def trajectory(self) -> Trajectory:
        """The flight as a run."""
        return orbit_run(self.system, self.parameters, self.legs)

    def __str__(self) -> str:
        virtual = f" (virtual: {self.faults[0]})" if self.faults else ""
        return (
            f"Homoclinic orbit to a pseudo-saddle at {self.parameter} = {self.value:.13g}{virtual}\n"
            f"  pseudo-saddle {self.pseudo_saddle.point.tolist()}, sliding eigenvalue "
            f"{self.eigenvalue:.6g}\n  leaves the surface at {self.fold.tolist()} to {self.side!r} and "
            f"lands after {self.flight:.6g}"
        )

    def __repr__(self) -> str:
        return f"Connection({self.parameter} = {self.value:.10g}, flight {self.flight:.6g})"


def find_homoclinic(
    system: FilippovSystem,
    pseudo_saddle: PseudoEquilibrium | ArrayLike,
    parameter: str,
    *,
    guess: float | None = None,
    parameters: Parameters | None = None,
    max_iterations: int = 30,
) -> Connection:
    """Find the parameter at which an orbit is homoclinic to a pseudo-saddle of a planar system.

    Parameters
    ----------
    system : FilippovSystem
        Two states, one surface, no explicit time.
    pseudo_saddle : PseudoEquilibrium or array_like (2,)
        At the guess, or a point near it.
    parameter : str
        That is varied.
    guess : float, optional
        Its value to start from; by default that of ``parameters``.
    parameters : mapping, optional
        Values that replace defaults.
    max_iterations : int, optional
        Newton's method gives up after this many.

    Returns
    -------
    Connection

    Raises
    ------
    ConvergenceError
        No visible fold from which an orbit lands near the pseudo-saddle, or Newton's method fails.
    DegenerateError
        The point is no pseudo-saddle.
    OptionError, ParameterError, PointError, DefinitionError

    Examples
    --------
    A spiral above the surface that lands where it slides to:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, c = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("c")
    >>> above = [0.1 * x - (y - 1), x + 0.1 * (y - 1)]
    >>> system = ns.FilippovSystem(
    ...     [x, y], surface=y, above=above, below=[c, 1], parameters={c: -0.6})
    >>> found = ns.find_homoclinic(system, [-1.4, 0.0], "c")
    >>> f"{found.value:.13f}", f"{found.flight:.13f}"
    ('-0.5862126010325', '5.2426089986980')
    """
    _require_planar(system)
    names = system.parameter_names
    if parameter not in names:
        raise ParameterError(
            f"parameter: expected a name among {list(names)}, received {parameter!r}."
        )
    given = {str(k): v for k, v in (parameters or {}).items()}
    if guess is not None:
        given[parameter] = guess
    p = system.parameter_vector(given)
    near = pseudo_saddle.point if isinstance(pseudo_saddle, PseudoEquilibrium) else pseudo_saddle
    saddle = find_pseudo_equilibrium(system, near, parameters=named(system, p))
    _require_saddle(saddle)
    side, legs, starts, durations = _flight(system, saddle, p)
    equations = _Equations(system, side, legs, names.index(parameter), p)
    u = equations.pack(starts, durations, saddle.point, saddle.alpha, p[equations.index])
    try:
        root = converge(equations, u, tol=1e-12, max_iterations=max_iterations)
    except ConvergenceError as error:
        raise _failed(parameter, equations, str(error)) from error
    if root is None:
        raise _failed(parameter, equations, "")
    return _connection(equations, root, parameter)


def _require_planar(system: FilippovSystem) -> None:
    require_system(system)
    if system.dimension != 2 or system.coupled or system.time_dependent or not system.surface_count:
        raise OptionError(
            explain(
                "system",
                expected="a planar autonomous one with one surface and a linear multiplier",
                received=repr(system),
                advice="In more dimensions the unstable manifold of a pseudo-saddle is no longer the "
                "surface: follow a bundle of orbits from it.",
            )
        )


def _require_saddle(saddle: PseudoEquilibrium) -> None:
    if saddle.kind != "pseudo-saddle" or saddle.status != "real":
        raise DegenerateError(
            f"pseudo_saddle: expected a real pseudo-saddle, received a {saddle}. Its orbits leave it "
            "along the surface or not at all: choose another point or parameter."
        )


def _flight(
    system: FilippovSystem, saddle: PseudoEquilibrium, p: Array
) -> tuple[str, list[Leg], list[Array], list[float]]:
    """The flight from a visible fold that lands nearest to the pseudo-saddle."""
    values, best = named(system, p), None
    told: list[str] = []
    for side in "+-":
        try:
            fold = find_fold(system, saddle.point, side=side, parameters=values)  # type: ignore[arg-type]
        except NonsmoothError as error:
            told.append(f"side {side!r}: {error}")
            continue
        if fold.kind != "visible":
            told.append(f"side {side!r}: its fold at {fold.point.tolist()} is not visible")
            continue
        size = float(np.linalg.norm(fold.point - saddle.point)) or 1.0
        for k in range(9):
            run = simulate(
                system, fold.point, 4.0**k, parameters=values, start_mode=side, tol=1e-12
            )
            if any(e.kind == "entry" for e in run.events):
                break
        flown = []
        for part in stretches(run):
            flown.append(part)
            if part.leg.kind == "entry":
                break
        if flown[-1].leg.kind != "entry":
            told.append(f"side {side!r}: the orbit of the fold does not land")
            continue
        miss = float(np.linalg.norm(flown[-1].end - saddle.point)) / size
        if miss > _CLOSE:
            told.append(
                f"side {side!r}: the orbit lands {miss:.2g} of the distance to the fold away"
            )
        elif best is None or miss < best[0]:
            starts, times = [f.start for f in flown], [f.duration for f in flown]
            best = (miss, side, [f.leg for f in flown], starts, times)
    if best is None:
        raise ConvergenceError(
            f"homoclinic orbit: expected a visible fold whose orbit lands near the pseudo-saddle "
            f"{saddle.point.tolist()}, received none ({'; '.join(told)}). Give a better guess of the "
            "parameter.",
            point=saddle.point,
        )
    return best[1:]


class _Equations:
    """The equations of a homoclinic orbit, with their Jacobian."""

    def __init__(
        self, system: FilippovSystem, side: str, legs: Sequence[Leg], index: int, p: Array
    ):
        self.system, self.side, self.legs, self.index, self.p = system, side, legs, index, p
        self.iterations, self.residual = 0, np.nan
        name = "L_F1 h" if side == "+" else "L_F2 h"
        self._fold = (surface_map(system, 0), event_map(system, "s", name))
        self._fields = [variational_field(system, mode).linear for mode in "+-"]

    def pack(
        self,
        starts: Sequence[Array],
        durations: Sequence[float],
        at: Array,
        alpha: float,
        mu: float,
    ) -> Array:
        """Unknowns: starts, durations, pseudo-saddle, alpha, parameter."""
        return np.concatenate([np.ravel(starts), durations, at, [alpha, mu]])

    def split(self, u: Array) -> tuple[Array, Array, Array, float, Array]:
        """Starts (N, n), durations (N,), pseudo-saddle (n,), alpha, all parameters."""
        count, n = len(self.legs), self.system.dimension
        p = self.p.copy()
        p[self.index] = u[-1]
        starts, rest = u[: count * n].reshape(count, n), u[count * n :]
        return starts, rest[:count], rest[count : count + n], float(rest[count + n]), p

    def __call__(self, u: Array) -> tuple[Array, Array]:
        """Values and Jacobian."""
        starts, durations, at, alpha, p = self.split(u)
        count, n, mu = len(self.legs), self.system.dimension, self.index
        values, jacobian = np.zeros(u.size), np.zeros((u.size, u.size))
        for row, condition in enumerate(self._fold):
            e = condition(starts[0], p)
            values[row], jacobian[row, :n], jacobian[row, -1] = (
                e.value,
                e.gradient,
                e.by_parameters[mu],
            )
        row, place = 2, count * (n + 1)
        for i, leg in enumerate(self.legs):
            part = fly(self.system, leg, starts[i], float(durations[i]), p, (mu,))
            own, time, rows = slice(i * n, (i + 1) * n), count * n + i, slice(row, row + n)
            last = i + 1 == count
            following = slice(place, place + n) if last else slice((i + 1) * n, (i + 2) * n)
            values[rows] = part.end - (at if last else starts[i + 1])
            jacobian[rows, own], jacobian[rows, time] = part.by_start, part.rate
            jacobian[rows, following] = -np.eye(n)
            jacobian[rows, -1] = part.by_parameters[:, 0]
            row += n
            if not last:
                e = leg.at_end(self.system, part.end, p)
                values[row] = e.value
                jacobian[row, own] = e.gradient @ part.by_start
                jacobian[row, time] = e.gradient @ part.rate
                jacobian[row, -1] = e.gradient @ part.by_parameters[:, 0] + e.by_parameters[mu]
                row += 1
        e = surface_map(self.system, 0)(at, p)
        values[row], jacobian[row, -1] = e.value, e.by_parameters[mu]
        jacobian[row, place : place + n] = e.gradient
        (f1, x1, p1), (f2, x2, p2) = (f.copied(at, p) for f in self._fields)
        rows = slice(row + 1, row + 1 + n)
        values[rows] = ((1 - alpha) * f1 + alpha * f2)[:, 0]
        jacobian[rows, place : place + n] = (1 - alpha) * x1 + alpha * x2
        jacobian[rows, place + n] = (f2 - f1)[:, 0]
        jacobian[rows, -1] = ((1 - alpha) * p1 + alpha * p2)[:, mu]
        self.iterations += 1
        self.residual = float(np.abs(values).max())
        return values, jacobian


def _failed(parameter: str, equations: _Equations, reason: str) -> ConvergenceError:
    return ConvergenceError(
        f"homoclinic orbit: expected Newton's method to converge in {parameter!r}, received none after "
        f"{equations.iterations} steps, residual {equations.residual:.2g}. {reason} Give a better guess.",
        residual=equations.residual,
    )


def _connection(equations: _Equations, u: Array, parameter: str) -> Connection:
    system = equations.system
    starts, durations, at, _, p = equations.split(u)
    values, _ = equations(u)
    legs, faults, t = list[OrbitLeg](), list[str](), 0.0
    for k, (leg, x, duration) in enumerate(zip(equations.legs, starts, durations, strict=True)):
        legs.append(OrbitLeg(leg.mode, x, t, float(duration), leg.name, leg.kind))
        t += float(duration)
        if duration <= 0.0:
            faults.append(f"leg {k + 1} ({leg.mode}) has the duration {duration:.3g}")
        else:
            seen = watch(system, leg.mode, x, float(duration), p).faults
            faults += [f"leg {k + 1} ({leg.mode}): {fault}" for fault in seen]
    saddle = find_pseudo_equilibrium(system, at, parameters=named(system, p))
    _require_saddle(saddle)
    return Connection(
        system=system,
        parameter=parameter,
        value=float(u[-1]),
        parameters=named(system, p),
        pseudo_saddle=saddle,
        side=equations.side,
        fold=starts[0],
        legs=tuple(legs),
        iterations=equations.iterations,
        residual=float(np.abs(values).max()),
        faults=tuple(faults),
    )
