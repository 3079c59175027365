"""What an event does to neighbours of an orbit: one formula for every kind of event.

At an event e(x, p) = 0 the field changes from f- to f+, the field of the mode after everything that
happens at that instant, and the state jumps by a reset g (the identity if there is none). A neighbour
x + dx meets the event at another time, so

    dt = -(e_x dx + e_p dp)/(e_x f-),    dx+ = g_x dx + g_p dp + (g_x f- - f+) dt,

    S = g_x + (f+ - g_x f-) e_x/(e_x f-),    S_p = g_p + (f+ - g_x f-) e_p/(e_x f-).

It holds for crossings, entries to sliding (S loses one rank), exits (f+ = f-, so S = 1), resets,
impacts, stops, clocks that are states, and surfaces that move with the time, which is a state then.

Source: Aizerman & Gantmakher 1958; Leine & Nijmeijer 2004, "Dynamics and bifurcations of non-smooth
mechanical systems", ch. 7; di Bernardo et al. 2008, "Piecewise-smooth dynamical systems", sec. 2.5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..model import Array, DegenerateError
from ..model.event_maps import AtEvent

#: An orbit that meets a surface at an angle below this grazes it.
GRAZING = 1e-8

#: Fields that differ by less than this part of them are one field.
_CONTINUOUS = 1e-10


@dataclass(frozen=True)
class Saltation:
    """Derivatives through an event.

    Attributes
    ----------
    matrix : ndarray (N, N)
        S.
    by_parameters : ndarray (N, np)
        S_p.
    time_by_state, time_by_parameters : ndarray (N,), (np,)
        Derivatives of the time of the event.
    angle : float
        ``|e_x f-|/(|e_x| |f-|)``, zero at a grazing.
    """

    matrix: Array
    by_parameters: Array
    time_by_state: Array
    time_by_parameters: Array
    angle: float


def saltation(at: AtEvent, before: Array, after: Array, what: str = "event") -> Saltation:
    """Saltation matrix of an event.

    Parameters
    ----------
    at : AtEvent
        Event function and reset, with their derivatives.
    before, after : ndarray (N,)
        Fields f- and f+.
    what : str
        Named in messages.

    Raises
    ------
    DegenerateError
        The orbit grazes the surface where the field changes.

    Examples
    --------
    An entry to sliding on y = 0: the direction across the surface is lost.

    >>> import numpy as np
    >>> at = AtEvent(np.zeros(2), np.eye(2), np.zeros((2, 0)), 0.0, np.array([0.0, 1.0]), np.zeros(0))
    >>> saltation(at, np.array([1.0, -2.0]), np.array([2.0, 0.0])).matrix
    array([[ 1. , -0.5],
           [ 0. ,  0. ]])
    """
    speed = float(at.gradient @ before)
    size = _length(at.gradient) * _length(before)
    angle = abs(speed) / size if size else 0.0
    carried = at.after_state @ before
    jump = after - carried
    scale = max(_length(after), _length(carried))
    continuous = _length(jump) <= _CONTINUOUS * scale
    if angle < GRAZING and not continuous:
        raise DegenerateError(grazing(what, angle, at, jump))
    rate = -1.0 / speed if speed else np.inf
    time_x, time_p = rate * at.gradient, rate * at.by_parameters
    if continuous:
        matrix, by_parameters = at.after_state, at.after_parameters
    else:
        matrix = at.after_state - jump[:, None] * time_x
        by_parameters = at.after_parameters - jump[:, None] * time_p
    return Saltation(matrix, by_parameters, time_x, time_p, angle)


def _length(v: Array) -> float:
    return math.sqrt(float(v @ v))


def grazing(what: str, angle: float, at: AtEvent, jump: Array) -> str:
    """Message for an event that the orbit only touches."""
    moved = not np.array_equal(at.after_state[:, : len(at.after)], np.eye(len(at.after)))
    if moved:
        kind = (
            "a grazing of a reset or impact: neighbours that miss it and those that meet it differ "
            "by a square root, whose derivative is infinite"
        )
    elif float(at.gradient[: len(jump)] @ jump) > 0.0:
        kind = (
            "a grazing of a sliding surface: the derivative is one matrix on the side that misses "
            "it and another one on the side that slides"
        )
    else:
        kind = (
            "a grazing of a surface beyond which the field leads away: the map is discontinuous "
            "there"
        )
    return (
        f"{what}: expected a transversal event, received the angle {angle:.1e} between orbit and "
        f"surface. It is {kind}. Move the start or a parameter away from the grazing."
    )
