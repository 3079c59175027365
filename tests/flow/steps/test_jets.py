"""A jet is the Taylor series of the flow: it agrees with repeated Lie derivatives for every operation."""

import itertools
import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nonsmooth.flow.engine.smooth import SmoothProgram
from nonsmooth.model import NotSmoothError
from nonsmooth.model.expressions.float_arithmetic import BINARY, UNARY
from nonsmooth.model.expressions.graph import operation
from nonsmooth.model.printing.instructions import series_of, sparse_entries

x, y, p = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("p")
U = 0.45 + 0.3 * ca.sin(x) + 0.1 * y  # stays in (0.05, 0.85), inside every domain below

OPERATIONS = {
    "add": U + y,
    "sub": x - U,
    "mul": U * y,
    "div": y / U,
    "inv": 1 / U,
    "neg": -U,
    "twice": U + U,
    "sq": U**2,
    "cube": U**3,
    "inverse square": U**-2,
    "half-integer power": U**2.5,
    "parameter power": U**p,
    "moving power": U ** (1 + y),
    "number to a power": 2**U,
    "parameter to a power": p**U,
    "sqrt": ca.sqrt(U),
    "exp": ca.exp(U),
    "log": ca.log(U),
    "sin": ca.sin(U),
    "cos": ca.cos(U),
    "tan": ca.tan(U),
    "asin": ca.asin(U),
    "acos": ca.acos(U),
    "atan": ca.atan(U),
    "sinh": ca.sinh(U),
    "cosh": ca.cosh(U),
    "tanh": ca.tanh(U),
    "asinh": ca.asinh(U),
    "acosh": ca.acosh(1 + U),
    "atanh": ca.atanh(U),
    "atan2": ca.atan2(U, y - 1),
    "atan2, other branch": ca.atan2(-U, -y - 1),
    "erf": ca.erf(U),
    "erfinv": ca.erfinv(U),
    "log1p": ca.log1p(U),
    "expm1": ca.expm1(U),
    "hypot": ca.hypot(U, y),
    "non-smooth function of a parameter": ca.fabs(p) * U + ca.fmax(p, 1) * y,
}
FIELD = ca.vertcat(y + 0.2 * x * y, p - ca.sin(x))


def jets_of(field, function, states, constants, order):
    """A function of states and constants: series of the states and of a function along them."""
    series = series_of([states, constants], [field, function])
    none = sparse_entries(ca.SX(0, 0))[1]
    program = SmoothProgram(series, np.zeros(states.numel(), np.int32), order, none)
    return lambda at, p: program.terms(np.array(at, float), np.array(p, float))


def lie_series(function, field, states, order):
    """Coefficients by repeated symbolic differentiation: slow, and another method altogether."""
    values, f = [], function
    for k in range(order + 1):
        values.append(f / math.factorial(k))
        f = ca.jacobian(f, states) @ field
    return ca.horzcat(*values)


@pytest.mark.parametrize("order", [5, pytest.param(7, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", OPERATIONS)
def test_every_operation_agrees_with_repeated_lie_derivatives(name, order):
    function, states = OPERATIONS[name], ca.vertcat(x, y)
    slow = [lie_series(x, FIELD, states, order), lie_series(y, FIELD, states, order)]
    slow.append(lie_series(function, FIELD, states, order))
    expected = np.array(ca.Function("f", [states, p], [ca.vertcat(*slow)])([0.3, -0.4], 0.7))
    got = jets_of(FIELD, function, states, p, order)([0.3, -0.4], [0.7])
    assert np.all(np.isfinite(expected))
    rel = 1e-10 if name == "erfinv" else 1e-12  # CasADi's is less accurate
    np.testing.assert_allclose(got, expected, rtol=rel, atol=rel * np.abs(expected).max())


def test_natural_powers_are_regular_at_zero():
    jets = jets_of(ca.SX(1), x**3, x, ca.SX(0, 1), 5)
    assert jets([0.0], [])[1].tolist() == [0, 0, 0, 1, 0, 0]


def test_polynomials_end_in_zeros():
    assert np.count_nonzero(jets_of(ca.SX(2), x**2, x, ca.SX(0, 1), 6)([1.0], [])[1]) == 3


A, Z = ca.SX.sym("a", 2, 2), ca.SX.sym("z", 2)
LINEAR = jets_of(A @ Z, ca.dot(Z, Z), Z, ca.vec(A), 16)


@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6), st.floats(0.01, 0.2))
def test_series_sums_to_the_solution_of_a_linear_system(entries, t):
    """x' = A x has x(t) = expm(A t) x0; also for the quadratic function |x|^2 along it."""
    from scipy.linalg import expm

    a, x0 = np.array(entries[:4]).reshape(2, 2), np.array(entries[4:])
    *states, square = LINEAR(x0, a.ravel(order="F"))
    powers = t ** np.arange(17)
    exact = expm(a * t) @ x0
    np.testing.assert_allclose(np.array(states) @ powers, exact, atol=1e-14)
    np.testing.assert_allclose(square @ powers, exact @ exact, atol=1e-14)


def test_an_operation_without_a_recurrence_is_refused():
    with pytest.raises(NotSmoothError, match="recurrence"):
        jets_of(ca.floor(x), x, x, ca.SX(0, 1), 3)


def test_jets_are_those_of_the_expression_as_it_stands():
    """A contact force with shared factors, against repeated Lie derivatives."""
    states, (x, y, z), (p, q) = (
        (v := ca.SX.sym("v", 3)),
        ca.vertsplit(v),
        ca.vertsplit(c := ca.SX.sym("c", 2)),
    )
    force = -(2 * p * (1 + z**2) * (1 - y) * z) - q**2 * (1 - y) * x
    field = ca.vertcat(z, force, -y + p * force)
    required = ca.Function("f", [states, c], [lie_series(force, field, states, 6)])
    at = [0.3, -0.2, 0.7], [0.4, 0.9]
    got = jets_of(field, force, states, c, 6)(*at)[3]
    assert got == pytest.approx(np.array(required(*at)).ravel(), rel=1e-12, abs=1e-13)


SPECIAL = [0.0, 1.0, -1.0, 0.5, -2.5, 3.0, 1000.0, -1000.0, 1e308, math.inf, -math.inf, math.nan]


@pytest.mark.parametrize("op", [*UNARY, *BINARY])
def test_operations_have_the_values_of_casadi(op):
    """Where Python raises no error for an overflow, a pole or a missing value."""
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    given = [a] if op in UNARY else [a, b]
    evaluate, own = ca.Function("f", given, [operation(op, given)]), {**UNARY, **BINARY}[op]
    compared = 0
    for values in itertools.product(SPECIAL, repeat=len(given)):
        try:
            found = own(*values)
        except (OverflowError, ZeroDivisionError, ValueError):
            continue
        compared += 1
        rel = 1e-10 if op == "erfinv" else 1e-14  # CasADi's is less accurate
        assert found == pytest.approx(float(evaluate(*values)), rel=rel, abs=0, nan_ok=True), values
    assert compared > 2


def test_the_inverse_of_the_error_function_is_accurate():
    for y in (*np.linspace(-0.999, 0.999, 38), -1e-300, 1 - 2**-53, 1e-12 - 1):
        assert math.erf(UNARY["erfinv"](y)) == pytest.approx(y, rel=4e-16, abs=0)
