"""Random systems with every kind of event, compared with an integrator that shares no code with the package.

``python -m tests.flow.random_systems 2000 [first seed]`` compares so many and prints counts by kind and status
(also when it is interrupted), and each system that differs. A system that the integrator cannot decide in doubles is counted as undecided.
"""

from __future__ import annotations

import collections
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

import nonsmooth as ns

from .independent.hybrid import (
    Contact,
    Jump,
    Model,
    Outcome,
    Problem,
    Table,
    follow,
    package_system,
)

TOLERANCE = 1e-9
T_END = 3.0


class Text:
    """Expressions whose numbers are parameters, so that a system with other numbers is the same text."""

    def __init__(self, rng: np.random.Generator):
        self.rng, self.numbers = rng, dict[str, float]()

    def number(self, value: float) -> str:
        """The name of a number of three digits."""
        name = f"p{len(self.numbers)}"
        self.numbers[name] = float(round(value, 3))
        return name

    def normal(self, scale: float = 1.0) -> str:
        return self.number(scale * self.rng.normal())

    def uniform(self, low: float, high: float) -> str:
        return self.number(self.rng.uniform(low, high))

    def form(self, weights: np.ndarray, names: list[str]) -> str:
        return "+".join(f"{self.number(w)}*{name}" for w, name in zip(weights, names, strict=True))


def _field(text: Text, has: dict[str, bool], states: list[str]) -> list[str]:
    rng, n = text.rng, len(states)
    rates = 0.6 * rng.normal(size=(n, n)) - 0.4 * np.eye(n)
    field = [f"{text.form(row, states)}+{text.normal()}" for row in rates]
    forms = ["sin(x0+x1)", "x0*x1/(1+x0*x0+x1*x1)", "tanh(x0)*cos(x1)", "exp(-x0*x0)"]
    for i in range(n):
        if has["nonlinear"]:
            field[i] += f"+{text.normal()}*{rng.choice(forms)}-0.05*x{i}*x{i}*x{i}"
        if has["forced"]:
            field[i] += f"+{text.normal()}*sin({text.uniform(0.5, 4)}*t+{i})"
    return field


def _surfaces(
    text: Text, has: dict[str, bool], states: list[str], field: list[str], m: int
) -> list[str]:
    """Surfaces, whose multipliers are added to the field."""
    rng, n = text.rng, len(states)
    surfaces, normals = [], rng.normal(size=(m, n))
    for i in range(m):
        normals[i] /= np.linalg.norm(normals[i])
        h = f"{text.form(normals[i], states)}+{text.normal(0.5)}"
        if has["curved"]:
            bent = text.form(0.6 * rng.normal(size=n), states)
            h += f"+0.3*({bent})*({bent})" if rng.random() < 0.5 else f"+0.25*sin({bent})"
        if has["moving"] and i == 0:
            h += f"+0.3*sin({text.uniform(1, 4)}*t)"
        surfaces.append(h)
    pushes = rng.uniform(0.2, 1.0) * rng.normal(size=(m, n))
    pushes -= rng.uniform(-0.3, 2.5, size=m)[:, None] * normals  # most surfaces attract
    for j in range(n):
        for i in range(m):
            law = f"l{i}"
            if has["hidden"]:
                bend = text.uniform(0.05, 0.4) if j == 0 else "0.2"
                law = f"(l0+{bend}*(l0-l0*l0*l0))"
            field[j] += f"+{text.number(pushes[i, j])}*{law}"
        if has["products"]:
            field[j] += f"+{text.normal(0.3)}*l0*l1"
    return surfaces


def _jump(text: Text, has: dict[str, bool], states: list[str], k: int) -> Jump:
    rng, n = text.rng, len(states)
    guard = f"{text.form(rng.normal(size=n), states)}-{text.normal(0.7)}"
    if rng.random() < 0.3:
        guard += f"+0.5*sin({text.uniform(1, 3)}*t)"
    chosen = rng.choice(n, size=int(rng.integers(1, n + 1)), replace=False)
    target = {f"x{i}": f"{text.uniform(-0.9, 0.9)}*x{i}+{text.normal(0.8)}" for i in chosen}
    jump = Jump(guard, target, int(rng.choice([-1, 1, 1, 0])), f"jump {k}")
    if rng.random() < 0.3:
        has["conditions"] = True
        when = text.form(rng.normal(size=n), states)
        jump = replace(jump, when=when, priority=float(rng.integers(0, 3)))
        if jump.direction and rng.random() < 0.5:  # jumps to where it does not hold
            has["level"] = True
            back = {f"x{i}": f"(-0.9)*x{i}-0.1" for i in range(n)}
            jump = replace(jump, target=back, level=True)
    return jump


def draw(seed: int, more: bool = True) -> tuple[Problem, frozenset[str]]:
    """Draw a system and the kinds of things in it; without ``more`` those that it had first."""
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
    text, states = Text(rng), [f"x{i}" for i in range(n)]
    field = _field(text, has, states)
    surfaces = _surfaces(text, has, states, field, m)
    count = int(rng.integers(1, 4)) if has["resets"] else 0
    jumps = [_jump(text, has, states, k) for k in range(count)]
    stops = []
    if has["stops"]:
        stops = [(text.form(rng.normal(size=n), states) + "-1.5", int(rng.choice([-1, 0, 1])))]
    start = [round(value, 3) for value in rng.normal(size=n)]
    contacts = []
    if has["impacts"]:
        states += ["q", "v"]
        field += ["v", f"-1.5-0.5*q+0.4*x0-0.1*v+r0{'+0.3*l0' if m else ''}"]
        w = text.uniform(1, 4)
        floor = (f"0.2*sin({w}*t)", f"0.2*{w}*cos({w}*t)") if rng.random() < 0.5 else ("0.1", "0")
        contacts = [Contact(f"q-{floor[0]}", f"v-{floor[1]}", text.uniform(0.2, 0.7))]
        field[0] += "+0.2*v"
        start += [1.0, 0.0]
    problem = Problem(
        states, field, start, T_END, surfaces, contacts, jumps, stops, bool(has["hidden"]),
        text.numbers,
    )  # fmt: skip
    kinds = {name for name, value in has.items() if value}
    if more:
        problem = _with_more(problem, rng, kinds)
    return problem, frozenset(kinds)


def _with_more(problem: Problem, rng: np.random.Generator, kinds: set[str]) -> Problem:
    """Add what ``draw`` has not: discrete states, conditions of two, cascades, tables, friction in the plane."""
    text = Text(rng)
    text.numbers = problem.numbers
    x = [s for s in problem.states if s.startswith("x")]
    jumps, changes = list(problem.jumps), {}

    def form(scale: float = 1.0) -> str:
        return text.form(scale * rng.normal(size=len(x)), x)

    def add(kind: str, *more: Jump) -> None:
        kinds.add(kind)
        for jump in more:
            jumps.append(replace(jump, name=f"jump {len(jumps)}"))

    if rng.random() < 0.4:
        h, low = form(), text.normal(0.5)
        on = Jump(f"{h}-{low}-0.6", {"d0": "1"}, 1, level=True, when="0.5-d0")
        add("discrete", on, Jump(f"{h}-{low}", {"d0": "0"}, -1, level=True, when="d0-0.5"))
        changes = dict(states=[*problem.states, "d0"], start=[*problem.start, 0.0], discrete=["d0"])
        field = [
            f"{f}+{text.normal()}*d0" if k < len(x) else f for k, f in enumerate(problem.field)
        ]
        changes["field"] = [*field, "0"]
    if rng.random() < 0.4:
        target = {x[0]: f"{text.uniform(-0.9, 0.9)}*{x[0]}", x[1]: f"{x[1]}+{text.normal(0.5)}"}
        two = Jump(f"{form()}-{text.normal(0.5)}", target, int(rng.choice([-1, 1])))
        either = bool(rng.random() < 0.5)
        add("joined", replace(two, other=f"{form()}-{text.normal(0.3)}", either=either))
    if rng.random() < 0.3:
        first = Jump(f"{form()}-{text.normal(0.5)}", {x[1]: f"{x[1]}+2"}, int(rng.choice([-1, 1])))
        then = {x[1]: f"0.1*{x[1]}-0.5", x[0]: f"{text.uniform(-0.9, 0.9)}*{x[0]}"}
        add("cascade", first, Jump(f"{x[1]}-1.2", then, 1))
    problem = replace(problem, jumps=jumps, **changes)
    if problem.hidden or "products" in kinds:
        return problem
    f = list(problem.field)
    if rng.random() < 0.35:
        kinds.add("table")
        xs = np.round(np.cumsum(rng.uniform(0.2, 0.8, size=4)) - 1.2, 3).tolist()
        table = Table(form(0.7), xs, np.round(rng.normal(size=4), 3).tolist())
        i = int(rng.integers(len(x)))
        f[i] += "+tab0"
        problem = replace(problem, tables=[table], field=f)
    elif rng.random() < 0.35:
        kinds.add("set")
        slopes = np.round(rng.normal(size=(2, len(x))), 3)
        push = np.linalg.pinv(slopes) @ (
            rng.uniform(0.6, 2) * np.eye(2) + 0.2 * rng.normal(size=(2, 2))
        )
        for i in range(len(x)):
            f[i] += "".join(f"-{text.number(push[i, k])}*u{k}" for k in range(2))
        forms = [f"{text.form(row, x)}+{text.normal(0.3)}" for row in slopes]
        problem = replace(problem, sets=[(forms[0], forms[1])], field=f)
    return problem


def varied(problem: Problem, seed: int) -> Problem:
    """The same text with other numbers and another start; as drawn where the seed is 0."""
    if not seed:
        return problem
    rng = np.random.default_rng(seed)
    spread = lambda value: float(value + 0.2 * rng.normal() * (0.3 + abs(value)))
    numbers = {name: spread(value) for name, value in problem.numbers.items()}
    numbers |= {c.restitution: rng.uniform(0.2, 0.7) for c in problem.contacts}
    start = [
        spread(value) if name.startswith("x") else value
        for name, value in zip(problem.states, problem.start, strict=True)
    ]
    return replace(problem, numbers=numbers, start=start)


def nudged(problem: Problem) -> list[float]:
    """A start nearby."""
    free = len(problem.states) - len(problem.discrete)
    return [value + 1e-7 * (i < free) for i, value in enumerate(problem.start)]


def package_words(system: Any, problem: Problem) -> Callable[[str], str]:
    """Modes of the package in the letters of a problem: without those of breakpoints and discrete states."""
    if not problem.tables:
        return lambda mode: mode.split(",")[0]
    rng, n = np.random.default_rng(0), len(problem.states)
    points = [rng.normal(size=n + 1) * 10 ** rng.uniform(-1, 4) for _ in range(30)]
    model, known = Model(problem), list(problem.numbers.values())
    true = [model.guards(x[:n], x[n])[: len(problem.surfaces)] for x in points]
    found = [system.surface_function(i) for i in range(system.surface_count)]
    arguments = [system.extended_states, system.parameter_symbols]
    heights = ca.Function("h", arguments, [ca.vertcat(*found)])
    size = system.extended_dimension
    given = [heights(x[:size], known).full().ravel() for x in points]
    times = (
        np.array(given)[:, None, :] / np.array(true)[:, :, None]
    )  # the same one but for a factor
    spread = np.ptp(times, axis=0) / np.max(np.abs(times), axis=0)
    own, count = [(i, times[0, k, i]) for k, i in enumerate(spread.argmin(axis=1))], len(found)
    assert (spread.min(axis=1) < 1e-6).all(), spread
    turned = str.maketrans("+-", "-+")

    def word(mode: str) -> str:
        letters = [mode[i] if way > 0 else mode[i].translate(turned) for i, way in own]
        return "".join(letters) + mode.split(",")[0][count:]

    return word


def package_events(run: Any, problem: Problem) -> list[tuple[float, str, str]]:
    """Events of a run of the package in the words of the integrator."""
    found, word = [], package_words(run.system, problem)
    before = word(run.segments[0].mode)
    for event in run.events:
        named = event.kind in ("reset", "impact", "stop")
        if named or (event.kind != "end" and word(event.mode_after) != before):
            found.append((event.t, event.name if named else "mode", word(event.mode_after)))
        before = word(event.mode_after)
    return found


def _without_rattle(events: list[tuple[float, str, str]]) -> list[tuple[float, str, str]]:
    """Leave out the impacts that accumulate at a contact: their number is a matter of tolerance."""
    closings = [t for t, what, mode in events if what == "mode" and mode.endswith("c")]
    return [
        event
        for event in events
        if not (event[1].startswith("impact") and any(0 <= t - event[0] < 0.02 for t in closings))
    ]


def difference(problem: Problem, exact: Outcome, run: Any, tol: float = TOLERANCE) -> str:
    """The difference between a run and the reference solution, or an empty string."""
    events, true = _without_rattle(package_events(run, problem)), _without_rattle(exact.events)
    if exact.status == run.status.name == "ENDLESS_JUMPS":  # counted further there
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
    if run.status.name != exact.status:
        return f"status: true {exact.status}, came {run.status.name} at {run.t[-1]:.6g}"
    if exact.status == "ENDLESS_JUMPS":
        return ""
    # when a contact closes is a limit of impacts, which the integrator extrapolates
    weight = [0.1 if what == "mode" and mode.endswith("c") else 1.0 for _, what, mode in events]
    pairs = zip(true, events, weight, strict=True)
    late = max([w * abs(a[0] - b[0]) for a, b, w in pairs], default=0.0)
    error = float(np.max(np.abs(run.x[-1] - exact.x) / (1 + np.abs(exact.x))))
    if max(late, error) <= 10 * tol:
        return ""
    moved = follow(replace(problem, start=nudged(problem)))
    growth = float(np.max(np.abs(moved.x - exact.x))) / 1e-7
    if moved.status == exact.status and max(late, error) <= 10 * tol * max(1.0, growth):
        return ""
    return f"digits: state {error:.2g}, times {late:.2g}, errors of the start grow by {growth:.2g}"


def wrong_side(problem: Problem, run: Any) -> str:
    """A segment whose letters disagree with the signs of the surfaces inside it, or an empty string."""
    if not problem.surfaces:
        return ""
    surfaces, word = Model(problem).guards, package_words(run.system, problem)
    for segment in run.segments:
        length = segment.t_end - segment.t_start
        for part in (0.1, 0.5, 0.9) if length > 1e-6 else ():
            t = segment.t_start + part * length
            values = surfaces(run(t), t)
            for letter, h in zip(word(segment.mode), values[: len(problem.surfaces)], strict=False):
                inside = {"+": h > -1e-7, "-": h < 1e-7, "s": abs(h) < 1e-7}
                if not inside[letter]:
                    return f"side: mode {segment.mode} at {t:.9g}, where h = {values}"
    return ""


def compare(seed: int, more: bool = True) -> tuple[str, str, frozenset[str]]:
    """Verdict (right, undecided, wrong: what), status of the integrator, kinds."""
    problem, kinds = draw(seed, more)
    exact = follow(problem)
    if exact.trouble:
        return "undecided: " + exact.trouble, "", kinds
    try:
        run = ns.simulate(package_system(problem), problem.start, problem.t_end, tol=TOLERANCE)
    except (TypeError, ns.DefinitionError) as error:
        return f"refused: {str(error)[:80]}", exact.status, kinds
    found = difference(problem, exact, run) or wrong_side(problem, run)
    return (f"wrong: {found}" if found else "right"), exact.status, kinds


def main(count: int, first: int = 0) -> None:
    verdicts: collections.Counter[str] = collections.Counter()
    by_kind: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    statuses: collections.Counter[str] = collections.Counter()
    reasons: collections.Counter[str] = collections.Counter()
    began = time.perf_counter()
    try:
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
    finally:  # also where it is interrupted
        print(dict(verdicts), f"in {time.perf_counter() - began:.0f} s")
        print("by status:", dict(statuses.most_common()))
        for kind, counts in sorted(by_kind.items()):
            print(f"  {kind:10s}", dict(counts.most_common()))
        print("undecided:", dict(reasons.most_common()), flush=True)


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    main(*[int(value) for value in sys.argv[1:]])
