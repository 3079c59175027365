"""Boundary equilibria: zeros of one field on the surface, their search and their bifurcation.

F1 = A x + ... vanishes on h = 0 where F2 = E. With C = grad h, d = C.E and s = C A^-1 E, s < 0 is
persistence and s > 0 a nonsmooth fold (di Bernardo, Budd, Champneys & Kowalczyk 2008, ch. 5, in any
dimension). In the plane the equilibrium's type splits these into BF1 to BF5 (focus), BN1, BN2
(stable node), BS1 to BS3 (saddle) after Kuznetsov, Rinaldi & Gragnani 2003, and UN1, UN2 (unstable
node, Hogan, Homer, Jeffrey & Szalai 2016). The table is for d > 0; d < 0 is its time reversal
(A, E -> -A, -E). The margins of a class are dimensionless distances from where it changes.

On a continuous surface both fields vanish. With A1 - A2 = K grad h the equilibria of the sides are at heights
h_i proportional to 1/det A_i: det A1 det A2 > 0 is persistence, < 0 a nonsmooth fold. Where only a force jumps,
F2 is tangent, and between the two sides the equilibrium is at rest at h = L = 0.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...model import Array, FilippovSystem, Parameters, PointError
from ...model.checks import positive
from ...result_tables import Tabular
from ..checks import (
    MARGIN,
    parameter_index,
    relative_difference,
    require_autonomous,
    require_linear,
)
from ..discrete_states import with_discrete_states_held
from ..point.one_sided import one_sided_at
from ..point.surface_point import (
    FIELDS,
    SIDES,
    LocalSurface,
    Numbers,
    Side,
    on_surface,
    side_index,
    surface_at,
)
from ..read_only import ReadOnly
from .boundary_cycles import BoundaryCycle, born_cycle
from .equilibria import equilibrium_distance
from .search import search


@dataclass(frozen=True, eq=False)
class BoundaryEquilibrium(Tabular):
    """An equilibrium of one field on the surface, and its bifurcation.

    Attributes
    ----------
    point : ndarray (n,)
        The point, in the order of the states.
    side : {"+", "-", ""}
        Whose equilibrium: of $F1$ or $F2$; empty on a continuous surface, where it is that of both.
    label : str
        On a generic surface in the plane ``"BF1"`` ... ``"BF5"``, ``"BN1"``, ``"BN2"``, ``"UN1"``, ``"UN2"``,
        ``"BS1"`` ... ``"BS3"``; otherwise ``"persistence"`` or ``"nonsmooth fold"``;
        ``"degenerate"`` if the margin is below the tolerance.
    unfolding : {"persistence", "nonsmooth fold"}
        Whether the equilibrium turns into the other one, or they annihilate: a pseudo-equilibrium, the
        equilibrium beyond a continuous surface, or rest on a surface where a force jumps.
    time_reversed : bool
        The other field points away from the equilibrium's side $(d < 0)$: the class is that of the
        system with time reversed.
    eigenvalues : ndarray (n,)
        Of the field's linear part A; on a continuous surface of $F1$.
    numbers : mapping
        On a continuous surface ``det A1``, ``det A2``, and in the plane ``trace A1``, ``trace A2``.
        ``d`` and ``s``; in the plane ``trace``, ``determinant``; ``landing`` (BF2, BF3) or
        ``unstable`` (BS1, BS2) and ``pseudo``, all in units of $L_i$ along the surface for a unit
        shift of the equilibrium.
    margins : mapping
        Distance from each boundary of the class.
    switching : str
        The kind of the surface: ``"generic"``, ``"continuous"`` or ``"velocity continuous"``.
    other_eigenvalues : ndarray (n,) or None
        On a continuous surface those of $F2$.
    cycle : BoundaryCycle or None
        The cycle that is born there, of planar continuous systems; None too where it is too small or too
        large, relative to the distance of the equilibrium, for doubles.
    """

    point: Array
    side: Side | Literal[""]
    label: str
    unfolding: str
    time_reversed: bool
    eigenvalues: NDArray[Any]
    numbers: Mapping[str, float]
    margins: Mapping[str, float]
    switching: str = "generic"
    other_eigenvalues: NDArray[Any] | None = None
    cycle: BoundaryCycle | None = None

    @property
    def margin(self) -> float:
        """Smallest of the margins."""
        return min(self.margins.values())


@dataclass(frozen=True, eq=False)
class BoundaryBifurcation(Tabular):
    """The value of a parameter at which an equilibrium of one field is on the surface.

    Attributes
    ----------
    point : ndarray (n,)
        The point, in the order of the states.
    parameter : str
        The one that was varied.
    value : float
        Of that parameter.
    parameters : mapping of str to float
        All of them there, to be given to :func:`boundary_equilibrium` or :func:`classify`.
    side : {"+", "-"}
        Whose equilibrium: of $F1$ or $F2$.
    distance : float
        From the start of the search, in the states.
    residual : float
        What is left of the equations at the point.
    iterations : int
        Iterations that Newton's method took; 0 where nothing was searched.
    """

    point: Array
    parameter: str
    value: float
    parameters: Mapping[str, float]
    side: Side
    distance: float
    residual: float
    iterations: int

    def __str__(self) -> str:
        return (
            f"equilibrium of {FIELDS[self.side]} on the surface at {self.point.tolist()} for "
            f"{self.parameter} = {self.value:.10g}."
        )


@with_discrete_states_held
def boundary_equilibrium(
    system: FilippovSystem,
    point: ArrayLike,
    *,
    side: Side | None = None,
    parameters: Parameters | None = None,
    surface: int = 0,
    mode: str | None = None,
    tol: float = 1e-9,
    margin: float = MARGIN,
) -> BoundaryEquilibrium:
    """Describe the equilibrium of one field at a point of the surface.

    Parameters
    ----------
    system, parameters, surface, mode
        As in :func:`region`.
    point : array_like (n,)
        The point, in the order of the states.
    side : {"+", "-"}, optional
        Whose equilibrium; by default the field that vanishes there.
    tol : float, optional
        How far away the zero of the field may be, relative to $1 + |x|$.
    margin : float, optional
        Below this distance from a change of class the label is ``"degenerate"``.

    Returns
    -------
    BoundaryEquilibrium
        The equilibrium on the surface, with its class from the linearisations.

    Raises
    ------
    PointError
        Neither field vanishes there, or the point is off the surface.
    DefinitionError
        Hidden dynamics, or vector multipliers; no surface; a ``mode``, ``surface`` or ``side`` that the
        system does not have.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        ``tol`` or ``margin`` is not positive.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[-x - y, x - y], below=[1, 1])
    >>> found = boundary_equilibrium(s, [0, 0])
    >>> found.label, found.unfolding
    ('BF4', 'persistence')
    """
    positive(tol, "tol"), positive(margin, "margin")
    where, x = surface_at(system, point, parameters, 0.0, surface, mode)
    require_linear(system, surface, "boundary equilibrium")
    numbers, derivatives = on_surface(where, x, tol), where.jacobians(x)
    found = [
        equilibrium_distance(f, d, x) for f, d in zip(numbers.fields, derivatives, strict=True)
    ]
    k = int(np.argmin(found)) if side is None else side_index(side)
    if found[k] > tol:
        raise PointError(
            f"point {x}: expected an equilibrium of a field (to {tol:.1e}), received F1 = "
            f"{numbers.fields[0].tolist()}, F2 = {numbers.fields[1].tolist()}; the nearest zero "
            f"is about {found[k]:.3g} away. find_boundary_equilibrium(system, near, "
            "vary=parameter) finds one."
        )
    return boundary_equilibrium_at(where, numbers, k, derivatives, margin)


def boundary_equilibrium_at(
    where: LocalSurface, numbers: Numbers, k: int, derivatives: Array, margin: float = MARGIN
) -> BoundaryEquilibrium:
    """Class of the equilibrium of field ``k`` by the class of the surface."""
    x, gradient, other = numbers.x, numbers.gradient, numbers.fields[1 - k]
    if where.one_sided:
        push = one_sided_at(where, numbers).push
        if where.element and where.element.kind == "contact":
            return _of_a_contact(x, gradient, push, derivatives[0], margin)
        return boundary_equilibrium_of(x, 0, gradient, push, derivatives[0], margin)
    switching = where.switching
    if switching.slides:
        return boundary_equilibrium_of(x, k, gradient, other, derivatives[k], margin)
    if switching.force_jumps:
        return _with_a_jumping_force(x, k, gradient, other, derivatives[k], margin)
    return _of_both_fields(x, switching.kind, derivatives, margin)


def _of_both_fields(x: Array, kind: str, derivatives: Array, margin: float) -> BoundaryEquilibrium:
    """The equilibrium of both fields, which differ by a rank one, or by that and a function of the speed of h."""
    # a force that vanishes with the speed changes neither the sign of a determinant nor the flow in (h, L) of the plane
    margins, numbers = dict[str, float](), dict[str, float]()
    determinants = [float(np.linalg.det(a)) for a in derivatives]
    for i, (a, det) in enumerate(zip(derivatives, determinants, strict=True), 1):
        margins[f"det A{i} = 0"] = _regularity(a)
        numbers[f"det A{i}"] = det
    unfolding = "persistence" if determinants[0] * determinants[1] > 0 else "nonsmooth fold"
    cycle = None
    if x.size == 2:
        traces = [float(np.trace(a)) for a in derivatives]
        numbers |= {f"trace A{i}": t for i, t in enumerate(traces, 1)}
        cycle = born_cycle((traces[0], traces[1]), (determinants[0], determinants[1]))
    label = unfolding if min(margins.values()) >= margin else "degenerate"
    own, other = (np.linalg.eigvals(a) for a in derivatives)
    values = ReadOnly(numbers), ReadOnly(margins)
    return BoundaryEquilibrium(x, "", label, unfolding, False, own, *values, kind, other, cycle)


def _persistence(c: Array, a: Array, push: Array) -> tuple[dict[str, float], dict[str, float], str]:
    """Numbers and margins of an equilibrium with a linear part and the push beside it, and its unfolding."""
    margins = {"determinant": _regularity(a)}
    if not margins["determinant"] > 1e-14:
        return {"s": math.nan}, margins, "degenerate"
    inverse: Array = np.asarray(np.linalg.solve(a, push), dtype=np.float64)
    s, margins["s"] = float(c @ inverse), _sine(c, inverse)
    return {"s": s}, margins, "nonsmooth fold" if s > 0 else "persistence"


def _with_a_jumping_force(
    x: Array, k: int, gradient: Array, other: Array, a: Array, margin: float
) -> BoundaryEquilibrium:
    """The equilibrium of field ``k`` where the other one, not zero, is tangent to the surface too."""
    c = gradient if k == 0 else -gradient
    values, margins, unfolding = _persistence(c, a, other)
    values["bend of h"] = float(c @ a @ other)
    margins["bend of h"] = _sine(c @ a, other)
    label = unfolding if min(margins.values()) >= margin else "degenerate"
    rest = ReadOnly(values), ReadOnly(margins), "velocity continuous"
    return BoundaryEquilibrium(x, SIDES[k], label, unfolding, False, np.linalg.eigvals(a), *rest)


def _of_a_contact(
    x: Array, gradient: Array, push: Array, a: Array, margin: float
) -> BoundaryEquilibrium:
    """An equilibrium whose gap is zero: the contact that it becomes is closed where s < 0, on the side without it."""
    values, margins, unfolding = _persistence(gradient, a, push)
    label = unfolding if min(margins.values()) >= margin else "degenerate"
    rest = ReadOnly(values), ReadOnly(margins)
    return BoundaryEquilibrium(x, "+", label, unfolding, False, np.linalg.eigvals(a), *rest)


def boundary_equilibrium_of(
    x: Array, k: int, gradient: Array, other: Array, a: Array, margin: float
) -> BoundaryEquilibrium:
    """Class from the linear data: grad h, the other field and the linear part of field ``k``."""
    c = gradient if k == 0 else -gradient  # towards the equilibrium's own side
    own, margins, unfolding = _persistence(c, a, other)
    d, label = float(c @ other), unfolding
    values = {"d": d} | own
    margins = {"determinant": 0.0, "d": _sine(c, other)} | margins
    if x.size == 2 and unfolding != "degenerate":
        sign = -1.0 if d < 0 else 1.0
        label, more = _planar_class(sign * a, c, sign * d, own["s"], margins)
        values.update(more)
    if min(margins.values()) < margin:
        label = "degenerate"
    rest = np.linalg.eigvals(a), ReadOnly(values), ReadOnly(margins)
    return BoundaryEquilibrium(x, SIDES[k], label, unfolding, d < 0, *rest)


def _regularity(a: Array) -> float:
    """The smallest singular value relative to the largest."""
    singular = np.linalg.svd(a, compute_uv=False)
    return float(singular[-1] / singular[0]) if singular[0] else 0.0


def _sine(u: Array, v: Array) -> float:
    lengths = float(np.linalg.norm(u) * np.linalg.norm(v))
    return abs(float(u @ v)) / lengths if lengths else 0.0


def _planar_class(
    a: Array, c: Array, d: float, s: float, margins: dict[str, float]
) -> tuple[str, dict[str, float]]:
    """Name for d > 0; adds the planar margins."""
    trace, det = float(np.trace(a)), float(np.linalg.det(a))
    size = float(np.linalg.norm(a, 2))
    disc = trace**2 - 4 * det
    ca = c @ a
    margins["fold"] = abs(float(ca[0] * c[1] - ca[1] * c[0])) / float(
        (np.linalg.norm(ca) * np.linalg.norm(c)) or 1.0
    )
    numbers = {"trace": trace, "determinant": det, "pseudo": -d / s if s else math.nan}
    beside = d / s if s else math.inf
    if det < 0:
        if s < 0:
            return "BS3", numbers
        unstable = 0.5 * (trace + math.sqrt(disc))
        numbers["unstable"] = -unstable
        margins["W^u meets the pseudo-node"] = _apart(beside, unstable)
        return ("BS1" if beside < unstable else "BS2"), numbers
    margins["trace"] = abs(trace) / size
    margins["focus or node"] = abs(disc) / (trace**2 + 4 * det)
    if disc > 0:
        name = "BN" if trace < 0 else "UN"
        return f"{name}{1 if s < 0 else 2}", numbers
    if trace < 0:
        return ("BF4" if s < 0 else "BF5"), numbers
    if s < 0:
        return "BF1", numbers
    landing = fold_orbit_landing(0.5 * trace, 0.5 * math.sqrt(-disc))
    numbers["landing"] = landing
    margins["fold orbit meets the pseudo-saddle"] = _apart(beside, -landing)
    return ("BF2" if -landing < beside else "BF3"), numbers


def _apart(u: float, v: float) -> float:
    """Relative difference; of an infinite number from a finite one it is 1."""
    return relative_difference(u, v) if math.isfinite(u) else 1.0


def fold_orbit_landing(rho: float, omega: float) -> float:
    """L1 where the orbit from the visible fold of an unstable focus comes back to the surface."""
    # The focus is a unit of h above the surface. Along the orbit h - 1 =
    # -exp(rho t) (cos wt - (rho/w) sin wt), which is -1 again once in (pi/w, 2 pi/w).
    q = rho / omega

    def miss(u: float) -> float:  # divided by exp(q u), which overflows for a strong focus
        return math.cos(u) - q * math.sin(u) - math.exp(-q * u)

    from scipy.optimize import brentq

    root = brentq(miss, math.pi, 2 * math.pi, xtol=4e-16, rtol=1e-15)
    return math.exp(min(q * root, 700.0)) * (rho * q + omega) * math.sin(root)


@with_discrete_states_held
def find_boundary_equilibrium(
    system: FilippovSystem,
    near: ArrayLike,
    *,
    vary: str,
    side: Side = "+",
    parameters: Parameters | None = None,
    surface: int = 0,
    mode: str | None = None,
    tol: float = 1e-11,
    max_iterations: int = 50,
) -> BoundaryBifurcation:
    """Find the value of a parameter at which an equilibrium of one field is on the surface.

    Parameters
    ----------
    system, parameters, surface, mode
        As in :func:`region`; the point need not be on the surface.
    near : array_like (n,)
        Start of the search: Newton's method with exact derivatives by states and parameter.
    vary : str
        Name of the parameter; the search starts from its value in ``parameters``.
    side : {"+", "-"}
        Whose field: ``"+"`` is $F1$ (above), ``"-"`` is $F2$ (below).
    tol : float, optional
        The residual at which the search is satisfied.
    max_iterations : int, optional
        Newton's method gives up after this many.

    Returns
    -------
    BoundaryBifurcation
        The point, the value of the parameter and the class of the bifurcation.

    Raises
    ------
    ConvergenceError
        Newton's method does not converge from this start; ``residual`` and ``point`` are the last ones.
    DefinitionError
        Explicit time, hidden dynamics or vector multipliers; no surface; a ``vary``, ``mode``,
        ``surface`` or ``side`` that the system does not have.
    PointError, ParameterError, OptionError
        As in :func:`find_equilibrium`.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, mu = (ca.SX.sym(s) for s in ("x", "y", "mu"))
    >>> s = ns.FilippovSystem(
    ...     [x, y], surface=y, above=[y - x, mu - 1 - y], below=[1, 1], parameters={mu: 0.0})
    >>> found = find_boundary_equilibrium(s, [0.1, 0.1], vary="mu")
    >>> (abs(found.point).round(12) + 0.0).tolist(), round(found.value, 12)
    ([0.0, 0.0], 1.0)
    >>> boundary_equilibrium(s, found.point, parameters=found.parameters).unfolding
    'persistence'
    """
    k = side_index(side)
    require_autonomous(system, "boundary equilibrium", elements=True)
    where, x = surface_at(system, near, parameters, 0.0, surface, mode, search=True)
    advice = "An equilibrium is on the surface at isolated values of a parameter."
    j, n = parameter_index(system, vary, "vary", advice), x.size

    def at(value: float) -> LocalSurface:
        p = where.parameters.copy()
        p[j] = value
        return replace(where, parameters=p)

    def equations(u: Array) -> tuple[Array, Array]:
        here, point = at(u[n]).free, u[:n]
        numbers, (dh, df) = here.at(point), here.parameter_derivatives(point)
        by_states = np.vstack([here.jacobians(point)[k], numbers.gradient])
        by_parameter = np.append(df[k, :, j], dh[j])
        return np.append(numbers.fields[k], numbers.h), np.column_stack([by_states, by_parameter])

    kept = where.with_kept(equations, velocities=True)

    found = search(
        kept,
        np.append(x, where.parameters[j]),
        tol=tol,
        max_iterations=max_iterations,
        what=f"boundary equilibrium of {FIELDS[side]}",
    )
    point, value = found.x[:n], float(found.x[n])
    return BoundaryBifurcation(
        point,
        vary,
        value,
        ReadOnly(at(value).values),
        side,
        float(np.linalg.norm(point - x)),
        found.residual,
        found.iterations,
    )
