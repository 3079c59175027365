"""Cases of reference by their names, and systems: ``CASES`` are the values of ``tests/data/orbits.json``."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import casadi as ca

import nonsmooth as ns


def cases_of(path: str) -> dict[str, dict[str, Any]]:
    """All of a file of cases, in a folder of the tests."""
    text = (Path(__file__).parents[1] / path).read_text(encoding="utf-8")
    return {case["id"]: case for case in json.loads(text)}


def values_of(path: str) -> dict[str, dict[str, Any]]:
    return {name: case["values"] for name, case in cases_of(path).items()}


CASES = values_of("data/orbits.json")
PARAMETERS = {
    name: case.get("parameters", {}) for name, case in cases_of("data/orbits.json").items()
}


def kinds(branch: ns.orbit.Branch) -> list[str]:
    return [event.kind for event in branch.events]


def symbols(names: str) -> list[ca.SX]:
    return [ca.SX.sym(name) for name in names.split()]


def relay() -> ns.FilippovSystem:
    return ns.textbook.multi_sliding_relay().system


def relay_oscillator() -> ns.FilippovSystem:
    """Closed form: the amplitude is f (1 + q)/(1 - q) with the factor q of half a turn."""
    x, v, d, f = symbols("x v d f")
    free = -x - 2 * d * v
    given = {"above": [v, free + f], "below": [v, free - f], "parameters": {d: 0.1, f: 1.0}}
    return ns.FilippovSystem([x, v], surface=v, **given)


def weakening_friction(x: Any = None, v: Any = None) -> ns.FilippovSystem:
    """A block on a belt whose friction falls with the slip, in symbols of its own or given ones."""
    x, v = (x, v) if x is not None else symbols("x v")
    slip, drop = v - 0.5, lambda s: 1 / (1 + 2 * s)
    sides = {"above": [v, -x - drop(slip)], "below": [v, -x + drop(-slip)]}
    return ns.FilippovSystem([x, v], surface=slip, **sides)


def double_well() -> ns.FilippovSystem:
    x, v, lam = symbols("x v lam")
    return ns.FilippovSystem([x, v], surface=x, multipliers=lam, field=[v, lam - x - 0.2 * v])


def stick_slip() -> ns.FilippovSystem:
    x, v, f, k, b = symbols("x v f k b")
    return ns.FilippovSystem(
        [x, v],
        surface=v - b,
        above=[v, -x - (f - k * (v - b))],
        below=[v, -x + (f - k * (b - v))],
        parameters={f: 1, k: 0.2, b: 0.5},
    )


def welander() -> ns.FilippovSystem:
    return ns.textbook.welander_box().system


def fused_focus() -> ns.FilippovSystem:
    return ns.textbook.pseudo_hopf().system


def scalar_relay() -> ns.FilippovSystem:
    x, t, A, k = symbols("x t A k")
    drive = A * ca.cos(t)
    return ns.FilippovSystem(
        [x], surface=x, above=[drive - k], below=[drive + k], parameters={A: 2.5, k: 1}, time=t
    )


def grazing_circle() -> ns.FilippovSystem:
    x, y, d, u = symbols("x y d u")
    r = ca.sqrt(x * x + y * y)
    return ns.FilippovSystem(
        [x, y],
        surface=y + d,
        above=[x * (1 - r) - y, y * (1 - r) + x],
        below=[u, 1],
        parameters={d: 0.9, u: 1},
    )


def table() -> ns.FilippovSystem:
    y, v, t, A, w, g, r = symbols("y v t A w g r")
    Y, rate = A * ca.sin(w * t), A * w * ca.cos(w * t)
    return ns.FilippovSystem(
        [y, v],
        field=[v, -g],
        parameters={A: 1.25 * float(CASES["I1"]["A_fold"]), w: 1, g: 1, r: 0.8},
        time=t,
        resets=ns.Reset(y - Y, [y, rate - r * (v - rate)], -1),
    )


def impact_oscillator() -> ns.FilippovSystem:
    x, v, t, F, w, z, r = symbols("x v t F w z r")
    return ns.FilippovSystem(
        [x, v],
        field=[v, F * ca.cos(w * t) - x - 2 * z * v],
        parameters={F: 0.5, w: 0.8, z: 0.05, r: 0.8},
        time=t,
        impacts=ns.Impact(1 - x, restitution=r),
    )


def excited_oscillator() -> ns.FilippovSystem:
    x, v, t, F, w, d, r = symbols("x v t F w d r")
    return ns.FilippovSystem(
        [x, v],
        field=[v, F * ca.cos(w * t) - x + 2 * d * v],
        parameters={F: 1, w: 2.4, d: float(CASES["I4"]["d_NS"]), r: 0.9},
        time=t,
        resets=ns.Reset(x + 0.1, [x, -r * v], 1),
    )


def forced_friction() -> ns.FilippovSystem:
    return ns.textbook.forced_dry_friction().system


def friction_oscillator() -> ns.FilippovSystem:
    return ns.textbook.belt_oscillator().system


def walker() -> ns.FilippovSystem:
    return ns.textbook.simplest_walker().system


#: Orbits by their itineraries, one leg in R^4 and halves of symmetric ones: system, start, options.
GUESSES: dict[str, tuple[ns.FilippovSystem, list[float], dict[str, Any]]] = {
    "walker": (
        walker(),
        [0.20, -0.20, 0.40, (1 - math.cos(0.40)) * -0.20],
        {"itinerary": [("", "heelstrike")]},
    ),
    "friction": (
        forced_friction(),
        [1.44, 0.0],
        {"itinerary": "s -", "symmetry": "odd", "parameters": {"f": 0.6}, "t_start": 0.64},
    ),
    "relay": (relay(), [0.0, 1.0, 2.57], {"itinerary": ["+", "s"] * 7, "symmetry": "odd"}),
}
