"""Times and memory of what a run keeps: dense output at many times, and a million events.

Each case has a fresh process. Seconds are of the processor, memory is that beyond what a short run needs. An
``ensemble`` of one start computes the same run and keeps its end only.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from ..timing import fresh

NAME = "reading"

#: Processor seconds at most for 1e5 times, and for a million events with MiB.
TARGETS = {
    "1e5 times of a run of 1e4 (s)": (0.02, "at most"),
    **{f"1e6 events, {name} (s)": (2.0, "at most") for name in ("hysteresis", "converter")},
    **{f"1e6 events, {name} (MiB)": (100.0, "at most") for name in ("hysteresis", "converter")},
}

_SECONDS = """
import gc, json, time
import casadi as ca, numpy as np, nonsmooth as ns

def seconds(work, turns):
    found = []
    for _ in range(turns):
        begin = time.process_time()
        kept = work()
        found.append(time.process_time() - begin)
        del kept
    return {"low": min(found), "median": float(np.median(found))}
"""

_TIMES = """
x, v, t, lam = (ca.SX.sym(s) for s in ("x", "v", "t", "lam"))
push = 0.9 * ca.cos(0.7 * t) - 0.1 * v - ca.sin(x)
pendulum = ns.FilippovSystem([x, v], field=[v, push - 0.1 * lam], multipliers=lam, surface=v, time=t)
run = ns.simulate(pendulum, [0.5, 0.1], T_END, tol=1e-9)
found = {"steps": len(run.steps)}
for name, times in (
    ("sorted", np.linspace(0, T_END, COUNT)),
    ("in any order", np.random.default_rng(0).uniform(0, T_END, COUNT)),
):
    found[name] = seconds(lambda: run(times), 9)
note = json.dumps(found)
"""

_SYSTEMS = """
def hysteresis():
    x, q = ca.SX.sym("x"), ca.SX.sym("q")
    flips = [ns.Reset(x - 1, [x, -1], 1, "off"), ns.Reset(x + 1, [x, 1], -1, "on")]
    return ns.FilippovSystem([x, q], field=[2 * q - x, 0], resets=flips), [0.0, 1.0], 1.0986122886681098

def converter():
    buck = ns.textbook.buck_converter()
    return buck.system, buck.start, 2e-4

def peak():
    with open("/proc/self/status") as file:
        return [int(line.split()[1]) / 1024 for line in file if line.startswith("VmHWM")][0]

system, start, each = SYSTEM()
limits = dict(max_steps=10**8, max_events=10**8)
end, one = each * COUNT, ns.Work(threads=1, progress=False)
ns.simulate(system, start, 100 * each)
"""

_CORE = """
ns.ensemble(system, [start], 100 * each, work=one)
note = json.dumps(seconds(lambda: ns.ensemble(system, [start], end, work=one, **limits), TURNS))
"""

_EVENTS = """
before = peak()
begin = time.process_time()
run = ns.simulate(system, start, end, dense=DENSE, **limits)
found = {"first": time.process_time() - begin, "MiB": peak() - before, "events": len(run.events)}
del run
found |= seconds(lambda: ns.simulate(system, start, end, dense=DENSE, **limits), TURNS)
note = json.dumps(found)
"""


def _measured(script: str, **values: Any) -> dict[str, Any]:
    text = _SECONDS + script
    for name, value in values.items():
        text = text.replace(name, str(value))
    found: dict[str, Any] = json.loads(fresh(text)["note"])
    return found


def run(quick: bool) -> dict[str, Any]:
    """Measure all cases."""
    count, turns = (10**4, 1) if quick else (10**6, 3)
    times = _measured(_TIMES, T_END=1e2 if quick else 1e4, COUNT=10**3 if quick else 10**5)
    result: dict[str, Any] = {"count": count, "times": times, "events": {}}
    print(f"  times: {result['times']}", flush=True)
    for system in ("hysteresis", "converter"):
        given = {"SYSTEM": system, "COUNT": count, "TURNS": turns}
        own = {"an ensemble of one": _measured(_SYSTEMS + _CORE, **given)}
        for dense in (False, True):
            label = f"simulate, dense={dense}"
            own[label] = _measured(_SYSTEMS + _EVENTS, **given, DENSE=dense)
        result["events"][system] = own
        print(f"  {system}: {own}", flush=True)
    return result


def figures(results: dict[str, Any]) -> dict[str, float]:
    """Numbers to compare with TARGETS."""
    section = results.get(NAME)
    if not section or section["count"] != 10**6:
        return {}
    found = {"1e5 times of a run of 1e4 (s)": section["times"]["sorted"]["median"]}
    for name, own in section["events"].items():
        loose = own["simulate, dense=False"]
        found[f"1e6 events, {name} (s)"] = loose["low"]
        found[f"1e6 events, {name} (MiB)"] = loose["MiB"]
    return found


def markdown(section: dict[str, Any], table: Callable[[list[str], list[list[str]]], str]) -> str:
    """Tables of this section."""
    times = section["times"]
    rows = [
        [name, *(f"{1e3 * times[name][k]:.3g}" for k in ("low", "median"))]
        for name in ("sorted", "in any order")
    ]
    first = table([f"1e5 times of {times['steps']:,} steps", "least ms", "median ms"], rows)
    rows = [
        [
            system,
            label,
            f"{t['low']:.3g}",
            f"{t['median']:.3g}",
            f"{t['MiB']:.0f}" if "MiB" in t else "",
        ]
        for system, own in section["events"].items()
        for label, t in own.items()
    ]
    head = [f"{section['count']:,} events", "by", "least s", "median s", "MiB"]
    return f"`python -m benchmarks --only {NAME}`, in processor time:\n\n{first}\n\n{table(head, rows)}"
