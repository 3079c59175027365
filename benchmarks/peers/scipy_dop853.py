"""SciPy: solve_ivp with DOP853 and terminal events, one call for each mode of each trajectory.

Right-hand sides are plain Python floats, which is what ``sympy.lambdify`` gives and is faster here
than arrays; with numba they are compiled, events too.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from ..problems import DECIDE, PLUS, SLIDING, STOP, T_MAX, Array, Problem, bounce
from ..reference import Ends
from . import NUDGE


def available() -> bool:
    """SciPy is a dependency of the library."""
    return True


def numba_available() -> bool:
    """Whether numba is installed."""
    return importlib.util.find_spec("numba") is not None


class Scipy:
    """One solve_ivp per mode."""

    def __init__(self, problem: Problem, rtol: float, atol: float, numba: bool = False):
        self.problem, self.rtol, self.atol = problem, rtol, atol
        compiled = _numba_functions(problem) if numba else None
        self.fields: list[Callable[..., Any]] = []
        self.events: list[list[Any]] = []
        for mode in range(3):
            if compiled is not None:
                field, values = compiled[mode]
            else:
                field = _field(problem.fields[mode])
                values = [_value(g.value) for g in problem.guards[mode]]
            self.fields.append(field)
            self.events.append([_terminal(v) for v in values])

    def solve(self, starts: Array, t_end: float = T_MAX) -> Ends:
        """Run every start to its stop, or to ``t_end``."""
        ends = [self._one(x, t_end) for x in starts]
        return Ends(
            np.array([e[0] for e in ends]),
            np.array([e[1] for e in ends]),
            np.array([e[2] for e in ends]),
        )

    def _one(self, x: Array, t_end: float) -> tuple[float, Array, int]:
        problem = self.problem
        mode = problem.first_mode(x.tolist())
        code, t = mode + 1, 0.0
        while True:
            run = solve_ivp(
                self.fields[mode],
                (t, t_end),
                x,
                method="DOP853",
                rtol=self.rtol,
                atol=self.atol,
                events=self.events[mode],
            )
            t, x = run.t[-1], run.y[:, -1].copy()
            if run.status != 1:
                return t, x, code
            hit = next(j for j, times in enumerate(run.t_events) if len(times))
            goes_to = problem.guards[mode][hit].goes_to
            if goes_to == STOP:
                return t, x, code
            x[problem.free] -= problem.surface(*x)
            mode = problem.decide(x.tolist(), mode) if goes_to == DECIDE else goes_to
            code = (4 * code + mode + 1) & 0x3FFFFFFFFFFFFFFF
            if mode != SLIDING:
                x[problem.free] += NUDGE if mode == PLUS else -NUDGE


def _field(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda t, x: function(*x.tolist())


def _value(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda t, x: function(*x.tolist())


def _terminal(value: Callable[..., Any]) -> Any:
    def event(t: float, x: Array) -> Any:
        return value(t, x)

    event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
    return event


class _Text:
    """A symbol whose arithmetic is its own source text: the formulas printed as Python."""

    def __init__(self, text: str):
        self.text = text

    def _with(self, operator: str, other: Any, swap: bool = False) -> _Text:
        right = other.text if isinstance(other, _Text) else repr(other)
        pair = (right, self.text) if swap else (self.text, right)
        return _Text(f"({pair[0]} {operator} {pair[1]})")

    __add__ = lambda self, other: self._with("+", other)
    __sub__ = lambda self, other: self._with("-", other)
    __mul__ = lambda self, other: self._with("*", other)
    __radd__ = lambda self, other: self._with("+", other, swap=True)
    __rsub__ = lambda self, other: self._with("-", other, swap=True)
    __rmul__ = lambda self, other: self._with("*", other, swap=True)
    __neg__ = lambda self: _Text(f"(-{self.text})")


def _jit(outputs: list[Any], dimension: int, scalar: bool) -> Any:
    import numba

    texts = [o.text if isinstance(o, _Text) else repr(float(o)) for o in outputs]
    lines = [f"    y{i} = y[{i}]" for i in range(dimension)]
    if scalar:
        lines.append(f"    return {texts[0]}")
    else:
        lines.append(f"    out = np.empty({len(texts)})")
        lines += [f"    out[{i}] = {text}" for i, text in enumerate(texts)]
        lines.append("    return out")
    space: dict[str, Any] = {"np": np}
    exec("\n".join(["def f(t, y):", *lines]), space)
    return numba.njit(space["f"])


def _numba_functions(problem: Problem) -> list[tuple[Any, list[Any]]]:
    """Fields and guards of the three modes, compiled."""
    n = problem.dimension
    symbols = [_Text(f"y{i}") for i in range(n)]
    return [
        (
            _jit(list(field(*symbols)), n, scalar=False),
            [_jit([g.value(*symbols)], n, scalar=True) for g in guards],
        )
        for field, guards in zip(problem.fields, problem.guards, strict=True)
    ]


def make(name: str, tolerance: float, numba: bool = False) -> Callable[[Array], Ends]:
    """Solver of a bounce; the tolerance is relative, the absolute one a hundredth of it."""
    return Scipy(bounce(name), tolerance, 1e-2 * tolerance, numba).solve
