"""The threads of a warp do most of their instructions together, and a bounce needs no more arithmetic than is known.

What NVRTC makes of the kernel is counted thread by thread on this processor, step by step. In each step a warp issues
what any of its 32 threads needs, once: the order is the best that a card could find.
"""

import ctypes
import re

import numpy as np
import pytest

from benchmarks.problems import bounce_system, random_starts
from nonsmooth.flow.compiled import find_compiler
from nonsmooth.flow.compiled.device.kernel import Kernel, Source
from nonsmooth.flow.options import Options
from nonsmooth.flow.results import Chunk
from tests.flow.compiled.device import nvrtc, ptx

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(nvrtc.library() is None, reason="no NVRTC: pip install nvidia-cuda-nvrtc"),
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler"),
]

WARP = 32
PREFACE = """
extern "C" {{ unsigned done[{size}], *kept; long steps; int head; }}
static inline void at_head(unsigned thread) {{
  if (!kept) return;
  unsigned *row = kept + {size} * steps++;
  for (int k = 0; k < {size}; k++) row[k] = done[k];
  row[head] = thread;
}}
#define AT(number, word) done[number]++;
#define LABEL(number) done[number]++; if (number == head) at_head(threadIdx.x);
"""

#: Instructions of the units for numbers of 64 bits.
DOUBLE = re.compile(r"(add|sub|mul|fma|setp|min|max)\..*f64")


class Counting(ptx.Interpreted):
    """One warp, of which each thread's instructions are counted."""

    def __init__(self):
        super().__init__(blocks=1, threads=WARP)

    def translate(self, source):
        text = super().translate(source)
        self.words = dict(re.findall(r'AT\((\d+), "([\w.:]+)"\)', text))
        self.labels = [int(k) for k in re.findall(r"LABEL\((\d+)\)", text)]
        self.size = 1 + max([*map(int, self.words), *self.labels])
        return PREFACE.format(size=self.size) + text

    def compile(self, source):
        self.library = super().compile(source)
        return self.library

    def variable(self, name, kind):
        return kind.in_dll(self.library, name)

    def done(self):
        return np.ctypeslib.as_array(self.variable("done", ctypes.c_uint32 * self.size))


def run(machine, kernel, count):
    x, options = random_starts(count, seed=5), Options(t_end=100.0)
    chunk = Chunk.empty(count, kernel.system, False)
    p = kernel.system.parameter_vector()
    kernel.run(Source.rows(x), 0, count, p, options, None, chunk)
    return int(chunk.totals[0])


def counted(name, each=12):
    """What each thread does between two visits to the head of its loop: a step, and what loads its next start.

    Returns the words of the instructions, for each thread an array (steps, instructions), and the number of bounces.
    """
    machine, system, count = Counting(), bounce_system(name), WARP * each
    kernel = Kernel(system, Options(t_end=100.0).order, machine)
    steps = run(machine, kernel, count)
    # The head is passed once for each step, and by each thread once more at its end.
    passed = machine.done()[machine.labels].tolist()
    head = machine.labels[passed.index(steps + WARP)]
    kept = np.zeros((steps + WARP, machine.size), np.uint32)
    machine.variable("head", ctypes.c_int).value = head
    machine.variable("kept", ctypes.c_void_p).value = kept.ctypes.data
    run(machine, kernel, count)
    numbers = [int(k) for k, word in machine.words.items() if not word.startswith("mov")]
    rows = [kept[kept[:, head] == thread][:, numbers] for thread in range(WARP)]
    words = [machine.words[str(k)] for k in numbers]
    return words, [np.diff(r.astype(np.int64), axis=0) for r in rows], count


@pytest.mark.parametrize(
    ("name", "together", "most"), [("linear", 0.71, 4500), ("nonlinear", 0.79, 25500)]
)
def test_warps(name, together, most):
    words, threads, count = counted(name)
    double = np.array([DOUBLE.match(word) is not None for word in words])
    assert sum(t[:, double].sum() for t in threads) / count < most
    busy = min(map(len, threads))  # as long as all threads have starts
    own = sum(t[:busy].sum() for t in threads)
    issued = np.max([t[:busy] for t in threads], axis=0).sum()
    assert own / (WARP * issued) > together
