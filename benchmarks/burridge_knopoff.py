"""A Burridge-Knopoff chain, of blocks on a belt with springs and a friction surface each, beside Siconos.

    q_i'' = (q_{i-1} - 2 q_i + q_{i+1}) - k q_i - F_i lambda_i + b (q_i' - V),   lambda_i in Sgn(q_i' - V)

Friction falls with the speed of slip by b, so that blocks keep sticking and slipping. Errors are against
our run at a tolerance a thousand times smaller; that of Siconos falls with its step h as O(h).

``python -m benchmarks.burridge_knopoff [--blocks 100] [--t-end 100]`` prints the table alone.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

import nonsmooth as ns

from . import report
from .timing import run_peer

K, V, B = 0.1, 0.3, 0.1
VARIABLE = "BENCH_SICONOS_PYTHON"
STEPS = (1e-2, 5e-3)
BLOCKS = 40  # of ``python -m benchmarks``; 100 take Siconos more than a quarter of an hour
TOLERANCE = 1e-10


def friction(count: int) -> np.ndarray:
    """Friction of each block, all different."""
    return 1.0 + 0.3 * np.sin(1.0 + np.arange(count)) ** 2


def start(count: int) -> np.ndarray:
    """Displacements that repeat every three blocks, at rest."""
    return np.concatenate([0.1 * (np.arange(count) % 3), np.zeros(count)])


def stiffness(count: int) -> np.ndarray:
    """Stiffness matrix of the springs."""
    ends = np.eye(count, k=1) + np.eye(count, k=-1)
    return K * np.eye(count) + np.diag(ends.sum(axis=1)) - ends


def chain(count: int) -> ns.FilippovSystem:
    """Return the chain as a system."""
    q, v, lam = (ca.SX.sym(name, count) for name in ("q", "v", "lam"))
    force, forces = friction(count), -ca.SX(stiffness(count)) @ q
    pushes = [forces[i] - force[i] * lam[i] + B * (v[i] - V) for i in range(count)]
    return ns.FilippovSystem(
        [*ca.vertsplit(q), *ca.vertsplit(v)],
        field=[*ca.vertsplit(v), *pushes],
        surfaces=[v[i] - V for i in range(count)],
        multipliers=ca.vertsplit(lam),
    )


def ours(count: int, t_end: float, tol: float) -> tuple[ns.Trajectory, float]:
    """A run and its processor seconds, the system built before."""
    system = chain(count)
    ns.simulate(system, start(count), 1e-3, tol=tol)
    begin = time.process_time()
    found = ns.simulate(system, start(count), t_end, tol=tol)
    return found, time.process_time() - begin


def siconos(python: str, count: int, t_end: float, steps: list[float]) -> dict[str, Any]:
    """The same chain by Siconos."""
    zero, one = np.zeros((count, count)), np.eye(count)
    problem = {
        "t_end": t_end,
        "matrix": np.block([[zero, one], [-stiffness(count), B * one]]).tolist(),
        "offset": [0.0] * count + [-B * V] * count,
        "rates": np.hstack([zero, one]).tolist(),
        "shift": [-V] * count,
        "push": np.vstack([zero, np.diag(friction(count))]).tolist(),
        "start": start(count).tolist(),
        "steps": steps,
    }
    return run_peer(python, "siconos_chain", problem)


def run(
    quick: bool,
    count: int = BLOCKS,
    t_end: float = 100.0,
    steps: Sequence[float] = STEPS,
) -> dict[str, Any]:
    """Errors at t_end and processor seconds of both, for the steps of Siconos and our tolerance."""
    if quick:
        count, t_end = min(count, 5), min(t_end, 20.0)
    solution, _ = ours(count, t_end, 1e-3 * TOLERANCE)
    found, seconds = ours(count, t_end, TOLERANCE)
    error = float(np.abs(found.x[-1] - solution.x[-1]).max())
    row = {"tolerance": TOLERANCE, "error": error, "seconds": seconds, "events": len(found.events)}
    result: dict[str, Any] = {"blocks": count, "t_end": t_end, "nonsmooth": {"rows": [row]}}
    result["same itinerary"] = found.itinerary == solution.itinerary
    result["status"] = found.status.name
    label, python = "siconos, Moreau time stepping", os.environ.get(VARIABLE)
    if python is None:
        result[label] = {"missing": f"name an interpreter that has it in {VARIABLE}"}
        return result
    peer = siconos(python, count, t_end, list(steps[:1] if quick else steps))
    for row in peer["rows"]:
        row["error"] = float(np.abs(np.array(row.pop("x")) - solution.x[-1]).max())
    result[label] = peer
    return result


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.burridge_knopoff", description=__doc__
    )
    parser.add_argument("--blocks", type=int, default=100)
    parser.add_argument("--t-end", type=float, default=100.0)
    parser.add_argument("--steps", nargs="+", type=float, default=STEPS, help="of Siconos")
    o = parser.parse_args()
    print(report.chain(run(False, o.blocks, o.t_end, o.steps)))


if __name__ == "__main__":
    main()
