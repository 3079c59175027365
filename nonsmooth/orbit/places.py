"""Where the parts of the equations of an orbit are in their Jacobian."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Places(NamedTuple):
    """Where entries of the Jacobian are in it, row after row: states by starts (own and following),
    states by durations, events by starts and by durations; and the number of the next leg."""

    blocks: NDArray[Any]
    following: NDArray[Any]
    by_duration: NDArray[Any]
    event_rows: NDArray[Any]
    event_durations: NDArray[Any]
    next_leg: NDArray[Any]


@lru_cache(maxsize=256)
def places_of(count: int, n: int) -> Places:
    """The places for so many legs of n states.

    Parameters
    ----------
    count, n : int
    """
    size = count * (n + 1)
    places = np.arange(size * size).reshape(size, size)
    rows = np.arange(count * n).reshape(count, n)
    times = np.arange(count * n, size)
    return Places(
        places[rows[:, :, None], rows[:, None, :]].ravel(),
        places[rows, np.roll(rows, -1, axis=0)].ravel(),
        places[rows, times[:, None]].ravel(),
        places[times[:, None], rows].ravel(),
        places[times, times].ravel(),
        np.roll(np.arange(count), -1),
    )
