"""What a GPU must do: compile, hold arrays, launch. ``card.py`` does it; tests put a processor in its place."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ....model import NonsmoothError

#: What a kernel takes: numbers of 64 bits, memory, or none.
Argument = Any

DEVICES = ("cuda",)


class DeviceError(NonsmoothError, RuntimeError):
    """There is no GPU to run on, what drives it is missing, or it failed; the message says what to do."""


class Machine(Protocol):
    """Where kernels run; ``kept`` is memory that all calls use, one after the other under the ``lock``."""

    lock: threading.RLock
    kept: dict[str, tuple[int, Any]]

    @property
    def name(self) -> str:
        """What runs them, in words."""
        ...

    @property
    def threads(self) -> int:
        """Threads of a block."""
        ...

    @property
    def blocks(self) -> int:
        """Blocks that keep all of it busy."""
        ...

    def compile(self, source: str) -> Any:
        """Return the kernels of a source."""
        ...

    def empty(self, size: int) -> Any:
        """Return memory of so many bytes."""
        ...

    def write(self, array: NDArray[Any]) -> Any:
        """Return memory with the numbers of an array."""
        ...

    def read(self, memory: Any, array: NDArray[Any]) -> None:
        """Fill an array from the beginning of memory, after all that was launched."""
        ...

    def launch(self, kernels: Any, name: str, arguments: Sequence[Argument]) -> None:
        """Run one of some kernels on all threads of all blocks."""
        ...


def numbers(arguments: Sequence[Argument]) -> list[Argument]:
    """Arguments with their widths: integers and floats of 64 bits, 0 for no memory."""
    made: list[Argument] = []
    for a in arguments:
        if a is None:
            made.append(np.int64(0))
        elif isinstance(a, int):
            made.append(np.int64(a))
        else:
            made.append(np.float64(a) if isinstance(a, float) else a)
    return made
