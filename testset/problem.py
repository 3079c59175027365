"""Problems of other collections as data: a system in strings, a start, and what is true of its motion."""

import ast
import builtins
import json
import math
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

import nonsmooth as ns
from nonsmooth.flow.constants import KINDS

CASES = Path(__file__).with_name("problems.json")
#: Small systems of the tests, in the same form.
RUNS = CASES.parents[1] / "tests" / "cases" / "runs.json"

_CASADI = (
    *("sin", "cos", "tan", "exp", "log", "sqrt", "fabs", "sign", "fmin", "fmax", "atan2", "floor"),
    *("asin", "acos", "erf"),
    *("tanh", "if_else", "logic_and", "logic_or", "jacobian", "solve", "vertcat", "vertsplit"),
    *("horzcat", "mtimes", "inv"),
)
_CONSTRUCTS = (
    *("Stop", "Reset", "Impact", "Clock", "Relay", "Friction", "Section"),
    *("Complementarity", "Constraint"),
)
#: Names that the strings of a system use.
WORDS = {n: getattr(ca, n) for n in _CASADI} | {"pi": math.pi, "matrix": ca.DM}
WORDS |= {n: getattr(ns, n) for n in (*_CONSTRUCTS, "table")}
#: Names that the strings of numbers use.
NUMBERS = {n: getattr(math, n) for n in dir(math) if not n.startswith("_")}

JUMPS = ("reset", "stop", "impact")
SWITCHES = [kind for kind in KINDS if kind not in (*JUMPS, "end")]


def cases(path: Path = CASES) -> list[dict[str, Any]]:
    """All cases; one with ``each`` is one case for each of its starts."""
    every = []
    for case in json.loads(path.read_text(encoding="utf-8")):
        for i, own in enumerate(case.pop("each", [{}])):
            name = f"{case['id']}-{i}" if own else case["id"]
            every.append({**case, **own, "id": name})
    return every


class Problem:
    """One problem; unknown names are symbols, ``let`` names expressions, ``numbers`` names values, ``system`` has the arguments of a FilippovSystem,
    ``textbook`` names one; ``within`` is the tolerance, or one of times ``t`` and one of states ``x``."""

    def __init__(self, data: dict[str, Any]):
        self.data = data
        if "textbook" in data:
            self.known = getattr(ns.textbook, data["textbook"])(**data.get("arguments", {}))
            self.data = {"start": self.known.start, "t_end": self.known.t_end, **data}
            if any(reference.quantity == "end" for reference in self.known.references):
                names, end = self.known.system.state_names, self.known["end"].value
                self.data["end"] = dict(zip(names, end, strict=True))

    @cached_property
    def space(self) -> dict[str, Any]:
        """Names that the strings may use."""
        given, let = WORDS | self.data.get("numbers", {}), self.data.get("let", {})
        parts = [let, *(self.data.get(part, {}) for part in ("system", "mechanism"))]
        texts = [text for part in parts for text in part.values()]
        nodes = [node for text in texts for node in ast.walk(ast.parse(text, mode="eval"))]
        names = {node.id for node in nodes if isinstance(node, ast.Name)}
        unknown = sorted(names - let.keys() - given.keys() - {*dir(builtins)})
        space = given | {name: ca.SX.sym(name) for name in unknown}
        for name, text in let.items():
            space[name] = eval(text, space)  # our own text
        return space

    def read(self, text: str) -> Any:
        return eval(text, self.space)

    @cached_property
    def system(self) -> ns.FilippovSystem:
        if "textbook" in self.data:
            return self.known.system
        given = {name: self.read(text) for name, text in self.data["system"].items()}
        make = ns.FilippovSystem.from_expression if "rhs" in given else ns.FilippovSystem
        return make(**given)

    def number(self, text: str | float) -> float:
        names = {**NUMBERS, **self.data.get("numbers", {})}
        return float(eval(str(text), {"__builtins__": {}}, names))  # our own text

    @property
    def start(self) -> list[float]:
        return [self.number(value) for value in self.data["start"]]

    @property
    def t_end(self) -> float:
        return self.number(self.data["t_end"])

    def within(self, what: str) -> float:
        given = self.data.get("within", 1e-8)
        return self.number(given.get(what, 1e-8) if isinstance(given, dict) else given)

    @property
    def options(self) -> dict[str, Any]:
        given = self.data.get("options", {})
        read = lambda value: self.number(value) if isinstance(value, str) else value
        return {n: v if n == "start_mode" else read(v) for n, v in given.items()}

    def run(self, **options: Any) -> ns.Trajectory:
        options = {"tol": 1e-10, **self.options, **options}
        if "section" in self.data:
            options["at"] = ns.Section(self.read(self.data["section"]))
        return ns.simulate(self.system, self.start, self.t_end, **options)

    def error(self, found: np.ndarray, true: dict[str, str]) -> float:
        """The largest relative error of the states that are named."""
        names = self.system.state_names
        pairs = [(found[names.index(name)], self.number(value)) for name, value in true.items()]
        return max(abs(value - exact) / max(1.0, abs(exact)) for value, exact in pairs)

    def near(self, found: float | None, text: str | float) -> bool:
        """Whether a time is the one in the text."""
        true = self.number(text)
        return found is not None and abs(found - true) <= self.within("t") * max(1.0, abs(true))

    def check(self, run: ns.Trajectory) -> None:
        """Compare a run with all that is true of it."""
        known = self.data.keys() & COMPARED.keys()
        assert known or self.data.get("status"), "nothing is compared"
        assert run.status.name in self.data.get("status", "REACHED_END").split(), run.message
        if run.status is ns.Status.REACHED_END:
            assert run.t[-1] == self.t_end
        for name in known:
            assert COMPARED[name](self, run, self.data[name]), (name, run, run.events)

    def check_many(self, run: ns.Trajectory, many: ns.Ensemble) -> None:
        """Compare an ensemble of one start with its run."""
        assert set(many.status) == {run.status} and set(many.itinerary) == {run.itinerary}
        assert np.array_equal(many.x, np.tile(many.x[0], (len(many.x), 1)), equal_nan=True)
        for kind, counted in many.events.items():
            assert counted[0] == sum(event.kind == kind for event in run.events), kind
        if many.engine == "core":
            assert np.array_equal(many.x[0], run.x[-1], equal_nan=True)
        elif run.status is not ns.Status.ACCUMULATION:
            assert np.allclose(many.x[0], run.x[-1], rtol=1e-8, atol=1e-8, equal_nan=True)
        if "end" in self.data:
            assert self.error(many.x[0], self.data["end"]) <= self.within("x")


def _jumps(run: ns.Trajectory) -> list[Any]:
    return [event for event in run.events if event.kind in JUMPS]


def _named(problem: Problem, events: list[Any], true: list[list[str]]) -> bool:
    return [event.name for event in events] == [name for name, _ in true] and all(
        problem.near(event.t, t) for event, (_, t) in zip(events, true, strict=True)
    )


def _at_times(problem: Problem, found: Any, true: list[str]) -> bool:
    """Whether these are the times; a list that ends in "..." has only the first of them."""
    rest = true[-1:] == ["..."]
    true = true[: len(true) - rest]
    found = list(found)[: len(true)] if rest else list(found)
    return len(found) == len(true) and all(map(problem.near, found, true))


def _of_kinds(run: ns.Trajectory, kinds: Any) -> list[float]:
    return [event.t for event in run.events if event.kind in kinds]


#: What may be true of a run, by its name in the data.
COMPARED: dict[str, Callable[[Problem, ns.Trajectory, Any], bool]] = {
    "itinerary": lambda _, run, true: (
        run.itinerary.endswith(true[3:]) if true.startswith("...") else run.itinerary == true
    ),
    "says": lambda _, run, true: all(text in run.message for text in true),
    "kinds": lambda _, run, true: [event.kind for event in run.events] == true.split(),
    "counts": lambda _, run, true: all(
        len(_of_kinds(run, [kind])) == n for kind, n in true.items()
    ),
    "names": lambda _, run, true: all(
        " ".join(event.name for event in run.events if event.kind == kind) == names
        for kind, names in true.items()
    ),
    "jumps": lambda own, run, true: _named(own, _jumps(run), true),
    "first": lambda own, run, true: _named(own, _jumps(run)[: len(true)], true),
    "last": lambda own, run, true: own.near(_of_kinds(run, {*KINDS} - {"end"})[-1], true),
    "t_last": lambda own, run, true: own.near(run.t[-1], true),
    "switches": lambda own, run, true: _at_times(own, _of_kinds(run, SWITCHES), true),
    "times": lambda own, run, true: all(
        _at_times(own, _of_kinds(run, [kind]), times) for kind, times in true.items()
    ),
    "limit": lambda own, run, true: (
        abs(run.accumulation_time - own.number(true)) <= own.within("t")
    ),
    "samples": lambda own, run, true: _at_times(own, run.sample_t, true),
    "at": lambda own, run, true: all(
        own.error(run(own.number(t)), states) <= own.within("x") for t, states in true.items()
    ),
    "before": lambda own, run, true: all(
        own.error(run.events[int(i)].x, states) <= own.within("x") for i, states in true.items()
    ),
    "after": lambda own, run, true: all(
        own.error(run.events[int(i)].x_after, states) <= own.within("x")
        for i, states in true.items()
    ),
    "end": lambda own, run, true: own.error(run.x[-1], true) <= own.within("x"),
    "exactly": lambda own, run, true: own.error(run.x[-1], true) == 0,
}
