"""Fold-folds: points of a planar system where both fields are tangent to the surface.

F1 = (a1, b1 x), F2 = (a2, b2 x) in a tangent coordinate x: VV1, VV2, VI1 to VI3, II1, II2 by
visibility and directions; only VI with opposite directions needs the sizes (Kuznetsov, Rinaldi &
Gragnani 2003). The margins of a class are dimensionless distances from where it changes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...model import Array, DefinitionError, FilippovSystem, Parameters, PointError, require_system
from ...model.checks import positive
from ...result_tables import Tabular
from ..checks import MARGIN, relative_difference, require_generic
from ..discrete_states import with_discrete_states_held
from ..point.surface_point import LocalSurface, Numbers, on_surface, surface_at
from ..read_only import ReadOnly
from .folds import bend


@dataclass(frozen=True, eq=False)
class FoldFold(Tabular):
    """A point of a planar system where both fields are tangent to the surface.

    Attributes
    ----------
    point : ndarray (2,)
        The point, in the order of the states.
    label : str
        ``"VV1"``, ``"VV2"``, ``"VI1"``, ``"VI2"``, ``"VI3"``, ``"II1"``, ``"II2"``, or
        ``"degenerate"``.
    visible : (bool, bool)
        Of the folds of $F1$ and $F2$.
    same_direction : bool
        Whether the two fields point the same way along the surface.
    numbers : mapping
        ``L11``, ``L22``, ``a1``, ``a2``, ``b1``, ``b2``; for II2 also ``stability``: positive if
        the fused focus is stable (its pseudo-Hopf cycle is then stable too).
    margins : mapping
        How far each inequality of the label is from equality.
    """

    point: Array
    label: str
    visible: tuple[bool, bool]
    same_direction: bool
    numbers: Mapping[str, float]
    margins: Mapping[str, float]

    @property
    def margin(self) -> float:
        """Smallest of the margins."""
        return min(self.margins.values())


@with_discrete_states_held
def fold_fold(
    system: FilippovSystem,
    point: ArrayLike,
    *,
    parameters: Parameters | None = None,
    surface: int = 0,
    mode: str | None = None,
    tol: float = 1e-9,
    margin: float = MARGIN,
) -> FoldFold:
    """Describe the fold-fold of a planar system at a point where $L1 = L2 = 0$.

    Parameters
    ----------
    system, parameters, surface, mode
        As in :func:`region`.
    point : array_like (2,)
        The point, in the order of the states.
    tol : float, optional
        Largest angle of a field with the surface, and relative distance from it.
    margin : float, optional
        Below this distance from a change of class the label is ``"degenerate"``.

    Returns
    -------
    FoldFold
        The two tangencies that meet, and their kind.

    Raises
    ------
    DefinitionError
        Not a planar system; explicit time; vector multipliers; no surface; a ``mode`` or ``surface``
        that the system does not have.
    PointError
        The fields are not both tangent there; off the surface; a wrong shape; not finite.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        ``tol`` or ``margin`` is not positive.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[1, -x], below=[-1, -x])
    >>> fold_fold(s, [0, 0]).label
    'II2'
    """
    positive(tol, "tol"), positive(margin, "margin")
    require_planar(system, "fold-fold")
    where, x = surface_at(system, point, parameters, 0.0, surface, mode)
    require_generic(where.system, where.surface, where.mode, "fold-fold", force=True)
    numbers = on_surface(where, x, tol)
    if np.any(np.abs(numbers.angles) > tol):
        raise PointError(
            f"point {x}: expected a fold-fold, L1 = L2 = 0, received L1 = {numbers.lie[0]:.6g}, "
            f"L2 = {numbers.lie[1]:.6g}. In the plane fold-folds happen at isolated values of a "
            "parameter."
        )
    return fold_fold_of(where, numbers, margin)


def fold_fold_of(where: LocalSurface, numbers: Numbers, margin: float = MARGIN) -> FoldFold:
    """Class from the numbers at the point; F1 and F2 must not vanish."""
    tangent = numbers.tangents[:, 0]
    a = numbers.fields @ tangent
    b = numbers.lie_gradients @ tangent
    second = a * b  # L11, L22: the fields are tangent
    visible = (bool(second[0] > 0), bool(second[1] < 0))
    same = bool(a[0] * a[1] > 0)
    margins = {f"L{k + 1}{k + 1}": bend(numbers, k, float(second[k])) for k in (0, 1)}
    names = ("L11", "L22", "a1", "a2", "b1", "b2")
    values = dict(zip(names, map(float, (*second, *a, *b)), strict=True))
    if visible[0] == visible[1]:
        label = ("VV" if visible[0] else "II") + ("1" if same else "2")
    elif same:
        label = "VI1"
    else:
        seen, unseen = (0, 1) if visible[0] else (1, 0)
        saddle, node = abs(a[unseen] * b[seen]), abs(a[seen] * b[unseen])
        margins["a2 b1 = a1 b2"] = relative_difference(saddle, node)
        label = "VI2" if saddle > node else "VI3"
    if label == "II2" and min(margins.values()) > 0:
        values["stability"] = fused_focus(where, numbers)
    if min(margins.values()) < margin:
        label = "degenerate"
    return FoldFold(numbers.x, label, visible, same, ReadOnly(values), ReadOnly(margins))


def require_planar(system: FilippovSystem, what: str) -> None:
    """Refuse a system that is not planar and autonomous."""
    require_system(system)
    if system.extended_dimension != 2:
        size = f"{system.dimension} states{' and time' if system.time_dependent else ''}"
        raise DefinitionError(
            f"{what}: expected a planar system without explicit time, received {size}. In three "
            "and more dimensions two folds meet in a two-fold: find_two_fold."
        )


def fused_focus(where: LocalSurface, numbers: Numbers) -> float:
    """Stability of a fused focus (II2): positive if orbits spiral in."""
    # A flight of the field (a + p x + q y, b x + r x^2 + s y) maps x to -x + beta x^2 with
    # beta = 2 (b p + b s - a r)/(3 a b); one flight each gives x + (beta2 - beta1) x^2.
    tangent = numbers.tangents[:, 0]
    gradient, square = numbers.gradient, float(numbers.gradient @ numbers.gradient)
    hessians, _ = where.hessians(numbers.x)
    derivatives = where.jacobians(numbers.x)
    curvature = float(tangent @ hessians[0] @ tangent) / square  # of the surface, times grad h
    betas = []
    for k in (0, 1):
        a = float(numbers.fields[k] @ tangent)
        b = float(numbers.lie_gradients[k] @ tangent)
        p = float(tangent @ derivatives[k] @ tangent)
        s = float(numbers.lie_gradients[k] @ gradient) / square
        along = float(tangent @ hessians[1 + k] @ tangent)
        r = 0.5 * (along - curvature * float(gradient @ numbers.lie_gradients[k]))
        betas.append(2 * (b * p + b * s - a * r) / (3 * a * b))
    return float(np.sign(numbers.fields[0] @ tangent)) * (betas[1] - betas[0])
