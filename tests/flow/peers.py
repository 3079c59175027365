"""Problems of other collections as data: a system in strings, a start, and what is true of its motion."""

import json
import math
from functools import cached_property
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

import nonsmooth as ns

from .independent.contacts import Mechanism

CASES = Path(__file__).parents[1] / "cases" / "peers.json"

_FUNCTIONS = (
    "sin",
    "cos",
    "tan",
    "exp",
    "log",
    "sqrt",
    "fabs",
    "sign",
    "fmin",
    "fmax",
    "atan2",
    "floor",
)
_LOGIC = (
    "if_else",
    "logic_and",
    "logic_or",
    "jacobian",
    "solve",
    "vertcat",
    "vertsplit",
    "horzcat",
    "mtimes",
    "inv",
)
_CONSTRUCTS = (
    *("Stop", "Reset", "Impact", "Clock", "Relay", "Friction", "Section"),
    *("Complementarity", "Constraint"),
)
#: Names that the strings of a system use.
WORDS = {n: getattr(ca, n) for n in (*_FUNCTIONS, *_LOGIC)} | {"pi": math.pi, "matrix": ca.DM}
WORDS |= {n: getattr(ns, n) for n in _CONSTRUCTS if hasattr(ns, n)}
#: Names that the strings of numbers use.
NUMBERS = {n: getattr(math, n) for n in dir(math) if not n.startswith("_")}

JUMPS = ("reset", "stop", "impact")


def cases(path: Path = CASES) -> list[dict[str, Any]]:
    """All cases; one with ``each`` is one case for each of its starts."""
    every = []
    for case in json.loads(path.read_text(encoding="utf-8")):
        for i, own in enumerate(case.pop("each", [{}])):
            name = f"{case['id']}-{i}" if own else case["id"]
            every.append({**case, **own, "id": name})
    return every


def number(text: str | float) -> float:
    return float(eval(str(text), {"__builtins__": {}}, NUMBERS))  # our own text


class Problem:
    """One problem; ``let`` names expressions, ``system`` has the arguments of a FilippovSystem, ``textbook`` names one."""

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
        space = dict(WORDS)
        space |= {name: ca.SX.sym(name) for name in self.data["symbols"].split()}
        for name, text in self.data.get("let", {}).items():
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

    @property
    def start(self) -> list[float]:
        return [number(value) for value in self.data["start"]]

    @property
    def t_end(self) -> float:
        return number(self.data["t_end"])

    @property
    def within(self) -> float:
        return self.data.get("within", 1e-8)

    def run(self, **options: Any) -> ns.Trajectory:
        options = {"tol": 1e-10, **self.data.get("options", {}), **options}
        if "section" in self.data:
            options["at"] = ns.Section(self.read(self.data["section"]))
        return ns.simulate(self.system, self.start, self.t_end, **options)

    def mechanism(self) -> Mechanism:
        """The same mechanism for an integrator that shares no code with the package."""
        given = {name: self.read(text) for name, text in self.data["mechanism"].items()}
        q, v = ca.vertcat(*given["q"]), ca.vertcat(*given["v"])
        gaps, slips = ca.vertcat(*given["gaps"]), ca.vertcat(*given["slips"])
        rates = ca.vertcat(ca.mtimes(ca.jacobian(gaps, q), v), slips)

        def values(expression: ca.SX, *arguments: ca.SX) -> Any:
            made = ca.Function("f", list(arguments), [ca.densify(ca.SX(expression))])
            flat = expression.is_column()
            return lambda *at: np.array(made(*at)).ravel() if flat else np.array(made(*at))

        return Mechanism(
            mass=values(given["mass"], q),
            force=values(ca.vertcat(*given["force"]), q, v),
            gaps=values(gaps, q),
            normals=values(ca.jacobian(gaps, q), q),
            tangents=values(ca.jacobian(slips, v), q),
            bias=values(ca.mtimes(ca.jacobian(rates, q), v), q, v),
            restitution=given["restitution"],
            friction=given["friction"],
        )

    def error(self, found: np.ndarray, true: dict[str, str]) -> float:
        """The largest relative error of the states that are named."""
        names = self.system.state_names
        pairs = [(found[names.index(name)], number(value)) for name, value in true.items()]
        return max(abs(value - truth) / max(1.0, abs(truth)) for value, truth in pairs)

    def check(self, run: ns.Trajectory) -> None:
        """Compare a run with all that is true of it."""
        data, compared = self.data, False
        assert run.status.name == data.get("status", "REACHED_END"), run.message
        if "itinerary" in data:
            assert run.itinerary == data["itinerary"]
            compared = True
        if "jumps" in data:
            jumps = [event for event in run.events if event.kind in JUMPS]
            assert [event.name for event in jumps] == [name for name, _ in data["jumps"]]
            for event, (_, t) in zip(jumps, data["jumps"], strict=True):
                assert abs(event.t - number(t)) <= self.within * max(1.0, event.t), event
            compared = True
        if "first" in data:  # of jumps that accumulate
            jumps = [event for event in run.events if event.kind in JUMPS][: len(data["first"])]
            assert [event.name for event in jumps] == [name for name, _ in data["first"]]
            for event, (_, t) in zip(jumps, data["first"], strict=True):
                assert abs(event.t - number(t)) <= self.within * max(1.0, event.t), event
            compared = True
        if "last" in data:
            last = [event.t for event in run.events if event.kind != "end"][-1]
            assert abs(last - number(data["last"])) <= self.within * max(1.0, last), last
            compared = True
        if "switches" in data:
            found = [e.t for e in run.events if e.kind not in (*JUMPS, "end")]
            true = [number(t) for t in data["switches"]]
            assert len(found) == len(true), found
            assert np.allclose(found, true, rtol=self.within, atol=self.within)
            compared = True
        if "limit" in data:
            assert abs(run.accumulation_time - number(data["limit"])) <= self.within
            compared = True
        if "samples" in data:
            true = [number(t) for t in data["samples"]]
            assert np.allclose(run.sample_t, true, rtol=self.within, atol=self.within)
            compared = True
        for t, states in data.get("at", {}).items():
            assert self.error(run(number(t)), states) <= self.within
            compared = True
        if "end" in data:
            assert self.error(run.x[-1], data["end"]) <= self.within
            compared = True
        assert compared or data.get("status"), "nothing is compared"
