"""The kernels' text as C++ on this processor, block by block and thread by thread, in the place of a card."""

import ctypes
import threading

import numpy as np

from nonsmooth.flow.engine import lanes as engine
from nonsmooth.flow.engine.building.build import build
from nonsmooth.flow.engine.device.card import numbers

STAND = """
extern "C" { extern const char nonsmooth_key[]; }
extern "C" void stand(int block, int thread, int blocks, int threads) {
  blockIdx.x = block; threadIdx.x = thread; gridDim.x = blocks; blockDim.x = threads;
}
"""
FLAGS = ("-march=native", "-x", "c++", "-std=gnu++17", "-fno-exceptions", "-fno-rtti")


class Shim:
    """A device whose threads run one after the other, each what would be its share.

    ``fused``: whether the compiler may fuse products and sums; ``flags``: more for the compiler; ``random``: a number
    for which every other step, at random, is the driver's.
    """

    name = "this processor, as a GPU"

    def __init__(self, fused=True, blocks=2, threads=3, flags=(), random=0):
        self.random, self.lock, self.kept = random, threading.RLock(), {}
        self.blocks, self.threads = blocks, threads
        self.flags = (*FLAGS, f"-ffp-contract={'fast' if fused else 'off'}", *flags)

    def compile(self, source):
        fast_tests = ("-O0",) if "-O0" in engine.FLAGS else ()
        source = source.replace("#define RANDOM 0\n", f"#define RANDOM {self.random}\n")
        return build(source + STAND, (*self.flags, *fast_tests))

    def empty(self, size):
        return np.full(size, 0xA5, np.uint8)

    def write(self, array):
        return np.ascontiguousarray(array).reshape(-1).view(np.uint8).copy()

    def read(self, memory, array):
        array[...] = memory[: array.nbytes].view(array.dtype).reshape(array.shape)

    def launch(self, kernels, name, arguments):
        values = []
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
