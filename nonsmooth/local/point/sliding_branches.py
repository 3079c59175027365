"""All sliding solutions at a point of a surface, with their stability in the layer.

With multipliers that enter nonlinearly, or on an intersection, grad h_i . f(x, lambda) = 0 can have
several solutions in [-1, 1]. Each is a sliding branch; those that attract in the layer problem
eps lambda_i' = grad h_i . f can be followed, the others separate them.

Source: Jeffrey 2018, Hidden Dynamics, ch. 6 and 12; problem 15 of the textbook.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...model import (
    Array,
    FilippovSystem,
    Parameters,
    coupled_of,
    require_system,
    sliding_multipliers,
)
from ..checks import require_surface
from ..discrete_states import with_discrete_states_held


@dataclass(frozen=True, eq=False)
class SlidingBranch:
    """One sliding solution.

    Attributes
    ----------
    multipliers : ndarray (k,)
        Of the sliding surfaces, in their order.
    velocity : ndarray (n,)
        The field of the states there.
    eigenvalues : ndarray (k,)
        Of the matrix $d(grad h_i . f)/d lambda_j$; all with negative real part where the branch attracts.
    """

    multipliers: Array
    velocity: Array
    eigenvalues: NDArray[np.complex128]

    @property
    def stable(self) -> bool:
        """Whether the branch attracts in the layer."""
        return bool(np.real(self.eigenvalues).max() < 0.0)


@with_discrete_states_held
def sliding_branches(
    system: FilippovSystem,
    point: ArrayLike,
    *,
    mode: str | None = None,
    parameters: Parameters | None = None,
    t: float = 0.0,
) -> list[SlidingBranch]:
    """Find the sliding solutions at a point.

    Parameters
    ----------
    system : FilippovSystem
        With one surface or several; multipliers may enter nonlinearly.
    point : array_like (n,)
        A point on the sliding surfaces.
    mode : str, optional
        One letter per surface, ``s`` for those that slide; all of them by default.
    parameters, t : optional
        As in :func:`region`.

    Returns
    -------
    list of SlidingBranch
        In the order of their first multiplier; empty where no combination stays on the surfaces.

    Raises
    ------
    DefinitionError
        ``system`` is none, or has no surface, or vector multipliers; a ``mode`` that it does not have.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    PointError
        A point of a wrong shape or not finite. It need not be on the surfaces.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, lam = (ca.SX.sym(s) for s in ("x", "y", "lam"))
    >>> system = ns.FilippovSystem([x, y], field=[(lam - 0.5) * (lam + 0.2), 1 - lam],
    ...                            multipliers=lam, surface=x, hidden=True)
    >>> for branch in ns.local.sliding_branches(system, [0.0, 0.0]):
    ...     print(branch.multipliers.round(6), branch.stable, branch.velocity.round(6) + 0.0)
    [-0.2] True [0.  1.2]
    [0.5] False [0.  0.5]
    """
    require_system(system)
    require_surface(system)
    coupled = coupled_of(system)
    mode = "s" * system.surface_count if mode is None else mode
    held = coupled.held(mode)
    x, p = system.extended_point(point, t), system.parameter_vector(parameters)
    sliding, branches = coupled.sliding(mode), []
    for unknowns in sliding_multipliers(coupled, mode, x, p, stable_only=False):
        at = coupled.layer_at(x, held, unknowns, p)
        multipliers = (unknowns / at.factors)[sliding]
        if np.abs(multipliers).max(initial=0.0) > 1.0 + 1e-9:
            continue
        slope = (at.slope * at.factors)[np.ix_(sliding, sliding)]
        velocity = coupled.values(x, held, unknowns, p)[0][: system.dimension]
        rates = np.linalg.eigvals(slope).astype(complex)
        branches.append(SlidingBranch(multipliers, velocity, rates))
    return sorted(branches, key=lambda b: float(b.multipliers[0]))
