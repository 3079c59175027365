"""The verb ``continue_equilibrium``: an equilibrium or pseudo-equilibrium followed as a parameter varies."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...local.checks import parameter_index, require_autonomous, require_linear
from ...local.point.surface_point import Side, place
from ...local.searches.equilibria import find_equilibrium
from ...local.searches.pseudo_equilibria import find_pseudo_equilibrium
from ...model import FilippovSystem, Parameters, require_system, whole
from ...model.checks import positive
from .branch import Branch
from .branch_curves import check_bounds, follow_branch
from .equilibrium_branches import Equilibria, EquilibriumCurve, PseudoEquilibriumCurve


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

    Pseudo-arclength continuation both ways from the value in ``parameters``, round turning points,
    with stability at each point.

    Parameters
    ----------
    system, parameters, surface, mode
        As in :func:`region`; a smooth system has neither surface nor mode.
    near : array_like (n,)
        Start of the search for the first one.
    parameter : str
        Name of the parameter that varies.
    bounds : (float, float)
        Where the branch ends.
    side : {"+", "-"} or None, optional
        Of the field $F1$ or $F2$; None for a pseudo-equilibrium; ``"+"`` for the one field of a smooth system.
    step : float, optional
        Largest step where the branch bends, relative to the width of the bounds and to the size of
        the states.
    max_points : int, optional
        Of each piece.
    through : bool, optional
        Whether to go on beyond a boundary equilibrium with the pseudo-equilibria, or equilibria,
        that end there too.
    progress : bool, optional
        Whether to show a bar that counts points. An interrupt (Ctrl-C) returns what was computed.

    Returns
    -------
    Branch
        Its ``solutions`` are Equilibrium and PseudoEquilibrium. Events: ``"fold"``, ``"Hopf"`` (with
        its first Lyapunov coefficient, for an eigenvector of length one), ``"branch point"``,
        ``"pseudo-saddle-node"``, ``"boundary equilibrium"`` of any surface (persistence or nonsmooth
        fold, in its ``far_side``), ``"two-fold"`` (sliding changes its stability), ``"intersection"``
        (a pseudo-equilibrium meets another surface, where its branch ends).

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
    require_system(system)
    require_autonomous(system, "continuation of equilibria")
    positive(step, "step")
    whole(max_points, "max_points", least=2)
    index = parameter_index(system, parameter)
    where, _ = place(system, near, parameters, 0.0, surface, mode, smooth=side is not None)
    value = float(where.parameters[index])
    low, high = check_bounds(bounds, value, parameter)
    given: dict[str, Any] = dict(parameters=parameters, surface=surface, mode=mode)
    curve: Equilibria
    if side is None:
        require_linear(system, surface, "pseudo-equilibrium")
        pseudo = find_pseudo_equilibrium(system, near, **given)
        size = max(1.0, float(np.abs(pseudo.point).max()))
        scale = np.append(np.full(system.dimension, size), [1.0, high - low])
        curve = PseudoEquilibriumCurve(where, (index,), scale)
        start = np.append(pseudo.point, [pseudo.alpha, value])
    else:
        found = find_equilibrium(system, near, side=side, **given)
        size = max(1.0, float(np.abs(found.point).max()))
        curve = EquilibriumCurve(
            where, (index,), np.append(np.full(system.dimension, size), high - low), side
        )
        start = np.append(found.point, value)
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
