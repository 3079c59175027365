"""A function called with numbers gives CasADi's own bits, at one point or at many, from any thread."""

from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

from nonsmooth.model import call

x, p = ca.SX.sym("x", 5), ca.SX.sym("p", 6)
FUNCTION = ca.Function("f", [x, p], [ca.sin(x) * p[0], ca.sumsqr(x) * p[1], x @ p.T])


def by_casadi(function, *values):
    return [np.array(v) for v in function.call(list(values))]


def same(found, expected):
    return all(
        a.shape == b.shape and np.array_equal(a, b) for a, b in zip(found, expected, strict=True)
    )


@pytest.mark.parametrize("count", [1, 3, 127, 128, 1024, 1025, 2500])
def test_bits_and_shapes_are_those_of_casadi(count):
    rng = np.random.default_rng(count)
    many, each = rng.normal(size=(5, count)), rng.normal(size=(6, count))
    for parameters in (each, each[:, :1], each[:, 0]):
        assert same(call(FUNCTION, many, parameters), by_casadi(FUNCTION, many, parameters))


@pytest.mark.parametrize("count", [3, 300])
def test_no_parameters_sparse_results_and_matrices_as_inputs(count):
    points = np.random.default_rng(0).normal(size=(5, count))
    bare = ca.Function("bare", [x, ca.SX.sym("none", 0, 1)], [x, ca.SX(0, 1)])
    assert same(call(bare, points, np.zeros(0)), by_casadi(bare, points, np.zeros(0)))
    sparse = ca.Function("sparse", [x], [ca.diag(x)])
    assert same(call(sparse, points), by_casadi(sparse, points))


def test_threads_do_not_disturb_each_other():
    rng = np.random.default_rng(1)
    points = [rng.normal(size=(5, 1500)) for _ in range(8)]
    parameters = rng.normal(size=6)
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda v: call(FUNCTION, v, parameters), points))
    assert all(
        same(one, by_casadi(FUNCTION, v, parameters)) for one, v in zip(found, points, strict=True)
    )
