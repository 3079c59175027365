"""Fit parameters of a law or contact model to measured bounces."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ...parameters import number
from ...units import GOLF, Ball, Scaling
from ..ground import Model
from .fit_result import FitResult, IdentifiabilityWarning
from .least_squares import Problem, Start
from .measurements import read_measurements
from .predictions import FitError
from .profile import Profile

Array = NDArray[np.float64]


def fit(
    model: Model,
    data: Any,
    *,
    parameters: Sequence[str],
    ball: Ball = GOLF,
    scaling: Scaling | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    weights: Mapping[str, float] | None = None,
    starts: int | Sequence[Mapping[str, float]] = 16,
    polish: int | None = None,
    seed: int = 0,
    bad_rows: str = "raise",
    tol: float = 1e-10,
    progress: bool = False,
) -> FitResult:
    """Fit parameters to measured landings and lift-offs.

    The sum of squares is of predicted less measured speeds at lift-off, spins as surface speeds,
    all in one unit. Its gradient is exact through the events for a contact model
    (:func:`sensitivity`), and by central differences for a law in closed form. Where a bounce
    changes its itinerary the gradient jumps; the steps of the trust region cope with that.

    Parameters
    ----------
    model : ContactModel or BounceLaw
        Its values are the first start; those not among ``parameters`` stay.
    data : path, mapping of str to array_like, table or sequence of dicts
        See :func:`read_measurements`.
    parameters : sequence of str
        Names to fit; for a law also "restitution" and "tilt" where they are numbers.
    ball : Ball, optional
        Radius, mass and moment of inertia; default ``bounce.golf.GOLF``.
    scaling : Scaling, optional
        The units of a contact model; needed for data with units.
    bounds : mapping of str to (float, float), optional
        By default what the model's limits say.
    weights : mapping of str to float, optional
        Factors of the residuals of ``xdot``, ``ydot``, ``omega``; 1 by default.
    starts : int or sequence of mappings, optional
        Points compared besides the model's own: this many drawn within the bounds (where those are
        infinite within a factor of 4 of the model's value), or these.
    polish : int, optional
        How many of the best points the least squares takes its first dozen steps from, besides the
        model's own values; it continues from the best. By default 3 for a contact model, 10 for a law.
    seed : int, optional
        Of the draws.
    bad_rows : {"raise", "leave out"}, optional
        What to do with rows that cannot be read or cannot be simulated at the model's own values:
        an error that names them, or a fit without them that names them in ``left_out``.
    tol : float, optional
        Relative tolerance.
    progress : bool, optional
        Show a bar (only on a terminal).

    Returns
    -------
    FitResult
        Fitted values, their intervals, and what the fit leaves.

    Raises
    ------
    DataError
        Measurements that cannot be read, or rows without a landing.
    FitError
        No start from which every bounce can be simulated, or fewer numbers than parameters.
    ModelError
        Neither a law nor a contact model; no ``scaling`` for a contact model and data with units.
    nonsmooth.ParameterError
        A parameter that the model does not have.
    nonsmooth.OptionError
        Bounds, weights, starts or other options out of their range.

    Warns
    -----
    IdentifiabilityWarning
        The data do not determine a parameter, see :attr:`FitResult.undetermined`; or an interval is
        too narrow, see :attr:`FitResult.narrow` and :meth:`FitResult.profile`.

    Examples
    --------
    >>> import numpy as np, bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    >>> u, w = np.random.default_rng(0).uniform(-1, 1, (2, 12))
    >>> many = bounce.lift_off(turf, u, -1.0, w)
    >>> data = dict(xdot=u, ydot=-np.ones(12), omega=w, lift_off_xdot=many.xdot,
    ...             lift_off_ydot=many.ydot, lift_off_omega=many.omega)
    >>> found = bounce.golf.fit(turf.replace(mu=0.5, eta=0.8), data, parameters=["mu", "eta"], starts=4)
    >>> {name: round(value, 7) for name, value in found.values.items()}
    {'mu': 0.3, 'eta': 0.5}
    """
    measurements = read_measurements(data, ball, bad_rows=bad_rows)
    problem = Problem(model, measurements, list(parameters), scaling, ball, weights, tol)
    problem.leave_out(bad_rows)
    low, high = problem.bounds(bounds)
    points = _points(problem, starts, low, high, seed)
    tried = [problem.start(values) for values in points]
    order = sorted(range(len(tried)), key=lambda k: tried[k].cost)
    most = problem.predictions.polish if polish is None else max(1, polish)
    best = [k for k in order if math.isfinite(tried[k].cost)][:most]
    best += [0] if 0 not in best and math.isfinite(tried[0].cost) else []
    if not best:
        raise FitError(
            f"starts: at none of the {len(tried)} starts can every bounce be simulated. The first: "
            f"{tried[0].problem}"
        )
    runs = {k: problem.solve(points[k], low, high, 12) for k in _bar(best, progress)}
    winner = min(runs, key=lambda k: float(runs[k].cost))
    if runs[winner].status == 0:  # continue from the best of the first steps
        runs[winner] = problem.solve(runs[winner].x, low, high, 200)
    for k, run in runs.items():
        fitted = problem.named(run.x)
        tried[k] = Start(tried[k].values, tried[k].cost, "", fitted, float(2 * run.cost))
    found = _result(problem, runs[winner], tuple(tried), low, high)
    found = _profiled(found, Profile(problem, runs[winner].x, found.covariance, low, high))
    _warn(found)
    return found


def _result(
    problem: Problem, run: Any, starts: tuple[Start, ...], low: Array, high: Array
) -> FitResult:
    """Errors from J^T J and the residual variance."""
    jacobian, residuals = run.jac, run.fun
    freedom = residuals.size - len(problem.names)
    covariance = _covariance(jacobian, float(residuals @ residuals) / freedom)
    size = np.maximum(np.abs(run.x), np.abs(problem.initial))
    spread = np.linalg.svd(jacobian * np.where(size > 0, size, 1.0), compute_uv=False)
    errors = np.sqrt(np.diag(covariance))
    near = 1e-6 * np.maximum(np.abs(run.x), 1e-3)
    on_bound = (run.x - low < near) | (high - run.x < near)
    plain = residuals.reshape(-1, len(problem.columns)) / problem.weights
    return FitResult(
        model=problem.predictions.fitted(problem.named(run.x), problem.data),
        values=problem.named(run.x),
        errors=problem.named(errors),
        covariance=covariance,
        residuals={c: plain[:, k] for k, c in enumerate(problem.data.lift_off)},
        measurements=problem.data,
        degrees_of_freedom=freedom,
        starts=starts,
        at_bound=tuple(n for n, on in zip(problem.names, on_bound, strict=True) if on),
        condition=float(spread[0] / spread[-1]) if spread[-1] > 0 else math.inf,
        message=str(run.message),
    )


def _covariance(jacobian: Array, variance: float) -> Array:
    """(J^T J)^-1 times the variance; infinite variances of parameters that a combination without effect contains."""
    scale = np.linalg.norm(jacobian, axis=0)
    safe = np.where(scale > 0, scale, 1.0)
    _, s, vt = np.linalg.svd(jacobian / safe, full_matrices=False)
    free = s <= 1e-9 * s[0] if s[0] > 0 else np.ones_like(s, dtype=bool)
    inverse = np.where(free, 0.0, 1.0 / np.where(free, 1.0, s))
    covariance: Array = variance * ((vt.T * inverse**2) @ vt) / np.outer(safe, safe)
    undetermined = np.any(np.abs(vt[free]) > 1e-6, axis=0)
    covariance[undetermined, undetermined] = np.inf
    return covariance


def _profiled(found: FitResult, search: Profile) -> FitResult:
    """Compare the intervals with the sum of squares at their ends."""
    narrow = search.too_narrow(found.width(0.95))
    return replace(
        found, narrow=tuple(n for n in narrow if n not in found.undetermined), search=search
    )


def _warn(found: FitResult) -> None:
    if found.undetermined:
        names = "; ".join(f"{n}: not determined by these data" for n in found.undetermined)
        warnings.warn(
            f"{names}. What was measured hardly depends on it, or only together with others (condition "
            f"number {found.condition:.3g}): leave it out of the fit, or measure landings that depend "
            "on it.",
            IdentifiabilityWarning,
            stacklevel=3,
        )
    if found.narrow:
        warnings.warn(
            f"{', '.join(found.narrow)}: the 95 % interval of the linearised fit is too narrow: at one "
            "of its ends the sum of squares rises less than its parabola. FitResult.profile() follows "
            "the sum of squares itself.",
            IdentifiabilityWarning,
            stacklevel=3,
        )


def _bar(items: list[int], progress: bool) -> Any:
    if not progress:
        return items
    from tqdm import tqdm

    return tqdm(items, desc="fit", unit="start", disable=None, leave=False)


def _points(
    problem: Problem,
    starts: int | Sequence[Mapping[str, float]],
    low: Array,
    high: Array,
    seed: int,
) -> list[Array]:
    """The model's own values and the starts."""
    own = np.clip(problem.initial, low, high)
    if isinstance(starts, int):
        if starts < 0:
            raise ns.OptionError(f"starts: expected a number >= 0, received {starts!r}.")
        size = np.where(own != 0.0, np.abs(own), 0.25)
        inside = np.isfinite(low) & np.isfinite(high)
        bottom = np.where(inside, low, np.maximum(low, own - 4 * size))
        top = np.where(inside, high, np.minimum(high, own + 4 * size))
        u = np.random.default_rng(seed).uniform(size=(starts, own.size))
        geometric = np.clip(size * 4.0 ** (2 * u - 1), low, high)
        draws = np.where((low >= 0.0) & ~inside, geometric, bottom + u * (top - bottom))
        return [own, *draws]
    points = [own]
    for given in starts:
        unknown = sorted(set(given) - set(problem.names))
        if unknown:
            raise ns.OptionError(
                f"starts: expected names among {problem.names}, received {unknown}."
            )
        point = [number(given.get(n, v), n) for n, v in zip(problem.names, own, strict=True)]
        points.append(np.clip(np.array(point), low, high))
    return points
