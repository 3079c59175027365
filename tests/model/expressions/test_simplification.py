"""Rewritten expressions are the same functions and never need more convolutions in a jet."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nonsmooth.model.expressions.graph import depends_on, instructions
from nonsmooth.model.expressions.simplification import simplified

x, y, z, p, q = (ca.SX.sym(s) for s in "xyzpq")
STATES, CONSTANTS = ca.vertcat(x, y, z), ca.vertcat(p, q)


def convolutions(expressions):
    """Half-convolutions: a product of two functions of the states counts 2, a square 1."""
    nodes, _ = instructions([STATES, CONSTANTS], expressions)
    moving = depends_on(nodes, [True, False])
    products = [n for n in nodes if n.op in ("mul", "sq") and all(moving[a] for a in n.args)]
    return sum(1 if n.op == "sq" else 2 for n in products)


def rewrite(*expressions):
    return simplified([STATES, CONSTANTS], expressions, [True, False])


CASES = {
    "common factor": ([p * x * y - 2 * x * z], 2),
    "common factor with a square": ([x**2 + x * y], 2),
    "common factor of three": ([x * y + p * x * z + x * y * z], 4),
    "common factor of a sum": ([p * (1 - y) * z + q * ((1 - y) * x)], 2),
    "two common factors": ([x * y + x * z + p * (1 + x) * y + q * z * (1 + x)], 4),
    "inside a function": ([ca.sin(x * y + x * z) * y], 4),
    "sums that share their products": (
        [2 * y + p * x * y + q * x * z, z - p * x * y - q * x * z],
        2,
    ),
    "squares are kept": ([x * y * y], 3),
    "equal on both sides": ([(1 + z) / 2 * (x * y - x + 2) + (1 - z) / 2 * (x * y - x - 2)], 2),
    "of another sign on the sides": ([(1 + z) / 2 * (x + p * y) - (1 - z) / 2 * (p * y - x)], 2),
    "a multiple on one side": ([(1 + z) / 2 * (3 * x) + (1 - z) / 2 * x], 2),
    "on one side": ([(1 + z) / 2 * (x + y) + (1 - z) / 2 * (x + 1e9 / 3)], 2),
    "what is shared stays shared": ([x * y + x * z, x * y - x * z], 4),
    "shared under a coefficient": ([p * (x * z) * y, 2 * (x * z) + 1], 4),
    "a square of a product": ([(x * y) ** 2 * z + 1], 5),
    "nothing left": ([x * y - y * x], 0),
    "constants alone": ([p * q + ca.sin(p)], 0),
}


@pytest.mark.parametrize("name", CASES)
def test_products_are_saved(name):
    expressions, expected = CASES[name]
    after = rewrite(*expressions)
    assert convolutions(after) == expected <= convolutions(expressions)
    assert_same(expressions, after)


def assert_same(before, after):
    both = ca.Function("f", [STATES, CONSTANTS], [ca.vertcat(*before), ca.vertcat(*after)])
    rng = np.random.default_rng(3)
    for _ in range(5):
        a, b = both(rng.uniform(0.5, 1.5, 3), rng.uniform(0.5, 1.5, 2))
        scale = 1.0 + np.abs(np.array(a))
        assert np.all(np.abs(np.array(a - b)) < 1e-12 * scale)


def graph(seed):
    """A few outputs of a random graph of sums, products and functions with shared nodes."""
    rng = np.random.default_rng(seed)
    nodes = [ca.SX(0.5), ca.SX(-2.0), p, q, *3 * [x, y, z]]
    for _ in range(rng.integers(6, 25)):
        a, b = nodes[-rng.integers(1, 8)], nodes[rng.integers(len(nodes))]
        choices = [a + b, a - b, 2 * a, a * b, a * b, a * a, a / (1 + p * p), ca.sin(a)]
        nodes.append(choices[rng.integers(len(choices))])
    return [nodes[-1 - k] for k in rng.integers(0, 6, rng.integers(1, 4))]


@given(st.integers(0, 2**32 - 1))
def test_random_graphs_keep_their_values_and_cost_no_more(seed):
    expressions = graph(seed)
    after = rewrite(*expressions)
    assert convolutions(after) <= convolutions(expressions)
    both = ca.Function("f", [STATES, CONSTANTS], [ca.vertcat(*expressions), ca.vertcat(*after)])
    a, b = (np.array(v) for v in both([0.31, -0.83, 0.57], [0.71, -0.42]))
    assert np.allclose(a, b, rtol=1e-9, atol=1e-9)


def test_shapes_are_kept():
    (a, b) = rewrite(ca.reshape(ca.vertcat(x, x * y, p, 0), 2, 2), ca.SX(0, 1))
    assert a.shape == (2, 2) and b.shape == (0, 1)


@pytest.mark.slow
def test_deep_graphs():
    """A thousand nested products and functions: no recursion over them."""
    deep = x
    for _ in range(1000):
        deep = ca.sin(0.9 * (deep * y + 0.5) * z + deep)
    assert_same([deep], rewrite(deep))


@pytest.mark.parametrize("unit", [1e9, 1e-9])
@pytest.mark.parametrize("power", [17, 36, 40])
@pytest.mark.parametrize("named", [False, True])
def test_coefficients_do_not_leave_the_range_of_doubles(unit, power, named):
    """(x/unit)^power near x = unit is near one, though unit^power is no double."""
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    scale = p if named else unit
    (rewritten,) = simplified([x, p], [(x / scale) ** power], [True, False])
    value = ca.Function("f", [x, p], [rewritten])(1.01 * unit, unit)
    assert float(value) == pytest.approx(1.01**power, rel=1e-13)
