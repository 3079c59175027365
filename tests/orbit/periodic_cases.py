"""Cases of ``tests/data/orbits.json`` by their names: reference values, parameters and systems."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import casadi as ca

import nonsmooth as ns

_DATA = json.loads((Path(__file__).parents[1] / "data" / "orbits.json").read_text())
CASES: dict[str, dict[str, Any]] = {case["id"]: case["values"] for case in _DATA}
PARAMETERS: dict[str, dict[str, Any]] = {case["id"]: case.get("parameters", {}) for case in _DATA}


def kinds(branch: ns.orbit.Branch) -> list[str]:
    return [event.kind for event in branch.events]


def symbols(names: str) -> list[ca.SX]:
    return [ca.SX.sym(name) for name in names.split()]


def relay() -> ns.FilippovSystem:
    return ns.textbook.multi_sliding_relay().system


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
    T, S, a, b, eps = symbols("T S a b eps")
    return ns.FilippovSystem(
        [T, S],
        surface=S - a * T - eps,
        above=[1 - 6 * T, b * (1 - S) - 5 * S],
        below=[1 - T, b * (1 - S)],
        parameters={a: 0.8, b: 0.5, eps: -0.01},
    )


def fused_focus() -> ns.FilippovSystem:
    x, y, al, r = symbols("x y al r")
    return ns.FilippovSystem(
        [x, y],
        surface=y,
        above=[1, -x],
        below=[-1, -(x - al) - r * (x - al) ** 2],
        parameters={al: -0.03, r: -1},
    )


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
