"""Flow and derivatives along legs of known durations, by the driver in C."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..model import Array, DegenerateError, FilippovSystem
from ..model.derivatives.variational import ORDER
from .engine.columns import (
    DONE,
    LEAVING,
    NOT_UNIQUE,
    CarriedLegs,
    ColumnsEngine,
    EndOfLeg,
    GivenLegs,
)
from .fixed import MOST_STEPS, TOLERANCE, stuck

#: No times.
NONE = np.zeros(0)


class Precision(NamedTuple):
    """Tolerance of legs, and the condition of derivatives by the start beyond which others begin, or 0."""

    tol: float = TOLERANCE
    ratio: float = 0.0


ROUNDING = Precision()


class Arc(NamedTuple):
    """A leg: its mode, start, duration and end; ``left``: switching functions of the sets on which it begins, and which
    it leaves."""

    mode: str
    start: Array
    duration: float
    ends: EndOfLeg | None = None
    left: tuple[int, ...] = ()


def carry_legs(
    system: FilippovSystem,
    legs: Sequence[Arc],
    p: Array,
    chosen: Sequence[int] = (),
    times: Array = NONE,
    first: Sequence[int] = (),
    back: bool = False,
    precision: Precision = ROUNDING,
) -> CarriedLegs:
    """Integrate states over legs, with derivatives of the ends, and at samples, by the starts and by chosen parameters.

    ``times`` are those of samples since the starts of their legs, which begin at ``first``. With ``back`` steps are
    recorded, along which rows can be pulled back, instead of derivatives. With a ``precision`` that has a ratio
    derivatives are those from the last of ``CarriedLegs.parts`` on.
    """
    engine: ColumnsEngine = system.cached("columns", lambda: ColumnsEngine(system, ORDER))
    words = {mode: list(system.parse_letters(mode)) for mode in {leg.mode for leg in legs}}
    letters = np.array([words[leg.mode] for leg in legs], np.int8).reshape(len(legs), -1)
    for row, leg in zip(letters, legs, strict=True):
        if leg.left:
            row[list(leg.left)] = LEAVING
    given = GivenLegs(
        letters,
        np.array([leg.start for leg in legs], float),
        np.array([leg.duration for leg in legs], float),
        [leg.ends for leg in legs],
        p,
        precision.tol,
        MOST_STEPS,
        times,
        np.array(first if len(first) else [0] * len(legs) + [len(times)]),
        precision.ratio,
    )
    return engine.record(given) if back else engine.carry(given, chosen)


def require_done(system: FilippovSystem, legs: Sequence[Arc], found: CarriedLegs) -> None:
    """Raise for a leg that does not reach its end."""
    if found.status == DONE:
        return
    leg = legs[found.failed]
    if found.status == NOT_UNIQUE:
        raise DegenerateError(
            f"mode {system.spelled(leg.mode)!r} at {leg.start.tolist()}: expected one set of multipliers that "
            "keeps the sliding, received none or several. Start elsewhere."
        )
    raise stuck(leg.duration, float(found.left[found.failed]), leg.start)
