"""Finding two-folds by Newton's method, and describing one at a known point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...model import Array, DegenerateError, FilippovSystem, Parameters, PointError, explain
from ...model.checks import positive
from ..point.lie_derivatives import Numbers
from ..point.regions import coincide
from ..point.sides import FIELDS, SIDES
from ..point.surface_point import Place, on_surface, place
from ..read_only import ReadOnly
from ..two_folds import classify_two_fold, normal_form
from .normal_form_coordinates import Chart
from .search import Found, search, unknowns
from .two_fold import TwoFold

#: Normalised grad h, grad L1, grad L2 whose smallest singular value is below this are dependent.
DEPENDENT = 1e-12
#: |L_ii| below this times |F_i| |grad L_i| is zero: a cusp.
CUSP = 1e-11


def _refuse_degenerate(numbers: Numbers, linear: bool) -> None:
    """Refuse dependent gradients and cusps; ``linear``: the search met a multiple root."""
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


def _build(where: Place, found: Found) -> TwoFold:
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
    return _build(where, Found(x))


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
      finite time, and from s every orbit of Dr is a possible future (infinitely many canards), as
      are spirals of flights along the diabolo.
      Found 0.141 from the start in 1 iteration, residual 0.
    """
    where, x = place(system, near, parameters, t, surface, mode)
    free = unknowns(system, hold, 3, "two-fold")
    return search_two_fold(where, x, free, tol, max_iterations)


def search_two_fold(
    where: Place, x: Array, free: Sequence[int], tol: float, max_iterations: int
) -> TwoFold:
    """Find a two-fold from the extended point ``x``, changing the states ``free`` only."""

    def equations(u: Array) -> tuple[Array, Array]:
        numbers = where.at(u)
        return np.array([numbers.h, *numbers.lie]), numbers.gradients

    found = search(equations, x, free, tol=tol, max_iterations=max_iterations, what="two-fold")
    return _build(where, found)
