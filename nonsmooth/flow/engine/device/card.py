"""The first CUDA device, driven by cuda-core; imported on use only."""

from __future__ import annotations

import ctypes
import importlib
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....model import OptionError
from .machine import DEVICES, Argument, DeviceError, Machine, numbers

_INSTALL = (
    "pip install 'nonsmooth-dynamics[cuda]' on a machine with an NVIDIA card and its driver; without "
    "device= the ensemble runs on this machine's processors."
)

#: Threads of a block, and blocks that a multiprocessor holds at once: 8 warps of 255 registers.
_THREADS, _RESIDENT = 128, 2


class Card:
    """One CUDA device of the module ``cuda.core``; DeviceError without a driver or a device."""

    threads = _THREADS

    # Products and sums are ``fused`` as in the lanes on a processor; unless, the bits are those of C++.
    def __init__(self, core: Any, fused: bool = True):
        self._core, self._fused = core, fused
        try:
            self._device = core.Device()
            self._device.set_current()
            self._stream = self._device.default_stream
            self.blocks = _RESIDENT * int(self._device.properties.multiprocessor_count)
            self.name = str(self._device.name)
        except Exception as error:  # cuda-core has several, and more of the driver
            raise DeviceError(
                f"device: expected an NVIDIA card and its driver for 'cuda', received "
                f"{type(error).__name__}: {error}. {_INSTALL}"
            ) from error
        self._pinned = core.LegacyPinnedMemoryResource()

    def compile(self, source: str) -> Any:
        """Return the kernels of a source, for this card."""
        options = self._core.ProgramOptions(
            arch=f"sm_{self._device.arch}",
            std="c++17",
            device_as_default_execution_space=True,
            disable_warnings=True,
            fma=self._fused,
        )
        self._device.set_current()
        return self._core.Program(source, code_type="c++", options=options).compile("cubin")

    def empty(self, size: int) -> Any:
        """Return memory of so many bytes."""
        self._device.set_current()  # of this thread
        return self._device.allocate(max(size, 1), stream=self._stream)

    def write(self, array: NDArray[Any]) -> Any:
        """Return memory with the numbers of an array."""
        memory, own = self.empty(array.nbytes), np.ascontiguousarray(array)
        if own.nbytes:
            staged = self._pinned.allocate(own.nbytes)
            ctypes.memmove(int(staged.handle), own.ctypes.data, own.nbytes)
            memory.copy_from(staged, stream=self._stream)
            self._stream.sync()
            staged.close()
        return memory

    def read(self, memory: Any, array: NDArray[Any]) -> None:
        """Fill an array from the beginning of memory, after all that was launched."""
        if not array.nbytes:
            return
        own, staged = np.empty_like(array, order="C"), self._pinned.allocate(array.nbytes)
        if array.nbytes < memory.size:
            memory = self._core.Buffer.from_handle(memory.handle, array.nbytes, owner=memory)
        staged.copy_from(memory, stream=self._stream)
        self._stream.sync()
        ctypes.memmove(own.ctypes.data, int(staged.handle), own.nbytes)
        staged.close()
        array[...] = own

    def wait(self) -> None:
        """Return when all that was launched is done."""
        self._stream.sync()

    def launch(self, kernels: Any, name: str, arguments: Sequence[Argument]) -> None:
        """Run one of some kernels on all threads of all blocks."""
        config = self._core.LaunchConfig(grid=self.blocks, block=self.threads)
        self._core.launch(self._stream, config, kernels.get_kernel(name), *numbers(arguments))


@lru_cache(maxsize=2)
def card(fused: bool = True) -> Card:
    """Return the card of this process."""
    try:
        core = importlib.import_module("cuda.core")
    except ImportError as error:
        raise DeviceError(
            f"device: expected the package cuda-core for 'cuda', received {error}. {_INSTALL}"
        ) from error
    return Card(core, fused)


def machine_for(device: str) -> Machine:
    """Return what runs ``device="cuda"``."""
    if device not in DEVICES:
        raise OptionError(f"device: expected None or one of {DEVICES}, received {device!r}.")
    return card()
