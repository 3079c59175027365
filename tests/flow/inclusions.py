"""Cases of set-valued elements as data: a system in strings, a start, and what is true of its motion."""

import json
import math
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import casadi as ca
import numpy as np

import nonsmooth as ns

CASES = Path(__file__).parents[1] / "cases" / "inclusions.json"

#: Functions that the strings use.
FUNCTIONS = {n: getattr(ca, n) for n in ("sin", "cos", "sqrt", "exp", "log", "fabs")}


def cases(path: Path = CASES) -> list[dict]:
    return json.loads(path.read_text(encoding="utf-8"))


@dataclass
class Case:
    """One case; ``system`` is built when it is first needed."""

    data: dict

    def __post_init__(self):
        if "points" in self.data:
            self.data = planar_body(self.data)
        names = [self.data.get(key, "") for key in ("states", "multipliers", "reactions", "time")]
        self.names = [name.split() for name in names]
        own = [condition["lam"] for condition in self.data.get("complementarity", [])]
        own += [
            one["reaction"]
            for key in ("constraints", "impacts")
            for one in self.data.get(key, [])
            if "reaction" in one
        ]
        own += re.findall(r"\w+", self.data.get("vector_multipliers", ""))
        self.symbols = {n: ca.SX.sym(n) for names in [*self.names, own] for n in names}

    def parse(self, text: str) -> list:
        value = eval(
            f"[{text}]", {"__builtins__": {}}, {**FUNCTIONS, **self.symbols}
        )  # our own text
        return [[*map(ca.SX, v)] if isinstance(v, list) else ca.SX(v) for v in value]

    @cached_property
    def system(self) -> ns.FilippovSystem:
        data = self.data
        if data["id"].startswith("slider-crank"):
            return ns.textbook.slider_crank(friction=False).system
        states, multipliers, _, time = ([self.symbols[n] for n in own] for own in self.names)
        surfaces = self.parse(data.get("surfaces", ""))
        multipliers += self.parse(data.get("vector_multipliers", ""))
        surfaces += self.parse(data.get("vector_surfaces", ""))
        impacts = [
            ns.Impact(
                self.parse(own["gap"])[0],
                restitution=own["restitution"],
                reaction=self.symbols[own["reaction"]] if "reaction" in own else None,
                name=f"gap{i}",
            )
            for i, own in enumerate(data.get("impacts", []))
        ]
        conditions = [
            ns.Complementarity(self.parse(own["y"])[0], multiplier=self.symbols[own["lam"]])
            for own in data.get("complementarity", [])
        ]
        constraints = [
            ns.Constraint(self.parse(own["g"])[0], reaction=self.symbols[own["reaction"]])
            for own in data.get("constraints", [])
        ]
        return ns.FilippovSystem(
            states,
            complementarity=conditions,
            field=self.parse(data["field"]) if "field" in data else None,
            above=self.parse(data["above"]) if "above" in data else None,
            below=self.parse(data["below"]) if "below" in data else None,
            surface=self.parse(data["surface"])[0] if "surface" in data else None,
            surfaces=surfaces or None,
            multipliers=multipliers or None,
            impacts=impacts or None,
            constraints=constraints,
            time=time[0] if time else None,
        )

    def run(self, **options) -> ns.Trajectory:
        start = [float(v) for v in self.data["start"]]
        options = {"start_mode": self.data.get("start_mode"), **options}
        if options["start_mode"] is not None:
            start = projected(self.system, start)
        return ns.simulate(self.system, start, self.data["t_end"], **options)

    def errors(self, run: ns.Trajectory) -> dict[str, float]:
        """Relative errors of what is true of the states at the end, and of those in ``x_at_1``."""
        found, states = {}, self.names[0]
        for name, text in self.data["truth"].items():
            which, _, at = name.partition("_at_")
            own = [which] if which in states else [n for n in states if which == f"each_{n[0]}"]
            value = run.x[-1] if not at else run(float(at))
            for n in own:
                true = float(text)
                error = abs(value[states.index(n)] - true) / max(1.0, abs(true))
                found[name] = max(error, found.get(name, 0.0))
        return found


def projected(system: ns.FilippovSystem, start: list[float]) -> list[float]:
    return start


def planar_body(data: dict) -> dict:
    """A planar body that touches at points: gaps and slips are linear, so that its accelerations are those at rest."""
    gaps, slips, force = [], [], ["0", "0", "0"]
    for i, ((px, py), angle) in enumerate(zip(data["points"], data["normal_angles"], strict=True)):
        n, s = (math.cos(angle), math.sin(angle)), (-math.sin(angle), math.cos(angle))
        rows = [(*d, px * d[1] - py * d[0]) for d in (n, s)]
        (gap, _), (_, slip) = (
            [
                "+".join(f"({c!r})*{q}" for c, q in zip(row, names, strict=True))
                for names in ("xyt", "uvw")
            ]
            for row in rows
        )
        gaps.append({"gap": gap, "restitution": 0, "reaction": f"r{i}"})
        slips.append(slip)
        for j in range(3):
            force[j] += f"+({rows[0][j]!r})*r{i}-({data['mu'] * rows[1][j]!r})*l{i}*r{i}"
    loads = [f"({own}+({load!r}))" for own, load in zip(force, data["load"], strict=True)]
    loads[2] = f"{loads[2]}/{data['inertia']!r}"
    count = len(gaps)
    return {
        **data,
        "states": "x y t u v w",
        "multipliers": " ".join(f"l{i}" for i in range(count)),
        "reactions": " ".join(f"r{i}" for i in range(count)),
        "surfaces": ", ".join(slips),
        "impacts": gaps,
        "field": ", ".join(["u", "v", "w", *loads]),
        "start": [0] * 6,
        "t_end": 1e-3,
    }


def accelerations(run: ns.Trajectory) -> np.ndarray:
    """Those of all motions that continue from the start, sorted."""
    if run.continuations:
        found = np.array([own.rates[3:] for own in run.continuations])
    else:
        found = run.steps.coefficients[:1, 3:6, 1]
    return found[np.lexsort(found.T[::-1].round(7))]
