"""Events that accumulate in finite time, recognised by their geometric intervals."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from ..facts import AT_ONCE, BLOCKS, LAGS, REMAINING, SHRINKS, SPREAD


def remaining_time(
    intervals: Sequence[float], patterns: Sequence[str], elapsed: float
) -> float | None:
    """Estimate the time left until events accumulate, or None if they do not (yet).

    Blocks of events with a repeating pattern shrink by a steady ratio r < 1 before a Zeno point,
    so the time left is (last block) r/(1 - r). The estimate is given once it is below 1e-6 of the
    time that the run has taken, so that the unit of time does not matter.

    Parameters
    ----------
    intervals : sequence of float
        Times between successive events.
    patterns : sequence of str
        What each event was; same length.
    elapsed : float
        Time since the start of the run, the scale of "small".

    Examples
    --------
    >>> remaining_time([2.0**-k for k in range(40)], ["impact"] * 40, 2.0) < 1e-11
    True
    """
    if len(intervals) > AT_ONCE and not any(intervals[-AT_ONCE:]):
        return 0.0
    for lag in LAGS:
        need = lag * BLOCKS
        if len(intervals) < need + lag:
            return None
        recent = list(patterns[-need:])
        if recent != list(patterns[-need - lag : -lag]):
            continue
        tail = list(intervals[-need:])
        blocks = [sum(tail[k : k + lag]) for k in range(0, need, lag)]
        if min(blocks) <= 0.0:
            continue
        ratios = [b / a for a, b in pairwise(blocks)]
        r = ratios[-1]
        if max(ratios) < SHRINKS and max(ratios) - min(ratios) <= SPREAD * (1.0 - r):
            left = blocks[-1] * r / (1.0 - r)
            if left < REMAINING * elapsed:
                return left
    return None
