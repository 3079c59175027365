"""Between touch-down and the first positive load there is no friction: the phase ``F``.

The load can be negative at first where it is less gravity (``load="net"``). That can last from the
scale of the bounce down to nothing, and begin at a power law's zero, so a few Euler points ahead
tell how long it lasts before the motion is computed. What is decided here is decided for one bounce
and for arrays of them; only the run itself is one trajectory there and an ensemble here.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..contact.equations import Blueprint, equations, free_system, touch_down_function
from ..errors import LandingError, LiftOffError

Array = NDArray[np.float64]

#: A phase shorter than this is passed by one Euler step of that length: it is below rounding in the
#: speeds, and far enough from a power law's zero.
INSTANT = 1e-13
#: Times ahead at which the load is looked at.
_AHEAD = 1e-17 * 4.0 ** np.arange(25)
#: How many of them are shorter than an instant.
_SHORT = int(np.searchsorted(_AHEAD, INSTANT))
#: A ball this near to y = 0 that moves up is back at the surface.
_SURFACE = 1e-9
#: A ball that is slower than this, relative to how it came and how deep it is, has come to rest.
_REST = 1e-12


class Rise(NamedTuple):
    """When the load of landings becomes positive; none of the three: it is so already.

    Attributes
    ----------
    root : ndarray of bool (m,)
        At once, from a zero at which there is no Taylor series, such as a power law's. A lone run
        in the plane can begin on it; arrays and runs in 3-D step off it.
    short : ndarray of bool (m,)
        Within an instant, which is stepped over.
    later : ndarray of bool (m,)
        After a phase without friction.
    longest : ndarray (m,)
        Longest step that does not miss its end; infinite where that was not seen ahead.
    """

    root: NDArray[np.bool_]
    short: NDArray[np.bool_]
    later: NDArray[np.bool_]
    longest: Array


def rise(blueprint: Blueprint, x: Array, p: Array) -> Rise:
    """Look ahead along the motion without friction.

    Parameters
    ----------
    blueprint : ContactModel or Contact3D
    x : ndarray (n, m)
        States at touch-down, in columns.
    p : ndarray (k, m)
        Parameters.

    Returns
    -------
    Rise
    """
    function = touch_down_function(blueprint)
    load, _, field, change = ns.call(function, x, p)
    never = _AHEAD.size + 1
    first = np.where(load[0] > 0, 0, never)
    zero = load[0] == 0  # at touch-down, and not negative before it is positive
    for k, ahead in enumerate(_AHEAD, start=1):
        waiting = np.flatnonzero(first == never)
        if not waiting.size:
            break
        now = ns.call(function, x[:, waiting] + ahead * field[:, waiting], p[:, waiting])[0][0]
        zero[waiting[now < 0]] = False
        first[waiting[now > 0]] = k
    rough = ~np.all(np.isfinite(change), axis=0)
    zero &= first < never
    root = np.where(first > 0, zero, rough)
    short = (first > 0) & (first <= _SHORT) & ~zero
    longest = np.append(_AHEAD / 8, np.inf)[np.maximum(first, 1) - 1]
    return Rise(root, short, (first > 0) & ~zero & ~short, longest)


def instant_later(blueprint: Blueprint, states: Array) -> Array:
    """Return states (..., n) an instant later; the speeds change by less than rounding in it."""
    eq, later = equations(blueprint), np.array(states)
    later[..., eq.centre] += INSTANT * later[..., eq.velocity]
    return later


def leaving(states: Array) -> NDArray[np.bool_]:
    """Whether balls (..., n) move up in the ground: without a load they have lifted off already."""
    return np.asarray((states[..., 2] < 0.0) & (states[..., 3] >= 0.0))


def surfaced(states: Array) -> NDArray[np.bool_]:
    """Whether the phase of balls (..., n) ended at y = 0, before there was any load."""
    return np.asarray((states[..., 2] > -_SURFACE) & (states[..., 3] > 0.0))


def rests(states: Array, start: Array) -> NDArray[np.bool_]:
    """Whether balls (..., n) whose load ended only rest: what is left of it is rounding.

    Where the load is less gravity and damping is strong, it falls to zero as the ball comes to rest.
    """
    size = np.maximum(np.abs(states[..., 2]), np.abs(start[..., [2, 3]]).max(axis=-1))
    return np.asarray(np.abs(states[..., 3]) <= _REST * size)


def onto_zero_load(blueprint: Blueprint, x: Array, p: Array) -> Array:
    """Move along the motion until the load is zero to rounding, not to the tolerance of the run.

    A ball that rolls at once must not see the negative load of an instant before.

    Parameters
    ----------
    blueprint : ContactModel or Contact3D
    x, p : ndarray (n, m), (k, m)
        States and parameters, in columns.

    Returns
    -------
    ndarray (n, m)
    """
    for _ in range(3):
        load, rate, field, _ = ns.call(touch_down_function(blueprint), x, p)
        x = x - load / rate * field
    return x


def approach(
    blueprint: Blueprint,
    parameters: dict[str, float],
    start: list[float],
    tol: float,
    t_max: float,
) -> tuple[ns.Trajectory | None, float, list[float]]:
    """Follow one ball without friction until the load is positive.

    Parameters
    ----------
    blueprint : ContactModel or Contact3D
    parameters : dict
    start : list of float (n,)
        State at touch-down.
    tol, t_max : float

    Returns
    -------
    run : nonsmooth.Trajectory or None
        None if the load is positive at once.
    t_start, start : float, list of float
        Time and state in which the contact with friction begins.

    Raises
    ------
    LandingError, LiftOffError
    """
    x, p = np.array(start)[:, None], np.array(list(parameters.values()))[:, None]
    positive = _finite_load(blueprint, x, p) > 0.0
    if positive and not equations(blueprint).steps_off_a_root:
        return None, 0.0, start
    root, short, later, longest = rise(blueprint, x, p)
    if root[0] and equations(blueprint).steps_off_a_root:
        return None, INSTANT, instant_later(blueprint, x[:, 0]).tolist()
    if positive or not later[0]:
        off = short[0] and not positive
        return None, 0.0, (instant_later(blueprint, x[:, 0]) if off else x[:, 0]).tolist()
    if leaving(x[:, 0]):
        raise LandingError(
            f"load: expected a positive load in a ball that moves up in the ground, received y = "
            f"{start[2]!r}, ydot = {start[3]!r}, where it is not. The ball has lifted off already."
        )
    run = ns.simulate(
        free_system(blueprint), start, t_max, parameters=parameters, tol=tol, max_step=longest[0]
    )
    if run.status is not ns.Status.STOPPED:
        raise LiftOffError(no_lift_off(run, t_max), run)
    if surfaced(run.x[-1]):
        raise LiftOffError(
            f"lift-off: expected a load that becomes positive, received none before the ball was back "
            f"at y = 0 at t = {run.t[-1]:.6g}. It passes through the surface without pressing on it.",
            run,
        )
    onto = onto_zero_load(blueprint, run.x[-1][:, None], p)[:, 0].tolist()
    return run, float(run.t[-1]), onto


def _finite_load(blueprint: Blueprint, x: Array, p: Array) -> float:
    """The load at touch-down; forces that are not finite are refused."""
    load, _, field, _ = (v.ravel() for v in ns.call(touch_down_function(blueprint), x, p))
    if not (np.isfinite(load[0]) and np.all(np.isfinite(field))):
        raise LandingError(
            f"load: expected finite forces at touch-down, received a load of {load[0]} and rates of "
            f"{field.tolist()} at {x[:, 0].tolist()}. Look at the model's logarithms, roots and "
            "divisions."
        )
    return float(load[0])


def no_lift_off(run: ns.Trajectory, t_max: float) -> str:
    """Say why a run ended without lift-off."""
    y, ydot = run.x[-1, 2], run.x[-1, 3]
    if run.status is not ns.Status.REACHED_END:
        return (
            f"lift-off: expected at some time, received {run.status} at t = {run.t[-1]:.6g}: "
            f"{run.message}"
        )
    if abs(ydot) < 1e-2:
        cause = "The ball came to rest in the ground, or the contact is slow: give a larger t_max."
    elif y > 0.0:
        cause = "The ball is above the ground: the load of this model does not vanish there."
    elif ydot < 0.0 and y < -10.0:
        cause = (
            "The ball sinks without end: the surface does not push it up. normal_force is positive "
            "in compression, as -k * s.y is."
        )
    else:
        cause = "Give a larger t_max, or check that the model's load vanishes."
    return (
        f"lift-off: expected before t_max = {t_max:g}, received none; at the end y = {y:.6g}, "
        f"ydot = {ydot:.6g}. {cause}"
    )
