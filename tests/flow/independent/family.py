"""A family of random systems with one to three curved surfaces in two to five dimensions.

    x' = A x + b + C sin(B x + c) - x |x|^2 / 20 + r / (1 + (q.x)^2) + u cos(omega t + phi)
         + sum_i lambda_i (g_i + G_i x),        h_i = w_i.x + (k_i.x)^2 / 4 + sin(v_i.x) / 4 - d_i

The same numbers are given to CasADi, as parameters of one system for each size, and to arrays that hold
many systems at once (``arrays``). Systems with fewer states and surfaces are padded there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

import nonsmooth as ns

STATES, SURFACES = 5, 3

#: Coefficients of a system by their shapes in states (n) and surfaces (m).
SHAPES = {
    "A": "nn",
    "b": "n",
    "C": "nn",
    "B": "nn",
    "c": "n",
    "r": "n",
    "q": "n",
    "u": "n",
    "omega": "",
    "phi": "",
    "g": "mn",
    "G": "mnn",
    "w": "mn",
    "k": "mn",
    "v": "mn",
    "d": "m",
}


@dataclass(frozen=True)
class Size:
    """Number of states and of surfaces."""

    n: int
    m: int

    def shape(self, name: str) -> tuple[int, ...]:
        """Shape of a coefficient."""
        return tuple({"n": self.n, "m": self.m}[letter] for letter in SHAPES[name])


def draw(size: Size, rng: np.random.Generator) -> dict[str, Any]:
    """Draw the coefficients of a system and its start ``x0``, which is on no surface."""
    n = size.n
    found = {name: rng.normal(size=size.shape(name)) for name in SHAPES}
    found["A"] = 0.6 * found["A"] - 0.4 * np.eye(n)
    found["omega"] = rng.uniform(0.5, 3.0)
    found["k"], found["v"], found["G"] = 0.5 * found["k"], 0.7 * found["v"], 0.2 * found["G"]
    found["w"] /= np.linalg.norm(found["w"], axis=1, keepdims=True)
    # Most surfaces attract, some are crossed.
    pull = rng.uniform(-0.3, 2.5, size.m)
    found["g"] = rng.uniform(0.2, 1.2) * found["g"] - pull[:, None] * found["w"]
    found["d"] = 0.4 * found["d"]
    while True:
        x = found["x0"] = rng.normal(size=n)
        h = found["w"] @ x + (found["k"] @ x) ** 2 / 4 + np.sin(found["v"] @ x) / 4 - found["d"]
        if np.all(np.abs(h) > 0.05):
            return found


def system(size: Size) -> ns.FilippovSystem:
    """Return the system of one size, with the coefficients as parameters."""
    n, m = size.n, size.m
    symbols: dict[str, ca.SX] = {}
    parameters = []
    for name in SHAPES:
        shape = size.shape(name)
        flat = ca.SX.sym(name, int(np.prod(shape)))
        parameters += ca.vertsplit(flat)
        symbols[name] = flat
    x, lam, t = ca.SX.sym("x", n), ca.SX.sym("lambda", m), ca.SX.sym("t")

    def matrix(name: str, first: int = 0) -> ca.SX:
        return ca.reshape(symbols[name][first : first + n * n], n, n).T

    def row(name: str, i: int) -> ca.SX:
        return symbols[name][i * n : (i + 1) * n]

    c = symbols
    field = matrix("A") @ x + c["b"] + matrix("C") @ ca.sin(matrix("B") @ x + c["c"])
    field += -x * ca.sumsqr(x) / 20 + c["r"] / (1 + ca.dot(c["q"], x) ** 2)
    field += c["u"] * ca.cos(c["omega"] * t + c["phi"])
    surfaces = []
    for i in range(m):
        field += lam[i] * (row("g", i) + matrix("G", i * n * n) @ x)
        h = ca.dot(row("w", i), x) + ca.dot(row("k", i), x) ** 2 / 4
        surfaces.append(h + ca.sin(ca.dot(row("v", i), x)) / 4 - c["d"][i])
    return ns.FilippovSystem(
        ca.vertsplit(x),
        field=ca.vertsplit(field),
        surfaces=surfaces,
        multipliers=ca.vertsplit(lam),
        parameters=parameters,
        time=t,
    )


def values(drawn: dict[str, Any]) -> np.ndarray:
    """Values of the parameters of ``system``, in their order."""
    return np.concatenate([np.ravel(drawn[name]) for name in SHAPES])


class Many:
    """Fields and surfaces of many systems at once, in extended precision.

    Parameters
    ----------
    drawn : list of dict
        As ``draw`` returns them; sizes may differ.
    """

    def __init__(self, drawn: list[dict[str, Any]]):
        self.count = len(drawn)
        sizes = {"n": STATES, "m": SURFACES}
        self._c = {}
        for name, letters in SHAPES.items():
            padded = np.zeros((self.count, *[sizes[letter] for letter in letters]), np.longdouble)
            for s, one in enumerate(drawn):
                value = np.asarray(one[name], float)
                padded[(s, *[slice(k) for k in value.shape])] = value
            self._c[name] = padded
        self.x0 = np.zeros((self.count, STATES), np.longdouble)
        for s, one in enumerate(drawn):
            self.x0[s, : one["x0"].size] = one["x0"]
            self._c["d"][s, one["d"].size :] = -1.0  # surfaces that are not there: h = 1
        self.n = np.array([one["x0"].size for one in drawn])
        self.m = np.array([one["d"].size for one in drawn])

    def part(self, chosen: np.ndarray) -> Many:
        """Return some of the systems."""
        other = object.__new__(Many)
        other._c = {name: value[chosen] for name, value in self._c.items()}
        other.x0, other.n, other.m = self.x0[chosen], self.n[chosen], self.m[chosen]
        other.count = len(other.n)
        return other

    def field(self, x: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Field without multipliers (S, n), and what multiplies them (S, m, n)."""
        c = self._c
        waves = np.sin(_times(c["B"], x) + c["c"])
        f = _times(c["A"], x) + c["b"] + _times(c["C"], waves)
        f -= x * (x * x).sum(axis=1)[:, None] / 20
        f += c["r"] / (1 + (c["q"] * x).sum(axis=1)[:, None] ** 2)
        f += c["u"] * np.cos(c["omega"] * t + c["phi"])[:, None]
        return f, c["g"] + np.einsum("smij,sj->smi", c["G"], x)

    def surfaces(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values h (S, m) and gradients (S, m, n)."""
        c = self._c
        bent, phase = _times(c["k"], x), _times(c["v"], x)
        h = _times(c["w"], x) + bent**2 / 4 + np.sin(phase) / 4 - c["d"]
        gradient = c["w"] + (bent / 2)[:, :, None] * c["k"]
        return h, gradient + (np.cos(phase) / 4)[:, :, None] * c["v"]


def _times(matrix: np.ndarray, x: np.ndarray) -> np.ndarray:
    return (matrix * x[:, None, :]).sum(axis=2)
