"""Arrays of lift-offs, with a status for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..shot.state import AlongTheGround

Array = NDArray[np.float64]


class BounceStatus(IntEnum):
    """How a bounce of an ensemble ended, as a number in arrays."""

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
        """The meaning of the status in a sentence."""
        return _ADVICE[self]


_ADVICE = {
    BounceStatus.LIFTED_OFF: "The load fell to zero.",
    BounceStatus.NO_LIFT_OFF: "The load did not vanish before t_max: the ball stays, or t_max is "
    "too short.",
    BounceStatus.NOT_A_LANDING: "The ball is above the ground or moves away from it.",
    BounceStatus.NOT_FINITE: "An input or a force is not a finite number.",
    BounceStatus.BAD_PARAMETER: "A parameter is outside the model's limits.",
    BounceStatus.NO_CONTACT: "The ball passes through the surface without pressing on it.",
    BounceStatus.NON_UNIQUE: "The motion reaches a point from which it is not unique.",
    BounceStatus.FAILED: "Too many events or steps: the message of simulate has the details.",
}


@dataclass(frozen=True, eq=False, repr=False)
class LiftOffs(AlongTheGround, ns.result_tables.Tabular):
    """Lift-offs, each array of the broadcast shape ``(...)`` of the landings.

    In 3-D ``xdot``, ``omega``, ``x`` and ``slip`` are arrays (..., 2), forward and to the right, as in
    :class:`bounce.shot.State`.

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
    slip : ndarray (...)
        Velocity of the contact point, ``xdot + omega``; below zero is reverse slip.
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
    slip: Array = None  # type: ignore[assignment]

    def _tables(self) -> dict[str, ns.result_tables.ResultTable]:
        axes = {f"landing_{k}": size for k, size in enumerate(self.time.shape)}
        return {"lift_offs": self._over(axes)}

    def _over(self, axes: Mapping[str, Any]) -> ns.result_tables.ResultTable:
        """The lift-offs as a table over the axes of the landings."""
        names = ("xdot", "ydot", "omega", "x", "y", "time", "slip")
        columns = {name: ("direction", getattr(self, name)) for name in names}
        status = np.array([str(s) for s in sorted(BounceStatus)], dtype=object)[self.status]
        plain = {"status": status, "itinerary": self.itinerary}
        return ns.result_tables.ResultTable(
            axes, columns | plain, {"direction": ("forward", "right")}
        )

    def __post_init__(self) -> None:
        if self.slip is None:
            object.__setattr__(self, "slip", self.xdot + self.omega)

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
        shown = ", ".join(map(repr, self.itineraries[:8])) + (
            ", ..." if len(self.itineraries) > 8 else ""
        )
        return f"{type(self).__name__}(shape {self.time.shape}; {counts}; itineraries {shown})"
