"""Sums of products as one rule are the rules that they join, exactly."""

from fractions import Fraction

import casadi as ca
import numpy as np
import pytest

from nonsmooth.model.expressions.graph import depends_on, instructions
from nonsmooth.model.expressions.sums import summed
from nonsmooth.model.expressions.taylor_rules import lower

ORDER = 4
x, y, p = (ca.SX.sym(s) for s in "xyp")


def convolved(u, v):
    return [sum(u[i] * v[k - i] for i in range(k + 1)) for k in range(ORDER)]


def series(rule, known, inputs):
    """Coefficients of a rule that is arithmetic, as fractions."""
    args, zero = [known[a] for a in rule.args], [Fraction(0)] * (ORDER - 1)
    number = lambda value: [Fraction(value), *zero]
    scaled = lambda factor, u: [Fraction(factor) * a for a in u]
    if rule.rule == "constant":
        return number(rule.numbers[0])
    if rule.rule == "input":
        return inputs[rule.source]
    if rule.rule == "sum":
        pairs = zip(rule.numbers, args[::2], args[1::2], strict=True)
        terms = [scaled(factor, convolved(u, v)) for factor, u, v in pairs]
        return [sum(own) for own in zip(*terms, strict=True)]
    if rule.rule == "apply":
        u, v = args[0][0], args[-1][0]
        found = {"twice": u + u, "add": u + v, "sub": u - v, "neg": -u, "mul": u * v, "sq": u * u}
        return number(found[rule.operation])
    if rule.rule == "affine":
        offset, factor = rule.numbers
        return [a + b for a, b in zip(scaled(factor, args[0]), number(offset), strict=True)]
    if rule.rule in ("add", "sub"):
        sign = 1 if rule.rule == "add" else -1
        return [a + sign * b for a, b in zip(*args, strict=True)]
    factor = {"neg": -1, "twice": 2}.get(rule.rule)
    return scaled(factor, args[0]) if factor else convolved(args[0], args[-1])


def values(rules, rows, inputs):
    known = []
    for rule in rules:
        known.append(series(rule, known, inputs))
    return [[known[j] for j in row] for row in rows]


def random_expression(rng, depth):
    """A tree of arithmetic in which subtrees are shared."""
    found = [x, y, p, ca.SX(float(rng.integers(-3, 4))), ca.SX(1.0)]
    for _ in range(depth):
        a, b = (found[rng.integers(len(found))] for _ in range(2))
        found.append([a + b, a - b, a * b, -a, 2 * a, a * a, 3 - a][rng.integers(7)])
    return found[-3:]


@pytest.mark.parametrize("seed", range(30))
def test_coefficients_are_equal(seed):
    rng = np.random.default_rng(seed)
    outputs = random_expression(rng, 14)
    nodes, rows = instructions([ca.vertcat(x, y), p], outputs)
    rules, number = lower(nodes, depends_on(nodes, [True, False]))
    rows = [[number[j] for j in row] for row in rows]
    draw = lambda: [Fraction(int(n), 7) for n in rng.integers(-9, 9, ORDER)]
    inputs = {(0, 0): draw(), (0, 1): draw(), (1, 0): [draw()[0], *[Fraction(0)] * (ORDER - 1)]}
    joined, new_rows = summed(rules, rows)
    assert values(joined, new_rows, inputs) == values(rules, rows, inputs)
    assert not {"add", "sub", "neg", "twice", "mul", "sq", "affine"} & {r.rule for r in joined}


def test_a_row_of_a_matrix_is_one_rule():
    states = ca.SX.sym("x", 30)
    rows = ca.DM(np.random.default_rng(0).normal(size=(30, 30))) @ ca.tanh(states) - states
    nodes, numbers = instructions([states, p], [rows])
    rules, number = lower(nodes, depends_on(nodes, [True, False]))
    joined, _ = summed(rules, [[number[j] for j in row] for row in numbers])
    assert sum(rule.rule == "sum" for rule in joined) == 60  # a row, and 1 - tanh^2, each
    assert max(len(rule.numbers) for rule in joined) == 31


def test_a_difference_that_is_subtracted_keeps_its_digits():
    """y - (x - p) is not (y - x) + p: what cancels inside does so before anything is added."""
    nodes, rows = instructions([ca.vertcat(x, y), p], [y - (x - p)])
    rules, number = lower(nodes, depends_on(nodes, [True, False]))
    joined, _ = summed(rules, [[number[j] for j in row] for row in rows])
    assert [len(rule.numbers) for rule in joined if rule.rule == "sum"] == [2, 2]
