"""Boundaries of conditions and contacts: a motion leaves them, is closed there, or arrives.

While a condition of relative degree 1 is closed its multiplier keeps y = 0: that is the limit of sliding for a
field below that presses infinitely strongly. A contact, of relative degree 2, keeps its gap and the rate of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...model import Array, PointError
from .surface_point import LocalSurface, Numbers, null_space


@dataclass(frozen=True, eq=False)
class OneSided:
    """Numbers of a boundary at one point; along joints and what else is closed, where there is such."""

    rate: float  # of the gap of a contact, as an angle; 0 for a condition
    drive: float  # first derivative that the multiplier enters while it is zero, dimensionless
    next: float  # the derivative after it
    load: float  # multiplier while closed
    push: Array  # direction in which the multiplier acts (d,)
    tangents: Array  # of the boundary (d, d - 1), of a contact also of rest on it (d, d - 2)

    def way(self, tol: float) -> int:
        """1 where a motion leaves, -1 where it is closed or arrives, 0 at the border of both."""
        value = self.rate if abs(self.rate) > tol else self.drive
        return 0 if abs(value) <= tol else 1 if value > 0 else -1


def one_sided_at(where: LocalSurface, numbers: Numbers) -> OneSided:
    """Numbers of the boundary at a point on it."""
    assert where.element is not None
    x, contact = numbers.x, where.element.kind == "contact"
    push, load = where.element.push_at(x, where.parameters)
    basis = where.along(x)
    push = push if basis is None else basis.T @ push
    rate, degree = (float(numbers.angles[0]), 2) if contact else (0.0, 1)
    speed, slope = (float(np.linalg.norm(v)) for v in (numbers.fields[0], numbers.gradient))
    size = speed**degree * slope / (1 + float(np.linalg.norm(x))) ** (degree - 1)
    drive, later = 0.0, 0.0
    if size > 0.0:
        h = where.orbit(x, "+", degree + 1)[1]
        drive, later = degree * float(h[degree]) / size, float(h[degree + 1])
    rows = [numbers.gradient, numbers.lie_gradients[0]] if contact else [numbers.gradient]
    return OneSided(rate, drive, later, load, push, null_space(np.array(rows)))


def velocity_while_closed(where: LocalSurface, numbers: Numbers, tol: float) -> Array:
    """Velocity (N,) while a condition or contact is closed; refused where it opens or is hit."""
    found = one_sided_at(where, numbers)
    if abs(found.rate) > tol or found.way(tol) > 0:
        what = "open" if found.way(tol) > 0 else "hit with a speed"
        raise PointError(
            f"sliding field: expected a point where the condition or contact is closed, received {numbers.x.tolist()}, "
            f"where it is {what}. classify(system, point) says what happens there."
        )
    basis, field = where.along(numbers.x), numbers.fields[1]
    return field if basis is None else np.asarray(basis @ field)
