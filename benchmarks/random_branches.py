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
from nonsmooth.orbit import Branch, BranchEnd, BranchEvent, PeriodicOrbit

from .problems import Array

Made = tuple[ns.FilippovSystem, Array, float]

#: Processor seconds for a system; nodes that are simulated; relative errors of closure and of multipliers.
LIMIT, NODES, CLOSURE, DIFFERENCE = 60, 10, 1e-7, 1e-4

#: Growth of derivatives along an orbit beyond which it is simulated in parts, and how many; relative distance of an
#: orbit from a touch within which rounding decides whether a simulation has it.
GROWS, PARTS, TOUCH = 1e3, 40, 1e-5

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


def parts(orbit: PeriodicOrbit, count: int) -> list[tuple[float, Array, Array]]:
    """Begin of each of equal parts of a period, from inside a leg that slides on nothing if there is one, and states."""
    run, n, period = orbit.trajectory, orbit.system.dimension, orbit.period
    leg = next((leg for leg in orbit.legs if not {"s", "c"} & set(leg.mode)), orbit.legs[0])
    first = leg.t - float(run.t[0]) + 0.37 * leg.duration
    times = float(run.t[0]) + (first + period * np.arange(count + 1) / count) % period
    states = [np.asarray(run(t))[:n] for t in times]
    return list(zip(times.tolist(), states[:-1], states[1:], strict=False))


def moved(orbit: PeriodicOrbit, x: Array, t: float, span: float, tol: float) -> ns.Trajectory:
    """The motion over a time."""
    return ns.simulate(orbit.system, x, t + span, t_start=t, parameters=orbit.parameters, tol=tol)


def differences(orbit: PeriodicOrbit, count: int) -> Array:
    """Eigenvalues of the derivative of the motion over a period, by central differences of fourth order over parts."""
    n = orbit.system.dimension
    whole, span = np.eye(n), orbit.period / count
    for t, x, _ in parts(orbit, count):
        slopes = list[Array]()
        for h in (1e-5, 5e-6):
            near = [x + s * h * e for e in np.eye(n) for s in (1.0, -1.0)]
            ends = [moved(orbit, y, t, span, 1e-13).x[-1] for y in near]
            slopes.append((np.array(ends[::2]) - ends[1::2]) / (2 * h))
        whole = (4 * slopes[1] - slopes[0]).T / 3 @ whole
    return np.asarray(np.linalg.eigvals(whole))


def _kinds(kinds: Sequence[str]) -> Counter[str]:
    return Counter(kind for kind in kinds if kind not in ("end", ""))


def _events(orbit: PeriodicOrbit) -> Counter[str]:
    """How often each kind of event occurs in a period."""
    return _kinds([leg.kind for leg in orbit.legs])


def _growth(orbit: PeriodicOrbit) -> float:
    """Of derivatives along the orbit, as beside a saddle, and over its period."""
    on_the_way = np.abs(orbit.evaluation.flows.by_start).max()
    return float(max(1.0, on_the_way, np.abs(orbit.multipliers).max()))


def _near(orbit: PeriodicOrbit) -> float:
    return min((abs(margin.relative) for margin in orbit.margins), default=1.0)


def errors_on(branch: Branch, counts: Counter[str]) -> list[str]:
    """Errors on a branch, as sentences."""
    found, size = list[str](), len(branch)
    events = {event.parameter for event in branch.events}
    beside = [event.parameter for event in branch.events if event.kind in BESIDE]
    for orbit in branch.orbits:
        try:
            _ = orbit.multipliers, orbit.stability
        except ns.NonsmoothError as error:
            found.append(f"a node that raises: {error}")
    for k in range(0, size, max(1, size // NODES)):
        orbit, value = branch.orbits[k], branch.values[k]
        if not np.isfinite(orbit.multipliers).all() or value in events:
            counts["nodes at events, not simulated"] += 1
            continue
        decided = _near(orbit) > TOUCH and all(abs(value - q) >= 1e-3 for q in beside)
        counts["nodes simulated" if decided else "nodes simulated but for a part"] += 1
        wrong = _missed(orbit, decided)
        found += [f"at {value:.6g} {orbit.itinerary}: {wrong}"] if wrong else []
    return found + false_events(branch, counts) + _of_multipliers(branch, counts)


def _missed(orbit: PeriodicOrbit, decided: bool) -> str:
    """How the motion misses the orbit; where rounding decides how it goes on, in more than one part of the period."""
    count = 1 if decided and _growth(orbit) < GROWS else PARTS
    wrong, own = list[str](), Counter[str]()
    for t, x, end in parts(orbit, count):
        run = moved(orbit, x, t, orbit.period / count, 1e-12)
        own += _kinds([e.kind for e in run.events if e.t > t + 1e-9 * orbit.period])
        missed = float(np.abs(run.x[-1] - end).max()) / (1 + float(np.abs(x).max()))
        if not run.status.complete:
            wrong.append(f"simulation ends {run.status}")
        elif missed > CLOSURE:
            wrong.append(f"does not close by {missed:.1e}")
    if decided and not wrong and own != _events(orbit):
        return f"simulation has {dict(own)}"
    return "; ".join(wrong) if len(wrong) > (not decided) else ""


def _of_multipliers(branch: Branch, counts: Counter[str]) -> list[str]:
    """Multipliers of an orbit that are not those of differences: the first from the middle that has no event beside it."""
    middle = len(branch) // 2
    for orbit in sorted(branch.orbits, key=lambda o: abs(branch.orbits.index(o) - middle)):
        own, growth = orbit.multipliers, _growth(orbit)
        if not np.isfinite(own).all() or orbit.is_virtual or not _near(orbit) >= 1e-3:
            continue
        if all({"s", "c"} & set(leg.mode) for leg in orbit.legs):
            continue
        largest = float(np.abs(own).max())
        lost = growth > 1e4  # all but the largest
        if lost and largest < 1e-3 * growth:
            continue
        counts["branches with multipliers by differences"] += 1
        values = differences(orbit, PARTS if lost else 4 if growth > GROWS else 1)
        compared = own[np.abs(own) >= largest * (1 - 1e-9)] if lost else own
        apart = max(float(np.abs(values - m).min()) for m in compared)
        if apart > DIFFERENCE * max(1.0, largest):
            return [f"multipliers {own.round(6)} are {values.round(6)} by differences"]
        return []
    return []


def false_events(branch: Branch, counts: Counter[str]) -> list[str]:
    """Events at which nothing happens between the nodes beside them, or no multiplier is on the unit circle."""
    found = list[str]()
    positions = {id(p): k for k, (_, p) in enumerate(branch.nodes)}
    for event in branch.events:
        k = positions.get(id(event.point), 0)
        if event.kind in SMOOTH:
            found += _off_circle(event, counts)
        if event.kind in SMOOTH or not 0 < k < len(branch) - 1:
            continue
        before, after = branch.orbits[k - 1], branch.orbits[k + 1]
        if _events(before) == _events(after) and "corner" not in event.kind:
            found.append(f"{event.kind} at {event.parameter:.8g} changes nothing")
    return found


def _off_circle(event: BranchEvent, counts: Counter[str]) -> list[str]:
    """A smooth bifurcation whose orbit has no multiplier on the unit circle, beside the one of the period."""
    orbit = event.orbit
    values = orbit.multipliers
    if not np.abs(values).max() < 1e4:
        counts["smooth events of orbits with a multiplier above 1e4, not checked"] += 1
        return []
    if not orbit.system.time_dependent:
        values = np.delete(values, np.argmin(np.abs(values - 1.0)))
    at = -1.0 if event.kind in ("period doubling", "pitchfork") else 1.0
    off = np.abs(values) - 1.0 if event.kind == "Neimark-Sacker" else values - at
    counts["smooth events checked"] += 1
    away = float(np.abs(off).min(initial=np.inf))
    return [f"{event.kind} at {event.parameter:.8g}: multipliers {values}"] if away > 1e-3 else []


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
    signal.signal(signal.SIGPROF, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    try:
        branch, reason = branch_of(kind, seed)
        if branch is not None and BranchEnd.INTERRUPTED in branch.ends:
            raise KeyboardInterrupt
        wrong = [] if branch is None else errors_on(branch, counts)
    except KeyboardInterrupt:
        branch, reason, wrong = None, f"longer than {LIMIT} s", [f"takes longer than {LIMIT} s"]
    except ns.NonsmoothError as error:
        branch, reason = None, f"raises {type(error).__name__}"
        wrong = [f"{reason}: {error}"]
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
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
