"""Sets of codimension two and more in a run: reached, passed, rolled on, left.

Off the set the multiplier is h/|h|. A step ends where |h| has fallen tenfold, and there it is asked
whether the set must be reached, |M^-1 a| < 1 with h' = a - M lambda; if so, and what is left is below the
tolerance, the rest is taken in one step with a and M frozen. Else the motion goes on, and passes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...model import Array, FilippovSystem, Guard, multiplier_enters
from ...model.laws.frozen import field_at, frozen
from ...model.laws.multiplier_series import unit
from ..constants import EPSILON, LEFT, OVERFLOW, REACHED, SHORTEST, TENFOLD, VANISHES
from .modes import rounding_scale, tolerances

if TYPE_CHECKING:
    from .driver import Driver

#: Only where |h| is this much of its terms its time to zero is asked for.
CLOSE = 1e-8


# reaching ------------------------------------------------------------------------------------------


def near(driver: Driver, guard: Guard, fell: bool = True) -> None:
    """|h| has fallen tenfold, or is small."""
    # What has fallen to rounding is zero, whatever its direction says.
    own = list(driver.system.set_of[guard.index])
    if driver.mode[own[0]] == "s":
        return  # friction's limit has fallen: the next step sees its digits
    coupled, mode, x, p = driver.coupled, driver.mode, driver.x, driver.p
    h = slip_of(driver, own)
    scale = scale_of(driver, own)
    law = frozen(coupled, mode, x, driver.unknowns, p, own)
    r = math.hypot(*h)
    at_floor = r <= VANISHES * scale
    hits = law.attracts
    dt = law.time_left(h) if hits else law.straight(h)
    at_floor = at_floor or dt < max(shortest(driver), swallowed(driver))
    if not hits and not at_floor:
        return
    if not (0.0 < dt < np.inf):
        if not (at_floor and (hits or fell)):
            return
        dt = 0.0
    if dt > 0.0:
        u = unit(h)
        mean = law.mean(h, dt) if hits else u
        rate = field_at(coupled, mode, x, driver.unknowns, p, own, mean)
        end = x + dt * rate
        later = frozen(coupled, mode, end, driver.unknowns, p, own)
        bend = float(np.abs(later.a - law.a).sum() + np.abs(later.m - law.m).sum()) * dt
        if not at_floor:
            turn = np.abs(rate - field_at(coupled, mode, x, driver.unknowns, p, own, u))
            turn += np.abs(rate - field_at(coupled, mode, end, driver.unknowns, p, own, mean))
            allowed = REACHED * tolerances(driver.system, x, driver.options)
            allowed += EPSILON * (driver.options.size + np.abs(x))
            if np.any(turn * dt > allowed) or bend > REACHED * r:
                return
        if bend <= r:  # else it is reached to rounding, and slowly
            driver.jump(rate, min(dt, driver.options.t_end - driver.t))
    before = mode
    active = driver.active({*own}, mode)
    driver.x = driver.surfaces.project(driver.x, p, active)
    driver.record.correct(driver.x)
    driver.go_on(active, {}, before, guard)


def look(driver: Driver) -> None:
    """After a step that ended with no guard: sets that are close may be reached to rounding."""
    if not driver.system.sets:
        return None
    for row, guard in enumerate(driver.stepper.guards(driver.mode)):
        members = driver.system.set_of.get(guard.index, ())
        if guard.kind != "near" or driver.mode[guard.index] == "s" or driver.drops.get(row, 0):
            continue
        if math.hypot(*slip_of(driver, list(members))) <= CLOSE * scale_of(driver, list(members)):
            return near(driver, guard, fell=False)
    return None


def shortest(driver: Driver) -> float:
    """Time to a set below which coefficients of series are too large for numbers."""
    return float(OVERFLOW ** (-1.0 / driver.options.order))


def swallowed(driver: Driver) -> float:
    """Time to a set below which rounding of the time leaves no room for a step of a tenfold fall."""
    return TENFOLD * SHORTEST * max(abs(driver.t), abs(driver.t - driver.options.t_start))


def met(driver: Driver, mode: str, members: tuple[int, ...], h: Array) -> bool:
    """Whether a state is on a set, or as close as no series can begin."""
    own = list(members)
    r, scale = math.hypot(*h[own]), scale_of(driver, own)
    if r <= VANISHES * scale or r > CLOSE * scale:
        return r <= VANISHES * scale
    law = frozen(driver.coupled, mode, driver.x, driver.unknowns, driver.p, own)
    speed = float(np.linalg.norm(law.a) + np.linalg.norm(law.m))
    return r < shortest(driver) * speed


def idle(system: FilippovSystem, p: Array) -> set[tuple[int, ...]]:
    """Sets whose multiplier does not enter the field with these parameters: no friction, mu = 0."""
    return {s for s in system.sets if not multiplier_enters(system, s, p)}


def asked(mode: str, actual: str, active: Sequence[int]) -> str:
    """Letters of a run that starts in a mode asked for."""
    kinds = {"*": "l"}
    return "".join(
        kinds.get(letter, letter)
        if i in active
        else ("i" if letter == "*" and actual[i] == "i" else letter)
        for i, letter in enumerate(mode)
    )


def decides(guard: Guard, mode: str) -> bool:
    """Whether a mode can continue only where a guard is positive; others only end steps."""
    on_set = guard.kind == "near" and mode[guard.index] == "s"
    return guard.kind in ("surface", "exit", "slip", "near") and not on_set


def slip_of(driver: Driver, own: Sequence[int]) -> Array:
    """h of a set, with all the digits that are known."""
    if driver.mode[own[0]] == "b":
        return driver.unknowns[list(own)]
    return driver.coupled.heights_at(driver.x, driver.p)[list(own)]


def scale_of(driver: Driver, own: Sequence[int]) -> float:
    """Rounding scale of |h| of a set: |dh/dx| (size + |x|)."""
    gradient = np.abs(driver.surfaces.values(driver.x, driver.p)[1])
    return float(rounding_scale(gradient, driver.x, driver.options.size)[list(own)].max())


# leaving -------------------------------------------------------------------------------------------


def after_step(driver: Driver) -> None:
    """Sets that were left a step ago: h is carried along until it is far above rounding."""
    letters = list(driver.mode)
    for members in driver.system.sets:
        own = list(members)
        if letters[own[0]] == "l":
            for i in own:
                letters[i] = "b"
        elif letters[own[0]] == "b":
            if math.hypot(*driver.unknowns[own]) > LEFT * scale_of(driver, own):
                for i in own:
                    letters[i] = "*"
                driver.unknowns[own] = 0.0
    driver.mode = "".join(letters)
    carried = [i for i, letter in enumerate(driver.mode) if letter == "b"]
    if carried:
        level = driver.unknowns[carried]
        driver.x = driver.surfaces.project(driver.x, driver.p, carried, level)
