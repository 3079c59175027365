"""scipy: periodic orbits by shooting with ``solve_ivp``, DOP853, and finite differences.

What one writes without a library: flows from event to event in plain Python floats, one for each mode,
put together by hand for the itinerary of one orbit; Newton's method with forward differences; multipliers
by central differences. ``whole`` differences every state of the start, as one would for any system;
``section`` only the coordinates on the surface where the orbit is caught, chosen by hand.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

Array = np.ndarray
Map = Callable[[Array, float], tuple[Array, float]]


@dataclass(frozen=True)
class Shooting:
    """A return map of whole states, and the coordinates of its section."""

    name: str
    map: Map
    guess: Array
    place: Callable[[Array], Array]
    coordinates: tuple[int, ...]


def _event(function: Callable[..., float], direction: int = 0) -> Callable[..., float]:
    function.terminal, function.direction = True, direction  # type: ignore[attr-defined]
    return function


def _flow(field, start, state, tol, event=None, span=40.0, first_step=None, most=math.inf):
    run = solve_ivp(
        field,
        (start, start + span),
        state,
        method="DOP853",
        rtol=tol,
        atol=tol,
        events=event,
        first_step=first_step,
        max_step=most,
    )
    return run.y[:, -1], float(run.t[-1]), run


# The simplest walker ----------------------------------------------------------------------------


def _walk(t, y, slope=0.009):
    angle, rate, swing, speed = y
    a = math.sin(angle - slope)
    b = a + (rate * rate - math.cos(angle - slope)) * math.sin(swing)
    return [rate, a, speed, b]


def _step(state: Array, tol: float) -> tuple[Array, float]:
    heel = _event(lambda t, y: y[2] - 2 * y[0], 1)
    middle, t, _ = _flow(
        _walk, 0.0, state, tol, span=2.5
    )  # the leg passes the other one at mid-stride
    end, t, _ = _flow(_walk, t, middle, tol, heel)
    c = math.cos(2 * end[0])
    return np.array([-end[0], c * end[1], -2 * end[0], c * (1 - c) * end[1]]), t


def _placed(z: Array) -> Array:
    return np.array([z[0], z[1], 2 * z[0], (1 - math.cos(2 * z[0])) * z[1]])


# Forced dry friction with one stick in half a period ----------------------------------------------


def _forced(state: Array, tol: float, f=0.6, w=0.6) -> tuple[Array, float]:
    x, _, t = state
    force = _event(lambda t, y: math.cos(w * t) - y[0] + f)
    stop = _event(lambda t, y: y[1], 1)
    rest, begins, _ = _flow(lambda t, y: [0.0, 0.0], t, [x, 0.0], tol, force, span=4.0)
    slip = lambda t, y: [y[1], math.cos(w * t) - y[0] + f]
    end, ends, _ = _flow(slip, begins, [rest[0], 0.0], tol, stop)
    return np.array([-end[0], -end[1], ends - math.pi / w]), ends - t


# The relay with seven slides in half a period -----------------------------------------------------


def _relay(
    state: Array, tol: float, w=25.0, xi=0.05, sigma=1.0, most=math.inf
) -> tuple[Array, float]:
    a, b, c = 2 * xi * w + 1, 2 * xi * w + w * w, w * w

    def free(t, y):
        return [-a * y[0] + y[1] - 1, -b * y[0] + y[2] + 2 * sigma, -c * y[0] - 1]

    def slide(t, y):
        return [0.0, y[2] + 2 * sigma * y[1], -y[1]]

    land = _event(lambda t, y: y[0], -1)
    exits = [_event(lambda t, y: y[1] - 1, 1), _event(lambda t, y: y[1] + 1, -1)]
    t = 0.0
    for _ in range(40):
        state, t, _ = _flow(free, t, state, tol, land, first_step=1e-3, most=most)
        state[0] = 0.0
        state, t, run = _flow(slide, t, state, tol, exits)
        if run.t_events[1].size:
            return -state, t
        state[1] = 1.0
    raise ArithmeticError("the relay: expected the other side, received none in 40 slides")


SHOOTING = {
    "W1": Shooting("walker", _step, _placed(np.array([0.20, -0.20])), _placed, (0, 1)),
    "D5": Shooting(
        "dry friction",
        _forced,
        np.array([1.44, 0.0, 0.64]),
        lambda z: np.array([z[0], 0.0, z[1]]),
        (0, 2),
    ),
    "R1": Shooting(
        "relay",
        lambda x, tol: _relay(x, tol, most=2e-3),  # longer steps miss the shortest slide
        np.array([0.0, 1.0, 2.57]),
        lambda z: np.array([0.0, 1.0, z[0]]),
        (2,),
    ),
    "R1 unlimited": Shooting(
        "relay, steps without a limit",
        _relay,
        np.array([0.0, 1.0, 2.57]),
        lambda z: np.array([0.0, 1.0, z[0]]),
        (2,),
    ),
}


def solve(case: str, tol: float, whole: bool) -> tuple[Array, float, Array]:
    """Orbit by shooting: state on the section, time of a return, multipliers of the return."""
    shooting = SHOOTING[case]
    place = (lambda z: z) if whole else shooting.place
    chosen = slice(None) if whole else list(shooting.coordinates)
    step, enough = max(math.sqrt(tol), 1e-7), max(100 * tol, 1e-12)

    def returned(z: Array) -> Array:
        return shooting.map(place(z), tol)[0][chosen]

    z = shooting.guess[chosen]
    for _ in range(20):
        here = returned(z)
        columns = [(returned(z + e) - here) / step for e in step * np.eye(z.size)]
        matrix = np.array(columns).T - np.eye(z.size)
        # whole states: the direction of the flow is free, so the shortest step is taken
        change = np.linalg.lstsq(matrix, here - z, rcond=1e-6)[0]
        z = z - change
        if np.abs(change).max() < enough:
            break
    wide = step ** (2 / 3)
    columns = [(returned(z + e) - returned(z - e)) / (2 * wide) for e in wide * np.eye(z.size)]
    state, time = shooting.map(place(z), tol)
    return state, time, np.linalg.eigvals(np.array(columns).T)
