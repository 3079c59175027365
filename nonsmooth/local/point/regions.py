"""Regions of a switching surface, the weight alpha and the sliding vector field (Filippov 1988)."""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from ...model import Array, FilippovSystem, Parameters, PointError, call, motion, require_system
from ...model.checks import positive
from ...model.laws.frozen import Frozen
from ..discrete_states import with_discrete_states_held
from .higher_codimension import law_at
from .one_sided import one_sided_at, velocity_while_closed
from .surface_point import TOLERANCE, LocalSurface, Numbers, on_surface, surface_at


class Region(Enum):
    """Region of a surface at a point, by the two fields; above is $h > 0$ with $F1$.

    Examples
    --------
    >>> print(Region.ATTRACTING)
    attracting sliding
    """

    ATTRACTING = "attracting sliding"  # L1 < 0 < L2
    REPELLING = "repelling sliding"  # L2 < 0 < L1
    CROSSING_UP = "crossing up"  # L1, L2 > 0
    CROSSING_DOWN = "crossing down"  # L1, L2 < 0
    TANGENT_ABOVE = "tangency of the field above"  # L1 = 0
    TANGENT_BELOW = "tangency of the field below"  # L2 = 0
    TWO_FOLD = "tangency of both fields"  # L1 = L2 = 0
    MIXED = "sliding that neither attracts nor repels"  # or a set where M is not positive definite
    SLIDING = "sliding"  # of a set of codimension two or three: |M^-1 a| < 1
    CROSSING = "crossing"  # |M^-1 a| > 1
    BOUNDARY = "boundary of sliding"  # |M^-1 a| = 1

    def __str__(self) -> str:
        return self.value

    @property
    def sliding(self) -> bool:
        """Whether the point is in a sliding region, attracting or repelling."""
        return self in (Region.ATTRACTING, Region.REPELLING, Region.SLIDING)


def region_of(numbers: Numbers, tol: float) -> Region:
    """Name the region from L1 and L2; zero is an angle with the surface of at most ``tol``."""
    above, below = (0 if abs(a) <= tol else int(np.sign(a)) for a in numbers.angles)
    return {
        (-1, 1): Region.ATTRACTING,
        (1, -1): Region.REPELLING,
        (1, 1): Region.CROSSING_UP,
        (-1, -1): Region.CROSSING_DOWN,
        (0, 0): Region.TWO_FOLD,
    }.get((above, below), Region.TANGENT_ABOVE if above == 0 else Region.TANGENT_BELOW)


def region_at(where: LocalSurface, numbers: Numbers, tol: float) -> Region:
    """Name the region of a surface, or of the boundary of a condition or contact, at a point."""
    if not where.one_sided:
        return region_of(numbers, tol)
    way = one_sided_at(where, numbers).way(tol)
    return {1: Region.CROSSING_UP, -1: Region.ATTRACTING, 0: Region.TANGENT_ABOVE}[way]


@with_discrete_states_held
def region(
    system: FilippovSystem,
    point: ArrayLike,
    *,
    parameters: Parameters | None = None,
    t: float = 0.0,
    surface: int = 0,
    mode: str | None = None,
    tol: float = TOLERANCE,
) -> Region:
    """Region of the switching surface, or of a set of codimension two or three, in which a point lies.

    On the boundary of a condition or contact ``ATTRACTING`` where it is closed or hit, ``CROSSING_UP`` where a
    motion leaves it. On a set $h = 0$ with a vector multiplier $h' = a - M lambda$: ``SLIDING`` where $|M^-1 a| < 1$, so that
    $lambda = M^-1 a$ keeps the motion on it; ``CROSSING`` where $|M^-1 a| > 1$ (see
    :func:`limit_directions`), ``BOUNDARY`` between; ``MIXED`` where M is indefinite, or has no attracting
    direction.

    Parameters
    ----------
    system : FilippovSystem
        With a surface, or a set of codimension two or three.
    point : array_like (n,)
        A point on the surface: $|h|/|grad h| <= tol (1 + |x|)$.
    parameters : mapping, optional
        Values that replace defaults.
    t : float, optional
        Time, where the system depends on it.
    surface : int, optional
        Number of the surface or set.
    mode : str, optional
        With several surfaces, one letter each: the sides of the others. By default the signs of
        their functions at the point.
    tol : float, optional
        A field is tangent when $|L_i| <= tol |grad h| |F_i|$: it makes an angle below ``tol`` with
        the surface. This does not change when h or a field is multiplied by a positive number.

    Returns
    -------
    Region
        What the fields do at the point.

    Raises
    ------
    PointError
        Off the surface (the message says how far and gives the nearest point), on two surfaces without
        a ``mode`` that chooses a side, a wrong shape, not finite.
    DefinitionError
        ``system`` is none, or has no surface; a ``mode`` or ``surface`` that it does not have.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        ``tol`` is not positive.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> s = ns.FilippovSystem([x, v], surface=v, above=[v, -x - 0.4], below=[v, -x + 0.4])
    >>> [str(region(s, [x0, 0.0])) for x0 in (0.2, -0.5, 0.4)]
    ['attracting sliding', 'crossing up', 'tangency of the field below']
    """
    require_system(system, sets=True, complementarity=True, joints=True)
    if system.sets and _is_set(system, surface):
        tol = positive(tol, "tol")
        return _region_of_set(law_at(system, point, parameters, t, surface, mode, tol), tol)
    where, x = surface_at(system, point, parameters, t, surface, mode)
    return region_at(where, on_surface(where, x, positive(tol, "tol"), slopes=where.one_sided), tol)


def _is_set(system: FilippovSystem, surface: int) -> bool:
    members = system.entries[surface] if surface in range(len(system.entries)) else ()
    return members in system.sets


def _region_of_set(law: Frozen, tol: float) -> Region:
    """Where sliding along a set is possible, and whether it attracts."""
    if law.indefinite:
        return Region.MIXED
    size = float(np.abs(law.m).max()) + float(np.abs(law.a).max())
    lam = np.linalg.lstsq(law.m, law.a, rcond=1e-13)[0]
    if np.abs(law.m @ lam - law.a).max() > tol * size:
        return Region.CROSSING  # friction does not act against all of a
    needed = float(np.linalg.norm(lam))
    if abs(needed - 1.0) <= tol:
        return Region.BOUNDARY
    if needed > 1.0 or not np.any(law.m):
        return Region.CROSSING
    return Region.SLIDING if law.definite else Region.MIXED


def _refuse_crossing(numbers: Numbers, found: Region, what: str) -> None:
    if found in (Region.CROSSING_UP, Region.CROSSING_DOWN):
        raise PointError(
            f"{what}: expected a point of the sliding region or its boundary, L1 L2 <= 0, "
            f"received {found} at {numbers.x.tolist()}, L1 = {numbers.lie[0]:.6g}, L2 = "
            f"{numbers.lie[1]:.6g}. Orbits cross the surface here; no convex combination is "
            "tangent to it."
        )


@with_discrete_states_held
def alpha(
    system: FilippovSystem,
    point: ArrayLike,
    *,
    parameters: Parameters | None = None,
    t: float = 0.0,
    surface: int = 0,
    mode: str | None = None,
    tol: float = TOLERANCE,
) -> float:
    """Weight of the field below in the sliding field, $alpha = L1/(L1 - L2) = (1 - lambda)/2$.

    It is 0 where $L1 = 0$ and 1 where $L2 = 0$, and in between $F_s = (1 - alpha) F1 + alpha F2$
    (Filippov 1988, section 4).

    Parameters
    ----------
    system, point, parameters, t, surface, mode, tol
        As in :func:`region`.

    Returns
    -------
    float in [0, 1]
        The share of the field below.

    Raises
    ------
    PointError
        In a crossing region; where both fields are tangent $(0/0)$; and as in :func:`region`.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> s = ns.FilippovSystem([x, v], surface=v, above=[v, -x - 0.4], below=[v, -x + 0.4])
    >>> round(alpha(s, [0.2, 0.0]), 12)
    0.75
    """
    where, x = surface_at(system, point, parameters, t, surface, mode)
    numbers = on_surface(where, x, positive(tol, "tol"), slopes=where.one_sided)
    if where.one_sided:
        raise PointError(
            f"alpha: a condition or contact has no field below. Its multiplier at {x.tolist()} is in "
            "classify(system, point).evidence."
        )
    found = region_of(numbers, tol)
    _refuse_crossing(numbers, found, "alpha")
    if found is Region.TWO_FOLD:
        raise PointError(
            "alpha: expected L1 and L2 not both zero, received both fields tangent at "
            f"{x.tolist()}. alpha is 0/0 at a two-fold and its limit depends on the direction; "
            "the sliding field itself is finite where the two fields coincide (sliding_field)."
        )
    if not found.sliding:
        return 0.0 if found is Region.TANGENT_ABOVE else 1.0
    return float(numbers.lie[0] / (numbers.lie[0] - numbers.lie[1]))


@with_discrete_states_held
def sliding_field(
    system: FilippovSystem,
    point: ArrayLike,
    *,
    parameters: Parameters | None = None,
    t: float = 0.0,
    surface: int = 0,
    mode: str | None = None,
    tol: float = TOLERANCE,
) -> Array:
    """Velocity of sliding, attracting or repelling: the convex combination tangent to the surface.

    Factors that $L1 - L2$ and $F1 - F2$ have in common are cancelled symbolically, so the field is
    accurate close to a two-fold where they vanish (Coulomb friction at zero normal force). At such
    a point itself it is $F1 = F2$.

    Parameters
    ----------
    system, point, parameters, t, surface, mode, tol
        As in :func:`region`.

    Returns
    -------
    ndarray (n,)
        Velocity of the sliding motion.

    Raises
    ------
    PointError
        In a crossing region; at a two-fold where the fields differ $(0/0)$; and as in
        :func:`region`.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> s = ns.FilippovSystem([x, v], surface=v - 1, above=[v, -x - 2], below=[v, -x + 2])
    >>> sliding_field(s, [0.2, 1.0]).round(12) + 0.0
    array([1., 0.])
    """
    where, x = surface_at(system, point, parameters, t, surface, mode)
    numbers = on_surface(where, x, positive(tol, "tol"), slopes=where.one_sided)
    if where.one_sided:
        return velocity_while_closed(where, numbers, tol)[: system.dimension]
    found = region_of(numbers, tol)
    _refuse_crossing(numbers, found, "sliding field")
    if found is Region.TWO_FOLD and not coincide(numbers, tol):
        raise PointError(
            "sliding field: expected L1 and L2 not both zero, or F1 = F2, received both fields "
            f"tangent and different at {x.tolist()}. The sliding field is 0/0 at this two-fold "
            "and its limit depends on the direction; find_two_fold gives the class of the point."
        )
    build = motion(where.system, where.mode)
    function = where.system.function(("sliding field", where.mode), lambda: [build.field])
    value = call(function, x, where.parameters)[0].ravel()
    if found is Region.TWO_FOLD:
        middle = numbers.fields.mean(axis=0)
        # at, or within rounding of, the point itself the quotient may be 0/0 or noise
        if not np.linalg.norm(value - middle) <= 10 * tol * np.linalg.norm(middle):
            value = middle
    return value[: system.dimension]


def coincide(numbers: Numbers, tol: float) -> bool:
    """Whether F1 = F2 at the point, relative to their size."""
    f1, f2 = numbers.fields
    size = float(np.linalg.norm(f1) + np.linalg.norm(f2))
    return bool(np.linalg.norm(f1 - f2) <= tol * size)
