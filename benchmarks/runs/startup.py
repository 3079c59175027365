"""Time to a first result in a fresh process: import only, cached, and with compilation."""

from __future__ import annotations

import tempfile
from typing import Any

import numpy as np

from ..peers import diffrax_modes, heyoka_modes
from ..timing import fresh

_OURS = """
from benchmarks.problems import bounce_system, random_starts, T_MAX
import nonsmooth as ns
system = bounce_system("linear")
"""
_ENSEMBLE = (
    _OURS
    + "note = str(ns.ensemble(system, random_starts(10000), T_MAX, work=ns.Work(threads=1)).t[0])"
)
_SIMULATE = _OURS + "note = str(ns.simulate(system, random_starts(1)[0], T_MAX).t[-1])"
_PEER = """
from benchmarks.problems import random_starts
from benchmarks.peers.{module} import make
note = str(make("linear", {tolerance})(random_starts({count})).t[0])
"""


def run(quick: bool) -> dict[str, Any]:
    """Seconds for each case: median, least and most of several fresh processes."""
    repeats = 1 if quick else 7
    cases: dict[str, tuple[str, bool]] = {
        "import nonsmooth": ("import nonsmooth", False),
        "nonsmooth.simulate, one bounce, the driver compiled": (_SIMULATE, True),
        "nonsmooth.simulate, one bounce": (_SIMULATE, False),
        "nonsmooth.ensemble, 10,000 bounces, cold": (_ENSEMBLE, True),
        "nonsmooth.ensemble, 10,000 bounces, cached": (_ENSEMBLE, False),
        "scipy, one bounce": (_peer("scipy_dop853", 1e-10, 1), False),
    }
    if heyoka_modes.available():
        for count, many in ((1, "one bounce"), (10_000, "10,000 bounces")):
            for cold, word in ((True, "cold"), (False, "cached")):
                cases[f"heyoka, {many}, {word}"] = (_peer("heyoka_modes", 1e-7, count), cold)
    if diffrax_modes.available():
        # JAX keeps nothing between processes by default.
        cases["diffrax, 500 bounces, cold"] = (_peer("diffrax_modes", 1e-10, 500), False)
    with tempfile.TemporaryDirectory() as cache:
        for script, _ in cases.values():
            fresh(script, _cache(cache))
        return {name: _repeat(*case, cache, repeats) for name, case in cases.items()}


def _peer(module: str, tolerance: float, count: int) -> str:
    return _PEER.format(module=module, tolerance=tolerance, count=count)


def _repeat(script: str, cold: bool, cache: str, repeats: int) -> dict[str, Any]:
    runs = [_cold(script) if cold else fresh(script, _cache(cache)) for _ in range(repeats)]
    inside = [r["inside"] for r in runs]
    print(f"  {script.strip().splitlines()[-1][:70]}: {np.median(inside):.3f} s", flush=True)
    return {
        "seconds": float(np.median(inside)),
        "low": min(inside),
        "high": max(inside),
        "processor time": float(np.median([r["cpu"] for r in runs])),
        "whole process": float(np.median([r["process"] for r in runs])),
        "peak MiB": max(r["peak_mib"] for r in runs),
    }


def _cold(script: str) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as empty:
        return fresh(script, _cache(empty))


def _cache(folder: str) -> dict[str, str]:
    """Where this library and heyoka keep what they compiled."""
    return {"NONSMOOTH_CACHE": folder, "XDG_CACHE_HOME": folder}
