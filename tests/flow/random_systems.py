"""Random systems with every kind of event, compared with an integrator that shares no code with the package.

``python -m tests.flow.random_systems 2000 [first seed]`` compares so many and prints counts by kind and status,
and each system that differs. A system that the integrator cannot decide in doubles is counted as undecided.
"""

from __future__ import annotations

import collections
import sys
import time
from dataclasses import replace
from typing import Any

import numpy as np

import nonsmooth as ns

from .independent.hybrid import Contact, Jump, Model, Outcome, Problem, follow, package_system

TOLERANCE = 1e-9
T_END = 3.0


def _sum(weights: np.ndarray, names: list[str]) -> str:
    """A linear form with coefficients of three digits."""
    return "+".join(f"({round(w, 3)})*{name}" for w, name in zip(weights, names, strict=True))


def draw(seed: int) -> tuple[Problem, frozenset[str]]:
    """Draw a system and the kinds of things in it."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 5)), int(rng.choice([0, 1, 1, 2, 2, 3, 4]))
    has = dict(
        nonlinear=rng.random() < 0.6,
        forced=rng.random() < 0.5,
        moving=m > 0 and rng.random() < 0.4,
        curved=m > 0 and rng.random() < 0.6,
        products=m > 1 and rng.random() < 0.3,
        resets=rng.random() < 0.5,
        conditions=False,
        level=False,
        stops=rng.random() < 0.2,
        impacts=rng.random() < 0.4,
        hidden=m == 1 and rng.random() < 0.3,
    )
    has["impacts"] &= not has["hidden"]
    states = [f"x{i}" for i in range(n)]
    rates = 0.6 * rng.normal(size=(n, n)) - 0.4 * np.eye(n)
    field = [_sum(row, states) + f"+({round(rng.normal(), 3)})" for row in rates]
    forms = ["sin(x0+x1)", "x0*x1/(1+x0*x0+x1*x1)", "tanh(x0)*cos(x1)", "exp(-x0*x0)"]
    for i in range(n):
        if has["nonlinear"]:
            field[i] += f"+({round(rng.normal(), 3)})*{rng.choice(forms)}-0.05*x{i}*x{i}*x{i}"
        if has["forced"]:
            field[i] += f"+({round(rng.normal(), 3)})*sin({round(rng.uniform(0.5, 4), 3)}*t+{i})"
    surfaces, normals = [], rng.normal(size=(m, n))
    for i in range(m):
        normals[i] /= np.linalg.norm(normals[i])
        h = _sum(normals[i], states) + f"+({round(0.5 * rng.normal(), 3)})"
        if has["curved"]:
            bent = _sum(0.6 * rng.normal(size=n), states)
            h += f"+0.3*({bent})*({bent})" if rng.random() < 0.5 else f"+0.25*sin({bent})"
        if has["moving"] and i == 0:
            h += f"+0.3*sin({round(rng.uniform(1, 4), 3)}*t)"
        surfaces.append(h)
    pushes = rng.uniform(0.2, 1.0) * rng.normal(size=(m, n))
    pushes -= rng.uniform(-0.3, 2.5, size=m)[:, None] * normals  # most surfaces attract
    for j in range(n):
        for i in range(m):
            law = f"l{i}"
            if has["hidden"]:
                law = f"(l0+{round(rng.uniform(0.05, 0.4), 3) if j == 0 else 0.2}*(l0-l0*l0*l0))"
            field[j] += f"+({round(pushes[i, j], 3)})*{law}"
        if has["products"]:
            field[j] += f"+({round(0.3 * rng.normal(), 3)})*l0*l1"
    jumps = []
    for k in range(int(rng.integers(1, 4)) if has["resets"] else 0):
        guard = _sum(rng.normal(size=n), states) + f"-({round(0.7 * rng.normal(), 3)})"
        if rng.random() < 0.3:
            guard += f"+0.5*sin({round(rng.uniform(1, 3), 3)}*t)"
        chosen = rng.choice(n, size=int(rng.integers(1, n + 1)), replace=False)
        target = {
            f"x{i}": f"({round(rng.uniform(-0.9, 0.9), 3)})*x{i}+({round(0.8 * rng.normal(), 3)})"
            for i in chosen
        }
        jumps.append(Jump(guard, target, int(rng.choice([-1, 1, 1, 0])), f"jump {k}"))
        if rng.random() < 0.3:
            has["conditions"] = True
            when = _sum(rng.normal(size=n), states)
            jumps[-1] = replace(jumps[-1], when=when, priority=float(rng.integers(0, 3)))
            if jumps[-1].direction and rng.random() < 0.5:  # jumps to where it does not hold
                has["level"] = True
                back = {f"x{i}": f"(-0.9)*x{i}-0.1" for i in range(n)}
                jumps[-1] = replace(jumps[-1], target=back, level=True)
    stops = []
    if has["stops"]:
        stops = [(_sum(rng.normal(size=n), states) + "-1.5", int(rng.choice([-1, 0, 1])))]
    start = [round(value, 3) for value in rng.normal(size=n)]
    contacts = []
    if has["impacts"]:
        push = f"+0.4*x0-0.1*v+r0{'+0.3*l0' if m else ''}"
        states += ["q", "v"]
        field += ["v", "-1.5-0.5*q" + push]
        floor = (f"0.2*sin({(w := round(rng.uniform(1, 4), 3))}*t)", f"{0.2 * w}*cos({w}*t)")
        floor = floor if rng.random() < 0.5 else ("0.1", "0")
        restitution = round(rng.uniform(0.2, 0.7), 3)
        contacts = [Contact(f"q-{floor[0]}", f"v-{floor[1]}", restitution)]
        field[0] += "+0.2*v"
        start += [1.0, 0.0]
    problem = Problem(
        states, field, start, T_END, surfaces, contacts, jumps, stops, bool(has["hidden"])
    )
    return problem, frozenset(name for name, value in has.items() if value)


def package_events(run: Any) -> list[tuple[float, str, str]]:
    """Events of a run of the package in the words of the integrator."""
    found = []
    for event in run.events:
        named = event.kind in ("reset", "impact", "stop")
        if event.kind != "end":
            found.append((event.t, event.name if named else "mode", event.mode_after))
    return found


def _without_rattle(events: list[tuple[float, str, str]]) -> list[tuple[float, str, str]]:
    """Leave out the impacts that accumulate at a contact: their number is a matter of tolerance."""
    closings = [t for t, what, mode in events if what == "mode" and mode.endswith("c")]
    return [
        event
        for event in events
        if not (event[1].startswith("impact") and any(0 <= t - event[0] < 0.02 for t in closings))
    ]


def difference(problem: Problem, truth: Outcome, run: Any, tol: float = TOLERANCE) -> str:
    """What differs between a run and the truth, or an empty string."""
    events, true = _without_rattle(package_events(run)), _without_rattle(truth.events)
    if truth.status == run.status.name == "ENDLESS_JUMPS":  # counted further there
        events = events[: len(true)]
    # the mode is that after the last jump of an instant
    words = [(what, mode) if mode else (what, None) for _, what, mode in true]
    got = [
        (what, mode if k >= len(words) or words[k][1] is not None else None)
        for k, (_, what, mode) in enumerate(events)
    ]
    if words != got:
        k = next(
            (k for k, pair in enumerate(zip(words, got, strict=False)) if len(set(pair)) > 1),
            min(len(words), len(got)),
        )
        return f"event {k}: true {true[k : k + 2]}, came {events[k : k + 2]}, {run.status.name}"
    if run.status.name != truth.status:
        return f"status: true {truth.status}, came {run.status.name} at {run.t[-1]:.6g}"
    if truth.status == "ENDLESS_JUMPS":
        return ""
    late = max([abs(a[0] - b[0]) for a, b in zip(true, events, strict=True)], default=0.0)
    error = float(np.max(np.abs(run.x[-1] - truth.x) / (1 + np.abs(truth.x))))
    if max(late, error) <= 10 * tol:
        return ""
    moved = follow(replace(problem, start=[value + 1e-7 for value in problem.start]))
    growth = float(np.max(np.abs(moved.x - truth.x))) / 1e-7
    if moved.status == truth.status and max(late, error) <= 10 * tol * max(1.0, growth):
        return ""
    return f"digits: state {error:.2g}, times {late:.2g}, errors of the start grow by {growth:.2g}"


def wrong_side(problem: Problem, run: Any) -> str:
    """A segment whose letters disagree with the signs of the surfaces inside it, or an empty string."""
    if not problem.surfaces:
        return ""
    surfaces = Model(problem).guards
    for segment in run.segments:
        length = segment.t_end - segment.t_start
        for part in (0.1, 0.5, 0.9) if length > 1e-6 else ():
            t = segment.t_start + part * length
            values = surfaces(run(t), t)
            for letter, h in zip(segment.mode, values[: len(problem.surfaces)], strict=False):
                inside = {"+": h > -1e-7, "-": h < 1e-7, "s": abs(h) < 1e-7}
                if not inside[letter]:
                    return f"side: mode {segment.mode} at {t:.9g}, where h = {values}"
    return ""


def compare(seed: int) -> tuple[str, str, frozenset[str]]:
    """Verdict (right, undecided, wrong: what), status of the integrator, kinds."""
    problem, kinds = draw(seed)
    truth = follow(problem)
    if truth.trouble:
        return "undecided: " + truth.trouble, "", kinds
    try:
        run = ns.simulate(package_system(problem), problem.start, problem.t_end, tol=TOLERANCE)
    except (TypeError, ns.DefinitionError) as error:
        return f"refused: {str(error)[:80]}", truth.status, kinds
    found = difference(problem, truth, run) or wrong_side(problem, run)
    return (f"wrong: {found}" if found else "right"), truth.status, kinds


def main(count: int, first: int = 0) -> None:
    verdicts: collections.Counter[str] = collections.Counter()
    by_kind: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    statuses: collections.Counter[str] = collections.Counter()
    reasons: collections.Counter[str] = collections.Counter()
    began = time.perf_counter()
    for seed in range(first, first + count):
        verdict, status, kinds = compare(seed)
        short = verdict.split(":")[0]
        verdicts[short] += 1
        if short == "undecided":
            reasons[verdict[11:]] += 1
        elif short != "right":
            print(f"seed {seed} {verdict[:300]} [{', '.join(sorted(kinds))}]", flush=True)
        statuses[f"{status or 'undecided'} {short}"] += 1
        for kind in kinds:
            by_kind[kind][short] += 1
    print(dict(verdicts), f"in {time.perf_counter() - began:.0f} s")
    print("by status:", dict(statuses.most_common()))
    for kind, counts in sorted(by_kind.items()):
        print(f"  {kind:10s}", dict(counts.most_common()))
    print("undecided:", dict(reasons.most_common()))


if __name__ == "__main__":
    main(*[int(value) for value in sys.argv[1:]])
