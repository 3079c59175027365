"""Where two or more surfaces meet: the range of motions that Filippov's convex set allows.

With independent multipliers (the bilinear law, which :func:`simulate` follows) the motion along an
intersection is one of many convex combinations of the 2^k fields that stay on it. Their range says
how much of a result is that choice: it is a point where the convention decides alone.

Source: Filippov 1988, sec. 4; Jeffrey 2014, "Dynamics at a switching intersection: hierarchy,
isonomy, and multiple sliding", SIAM J. Appl. Dyn. Syst. 13, 1082 (the canopy, here "bilinear").
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...model import (
    DefinitionError,
    FilippovSystem,
    Parameters,
    PointError,
    read_function,
    require_system,
)
from .surface_point import TOLERANCE


def intersection_range(
    system: FilippovSystem,
    point: ArrayLike,
    of: Any,
    *,
    surfaces: Sequence[int] | None = None,
    parameters: Parameters | None = None,
    t: float = 0.0,
) -> tuple[float, float]:
    """Range of d(of)/dt over all convex combinations of fields that stay on an intersection.

    Parameters
    ----------
    system : FilippovSystem
        With the surfaces that meet, and their multipliers.
    point : array_like (n,)
        A point on the surfaces.
    of : expression
        A function of states, parameters and time, such as one of the states.
    surfaces : sequence of int, optional
        Which surfaces meet; all of them by default.
    parameters, t : optional
        As in :func:`region`.

    Returns
    -------
    low, high : float
        Equal where Filippov's convention determines the motion.

    Raises
    ------
    PointError
        No convex combination stays on the intersection; off one of the surfaces; a wrong shape.
    DefinitionError
        ``of`` is no expression in states, parameters and time; a surface that the system does not
        have, or vector multipliers.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, z, a, b = (ca.SX.sym(s) for s in ("x", "y", "z", "a", "b"))
    >>> system = ns.FilippovSystem(
    ...     [x, y, z], field=[-a, -b, 1 + a * b / 2], multipliers=[a, b], surfaces=[x, y])
    >>> low, high = ns.local.intersection_range(system, [0, 0, 0], of=z)
    >>> round(low, 12), round(high, 12)
    (0.5, 1.5)
    """
    from scipy.optimize import linprog

    require_system(system)
    chosen = _chosen(system, surfaces)
    of = read_function(system.definition, of, "of")
    every = range(system.surface_count)
    h = [system.evaluate(system.surface_function(i), point, parameters, t).item() for i in every]
    _refuse_distance(system, point, parameters, t, {i: h[i] for i in chosen})
    letters = ["+" if value > 0 else "-" for value in h]
    rates, normal = [], []
    for combination in product("+-", repeat=len(chosen)):
        for i, letter in zip(chosen, combination, strict=True):
            letters[i] = letter
        mode = "".join(letters)
        rates.append(_rate(system, mode, of, None, point, parameters, t))
        normal.append([_rate(system, mode, None, i, point, parameters, t) for i in chosen])
    equations = np.vstack([np.array(normal).T, np.ones(len(rates))])
    right = np.append(np.zeros(len(chosen)), 1.0)
    results = [linprog(s * np.array(rates), A_eq=equations, b_eq=right) for s in (1.0, -1.0)]
    if any(r.x is None for r in results):
        raise PointError(
            f"point: expected one where a convex combination of the fields stays on surfaces "
            f"{chosen}, received one (h = {[h[i] for i in chosen]}) where none does. The motion leaves the intersection."
        )
    return float(results[0].fun), float(-results[1].fun)


def _chosen(system: FilippovSystem, surfaces: Sequence[int] | None) -> list[int]:
    items: Any = range(system.surface_count) if surfaces is None else surfaces
    if isinstance(items, (str, bytes)) or not isinstance(items, (Sequence, np.ndarray)):
        items = [items]
    chosen = [system.surface_index(i) for i in items]
    if not chosen or len(set(chosen)) < len(chosen):
        raise DefinitionError(
            f"surfaces: expected different indices below {system.surface_count}, at least one, "
            f"received {chosen}."
        )
    return chosen


def _refuse_distance(
    system: FilippovSystem,
    point: ArrayLike,
    parameters: Parameters | None,
    t: float,
    values: dict[int, float],
) -> None:
    for i, h in values.items():
        slope = system.evaluate(system.gradient(system.surface_function(i)), point, parameters, t)
        scale = float(np.linalg.norm(slope)) * (
            1.0 + float(np.linalg.norm(np.asarray(point, float)))
        )
        if not abs(h) <= TOLERANCE * scale:
            raise PointError(
                f"point: expected one on surfaces {list(values)}, received one with h{i} = {h:.6g}. "
                "Give surfaces= those that meet at the point."
            )


def _rate(
    system: FilippovSystem,
    mode: str,
    of: Any,
    surface: int | None,
    point: ArrayLike,
    parameters: Parameters | None,
    t: float,
) -> float:
    """d(of)/dt, or dh_i/dt, along the field of a mode."""
    derivative = (
        system.lie_derivative([mode], of=of)
        if surface is None
        else system.lie_derivative([mode], surface)
    )
    return system.evaluate(derivative, point, parameters, t).item()
