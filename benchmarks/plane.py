"""Friction in the plane: bounces in 3-D beside planar ones, and a block on an incline beside Siconos.

``python -m benchmarks.plane`` prints both; ``BENCH_SICONOS_PYTHON`` names an interpreter with Siconos.
"""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np

import bounce
import nonsmooth as ns

VARIABLE = "BENCH_SICONOS_PYTHON"
TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
STEPS = ("1e-2", "1e-3", "1e-4")
#: The block slides until it sticks; closed forms with 24 digits.
MU, SLOPE, T_END = 0.7, 0.4, 4.91171510210042615824384
END = np.array([1.50886027451038765470960, 1.48581145486294845964079])


def rate(follow: Callable[[], object], count: int, turns: int = 3) -> float:
    """Bounces in a second of processor time, the fastest of some turns."""
    seconds = []
    follow()
    for _ in range(turns):
        begin = time.process_time()
        follow()
        seconds.append(time.process_time() - begin)
    return count / min(seconds)


def bounces(count: int = 4000, tol: float = 1e-9) -> tuple[float, float]:
    """Rates of bounces in 3-D and in the plane, one thread."""
    rng = np.random.default_rng(0)
    v, w = rng.uniform(-1, 1, (2, count, 2))
    work = ns.Work(progress=False, threads=1)
    many = 50 * count
    one, other = rng.uniform(-1, 1, (2, many))
    space = rate(lambda: bounce.lift_off(TURF.in_3d(), v, -1.0, w, tol=tol, work=work), count)
    plane = rate(lambda: bounce.lift_off(TURF, one, -1.0, other, tol=tol, work=work), many)
    return space, plane


def incline(tol: float) -> tuple[float, float]:
    """Error of the place at the end, and processor seconds of the run."""
    x1, x2, v1, v2, l1, l2 = (ca.SX.sym(name) for name in ("x1", "x2", "v1", "v2", "l1", "l2"))
    load = np.cos(SLOPE)
    block = ns.FilippovSystem(
        [x1, x2, v1, v2],
        field=[v1, v2, np.sin(SLOPE) - MU * load * l1, -MU * load * l2],
        surfaces=[ca.vertcat(v1, v2)],
        multipliers=[ca.vertcat(l1, l2)],
    )
    start = [0.0, 0.0, 0.5, 1.2]
    seconds = 1 / rate(lambda: ns.simulate(block, start, T_END, tol=tol), 1, turns=5)
    end = ns.simulate(block, start, T_END, tol=tol).x[-1, :2]
    return float(np.abs(end - END).max()), seconds


def main() -> None:
    """Print both tables."""
    space, plane = bounces()
    print(f"bounces: {space:.0f} in 3-D, {plane:.0f} in the plane a second: {space / plane:.4f}")
    for tol in (1e-4, 1e-9):
        error, seconds = incline(tol)
        print(f"incline, nonsmooth at {tol:g}: error {error:.1e}, {1e3 * seconds:.3f} ms")
    python = os.environ.get(VARIABLE)
    if python is None:
        print(f"{VARIABLE} is not set: without Siconos")
        return
    script = Path(__file__).parent / "peers" / "siconos_incline.py"
    done = subprocess.run([python, str(script), *STEPS], capture_output=True, text=True, check=True)
    for line in done.stdout.splitlines():
        if line.startswith("{"):
            row = json.loads(line)
            print(
                f"incline, Siconos at h = {row['step']:g}: error {row['error']:.1e}, "
                f"{1e3 * row['seconds']:.3f} ms"
            )


if __name__ == "__main__":
    main()
