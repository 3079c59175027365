"""Timing of pieces of work in turns, and of scripts in fresh processes with their peak memory.

On a shared machine times are noisy. Solvers therefore take turns (A B C A B C ...), each timed by the
processor time of this process; results are the median and the spread.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parent.parent

#: One thread for the linear algebra of peers, as more do not pay for small systems.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
Clock = Callable[[], float]


@dataclass(frozen=True)
class Timing:
    """Seconds of one piece of work: median, smallest and largest turn."""

    median: float
    low: float
    high: float
    turns: int

    def rate(self, count: int) -> float:
        """Pieces per second at the median."""
        return count / self.median

    @property
    def spread(self) -> float:
        """(largest - smallest) / median."""
        return (self.high - self.low) / self.median

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**asdict(self), "spread": self.spread}


def alternate(
    work: Mapping[str, Callable[[], Any]], turns: int, clock: Clock = time.process_time
) -> dict[str, Timing]:
    """Time pieces of work in turns; each runs once beforehand, unmeasured."""
    for run in work.values():
        run()
    seconds: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(turns):
        for name, run in work.items():
            begin = clock()
            run()
            seconds[name].append(clock() - begin)
    return {name: _timing(s) for name, s in seconds.items()}


def _timing(seconds: list[float]) -> Timing:
    return Timing(float(np.median(seconds)), min(seconds), max(seconds), len(seconds))


#: Runs a script and prints its seconds, its processor time (children included) and peak memory.
_WRAPPER = """
import time; _begin = time.perf_counter(); _cpu = time.process_time()
{script}
_inside = time.perf_counter() - _begin
import json, resource, os
_children = resource.getrusage(resource.RUSAGE_CHILDREN)
_peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
if os.path.exists("/proc/self/status"):  # the figure above begins with that of the parent process
    with open("/proc/self/status") as _file:
        _peak = [int(l.split()[1]) / 1024 for l in _file if l.startswith("VmHWM")][0]
print("\\n" + json.dumps(dict(
    inside=_inside,
    cpu=time.process_time() - _cpu + _children.ru_utime + _children.ru_stime,
    peak_mib=_peak,
    note=globals().get("note"))))
"""


def fresh(script: str, environment: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Run a script in a fresh interpreter."""
    begin = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", _WRAPPER.format(script=script)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, **(environment or {})},
    )
    seconds = time.perf_counter() - begin
    if done.returncode:
        raise RuntimeError(f"a fresh process failed:\n{script}\n{done.stderr[-2000:]}")
    result: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return {**result, "process": seconds}


def run_peer(python: str, script: str, problem: dict[str, Any]) -> dict[str, Any]:
    """Result of a script of ``peers`` in an interpreter of its own, which reads a problem as JSON."""
    done = subprocess.run(
        [python, str(Path(__file__).with_name("peers") / f"{script}.py")],
        input=json.dumps(problem),
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | ONE_THREAD,
    )
    if done.returncode:
        return {"missing": f"failed: {done.stderr.strip()[-200:]}", "rows": []}
    found: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return found


def machine() -> dict[str, Any]:
    """Processor, load and versions, without names of hosts or folders."""
    import platform

    cpu = platform.processor() or platform.machine()
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                cpu = line.split(":")[1].strip()
                break
    except OSError:
        pass
    version = subprocess.run(["cc", "--version"], capture_output=True, text=True, check=False)
    return {
        "cpu": cpu,
        "processors": os.cpu_count(),
        "load at the start": round(os.getloadavg()[0], 2),
        "python": platform.python_version(),
        "compiler": version.stdout.splitlines()[0] if version.stdout else "none",
    }
