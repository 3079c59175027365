"""Two-folds of a system, h = L1 = L2 = 0: their search, normal form and class.

The coordinates z1 = theta h, z2 = -phi theta L1, z3 = theta L2/phi of the normal form (Jeffrey &
Colombo 2009) are these functions of the state, not their linearisation.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...model import (
    Array,
    DefinitionError,
    DegenerateError,
    FilippovSystem,
    Parameters,
    PointError,
    real_array,
)
from ...model.checks import positive
from ...notebook import quadrants, representation
from ...result_tables import Tabular
from ...solvers.newton import solve_many
from ..checks import require_generic
from ..discrete_states import with_discrete_states_held
from ..point.regions import coincide
from ..point.surface_point import FIELDS, SIDES, LocalSurface, Numbers, on_surface, surface_at
from ..read_only import ReadOnly
from ..two_folds import Boundary, Classification, NormalForm, classify_two_fold, normal_form
from .search import Found, search, unknowns


@dataclass(frozen=True, eq=False, repr=False)
class TwoFold(Tabular):
    """A generic two-fold, its normal form and its class.

    ``print(fold)`` explains it. Coordinates $(z1, z2, z3)$, times and the matrix are those of
    ``normal_form``: sliding is attracting where $z2, z3 > 0$ and repelling where $z2, z3 < 0$.

    Attributes
    ----------
    system : FilippovSystem
        The system that the two-fold belongs to.
    point : ndarray (n,)
        The point, in the order of the states.
    t : float
        Time, where the system depends on it.
    parameters : mapping of str to float
        Values of all parameters there.
    surface : int
        Index of the surface it lies on.
    form : NormalForm
        $theta$, $phi$ and the reduced flow.
    classification : Classification
        Class, canards and determinism, from signs and numbers alone.
    lie : mapping
        ``L11``, ``L12``, ``L21``, ``L22`` with $L_ij = F_i . grad L_j$.
    coincident_fields : bool
        Whether $F1 = F2$ at the point. Then $Delta = 0$ and sliding passes smoothly through it.
    distance : float
        From the start of the search; 0 if the point was given.
    residual : float
        Largest first-order distance to $h = 0$, $L1 = 0$, $L2 = 0$.
    iterations : int
        Iterations that Newton's method took; 0 where nothing was searched.
    chart : Chart
        The coordinates of the normal form as functions; see ``coordinates`` and ``point_at``.
    """

    system: FilippovSystem
    point: Array
    t: float
    parameters: Mapping[str, float]
    surface: int
    form: NormalForm
    classification: Classification
    lie: Mapping[str, float]
    coincident_fields: bool
    distance: float
    residual: float
    iterations: int
    chart: Chart

    # the normal form ---------------------------------------------------------------------------

    @property
    def sigma(self) -> tuple[int, int]:
        """Signs of $L11$ and $L22$."""
        return self.form.flow.sigma

    @property
    def nu(self) -> tuple[float, float]:
        """The two numbers: $L12$ and $-L21$ over $sqrt(|L11 L22|)$."""
        return self.form.flow.nu

    @property
    def theta(self) -> float:
        """Scale of the surface's function, $|L11 L22|^(-1/2)$, so that $z1 = theta h$."""
        return self.form.theta

    @property
    def phi(self) -> float:
        """Scale of time, $|L22/L11|^(1/4)$: real time is $phi tau$ above and $tau/phi$ below."""
        return self.form.phi

    @property
    def matrix(self) -> Array:
        """Matrix of the reduced flow, $[[nu2, -sigma1], [sigma2, nu1]]$; (2, 2)."""
        return self.form.flow.matrix

    @property
    def trace(self) -> float:
        """Trace of M, $nu1 + nu2$."""
        return self.form.flow.trace

    @property
    def determinant(self) -> float:
        """Determinant of M, $Delta = nu1 nu2 + sigma1 sigma2$."""
        return self.form.flow.determinant

    @property
    def discriminant(self) -> float:
        """Discriminant of M, $(nu1 - nu2)^2 - 4 sigma1 sigma2$; negative: a focus."""
        return self.form.flow.discriminant

    @property
    def eigenvalues(self) -> NDArray[Any]:
        """Eigenvalues of M, ascending where real; (2,)."""
        return self.form.flow.eigenvalues

    @property
    def eigenvectors(self) -> NDArray[Any]:
        """Unit eigenvectors in $(z2, z3)$ as columns; (2, 2)."""
        return self.form.flow.eigenvectors

    @property
    def slopes(self) -> NDArray[Any]:
        """Slopes $z3/z2$ of the eigenvectors; (2,)."""
        return self.form.flow.slopes

    # the class ---------------------------------------------------------------------------------

    @property
    def kind(self) -> str:
        """``"visible"``, ``"invisible"`` or ``"visible-invisible"``."""
        return self.classification.kind

    @property
    def label(self) -> str:
        """Class, or the named boundary where classes meet."""
        return self.classification.label

    @property
    def canards(self) -> float:
        """Number of sliding orbits $Da -> s -> Dr$: 0, 1 or inf (NaN on a boundary of classes)."""
        return self.classification.canards

    @property
    def faux_canards(self) -> float:
        """Number of sliding orbits $Dr -> s -> Da$: 0, 1 or inf (NaN on a boundary of classes)."""
        return self.classification.faux_canards

    @property
    def boundaries(self) -> tuple[Boundary, ...]:
        """Degenerate boundaries on which the two-fold lies, harmless ones included."""
        return self.classification.boundaries

    def __str__(self) -> str:
        return description(self)

    def _repr_html_(self) -> str:
        """Notebook representation: class, numbers, and their meaning."""
        real = [float(s.real) for s in self.slopes if abs(s.imag) < 1e-12 * (1 + abs(s.real))]
        rows = (
            ("point", np.array2string(self.point, precision=6)),
            ("sigma, nu", f"{self.sigma}, ({self.nu[0]:.6g}, {self.nu[1]:.6g})"),
            ("canards", _counted(self.canards)),
            ("faux canards", _counted(self.faux_canards)),
        )
        meaning = representation("", [("", self.classification.determinism)])
        return (
            representation(f"{self.kind} two-fold, class {self.label}", rows, quadrants(real))
            + meaning
        )

    def __repr__(self) -> str:
        return f"TwoFold({self.label}, {self.kind}, point={self.point.tolist()})"

    # maps --------------------------------------------------------------------------------------

    def coordinates(self, x: ArrayLike) -> Array:
        """Normal-form coordinates $z1 = theta h$, $z2 = -phi theta L1$, $z3 = theta L2/phi$.

        They are these functions at any state, not their linearisation.

        Parameters
        ----------
        x : array_like (..., n)
            States, on the last axis.

        Returns
        -------
        ndarray (..., 3)
            Coordinates $(z1, z2, z3)$ of the normal form.

        Raises
        ------
        PointError
            States whose last axis has not the length n, or that are not finite.
        """
        return self.chart(x)

    def point_at(self, z: ArrayLike, *, tol: float = 1e-12, max_iterations: int = 50) -> Array:
        """Find states near the two-fold with given coordinates (the inverse of ``coordinates``).

        For $n > 3$ the least-norm steps of Newton's method choose the state.

        Parameters
        ----------
        z : array_like (..., 2) or (..., 3)
            $(z2, z3)$ on the surface, or $(z1, z2, z3)$.
        tol, max_iterations
            As in :func:`find_two_fold`.

        Returns
        -------
        ndarray (..., n)
            States at these coordinates.

        Raises
        ------
        PointError
            Wrong shape, NaN.
        ConvergenceError
            z is too far from 0 for the coordinates to be invertible.
        """
        return self.chart.inverse(z, tol, max_iterations)

    def tangents(self) -> Array:
        """States per unit of $z1$, $z2$ and $z3$ at the two-fold, the derivative of ``point_at``.

        Returns
        -------
        ndarray (n, 3)
            Directions of $z1$, $z2$ and $z3$ in the space of states, as columns.
        """
        return self.chart.tangents()

    def reach_time(self, z: ArrayLike, *, tol: float = 1e-9) -> Array:
        """Real time, to leading order, at which the sliding orbit through $(z2, z3)$ is at s.

        It is $-(1/phi, phi) M^-1 z$; on an eigenline $(z2/phi + phi z3)/(-lambda)$. Positive: the orbit
        reaches s; negative: it came from there; NaN: it does neither.

        Parameters
        ----------
        z : array_like (..., 2)
            $(z2, z3)$ in Da or Dr.
        tol : float, optional
            Relative distance in slope within which a point is on a single canard.

        Returns
        -------
        ndarray (...,)
            The time; negative where the orbit came from s, NaN where it does neither.

        Raises
        ------
        PointError
            Coordinates that are no pairs, or not finite.
        """
        z = np.asarray(z, dtype=float)
        if z.ndim == 0 or z.shape[-1] != 2 or not np.all(np.isfinite(z)):
            raise PointError(f"z: expected finite numbers (..., 2), received {z!r}.")
        positive(tol, "tol")
        return np.array([self._reach_time(p, tol) for p in z.reshape(-1, 2)]).reshape(z.shape[:-1])

    def _reach_time(self, z: Array, tol: float) -> float:
        if z[0] * z[1] <= 0:
            return math.nan
        slope = float(z[1] / z[0])
        weights = np.array([1 / self.phi, self.phi])
        sets = (self.classification.into, self.classification.out_of)
        for slopes, eigenvalue in zip(sets, self.eigenvalues, strict=True):
            if slopes.contains(slope, tol):
                if slopes.kind == "one":
                    return float(-weights @ z / eigenvalue)
                return float(-weights @ np.linalg.solve(self.matrix, z))
        return math.nan


@dataclass(frozen=True, eq=False)
class Chart:
    """The coordinates (z1, z2, z3) near a two-fold, and their inverse."""

    where: LocalSurface
    point: Array  # the two-fold (N,)
    scales: Array  # of h, L1 and L2 (3,)

    @property
    def _dimension(self) -> int:
        return self.where.system.dimension

    def _extended(self, x: Array) -> Array:
        """Append the two-fold's time to states (k, n)."""
        tail = np.tile(self.point[self._dimension :], (len(x), 1))
        return np.hstack([x, tail])

    def __call__(self, x: ArrayLike) -> Array:
        """Return z (..., 3) at states (..., n)."""
        states, n = real_array(x, "states"), self._dimension
        if states.ndim == 0 or states.shape[-1] != n:
            raise PointError(
                f"states: expected shape (..., {n}) for the states "
                f"{self.where.system.state_names}, received shape {states.shape}. States are on "
                "the last axis."
            )
        if not np.all(np.isfinite(states)):
            raise PointError("states: expected finite numbers, received NaN or inf.")
        many = self.where.many(self._extended(states.reshape(-1, n)))
        return (many.values * self.scales).reshape(*states.shape[:-1], 3)

    def tangents(self) -> Array:
        """States per unit of z1, z2 and z3 at the two-fold: the derivative of ``inverse``; (n, 3)."""
        gradients = self.where.at(self.point).gradients[:, : self._dimension]
        return np.asarray(np.linalg.pinv(self.scales[:, None] * gradients), dtype=np.float64)

    def inverse(self, z: ArrayLike, tol: float, max_iterations: int) -> Array:
        """Return states (..., n) with coordinates (..., 2), (z2, z3) on the surface, or (..., 3)."""
        target = np.asarray(z, dtype=float)
        if target.ndim == 0 or target.shape[-1] not in (2, 3) or not np.all(np.isfinite(target)):
            raise PointError(
                f"z: expected finite numbers of shape (..., 2) or (..., 3), received {z!r}."
            )
        if target.shape[-1] == 2:
            target = np.concatenate([np.zeros((*target.shape[:-1], 1)), target], axis=-1)
        required, n = target.reshape(-1, 3), self._dimension

        def equations(x: Array, which: NDArray[np.int64]) -> tuple[Array, Array]:
            many, scales = self.where.many(self._extended(x)), self.scales
            return many.values * scales - required[which], many.gradients[:, :, :n] * scales[
                :, None
            ]

        starts = np.tile(self.point[:n], (len(required), 1))
        x, converged = solve_many(equations, starts, tol=positive(tol, "tol"))
        for k in np.flatnonzero(~converged):
            x[k] = self._one(required[k], tol, max_iterations)
        return x.reshape(*target.shape[:-1], n)

    def _one(self, required: Array, tol: float, max_iterations: int) -> Array:
        """Search with damping, where full steps diverged."""

        def equations(x: Array) -> tuple[Array, Array]:
            numbers = self.where.at(x)
            values = np.array([numbers.h, *numbers.lie]) * self.scales - required
            return values, numbers.gradients * self.scales[:, None]

        n, what = self._dimension, f"state at z = {required.tolist()}"
        found = search(
            equations, self.point, range(n), tol=tol, max_iterations=max_iterations, what=what
        )
        return found.x[:n]


# print(fold) -------------------------------------------------------------------------------------

_WIDTH = 98


def _count(number: float) -> str:
    if math.isnan(number):
        return "not decided at leading order"
    return {0.0: "none", 1.0: "one", math.inf: "infinitely many"}[number]


def _numbers(values: NDArray[Any]) -> str:
    def one(value: complex) -> str:
        if value.imag:
            return f"{value.real:.6g}{value.imag:+.6g}i"
        return f"{value.real:.6g}"

    return ", ".join(one(complex(v)) for v in values)


def _point(fold: TwoFold) -> str:
    size = max(1.0, *(abs(v) for v in fold.point))
    rounded = (0.0 if abs(v) < 1e-14 * size else v for v in fold.point)
    text = f"[{', '.join(f'{v:.10g}' for v in rounded)}]"
    return text + (f", t = {fold.t:.10g}" if fold.system.time_dependent else "")


def _counted(orbits: float) -> str:
    """A number of orbits, in words where it is not finite."""
    return "infinitely many" if np.isinf(orbits) else f"{orbits:g}"


def description(fold: TwoFold) -> str:
    """Describe a two-fold in a paragraph."""
    c = fold.classification
    title = f"{fold.kind.capitalize()} two-fold at {_point(fold)}"
    lines = [f"{title}, {'' if c.label.startswith('boundary') else 'class '}{c.label}."]
    (s1, s2), (n1, n2) = fold.sigma, fold.nu
    lines.append(f"sigma = ({s1:+d}, {s2:+d}), nu = ({n1:.6g}, {n2:.6g})")
    slopes = _numbers(fold.slopes)
    lines.append(f"eigenvalues {_numbers(fold.eigenvalues)} with slopes z3/z2 = {slopes}")
    lines.append(
        f"canards (Da -> s -> Dr): {_count(fold.canards)}; "
        f"faux canards (Dr -> s -> Da): {_count(fold.faux_canards)}"
    )
    if fold.coincident_fields:
        lines.append(
            "The two fields coincide at s: Delta = 0, the sliding flow is smooth through s and a "
            "run along it continues."
        )
    lines.append(c.determinism)
    if fold.system.dimension > 3 and 1.0 in (c.canards, c.faux_canards):
        lines.append(
            f"With {fold.system.dimension} states two-folds form a set of dimension "
            f"{fold.system.dimension - 3}; one orbit reads a set of codimension one."
        )
    for boundary in c.boundaries:
        if boundary.harmless and not (fold.coincident_fields and boundary.name == "Delta=0"):
            lines.append(
                f"On the boundary {boundary.name} ({boundary.meaning}); the class is "
                f"{boundary.between[0]} on both sides."
            )
    if fold.iterations:
        plural = "" if fold.iterations == 1 else "s"
        lines.append(
            f"Found {fold.distance:.3g} from the start in {fold.iterations} iteration{plural}, "
            f"residual {fold.residual:.2g}."
        )
    wrapped = [textwrap.fill(line, _WIDTH, subsequent_indent="  ") for line in lines[:1]]
    wrapped += [
        textwrap.fill(line, _WIDTH, initial_indent="  ", subsequent_indent="  ")
        for line in lines[1:]
    ]
    return "\n".join(wrapped)


# the search --------------------------------------------------------------------------------------

#: Normalised grad h, grad L1, grad L2 whose smallest singular value is below this are dependent.
DEPENDENT = 1e-12
#: |L_ii| below this times |F_i| |grad L_i| is zero: a cusp.
CUSP = 1e-11


def _refuse_degenerate(numbers: Numbers, linear: bool) -> None:
    """Refuse dependent gradients and cusps; ``linear`` after linear convergence."""
    lengths = np.linalg.norm(numbers.gradients, axis=1)
    smallest, at = independence(numbers), numbers.x.tolist()
    if smallest <= DEPENDENT or linear:
        length, name = min(zip(lengths / lengths.max(), ("h", "L1", "L2"), strict=True))
        vanishing = f"; |grad {name}| is {length:.1e} of the largest" if length < 1e-4 else ""
        slow = "; Newton converged only linearly" if linear else ""
        raise DegenerateError(
            f"two-fold at {at}: expected independent grad h, grad L1 and grad L2, received "
            f"dependent ones (smallest singular value {smallest:.1e} after normalising{vanishing}"
            f"{slow}). The folds do not cross transversally, so there is no normal form: vary a "
            "parameter."
        )
    for k, letter in enumerate(SIDES):
        value = numbers.second[f"L{k + 1}{k + 1}"]
        size = float(np.linalg.norm(numbers.fields[k]) * np.linalg.norm(numbers.lie_gradients[k]))
        if abs(value) <= CUSP * size:
            raise DegenerateError(
                f"two-fold at {at}: expected L{k + 1}{k + 1} != 0, received {value:.3e} "
                f"(sigma{k + 1} = 0). The field {FIELDS[letter]} has a cusp there (cusp-fold), "
                "which is outside the classes of generic two-folds: vary a parameter."
            )


def independence(numbers: Numbers) -> float:
    """Smallest singular value of grad h, grad L1, grad L2 as unit vectors; 0 where dependent."""
    lengths = np.linalg.norm(numbers.gradients, axis=1)
    scaled = numbers.gradients / np.where(lengths > 0, lengths, 1.0)[:, None]
    return float(np.linalg.svd(scaled, compute_uv=False)[-1])


def two_fold_at(where: LocalSurface, found: Found) -> TwoFold:
    """Describe the two-fold at a point where h = L1 = L2 = 0."""
    system, numbers = where.system, where.finite_at(found.x)
    _refuse_degenerate(numbers, found.linear)
    lie = numbers.second
    form = normal_form(lie)
    lengths = np.linalg.norm(numbers.gradients, axis=1)
    n, scales = system.dimension, form.theta * np.array([1.0, -form.phi, 1 / form.phi])
    return TwoFold(
        system=system,
        point=found.x[:n],
        t=float(found.x[n]) if system.time_dependent else 0.0,
        parameters=ReadOnly(where.values),
        surface=where.surface,
        form=form,
        classification=classify_two_fold(form.flow.sigma, form.flow.nu),
        lie=ReadOnly(lie),
        coincident_fields=coincide(numbers, 1e-9),
        distance=found.distance,
        residual=float(np.max(np.abs([numbers.h, *numbers.lie]) / lengths)),
        iterations=found.iterations,
        chart=Chart(where, found.x, scales),
    )


def _require_coordinates(where: LocalSurface, x: Array) -> None:
    """Refuse joints and closed contacts, beside which the coordinates of a two-fold are not defined."""
    if where.along(x) is not None:
        raise DefinitionError(
            "two-fold: the system has constraints or closed contacts, and a two-fold has coordinates in which the motion is "
            "free. Write the motion in such coordinates; classify(system, point) names the class as it is."
        )


@with_discrete_states_held
def two_fold(
    system: FilippovSystem,
    point: ArrayLike,
    *,
    parameters: Parameters | None = None,
    t: float = 0.0,
    surface: int = 0,
    mode: str | None = None,
    tol: float = 1e-9,
) -> TwoFold:
    """Describe the two-fold at a known point.

    Parameters
    ----------
    system, parameters, t, surface, mode
        As in :func:`region`.
    point : array_like (n,)
        The point, in the order of the states.
    tol : float, optional
        How well $h = L1 = L2 = 0$ must hold: each function over the length of its gradient is at most
        $tol (1 + |x|)$.

    Returns
    -------
    TwoFold
        The two-fold with its normal form and its class.

    Raises
    ------
    PointError
        The point is not a two-fold; a wrong shape; not finite.
    DegenerateError
        $grad h$, $grad L1$ and $grad L2$ are dependent, or a field has a cusp.
    DefinitionError
        Fewer than three states; vector multipliers; no surface; a ``mode`` or ``surface`` that the
        system does not have.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        ``tol`` is not positive.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, z = (ca.SX.sym(s) for s in "xyz")
    >>> s = ns.FilippovSystem([x, y, z], surface=x, above=[-y, -1, 1], below=[z, 2, -1])
    >>> fold = two_fold(s, [0, 0, 0])
    >>> fold.kind, fold.sigma, fold.nu, fold.label
    ('visible', (1, -1), (1.0, 2.0), 'VV-F')
    """
    where, x = surface_at(system, point, parameters, t, surface, mode)
    _require_coordinates(where, x)
    if system.dimension < 3:
        unknowns(system, (), 3, "two-fold")
    require_generic(where.system, where.surface, where.mode, "two-fold")
    numbers = on_surface(where, x, positive(tol, "tol"))
    lengths = np.linalg.norm(numbers.lie_gradients, axis=1)
    allowed = tol * (1 + np.linalg.norm(x)) * np.where(lengths > 0, lengths, 1.0)
    if np.any(np.abs(numbers.lie) > allowed):
        raise PointError(
            f"point {x}: expected a two-fold, L1 = L2 = 0, received L1 = {numbers.lie[0]:.6g}, L2 "
            f"= {numbers.lie[1]:.6g}. find_two_fold(system, near=point) goes to the nearest one."
        )
    return two_fold_at(where, Found(x))


@with_discrete_states_held
def find_two_fold(
    system: FilippovSystem,
    near: ArrayLike,
    *,
    parameters: Parameters | None = None,
    t: float = 0.0,
    surface: int = 0,
    mode: str | None = None,
    hold: Sequence[str] = (),
    tol: float = 1e-12,
    max_iterations: int = 50,
) -> TwoFold:
    """Find a two-fold close to a point: $h = L1 = L2 = 0$.

    Newton's method with exact gradients and least-norm steps; in a system of $n > 3$ states the
    two-fold found is near the start, not exactly the nearest of the (n-3)-dimensional set.

    Parameters
    ----------
    system, parameters, t, surface, mode
        As in :func:`region`; the point need not be on the surface. Time is kept.
    near : array_like (n,)
        Where the search starts.
    hold : sequence of str, optional
        Names of states that keep their value.
    tol : float, optional
        Accepted residual (a distance), relative to $1 + |x|$; the search itself goes to rounding.
    max_iterations : int, optional
        Newton's method gives up after this many.

    Returns
    -------
    TwoFold
        The two-fold found, with its normal form and its class.

    Raises
    ------
    ConvergenceError
        Newton's method does not converge from this start; ``residual`` and ``point`` are the last ones.
    DegenerateError
        A two-fold that is not generic; the message names the condition.
    DefinitionError
        Fewer than three states that may change; vector multipliers; no surface; a ``mode``,
        ``surface`` or state to ``hold`` that the system does not have.
    PointError
        A start of a wrong shape or not finite.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        ``tol`` or ``max_iterations`` is not positive.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, z = (ca.SX.sym(s) for s in "xyz")
    >>> s = ns.FilippovSystem([x, y, z], surface=x, above=[-y, 1, -2], below=[z, -1, 1 + 0.1 * y])
    >>> print(find_two_fold(s, near=[0.0, 0.1, -0.1]))
    Invisible two-fold at [0, 0, 0], class II-C.
      sigma = (-1, +1), nu = (-2, -1)
      eigenvalues -2.61803, -0.381966 with slopes z3/z2 = -1.61803, 0.618034
      canards (Da -> s -> Dr): infinitely many; faux canards (Dr -> s -> Da): none
      Determinism breaks on an open set (Teixeira singularity): every orbit of Da reaches s in
      finite time, and from s every orbit of Dr is a possible continuation (infinitely many canards), as
      are spirals of flights along the diabolo.
      Found 0.141 from the start in 1 iteration, residual 0.
    """
    where, x = surface_at(system, near, parameters, t, surface, mode, search=True)
    _require_coordinates(where, x)
    free = unknowns(system, hold, 3, "two-fold")
    require_generic(where.system, where.surface, where.mode, "two-fold")
    return search_two_fold(where, x, free, tol, max_iterations)


def search_two_fold(
    where: LocalSurface, x: Array, free: Sequence[int], tol: float, max_iterations: int
) -> TwoFold:
    """Find a two-fold from the extended point ``x``, changing the states ``free`` only."""

    def equations(u: Array) -> tuple[Array, Array]:
        numbers = where.at(u)
        return np.array([numbers.h, *numbers.lie]), numbers.gradients

    found = search(equations, x, free, tol=tol, max_iterations=max_iterations, what="two-fold")
    return two_fold_at(where, found)
