"""Tolerances and limits of a run."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

from ..model import OptionError, real, whole
from .constants import EPSILON, METHODS, SAFETY
from .section import Hits


class Tolerances(NamedTuple):
    """Relative and absolute tolerance of a run."""

    rtol: float
    atol: float


def tolerances(tol: float, rtol: float | None = None, atol: float | None = None) -> Tolerances:
    """Relative and absolute tolerance, ``tol`` unless given separately."""
    return Tolerances(tol if rtol is None else rtol, tol if atol is None else atol)


@dataclass(frozen=True)
class Options:
    """Tolerances and limits of a run, checked."""

    t_end: float
    t_start: float = 0.0
    rtol: float = 1e-10
    atol: float = 1e-10
    max_step: float = math.inf
    max_steps: int = 1_000_000
    max_events: int = 100_000
    max_jumps: int = 1_000
    start_mode: str | None = None
    hits: Hits | None = None
    rest_below: float | None = None
    method: str = "auto"
    passed: tuple[bool, ...] = ()  # stops that do not end the run, which has no section

    def __post_init__(self) -> None:
        for name in ("t_end", "t_start"):
            self._set(name, real(getattr(self, name), name))
        rtol = real(
            self.rtol,
            "tol",
            expected="a number from 1e-16 to below 1",
            advice="1e-10 is a good start; below 1e-14 rounding dominates.",
            low=1e-16,
            high=math.nextafter(1.0, 0.0),
        )
        self._set("rtol", rtol)
        atol = real(
            self.atol,
            "atol",
            expected="a positive number",
            advice="It is in the unit of the states: 1e-10 of their size is a good start.",
            low=sys.float_info.min,
        )
        self._set("atol", atol)
        if not self.t_end >= self.t_start:
            raise OptionError(
                f"t_end = {self.t_end} is before t_start = {self.t_start}. Give a later time: backward "
                "motion is not unique in Filippov systems; nonsmooth.flow.follow runs one mode backward."
            )
        if self.max_step != math.inf:
            low = math.nextafter(0.0, 1.0)
            step = real(self.max_step, "max_step", expected="a positive number", low=low)
            self._set("max_step", step)
        if self.rest_below is not None:
            speed = real(
                self.rest_below,
                "rest_below",
                expected="a positive number",
                advice="It is a speed, in the unit of a switching function per time.",
                low=math.nextafter(0.0, 1.0),
            )
            self._set("rest_below", speed)
        if self.method not in METHODS:
            raise OptionError(
                f"method is {self.method!r}. Give 'auto' (implicit steps where they cost less), 'taylor' or 'stiff'."
            )
        for name in ("max_steps", "max_events", "max_jumps"):
            self._set(name, whole(getattr(self, name), name))

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> Options:
        """Return the options among the arguments of a function, by name."""
        own = {name: given[name] for name in _NAMES if name in given}
        own["rtol"], own["atol"] = tolerances(given["tol"], given["rtol"], given["atol"])
        return cls(**own)

    @property
    def begins_late(self) -> bool:
        """Whether one number rounds times after the start by more than the tolerance."""
        return EPSILON * abs(self.t_start) > SAFETY * (self.rtol + self.atol)

    @property
    def order(self) -> int:
        """Order of the Taylor method for the relative tolerance."""
        # A fifth above the optimum of Jorba & Zou (2005, eq. 3-7; 0.5 there), which counts the work of
        # the series only: the guards, roots and step size of each step cost as much.
        return max(6, math.ceil(-0.6 * math.log(SAFETY * self.rtol)) + 1)

    @property
    def size(self) -> float:
        """Size of states at which the absolute tolerance is as large as the relative one."""
        return self.atol / self.rtol

    def _set(self, name: str, value: float) -> None:
        """Replace an option by its checked value."""
        if value is not getattr(self, name):
            object.__setattr__(self, name, value)


_NAMES = tuple(f.name for f in fields(Options))
