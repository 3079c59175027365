"""The ball at touch-down and at lift-off: its motion, with one or two directions along the ground."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..contact.equations import STATES, STATES_3D, Equations
from ..contact.model import Contact3D, ContactModel
from ..errors import LandingError, ModelError
from ..parameters import Parametrised, number

Array = NDArray[np.float64]
Along = TypeVar("Along", bound=float | Array)

#: State at touch-down of a bounce.
INPUTS = ("xdot", "ydot", "omega", "x", "y")


def forward_and_right(along: Any, normal: Any) -> tuple[Array, Array]:
    """Components along the ground; a vector has one axis more than what is normal to the ground."""
    array = np.asarray(along, dtype=float)
    if array.ndim > np.ndim(normal):
        return array[..., 0], array[..., 1]
    return array, np.zeros_like(array)


def direction(along: Any, normal: Any) -> Array:
    """Angle along the ground from forward to the right, in (-pi, pi]."""
    forward, right = forward_and_right(along, normal)
    return np.arctan2(right + 0.0, forward)  # -0.0 is no other side


class AlongTheGround:
    """Speeds and directions along the ground of arrays of balls."""

    xdot: Any
    ydot: Any
    slip: Any

    @property
    def slip_speed(self) -> Array:
        """Length of the slip (...)."""
        return np.hypot(*forward_and_right(self.slip, self.ydot))

    @property
    def slip_angle(self) -> Array:
        """Direction of the slip (...), rad from forward to the right; 0 where the ball rolls."""
        return direction(self.slip, self.ydot)

    @property
    def travel_angle(self) -> Array:
        """Direction of travel along the ground (...), rad from forward to the right."""
        return direction(self.xdot, self.ydot)


class _Motion(NamedTuple, Generic[Along]):
    xdot: Along
    ydot: Any
    omega: Along
    x: Along = 0.0  # type: ignore[assignment]
    y: Any = 0.0


class State(_Motion[Along], AlongTheGround):
    """The ball at one instant, or at many: arrays of the shape (...) of the times.

    In the plane every component is a number. In 3-D ``xdot``, ``omega``, ``x`` and ``slip`` are arrays
    (..., 2), forward and to the right.

    Attributes
    ----------
    xdot, ydot : float or ndarray
        Velocity of the centre, along and normal to the ground.
    omega : float or ndarray
        Spin, in units in which the contact point moves at ``xdot + omega``: in 3-D
        $(omega_z, -omega_x)$, and with drilling the spin $omega_y$ about the vertical as a third component.
    x, y : float or ndarray
        Position of the centre; ``y`` is 0 at touch-down.
    """

    @cached_property
    def slip(self) -> Along:
        """Velocity of the contact point; in 3-D to its own relative accuracy, however small it is."""
        omega: Any = self.omega
        return self.xdot + (omega[..., :2] if np.ndim(omega) > np.ndim(self.ydot) else omega)


def state_of(eq: Equations, states: Array) -> State[Any]:
    """Return states (..., n) of the equations by what they are."""
    if eq.directions == 1:
        x, xdot, y, ydot, omega = (_plain(states[..., k]) for k in range(len(STATES)))
        return State(xdot, ydot, omega, x, y)
    x, xdot, y, ydot, z, zdot, slip_x, slip_z = (states[..., k] for k in range(len(STATES_3D)))
    slip, velocity = np.stack([slip_x, slip_z], axis=-1), np.stack([xdot, zdot], axis=-1)
    omega = slip - velocity
    if eq.drilling:
        omega = np.concatenate([omega, states[..., [len(STATES_3D)]]], axis=-1)
    state = State(velocity, _plain(ydot), omega, np.stack([x, z], axis=-1), _plain(y))
    state.slip = slip
    return state


def _plain(value: Array) -> Any:
    return float(value) if np.ndim(value) == 0 else value


# landings -----------------------------------------------------------------------------------------


def require_model(model: Any) -> None:
    """Refuse what is no contact model in the plane."""
    if isinstance(model, ContactModel):
        return
    hint = " Make an instance of the class." if isinstance(model, type) else ""
    if isinstance(model, Parametrised):
        hint = " A law of bounce.laws takes no time: use its lift_off(xdot, ydot, omega)."
    raise ModelError(f"model: expected a ContactModel, received {model!r}.{hint}")


def is_vector(value: Any) -> bool:
    """Whether something is meant as a vector, not as a number."""
    return isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim > 0)


def landings(
    model: ContactModel | Contact3D, given: Mapping[str, Any], read: Callable[[Any, str], Any]
) -> dict[str, Any]:
    """Return landings by the names of the states; ``read`` takes a component and its name."""
    if isinstance(model, ContactModel):
        return {name: read(given[name], name) for name in INPUTS}
    x = given["x"]
    if not is_vector(x) and number(x, "x", LandingError) == 0.0:
        x = np.zeros(2)
    v, position = _components("xdot", given["xdot"], (2,), read), _components("x", x, (2,), read)
    w = _components("omega", given["omega"], (2, 3) if model.drilling else (2,), read)
    try:
        slip_x, slip_z = v[0] + w[0], v[1] + w[1]
    except ValueError as error:
        raise LandingError(
            f"xdot has shape {np.shape(given['xdot'])} and omega {np.shape(given['omega'])}, which do "
            "not broadcast."
        ) from error
    named = dict(x=position[0], z=position[1], xdot=v[0], zdot=v[1], slip_x=slip_x, slip_z=slip_z)
    turning = dict(spin=w[2] if len(w) > 2 else read(0.0, "omega")) if model.drilling else {}
    return {**named, **turning, **{name: read(given[name], name) for name in ("y", "ydot")}}


def _components(
    name: str, value: Any, lengths: tuple[int, ...], read: Callable[[Any, str], Any]
) -> list[Any]:
    """Components along the ground, which are on the last axis."""
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise LandingError(f"{name} is {value!r}, not an array of numbers.") from error
    if array.ndim == 0 or array.shape[-1] not in lengths:
        hint = (
            " In the plane xdot, omega and x are numbers, and the model is given without in_3d()."
            if array.ndim == 0
            else ""
        )
        if name == "omega" and array.shape[-1:] == (3,):
            hint = " A spin about the vertical needs model.in_3d(drilling_radius=...)."
        raise LandingError(
            f"{name} has shape {array.shape}, but in 3-D its last axis has "
            f"{' or '.join(map(str, lengths))} components, forward and to the right.{hint}"
        )
    return [read(array[..., k], f"{name}[{k}]") for k in range(array.shape[-1])]


def landing_number(value: Any, name: str) -> float:
    """Return one finite number of a landing."""
    if is_vector(value):
        raise LandingError(
            f"{name} has shape {np.shape(value)}, but simulate follows one bounce. Use bounce.lift_off "
            "for many."
        )
    return number(value[()] if isinstance(value, np.ndarray) else value, name, LandingError)


def check_approach(y: float, ydot: float) -> None:
    """Refuse a ball above the ground or moving away from it."""
    if y > 0.0:
        raise LandingError(f"y is {y!r}: the ball is in the air. Touch-down is at y = 0.")
    if y == 0.0 and ydot >= 0.0:
        raise LandingError(
            f"ydot is {ydot!r} at y = 0: the ball does not approach the ground. y points up, so ydot "
            "must be negative."
        )


def time_limit(t_max: float) -> float:
    """Return the longest time of a contact."""
    limit = number(t_max, "t_max", ns.OptionError)
    if limit <= 0:
        raise ns.OptionError(f"t_max is {t_max!r}, but a longest time is positive.")
    return limit
