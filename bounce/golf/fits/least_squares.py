"""The least-squares problem of a fit: bounds, residuals and their derivatives."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ...parameters import number
from ...units import Ball, Scaling
from ..ground import Model
from .columns import DataError
from .measurements import COMPONENTS, Measurements, listed
from .predictions import FitError, predictions

Array = NDArray[np.float64]

#: Bounds of the limits of parameters; an open end is moved inside a little.
_BOUNDS = {
    "> 0": (1e-9, math.inf),
    ">= 0": (0.0, math.inf),
    "in (0, 1]": (1e-9, 1.0),
    "in [0, 1]": (0.0, 1.0),
    "in (-pi/2, pi/2)": (-1.57, 1.57),
}
_OPTIONS = {"restitution": (0.0, 1.0), "tilt": (0.0, 1.57)}


@dataclass(frozen=True)
class Start:
    """One of the starts of a fit.

    Attributes
    ----------
    values : dict of str to float
        Where the search started.
    cost : float
        Sum of squares there; infinite where not every bounce could be simulated.
    problem : str
        Why not every bounce could be simulated there; empty if all could.
    fitted : dict of str to float or None
        Where the least squares from here ended, or was after a dozen steps if another was better
        then; None if it was not among the best.
    fitted_cost : float
        Half the sum of squares that it ended with.
    """

    values: dict[str, float]
    cost: float
    problem: str
    fitted: dict[str, float] | None = None
    fitted_cost: float = math.inf


class Problem:
    """Measured bounces and a model whose named parameters are to fit them."""

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
        self.model, self.names = model, names
        self.predictions = predictions(model, data, scaling, ball, tol)
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
        options = {k: v for k, v in self.model.options().items() if k in _OPTIONS}
        known = {**self.model.values, **{k: v for k, v in options.items() if not callable(v)}}
        if name not in known:
            raise ns.ParameterError(
                f"parameters: expected names among {list(known)} of {type(self.model).__name__}, "
                f"received {name!r}."
            )
        return float(known[name])

    @property
    def measured(self) -> Array:
        return np.column_stack(list(self.data.lift_off.values()))

    def named(self, values: Array) -> dict[str, float]:
        return dict(zip(self.names, values.tolist(), strict=True))

    def predict(self, values: Array) -> tuple[Array, dict[int, str]]:
        return self.predictions.lift_offs(self.named(values), self.data)

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
        by = self.predictions.derivatives(self.named(values), self.data)
        if by is None:
            return self.differences(values)
        weighted: Array = by[:, self.columns] * self.weights[:, None]
        return weighted.reshape(-1, len(self.names))

    def differences(self, values: Array) -> Array:
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
        """Drop, or refuse, rows that cannot be simulated at the model's own values."""
        _, problems = self.predict(self.initial)
        if problems and bad_rows == "raise":
            raise DataError(
                f"data: some bounces have no lift-off from {self.model!r} ({listed(problems)}). Correct "
                "them, choose other values to start from, or leave them out with bad_rows='leave out'."
            )
        keep = ~np.isin(self.data.rows, list(problems))
        self.data = self.data.keep(keep, problems)
        count = len(self.data.rows) * len(self.columns)
        if count <= len(self.names):
            raise FitError(
                f"data: {count} numbers from {len(self.data.rows)} bounces are too few for "
                f"{len(self.names)} parameters (left out: {listed(dict(self.data.left_out)) or 'none'}). "
                "Measure more bounces, or fit fewer parameters."
            )

    def bounds(self, given: Mapping[str, tuple[float, float]] | None) -> tuple[Array, Array]:
        limits = {**{k: "" for k in self.names}, **self.model.limits_of_values()}
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
        named = self.named(values)
        try:
            _, problems = self.predict(values)
        except ns.ParameterError as error:
            return Start(named, math.inf, str(error))
        if problems:
            return Start(named, math.inf, listed(problems))
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
