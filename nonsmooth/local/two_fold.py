"""Two-folds: points where both fields are tangent to the surface, h = L1 = L2 = 0.

They are found by Newton's method with least-norm steps and described by their normal form and class.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..model import (
    Array,
    DegenerateError,
    FilippovSystem,
    Parameters,
    PointError,
    explain,
    real_array,
)
from .classification import Boundary, Classification, classify_two_fold
from .describe import two_fold_in_words
from .folds import unknowns
from .lie import Numbers, Place, on_surface, place, positive
from .newton import Root, solve
from .normal_form import NormalForm, normal_form
from .regions import coincide

#: Normalised grad h, grad L1, grad L2 whose smallest singular value is below this are dependent.
DEPENDENT = 1e-12
#: |L_ii| below this times |F_i| |grad L_i| is zero: a cusp.
CUSP = 1e-11


@dataclass(frozen=True, eq=False, repr=False)
class TwoFold:
    """A generic two-fold, its normal form and its class.

    ``print(fold)`` says what it means. Coordinates (z1, z2, z3), times and the matrix are those of
    ``normal_form``: sliding is attracting where z2, z3 > 0 and repelling where z2, z3 < 0.

    Attributes
    ----------
    system : FilippovSystem
    point : ndarray (n,)
    t : float
        Time, where the system depends on it.
    parameters : mapping of str to float
    surface : int
    form : NormalForm
        theta, phi and the reduced flow.
    classification : Classification
    lie : mapping
        ``L11``, ``L12``, ``L21``, ``L22`` with L_ij = F_i . grad L_j.
    coincident_fields : bool
        Whether F1 = F2 at the point. Then Delta = 0 and sliding passes smoothly through it.
    distance : float
        From the start of the search; 0 if the point was given.
    residual : float
        Largest first-order distance to h = 0, L1 = 0, L2 = 0.
    iterations : int
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
    _place: Place = field(repr=False)

    # the normal form ---------------------------------------------------------------------------

    @property
    def sigma(self) -> tuple[int, int]:
        """Signs of L11 and L22."""
        return self.form.flow.sigma

    @property
    def nu(self) -> tuple[float, float]:
        """L12 and -L21 over sqrt|L11 L22|."""
        return self.form.flow.nu

    @property
    def theta(self) -> float:
        """|L11 L22|^(-1/2), so z1 = theta h."""
        return self.form.theta

    @property
    def phi(self) -> float:
        """|L22/L11|^(1/4): real time is phi tau above and tau/phi below."""
        return self.form.phi

    @property
    def matrix(self) -> Array:
        """M = [[nu2, -sigma1], [sigma2, nu1]]; (2, 2)."""
        return self.form.flow.matrix

    @property
    def trace(self) -> float:
        """nu1 + nu2."""
        return self.form.flow.trace

    @property
    def determinant(self) -> float:
        """Delta = nu1 nu2 + sigma1 sigma2."""
        return self.form.flow.determinant

    @property
    def discriminant(self) -> float:
        """(nu1 - nu2)^2 - 4 sigma1 sigma2."""
        return self.form.flow.discriminant

    @property
    def eigenvalues(self) -> NDArray[Any]:
        """Eigenvalues of M, ascending where real; (2,)."""
        return self.form.flow.eigenvalues

    @property
    def eigenvectors(self) -> NDArray[Any]:
        """Unit eigenvectors in (z2, z3) as columns; (2, 2)."""
        return self.form.flow.eigenvectors

    @property
    def slopes(self) -> NDArray[Any]:
        """z3/z2 along the eigenvectors; (2,)."""
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
        """Number of sliding orbits Da -> s: 0, 1 or inf (NaN on a boundary of classes)."""
        return self.classification.canards

    @property
    def faux_canards(self) -> float:
        """Number of sliding orbits Dr -> s -> Da: 0, 1 or inf (NaN on a boundary of classes)."""
        return self.classification.faux_canards

    @property
    def boundaries(self) -> tuple[Boundary, ...]:
        """Degenerate boundaries on which the two-fold lies, harmless ones included."""
        return self.classification.boundaries

    def __str__(self) -> str:
        return two_fold_in_words(self)

    def __repr__(self) -> str:
        return f"TwoFold({self.label}, {self.kind}, point={self.point.tolist()})"

    # maps --------------------------------------------------------------------------------------

    def _extended(self, x: ArrayLike) -> Array:
        states = real_array(x, "states")
        n = self.system.dimension
        if states.ndim == 0 or states.shape[-1] != n:
            raise PointError(
                explain(
                    "states",
                    expected=f"shape (..., {n}) for the states {self.system.state_names}",
                    received=f"shape {states.shape}",
                    advice="States are on the last axis.",
                )
            )
        if not np.all(np.isfinite(states)):
            raise PointError("states: expected finite numbers, received NaN or inf.")
        flat = states.reshape(-1, n)
        if self.system.time_dependent:
            flat = np.column_stack([flat, np.full(len(flat), self.t)])
        return flat

    @property
    def _scales(self) -> Array:
        return self.theta * np.array([1.0, -self.phi, 1 / self.phi])

    def coordinates(self, x: ArrayLike) -> Array:
        """Normal-form coordinates z1 = theta h, z2 = -phi theta L1, z3 = theta L2/phi.

        They are these functions at any state, not their linearisation.

        Parameters
        ----------
        x : array_like (..., n)

        Returns
        -------
        ndarray (..., 3)

        Raises
        ------
        PointError
        """
        values, _ = self._place.many(self._extended(x))
        return (values * self._scales).reshape(*np.shape(x)[:-1], 3)

    def point_at(self, z: ArrayLike, *, tol: float = 1e-12, max_iterations: int = 50) -> Array:
        """Find states near the two-fold with given coordinates (the inverse of ``coordinates``).

        For n > 3 the least-norm steps of Newton's method choose the state.

        Parameters
        ----------
        z : array_like (..., 2) or (..., 3)
            (z2, z3) on the surface, or (z1, z2, z3).
        tol, max_iterations
            As in :func:`find_two_fold`.

        Returns
        -------
        ndarray (..., n)

        Raises
        ------
        PointError
            Wrong shape, NaN.
        ConvergenceError
            z is too far from 0 for the coordinates to be invertible.
        """
        target = np.asarray(z, dtype=float)
        if target.ndim == 0 or target.shape[-1] not in (2, 3) or not np.all(np.isfinite(target)):
            raise PointError(
                f"z: expected finite numbers of shape (..., 2) or (..., 3), received {z!r}."
            )
        if target.shape[-1] == 2:
            target = np.concatenate([np.zeros((*target.shape[:-1], 1)), target], axis=-1)
        wanted = target.reshape(-1, 3)
        x, converged = self._batch_newton(wanted, positive(tol, "tol"))
        for k in np.flatnonzero(~converged):
            x[k] = self._state_at(wanted[k], tol, max_iterations)
        return x.reshape(*target.shape[:-1], self.system.dimension)

    def _batch_newton(self, wanted: Array, tol: float) -> tuple[Array, NDArray[np.bool_]]:
        """Newton without damping for all points at once, and which of them it solved."""
        n = self.system.dimension
        x = np.tile(self.point, (len(wanted), 1))
        residual = np.full(len(wanted), np.inf)
        going = np.ones(len(wanted), dtype=bool)
        for _ in range(10):
            values, gradients = self._place.many(self._extended(x[going]))
            r = values * self._scales - wanted[going]
            jacobian = gradients[:, :, :n] * self._scales[:, None]
            lengths = np.linalg.norm(jacobian, axis=2)
            good = np.isfinite(r).all(1) & np.isfinite(jacobian).all((1, 2)) & (lengths > 0).all(1)
            index = np.flatnonzero(going)
            going[index[~good]] = False
            index, r, jacobian, lengths = index[good], r[good], jacobian[good], lengths[good]
            if not index.size:
                break
            residual[index] = np.max(np.abs(r) / lengths, axis=1)
            step = (np.linalg.pinv(jacobian) @ r[..., None])[..., 0]
            x[index] -= step
            size, length = np.linalg.norm(x[index], axis=1), np.linalg.norm(step, axis=1)
            going[index] = (length > 2.0**-48 * (1 + size)) & (length < 1e8)
            residual[index[length >= 1e8]] = np.inf
            if not going.any():
                break
        return x, residual <= tol * (1 + np.linalg.norm(x, axis=1))

    def _state_at(self, wanted: Array, tol: float, max_iterations: int) -> Array:
        n, full = self.system.dimension, self._extended(self.point)[0]

        def equations(x: Array) -> tuple[Array, Array]:
            numbers = self._place.at(np.concatenate([x, full[n:]]))
            values = np.array([numbers.h, *numbers.lie]) * self._scales - wanted
            return values, numbers.gradients[:, :n] * self._scales[:, None]

        what = f"state at z = {wanted.tolist()}"
        return solve(equations, self.point, tol=tol, max_iterations=max_iterations, what=what).x

    def reach_time(self, z: ArrayLike, *, tol: float = 1e-9) -> Array:
        """Real time, to leading order, at which the sliding orbit through (z2, z3) is at s.

        t* = -(1/phi, phi) M^-1 z; on an eigenline (z2/phi + phi z3)/(-lambda). Positive: the orbit
        reaches s; negative: it came from there; NaN: it does neither.

        Parameters
        ----------
        z : array_like (..., 2)
            (z2, z3) in Da or Dr.
        tol : float, optional
            Relative distance in slope within which a point is on a single canard.

        Returns
        -------
        ndarray (...,)

        Raises
        ------
        PointError
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


# Building --------------------------------------------------------------------------------------


def _refuse_degenerate(numbers: Numbers, root: Root | None) -> None:
    lengths = np.linalg.norm(numbers.gradients, axis=1)
    scaled = numbers.gradients / np.where(lengths > 0, lengths, 1.0)[:, None]
    smallest = float(np.linalg.svd(scaled, compute_uv=False)[-1])
    where = numbers.x.tolist()
    if smallest <= DEPENDENT or (root is not None and root.linear):
        length, name = min(zip(lengths / lengths.max(), ("h", "L1", "L2"), strict=True))
        vanishing = f"; |grad {name}| is {length:.1e} of the largest" if length < 1e-4 else ""
        raise DegenerateError(
            f"two-fold at {where}: expected independent grad h, grad L1 and grad L2, received "
            f"dependent ones (smallest singular value {smallest:.1e} after normalising{vanishing}"
            f"{'; Newton converged only linearly' if root is not None and root.linear else ''}). "
            "The folds do not cross transversally, so there is no normal form: vary a parameter."
        )
    for k in (0, 1):
        value = numbers.second[f"L{k + 1}{k + 1}"]
        size = float(np.linalg.norm(numbers.fields[k]) * np.linalg.norm(numbers.lie_gradients[k]))
        if abs(value) <= CUSP * size:
            raise DegenerateError(
                f"two-fold at {where}: expected L{k + 1}{k + 1} != 0, received {value:.3e} "
                f"(sigma{k + 1} = 0). The field {('above', 'below')[k]} has a cusp there "
                "(cusp-fold); its classification needs third derivatives and is not built: vary "
                "a parameter."
            )


def _build(where: Place, x: Array, root: Root | None, start: Array | None) -> TwoFold:
    system = where.system
    numbers = where.finite_at(x)
    _refuse_degenerate(numbers, root)
    lie = numbers.second
    form = normal_form(lie)
    lengths = np.linalg.norm(numbers.gradients, axis=1)
    residual = float(np.max(np.abs([numbers.h, *numbers.lie]) / lengths))
    n = system.dimension
    values = dict(zip(system.parameter_names, map(float, where.parameters), strict=True))
    return TwoFold(
        system=system,
        point=x[:n],
        t=float(x[n]) if system.time_dependent else 0.0,
        parameters=MappingProxyType(values),
        surface=where.surface,
        form=form,
        classification=classify_two_fold(form.flow.sigma, form.flow.nu),
        lie=MappingProxyType(lie),
        coincident_fields=coincide(numbers, 1e-9),
        distance=0.0 if start is None else float(np.linalg.norm(x - start)),
        residual=residual,
        iterations=0 if root is None else root.iterations,
        _place=where,
    )


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
    tol : float, optional
        How well h = L1 = L2 = 0 must hold: each |.|/|grad .| is at most ``tol (1 + |x|)``.

    Returns
    -------
    TwoFold

    Raises
    ------
    PointError
        The point is not a two-fold.
    DegenerateError
        grad h, grad L1, grad L2 are dependent, or a field has a cusp.
    ParameterError, DefinitionError, OptionError

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, z = (ca.SX.sym(s) for s in "xyz")
    >>> s = ns.FilippovSystem([x, y, z], surface=x, above=[-y, -1, 1], below=[z, 2, -1])
    >>> fold = two_fold(s, [0, 0, 0])
    >>> fold.kind, fold.sigma, fold.nu, fold.label
    ('visible', (1, -1), (1.0, 2.0), 'VV-F')
    """
    where, x = place(system, point, parameters, t, surface, mode)
    if system.dimension < 3:
        unknowns(system, (), 3, "two-fold")
    numbers = on_surface(where, x, positive(tol, "tol"))
    lengths = np.linalg.norm(numbers.lie_gradients, axis=1)
    allowed = tol * (1 + np.linalg.norm(x)) * np.where(lengths > 0, lengths, 1.0)
    if np.any(np.abs(numbers.lie) > allowed):
        raise PointError(
            explain(
                f"point {x}",
                expected="a two-fold, L1 = L2 = 0",
                received=f"L1 = {numbers.lie[0]:.6g}, L2 = {numbers.lie[1]:.6g}",
                advice="find_two_fold(system, near=point) goes to the nearest one.",
            )
        )
    return _build(where, x, None, None)


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
    """Find a two-fold close to a point: h = L1 = L2 = 0.

    Newton's method with exact gradients and least-norm steps; in a system of n > 3 states the
    two-fold found is near the start, not exactly the nearest of the (n-3)-dimensional set.

    Parameters
    ----------
    system, parameters, t, surface, mode
        As in :func:`region`; the point need not be on the surface. Time is kept.
    near : array_like (n,)
    hold : sequence of str, optional
        Names of states that keep their value.
    tol : float, optional
        Accepted residual (a distance), relative to 1 + |x|; the search itself goes to rounding.
    max_iterations : int, optional

    Returns
    -------
    TwoFold

    Raises
    ------
    ConvergenceError
        With ``residual`` and ``point``, the last iterate.
    DegenerateError
        A two-fold that is not generic; the message names the condition.
    DefinitionError
        Fewer than three states that may change.
    PointError, ParameterError, OptionError

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
      finite time, and from s every orbit of Dr is a possible future (infinitely many canards), as
      are spirals of flights along the diabolo.
      Found 0.141 from the start in 1 iteration, residual 0.
    """
    where, x = place(system, near, parameters, t, surface, mode)
    free = unknowns(system, hold, 3, "two-fold")
    return search(where, x, free, tol, max_iterations)


def search(where: Place, x: Array, free: list[int], tol: float, max_iterations: int) -> TwoFold:
    """Find a two-fold from the extended point ``x``, changing the states ``free`` only."""

    def full(u: Array) -> Array:
        point = x.copy()
        point[free] = u
        return point

    def equations(u: Array) -> tuple[Array, Array]:
        numbers = where.at(full(u))
        return np.array([numbers.h, *numbers.lie]), numbers.gradients[:, free]

    root = solve(equations, x[free], tol=tol, max_iterations=max_iterations, what="two-fold")
    return _build(where, full(root.x), root, x)
