"""Lift-offs that a law or contact model predicts for measured landings, and their derivatives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ...contact.model import ContactModel
from ...errors import LandingError, LiftOffError
from ...laws import BounceLaw, LandingRange
from ...maps.lift_offs import lift_off
from ...maps.results import BounceStatus
from ...shot.sensitivity import sensitivity
from ...shot.single import simulate
from ...units import Ball, Scaling
from ..ground import Model, require_model, require_scaling
from .measurements import Measurements

Array = NDArray[np.float64]
Values = Mapping[str, float]

_STATE_ROWS = [1, 3, 4]  # xdot, ydot, omega in the states of a contact


class FitError(ns.NonsmoothError, RuntimeError):
    """No fit: no start at which every bounce can be simulated, or fewer numbers than parameters."""


class Predictions(ABC):
    """Predicted lift-offs of measured landings."""

    model: Model
    unit: float  # of speed of the model, in that of the data
    polish: int  # default number of starts from which a fit takes its first steps

    @abstractmethod
    def lift_offs(self, values: Values, data: Measurements) -> tuple[Array, dict[int, str]]:
        """Return (n, 3) of xdot, ydot, omega, NaN where there is no lift-off, and why, by row."""

    def derivatives(self, values: Values, data: Measurements) -> Array | None:
        """Return those of the lift-offs by the values (n, 3, k), or None."""
        return None

    def fitted(self, values: Values, data: Measurements) -> Model:
        """Return the model with the values that fit the data."""
        model: Model = self.model.replace(**values)
        return model


@dataclass(frozen=True)
class LawPredictions(Predictions):
    model: BounceLaw
    radius: float
    unit: float = 1.0
    polish: int = 10

    def lift_offs(self, values: Values, data: Measurements) -> tuple[Array, dict[int, str]]:
        shot = self.model.replace(**values).lift_off(*data.landing.T)
        return np.column_stack([shot.xdot, shot.ydot, shot.omega]), {}

    def fitted(self, values: Values, data: Measurements) -> BounceLaw:
        covered = _covered(data, self.radius) if data.si else None
        return self.model.replace(**values).covering(covered)


@dataclass(frozen=True)
class ContactPredictions(Predictions):
    model: ContactModel
    unit: float
    tol: float
    polish: int = 3

    def lift_offs(self, values: Values, data: Measurements) -> tuple[Array, dict[int, str]]:
        many = lift_off(self.model.replace(**values), *(data.landing.T / self.unit), tol=self.tol)
        problems = {
            int(data.rows[k]): BounceStatus(int(many.status[k])).advice
            for k in np.flatnonzero(~many.complete)
        }
        return np.column_stack([many.xdot, many.ydot, many.omega]) * self.unit, problems

    def derivatives(self, values: Values, data: Measurements) -> Array:
        model, result = self.model.replace(**values), []
        for row, landing in zip(data.rows, data.landing / self.unit, strict=True):
            try:
                shot = simulate(model, *landing.tolist(), tol=self.tol)
            except (LiftOffError, LandingError) as error:
                raise FitError(f"row {row}: {error}") from error
            by = sensitivity(shot, list(values)).state[_STATE_ROWS]
            if not np.all(np.isfinite(by)):
                raise FitError(
                    f"row {row}: the bounce grazes at {dict(values)}, where its derivative is infinite. "
                    "Start elsewhere, or leave the row out."
                )
            result.append(by * self.unit)
        return np.array(result)


def _covered(data: Measurements, radius: float) -> LandingRange:
    u, v, surface = data.landing.T
    spin = np.where(u < 0, -surface, surface) / radius
    xdot, ydot, spins = ((float(a.min()), float(a.max())) for a in (np.abs(u), np.abs(v), spin))
    return LandingRange(xdot, ydot, spins, f"{len(u)} measured bounces")


def predictions(
    model: Model, data: Measurements, scaling: Scaling | None, ball: Ball, tol: float
) -> Predictions:
    require_model(model)
    if isinstance(model, BounceLaw):
        return LawPredictions(model, ball.radius)
    unit = require_scaling(model, ball, scaling).speed if data.si else 1.0
    return ContactPredictions(model, unit, tol)
