"""What becomes of many bounces: arrays of lift-offs, with a status for each."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class BounceStatus(IntEnum):
    """How a bounce of an ensemble ended; stored in arrays."""

    LIFTED_OFF = 0
    NO_LIFT_OFF = 1
    NOT_A_LANDING = 2
    NOT_FINITE = 3
    BAD_PARAMETER = 4
    NO_CONTACT = 5
    NON_UNIQUE = 6
    FAILED = 7

    def __str__(self) -> str:
        return self.name

    @property
    def advice(self) -> str:
        """The status in a sentence, with what to do."""
        return _ADVICE[self]


_ADVICE = {
    BounceStatus.LIFTED_OFF: "The load fell to zero.",
    BounceStatus.NO_LIFT_OFF: "The load did not vanish before t_max: the ball stays, or t_max is "
    "too short.",
    BounceStatus.NOT_A_LANDING: "The ball is above the ground or moves away from it.",
    BounceStatus.NOT_FINITE: "An input, or a force on the way, is not a finite number.",
    BounceStatus.BAD_PARAMETER: "A parameter is outside the model's limits.",
    BounceStatus.NO_CONTACT: "The ball passes through the surface without pressing on it.",
    BounceStatus.NON_UNIQUE: "The motion meets a point from which it is not unique.",
    BounceStatus.FAILED: "Too many events or steps: simulate this one to see its message.",
}


class _Ended:
    """How the bounces of an array ended: common to the plane and to 3-D."""

    time: Array
    status: NDArray[np.int8]
    itineraries: tuple[str, ...]
    itinerary_code: NDArray[np.int32]

    @property
    def itinerary(self) -> NDArray[np.object_]:
        """Phases as in ``Shot.itinerary`` (...); equal ones are the same object, "" where none."""
        return np.array([*self.itineraries, ""], dtype=object)[self.itinerary_code]

    @property
    def complete(self) -> NDArray[np.bool_]:
        """Where the ball lifted off (...)."""
        return self.status == BounceStatus.LIFTED_OFF

    def __repr__(self) -> str:
        counts = ", ".join(
            f"{BounceStatus(int(s))} {k}"
            for s, k in zip(*np.unique(self.status, return_counts=True), strict=True)
        )
        words = ", ".join(map(repr, self.itineraries[:8])) + (
            ", ..." if len(self.itineraries) > 8 else ""
        )
        return f"{type(self).__name__}(shape {self.time.shape}; {counts}; itineraries {words})"


@dataclass(frozen=True, eq=False, repr=False)
class LiftOffs(_Ended):
    """Lift-offs, each array of the broadcast shape ``(...)`` of the inputs.

    Attributes
    ----------
    xdot, ydot, omega, x, y : ndarray (...)
        State at lift-off; NaN where ``status`` is not LIFTED_OFF.
    time : ndarray (...)
        Duration of the contact.
    status : ndarray of int8 (...)
        Values of :class:`BounceStatus`.
    itineraries : tuple of str
        Those that occur, sorted.
    itinerary_code : ndarray of int32 (...)
        Position in ``itineraries``; -1 where there was no lift-off.
    """

    xdot: Array
    ydot: Array
    omega: Array
    x: Array
    y: Array
    time: Array
    status: NDArray[np.int8]
    itineraries: tuple[str, ...]
    itinerary_code: NDArray[np.int32]

    @property
    def slip(self) -> Array:
        """Slip ``xdot + omega`` at lift-off (...); below zero is reverse slip."""
        return self.xdot + self.omega


@dataclass(frozen=True, eq=False, repr=False)
class LiftOffs3D(_Ended):
    """Lift-offs in 3-D, arrays of the broadcast shape ``(...)`` of the landings.

    Attributes
    ----------
    xdot, omega, x : ndarray (..., 2)
        Velocity, spin and place along the ground, forward and to the right, as in
        :class:`State3D`; NaN where ``status`` is not LIFTED_OFF.
    ydot, y : ndarray (...)
        Velocity and place normal to the ground.
    slip : ndarray (..., 2)
        Velocity of the contact point.
    time : ndarray (...)
        Duration of the contact.
    status : ndarray of int8 (...)
        Values of :class:`BounceStatus`.
    itineraries : tuple of str
        Those that occur, sorted.
    itinerary_code : ndarray of int32 (...)
        Position in ``itineraries``; -1 where there was no lift-off.
    """

    xdot: Array
    ydot: Array
    omega: Array
    x: Array
    y: Array
    slip: Array
    time: Array
    status: NDArray[np.int8]
    itineraries: tuple[str, ...]
    itinerary_code: NDArray[np.int32]

    @property
    def slip_speed(self) -> Array:
        """Length of the slip (...)."""
        return np.hypot(self.slip[..., 0], self.slip[..., 1])

    @property
    def slip_angle(self) -> Array:
        """Direction of the slip (...), rad from forward to the right, in $(-pi, pi]$."""
        return np.arctan2(self.slip[..., 1] + 0.0, self.slip[..., 0])

    @property
    def travel_angle(self) -> Array:
        """Direction in which the ball leaves along the ground (...), as ``slip_angle``."""
        return np.arctan2(self.xdot[..., 1] + 0.0, self.xdot[..., 0])
