"""Branches of periodic orbits of random systems, each checked by simulation and by differences.

``python -m benchmarks.random_branches [COUNT [FIRST SEED [CLASS ...]]]`` prints what is wrong, seed by seed, then
counts. For nodes of every branch: multipliers and stability are returned; the motion from inside the first leg closes
after the period, through the same modes; multipliers are those of differences of the motion. Events: an itinerary
changes at those that change it, a multiplier passes the unit circle at the others. Ends: each is named.
"""

from __future__ import annotations

import signal
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

import nonsmooth as ns
from nonsmooth.orbit import Branch, BranchEnd, PeriodicOrbit

from .problems import Array

Made = tuple[ns.FilippovSystem, Array, float]

#: Seconds for a system; nodes that are simulated; relative errors of closure and of multipliers; growth of
#: derivatives along an orbit beyond which rounding decides a simulation of it.
LIMIT, NODES, CLOSURE, DIFFERENCE, LOST = 60, 10, 1e-7, 1e-4, 1e13

#: Ends of a branch that say nothing of its orbits.
NAMELESS = (BranchEnd.STEP_TOO_SMALL, BranchEnd.FAILED)

#: Events beside which rounding decides how a simulation continues, or when.
BESIDE = ("two-fold", "infinite period at a boundary node")

#: Events at which a multiplier passes the unit circle.
SMOOTH = ("fold", "branch point", "period doubling", "Neimark-Sacker", "pitchfork")


def _linear(rng: np.random.Generator, n: int, decay: float) -> Array:
    a = rng.normal(size=(n, n))
    return np.asarray(a - max(0.0, np.linalg.eigvals(a).real.max() + decay) * np.eye(n))


def _states(n: int) -> tuple[list[ca.SX], ca.SX, ca.SX, ca.SX]:
    names = [ca.SX.sym(f"x{i}") for i in range(n)]
    return names, ca.vertcat(*names), ca.SX.sym("q"), ca.SX.sym("t")


def filippov(rng: np.random.Generator, forced: bool = False) -> Made:
    """Two cubic fields of 2 to 6 states and a curved surface that moves with the parameter."""
    n = int(rng.integers(2, 6 if forced else 7))
    names, x, q, t = _states(n)
    fields = []
    for k in range(2):
        a, b, d = rng.normal(size=(n, n)) - 0.9 * np.eye(n), rng.normal(size=n), rng.normal(size=n)
        f = ca.DM(a) @ x + ca.DM(b) - 0.05 * x**3
        fields.append(f + (q * ca.DM(0.5 * d) if k == 0 else 0))
    drive = ca.DM(2 * rng.normal(size=n)) * ca.cos(1.3 * t) if forced else 0
    above, below = (ca.vertsplit(f + drive) for f in fields)
    h, more = names[0] - 0.2 * q + 0.1 * names[1] ** 2, {"time": t} if forced else {}
    system = ns.FilippovSystem(
        names, surface=h, above=above, below=below, parameters={q: 1.0}, **more
    )
    return system, 0.5 * rng.normal(size=n), 150.0


def relay(rng: np.random.Generator) -> Made:
    """A stable linear system of 3 to 6 states with a relay."""
    n = int(rng.integers(3, 7))
    names, x, q, _ = _states(n)
    b = rng.normal(size=n)
    b[0] = abs(b[0]) * rng.choice([1.0, -0.05, -0.3])
    f, push = ca.DM(_linear(rng, n, 0.3)) @ x, q * ca.DM(0.3 * rng.normal(size=n))
    above = ca.vertsplit(f - ca.DM(b + 0.2 * rng.normal(size=n)) + push)
    system = ns.FilippovSystem(
        names,
        surface=names[0] - 0.2 * q,
        above=above,
        below=ca.vertsplit(f + ca.DM(b)),
        parameters={q: 1.0},
    )
    return system, rng.normal(size=n), 150.0


def gap(rng: np.random.Generator) -> Made:
    """One or two forced masses with a second spring, a dashpot, a preload or a rigid wall beyond a gap."""
    n = int(rng.integers(1, 3))
    x, v = [ca.SX.sym(f"x{i}") for i in range(n)], [ca.SX.sym(f"v{i}") for i in range(n)]
    q, t = ca.SX.sym("q"), ca.SX.sym("t")
    k, c = 0.5 + rng.random(n), 0.1 + 0.2 * rng.random(n)
    forces = [-k[i] * x[i] - c[i] * v[i] for i in range(n)]
    forces[0] += q * rng.random() * ca.cos(0.9 * t)
    if n == 2:
        forces[:] = [forces[0] + 0.4 * (x[1] - x[0]), forces[1] + 0.4 * (x[0] - x[1])]
    wall, states = rng.uniform(0.3, 0.8), [*x, *v]
    given: dict[str, Any] = {"time": t, "parameters": {q: 1.0}}
    kind, start = (
        rng.choice(["spring", "dashpot", "preload", "rigid"]),
        0.1 * rng.normal(size=2 * n),
    )
    if kind == "rigid":
        hit = ns.Impact(wall - x[0], restitution=rng.uniform(0.3, 0.9))
        system = ns.FilippovSystem(states, field=[*v, *forces], impacts=[hit], **given)
        return system, start, 300.0
    push = rng.uniform(1, 8) * (x[0] - wall)
    push += {"spring": 0, "dashpot": 0.5 * v[0], "preload": 0.2}[kind]
    beyond = [forces[0] - push, *forces[1:]]
    system = ns.FilippovSystem(
        states, surface=x[0] - wall, above=[*v, *beyond], below=[*v, *forces], **given
    )
    return system, start, 300.0


def hybrid(rng: np.random.Generator) -> Made:
    """A neuron with adaptation, a kicked oscillator, or a relay with hysteresis and a linear filter."""
    kind, q = rng.integers(3), ca.SX.sym("q")
    if kind == 0:
        v, w, t = ca.SX.sym("v"), ca.SX.sym("w"), ca.SX.sym("t")
        drive = rng.uniform(0.0, 0.3) * ca.cos(rng.uniform(1.0, 4.0) * t)
        fire = ns.Reset(v - 1, [0, w + rng.uniform(0.05, 0.3)], direction=1, name="spike")
        system = ns.FilippovSystem(
            [v, w],
            field=[1.5 + 0.5 * q + drive - v - w, -rng.uniform(0.2, 1.0) * w],
            resets=[fire],
            time=t,
            parameters={q: 1.0},
        )
        return system, np.array([0.1, 0.1]), 200.0
    if kind == 1:
        x, v, z = (ca.SX.sym(s) for s in "xvz")
        kick = ns.Reset(x, [x, v + 0.2 + 0.2 * q, z], direction=1, name="kick")
        damping, fast = rng.uniform(0.05, 0.3), rng.uniform(0.3, 3.0)
        field = [v, -x - damping * v - 0.1 * x**3 + 0.1 * z, x - fast * z]
        system = ns.FilippovSystem([x, v, z], field=field, resets=[kick], parameters={q: 1.0})
        return system, np.array([1.0, 0.0, 0.1]), 200.0
    n = int(rng.integers(2, 5))
    names, x, q, _ = _states(n)
    u = ca.SX.sym("u")
    a, b = _linear(rng, n, 0.5), rng.normal(size=n)
    out = ca.dot(ca.DM(-np.linalg.solve(a, b)), x) / float(np.sum(np.linalg.solve(a, b) ** 2))
    width = rng.uniform(0.1, 0.5) * q
    switches = [
        ns.Reset(out - width, [*names, -1], direction=1, name="off"),
        ns.Reset(out + width, [*names, 1], direction=-1, name="on"),
    ]
    field = [*ca.vertsplit(ca.DM(a) @ x + ca.DM(b) * u), 0]
    system = ns.FilippovSystem([*names, u], field=field, resets=switches, parameters={q: 1.0})
    return system, np.append(0.1 * rng.normal(size=n), 1.0), 150.0


CLASSES: dict[str, Callable[[np.random.Generator], Made]] = {
    "filippov": filippov,
    "forced": lambda rng: filippov(rng, forced=True),
    "relay": relay,
    "gap": gap,
    "hybrid": hybrid,
}


def inside(orbit: PeriodicOrbit) -> tuple[Array, float]:
    """A state inside the first leg, and its time."""
    run = orbit.trajectory
    t = float(run.t[0]) + 0.37 * orbit.legs[0].duration
    return np.asarray(run(t))[: orbit.system.dimension], t if orbit.system.time_dependent else 0.0


def moved(orbit: PeriodicOrbit, x: Array, t: float, tol: float) -> ns.Trajectory:
    """The motion over a period."""
    values, end = orbit.parameters, t + orbit.period
    return ns.simulate(orbit.system, x, end, t_start=t, parameters=values, tol=tol)


def differences(orbit: PeriodicOrbit, x: Array, t: float) -> Array:
    """Eigenvalues of the derivative of the motion over a period, by central differences of fourth order."""
    slopes = list[Array]()
    for h in (1e-5, 5e-6):
        ends = [
            moved(orbit, x + s * h * e, t, 1e-13).x[-1] for e in np.eye(x.size) for s in (1.0, -1.0)
        ]
        slopes.append((np.array(ends[::2]) - ends[1::2]) / (2 * h))
    return np.asarray(np.linalg.eigvals((4 * slopes[1] - slopes[0]).T / 3))


def _kinds(kinds: Sequence[str]) -> Counter[str]:
    return Counter(kind for kind in kinds if kind not in ("end", ""))


def _events(orbit: PeriodicOrbit) -> Counter[str]:
    """How often each kind of event occurs in a period."""
    return _kinds([leg.kind for leg in orbit.legs])


def errors_on(branch: Branch) -> list[str]:
    """Errors on a branch, as sentences."""
    found, count = list[str](), len(branch)
    events = {event.parameter for event in branch.events}
    beside = [event.parameter for event in branch.events if event.kind in BESIDE]
    for orbit in branch.orbits:
        try:
            _ = orbit.multipliers, orbit.stability
        except ns.NonsmoothError as error:
            found.append(f"a node that raises: {error}")
    for k in range(0, count, max(1, count // NODES)):
        orbit = branch.orbits[k]
        if not np.isfinite(orbit.multipliers).all() or branch.values[k] in events:
            continue
        near = min((abs(m.relative) for m in orbit.margins), default=1.0)
        at, (x, t) = f"at {branch.values[k]:.6g}", inside(orbit)
        growth = float(np.abs(orbit.evaluation.flows.by_start).max())  # as beside a saddle
        if growth > LOST or any(abs(branch.values[k] - q) < 1e-3 for q in beside):
            continue
        run = moved(orbit, x, t, 1e-12)
        if not run.status.complete:
            if near > 1e-5:
                found.append(f"{at} {orbit.itinerary}: simulation ends {run.status}")
            continue
        missed = float(np.abs(run.x[-1] - x).max()) / (1 + float(np.abs(x).max()))
        largest = max(1.0, float(np.abs(orbit.multipliers).max()))
        if missed > CLOSURE * largest + 1e-11 * growth and near > 1e-5:
            found.append(f"{at} {orbit.itinerary}: does not close by {missed:.1e} of {largest:.1e}")
        elif largest < 1e3 and near > 1e-5:
            own = _kinds([e.kind for e in run.events if e.t > t + 1e-9 * orbit.period])
            if own != _events(orbit):
                found.append(f"{at} {orbit.itinerary}: simulation has {dict(own)}")
    return found + false_events(branch) + _of_multipliers(branch.orbits[count // 2])


def _of_multipliers(orbit: PeriodicOrbit) -> list[str]:
    if "s" in orbit.legs[0].mode or orbit.system.definition.discrete or orbit.is_virtual:
        return []
    near = min((abs(m.relative) for m in orbit.margins), default=1.0)
    own = orbit.multipliers
    growth = float(np.abs(orbit.evaluation.flows.by_start).max())  # on the way
    if near < 1e-3 or not np.abs(own).max() < 1e3 or growth > 1e4:
        return []
    values = differences(orbit, *inside(orbit))
    apart = max(float(np.abs(values - m).min()) for m in own)
    if apart > DIFFERENCE * max(1.0, float(np.abs(own).max())):
        return [f"multipliers {own.round(6)} are {values.round(6)} by differences"]
    return []


def false_events(branch: Branch) -> list[str]:
    """Events at which nothing happens between the nodes beside them."""
    found = list[str]()
    positions = {id(p): k for k, (_, p) in enumerate(branch.nodes)}
    for event in branch.events:
        k = positions.get(id(event.point), 0)
        if event.kind in SMOOTH or not 0 < k < len(branch) - 1:
            continue
        before, after = branch.orbits[k - 1], branch.orbits[k + 1]
        if _events(before) == _events(after) and "corner" not in event.kind:
            found.append(f"{event.kind} at {event.parameter:.8g} changes nothing")
    return found


def branch_of(kind: str, seed: int) -> tuple[Branch | None, str]:
    """The branch through the orbit that a random motion tends to; None with the reason where there is none."""
    system, start, t_end = CLASSES[kind](np.random.default_rng(seed))
    run = ns.simulate(system, start, t_end)
    if not run.status.complete or np.abs(run.x[-1]).max() > 1e3:
        return None, f"no run: {run.status}"
    try:
        orbit = ns.periodic_orbit(system, run, max_time=15)
    except ns.NonsmoothError as error:
        return None, f"no orbit: {type(error).__name__}"
    return ns.continue_orbit(orbit, "q", bounds=(0.2, 3.0), max_points=300), ""


def checked(kind: str, seed: int, counts: Counter[str]) -> Branch | None:
    """The branch of a seed, with what is wrong printed and counted."""
    signal.alarm(LIMIT)
    try:
        branch, reason = branch_of(kind, seed)
        wrong = [] if branch is None else errors_on(branch)
    except KeyboardInterrupt:
        branch, reason, wrong = None, f"longer than {LIMIT} s", [f"takes longer than {LIMIT} s"]
    except ns.NonsmoothError as error:
        branch, reason = None, f"raises {type(error).__name__}"
        wrong = [f"{reason}: {error}"]
    finally:
        signal.alarm(0)
    for text in wrong:
        print(kind, seed, text[:300], flush=True)
    counts["WRONG"] += len(wrong)
    if branch is None:
        counts[reason] += 1
    return branch


def main(numbers: Sequence[int] = (), classes: Sequence[str] = ()) -> Counter[str]:
    """Check equally many branches of each class, 200 from seed 0 on by default; counts of what was found."""
    counts, began, chosen = Counter[str](), time.perf_counter(), classes or tuple(CLASSES)
    count, first = [*numbers, *(200, 0)[len(numbers) :]]
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    warnings.simplefilter("ignore")
    for kind in chosen:
        seed = first
        while counts[f"branches of {kind}"] < count // len(chosen):
            branch = checked(kind, seed, counts)
            seed += 1
            if branch is None:
                continue
            counts.update({"nodes": len(branch), "events": len(branch.events)})
            counts.update([f"branches of {kind}", *(f"end {end}" for end in branch.ends)])
            counts.update(f"event {event.kind}" for event in branch.events)
            for end, why in zip(branch.ends, branch.reasons, strict=True):
                named = "A multiplier has grown" in why
                if (end in NAMELESS and not named) or "corner" in why or "unclassified" in why:
                    print(kind, seed - 1, end, branch.values[[0, -1]], why[:200], flush=True)
    counts["seconds"] = round(time.perf_counter() - began)
    return counts


if __name__ == "__main__":
    numbers = [int(text) for text in sys.argv[1:] if text.isdigit()]
    names = [text for text in sys.argv[1:] if text in CLASSES]
    for what, many in main(numbers, names).items():
        print(f"{many:8d}  {what}")
