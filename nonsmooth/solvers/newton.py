"""Newton's method with least-norm steps for m equations in n >= m unknowns.

Each step is the shortest one that solves the linearised equations (Gauss-Newton; Ben-Israel 1966),
so the root found is close to the start. Equations are divided by the length of their gradient:
residuals are distances, whatever the units of the equations. A step is halved until the residual
falls. The iteration continues to rounding and is accepted if the residual is below ``tol``.

From a good guess of as many equations as unknowns ``converge`` takes full steps and stops as soon as
the next one would be below ``tol``; ``Secant`` carries the Jacobian from one evaluation to the next
(Broyden 1965). ``solve_many`` takes full steps from many starts at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..model import Array, ConvergenceError, DefinitionError, OptionError, PointError, real_array
from ..model.checks import positive
from . import linear_equations

Equations = Callable[[Array], tuple[Array, Array]]
Values = Callable[[Array], Array]

_HALVINGS = 40

#: After full steps below the first size, relative to the unknowns, others with the same Jacobian are tried:
#: so many, as long as each is below this part of the one before.
_SMALL, _CHORDS, _CONTRACTS = 1e-3, 4, 0.05

#: Changes over steps shorter than this part of the unknowns are rounding.
_SHORT = 1e-11


@dataclass(frozen=True, eq=False)
class Root:
    """The root that a search found."""

    x: Array
    residual: float
    iterations: int
    history: tuple[float, ...]
    conditioning: float
    linear: bool


@dataclass(frozen=True, eq=False)
class _Values:
    """Equations at x, with the lengths of their gradients."""

    x: Array
    values: Array
    jacobian: Array
    lengths: Array

    @property
    def residuals(self) -> Array:
        return self.values / self.lengths

    @property
    def residual(self) -> float:
        return float(np.abs(self.residuals).max())

    @property
    def directions(self) -> Array:
        return self.jacobian / self.lengths[:, None]

    @property
    def finite(self) -> bool:
        return bool(np.isfinite(self.values).all() and np.isfinite(self.lengths).all())


def _evaluate(equations: Equations, x: Array) -> _Values:
    values, jacobian = equations(x)
    with np.errstate(over="ignore"):  # far from a root entries may be huge: a trial that is no step
        lengths = np.sqrt((jacobian * jacobian).sum(axis=1))
    lengths[lengths == 0] = 1.0
    return _Values(x, values, jacobian, lengths)


def _damped(equations: Equations, at: _Values, step: Array) -> tuple[_Values, float] | None:
    """Halve the step until the residual falls; None if it does not."""
    factor, old = 1.0, at.residual
    for _ in range(_HALVINGS):
        trial = _evaluate(equations, at.x + factor * step)
        if trial.finite:
            new = float(np.abs(trial.values / at.lengths).max())
            if new <= (1 - 1e-4 * factor) * old:
                return trial, factor
        factor /= 2
    return None


def solve(
    equations: Equations, start: Array, *, tol: float, max_iterations: int, what: str
) -> Root:
    """Find a root close to ``start``."""
    positive(tol, "tol")
    if isinstance(max_iterations, bool) or int(max_iterations) != max_iterations:
        raise OptionError(f"max_iterations: expected a whole number, received {max_iterations!r}.")
    positive(max_iterations, "max_iterations")
    at = _evaluate(equations, np.array(start, dtype=float))
    if not at.finite:
        raise PointError(
            f"near: expected a start where the equations of a {what} are finite, received {at.x}. "
            "A root, logarithm or division of the fields left its domain; move the start."
        )
    history, steps = [at.residual], list[float]()
    while len(steps) < max_iterations:
        step = np.asarray(-np.linalg.lstsq(at.directions, at.residuals, rcond=1e-14)[0], float)
        if float(np.linalg.norm(step)) <= 2.0**-51 * float(np.linalg.norm(at.x)):
            break
        damped = _damped(equations, at, step)
        if damped is None:
            break
        at, factor = damped
        history.append(at.residual)
        steps.append(factor * float(np.linalg.norm(step)))
    return _accept(at.x, at.directions, history, steps, tol, max_iterations, what)


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


# good guesses ----------------------------------------------------------------------------------


class Secant:
    """Equations without derivatives: the Jacobian is updated from differences (Broyden 1965).

    Along a curve the Jacobian of the last point is good, and a point costs two or three evaluations
    instead of those and as many more as there are unknowns.

    Parameters
    ----------
    values : callable
        Takes unknowns (n,) and returns values (m,).
    scale : float
        Size of the unknowns.

    Examples
    --------
    >>> converge(Secant(lambda u: u**2 - 2.0, 1.0), np.array([1.0])).tolist()
    [1.414213562373095...]
    """

    def __init__(self, values: Values, scale: float):
        self.values, self.scale = values, scale
        self.jacobian: Array | None = None
        self._last: tuple[Array, Array] | None = None

    def forget(self) -> bool:
        """Discard the Jacobian; whether there was one."""
        had, self.jacobian, self._last = self.jacobian is not None, None, None
        return had

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Values (m,) and the carried Jacobian (m, n) at x (n,)."""
        r = self.values(x)
        if self.jacobian is None:
            delta = 1e-6 * self.scale
            columns = [(self.values(x + e) - r) / delta for e in delta * np.eye(len(x))]
            self.jacobian = np.column_stack(columns)
        elif self._last is not None:
            step, change = x - self._last[0], r - self._last[1]
            square = float(step @ step)
            if square > (_SHORT * self.scale) ** 2:
                miss = change - self.jacobian @ step
                self.jacobian = self.jacobian + np.outer(miss, step) / square
        self._last = x, r
        return r, self.jacobian


def converge(
    equations: Equations,
    start: Array,
    *,
    tol: float = 1e-15,
    scale: float = 1.0,
    max_iterations: int = 30,
    linear: Callable[[Array, Array], Array] | None = None,
    noise: float = 1e-11,
    values: Callable[[Array], Array | None] | None = None,
) -> Array | None:
    """Root of as many equations as unknowns from a good guess, or None.

    Full steps; it ends with the step after which the next one would be below ``tol``: steps shrink
    by a factor that itself shrinks, so the next one is below the square of the size over the last one.

    Parameters
    ----------
    equations : callable
        Takes unknowns (n,) and returns values (n,) and Jacobian (n, n); a :class:`Secant` is tried again
        with fresh differences.
    start : ndarray (n,)
        Where the iteration starts.
    tol : float, optional
        Accepted error, relative to ``scale``.
    scale : float, optional
        Size of the unknowns.
    max_iterations : int, optional
        Newton's method gives up after this many.
    linear : callable, optional
        Solves the linear equations of a step, where their structure is known.
    noise : float, optional
        Steps below this, relative to ``scale``, that shrink no more are taken to be rounding.
    values : callable, optional
        Takes unknowns (n,) and returns the values alone, where that is cheaper, or None where it fails. Then
        steps with the Jacobian of the last full one follow it as long as they shrink fast.

    Examples
    --------
    >>> converge(lambda x: (x**2 - 9.0, np.diag(2 * x)), np.array([2.0])).tolist()
    [3.0]
    """
    if not callable(equations):
        raise DefinitionError(
            f"equations: expected a function of the unknowns, received {equations!r}. It returns values "
            "and Jacobian; a Secant makes one of values alone."
        )
    start = real_array(start, "start")
    carried = isinstance(equations, Secant) and equations.jacobian is not None
    given = tol, scale, max_iterations, linear or linear_equations.solve, noise, values
    root = _full_steps(equations, start, *given)
    if root is None and carried and isinstance(equations, Secant) and equations.forget():
        root = _full_steps(equations, start, *given)
    return root


def _full_steps(
    equations: Equations,
    start: Array,
    tol: float,
    scale: float,
    most: int,
    linear: Callable[[Array, Array], Array],
    noise: float,
    plain: Callable[[Array], Array | None] | None,
) -> Array | None:
    x, last = np.array(start, dtype=float), np.inf
    for _ in range(most):
        values, jacobian = equations(x)
        if not (np.isfinite(values).all() and np.isfinite(jacobian).all()):
            return None
        try:
            step = -linear(jacobian, values)
        except np.linalg.LinAlgError:
            return None
        size = math.sqrt(float(step @ step)) / scale
        x = x + step
        if size <= tol or (np.isfinite(last) and size * size <= tol * last):
            return x
        if size <= noise and size >= 0.25 * last:
            return x  # rounding of the equations is above tol
        if not size <= 1e6:
            return None
        last = size
        if plain is not None and size <= _SMALL:
            solved = lambda r, matrix=jacobian: linear(matrix, r)
            x, last, is_root = _chords(plain, solved, x, size, scale, tol)
            if is_root:
                return x
    return None


# many starts -----------------------------------------------------------------------------------

#: Points (k, n) and which of all starts they belong to (k,) -> values (k, m), Jacobians (k, m, n).
ManyEquations = Callable[[Array, NDArray[np.int64]], tuple[Array, Array]]

_FAR = 1e8  # a longer step has left the problem


def solve_many(
    equations: ManyEquations, starts: Array, *, tol: float, iterations: int = 10
) -> tuple[Array, NDArray[np.bool_]]:
    """Find a root close to each start."""
    x = np.array(starts, dtype=float)
    residual = np.full(len(x), np.inf)
    index = np.arange(len(x))
    for _ in range(iterations):
        if not index.size:
            break
        values, jacobian = equations(x[index], index)
        lengths = np.linalg.norm(jacobian, axis=2)
        good = np.isfinite(values).all(1) & np.isfinite(lengths).all(1) & (lengths > 0).all(1)
        residual[index[~good]] = np.inf
        index, values, jacobian, lengths = index[good], values[good], jacobian[good], lengths[good]
        residual[index] = np.max(np.abs(values) / lengths, axis=1, initial=0.0)
        step = _least_norm(values / lengths, jacobian / lengths[..., None])
        x[index] -= step
        length = np.linalg.norm(step, axis=1)
        residual[index[length >= _FAR]] = np.inf
        small = length <= 2.0**-48 * (1 + np.linalg.norm(x[index], axis=1))
        index = index[~small & (length < _FAR)]
    return x, residual <= tol * (1 + np.linalg.norm(x, axis=1))


def _least_norm(values: Array, jacobian: Array) -> Array:
    """Shortest steps (k, n) that solve equations (k, m) with rows of length 1."""
    if values.shape[1] == 1:
        return values * jacobian[:, 0]
    return (np.linalg.pinv(jacobian) @ values[..., None])[..., 0]


def _chords(
    values: Callable[[Array], Array | None],
    solved: Callable[[Array], Array],
    x: Array,
    last: float,
    scale: float,
    tol: float,
) -> tuple[Array, float, bool]:
    """Steps with the Jacobian of the last full one: their end, the last size, whether it is the root."""
    rate = 0.0
    for again in range(_CHORDS):
        found = values(x)
        if found is None or not np.isfinite(found).all():
            break
        step = -solved(found)
        size = math.sqrt(float(step @ step)) / scale
        ratio = size / last
        # a full step leaves the square of its size, one with the same derivatives twice as much of its own
        rate = max(ratio, rate) if again else 2.0 * ratio
        if not ratio <= 1.0:
            break
        x, last = x + step, size
        if size <= tol or rate * size <= 0.1 * tol:
            return x, size, True
        if ratio > _CONTRACTS:
            break
    return x, last, False
