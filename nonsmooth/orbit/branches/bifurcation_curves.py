"""Curves of bifurcations in two parameters, and the points of codimension two on them.

The test of the event is added to the equations of the branch, and a second parameter is free. At a fold
the Jacobian without the parameters is singular, which a bordered system measures (Griewank & Reddien 1984;
Kuznetsov 2004, sec. 10.2). The row of the test in the Jacobian is updated along the curve by secants
(Broyden 1965): it only guides Newton's method, and the accuracy is that of the test.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...flow.ensembles.progress import progress_bar
from ...model import Array, ConvergenceError, DefinitionError, OptionError, whole
from ...model.checks import positive
from ...solvers.continuation import Arc, Curve, Point, Secant, Zero, directions, trace
from ..homoclinic.homoclinic_orbits import Connection
from .branch import BranchCurve, BranchEnd, BranchEvent, check_bounds, end_of
from .homoclinic_curves import ConnectionCurve, event_of

_NAMES = {
    frozenset({"fold", "period doubling"}): "fold-flip",
    frozenset({"fold", "Neimark-Sacker"}): "fold-Neimark-Sacker",
    frozenset({"period doubling", "Neimark-Sacker"}): "flip-Neimark-Sacker",
    frozenset({"fold", "Hopf"}): "fold-Hopf",
    frozenset({"boundary equilibrium", "fold"}): "boundary saddle-node",
    frozenset({"boundary equilibrium", "Hopf"}): "boundary Hopf",
}


_DEGENERATE = (
    "two-fold",
    "a second touch",
    "touch of higher order",
    "fold with contact",
    "period doubling with contact",
    "cusp with the other sliding bifurcation",
)


@dataclass(frozen=True, eq=False)
class CodimensionTwo:
    """A point of codimension two on a curve of bifurcations.

    Attributes
    ----------
    kind : str
        Its name, such as ``"cusp"``, or the names of both events.
    values : ndarray (2,)
        Values of the two parameters.
    solution
        The equilibrium or orbit there.
    """

    kind: str
    values: Array
    solution: Any

    def __str__(self) -> str:
        return f"{self.kind} at ({self.values[0]:.10g}, {self.values[1]:.10g})"


@dataclass(frozen=True, eq=False, repr=False)
class BifurcationCurve:
    """A curve of bifurcations in the plane of two parameters.

    Attributes
    ----------
    kind : str
        Kind of the bifurcation, as in ``BranchEvent.kind``.
    parameters : tuple of two str
        Names of the two parameters.
    values : ndarray (k, 2)
        Their values along the curve.
    points : tuple of k ndarray
        Unknowns of the equations at each point.
    special : tuple of CodimensionTwo
        Points of codimension two on the curve.
    ends : tuple of two BranchEnd
        Why the curve ends at its two ends.
    curve : Curve
        The equations, from which other curves start.
    """

    kind: str
    parameters: tuple[str, str]
    values: Array
    points: tuple[Array, ...]
    special: tuple[CodimensionTwo, ...]
    ends: tuple[BranchEnd, BranchEnd]
    curve: EventCurve | ConnectionCurve

    def solution(self, k: int) -> Any:
        """Return the equilibrium or orbit at a point of the curve.

        Parameters
        ----------
        k : int
            Number of the point: a row of ``values``.
        """
        return self.curve.base.describe(self.points[k])

    def __len__(self) -> int:
        return len(self.values)

    def __str__(self) -> str:
        lines = [
            f"Curve of {self.kind} in ({', '.join(self.parameters)}), {len(self)} points, "
            f"ends {self.ends[0]} and {self.ends[1]}"
        ]
        return "\n".join([*lines, *(f"  {point}" for point in self.special)])

    def __repr__(self) -> str:
        return f"BifurcationCurve({self.kind!r}, {len(self)} points, {len(self.special)} special)"


class EventCurve(Curve):
    """The equations of a branch with two free parameters, and the test of an event."""

    exact = False
    tol = 1e-15  # steps of a secant method shrink less regularly than Newton's

    def __init__(self, base: BranchCurve, name: str, start: Array):
        self.base, self.name, self.scale = base, name, base.scale
        self.columns = len(start) - 2
        if name == "fold":
            left, _, right = np.linalg.svd(self._square(start))
            self.border = left[:, -1], right[-1]
        self.unit = abs(self.test(start + 1e-3 * base.scale * self._probe())) or 1.0
        # tests that vanish with the event, as at its image in a symmetric orbit
        tests = self.base.tests(Point(start, np.zeros(len(start))))
        self.twins = {k for k, v in tests.items() if abs(v) <= 1e-8 and k != name}
        self.secant = Secant(self._scaled_test, 1.0)

    def _scaled_test(self, v: Array) -> Array:
        return np.array([self.test(v * self.scale) / self.unit])

    def _probe(self) -> Array:
        """A generic direction."""
        return np.cos(1.0 + np.arange(self.columns + 2))

    def _square(self, u: Array) -> Array:
        """Jacobian by the unknowns without the parameters, scaled."""
        return self.base.scaled(u / self.scale)[1][:, : self.columns]

    def test(self, u: Array) -> float:
        """The function that vanishes on the curve."""
        if self.name == "fold":
            return self._bordered(u)[0]
        return float(self.base.tests(Point(u, np.zeros(u.size)))[self.name])

    def _bordered(self, u: Array) -> tuple[float, Array]:
        """The test of a fold, zero where the square Jacobian is singular, and its null vector."""
        b, c = self.border
        matrix = np.block([[self._square(u), b[:, None]], [c[None, :], np.zeros((1, 1))]])
        target = np.zeros(b.size + 1)
        target[-1] = 1.0
        solved = np.linalg.solve(matrix, target)
        return float(solved[-1]), solved[:-1]

    def equations(self, u: Array) -> tuple[Array, Array]:
        values, jacobian = self.base.equations(u)
        known = self.base.test_row(self.name, u)
        if known is not None:
            value, slope = known
            return np.append(values, value), np.vstack([jacobian, slope])
        test, row = self.secant(u / self.scale)
        return np.append(values, test), np.vstack([jacobian, row / self.scale])

    def renewed(self, point: Point) -> Point | None:
        tangent = self.base.turned(point.u, point.tangent)
        if tangent is None:
            return None
        tangent = self.along(self.scaled(point.u / self.scale)[1], tangent)[0]
        return self.point(point.u, tangent, tangent, point.arclength)

    def ends(self, name: str) -> bool:
        return self.base.ends_curve(name)

    def singular(self, name: str) -> bool:
        return self.base.singular(name)

    def tests(self, point: Point) -> Mapping[str, float]:
        """Functions that vanish at other events and at degenerate ones."""
        u = point.u
        omitted = {self.name, *self.twins}
        found = {k: v for k, v in self.base.tests(point).items() if k not in omitted}
        if self.name == "fold":
            found["cusp"] = self._quadratic(u)
        else:
            found["fold"] = float(np.linalg.det(self._square(u)))
        further = self.base.codimension_two(self.name, u)
        if "two-fold" in further:  # the event before is tangent there too
            found = {k: v for k, v in found.items() if not k.startswith("transversality")}
        return found | dict(further)

    def _quadratic(self, u: Array) -> float:
        """Quadratic coefficient of a fold, by the change of the Jacobian along its null vector."""
        null = self._bordered(u)[1]
        null = null / np.linalg.norm(null)
        step = np.zeros(u.size)
        step[: self.columns] = 1e-5 * null * self.scale[: self.columns]
        change = (self._square(u + step) - self._square(u - step)) @ null / 2e-5
        left = np.linalg.svd(self._square(u))[0][:, -1]
        return float(left @ change) * np.sign(left @ self.border[0])


def continue_bifurcation(
    event: BranchEvent | Connection,
    parameters: Sequence[str],
    *,
    bounds: Sequence[Sequence[float]],
    step: float = 0.02,
    max_points: int = 2000,
    progress: bool = False,
) -> BifurcationCurve:
    """Follow a bifurcation as two parameters vary.

    Parameters
    ----------
    event : BranchEvent or Connection
        An entry of ``Branch.events``, or a homoclinic orbit.
    parameters : two str
        Names; others keep their values at the event.
    bounds : two (low, high)
        Bounds of the parameters at which the curve ends.
    step : float, optional
        Largest step where the curve bends, relative to the widths of the bounds.
    max_points : int, optional
        Largest number of points on each side of the event.
    progress : bool, optional
        Whether to show a bar that counts points. After Ctrl-C the points computed so far are returned.

    Returns
    -------
    BifurcationCurve
        With the points of codimension two on it: a second event at the same time, cusps of folds,
        changes of the class of a boundary equilibrium, neutral saddles of homoclinic orbits.

    Raises
    ------
    DefinitionError
        No event of a branch that two parameters unfold; parameters that are not two of the system.
    OptionError
        Bounds in the wrong order, or without the event; ``step`` or ``max_points`` out of its range;
        parameters that break the symmetry by which half of an orbit is solved for.
    ConvergenceError
        The event does not solve the equations of its curve.

    Examples
    --------
    The cusp $x' = a + b x - x^3$: folds lie on $4 b^3 = 27 a^2$.

    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, a, b = (ca.SX.sym(s) for s in ("x", "y", "a", "b"))
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[a + b * x - x**3, 1 - y], below=[1, 1],
    ...                       parameters={a: -1.0, b: 0.75})
    >>> branch = ns.continue_equilibrium(s, [-1.5, 1.0], "a", bounds=(-2, 2))
    >>> curve = continue_bifurcation(branch.events[0], ("a", "b"), bounds=[(-1, 1), (-1, 1)])
    >>> bool(abs(4 * curve.values[:, 1]**3 - 27 * curve.values[:, 0]**2).max() < 1e-11)
    True
    >>> [point.kind for point in curve.special], abs(curve.special[0].values).max().round(6)
    (['cusp'], np.float64(0.0))
    """
    if isinstance(event, Connection):
        event = event_of(event)
    names, widths, limits = _checked(event, parameters, bounds)
    positive(step, "step")
    whole(max_points, "max_points", least=2)
    system = event.curve.system
    free = tuple(system.parameter_names.index(name) for name in names)
    assert event.point is not None
    base, start = event.curve.freed(event.point.u, free, widths)
    connected = isinstance(base, ConnectionCurve)  # its equations are of codimension one
    curve = base if connected else EventCurve(base, event.test, start)
    k = start.size - 2
    start = _on_curve(curve, start, event.kind)
    halves: list[Arc] = []
    tangent, bar = directions(curve, start)[0], progress_bar(None, progress, " points")
    for way in (-tangent, tangent):
        if halves and halves[0].end in ("closed", "interrupted"):
            break
        base.restart(start)
        if isinstance(curve, EventCurve):
            curve.secant.forget()
        ends = [(k + i, low, high) for i, (low, high) in enumerate(limits)]
        halves.append(
            trace(
                curve,
                [start],
                way,
                step=step,
                most=max_points,
                bounds=ends,
                report=lambda _: bar.update(),
            )
        )
    bar.close()
    points = [*reversed(halves[0].rows), *(halves[1].rows[1:] if len(halves) > 1 else ())]
    zeros = [*reversed(halves[0].zeros), *(halves[1].zeros if len(halves) > 1 else ())]
    for u in (points[0], points[-1]):
        base.require_valid(u)
    return BifurcationCurve(
        kind=event.kind,
        parameters=names,
        values=np.array([u[k:] for u in points]),
        points=tuple(points),
        special=tuple(_special(curve, zero, k, event.kind) for zero in zeros),
        ends=(end_of(halves[0]), end_of(halves[-1])),
        curve=curve,
    )


def _checked(
    event: BranchEvent, parameters: Sequence[str], bounds: Sequence[Sequence[float]]
) -> tuple[tuple[str, str], Array, list[tuple[float, float]]]:
    if not isinstance(event, BranchEvent) or event.curve is None or not event.test:
        raise DefinitionError(
            f"event={event!r} is no entry of Branch.events that two parameters unfold. Continue an "
            "equilibrium or an orbit first."
        )
    known = event.curve.system.parameter_names
    given = [parameters] if isinstance(parameters, str) else parameters
    names = [str(name) for name in given] if isinstance(given, Iterable) else []
    if len(names) != 2 or len(set(names)) != 2 or not set(names) <= set(known):
        raise DefinitionError(
            f"parameters={parameters!r} are not two names of the system's. Give two among {list(known)}."
        )
    if not isinstance(bounds, (Sequence, np.ndarray)) or len(bounds) != 2:
        raise OptionError(
            f"bounds={bounds!r} are not two pairs. Give (low, high) for each parameter."
        )
    assert event.point is not None
    values = event.curve.parameters_at(event.point.u)
    limits = [
        check_bounds(pair, float(values[known.index(name)]), name)
        for pair, name in zip(bounds, names, strict=True)
    ]
    return (names[0], names[1]), np.array([high - low for low, high in limits]), limits


def _on_curve(curve: Curve, start: Array, kind: str) -> Array:
    """The event as a point of the curve, to rounding."""
    _, jacobian = curve.scaled(start / curve.scale)
    found = curve.correct(start, np.linalg.svd(jacobian)[2][-1])
    if found is None:
        raise ConvergenceError(
            f"event: Newton's method for the curve does not converge at the {kind}. It may be of "
            "codimension two itself, or the second parameter does not unfold it: choose others.",
            point=start,
        )
    return found


def _special(curve: EventCurve | ConnectionCurve, zero: Zero, k: int, event: str) -> CodimensionTwo:
    own, other = (curve.base.named(name, zero.point.u) for name in (curve.name, zero.name))
    kind = _NAMES.get(frozenset({own, other}), other)
    if zero.name in _DEGENERATE:
        kind = f"{event} with {other}"
    elif kind == other and zero.name in curve.base.tests(zero.point):
        kind = f"{own} with {other}"
    if kind == "fold-Hopf" and curve.base.double_zero(zero.point.u):
        kind = "Bogdanov-Takens"
    try:
        solution = curve.base.describe(zero.point.u)
    except (ArithmeticError, ValueError):
        solution = None
    return CodimensionTwo(kind, zero.point.u[k:], solution)
