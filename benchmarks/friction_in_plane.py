"""Friction in the plane, beside Siconos: blocks on an incline and on a disc, a sphere on a turntable.

``python -m benchmarks.friction_in_plane`` prints all; ``BENCH_SICONOS_PYTHON`` names an interpreter that
has Siconos.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from .timing import ONE_THREAD

Array = NDArray[np.float64]

VARIABLE = "BENCH_SICONOS_PYTHON"
STEPS = (1e-2, 1e-3, 1e-4)
TOLERANCES = (1e-4, 1e-9)
TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


def rate(follow: Callable[[], object], count: int, turns: int = 3) -> float:
    """Runs in a second of processor time, the fastest of some turns."""
    seconds = []
    follow()
    for _ in range(turns):
        begin = time.process_time()
        follow()
        seconds.append(time.process_time() - begin)
    return count / min(seconds)


@dataclass(frozen=True)
class Ride:
    """A body that slips and sticks on a floor that may turn."""

    name: str
    mu: float
    load: float
    push: float
    turning: float
    start: tuple[float, float]
    speed: tuple[float, ...]
    inertia: float
    t_end: float
    end: tuple[float, float]

    def system(self) -> ns.FilippovSystem:
        """The inertial frame's equations."""
        x1, x2, v1, v2, w1, w2, l1, l2 = (ca.SX.sym(n) for n in "x1 x2 v1 v2 w1 w2 l1 l2".split())
        x, v, w, lam = (
            ca.vertcat(x1, x2),
            ca.vertcat(v1, v2),
            ca.vertcat(w1, w2),
            ca.vertcat(l1, l2),
        )
        force = -self.mu * self.load * lam
        slip, states, rates = (
            v - self.turning * TURN @ x,
            [x, v],
            [v, force + ca.SX([self.push, 0])],
        )
        if self.inertia:
            slip, states, rates = slip + w, [*states, w], [*rates, force / self.inertia]
        return ns.FilippovSystem(
            ca.vertcat(*states), field=ca.vertcat(*rates), surfaces=[slip], multipliers=[lam]
        )

    def peer(self, step: float) -> dict[str, Any]:
        """The floor's frame for Siconos."""
        # The step is rounded so that t_end is a whole number of steps.
        step = self.t_end / round(self.t_end / step)
        size = 5 if self.inertia else 3
        mass, damping, stiffness = np.eye(size), np.zeros((size, size)), np.zeros((size, size))
        relation = np.zeros((3, size))
        relation[0, 0] = 1.0
        relation[1:, 1:3] = np.eye(2)
        damping[1:3, 1:3] = 2 * self.turning * TURN
        stiffness[1:3, 1:3] = -(self.turning**2) * np.eye(2)
        if self.inertia:
            mass[3:, 3:] *= self.inertia
            damping[3:, 3:] = self.inertia * self.turning * TURN
            relation[1:, 3:] = np.eye(2)
        speed = np.array(self.speed[:2]) - self.turning * TURN @ self.start
        force = [-self.load, self.push, *[0.0] * (size - 2)]
        return dict(
            mass=mass.tolist(), damping=damping.tolist(), stiffness=stiffness.tolist(),
            relation=relation.tolist(), force=force, mu=self.mu, t_end=self.t_end, step=step,
            start=[0.0, *self.start, *[0.0] * (size - 3)],
            speed=[0.0, *speed.tolist(), *self.speed[2:]],
        )  # fmt: skip

    def error(self, point: Array) -> float:
        """Largest error of a point in the floor's frame at the end."""
        angle = self.turning * self.t_end
        c, s = math.cos(angle), math.sin(angle)
        return float(np.abs(np.array([[c, -s], [s, c]]) @ point - self.end).max())

    def ours(self, tol: float) -> tuple[float, float]:
        """Error of the position at the end, and processor seconds of the run."""
        system, start = self.system(), [*self.start, *self.speed]
        follow = lambda: ns.simulate(system, start, self.t_end, tol=tol)
        seconds = 1 / rate(follow, 1, turns=5)
        return float(np.abs(follow().x[-1, :2] - self.end).max()), seconds


RIDES = (
    Ride(
        *("a block on an incline slides and sticks", 0.7, math.cos(0.4), math.sin(0.4), 0.0),
        *((0.0, 0.0), (0.5, 1.2), 0.0, 4.91171510210042615824384),
        (1.50886027451038765470960, 1.48581145486294845964079),
    ),
    Ride(
        *("a block on a turning disc slides and sticks", 0.5, 1.0, 0.0, 1.0),
        *((0.1, 0.0), (0.1, 0.3), 0.0, 4.0),
        (-0.0686153343753281915759452, -0.135804142579161874984840),
    ),
    Ride(
        *("a sphere rolls one turn of its circle on a turntable", 2.0, 1.0, 0.0, 1.3),
        *((0.4, 0.2), (0.3, -0.5, -0.56, 1.02), 0.4, 16.9162681347142712840296),
        (0.4, 0.2),
    ),
)


def theirs(
    python: str, rides: tuple[Ride, ...] = RIDES
) -> list[tuple[Ride, float, dict[str, Any]]]:
    """Runs of Siconos: step and result."""
    cases = [(ride, step) for ride in rides for step in STEPS]
    script = Path(__file__).parent / "peers" / "siconos_plane.py"
    runs = json.dumps([ride.peer(step) for ride, step in cases])
    call, environment = [python, str(script), runs], os.environ | ONE_THREAD
    done = subprocess.run(call, capture_output=True, text=True, env=environment)
    answers = [json.loads(row) for row in done.stdout.splitlines() if row.startswith("{")]
    gone = dict(failure=f"the process ended with {done.returncode}: {done.stderr[-200:]}")
    answers += [gone] * (len(cases) - len(answers))
    return [(*case, answer) for case, answer in zip(cases, answers, strict=True)]


def main() -> None:
    """Print all tables."""
    for ride in RIDES:
        for tol in TOLERANCES:
            error, seconds = ride.ours(tol)
            print(f"{ride.name}: nonsmooth at {tol:g}: {error:.1e}, {1e3 * seconds:.3f} ms")
    python = os.environ.get(VARIABLE)
    if python is None:
        print(f"{VARIABLE} is not set: without Siconos")
        return
    for ride, step, answer in theirs(python):
        what = answer.get("failure")
        if what is None:
            error = ride.error(np.array(answer["place"][1:3]))
            what = f"{error:.1e}, {1e3 * answer['seconds']:.3f} ms"
        print(f"{ride.name}: Siconos at h = {step:g}: {what}")


if __name__ == "__main__":
    main()
