"""Options of a run, checked once."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..model import OptionError, explain


@dataclass(frozen=True)
class Options:
    """Tolerances and limits of a run.

    Parameters
    ----------
    t_end : float
        Final time, after ``t_start``.
    t_start : float
    rtol, atol : float
        Local error of state i is kept below ``atol + rtol*abs(x_i)``.
    max_step : float
    max_steps, max_events : int
    start_mode : str or None
        Continue in this mode from a start where more than one is possible.

    Raises
    ------
    OptionError
        A value out of range.
    """

    t_end: float
    t_start: float = 0.0
    rtol: float = 1e-10
    atol: float = 1e-10
    max_step: float = math.inf
    max_steps: int = 1_000_000
    max_events: int = 100_000
    start_mode: str | None = None

    def __post_init__(self) -> None:
        for name in ("t_end", "t_start"):
            _number(name, getattr(self, name))
        for name in ("rtol", "atol"):
            value = getattr(self, name)
            if not (isinstance(value, (int, float)) and 1e-16 <= value < 1.0):
                raise OptionError(
                    explain(
                        "tol" if name == "rtol" else name,
                        expected="a number from 1e-16 to below 1",
                        received=repr(value),
                        advice="1e-10 is a good start; below 1e-14 rounding dominates.",
                    )
                )
        if not self.t_end >= self.t_start:
            raise OptionError(
                explain(
                    "t_end",
                    expected=f"a time not before t_start = {self.t_start}",
                    received=repr(self.t_end),
                    advice="Backward motion is not unique in Filippov systems; "
                    "nonsmooth.follow runs one smooth mode backward.",
                )
            )
        for name in ("max_step", "max_steps", "max_events"):
            value = getattr(self, name)
            if not (isinstance(value, (int, float)) and value > 0):
                raise OptionError(f"{name}: expected a positive number, received {value!r}.")


def _number(name: str, value: object) -> None:
    if not isinstance(value, (int, float)) or not math.isfinite(value):
        raise OptionError(f"{name}: expected a finite number, received {value!r}.")
