"""Outcome maps of landings in SI units, on laws and contact models."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..laws import BounceLaw
from ..maps.lift_offs import lift_off
from ..maps.outcomes import OutcomeMap, checked_axes
from ..maps.results import BounceStatus, LiftOffs
from ..units import GOLF, Ball, Scaling
from .ground import ExtrapolationWarning, Model, ground, require_scaling

Array = NDArray[np.float64]

#: Components of a landing: m/s, rad below the horizontal, rad/s (backspin).
POLAR = ("speed", "angle", "spin")


def landing_map(
    model: Model,
    over: Mapping[str, ArrayLike],
    fixed: Mapping[str, float] | None = None,
    ball: Ball = GOLF,
    *,
    scaling: Scaling | None = None,
    **options: Any,
) -> OutcomeMap:
    """Map outcomes of landings over any two of speed, angle, spin and the model's parameters.

    Parameters
    ----------
    model : BounceLaw or ContactModel
        The ground: a contact model or a law in closed form.
    over : mapping
        Two names with their values, e.g. ``{"speed": speeds, "angle": angles}``; the first is
        horizontal. ``speed`` in m/s, ``angle`` of descent in rad, ``spin`` in rad/s, backspin
        positive; parameters of a contact model as it has them.
    fixed : mapping, optional
        Values of the other names, in the same units.
    ball : Ball, optional
        Radius, mass and moment of inertia; default ``bounce.golf.GOLF``.
    scaling : Scaling, optional
        The units of a contact model; unused by a law.
    **options
        As :func:`bounce.lift_off` takes, for a contact model: ``tol``, ``work``, ...

    Returns
    -------
    OutcomeMap
        ``lift_offs`` are in m/s and s, with the surface speed of the spin as ``omega``. The regions of a
        law are its cases.

    Raises
    ------
    ModelError
        As :func:`rebound`.
    nonsmooth.OptionError
        Not two names; a name that is unknown, missing or doubled; speeds or angles that are no landings.
    LandingError, nonsmooth.ParameterError
        As :func:`bounce.lift_off`, for a contact model.

    Warns
    -----
    ExtrapolationWarning
        Landings outside the range that a law was fitted to.

    Examples
    --------
    >>> import numpy as np, bounce
    >>> over = {"speed": np.linspace(20, 30, 5), "angle": np.radians([15, 20, 40, 60])}
    >>> m = bounce.golf.landing_map(bounce.laws.TURFS["artificial"].law, over, {"spin": 800.0})
    >>> m.regions, m.slip.shape
    (('II+', 'III+'), (4, 5))
    """
    ground(model, ball, scaling, 1e-10)  # raises if they do not fit together
    known = [*POLAR, *([] if isinstance(model, BounceLaw) else model.values)]
    axes, others = checked_axes(over, fixed or {}, known, POLAR)
    first, second = axes
    values: dict[str, Any] = {**others, first: axes[first], second: axes[second][:, None]}
    speed, angle = values["speed"], values["angle"]
    if np.any(speed <= 0) or np.any((angle <= 0) | (angle > np.pi / 2)):
        raise ns.OptionError(
            "speed, angle: expected positive speeds, and angles of descent in (0, pi/2] rad, received "
            f"{np.min(speed):g} to {np.max(speed):g} m/s and {np.min(angle):g} to {np.max(angle):g} rad."
        )
    landing = (speed * np.cos(angle), -speed * np.sin(angle), values["spin"] * ball.radius)
    outside = None
    if isinstance(model, BounceLaw):
        off = _of_law(model, np.broadcast_arrays(*landing))
        outside = _outside(model, landing[0], landing[1], values["spin"])
    else:
        unit = require_scaling(model, ball, scaling)
        parameters = {name: v for name, v in values.items() if name not in POLAR}
        many = lift_off(model, *(c / unit.speed for c in landing), parameters=parameters, **options)
        off = _scaled(many, unit)
    shape = (len(axes[second]), len(axes[first]))
    spin = np.broadcast_to(np.asarray(values["spin"], dtype=float), shape)
    pair = (axes[first], axes[second])
    return OutcomeMap(model, (first, second), pair, others, off, spin, outside)


def _outside(law: BounceLaw, xdot: Array, ydot: Array, spin: Array) -> NDArray[np.bool_] | None:
    """Whether landings are outside those that a law was fitted to, with a warning."""
    if law.covers is None:
        return None
    inside = np.broadcast_arrays(law.covers.holds(xdot, ydot, spin), xdot, ydot)[0]
    if not np.all(inside):
        warnings.warn(
            f"{type(law).__name__}: {np.size(inside) - np.sum(inside)} of {np.size(inside)} landings are "
            "outside those that it was fitted to; their rebounds are extrapolations.",
            ExtrapolationWarning,
            stacklevel=3,
        )
    return np.asarray(~inside)


def _of_law(law: BounceLaw, landing: tuple[Array, ...]) -> LiftOffs:
    shot = law.lift_off(*landing)
    cases, code = np.unique(shot.case, return_inverse=True)
    down = shot.ydot <= 0.0  # the law keeps the ball on the ground
    zero = np.where(down, np.nan, 0.0)
    return LiftOffs(
        xdot=shot.xdot + zero,
        ydot=shot.ydot + zero,
        omega=shot.omega + zero,
        x=zero,
        y=zero,
        time=zero,
        status=np.where(down, BounceStatus.NO_LIFT_OFF, BounceStatus.LIFTED_OFF).astype(np.int8),
        itineraries=tuple(map(str, cases)),
        itinerary_code=np.where(down, -1, code.reshape(down.shape)).astype(np.int32),
    )


def _scaled(many: LiftOffs, unit: Scaling) -> LiftOffs:
    speeds = {name: getattr(many, name) * unit.speed for name in ("xdot", "ydot", "omega")}
    positions = {name: getattr(many, name) * unit.length for name in ("x", "y")}
    return LiftOffs(
        **speeds,
        **positions,
        time=many.time * unit.time,
        status=many.status,
        itineraries=many.itineraries,
        itinerary_code=many.itinerary_code,
    )
