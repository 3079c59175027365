"""Memory of a large ensemble, scaling over threads and processes, and the peak rate of one core."""

from __future__ import annotations

import multiprocessing
import shutil
import subprocess
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import nonsmooth as ns

from ..problems import T_MAX, bounce_system, random_starts
from ..timing import alternate, fresh

#: Floating-point operations of an ideal bounce at 1e-9: the expansion alone, at the best order.
IDEAL_FLOP = {"linear": 3.5e3, "nonlinear": 19.4e3}

_MEMORY = """
from benchmarks.problems import bounce_system, random_starts, T_MAX
import nonsmooth as ns
x = random_starts({count})
many = ns.ensemble(bounce_system("linear"), x, T_MAX, tol={tol}, work=ns.Work(progress=False))
results = (many.x, many.t, many.status, many.itinerary_code, *many.events.values())
note = dict(
    starts_mib=x.nbytes / 2**20,
    results_mib=sum(a.nbytes for a in results) / 2**20,
    complete=int(many.complete.sum()),
)
"""


def memory(quick: bool, tolerance: float = 1e-8) -> dict[str, Any]:
    """Peak resident memory of 1e7 bounces in one call, starts and results included."""
    count = 10**5 if quick else 10**7
    result = fresh(_MEMORY.format(count=count, tol=tolerance))
    print(f"  {count} bounces: {result['peak_mib']:.0f} MiB", flush=True)
    return {"bounces": count, "peak MiB": result["peak_mib"], **result["note"]}


def scaling(quick: bool, tolerance: float = 1e-8) -> dict[str, Any]:
    """Wall times of one sweep on one and two threads, and on one and two processes."""
    result: dict[str, Any] = {}
    count = 20_000 if quick else 1_000_000
    starts = random_starts(count, seed=4)
    method = multiprocessing.get_context("spawn")
    with (
        ProcessPoolExecutor(1, mp_context=method) as one,
        ProcessPoolExecutor(2, mp_context=method) as two,
    ):
        for name in ("linear", "nonlinear"):
            system = bounce_system(name)

            def sweep(system: ns.FilippovSystem = system, **how: Any) -> None:
                work = ns.Work(progress=False, **how)
                ns.ensemble(system, starts, T_MAX, tol=tolerance, work=work)

            work = {
                "1 thread": lambda sweep=sweep: sweep(threads=1),
                "2 threads": lambda sweep=sweep: sweep(threads=2),
                "1 process": lambda sweep=sweep: sweep(executor=one),
                "2 processes": lambda sweep=sweep: sweep(executor=two),
            }
            timings = alternate(work, 3 if quick else 15, clock=time.perf_counter)
            result[name] = {k: t.as_dict() | {"rate": t.rate(count)} for k, t in timings.items()}
            threads = {k: run for k, run in work.items() if "thread" in k}
            for k, t in alternate(threads, 3).items():
                result[name][k]["processor s"] = t.median
            print(
                f"  {name}: { ({k: round(t.median, 3) for k, t in timings.items()}) }", flush=True
            )
    return result


def peak() -> dict[str, Any]:
    """Peak rate of one core in multiply-adds, measured by a C program built for this processor."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return {"missing": "no C compiler"}
    source = Path(__file__).with_name("peak.c")
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "peak"
        flags = ["-O3", "-march=native", "-ffp-contract=fast"]
        subprocess.run([compiler, *flags, str(source), "-o", str(program)], check=True)
        done = subprocess.run([str(program)], capture_output=True, text=True, check=True)
    vector, scalar, lanes = (float(v) for v in done.stdout.split())
    print(f"  {vector:.1f} Gflop/s with {lanes:.0f} lanes, {scalar:.1f} scalar", flush=True)
    limits = {name: vector * 1e9 / flop for name, flop in IDEAL_FLOP.items()}
    return {"Gflop/s": vector, "scalar Gflop/s": scalar, "lanes": lanes, "limits": limits}
