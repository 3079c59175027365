"""A stick-slip run beside Siconos and nosnoc, which run in other interpreters.

Environment variables, below, name the interpreters.
"""

from __future__ import annotations

import os
import time
from typing import Any

import numpy as np

import nonsmooth as ns

from ..problems import BELTS, STICK, STICK_START, stick_slip_system
from ..timing import run_peer

BELT, T_END = BELTS["many events"], 100.0
#: Label, environment variable, script, steps to try.
PEERS = (
    (
        "siconos, Moreau time stepping",
        "BENCH_SICONOS_PYTHON",
        "siconos_stick_slip",
        (1e-2, 1e-3, 1e-4),
    ),
    ("nosnoc, FESD Radau IIA", "BENCH_NOSNOC_PYTHON", "nosnoc_stick_slip", (0.5, 0.25)),
)


def run(quick: bool) -> dict[str, Any]:
    """Errors at t = 100 and processor seconds, for each step of each peer, and for ours."""
    solution = ns.simulate(stick_slip_system(BELT), STICK_START, T_END, tol=1e-14).x[-1]
    result: dict[str, Any] = {"nonsmooth": {"rows": _ours(solution)}}
    for label, variable, script, steps in PEERS:
        python = os.environ.get(variable)
        if python is None:
            result[label] = {"missing": f"name an interpreter that has it in {variable}"}
            continue
        chosen = list(steps[:1] if quick else steps)
        problem = {"belt": BELT, "t_end": T_END, **STICK, "start": STICK_START, "steps": chosen}
        found = run_peer(python, script, problem)
        for row in found["rows"]:
            row["error"] = float(np.abs(np.array(row.pop("x")) - solution).max())
        result[label] = found
        print(f"  {label}: {found}", flush=True)
    return result


def _ours(solution: np.ndarray) -> list[dict[str, Any]]:
    rows = []
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        seconds = []
        for _ in range(5):
            begin = time.process_time()
            end = ns.simulate(stick_slip_system(BELT), STICK_START, T_END, tol=tolerance)
            seconds.append(time.process_time() - begin)
        error = float(np.abs(end.x[-1] - solution).max())
        rows.append({"tolerance": tolerance, "error": error, "seconds": float(np.median(seconds))})
    return rows
