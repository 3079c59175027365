"""The search for special points: Newton's method on equations in some of the states, others held."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...model import (
    Array,
    ConvergenceError,
    DefinitionError,
    FilippovSystem,
    NonsmoothError,
    OptionError,
    real_array,
)
from ...solvers.newton import Equations, solve


@dataclass(frozen=True, eq=False)
class Found:
    """Where a search ended, or a point that was given."""

    x: Array
    distance: float = 0.0
    residual: float = 0.0
    iterations: int = 0
    linear: bool = False

    @property
    def effort(self) -> dict[str, Any]:
        """What results keep of it."""
        return dict(distance=self.distance, residual=self.residual, iterations=self.iterations)


def search(
    equations: Equations,
    start: Array,
    free: Sequence[int] | None = None,
    *,
    tol: float,
    max_iterations: int,
    what: str,
) -> Found:
    """Find a zero close to ``start``, changing the coordinates ``free`` only (all by default)."""
    chosen = list(range(start.size) if free is None else free)

    def full(u: Array) -> Array:
        x = start.copy()
        x[chosen] = u
        return x

    def restricted(u: Array) -> tuple[Array, Array]:
        values, jacobian = equations(full(u))
        return values, jacobian[:, chosen]

    try:
        root = solve(restricted, start[chosen], tol=tol, max_iterations=max_iterations, what=what)
    except ConvergenceError as error:
        error.point = full(np.asarray(error.point))
        raise
    x = full(root.x)
    away = float(np.linalg.norm(x - start))
    return Found(x, away, root.residual, root.iterations, root.linear)


def unknowns(system: FilippovSystem, hold: Sequence[str], equations: int, what: str) -> list[int]:
    """Indices of the states that a search may change."""
    names = [hold] if isinstance(hold, str) else [str(name) for name in hold]
    unknown = [name for name in names if name not in system.state_names]
    if unknown:
        raise DefinitionError(
            f"hold: expected names of states among {list(system.state_names)}, received "
            f"{unknown}. Parameters keep their value anyway."
        )
    free = [i for i, name in enumerate(system.state_names) if name not in names]
    if len(free) < equations:
        advice = "Hold fewer states."
        if equations == 3 and system.dimension < 3:
            advice = (
                "In the plane a two-fold (fold-fold) happens at isolated values of a parameter: make "
                "that parameter a state with derivative 0 to find it."
            )
        raise DefinitionError(
            f"{what}: expected at least {equations} free states, one for each equation, received "
            f"{len(free)} ({system.dimension} states, {len(names)} held). {advice}"
        )
    return free


def find_all(search: Any, starts: ArrayLike, *, apart: float = 1e-6) -> list[Any]:
    """Results of a search from many starts, each once; starts that lead nowhere are left out.

    The list is not proven complete: :func:`nonsmooth.prove_all` proves that there are no others.

    Parameters
    ----------
    search : callable
        Takes a start (n,), returns an object with a ``point``, e.g. ``lambda x:
        find_equilibrium(system, x, side="-")``.
    starts : array_like (k, n)
        Points from which to search.
    apart : float, optional
        Two results closer than this, relative to $1 + |x|$, are the same.

    Returns
    -------
    list
        What the search returned, each once, in the order of the starts.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[x**2 - 1, -y], below=[1, 1])
    >>> starts = [[-2, 0], [-1, 1], [0.5, 0], [3, 1]]
    >>> found = find_all(lambda p: ns.find_equilibrium(s, p), starts)
    >>> [e.kind for e in found]
    ['stable node', 'saddle']
    """
    found: list[Any] = []
    if not callable(search):
        raise OptionError(
            f"search: expected a function of a start, received {search!r}. For example lambda x: "
            "nonsmooth.find_fold(system, x)."
        )
    for start in np.atleast_2d(real_array(starts, "starts")):
        try:
            result = search(start)
        except NonsmoothError:
            continue
        near = apart * (1 + float(np.linalg.norm(result.point)))
        if all(np.linalg.norm(result.point - other.point) > near for other in found):
            found.append(result)
    return found
