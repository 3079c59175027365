"""The phase ``F`` from touch-down to the first positive load, without friction.

The load can be negative at first where it is less gravity (``load="net"``). This lasts from the
scale of the bounce down to nothing, and can begin at a power law's zero. Its length is estimated
from a few Euler points before the motion is integrated.
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
#: Times ahead at which the load is evaluated.
_AHEAD = 1e-17 * 4.0 ** np.arange(25)
#: How many of them are shorter than an instant.
_SHORT = int(np.searchsorted(_AHEAD, INSTANT))
#: A ball this near to y = 0 that moves up is back at the surface.
_SURFACE = 1e-9
#: A ball that is slower than this, relative to its speed at touch-down and its depth, has come to rest.
_REST = 1e-12


class Rise(NamedTuple):
    """When the load of landings becomes positive; if none of the first three, it is positive already."""

    #: At once, from a zero without a Taylor series, such as a power law's. One run in the plane can
    #: begin on it; ensembles and runs in 3-D step off it.
    root: NDArray[np.bool_]
    #: Within an instant, which is passed by one Euler step.
    short: NDArray[np.bool_]
    #: After a phase without friction.
    later: NDArray[np.bool_]
    #: Longest step that does not miss the end of that phase; infinite where no end was found ahead.
    longest: Array


def rise(blueprint: Blueprint, x: Array, p: Array) -> Rise:
    """Estimate it for states (n, m) and parameters (k, m) in columns, without friction."""
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
    """Whether balls (..., n) whose load ended are at rest, with a load of rounding errors only."""
    # Where the load is less gravity and damping is strong, it falls to zero as the ball comes to rest.
    size = np.maximum(np.abs(states[..., 2]), np.abs(start[..., [2, 3]]).max(axis=-1))
    return np.asarray(np.abs(states[..., 3]) <= _REST * size)


def onto_zero_load(blueprint: Blueprint, x: Array, p: Array) -> Array:
    """Move along the motion until the load is zero to rounding, not to the tolerance of the run."""
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
    """The motion until the load is positive (None if at once), and time and state at its end."""
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
            f"y = {start[2]!r}, ydot = {start[3]!r}: the load is not positive and the ball moves up. The "
            "ball has lifted off already."
        )
    run = ns.simulate(
        free_system(blueprint), start, t_max, parameters=parameters, tol=tol, max_step=longest[0]
    )
    if run.status is not ns.Status.STOPPED:
        raise LiftOffError(no_lift_off(run, t_max), run)
    if surfaced(run.x[-1]):
        raise LiftOffError(
            f"The load is not positive before the ball is back at y = 0 at t = {run.t[-1]:.6g}. It passes "
            "through the surface without pressing on it.",
            run,
        )
    onto = onto_zero_load(blueprint, run.x[-1][:, None], p)[:, 0].tolist()
    return run, float(run.t[-1]), onto


def _finite_load(blueprint: Blueprint, x: Array, p: Array) -> float:
    """The load at touch-down; forces that are not finite are refused."""
    load, _, field, _ = (v.ravel() for v in ns.call(touch_down_function(blueprint), x, p))
    if not (np.isfinite(load[0]) and np.all(np.isfinite(field))):
        raise LandingError(
            f"The load at touch-down is {load[0]}, and the rates are {field.tolist()}, at the state "
            f"{x[:, 0].tolist()}. Check the model's logarithms, roots and divisions."
        )
    return float(load[0])


def no_lift_off(run: ns.Trajectory, t_max: float) -> str:
    """Why a run ended without lift-off, and what to do."""
    y, ydot = run.x[-1, 2], run.x[-1, 3]
    if run.status is not ns.Status.REACHED_END:
        return (
            f"The ball does not lift off: the run ended with {run.status} at t = {run.t[-1]:.6g}. "
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
        f"The ball does not lift off before t_max = {t_max:g}; at the end y = {y:.6g}, ydot = "
        f"{ydot:.6g}. {cause}"
    )
