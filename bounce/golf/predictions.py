"""What a law or a contact model predicts for measured landings, and how that depends on numbers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..contact.model import ContactModel
from ..errors import LandingError, LiftOffError
from ..laws import BounceLaw, LandingRange
from ..maps.lift_offs import lift_off
from ..maps.results import BounceStatus
from ..shot.sensitivity import sensitivity
from ..shot.simulate import simulate
from ..units import Ball, Scaling
from .fit_result import FitError
from .ground import Model, require_model, require_scaling
from .measurements import Measurements

Array = NDArray[np.float64]
Values = Mapping[str, float]

_STATE_ROWS = [1, 3, 4]  # xdot, ydot, omega in the states of a contact


class Predictions(ABC):
    """Lift-offs of the measured landings.

    Attributes
    ----------
    model : BounceLaw or ContactModel
    unit : float
        Unit of speed of the model in that of the data.
    polish : int
        From how many starts a fit takes its first steps, unless told.
    """

    model: Model
    unit: float
    polish: int

    @abstractmethod
    def lift_offs(self, values: Values, data: Measurements) -> tuple[Array, dict[int, str]]:
        """Return (n, 3) of xdot, ydot, omega with some values of the model changed, and problems.

        It is NaN where there is no lift-off; the problems say why, by row.
        """

    def derivatives(self, values: Values, data: Measurements) -> Array | None:
        """Return those of the lift-offs (n, 3, k) by the values, None where differences must do."""
        return None

    def fitted(self, values: Values, data: Measurements) -> Model:
        """Return the model with the values that fit the data."""
        model: Model = self.model.replace(**values)
        return model


@dataclass(frozen=True)
class LawPredictions(Predictions):
    """Of a law: arrays in closed form, cheap enough for differences and many starts."""

    model: BounceLaw
    radius: float
    unit: float = 1.0
    polish: int = 10

    def lift_offs(self, values: Values, data: Measurements) -> tuple[Array, dict[int, str]]:
        """Return (n, 3) of xdot, ydot, omega; there always is one."""
        shot = self.model.replace(**values).lift_off(*data.landing.T)
        return np.column_stack([shot.xdot, shot.ydot, shot.omega]), {}

    def fitted(self, values: Values, data: Measurements) -> BounceLaw:
        """Return the law, which covers the data where these have units."""
        covered = _covered(data, self.radius) if data.si else None
        return self.model.replace(**values).covering(covered)


@dataclass(frozen=True)
class ContactPredictions(Predictions):
    """Of a contact model: simulated, with derivatives that are exact through the events."""

    model: ContactModel
    unit: float
    tol: float
    polish: int = 3

    def lift_offs(self, values: Values, data: Measurements) -> tuple[Array, dict[int, str]]:
        """Return (n, 3) of xdot, ydot, omega, NaN where there is none, and why, by row."""
        many = lift_off(self.model.replace(**values), *(data.landing.T / self.unit), tol=self.tol)
        problems = {
            int(data.rows[k]): BounceStatus(int(many.status[k])).advice
            for k in np.flatnonzero(~many.complete)
        }
        return np.column_stack([many.xdot, many.ydot, many.omega]) * self.unit, problems

    def derivatives(self, values: Values, data: Measurements) -> Array:
        """Return those of the lift-offs (n, 3, k) by the values.

        Raises
        ------
        FitError
            A bounce that cannot be simulated, or that grazes.
        """
        model, result = self.model.replace(**values), []
        for row, landing in zip(data.rows, data.landing / self.unit, strict=True):
            try:
                shot = simulate(model, *landing.tolist(), tol=self.tol)
            except (LiftOffError, LandingError) as error:
                raise FitError(f"row {row}: {error}") from error
            by = sensitivity(shot, list(values)).state[_STATE_ROWS]
            if not np.all(np.isfinite(by)):
                raise FitError(
                    f"row {row}: expected a transversal bounce, received one that grazes at "
                    f"{dict(values)} (infinite derivative)."
                )
            result.append(by * self.unit)
        return np.array(result)


def _covered(data: Measurements, radius: float) -> LandingRange:
    """The range of measured landings."""
    u, v, surface = data.landing.T
    spin = np.where(u < 0, -surface, surface) / radius
    xdot, ydot, spins = ((float(a.min()), float(a.max())) for a in (np.abs(u), np.abs(v), spin))
    return LandingRange(xdot, ydot, spins, f"{len(u)} measured bounces")


def predictions(
    model: Model, data: Measurements, scaling: Scaling | None, ball: Ball, tol: float
) -> Predictions:
    """Return how a model predicts the lift-offs of measurements.

    Raises
    ------
    ModelError
        Neither a law nor a contact model; no scaling, or another ball's, for data with units.
    """
    require_model(model)
    if isinstance(model, BounceLaw):
        return LawPredictions(model, ball.radius)
    unit = require_scaling(model, ball, scaling).speed if data.si else 1.0
    return ContactPredictions(model, unit, tol)
