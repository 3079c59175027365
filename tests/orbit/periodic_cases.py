"""The systems of ``tests/data/orbits.json``, by the names of the cases."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import casadi as ca

import nonsmooth as ns

CASES: dict[str, dict[str, Any]] = {
    case["id"]: case["values"]
    for case in json.loads((Path(__file__).parents[1] / "data" / "orbits.json").read_text())
}


def symbols(names: str) -> list[ca.SX]:
    return [ca.SX.sym(name) for name in names.split()]


def relay() -> ns.FilippovSystem:
    x1, x2, x3, w = symbols("x1 x2 x3 w")
    linear = [x2 - (0.1 * w + 1) * x1, x3 - (0.1 * w + w**2) * x1, -(w**2) * x1]
    drive = [1, -2, 1]
    return ns.FilippovSystem(
        [x1, x2, x3],
        surface=x1,
        above=[a - b for a, b in zip(linear, drive, strict=True)],
        below=[a + b for a, b in zip(linear, drive, strict=True)],
        parameters={w: 25.0},
    )


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
    x, v, t, f, F, W = symbols("x v t f F W")
    return ns.FilippovSystem(
        [x, v],
        surface=v,
        above=[v, F * ca.cos(W * t) - x - f],
        below=[v, F * ca.cos(W * t) - x + f],
        parameters={f: 0.2, F: 1, W: 0.6},
        time=t,
    )


def friction_oscillator() -> ns.FilippovSystem:
    u, v, t, nu, F, a0, a1, a2 = symbols("u v t nu F a0 a1 a2")

    def c(z: ca.SX, side: int) -> ca.SX:
        return a0 * side - a1 * z + a2 * z**3

    return ns.FilippovSystem(
        [u, v],
        surface=1 - v,
        above=[v, -u + c(1 - v, 1) + F * ca.cos(nu * t)],
        below=[v, -u + c(1 - v, -1) + F * ca.cos(nu * t)],
        parameters={nu: float(CASES["K1"]["nu_grazing"]), F: 0.1, a0: 1.5, a1: 1.5, a2: 0.45},
        time=t,
    )


def walker() -> ns.FilippovSystem:
    a, b, p, q, gamma = symbols("th thd ph phd gamma")
    swing = ca.sin(a - gamma) + b**2 * ca.sin(p) - ca.cos(a - gamma) * ca.sin(p)
    after = [-a, ca.cos(2 * a) * b, -2 * a, ca.cos(2 * a) * (1 - ca.cos(2 * a)) * b]
    return ns.FilippovSystem(
        [a, b, p, q],
        field=[b, ca.sin(a - gamma), q, swing],
        parameters={gamma: 0.009},
        resets=ns.Reset(p - 2 * a, after, 1),
    )
