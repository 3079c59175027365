"""Newton's method with least-norm steps for m equations in n >= m unknowns.

Each step is the shortest one that solves the linearised equations (Gauss-Newton; Ben-Israel 1966),
so the root found is close to the start. Equations are divided by the length of their gradient:
residuals are distances, whatever the units of the equations. A step is halved until the residual
falls. The iteration goes on to rounding and is accepted if the residual is below ``tol``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..model import Array, ConvergenceError, OptionError, PointError
from .lie import positive

Equations = Callable[[Array], tuple[Array, Array]]

_HALVINGS = 40


@dataclass(frozen=True, eq=False)
class Root:
    """What a search found.

    Attributes
    ----------
    x : ndarray (n,)
    residual : float
        Largest distance |r_i|/|grad r_i| of the equations.
    iterations : int
    history : tuple of float
        Residual at the start and after each step.
    conditioning : float
        Smallest over largest singular value of the normalised Jacobian.
    linear : bool
        Whether the last steps (six or more) gained less than a factor 5 each: a multiple root,
        where the equations have dependent gradients.
    """

    x: Array
    residual: float
    iterations: int
    history: tuple[float, ...]
    conditioning: float
    linear: bool


def _normalised(equations: Equations, x: Array) -> tuple[Array, Array]:
    r, jacobian = equations(x)
    lengths = np.linalg.norm(jacobian, axis=1)
    lengths[lengths == 0] = 1.0
    return r / lengths, jacobian / lengths[:, None]


def _finite(*arrays: Array) -> bool:
    return all(bool(np.all(np.isfinite(a))) for a in arrays)


def _damped(equations: Equations, x: Array, r: Array, step: Array) -> tuple[Array, float] | None:
    """Halve the step until the residual falls; None if it never does."""
    _, jacobian = equations(x)
    lengths = np.linalg.norm(jacobian, axis=1)
    lengths[lengths == 0] = 1.0
    factor, old = 1.0, float(np.max(np.abs(r)))
    for _ in range(_HALVINGS):
        trial = x + factor * step
        values, gradients = equations(trial)
        if _finite(values, gradients):
            new = float(np.max(np.abs(values / lengths)))
            if new <= (1 - 1e-4 * factor) * old:
                return trial, factor
        factor /= 2
    return None


def solve(
    equations: Equations, start: Array, *, tol: float, max_iterations: int, what: str
) -> Root:
    """Find a root close to ``start``.

    Parameters
    ----------
    equations : callable
        x (n,) -> values (m,), Jacobian (m, n).
    start : ndarray (n,)
    tol : float
        Accepted residual, relative to 1 + |x|; its square root at a multiple root.
    max_iterations : int
    what : str
        Named in messages, e.g. ``"two-fold"``.

    Raises
    ------
    ConvergenceError, PointError, OptionError

    Examples
    --------
    >>> circle = lambda x: (np.array([x @ x - 1]), 2 * x[None, :])
    >>> solve(circle, np.array([3.0, 4.0]), tol=1e-12, max_iterations=20, what="circle").x
    array([0.6, 0.8])
    """
    positive(tol, "tol")
    if isinstance(max_iterations, bool) or int(max_iterations) != max_iterations:
        raise OptionError(f"max_iterations: expected a whole number, received {max_iterations!r}.")
    positive(max_iterations, "max_iterations")
    x = np.array(start, dtype=float)
    r, jacobian = _normalised(equations, x)
    if not _finite(r, jacobian):
        raise PointError(
            f"near: expected a start where the equations of a {what} are finite, received {x}. "
            "A root, logarithm or division of the fields left its domain; move the start."
        )
    history, steps = [float(np.max(np.abs(r)))], list[float]()
    while len(steps) < max_iterations:
        step = np.asarray(-np.linalg.lstsq(jacobian, r, rcond=1e-14)[0], dtype=np.float64)
        if float(np.linalg.norm(step)) <= 2.0**-51 * float(np.linalg.norm(x)):
            break
        damped = _damped(equations, x, r, step)
        if damped is None:
            break
        x, factor = damped
        r, jacobian = _normalised(equations, x)
        history.append(float(np.max(np.abs(r))))
        steps.append(factor * float(np.linalg.norm(step)))
    return _accept(x, jacobian, history, steps, tol, max_iterations, what)


def _accept(
    x: Array,
    jacobian: Array,
    history: list[float],
    steps: list[float],
    tol: float,
    max_iterations: int,
    what: str,
) -> Root:
    singular = np.linalg.svd(jacobian, compute_uv=False)
    conditioning = float(singular[-1] / singular[0]) if singular[0] else 0.0
    above_rounding = [s for s in steps if s > 1e-10 * (1 + np.linalg.norm(x))][-9:]
    gains = [b / a for a, b in pairwise(above_rounding)]
    # all but one: the last step, at rounding, may be any size
    linear = len(gains) >= 6 and sorted(gains)[1] > 0.2
    # rounding hides a multiple root below the square root of what it does to a simple one
    if history[-1] > (np.sqrt(tol) if linear else tol) * (1 + np.linalg.norm(x)):
        cause = (
            "its equations have (nearly) dependent gradients there"
            if conditioning < 1e-8
            else "it is small but not at rounding: a multiple root, where gradients are dependent, "
            "or large cancelling terms in the equations"
            if history[-1] < np.sqrt(tol)
            else "the iteration budget was used up"
            if len(steps) >= max_iterations
            else "no smaller residual lies along the step: perhaps there is none nearby"
        )
        raise ConvergenceError(
            f"{what}: expected a residual below {tol:.1e} (1 + |x|), received {history[-1]:.3e} "
            f"after {len(steps)} iterations, at {x.tolist()}; {cause}. Start closer, e.g. from a "
            "point of a simulation, or raise max_iterations or tol.",
            residual=history[-1],
            point=x,
        )
    return Root(x, history[-1], len(steps), tuple(history), conditioning, linear)
