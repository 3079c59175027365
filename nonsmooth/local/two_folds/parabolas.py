"""Orbits of the normal form off the surface, in closed form: z1 is quadratic in time."""

from __future__ import annotations

import numpy as np

from ...model import Array
from ..point.surface_point import Side
from .reduced_flow import ReducedFlow

_POINTS = 61


def arc(flow: ReducedFlow, side: Side, centre: float, half: float, height: float = 0.0) -> Array:
    """Return an orbit off the surface, symmetric in time about its passage over a fold."""
    (s1, s2), (n1, n2) = flow.sigma, flow.nu
    t = np.linspace(-half, half, _POINTS)
    if side == "+":
        return np.column_stack([height + s1 * t**2 / 2, -s1 * t, centre + n1 * t])
    return np.column_stack([height + s2 * t**2 / 2, centre + n2 * t, s2 * t])


def flight(flow: ReducedFlow, z: Array, side: Side) -> Array:
    """Return the flight (61, 3) from (z2, z3) over or under an invisible fold."""
    if side == "+":
        return arc(flow, "+", z[1] - flow.nu[0] * z[0], -z[0], z[0] ** 2 / 2)
    return arc(flow, "-", z[0] - flow.nu[1] * z[1], -z[1], -(z[1] ** 2) / 2)


def passage(flow: ReducedFlow, z: Array, side: Side, *, ahead: bool) -> Array:
    """Return the orbit (61, 3) of one field from or to (z2, z3), while it stays on its side."""
    (s1, s2), (n1, n2) = flow.sigma, flow.nu
    if side == "+":
        speed, returns = abs(z[0]), s1 < 0
    else:
        speed, returns = abs(z[1]), s2 > 0
    last = 2 * speed if returns else 1.5
    t = np.linspace(0.0, last, _POINTS) if ahead else np.linspace(-last, 0.0, _POINTS)
    if side == "+":
        return np.column_stack([-z[0] * t + s1 * t**2 / 2, z[0] - s1 * t, z[1] + n1 * t])
    return np.column_stack([z[1] * t + s2 * t**2 / 2, z[0] + n2 * t, z[1] + s2 * t])
