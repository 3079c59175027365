"""What is said of a guess must not contradict it: its system, its forcing, its symmetry."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..flow.fixed import flow_for
from ..model import Array, DefinitionError, FilippovSystem, OptionError, explain
from ..model.variational import plain_field
from .boundary import BoundaryProblem
from .forced import forcing_of
from .legs import Leg

#: Fields that differ by this part after a period have another one.
_OTHER = 1e-6


def require_of(system: FilippovSystem, other: FilippovSystem) -> None:
    """Refuse a guess that is of another system, by what its states and events are.

    Raises
    ------
    DefinitionError
    """
    if other is system or _signature(other) == _signature(system):
        return
    raise DefinitionError(
        explain(
            "guess",
            expected=f"a run or an orbit of {system!r}",
            received=f"one of {other!r}",
            advice="Give a state, or the system that it is of.",
        )
    )


def _signature(system: FilippovSystem) -> tuple[Any, ...]:
    events = (system.surface_count, system.resets, system.impacts, system.time_dependent)
    return (system.state_names, system.parameter_names, *map(str, events))


def require_alone(guess: Any, **given: Any) -> None:
    """Refuse what is said of a state, where the guess is none.

    Raises
    ------
    OptionError
    """
    for name, value in given.items():
        if value is not None:
            raise OptionError(
                explain(
                    name,
                    expected="none, as it belongs to a state as the guess",
                    received=f"{value!r} with a {type(guess).__name__}, which has its own",
                    advice="Leave it out, or give a state.",
                )
            )


def require_same(problem: BoundaryProblem, period: Any, mirror: Array | None, p: Array) -> None:
    """Refuse another period of the forcing, or another symmetry, than an orbit has.

    Raises
    ------
    OptionError
    """
    own, other = problem.forcing, None if period is None else forcing_of(problem.system, period)
    if own is not None and other is not None and abs(other(p)[0] / own(p)[0] - 1.0) > _OTHER:
        raise OptionError(
            explain(
                "period",
                expected=f"that of the orbit that is the guess, {own(p)[0]:.10g}",
                received=f"{other(p)[0]:.10g}",
                advice="Leave it out, or give a run as the guess.",
            )
        )
    half = problem.symmetry
    if mirror is not None and (half is None or np.abs(half - mirror).max() > 0.0):
        had = "has none" if half is None else "has another one"
        raise OptionError(
            explain(
                "symmetry",
                expected="none, or that by which the guess was found",
                received=f"one, and an orbit that {had}",
                advice="Leave it out, or give orbit.trajectory as the guess.",
            )
        )


def require_period(
    system: FilippovSystem,
    legs: Sequence[Leg],
    starts: Array,
    durations: Array,
    span: float,
    p: Array,
) -> None:
    """Refuse a period after which the fields are not what they were.

    A field may jump where a leg begins; so it counts what is within.
    """
    for leg, x, duration in zip(legs, starts, durations, strict=True):
        field = leg.field(system)
        y = flow_for(plain_field(system, leg.mode), field.states_at(x, p), p, 0.5 * float(duration))
        later = y.copy()
        later[system.dimension] += span
        here, there = (field.rate.copied(z, p)[0][:, 0] for z in (y, later))
        miss = float(np.abs(here - there).max())
        if miss > _OTHER * float(np.abs(here).max()):
            raise OptionError(
                explain(
                    "period",
                    expected="a time after which the field is the same again",
                    received=f"{span:.10g}, after which it differs by {miss:.2g} in mode {leg.mode!r} "
                    f"at {y[: system.dimension].tolist()}",
                    advice="Give the period of the forcing, or leave it out.",
                )
            )
