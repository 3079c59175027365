"""Parameters of a law or contact model from measured bounces: least squares with exact gradients."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from .contact import ContactModel
from .errors import LandingError, LiftOffError, ModelError
from .measurements import COMPONENTS, DataError, Measurements, read_measurements
from .outcomes import BounceStatus, lift_off
from .parameters import number
from .rigid import RigidBounce
from .sensitivity import sensitivity
from .shot import simulate
from .units import GOLF, Ball, Scaling

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Model = RigidBounce | ContactModel

#: Bounds that the words of ``limits`` mean; a strict one keeps a hair's breadth.
_BOUNDS = {
    "> 0": (1e-9, math.inf),
    ">= 0": (0.0, math.inf),
    "in (0, 1]": (1e-9, 1.0),
    "in [0, 1]": (0.0, 1.0),
    "in (-pi/2, pi/2)": (-1.57, 1.57),
}
_OPTIONS = {"restitution": (0.0, 1.0), "tilt": (0.0, 1.57)}
_STATE_ROWS = [1, 3, 4]  # xdot, ydot, omega in the states of a contact


class FitError(ns.NonsmoothError, RuntimeError):
    """No fit: no start at which every bounce can be simulated, or fewer numbers than parameters."""


@dataclass(frozen=True)
class Start:
    """One of the starts of a fit.

    Attributes
    ----------
    values : dict of str to float
    cost : float
        Sum of squares there; infinite where not every bounce could be simulated.
    problem : str
        Why not.
    fitted : dict of str to float or None
        Where the least squares from here ended, or was after a dozen steps if another was better
        then; None if it was not among the best.
    fitted_cost : float
    """

    values: dict[str, float]
    cost: float
    problem: str
    fitted: dict[str, float] | None = None
    fitted_cost: float = math.inf


@dataclass(frozen=True, repr=False)
class FitResult:
    """Fitted parameters and what they leave.

    Attributes
    ----------
    model : RigidBounce or ContactModel
        With the fitted values.
    values, errors : dict of str to float
        Fitted values and their standard errors (infinite where the data do not determine one).
    covariance : ndarray (k, k)
    residuals : dict of str to ndarray (n,)
        Predicted less measured, for each component measured; m/s, spins as surface speeds (without
        units: in the model's).
    measurements : Measurements
        What was fitted; ``measurements.left_out`` names what was not.
    degrees_of_freedom : int
    starts : tuple of Start
    at_bound : tuple of str
        Parameters that ended on a bound; errors and intervals assume that they do not.
    message : str
        Why the least squares stopped.
    """

    model: Model
    values: dict[str, float]
    errors: dict[str, float]
    covariance: Array
    residuals: dict[str, Array]
    measurements: Measurements
    degrees_of_freedom: int
    starts: tuple[Start, ...]
    at_bound: tuple[str, ...]
    message: str

    @property
    def rms(self) -> dict[str, float]:
        """Root mean square residual of each component."""
        return {n: float(np.sqrt(np.mean(r**2))) for n, r in self.residuals.items()}

    def interval(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Return confidence intervals: Student's t about the linearised fit.

        Parameters
        ----------
        level : float, optional
            In (0, 1).
        """
        from scipy.stats import t

        if not 0.0 < level < 1.0:
            raise ns.OptionError(f"level: expected a number in (0, 1), received {level!r}.")
        width = float(t.ppf((1 + level) / 2, self.degrees_of_freedom))
        return {
            n: (v - width * self.errors[n], v + width * self.errors[n])
            for n, v in self.values.items()
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers as plain Python, for JSON."""
        return dict(
            model=type(self.model).__name__,
            values=self.values,
            errors=self.errors,
            interval_95={n: list(pair) for n, pair in self.interval().items()},
            rms=self.rms,
            bounces=len(self.measurements.rows),
            left_out=[list(pair) for pair in self.measurements.left_out],
            at_bound=list(self.at_bound),
            message=self.message,
        )

    def plot_residuals(self) -> Figure:
        """Draw the residuals of each component against the measured value.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from matplotlib.figure import Figure

        names = list(self.residuals)
        figure = Figure(figsize=(4.2 * len(names), 3.6), layout="constrained")
        unit = " [m/s]" if self.measurements.si else ""
        for ax, name in zip(figure.subplots(1, len(names), squeeze=False)[0], names, strict=True):
            measured = self.measurements.lift_off[name]
            ax.axhline(0.0, color="0.3", linewidth=0.8)
            for sign in (-1, 1):
                ax.axhline(sign * self.rms[name], color="0.6", linewidth=0.8, linestyle="--")
            ax.plot(measured, self.residuals[name], "o", color="#0072B2", markersize=4)
            label = "R omega" if name == "omega" and self.measurements.si else name
            ax.set_xlabel(f"measured {label} at lift-off{unit}")
            ax.set_ylabel(f"predicted less measured{unit}")
            ax.set_title(f"rms {self.rms[name]:.3g}{unit.replace('[', '').replace(']', '')}")
        return figure

    def __repr__(self) -> str:
        lines = [f"{type(self.model).__name__} fitted to {len(self.measurements.rows)} bounces"]
        for name, (low, high) in self.interval().items():
            note = "  (on its bound)" if name in self.at_bound else ""
            if not math.isfinite(self.errors[name]):
                note += "  (not determined by these data)"
            lines.append(
                f"  {name} = {self.values[name]:.6g}  95 % in [{low:.6g}, {high:.6g}]{note}"
            )
        rms = ", ".join(f"{n} {v:.3g}" for n, v in self.rms.items())
        lines.append(f"  rms residuals: {rms}{' m/s' if self.measurements.si else ''}")
        if self.measurements.left_out:
            lines.append(f"  left out: {_listed(dict(self.measurements.left_out))}")
        return "\n".join(lines)


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
    model : ContactModel or RigidBounce
        Its values are the first start; those not among ``parameters`` stay.
    data : path, mapping of str to array_like, table or sequence of dicts
        See :func:`read_measurements`.
    parameters : sequence of str
        Names to fit; for a law also "restitution" and "tilt" where they are numbers.
    ball : Ball, optional
    scaling : Scaling, optional
        The units of a contact model; needed for data with units.
    bounds : mapping of str to (float, float), optional
        By default what the model's limits say.
    weights : mapping of str to float, optional
        Factors of the residuals of xdot, ydot, omega; 1 by default.
    starts : int or sequence of mappings, optional
        Points compared besides the model's own: this many drawn within the bounds (where those are
        infinite within a factor of 4 of the model's value), or these.
    polish : int, optional
        How many of the best points the least squares takes its first dozen steps from, besides the
        model's own values; it goes on from the best. By default 3 for a contact model, 10 for a law.
    seed : int, optional
        Of the draws.
    bad_rows : {"raise", "leave out"}, optional
        What to do with rows that cannot be read or cannot be simulated at the model's own values:
        an error that names them, or a fit without them that names them in ``left_out``.
    tol : float, optional
    progress : bool, optional
        Show a bar (only on a terminal).

    Returns
    -------
    FitResult

    Raises
    ------
    DataError, FitError, ModelError, nonsmooth.ParameterError, nonsmooth.OptionError

    Examples
    --------
    >>> import numpy as np, bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    >>> u, w = np.random.default_rng(0).uniform(-1, 1, (2, 12))
    >>> many = bounce.lift_off(turf, u, -1.0, w)
    >>> data = dict(xdot=u, ydot=-np.ones(12), omega=w, lift_off_xdot=many.xdot,
    ...             lift_off_ydot=many.ydot, lift_off_omega=many.omega)
    >>> found = bounce.fit(turf.replace(mu=0.5, eta=0.8), data, parameters=["mu", "eta"], starts=4)
    >>> {name: round(value, 7) for name, value in found.values.items()}
    {'mu': 0.3, 'eta': 0.5}
    """
    measurements = read_measurements(data, ball, bad_rows=bad_rows)
    problem = _Problem(model, measurements, list(parameters), scaling, ball, weights, tol)
    problem.leave_out(bad_rows)
    low, high = problem.bounds(bounds)
    points = _points(problem, starts, low, high, seed)
    tried = [problem.start(values) for values in points]
    order = sorted(range(len(tried)), key=lambda k: tried[k].cost)
    most = (10 if isinstance(model, RigidBounce) else 3) if polish is None else max(1, polish)
    best = [k for k in order if math.isfinite(tried[k].cost)][:most]
    best += [0] if 0 not in best and math.isfinite(tried[0].cost) else []
    if not best:
        raise FitError(
            f"starts: expected one at which every bounce can be simulated, received none of "
            f"{len(tried)}. The first: {tried[0].problem}"
        )
    runs = {k: problem.solve(points[k], low, high, 12) for k in _bar(best, progress)}
    winner = min(runs, key=lambda k: float(runs[k].cost))
    if runs[winner].status == 0:  # the first steps tell which is best; go on with that one
        runs[winner] = problem.solve(runs[winner].x, low, high, 200)
    for k, run in runs.items():
        fitted = dict(zip(problem.names, run.x.tolist(), strict=True))
        tried[k] = Start(tried[k].values, tried[k].cost, "", fitted, float(2 * run.cost))
    return problem.result(runs[winner], tuple(tried), low, high)


def _bar(items: list[int], progress: bool) -> Any:
    if not progress:
        return items
    from tqdm import tqdm

    return tqdm(items, desc="fit", unit="start", disable=None, leave=False)


class _Problem:
    """The least-squares problem: names, data and how to predict."""

    def __init__(
        self,
        model: Model,
        data: Measurements,
        names: list[str],
        scaling: Scaling | None,
        ball: Ball,
        weights: Mapping[str, float] | None,
        tol: float,
    ):
        self.model, self.names, self.tol = model, names, tol
        self.unit = _unit(model, data, scaling, ball)
        self.data = data
        self.initial = np.array([self._value(name) for name in names])
        if not names or len(set(names)) < len(names):
            raise ns.ParameterError(
                f"parameters: expected different names, at least one, received {names}."
            )
        given = dict(weights or {})
        unknown = sorted(set(given) - set(COMPONENTS))
        if unknown or not all(number(w, "weights") > 0 for w in given.values()):
            raise ns.OptionError(
                f"weights: expected positive numbers for names among {list(COMPONENTS)}, received "
                f"{given}."
            )
        self.weights = np.array([float(given.get(c, 1.0)) for c in data.lift_off])
        self.columns = [COMPONENTS.index(c) for c in data.lift_off]

    def _value(self, name: str) -> float:
        options = {k: v for k, v in self.model._options().items() if k in _OPTIONS}
        known = {**self.model.values, **{k: v for k, v in options.items() if not callable(v)}}
        if name not in known:
            raise ns.ParameterError(
                f"parameters: expected names among {list(known)} of {type(self.model).__name__}, "
                f"received {name!r}."
            )
        return float(known[name])

    @property
    def measured(self) -> Array:
        """Measured lift-offs (n, m)."""
        return np.column_stack(list(self.data.lift_off.values()))

    def changed(self, values: Array) -> Model:
        """The model with these values."""
        new = dict(zip(self.names, values.tolist(), strict=True))
        model: Model = self.model.replace(**new)
        return model

    def predict(self, values: Array) -> tuple[Array, dict[int, str]]:
        """Lift-offs (n, 3), NaN where there is none, and why by row."""
        u, v, w = self.data.landing.T / self.unit
        model = self.changed(values)
        if isinstance(model, RigidBounce):
            shot = model.lift_off(u, v, w)
            return np.column_stack([shot.xdot, shot.ydot, shot.omega]) * self.unit, {}
        many = lift_off(model, u, v, w, tol=self.tol)
        problems = {
            int(self.data.rows[k]): f"{BounceStatus(int(many.status[k])).advice}"
            for k in np.flatnonzero(~many.complete)
        }
        return np.column_stack([many.xdot, many.ydot, many.omega]) * self.unit, problems

    def residuals(self, values: Array) -> Array:
        """Weighted residuals (n m,); NaN where a bounce cannot be simulated, so the step shrinks."""
        try:
            predicted = self.predict(values)[0]
        except ns.ParameterError:
            return np.full(self.measured.size, np.nan)
        weighted: Array = (predicted[:, self.columns] - self.measured) * self.weights
        return weighted.ravel()

    def jacobian(self, values: Array) -> Array:
        """Derivatives of the residuals (n m, k)."""
        model = self.changed(values)
        if isinstance(model, RigidBounce):
            return self._differences(values)
        rows = []
        for row, landing in zip(self.data.rows, self.data.landing / self.unit, strict=True):
            try:
                shot = simulate(model, *landing.tolist(), tol=self.tol)
            except (LiftOffError, LandingError) as error:
                raise FitError(f"row {row}: {error}") from error
            by = sensitivity(shot, self.names).state[_STATE_ROWS]
            if not np.all(np.isfinite(by)):
                raise FitError(
                    f"row {row}: expected a transversal bounce, received one that grazes at "
                    f"{dict(zip(self.names, values.tolist(), strict=True))} (infinite derivative)."
                )
            rows.append(by[self.columns] * self.weights[:, None] * self.unit)
        return np.concatenate(rows)

    def _differences(self, values: Array) -> Array:
        """Central differences, one-sided at a limit of the law."""
        columns = []
        for k, value in enumerate(values):
            step = 1e-6 * max(abs(value), 1e-3)
            ends = []
            for sign in (1, -1):
                moved = values.copy()
                moved[k] = value + sign * step
                out = self.residuals(moved)
                if not np.all(np.isfinite(out)):
                    moved, out = values, self.residuals(values)
                ends.append((moved[k], out))
            (a, high), (b, low) = ends
            columns.append((high - low) / (a - b))
        return np.column_stack(columns)

    def leave_out(self, bad_rows: str) -> None:
        """Rows that cannot be simulated at the model's own values."""
        _, problems = self.predict(self.initial)
        if problems and bad_rows == "raise":
            raise DataError(
                f"data: expected bounces that {self.model!r} can simulate, received "
                f"{_listed(problems)}. Correct them, choose other values to start from, or leave "
                "them out with bad_rows='leave out'."
            )
        keep = ~np.isin(self.data.rows, list(problems))
        self.data = self.data.keep(keep, problems)
        count = len(self.data.rows) * len(self.columns)
        if count <= len(self.names):
            raise FitError(
                f"data: expected more than {len(self.names)} numbers for {len(self.names)} "
                f"parameters, received {count} from {len(self.data.rows)} bounces; left out: "
                f"{_listed(dict(self.data.left_out)) or 'none'}."
            )

    def bounds(self, given: Mapping[str, tuple[float, float]] | None) -> tuple[Array, Array]:
        """Lower and upper bounds."""
        limits = {**{k: "" for k in self.names}, **self.model.declared_limits()}
        pairs = {n: _BOUNDS.get(limits[n], (-math.inf, math.inf)) for n in self.names}
        pairs |= {n: _OPTIONS[n] for n in self.names if n in _OPTIONS}
        for name, (low, high) in dict(given or {}).items():
            if name not in pairs:
                raise ns.OptionError(
                    f"bounds: expected names among {self.names}, received {name!r}."
                )
            inside = (max(low, pairs[name][0]), min(high, pairs[name][1]))
            if not inside[0] < inside[1]:
                raise ns.OptionError(
                    f"bounds: {name}: expected low < high within {pairs[name]}, received "
                    f"({low!r}, {high!r})."
                )
            pairs[name] = inside
        lows, highs = np.array(list(pairs.values())).T
        return lows, highs

    def start(self, values: Array) -> Start:
        """Cost of a point."""
        named = dict(zip(self.names, values.tolist(), strict=True))
        try:
            _, problems = self.predict(values)
        except ns.ParameterError as error:
            return Start(named, math.inf, str(error))
        if problems:
            return Start(named, math.inf, _listed(problems))
        return Start(named, float(np.sum(self.residuals(values) ** 2)), "")

    def solve(self, values: Array, low: Array, high: Array, evaluations: int) -> Any:
        """Trust-region least squares from a point."""
        from scipy.optimize import least_squares

        inside = np.clip(values, low + 1e-12, high - 1e-12)
        return least_squares(
            self.residuals,
            inside,
            jac=self.jacobian,
            bounds=(low, high),
            x_scale="jac",
            ftol=1e-12,
            xtol=1e-10,
            gtol=1e-12,
            max_nfev=evaluations,
        )

    def result(self, run: Any, starts: tuple[Start, ...], low: Array, high: Array) -> FitResult:
        """Errors from J^T J and the residual variance."""
        jacobian, residuals = run.jac, run.fun
        freedom = residuals.size - len(self.names)
        covariance = _covariance(jacobian, float(residuals @ residuals) / freedom)
        errors = np.sqrt(np.diag(covariance))
        near = 1e-6 * np.maximum(np.abs(run.x), 1e-3)
        on_bound = (run.x - low < near) | (high - run.x < near)
        plain = residuals.reshape(-1, len(self.columns)) / self.weights
        return FitResult(
            model=self.changed(run.x),
            values=dict(zip(self.names, run.x.tolist(), strict=True)),
            errors=dict(zip(self.names, errors.tolist(), strict=True)),
            covariance=covariance,
            residuals={c: plain[:, k] for k, c in enumerate(self.data.lift_off)},
            measurements=self.data,
            degrees_of_freedom=freedom,
            starts=starts,
            at_bound=tuple(n for n, on in zip(self.names, on_bound, strict=True) if on),
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


def _points(
    problem: _Problem,
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


def _unit(model: Model, data: Measurements, scaling: Scaling | None, ball: Ball) -> float:
    """Unit of speed of the model in that of the data."""
    if not isinstance(model, RigidBounce | ContactModel):
        raise ModelError(f"model: expected a ContactModel or a law, received {model!r}.")
    if isinstance(model, RigidBounce) or not data.si:
        return 1.0
    if scaling is None:
        raise ModelError(
            f"scaling: expected a Scaling, because the data have units and {type(model).__name__} is "
            "dimensionless, received none. Scaling.from_stiffness(ball, newtons_per_metre) makes one."
        )
    if scaling.ball != ball:
        raise ModelError(
            f"ball: expected that of the scaling, {scaling.ball!r}, received {ball!r}."
        )
    return scaling.speed


def _listed(problems: Mapping[int, str], most: int = 8) -> str:
    """Rows and reasons in one line."""
    items = [f"row {row}: {why}" for row, why in list(problems.items())[:most]]
    more = f"; and {len(problems) - most} more" if len(problems) > most else ""
    return "; ".join(items) + more
