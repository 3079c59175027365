"""The problems as plain formulas for floats, arrays and every peer's symbols."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

Array = NDArray[np.float64]
Codes = NDArray[np.int64]

#: mu, d1, d2, eta, G of both bounces; 1 + 1/inertia of a solid ball.
MU, D1, D2, ETA, G = 0.3, 0.1, 0.1, 0.5, 1e-4
SPIN = 2.5
KAPPA = 1.0 + SPIN

#: Modes of a system with one surface, numbered as in itinerary codes.
PLUS, SLIDING, MINUS = 0, 1, 2
LETTERS = "+s-"

#: Longest time before lift-off.
T_MAX = 100.0


@dataclass(frozen=True)
class Guard:
    """A function that is positive inside a mode; where it falls to zero, ``goes_to`` continues."""

    # ``goes_to`` is a mode, or ``DECIDE`` (cross or slide) or ``STOP``.

    value: Callable[..., Any]
    goes_to: int


DECIDE, STOP = 8, 9


@dataclass(frozen=True)
class Problem:
    """A system with one surface as three smooth modes and their guards."""

    name: str
    dimension: int
    fields: tuple[Callable[..., Sequence[Any]], ...]
    guards: tuple[tuple[Guard, ...], ...]
    slopes: Callable[..., tuple[Any, Any]]
    surface: Callable[..., Any]
    free: int

    def decide(self, x: Sequence[float], before: int) -> int:
        """Mode after reaching the surface from ``before``: sliding where both fields point to it."""
        below_zero, above_zero = self.slopes(*x)
        return SLIDING if below_zero < 0.0 < above_zero else 2 - before

    def first_mode(self, x: Sequence[float]) -> int:
        """Mode of a start that is not on the surface."""
        return PLUS if self.surface(*x) > 0.0 else MINUS


# The bounce --------------------------------------------------------------------------------------


def linear_forces(X: Any, V: Any, Y: Any, W: Any) -> tuple[Any, Any]:
    """Load and tangential force of the linear bounce."""
    return -2 * D2 * W - Y - G, -2 * D1 * ETA * V - ETA**2 * X


def nonlinear_forces(X: Any, V: Any, Y: Any, W: Any) -> tuple[Any, Any]:
    """Load and tangential force of the nonlinear bounce."""
    load = -(2 * D2) * ((1 - Y) * W) - (1 + 2 * (Y * Y)) * Y - G
    along = -(2 * D1 * ETA) * ((1 + V * V) * (1 - Y) * V) - ETA**2 * ((1 - Y) * X)
    return load, along


FORCES = {"linear": linear_forces, "nonlinear": nonlinear_forces}


@lru_cache(maxsize=4)
def bounce(name: str) -> Problem:
    """Return the ``linear`` or ``nonlinear`` bounce: states X, X', Y, Y', Omega."""
    forces = FORCES[name]

    def field(mode: int) -> Callable[..., Sequence[Any]]:
        def slipping(X: Any, V: Any, Y: Any, W: Any, O: Any) -> Sequence[Any]:
            load, along = forces(X, V, Y, W)
            friction = (-MU if mode == PLUS else MU) * load
            return V, along + friction, W, load, SPIN * friction

        def rolling(X: Any, V: Any, Y: Any, W: Any, O: Any) -> Sequence[Any]:
            load, along = forces(X, V, Y, W)
            friction = along * (-1 / KAPPA)
            return V, along + friction, W, load, SPIN * friction

        return rolling if mode == SLIDING else slipping

    def slopes(X: Any, V: Any, Y: Any, W: Any, O: Any = 0.0) -> tuple[Any, Any]:
        load, along = forces(X, V, Y, W)
        return along - KAPPA * MU * load, along + KAPPA * MU * load

    lift_off = Guard(lambda X, V, Y, W, O: forces(X, V, Y, W)[0], STOP)
    return Problem(
        name=name,
        dimension=5,
        fields=(field(PLUS), field(SLIDING), field(MINUS)),
        guards=(
            (Guard(lambda X, V, Y, W, O: V + O, DECIDE), lift_off),
            (
                Guard(lambda *x: -slopes(*x)[0], PLUS),
                Guard(lambda *x: slopes(*x)[1], MINUS),
                lift_off,
            ),
            (Guard(lambda X, V, Y, W, O: -(V + O), DECIDE), lift_off),
        ),
        slopes=slopes,
        surface=lambda X, V, Y, W, O: V + O,
        free=4,
    )


@lru_cache(maxsize=4)
def bounce_system(name: str) -> ns.FilippovSystem:
    """Return the same bounce as a library user writes it, with its five parameters as symbols."""
    X, V, Y, W, O, lam = (ca.SX.sym(s) for s in ("X", "V", "Y", "W", "O", "lam"))
    mu, d1, d2, eta, g = p = [ca.SX.sym(s) for s in ("mu", "d1", "d2", "eta", "G")]
    if name == "linear":
        load = -2 * d2 * W - Y - g
        along = -2 * d1 * eta * V - eta**2 * X
    else:
        load = -(2 * d2 * (1 - Y) * W) - (1 + 2 * Y**2) * Y - g
        along = -(2 * d1 * eta * (1 + V**2) * (1 - Y) * V) - eta**2 * (1 - Y) * X
    friction = -lam * mu * load
    return ns.FilippovSystem(
        [X, V, Y, W, O],
        surface=V + O,
        multipliers=lam,
        field=[V, along + friction, W, load, SPIN * friction],
        parameters=dict(zip(p, (MU, D1, D2, ETA, G), strict=True)),
        stops=[ns.Stop(load, -1, "lift-off")],
    )


def random_starts(count: int, seed: int = 0) -> Array:
    """Landings with X' in [0, 2] and Omega in [-2, 1]; X = Y = 0, Y' = -1."""
    rng = np.random.default_rng(seed)
    return landings(rng.uniform(0.0, 2.0, count), rng.uniform(-2.0, 1.0, count))


def landings(speed: Array, spin: Array) -> Array:
    """States (n, 5) at touch-down."""
    x = np.zeros((len(speed), 5))
    x[:, 1], x[:, 3], x[:, 4] = speed, -1.0, spin
    return x


def code(word: str) -> int:
    """Number of an itinerary: a base-4 digit for each mode."""
    number = 0
    for letter in word.split():
        number = 4 * number + LETTERS.index(letter) + 1
    return number


# Stick-slip --------------------------------------------------------------------------------------

#: x'' = -x - c x' + A cos(omega t) - lambda F, lambda in Sgn(x' - belt).
STICK = {"A": 0.3, "c": 0.05, "omega": 0.7, "F": 0.4}
STICK_START = (0.1, 0.0)
#: Belt speeds: at the first the block never sticks after the transient, at the second it always does.
BELTS = {"few events": 1.0, "many events": 0.2}


@lru_cache(maxsize=4)
def stick_slip_system(belt: float) -> ns.FilippovSystem:
    """Return the forced block on a belt; the forcing is of the explicit time."""
    x, v, t, lam = (ca.SX.sym(s) for s in ("x", "v", "t", "lam"))
    push = STICK["A"] * ca.cos(STICK["omega"] * t)
    return ns.FilippovSystem(
        [x, v],
        surface=v - belt,
        multipliers=lam,
        field=[v, -x - STICK["c"] * v + push - STICK["F"] * lam],
        time=t,
    )


@lru_cache(maxsize=4)
def stick_slip(belt: float, cos: Callable[[Any], Any]) -> Problem:
    """Return the same block for a peer whose cosine is ``cos``; its states are x, v and the time."""
    c, force = STICK["c"], STICK["F"]

    def free(x: Any, v: Any, t: Any, cos: Callable[[Any], Any] = cos) -> Any:
        return -x - c * v + STICK["A"] * cos(STICK["omega"] * t)

    def slopes(x: float, v: float, t: float) -> tuple[float, float]:
        rate = free(x, v, t, math.cos)
        return rate - force, rate + force

    return Problem(
        name="stick-slip",
        dimension=3,
        fields=(
            lambda x, v, t: (v, free(x, v, t) - force, 1.0),
            lambda x, v, t: (v, 0.0 * v, 1.0),
            lambda x, v, t: (v, free(x, v, t) + force, 1.0),
        ),
        guards=(
            (Guard(lambda x, v, t: v - belt, DECIDE),),
            (
                Guard(lambda x, v, t: force - free(x, v, t), PLUS),
                Guard(lambda x, v, t: force + free(x, v, t), MINUS),
            ),
            (Guard(lambda x, v, t: belt - v, DECIDE),),
        ),
        slopes=slopes,
        surface=lambda x, v, t: v - belt,
        free=1,
    )
