"""The kernels' own text on this processor, block by block and thread by thread: to test and to compare with."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..building.build import build
from .machine import Argument, numbers

_STAND = """
extern "C" { extern const char nonsmooth_key[]; }
extern "C" void stand(int block, int thread, int blocks, int threads) {
  blockIdx.x = block; threadIdx.x = thread; gridDim.x = blocks; blockDim.x = threads;
}
"""
_FLAGS = ("-x", "c++", "-std=gnu++17", "-fno-exceptions", "-fno-rtti")


class Shim:
    """A device that is none."""

    name = "this processor, as a GPU"

    def __init__(
        self, fused: bool = True, blocks: int = 2, threads: int = 3, flags: Sequence[str] = ()
    ):
        self.blocks, self.threads = blocks, threads
        self._flags = (*_FLAGS, f"-ffp-contract={'fast' if fused else 'off'}", *flags)

    def compile(self, source: str) -> ctypes.CDLL:
        """Return the kernels of a source."""
        return build(source + _STAND, self._flags)

    def empty(self, size: int) -> NDArray[np.uint8]:
        """Return memory of so many bytes, with anything in it."""
        return np.full(size, 0xA5, np.uint8)

    def write(self, array: NDArray[Any]) -> NDArray[np.uint8]:
        """Return memory with the numbers of an array."""
        return np.ascontiguousarray(array).reshape(-1).view(np.uint8).copy()

    def read(self, memory: NDArray[np.uint8], array: NDArray[Any]) -> None:
        """Fill an array from the beginning of memory."""
        array[...] = memory[: array.nbytes].view(array.dtype).reshape(array.shape)

    def wait(self) -> None:
        """All that was launched is done."""

    def launch(self, kernels: ctypes.CDLL, name: str, arguments: Sequence[Argument]) -> None:
        """Run one of some kernels as each thread of each block in turn."""
        values: list[Any] = []
        for a in numbers(arguments):
            if isinstance(a, np.ndarray):
                values.append(ctypes.c_void_p(a.ctypes.data))
            else:
                kind = ctypes.c_double if isinstance(a, np.float64) else ctypes.c_int64
                values.append(kind(a.item()))
        kernel = getattr(kernels, name)
        for block in range(self.blocks):
            for thread in range(self.threads):
                kernels.stand(block, thread, self.blocks, self.threads)
                kernel(*values)
