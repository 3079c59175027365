"""Equilibria and pseudo-equilibria as a parameter varies, through the bifurcations that join them.

An equilibrium of F_k solves F_k(x, p) = 0; where h = 0 on the branch it is a boundary equilibrium,
beyond which a branch of pseudo-equilibria continues it: (1 - alpha) F1 + alpha F2 = 0 with h = 0,
which begins with alpha = 0 (of F1) or 1 (of F2). On the other side of the parameter this is
persistence, on the same side a nonsmooth fold (di Bernardo, Budd, Champneys & Kowalczyk 2008,
ch. 5; Kuznetsov, Rinaldi & Gragnani 2003).
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...local.checks import parameter_index, require_autonomous, require_linear
from ...local.classify import classify
from ...local.discrete_states import with_discrete_states_held
from ...local.point.surface_point import SIDES, LocalSurface, Side, side_index, surface_at
from ...local.read_only import ReadOnly
from ...local.searches.boundary_equilibria import boundary_equilibrium_at
from ...local.searches.equilibria import (
    Equilibrium,
    by_real_part,
    equilibrium_at,
    find_equilibrium,
    needs_mode,
)
from ...local.searches.pseudo_equilibria import (
    PseudoEquilibrium,
    find_pseudo_equilibrium,
    pseudo_equilibrium_at,
    sliding_matrix,
)
from ...local.searches.search import Found
from ...model import Array, FilippovSystem, NonsmoothError, Parameters, require_system, whole
from ...model.checks import positive
from ...solvers.continuation import Departure, Point, Zero, depart
from .branch import Branch, BranchCurve, BranchEvent, FarSide, check_bounds, follow_branch
from .normal_forms import hopf_coefficient

#: Length of the first step from a boundary equilibrium.
START = 1e-4

#: A switching function or weight below minus this is that of a virtual equilibrium.
VIRTUAL = 1e-9

#: The test of a boundary equilibrium that changes its class.
_TURNS = "persistence turns into nonsmooth fold"

#: Relative error of a state.
_ROUNDING = 1e-13


#: The solutions that meet at a boundary equilibrium, and the one that continues the branch, by the class of the surface.
_MEETS = {
    "generic": ("equilibrium and pseudo-equilibrium", "pseudo-equilibrium"),
    "smooth": ("the equilibria of both sides", "equilibrium"),
    "velocity continuous": ("equilibrium and rest between the two forces", "rest"),
    "undecided": ("equilibrium and pseudo-equilibrium", ""),
}


class Equilibria(BranchCurve):
    """Equations and events common to equilibria and pseudo-equilibria."""

    def __init__(self, where: LocalSurface, free: tuple[int, ...], scale: Array):
        self.where, self.free, self.scale = where, free, scale
        self.system, self.n = where.system, where.system.dimension

    def local_surface(self, u: Array) -> LocalSurface:
        """The surface with the parameters of a point."""
        return replace(self.where, parameters=self.parameters_at(u))

    def parameters_at(self, u: Array) -> Array:
        p = self.where.parameters.copy()
        p[list(self.free)] = u[-len(self.free) :]
        return p

    def freed(self, u: Array, free: tuple[int, ...], widths: Array) -> tuple[BranchCurve, Array]:
        here, k = self.local_surface(u), u.size - len(self.free)
        curve = copy(self)
        curve.where, curve.free = here, free
        curve.scale = np.append(self.scale[:k], widths)
        return curve, np.append(u[:k], here.parameters[list(free)])

    def eigenvalues(self, u: Array) -> NDArray[Any]:
        raise NotImplementedError

    def mode_at(self, u: Array) -> str:
        """The mode whose field vanishes."""
        raise NotImplementedError

    def lyapunov(self, u: Array, frequency: float) -> float:
        """The first Lyapunov coefficient; NaN where the field is not explicit."""
        x, p = u[: self.n], self.parameters_at(u)
        try:
            return hopf_coefficient(self.system, self.mode_at(u), x, p, frequency)
        except (NonsmoothError, np.linalg.LinAlgError):
            return float("nan")

    def _vague(self, u: Array, frequency: float, value: float) -> float:
        """Error of the first Lyapunov coefficient, by a state that differs by rounding."""
        beside = u.copy()
        beside[: self.n] += _ROUNDING * self.scale[: self.n] * np.cos(np.arange(self.n))
        return abs(self.lyapunov(beside, frequency) - value)

    def bautin(self, u: Array) -> Mapping[str, float]:
        """The first Lyapunov coefficient, which vanishes at a Bautin point on a curve of Hopf points."""
        values = self.eigenvalues(u)
        frequency = float(abs(values[_critical_pair(values)[0]].imag))
        value = self.lyapunov(u, frequency) if frequency else np.nan
        return {"Bautin": value} if np.isfinite(value) else {}

    def occurs(self, test: str, u: Array) -> bool:
        """Not a Hopf point at a neutral saddle, where two real eigenvalues have the sum 0."""
        if test != "Hopf":
            return True
        values = self.eigenvalues(u)
        return bool(values[_critical_pair(values)[0]].imag != 0.0) or self.double_zero(u)

    def double_zero(self, u: Array) -> bool:
        sizes = np.sort(np.abs(self.eigenvalues(u)))
        # a double zero is known to the square root of rounding
        return sizes.size > 1 and bool(sizes[1] < 1e-4 * max(1.0, sizes[-1]))

    def hopf(self, u: Array) -> float:
        """Product of the sums of pairs of eigenvalues: zero at a Hopf point or neutral saddle."""
        values = self.eigenvalues(u)
        k, l = np.triu_indices(values.size, 1)
        return float(np.prod(values[k] + values[l]).real)

    def described(self, zero: Zero, kind: str, **more: Any) -> BranchEvent:
        u = zero.point.u
        return BranchEvent(
            kind,
            self.value(u),
            self.describe(u),
            curve=self,
            point=zero.point,
            test=zero.name,
            **more,
        )

    def smooth_event(self, zero: Zero, fold: str) -> BranchEvent | None:
        """Fold, branch point or Hopf point."""
        u = zero.point.u
        if zero.name == "fold":
            return self.described(zero, fold, far_side=FarSide("", "two branches meet and end"))
        if zero.name == "branch point":
            return self.described(zero, "branch point", far_side=FarSide("", "branches cross"))
        values = self.eigenvalues(u)
        pair = _critical_pair(values)
        frequency = float(abs(values[pair[0]].imag))
        if frequency == 0.0:
            return None  # a neutral saddle
        numbers = {"frequency": frequency}
        value = self.lyapunov(u, frequency)
        verdict = "a pair of eigenvalues crosses the imaginary axis"
        if np.isfinite(value):
            numbers["first Lyapunov coefficient"] = value
            rest = np.delete(values, pair)
            stable = value < 0.0 and bool(np.all(rest.real < 0.0))
            kind = "supercritical" if value < 0.0 else "subcritical"
            if abs(value) <= 10.0 * self._vague(u, frequency, value):
                verdict += ": degenerate to rounding"
            else:
                verdict += f": orbits branch off ({kind}{', stable' if stable else ''})"
        side = FarSide("", verdict, ReadOnly(numbers))
        return self.described(zero, "Hopf", far_side=side, coefficients=ReadOnly(numbers))

    def boundary(self, zero: Zero, k: int) -> BranchEvent:
        """The boundary equilibrium of F1 (k = 0) or F2 (k = 1) on this curve."""
        x, here = zero.point.u[: self.n], self.local_surface(zero.point.u)
        numbers = here.finite_at(x)
        switching = here.switching
        found = boundary_equilibrium_at(here, numbers, k, here.jacobians(x))
        jumps = switching.slides or switching.force_jumps
        pair, onward = _MEETS[switching.kind if jumps else "smooth"]
        if isinstance(self, _PseudoEquilibriumCurve):
            onward = "equilibrium"
        verdict = {
            "persistence": "persistence: one continues the other",
            "nonsmooth fold": f"nonsmooth fold: {pair} annihilate",
        }.get(found.unfolding, "degenerate")
        side = FarSide(onward, verdict, found.numbers)
        event = self.described(zero, "boundary equilibrium", far_side=side)
        return replace(event, solution=found)

    def boundary_numbers(self, u: Array, k: int) -> Mapping[str, float]:
        """Functions that vanish where a boundary equilibrium of F1 (k = 0) or F2 (k = 1) changes class."""
        x, here = u[: self.n], self.local_surface(u)
        numbers, switching, both = here.finite_at(x), here.switching, here.jacobians(x)
        a, other, sign = both[k], numbers.fields[1 - k], 1.0 - 2.0 * k
        bordered = np.block([[a, other[:, None]], [numbers.gradient[None, :], np.zeros((1, 1))]])
        values = by_real_part(a)
        i, j = np.triu_indices(self.n, 1)
        vanishes = not (switching.slides or switching.force_jumps)  # the other field too
        change = np.linalg.det(both[1 - k]) if vanishes else -sign * np.linalg.det(bordered)
        found = {_TURNS: float(change), "fold": float(np.linalg.det(a))}
        if switching.slides:
            found["the other field is tangent"] = sign * float(numbers.gradient @ other)
        if self.n > 1:
            found["Hopf"] = float(np.prod(values[i] + values[j]).real)
        return found


class EquilibriumCurve(Equilibria):
    """F_k(x, p) = 0 in the unknowns (x, p), for continuation."""

    def __init__(self, where: LocalSurface, free: tuple[int, ...], scale: Array, side: Side):
        super().__init__(where, free, scale)
        self.side, self.k = side, side_index(side)

    def mode_at(self, u: Array) -> str:
        return self.where.side(self.side)

    def equations(self, u: Array) -> tuple[Array, Array]:
        here, x = self.local_surface(u), u[: self.n]
        by_parameter = here.parameter_derivatives(x)[1][self.k][:, list(self.free)]
        return here.at(x).fields[self.k], np.column_stack([here.jacobians(x)[self.k], by_parameter])

    def eigenvalues(self, u: Array) -> NDArray[Any]:
        return by_real_part(self.local_surface(u).jacobians(u[: self.n])[self.k])

    def tests(self, point: Point) -> Mapping[str, float]:
        found = dict[str, float]()
        if self.where.mode:
            switches = self.local_surface(point.u).switches(point.u[: self.n])
            found = {self._boundary_of(j): float(h) for j, h in enumerate(switches)}
        if self.n > 1:
            found["Hopf"] = self.hopf(point.u)
        return found

    def codimension_two(self, name: str, u: Array, touch: float | None) -> Mapping[str, float]:
        if name == "Hopf":
            return self.bautin(u)
        return self.boundary_numbers(u, self.k) if name == "boundary equilibrium" else {}

    def faults(self, u: Array) -> list[str]:
        mode, h = self.mode_at(u), self.local_surface(u).switches(u[: self.n])
        signs = [1.0 if letter == "+" else -1.0 for letter in mode]
        return [self._boundary_of(j) for j, s in enumerate(signs) if s * h[j] < -VIRTUAL]

    def _boundary_of(self, surface: int) -> str:
        own = "boundary equilibrium"
        return own if surface == self.where.surface else f"{own} of surface {surface}"

    def _on(self, name: str) -> EquilibriumCurve:
        """The same curve with respect to the surface of a test."""
        j = next((j for j in self.where.others if self._boundary_of(j) == name), None)
        if j is None:
            return self
        mode = self.where.side(self.side)
        curve, side = copy(self), SIDES["+-".index(mode[j])]
        curve.where = replace(self.where, surface=j, mode=mode[:j] + "s" + mode[j + 1 :])
        curve.side, curve.k = side, side_index(side)
        return curve

    def ends(self, name: str) -> bool:
        return name.startswith("boundary equilibrium")

    def entered(self, start: Array) -> Departure | None:
        """Leave a boundary equilibrium to the field's own side."""
        here, x, own = self.local_surface(start), start[: self.n], 1.0 - 2.0 * self.k
        dh = here.parameter_derivatives(x)[0][list(self.free)]
        return _leave(self, start, own * np.append(here.at(x).gradient, dh))

    def describe(self, u: Array) -> Equilibrium:
        return equilibrium_at(self.local_surface(u), Found(u[: self.n]), self.side)

    def event(self, zero: Zero) -> BranchEvent | None:
        if self.ends(zero.name):
            curve = self._on(zero.name)
            event = curve.boundary(zero, curve.k)
            return replace(event, curve=curve, test="boundary equilibrium")
        return self.smooth_event(zero, "fold")

    def onward(self, event: BranchEvent, zero: Zero) -> Departure | None:
        """Pseudo-equilibria with 0 < alpha < 1, or where the field is continuous equilibria on the other side."""
        x, value, near = zero.point.u[: self.n], zero.point.u[-1], self._on(zero.name)
        switching = near.local_surface(zero.point.u).switching
        if not (switching.slides or switching.force_jumps):
            beyond = EquilibriumCurve(near.where, self.free, self.scale, SIDES[1 - near.k])
            return beyond.entered(zero.point.u)
        if switching.kind == "undecided":
            return None
        scale = np.append(self.scale[: self.n], [1.0, self.scale[-1]])
        of = _RestCurve if switching.force_jumps else _PseudoEquilibriumCurve
        curve = of(near.where, self.free, scale)
        return _leave(curve, np.concatenate([x, [float(near.k), value]]), 1.0 - 2.0 * near.k)


#: Tests at which the weight of one field vanishes, and the weight alpha of F2 there.
_ALPHA = {"alpha = 0": 0, "alpha = 1": 1}


_PSEUDO = {"fold": "pseudo-saddle-node"}


class _PseudoEquilibriumCurve(Equilibria):
    """h = 0 and (1 - alpha) F1 + alpha F2 = 0 in the unknowns (x, alpha, p), for continuation."""

    def mode_at(self, u: Array) -> str:
        return self.where.mode

    def named(self, test: str, u: Array) -> str:
        return "boundary equilibrium" if test in _ALPHA else _PSEUDO.get(test, test)

    def equations(self, u: Array) -> tuple[Array, Array]:
        n, here, x, a = self.n, self.local_surface(u), u[: self.n], u[self.n]
        at, (d1, d2) = here.at(x), here.jacobians(x)
        dh, df = here.parameter_derivatives(x)
        f1, f2 = at.fields
        matrix, free = np.zeros((n + 1, u.size)), list(self.free)
        matrix[:n, :n] = (1 - a) * d1 + a * d2
        matrix[:n, n] = f2 - f1
        matrix[:n, n + 1 :] = ((1 - a) * df[0] + a * df[1])[:, free]
        matrix[n, :n], matrix[n, n + 1 :] = at.gradient, dh[free]
        return np.append((1 - a) * f1 + a * f2, at.h), matrix

    def eigenvalues(self, u: Array) -> NDArray[Any]:
        here, x = self.local_surface(u), u[: self.n]
        return by_real_part(sliding_matrix(here.at(x), here.jacobians(x))[0])

    def tests(self, point: Point) -> Mapping[str, float]:
        u = point.u
        numbers = self.local_surface(u).at(u[: self.n])
        found = {"alpha = 0": u[self.n], "alpha = 1": 1 - u[self.n]}
        switches = self.local_surface(u).switches(u[: self.n])
        found.update({name: float(switches[j]) for name, j in self._surfaces.items()})
        found["two-fold"] = float(numbers.lie[1] - numbers.lie[0])
        if self.n > 2 and found["two-fold"] != 0:
            found["Hopf"] = self.hopf(u)
        return found

    def codimension_two(self, name: str, u: Array, touch: float | None) -> Mapping[str, float]:
        if name == "Hopf":
            return self.bautin(u)
        return self.boundary_numbers(u, _ALPHA[name]) if name in _ALPHA else {}

    def faults(self, u: Array) -> list[str]:
        tests, mode = self.tests(Point(u, np.zeros(u.size))), self.where.mode
        signs = {name: -1.0 if mode[j] == "-" else 1.0 for name, j in self._surfaces.items()}
        signs |= dict.fromkeys(_ALPHA, 1.0)
        return [name for name, sign in signs.items() if sign * tests[name] < -VIRTUAL]

    @property
    def _surfaces(self) -> dict[str, int]:
        """Other surfaces by the names of their tests."""
        return {f"intersection {j}": j for j in self.where.others}

    def ends(self, name: str) -> bool:
        return name in _ALPHA or name in self._surfaces

    def describe(self, u: Array) -> Any:
        return pseudo_equilibrium_at(self.local_surface(u), Found(u[: self.n]))

    def event(self, zero: Zero) -> BranchEvent | None:
        if zero.name in _ALPHA:
            return self.boundary(zero, _ALPHA[zero.name])
        if zero.name in self._surfaces:
            verdict = f"it reaches surface {self._surfaces[zero.name]}: not followed onto the intersection"
            return self.described(zero, "intersection", far_side=FarSide("", verdict))
        if zero.name == "two-fold":
            numbers = self.local_surface(zero.point.u).at(zero.point.u[: self.n])
            side = FarSide("", "sliding changes between attracting and repelling")
            event = BranchEvent("two-fold", self.value(zero.point.u), numbers.x, side)
            return replace(event, curve=self, point=zero.point, test=zero.name)
        return self.smooth_event(zero, _PSEUDO["fold"])

    def onward(self, event: BranchEvent, zero: Zero) -> Departure | None:
        """Equilibria of the field whose weight is one, on that field's own side."""
        if zero.name not in _ALPHA:
            return None
        k, u = _ALPHA[zero.name], zero.point.u
        scale = np.append(self.scale[: self.n], self.scale[-1])
        curve = EquilibriumCurve(self.where, self.free, scale, SIDES[k])
        return curve.entered(np.append(u[: self.n], u[-1]))


class _RestCurve(_PseudoEquilibriumCurve):
    """The same equations where a force jumps with the position: rest between the two forces, without sliding."""

    def eigenvalues(self, u: Array) -> NDArray[Any]:
        return np.zeros(0)  # orbits turn round it, or leave it

    def tests(self, point: Point) -> Mapping[str, float]:
        u = point.u
        switches = self.local_surface(u).switches(u[: self.n])
        found = {"alpha = 0": float(u[self.n]), "alpha = 1": float(1 - u[self.n])}
        return found | {name: float(switches[j]) for name, j in self._surfaces.items()}

    def describe(self, u: Array) -> PseudoEquilibrium:
        here, x, alpha = self.local_surface(u), u[: self.n], float(u[self.n])
        mode = here.mode if self.system.surface_count > 1 else None
        label = classify(
            self.system, x, parameters=here.values, surface=here.surface, mode=mode
        ).label
        stable, inside = label.startswith("stable"), min(alpha, 1.0 - alpha)
        return PseudoEquilibrium(
            point=x,
            alpha=alpha,
            status="real" if inside > 0.0 else "virtual",
            region=None,
            kind=f"rest between two forces, {label}",
            eigenvalues=self.eigenvalues(u),
            stable=stable,
            margin=abs(inside),
            distance=0.0,
            residual=0.0,
            iterations=0,
            mode=self.where.mode,
            multipliers=np.array([1.0 - 2.0 * alpha]),
        )


def _critical_pair(values: NDArray[Any]) -> list[int]:
    """Indices of the two eigenvalues whose sum is nearest to zero."""
    k, l = np.triu_indices(values.size, 1)
    near = int(np.argmin(np.abs(values[k] + values[l])))
    return [int(k[near]), int(l[near])]


def _leave(curve: Equilibria, u: Array, inward: float | Array) -> Departure | None:
    """Leave a boundary equilibrium to real solutions: along a gradient ``inward``, or its sign of alpha."""
    _, jacobian = curve.scaled(u / curve.scale)
    tangent = np.linalg.svd(jacobian)[2][-1]
    if isinstance(inward, float):
        growth = inward * tangent[curve.n]
    else:
        growth = float((inward * curve.scale) @ tangent)
    direction = tangent if growth > 0 else -tangent
    return depart(curve, u, direction, START, direction)


@with_discrete_states_held
def continue_equilibrium(
    system: FilippovSystem,
    near: ArrayLike,
    parameter: str,
    *,
    bounds: tuple[float, float],
    side: Side | None = "+",
    parameters: Parameters | None = None,
    surface: int = 0,
    mode: str | None = None,
    step: float = 0.02,
    max_points: int = 2000,
    through: bool = True,
    progress: bool = False,
) -> Branch:
    """Follow an equilibrium or pseudo-equilibrium as a parameter varies.

    Pseudo-arclength continuation in both directions from the value in ``parameters``, past turning points,
    with stability at each point.

    Parameters
    ----------
    system, parameters, surface, mode
        As in :func:`region`; a smooth system has neither surface nor mode. With complementarity conditions, constraints
        or closed contacts ``mode`` has all letters, also those of sliding surfaces and closed elements.
    near : array_like (n,)
        Guess of the first one.
    parameter : str
        Name of the parameter that varies.
    bounds : (float, float)
        Bounds of the parameter at which the branch ends.
    side : {"+", "-"} or None, optional
        Of the field $F1$ or $F2$; None for a pseudo-equilibrium; ``"+"`` for the one field of a smooth system.
    step : float, optional
        Largest step where the branch bends, relative to the width of the bounds and to the size of
        the states.
    max_points : int, optional
        Largest number of points on each side of the start.
    through : bool, optional
        Whether to continue beyond a boundary equilibrium with the pseudo-equilibria, or equilibria,
        that end there too.
    progress : bool, optional
        Whether to show a bar that counts points. After Ctrl-C the points computed so far are returned.

    Returns
    -------
    Branch
        Its ``solutions`` are Equilibrium and PseudoEquilibrium, also rest between two forces where a force jumps with the
        position. Events: ``"fold"``, ``"Hopf"`` (with
        its first Lyapunov coefficient, for an eigenvector of length one), ``"branch point"``,
        ``"pseudo-saddle-node"``, ``"boundary equilibrium"`` of any surface, condition or contact (persistence or
        nonsmooth fold, in its ``far_side``), ``"two-fold"`` (sliding changes its stability), ``"intersection"``
        (a pseudo-equilibrium reaches another surface, where its branch ends).

    Raises
    ------
    ConvergenceError
        No equilibrium is found near the start.
    DefinitionError
        Explicit time or vector multipliers; a ``parameter``, ``mode``, ``surface`` or ``side`` that the
        system does not have.
    OptionError
        Bounds in the wrong order, or without the start; ``step`` or ``max_points`` out of its range.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    PointError
        A start of a wrong shape or not finite.

    Examples
    --------
    A pseudo-saddle-node of the sliding flow $x' = mu - x^2$ on $y = 0$:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, mu = (ca.SX.sym(s) for s in ("x", "y", "mu"))
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[mu - x**2, -1], below=[mu - x**2, 1],
    ...                       parameters={mu: 1.0})
    >>> branch = continue_equilibrium(s, [1.0, 0.0], "mu", bounds=(-1, 2), side=None)
    >>> [(event.kind, abs(round(event.parameter, 12))) for event in branch.events]
    [('pseudo-saddle-node', 0.0)]
    >>> [found.kind for found in branch.at(1.0)]
    ['pseudo-saddle', 'stable pseudo-node']
    """
    require_system(system, complementarity=True, joints=True)
    require_autonomous(system, "continuation of equilibria", elements=True)
    positive(step, "step")
    whole(max_points, "max_points", least=2)
    index = parameter_index(system, parameter)
    value = float(system.parameter_vector(parameters)[index])
    low, high = check_bounds(bounds, value, parameter)
    given: dict[str, Any] = dict(parameters=parameters, surface=surface, mode=mode)
    ends = index, value, high - low
    if needs_mode(system, mode):
        curve, start = _in_mode(system, near, ends, parameters, mode)
    elif side is None:
        curve, start = _pseudo(system, near, ends, given)
    else:
        curve, start = _of_field(system, near, ends, side, given)
    return follow_branch(
        curve,
        start,
        name=parameter,
        bounds=(low, high),
        step=step,
        max_points=max_points,
        through=through,
        progress=progress,
    )


#: Number of a parameter, its value at the start, and the width of its bounds.
_Ends = tuple[int, float, float]


def _of_field(
    system: FilippovSystem, near: ArrayLike, ends: _Ends, side: Side, given: dict[str, Any]
) -> tuple[Equilibria, Array]:
    """Equilibria of one field, and the first one."""
    index, value, width = ends
    names = (given[name] for name in ("parameters", "surface", "mode"))
    where, _ = surface_at(system, near, next(names), 0.0, *names, smooth=True)
    found = find_equilibrium(system, near, side=side, **given)
    curve = EquilibriumCurve(where, (index,), _scale(system, found.point, [width]), side)
    return curve, np.append(found.point, value)


def _pseudo(
    system: FilippovSystem, near: ArrayLike, ends: _Ends, given: dict[str, Any]
) -> tuple[Equilibria, Array]:
    """Pseudo-equilibria, and the first one."""
    index, value, width = ends
    names = (given[name] for name in ("parameters", "surface", "mode"))
    where, _ = surface_at(system, near, next(names), 0.0, *names)
    require_linear(system, given["surface"], "pseudo-equilibrium")
    found = find_pseudo_equilibrium(system, near, **given)
    curve = _PseudoEquilibriumCurve(where, (index,), _scale(system, found.point, [1.0, width]))
    return curve, np.append(found.point, [found.alpha, value])


def _in_mode(
    system: FilippovSystem,
    near: ArrayLike,
    ends: _Ends,
    parameters: Parameters | None,
    mode: str | None,
) -> tuple[Equilibria, Array]:
    """Equilibria of a mode with conditions, contacts or joints, and the first one."""
    from .mode_equilibria import ModeEquilibria  # which needs this module

    index, value, width = ends
    found, p = (
        find_equilibrium(system, near, parameters=parameters, mode=mode),
        system.parameter_vector(parameters),
    )
    scale = _scale(system, found.point, [width])
    return ModeEquilibria(system, found.mode, p, (index,), scale), np.append(found.point, value)


def _scale(system: FilippovSystem, point: Array, more: list[float]) -> Array:
    size = max(1.0, float(np.abs(point).max()))
    return np.append(np.full(system.dimension, size), more)
