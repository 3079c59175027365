"""The first CUDA device, driven by cuda-core; imported on use only."""

from __future__ import annotations

import ctypes
import importlib
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....model import NonsmoothError, OptionError

_INSTALL = (
    "pip install 'nonsmooth-dynamics[cuda]' on a machine with an NVIDIA card and its driver; without "
    "device= the ensemble runs on this machine's processors."
)

#: Threads of a block, and blocks that a multiprocessor holds at once: 8 warps of 255 registers. Measured: 168 or 128
#: registers spill too much, and two blocks of 128 threads read the long text of a nonlinear step at different points.
_THREADS, _RESIDENT = 256, 1

#: Bytes of each of the two buffers for copies of arrays.
_STAGED = 1 << 24

#: PTX for this architecture is compiled by every driver, for every card.
COMMON = "80"


class DeviceError(NonsmoothError, RuntimeError):
    """No GPU or driver was found, or the GPU failed; the message says what to do."""


class Card:
    """One CUDA device of the module ``cuda.core``; DeviceError without a driver or a device. ``kept`` is memory that all
    calls use, one after the other under the ``lock``. Tests put a processor in its place."""

    threads = _THREADS

    # Products and sums are ``fused`` as in the lanes on a processor; unless, the bits are those of C++.
    def __init__(self, core: Any, fused: bool = True):
        self._core, self._fused, self.lock = core, fused, threading.RLock()
        self.kept: dict[str, tuple[int, Any]] = {}
        self.name = "the first CUDA device"
        with self._driven("start", _INSTALL):
            self._device = core.Device()
            self._device.set_current()
            self._stream = self._device.default_stream
            self.blocks = _RESIDENT * int(self._device.properties.multiprocessor_count)
            self.name = str(self._device.name)
            self._pinned = core.LegacyPinnedMemoryResource()
        self._staging: list[tuple[Any, Any]] = []  # buffers, and what marks the end of their copies

    @contextmanager
    def _driven(self, verb: str, advice: str = "Run without device=.") -> Iterator[None]:
        """Errors of cuda-core and of the driver, of which there are several kinds, as DeviceError."""
        with self.lock:
            try:
                if verb != "start":
                    self._device.set_current()  # of this thread
                yield
            except DeviceError:
                raise
            except Exception as error:
                raise DeviceError(
                    f"device='cuda': cannot {verb} on {self.name}: {type(error).__name__}: {error}. "
                    f"{advice}"
                ) from error

    def compile(self, source: str) -> Any:
        """Return the kernels of a source, for this card."""
        own, said = str(self._device.arch), []
        # An NVRTC that is older than the card, or newer than the driver, may still write PTX for the driver's compiler.
        for target, arch in (("cubin", own), ("ptx", own), ("ptx", COMMON)):
            try:
                with self._driven("compile"):
                    kernels = self.program(source, arch).compile(target)
                    kernels.get_kernel("trajectories")  # loads it
                    return kernels
            except DeviceError as error:
                said.append(f"as {target} of sm_{arch}: {error.__cause__}")
        tried = "; ".join(said)
        raise DeviceError(
            f"device='cuda': no way to compile kernels for {self.name} ({tried}). {_INSTALL}"
        )

    def program(self, source: str, arch: str) -> Any:
        """Return a source for an architecture, to be compiled."""
        options = self._core.ProgramOptions(
            arch=f"sm_{arch}",
            std="c++17",
            device_as_default_execution_space=True,
            disable_warnings=True,
            fma=self._fused,
        )
        return self._core.Program(source, code_type="c++", options=options)

    def empty(self, size: int) -> Any:
        """Return memory of so many bytes."""
        with self._driven("allocate memory", "Give work=nonsmooth.Work(chunk=...), a smaller one."):
            return self._device.allocate(max(size, 1), stream=self._stream)

    def write(self, array: NDArray[Any]) -> Any:
        """Return memory with the numbers of an array."""
        own = np.ascontiguousarray(array)
        memory = self.empty(own.nbytes)
        with self._driven("write"):
            for turn, first in enumerate(range(0, own.nbytes, _STAGED)):
                size = min(_STAGED, own.nbytes - first)
                staged, mark = self._stage(turn)
                mark.sync()
                ctypes.memmove(int(staged.handle), own.ctypes.data + first, size)
                self._part(memory, first, size).copy_from(
                    self._part(staged, 0, size), stream=self._stream
                )
                self._stream.record(mark)
        return memory

    def read(self, memory: Any, array: NDArray[Any]) -> None:
        """Fill an array from the beginning of memory, after all that was launched."""
        own = array if array.flags.c_contiguous else np.empty_like(array, order="C")
        firsts = range(0, own.nbytes, _STAGED)
        with self._driven("run"):
            # The next part is copied while this one is moved to its place.
            for turn in range(len(firsts) + 1):
                if turn < len(firsts):
                    size = min(_STAGED, own.nbytes - firsts[turn])
                    staged, mark = self._stage(turn)
                    mark.sync()
                    self._part(staged, 0, size).copy_from(
                        self._part(memory, firsts[turn], size), stream=self._stream
                    )
                    self._stream.record(mark)
                if turn:
                    size = min(_STAGED, own.nbytes - firsts[turn - 1])
                    staged, mark = self._stage(turn - 1)
                    mark.sync()
                    ctypes.memmove(own.ctypes.data + firsts[turn - 1], int(staged.handle), size)
        if own is not array:
            array[...] = own

    def _stage(self, turn: int) -> tuple[Any, Any]:
        """One of the two buffers, and what marks the end of its last copy."""
        while len(self._staging) < 2:
            mark = self._stream.record()
            self._staging.append((self._pinned.allocate(_STAGED), mark))
        return self._staging[turn % 2]

    def _part(self, memory: Any, first: int, size: int) -> Any:
        if first == 0 and size == memory.size:
            return memory
        return self._core.Buffer.from_handle(int(memory.handle) + first, size, owner=memory)

    def launch(self, kernels: Any, name: str, arguments: Sequence[Any]) -> None:
        """Run one of some kernels on all threads of all blocks."""
        with self._driven("run"):
            config = self._core.LaunchConfig(grid=self.blocks, block=self.threads)
            self._core.launch(self._stream, config, kernels.get_kernel(name), *numbers(arguments))


@lru_cache(maxsize=2)
def card(fused: bool = True) -> Card:
    """Return the card of this process."""
    try:
        core = importlib.import_module("cuda.core")
    except ImportError as error:
        raise DeviceError(
            f"device='cuda': the package cuda-core is missing ({error}). {_INSTALL}"
        ) from error
    return Card(core, fused)


def machine_for(device: str) -> Card:
    """Return the machine that runs ``device="cuda"``."""
    if device != "cuda":
        raise OptionError(f"device: expected None or 'cuda', received {device!r}.")
    return card()


def numbers(arguments: Sequence[Any]) -> list[Any]:
    """Arguments of fixed width: integers and floats of 64 bits, 0 for no memory."""
    made: list[Any] = []
    for a in arguments:
        if a is None:
            made.append(np.int64(0))
        elif isinstance(a, int):
            made.append(np.int64(a))
        else:
            made.append(np.float64(a) if isinstance(a, float) else a)
    return made
