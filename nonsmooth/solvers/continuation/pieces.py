"""Curves made of pieces, each with its own equations, and how to leave branch points."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ...model import Array, DefinitionError
from .arc import Arc, require_curve, vector
from .curve import Curve, Point


@dataclass(frozen=True, eq=False)
class Departure:
    """How a piece of a curve begins.

    Attributes
    ----------
    curve : Curve
        Its equations.
    rows : list of ndarray (N,)
        Points of it, the last one where the piece begins.
    tangent : ndarray (N,)
        The way it goes, in scaled unknowns.
    """

    curve: Curve
    rows: list[Array]
    tangent: Array


def pieces(
    departure: Departure,
    follow: Callable[[Departure], Arc],
    following: Callable[[Departure, Arc], Departure | None],
    *,
    last: Callable[[Arc], bool],
    apart: float = 1e-6,
    most: int = 24,
) -> Iterator[tuple[Departure, Arc]]:
    """Trace piece after piece.

    Parameters
    ----------
    departure : Departure
        Of the first piece.
    follow : callable
        Takes a departure and returns its arc.
    following : callable
        How the next one begins, from the piece that ended; None if nothing follows.
    last : callable
        Whether the curve ends with a piece.
    apart : float, optional
        A piece that ends where an earlier one did closes the curve; distance in scaled unknowns.
    most : int, optional
        Limit of the number of pieces.

    Yields
    ------
    Departure, Arc
        A start, and the arc that was followed from it.
    """
    for name, value in (("follow", follow), ("following", following), ("last", last)):
        if not callable(value):
            raise DefinitionError(f"{name}: expected a function, received {value!r}.")
    ends: list[Array] = []
    for _ in range(most):
        arc = follow(departure)
        yield departure, arc
        end = arc.points[-1].u / departure.curve.scale
        same = [e for e in ends if e.size == end.size]
        if last(arc) or any(np.linalg.norm(end - e) < apart for e in same):
            return
        ends.append(end)
        found = following(departure, arc)
        if found is None:
            return
        departure = found


def depart(
    curve: Curve, u: Array, direction: Array, distance: float, forward: Array
) -> Departure | None:
    """Leave a point along a direction, unless that is the way back.

    Parameters
    ----------
    curve : Curve
        The curve: its equations and test functions.
    u : ndarray (N,)
        The point of the curve to leave from.
    direction : ndarray (N,)
        In scaled unknowns.
    distance : float
        How far the first point is from there.
    forward : ndarray (N,)
        How the point was reached.
    """
    require_curve(curve)
    u, direction = vector(u, "u"), vector(direction, "direction")
    found = curve.correct(u + distance * direction * curve.scale, direction)
    if found is None or curve.fault(found):
        return None
    step = (found - u) / curve.scale
    tangent = step / np.linalg.norm(step)
    return Departure(curve, [u, found], tangent) if tangent @ forward > -0.9 else None


def directions(curve: Curve, u: Array) -> list[Array]:
    """Return both directions of a curve at a point, by its Jacobian.

    Parameters
    ----------
    curve : Curve
        The curve: its equations.
    u : ndarray (N,)
        The point.

    Returns
    -------
    list of two ndarray (N,)
        Unit vectors in scaled unknowns.
    """
    require_curve(curve)
    _, jacobian = curve.scaled(vector(u, "u") / curve.scale)
    tangent = np.linalg.svd(jacobian)[2][-1]
    return [tangent, -tangent]


def other_direction(point: Point) -> Array:
    """Return the direction across the curve in the plane of both branches that meet at a branch point.

    The Jacobian has two null vectors there. The one across the tangent leads, corrected in the
    hyperplane across it, to the other branch (Keller 1977).

    Parameters
    ----------
    point : Point
        The branch point.

    Returns
    -------
    ndarray (N,)
        A unit vector in scaled unknowns.
    """
    if not isinstance(point, Point):
        raise DefinitionError(
            f"point: expected a nonsmooth.continuation.Point, received {point!r}. A Zero has one."
        )
    null = np.linalg.svd(point.jacobian)[2][-2:]
    inside = null @ point.tangent
    across = inside[0] * null[1] - inside[1] * null[0]
    return np.asarray(across / np.linalg.norm(across))


def changes_around(
    label: Callable[[float], str],
    sign: Callable[[str], int],
    start: float,
    *,
    count: int = 49,
    leave_out: int = 3,
    halvings: int = 12,
) -> Iterator[tuple[float, str, str]]:
    """Angles at which a label changes its sign on a small circle, the nearest to ``start`` first.

    Parameters
    ----------
    label : callable
        Takes an angle and returns a label.
    sign : callable
        Takes a label and returns -1, 0 or 1.
    start : float
        The way ahead; the way back is left out.
    count, leave_out, halvings : int, optional
        Angles on the circle, those left out at either end, and bisections of an interval.

    Yields
    ------
    angle, label before, label after
        Where the label changes, and from what to what.
    """
    angles = start + np.linspace(-np.pi, np.pi, count)[leave_out : count - leave_out]
    labels = [label(float(a)) for a in angles]
    for k in sorted(range(len(labels) - 1), key=lambda k: abs(k - len(labels) // 2)):
        (low, high), (a, b) = map(float, angles[k : k + 2]), labels[k : k + 2]
        if sign(a) * sign(b) >= 0:
            continue
        middle = low
        for _ in range(halvings):
            middle = 0.5 * (low + high)
            c = label(middle)
            low, high, a, b = (middle, high, c, b) if sign(c) == sign(a) else (low, middle, a, c)
        yield middle, a, b
