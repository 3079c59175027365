"""The period of the forcing of an orbit: given, or read off the system."""

from __future__ import annotations

import math
from typing import Any

from ...model import Array, FilippovSystem, OptionError, explain
from ...model.derivatives.forcing import Forcing, frequencies


def forcing_of(system: FilippovSystem, period: Any) -> Forcing | None:
    """The period of the forcing as a function of the parameters; None for autonomous systems."""
    if not system.time_dependent:
        return None
    if period is None:
        found = system.cached("frequencies", lambda: frequencies(system))
        if len(found) != 1:
            raise OptionError(
                explain(
                    "period",
                    expected="the period of the forcing, as a number or an expression in parameters",
                    received=f"none, with {len(found)} frequencies {found} in sines and cosines",
                    advice="Give period=2*pi/w.",
                )
            )
        return system.cached("forcing", lambda: Forcing(system, 2.0 * math.pi / found[0], True))
    return Forcing(system, period)


def span_of(forcing: Forcing | None, p: Array) -> float | None:
    """The forcing period at some parameters; None for autonomous systems."""
    if forcing is None:
        return None
    span = forcing(p)[0]
    if not (math.isfinite(span) and span > 0.0):
        raise OptionError(
            explain(
                "period",
                expected="a positive time",
                received=f"{span:.6g}",
                advice="It is the period of the forcing, as a number or an expression in parameters.",
            )
        )
    return span


def about_of(system: FilippovSystem, period: Any, p: Array) -> float | None:
    """About how long an orbit takes, in a system without time; None if that was not said."""
    if period is None or system.time_dependent:
        return None
    span = Forcing(system, period)(p)[0]
    if not (math.isfinite(span) and span > 0.0):
        raise OptionError(
            explain(
                "period",
                expected="a positive time",
                received=f"{span:.6g}",
                advice="In a system without time it says about how long the orbit takes.",
            )
        )
    return span
