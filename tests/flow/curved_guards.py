"""Random curved guards against dense sampling: ``python -m tests.flow.curved_guards SHAPES [SEED]``, 20 levels each.

The motions are known in closed form, so the guards are functions of the time: how often they pass a level, and
when, is read off a fine grid and bisected. Levels that an extremum nearly touches are left out.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.optimize import brentq

import nonsmooth as ns

LEVELS, T_END = 20, 8.0
GRID = np.linspace(0.0, T_END, 16_001)

_x, _v, _count, _t, _h = (ca.SX.sym(name) for name in ("x", "v", "count", "t", "h"))

#: Fields of x and v with the motion from (1, 0).
MOTIONS = (
    ([_v, -_x], lambda t: (np.cos(t), -np.sin(t))),
    ([1, -0.5], lambda t: (1 + t, -0.5 * t)),
    ([_v, -2], lambda t: (1 - t * t, -2 * t)),
    ([-0.3 * _x, 1], lambda t: (np.exp(-0.3 * t), t)),
)


@dataclass
class Counts:
    """What a fuzz has seen."""

    runs: int = 0
    passages: int = 0
    left_out: int = 0
    wrong: int = 0
    worst: float = 0.0


def _term(rng, m):
    """A random smooth function of x, v and t with values of order 1; ``m`` are the functions of a library."""
    a, b = rng.uniform(0.3, 3.0, 2) * rng.choice([-1, 1], 2)
    return (
        lambda x, v, t: m.sin(a * t + b),
        lambda x, v, t: m.cos(a * x + 0.3 * b * v),
        lambda x, v, t: x * m.sin(a * t),
        lambda x, v, t: 1 / (1 + (0.5 * x - 0.3 * a * v) ** 2),
        lambda x, v, t: m.exp(-((x - 0.3 * a) ** 2)),
        lambda x, v, t: (x - 0.3 * a) * (v - 0.3 * b) / (1 + 0.1 * t * t),
        lambda x, v, t: m.tanh(a * x + b * v),
        lambda x, v, t: 0.2 * a * (x - 0.5 * v),
    )[rng.integers(8)]


def _shape(seed, m):
    rng = np.random.default_rng(seed)
    terms = [_term(rng, m) for _ in range(rng.integers(1, 4))]
    return lambda x, v, t: sum(term(x, v, t) for term in terms)


def _passages(value, direction):
    """Times at which a function of the time passes zero, or None where that is not clear on the grid."""
    g = value(GRID)
    size = np.abs(g).max() + 1e-12
    inner = (g[1:-1] - g[:-2]) * (g[2:] - g[1:-1]) <= 0
    if np.any(np.abs(g[1:-1][inner]) < 1e-5 * size) or min(abs(g[0]), abs(g[-1])) < 1e-9 * size:
        return None
    at = np.flatnonzero(g[:-1] * g[1:] < 0)
    at = at[direction * (g[at + 1] - g[at]) >= 0]
    return np.array([brentq(value, GRID[k], GRID[k + 1], xtol=1e-15, rtol=1e-15) for k in at])


def run(seed: int, counts: Counts, tol: float = 1e-10) -> None:
    """Compare the passages of one random guard through random levels."""
    rng = np.random.default_rng([seed, 1])
    field, motion = MOTIONS[rng.integers(len(MOTIONS))]
    direction = int(rng.integers(-1, 2))
    guard, dense = _shape(seed, ca)(_x, _v, _t), _shape(seed, np)
    kick = ns.Reset(guard - _h, [_x, _v, _count + 1], direction=direction)
    given = {"field": [*field, 0], "parameters": {_h: 0.0}, "time": _t}
    system = ns.FilippovSystem([_x, _v, _count], resets=[kick], **given)
    values = dense(*motion(GRID), GRID)
    for level in rng.uniform(values.min(), values.max(), LEVELS):
        true = _passages(lambda t, level=level: dense(*motion(t), t) - level, direction)
        if true is None:
            counts.left_out += 1
            continue
        found = ns.simulate(system, [1.0, 0.0, 0.0], T_END, parameters={"h": level}, tol=tol)
        reached = np.array([e.t for e in found.events if e.kind == "reset"])
        counts.runs += 1
        counts.passages += len(true)
        if len(reached) != len(true) or found.x[-1, 2] != len(true):
            counts.wrong += 1
            print(f"seed {seed}, level {level!r}: {len(reached)} passages of {len(true)}")
        elif len(true):
            counts.worst = max(counts.worst, float(np.abs(reached - true).max()))


def main(shapes: int, seed: int = 0, tol: float = 1e-10) -> Counts:
    """Compare many guards and print the counts."""
    counts = Counts()
    for k in range(shapes):
        run(seed + k, counts, tol)
    print(counts)
    return counts


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])).wrong > 0)
