"""The kernels' text reads and writes where it may, and does nothing that C++ leaves undefined."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from nonsmooth.flow.engine import find_compiler

ROOT = Path(__file__).parents[4]

#: Bounces of starts of all sources, with shared and with own parameters; an event is kept.
PROGRAM = """
import numpy as np
from nonsmooth.flow.engine.device.kernel import Bins, Given, Kernel, Reduction, Source
from tests.flow.engine.device.shim import Shim
from nonsmooth.flow.options import Options
from nonsmooth.flow.results import Chunk
from benchmarks.problems import bounce_system, random_starts

checks = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all", "-O1")
options, wide = Options(t_end=100.0), Options(t_end=100.0, max_events=2, max_steps=9)
axes = [np.array(0.0), np.linspace(0, 2, 20), np.array(0.0), np.array(-1.0), np.linspace(-2, 1, 20)]
bins = Bins(7, np.full(6, -1.0), np.full(6, 1.0))
for name in ("linear", "nonlinear"):
    system, x = bounce_system(name), random_starts(400, seed=2)
    x[3], x[5] = np.nan, 0.0
    kernel, p = Kernel(system, options.order, Shim(flags=checks)), system.parameter_vector()
    sources = [Source.rows(x), Source.grid(axes), Source.box(-np.ones(5), np.ones(5), 2**64 - 1)]
    for source in sources:
        for own in (p, p * np.linspace(0, 2, 400)[:, None]):
            for limits in (options, wide):
                chunk = Chunk.empty(400, system, True)
                kernel.steps = 5
                left = kernel.run(Given(source, 0, 400, own, limits), (1, 1), chunk)
                assert chunk.totals[0] + left["steps"].sum() > 400
            reduction = Reduction(kernel, bins)
            left, rest = reduction.add(Given(source, 0, 400, own, options))
            assert rest is None
            assert sum(reduction.read().status.values()) + len(left) == 400
            back = left[left["begun"] != 0]
            kernel.run(Given(Source.records(back), 0, len(back), p, options), (1, 1), Chunk.empty(len(back), system, True))
print("done")
"""


def runtime():
    """The sanitizers' library, or None."""
    command = find_compiler()
    if command is None or len(command) > 1:
        return None
    said = subprocess.run([*command, "-print-file-name=libasan.so"], capture_output=True, text=True)
    path = Path(said.stdout.strip())
    return path if said.returncode == 0 and path.is_absolute() and path.exists() else None


@pytest.mark.slow
@pytest.mark.skipif(runtime() is None, reason="no library of the address sanitizer")
def test_under_sanitizers(tmp_path):
    environment = {
        **os.environ,
        "LD_PRELOAD": str(runtime()),
        "ASAN_OPTIONS": "detect_leaks=0:alloc_dealloc_mismatch=0",
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "NONSMOOTH_CACHE": str(tmp_path),
        "PYTHONPATH": str(ROOT),
    }
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stdout.startswith("done")
