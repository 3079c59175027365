"""Common factors are found and cancelled, and the quotient is the same function elsewhere."""

import casadi as ca
import numpy as np
import pytest

from nonsmooth.model.expressions.cancel import cancel_common_factor

x, y, z, mu = (ca.SX.sym(s) for s in ("x", "y", "z", "mu"))
STATES = ca.vertcat(x, y, z)
N = x + 2 * y - 0.3

CASES = {
    "product of a sum": ([mu * N, 2.5 * mu * N, 3.5 * mu * N], N),
    "difference of two sums": ([(z - mu * N) - (z + mu * N), 2.5 * N], N),
    "power": ([N**2 * z, N * x], N),
    "quotient": ([N / z, N * y / z**2], N / z**2),
    "function as a factor": ([ca.exp(x) * y, ca.exp(x) * z], ca.exp(x)),
    "product of two sums": ([(x + y) * (y + z), (x + y) * (x - z)], x + y),
    "negative": ([-N * z, N], N),
    "zero among them": ([ca.SX(0), N * z], N * z),
}


def value(expression, point):
    return float(ca.Function("f", [STATES, mu], [expression])(point, 0.7))


@pytest.mark.parametrize("name", CASES)
def test_the_factor_is_found(name):
    expressions, factor = CASES[name]
    reduced, found = cancel_common_factor(expressions, STATES, mu)
    rng = np.random.default_rng(1)
    for point in rng.normal(size=(5, 3)):
        for e, r in zip(expressions, reduced, strict=True):
            assert value(found * r, point) == pytest.approx(value(e, point), rel=1e-13, abs=1e-13)
    # The factor found contains the expected one: their quotient stays bounded at its zeros.
    root = np.array([0.3 - 2 * 0.4, 0.4, 0.5])  # a zero of N; (x + y) is zero at the next
    for zero in (root, np.array([0.4, -0.4, 0.9])):
        if abs(value(factor, zero)) < 1e-15:
            assert abs(value(found, zero)) < 1e-15


def test_reduced_expressions_are_finite_where_the_factor_vanishes():
    (a, b), _ = cancel_common_factor([mu * N * z, 3.5 * mu * N], STATES, mu)
    point = [0.3, 0.0, 2.0]
    assert value(N, point) == 0.0
    assert value(a / b, point) == pytest.approx(2.0 / 3.5)


def test_nothing_in_common_is_left_alone():
    expressions = [x + y, y + z]
    reduced, factor = cancel_common_factor(expressions, STATES, mu)
    assert factor.is_one()
    assert all(ca.is_equal(a, b) for a, b in zip(reduced, expressions, strict=True))


def test_all_zero_is_left_alone():
    reduced, factor = cancel_common_factor([ca.SX(0), ca.SX(0)], STATES, mu)
    assert factor.is_one() and all(r.is_zero() for r in reduced)
