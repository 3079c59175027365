"""A two-fold: a point where both fields are tangent to the surface, h = L1 = L2 = 0, with its class."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...model import Array, FilippovSystem, PointError
from ...model.checks import positive
from ...notebook import card, quadrants
from ..two_folds import Boundary, Classification, NormalForm
from .normal_form_coordinates import Chart

# A two-fold in words: what ``print(fold)`` shows.

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


def two_fold_in_words(fold: TwoFold) -> str:
    """Write the paragraph for a two-fold."""
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
            "run along it goes on."
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


@dataclass(frozen=True, eq=False, repr=False)
class TwoFold:
    """A generic two-fold, its normal form and its class.

    ``print(fold)`` says what it means. Coordinates $(z1, z2, z3)$, times and the matrix are those of
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
        return two_fold_in_words(self)

    def _repr_html_(self) -> str:
        """How a notebook shows the two-fold: its class, its numbers, and what follows from them."""
        real = [float(s.real) for s in self.slopes if abs(s.imag) < 1e-12 * (1 + abs(s.real))]
        rows = (
            ("point", np.array2string(self.point, precision=6)),
            ("sigma, nu", f"{self.sigma}, ({self.nu[0]:.6g}, {self.nu[1]:.6g})"),
            ("canards", f"{self.canards:g}, faux {self.faux_canards:g}"),
        )
        words = card("", [("", self.classification.determinism)])
        return card(f"{self.kind} two-fold, class {self.label}", rows, quadrants(real)) + words

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
