"""Periods of a forced system: positive numbers, or functions of its parameters."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import casadi as ca
import numpy as np

from ..checks import is_real
from ..definition.system import FilippovSystem
from ..errors import OptionError
from ..laws.evaluators import Evaluator
from ..values import Array


def is_function(value: Any) -> bool:
    """Whether a value is one scalar expression."""
    return isinstance(value, ca.SX) and bool(value.is_scalar())


def read_period(system: FilippovSystem, value: Any) -> float | str | None:
    """Read a number, or an expression in parameters as a serialised function."""
    if is_real(value):
        return float(periods(float(value), np.zeros(0)))
    if not is_function(value):
        return None
    try:
        return str(ca.Function("period", [system.parameter_symbols], [value]).serialize())
    except RuntimeError:  # of other symbols
        return None


def periods(period: float | str, p: Array) -> Array:
    """Periods () or (m,) of parameters (np,) or (m, np); NaN where a parameter is."""
    values: Array = np.asarray(period if isinstance(period, float) else np.nan)
    if isinstance(period, str):
        found = np.array(ca.Function.deserialize(period)(p.T), float)
        values = found.reshape(p.shape[:-1])
    bad = values[np.isinf(values) | (values <= 0.0)]
    if bad.size:
        raise OptionError(f"period: expected a positive number, received {bad.flat[0]}.")
    return values


class Forcing:
    """The period of a system as a function of its parameters; ``found`` if the system gave it."""

    def __init__(self, system: FilippovSystem, period: ca.SX | float, found: bool = False):
        self.found, self._system = found, system
        if not is_real(period) and read_period(system, period) is None:
            raise OptionError(
                "period: expected a number, or an expression in the parameters "
                f"{list(system.parameter_names)}, received {period!r}. Give period=2*pi/w."
            )
        self.expression = ca.SX(period)
        p = system.parameter_symbols
        slope = ca.jacobian(self.expression, p)
        self._constant = bool(slope.nnz() == 0)
        self._last: tuple[float, Array] | None = None
        outputs = [ca.densify(e) for e in (self.expression, slope)]
        self._function = Evaluator(ca.Function("period", [ca.SX(0, 1), p], outputs))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled with its system, as a function of the parameters."""
        function = ca.Function("period", [self._system.parameter_symbols], [self.expression])
        return _restored, (self._system, function.serialize(), self.found)

    def __call__(self, p: Array) -> tuple[float, Array]:
        """The period, and its derivatives by all parameters."""
        if self._last is None or not self._constant:
            value, slope = self._function.copied(np.zeros(0), p)
            self._last = float(value[0, 0]), slope[0]
        return self._last


def _restored(system: FilippovSystem, text: str, found: bool) -> Forcing:
    period = ca.Function.deserialize(text)
    return Forcing(system, period(system.parameter_symbols), found)


def frequencies(system: FilippovSystem) -> list[ca.SX]:
    """Frequencies of the sines and cosines of the time, each once."""
    if not system.time_dependent:
        return []
    d = system.definition
    expressions = [d.field, d.surfaces, d.guards, d.maps, d.gaps]
    found: list[ca.SX] = []
    seen: set[int] = set()
    stack = [e for block in expressions for e in ca.vertsplit(ca.densify(ca.vec(block)))]
    while stack:
        node = stack.pop()
        if node.element_hash() in seen:
            continue
        seen.add(node.element_hash())
        if node.is_leaf():
            continue
        if node.op() in (ca.OP_SIN, ca.OP_COS):
            rate = ca.simplify(ca.jacobian(node.dep(0), d.time))
            if not rate.is_zero() and not ca.depends_on(rate, system.extended_states):
                if not any(ca.is_equal(rate, other, 10) for other in found):
                    found.append(rate)
        stack += [node.dep(k) for k in range(node.n_dep())]
    return found


#: Largest ratio of two frequencies, and largest denominator of it, that have a common period.
_LARGEST = 64


def common_frequency(found: list[ca.SX]) -> ca.SX | None:
    """The frequency of which some others are whole multiples, whatever the parameters; None if there is none."""
    if not found:
        return None
    parts = list[Fraction]()
    for rate in found:
        ratio = ca.simplify(rate / found[0])
        value = float(ca.DM(ratio)) if ratio.is_constant() else math.nan
        near = Fraction(value).limit_denominator(_LARGEST) if math.isfinite(value) else Fraction(0)
        if not near or abs(near) > _LARGEST or abs(float(near) - value) > _EXACT * abs(value):
            return None
        parts.append(abs(near))
    denominator = math.lcm(*(part.denominator for part in parts))
    return found[0] * math.gcd(*(int(part * denominator) for part in parts)) / denominator


#: Relative difference of a ratio of frequencies from a rational number that is rounding.
_EXACT = 1e-13


def clock_periods(system: FilippovSystem, clock: int, p: Array) -> Array:
    """Periods of a clock for parameters (np,) or (m, np)."""
    read = lambda: read_period(system, system.definition.periods[clock])
    period = system.cached(("period of clock", clock), read)
    assert period is not None  # the definition refuses one that depends on states
    return periods(period, p)
