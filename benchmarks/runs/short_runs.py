"""Times of short runs of new systems, before a program is compiled for them.

Processor seconds in a fresh process after the import, with a cached interpreter.
"""

from __future__ import annotations

import json
import tempfile
from typing import Any

import numpy as np

from ..timing import fresh

_SCRIPT = """
import json, time
import casadi as ca, numpy as np, nonsmooth as ns

def stick_slip(belt):
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    return ns.FilippovSystem([x, v], surface=v - belt, above=[v, -x - 0.4], below=[v, -x + 0.4])

def pendulums(n):
    u, v = ca.SX.sym("u", n), ca.SX.sym("v", n)
    left, right = ca.vertcat(0, u[:-1]), ca.vertcat(u[1:], 0)
    pull = left + right - 2 * u - ca.sin(u) - 0.1 * (u - left) ** 3
    rest, push = ca.vertcat(v, pull), ca.DM.zeros(2 * n)
    push[n] = 0.5
    states = ca.vertsplit(ca.vertcat(u, v))
    return ns.FilippovSystem(states, surface=v[0] - 0.3, above=rest - push, below=rest + push)

def seconds(work):
    begin = time.process_time()
    work()
    return time.process_time() - begin

found = {}
found["first result"] = seconds(lambda: ns.simulate(stick_slip(0.3), [0.0, 0.0], 20.0))
starts = np.random.default_rng(0).normal(size=(4, 2))
found["ensemble of 4"] = seconds(lambda: ns.ensemble(stick_slip(0.31), starts, 20.0))
found["40 pendulums"] = seconds(lambda: ns.simulate(pendulums(40), np.full(80, 0.2), 10.0))
system = stick_slip(0.3)
run = lambda: ns.simulate(system, [0.0, 0.0], 22.0)
found["steps"] = len(run().steps.starts)
found["simulate"] = min(seconds(run) for _ in range(500))  # too few to be worth a program of its own
note = json.dumps(found)
"""


def run(quick: bool) -> dict[str, Any]:
    """Least and median of several processes."""
    with tempfile.TemporaryDirectory() as cache:
        environment = {"NONSMOOTH_CACHE": cache}
        fresh(_SCRIPT, environment)
        found = [json.loads(fresh(_SCRIPT, environment)["note"]) for _ in range(1 if quick else 7)]
    result: dict[str, Any] = {"steps": found[0]["steps"]}
    for name in ("first result", "ensemble of 4", "40 pendulums", "simulate"):
        each = [one[name] for one in found]
        result[name] = {"low": min(each), "median": float(np.median(each))}
        print(f"  {name}: {result[name]}", flush=True)
    return result
