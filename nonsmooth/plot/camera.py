"""How the flow at a two-fold is seen: an orthographic projection, and where it is looked at from."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..local.two_folds import ReducedFlow, diabolo_slopes, flight_above
from ..local.two_folds.flights import has_diabolo
from ..local.two_folds.parabolas import flight
from ..model import Array


@dataclass(frozen=True)
class Camera:
    """Orthographic projection of (z1, z2, z3), z1 upwards, seen from above Da.

    Attributes
    ----------
    azimuth : float
        Direction of the viewer in the z2-z3 plane, from the z2 axis; rad.
    elevation : float
        Above the surface; rad.
    stretch : float
        Of z1: normal forms have no scale that relates it to z2 and z3.
    """

    azimuth: float = math.radians(72.0)
    elevation: float = math.radians(37.0)
    stretch: float = 1.0

    def __call__(self, z: ArrayLike) -> Array:
        """Project points (..., 3) to the picture (..., 2).

        Examples
        --------
        >>> float(Camera()([1.0, 0.0, 0.0])[0])
        0.0
        """
        z = np.asarray(z, dtype=float)
        c, s = math.cos(self.azimuth), math.sin(self.azimuth)
        right = -s * z[..., 1] + c * z[..., 2]
        away = -c * z[..., 1] - s * z[..., 2]
        up = math.sin(self.elevation) * away + math.cos(self.elevation) * self.stretch * z[..., 0]
        return np.stack([right, up], axis=-1)


def azimuth_of(flow: ReducedFlow) -> float:
    """Direction of view with Da in front and neither field along the line of sight."""
    (s1, s2), (n1, n2) = flow.sigma, flow.nu

    def seen(angle: float) -> float:
        right = np.array([-math.sin(angle), math.cos(angle)])
        fields = np.array([[-s1, n1], [n2, s2]]) / [[math.hypot(1, n1)], [math.hypot(1, n2)]]
        return float(np.min(np.abs(fields @ right)))

    return max((math.radians(d) for d in (72.0, 62.0, 28.0, 18.0)), key=seen)


def stretch_of(flow: ReducedFlow) -> float:
    """Stretch of z1 that makes flights over invisible folds about as high as they are wide."""
    if has_diabolo(flow):
        heights = []
        for slope in diabolo_slopes(flow.nu):
            line = np.array([-1.0, slope])
            above, below = flight(flow, line, "+"), flight(flow, flight_above(line, flow.nu), "-")
            for curve in (above, below):
                size = np.max(np.abs(curve[:, 1:]))
                heights.append(np.max(np.abs(curve[:, 0])) / size**2)
        return float(np.clip(0.5 / max(heights), 1.5, 8.0))
    return {"VV": 1.6, "II": 4.0}.get(flow.folds, 2.2)
