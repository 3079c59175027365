"""Exact tests of identities: CasADi expressions evaluated in rational arithmetic.

Two rational functions that agree at a random point of a large grid are equal but for a probability
of at most degree/(size of the grid) (Schwartz 1980, Zippel 1979). With points drawn from more than
1e6 values for each symbol and twelve points, a wrong identity of degree 20 passes with a
probability below 1e-50. Nothing is rounded: a coefficient of 1e-30 would be seen.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import casadi as ca

Expression = Any  # a CasADi SX scalar or a number
Given = Sequence[tuple[ca.SX, Expression]]

_OPERATIONS: dict[int, Callable[..., Fraction]] = {
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_ADD: lambda a, b: a + b,
    ca.OP_SUB: lambda a, b: a - b,
    ca.OP_MUL: lambda a, b: a * b,
    ca.OP_DIV: lambda a, b: a / b,
    ca.OP_NEG: lambda a: -a,
    ca.OP_SQ: lambda a: a * a,
    ca.OP_TWICE: lambda a: a + a,
    ca.OP_INV: lambda a: 1 / a,
    ca.OP_FABS: abs,
    ca.OP_POW: lambda a, b: _integer_power(a, b),
    ca.OP_CONSTPOW: lambda a, b: _integer_power(a, b),
}


def _integer_power(base: Fraction, exponent: Fraction) -> Fraction:
    if exponent.denominator != 1:
        raise ValueError(f"power {exponent}: expected an integer; roots are not rational.")
    return base ** int(exponent)


def constant(value: float) -> Fraction:
    """Return the short fraction that a float constant stands for (0.4 is 2/5), else its bits."""
    short = Fraction(value).limit_denominator(1000)
    return short if float(short) == value else Fraction(value)


def evaluate(expression: Expression, values: Mapping[str, Fraction]) -> Fraction:
    """Evaluate a rational expression exactly, given a fraction for each symbol's name."""
    expression = ca.densify(ca.SX(expression))
    symbols = ca.symvar(expression)
    function = ca.Function("exact", symbols, [expression])
    work: dict[int, Fraction] = {}
    result = Fraction(0)
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_CONST:
            work[target[0]] = constant(function.instruction_constant(k))
        elif operation == ca.OP_INPUT:
            work[target[0]] = values[symbols[source[0]].name()]
        elif operation == ca.OP_OUTPUT:
            result = work[source[0]]
        elif operation in _OPERATIONS:
            work[target[0]] = _OPERATIONS[operation](*(work[s] for s in source))
        else:
            raise ValueError(f"{expression}: expected a rational expression.")
    return result


def impose(expression: Expression, given: Given) -> ca.SX:
    """Substitute the ``(symbol, expression)`` pairs of ``given`` one after the other."""
    result = ca.SX(expression)
    for symbol, value in given:
        result = ca.substitute(result, symbol, value)
    return result


def identical(
    left: Expression, right: Expression = 0.0, *, given: Given = (), samples: int = 12
) -> bool:
    """Whether two rational expressions are equal as functions, under constraints solved for a symbol each."""
    difference = impose(ca.SX(left) - right, given)
    names = [s.name() for s in ca.symvar(difference)]
    generator = random.Random(2022)
    tested = 0
    while tested < samples:
        point = {
            n: Fraction(generator.randint(-(10**6), 10**6), generator.randint(1, 999))
            for n in names
        }
        try:
            if evaluate(difference, point) != 0:
                return False
        except ZeroDivisionError:
            continue
        tested += 1
    return True
