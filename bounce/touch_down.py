"""Between touch-down and the first positive load there is no friction: the phase ``F``.

The load can be negative at first where it is less gravity (``load="net"``). That can last from the
scale of the bounce down to nothing, and begin at a power law's zero, so a few Euler points ahead
tell how long it lasts before the motion is computed.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from .contact import ContactModel
from .equations import free_system, touch_down_function
from .errors import LandingError, LiftOffError

#: Times ahead at which the load is looked at. A phase shorter than _INSTANT is passed by one Euler
#: step of that length: below rounding in the speeds, and far enough from a power law's zero.
_AHEAD = 1e-17 * 4.0 ** np.arange(25)
_INSTANT = 1e-13


def approach(
    blueprint: ContactModel,
    parameters: dict[str, float],
    start: list[float],
    tol: float,
    t_max: float,
) -> tuple[ns.Trajectory | None, list[float]]:
    """Follow the ball without friction until the load is positive.

    Parameters
    ----------
    blueprint : ContactModel
    parameters : dict
    start : list of float (n,)
        State at touch-down.
    tol, t_max : float

    Returns
    -------
    run : nonsmooth.Trajectory or None
        None if the load is positive at once.
    start : list of float
        State in which the contact with friction begins.

    Raises
    ------
    LandingError, LiftOffError
    """
    p = list(parameters.values())
    function = touch_down_function(blueprint)
    load, _, field, _ = (np.array(v).ravel() for v in function(start, p))
    if not (np.isfinite(load[0]) and np.all(np.isfinite(field))):
        raise LandingError(
            f"load: expected finite forces at touch-down, received a load of {load[0]} and rates of "
            f"{field.tolist()} at {start}. Look at the model's logarithms, roots and divisions."
        )
    if load[0] > 0.0:
        return None, start
    ahead = np.array(start)[:, None] + field[:, None] * _AHEAD
    loads = np.array(
        function(ahead, np.repeat(np.array(p)[:, None], _AHEAD.size, axis=1))[0]
    ).ravel()
    positive = np.flatnonzero(loads > 0.0)
    first = int(positive[0]) if positive.size else _AHEAD.size
    if load[0] == 0.0 and first < _AHEAD.size and not np.any(loads[:first] < 0.0):
        return None, start
    if first < _AHEAD.size and _AHEAD[first] < _INSTANT:
        return None, (np.array(start) + _INSTANT * field).tolist()
    _require_approach(start)
    longest = _AHEAD[first] / 8 if first < _AHEAD.size else np.inf
    run = ns.simulate(
        free_system(blueprint), start, t_max, parameters=parameters, tol=tol, max_step=longest
    )
    if run.status is ns.Status.STOPPED and run.events[-1].name == "contact":
        return run, _onto_zero_load(function, run.x[-1], p)
    if run.status is ns.Status.STOPPED:
        message = (
            f"lift-off: expected a load that becomes positive, received none before the ball was back "
            f"at y = 0 at t = {run.t[-1]:.6g}. It passes through the surface without pressing on it."
        )
    else:
        message = no_lift_off(run, t_max)
    raise LiftOffError(message, run)


def _onto_zero_load(function: ca.Function, x: NDArray[np.float64], p: list[float]) -> list[float]:
    """Move along the motion until the load is zero to rounding, not to the tolerance of the run.

    A ball that rolls at once must not see the negative load of an instant before.
    """
    for _ in range(3):
        load, rate, field, _ = (np.array(v).ravel() for v in function(x, p))
        x = x - load / rate * field
    return x.tolist()


def _require_approach(start: list[float]) -> None:
    if start[2] < 0.0 <= start[3]:
        raise LandingError(
            f"load: expected a positive load in a ball that moves up in the ground, received y = "
            f"{start[2]!r}, ydot = {start[3]!r}, where it is not. The ball has lifted off already."
        )


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
