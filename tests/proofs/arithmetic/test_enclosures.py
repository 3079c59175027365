"""Values and derivatives of random expressions lie in their enclosures, and jumps are refused."""

import casadi as ca
import mpmath
import numpy as np
import pytest
from flint import arb

import nonsmooth as ns
from nonsmooth.proofs.arithmetic.instructions import ExpressionGraph, Program
from nonsmooth.proofs.arithmetic.interval_arrays import Intervals, evaluate_many
from nonsmooth.proofs.arithmetic.intervals import Enclosures, between, ends, exact, precision
from tests.proofs.random_graphs import Exact, Undefined, expression

DIGITS = 40


def program_of(f, symbols):
    """A program of an expression's value and gradient."""
    graph = ExpressionGraph()
    inputs = [graph.symbol(0, i) for i in range(len(symbols))]
    ((root,),) = graph.insert([f], [ca.vertcat(*symbols)], [inputs])
    return Program(graph, [[root], graph.gradient(root, inputs)])


def check_random_expressions(seed, graphs, samples):
    """Sample random boxes; return how many samples were compared."""
    rng, compared = np.random.default_rng(seed), 0
    symbols = [ca.SX.sym(s) for s in "xyz"]
    slack = mpmath.mpf(10) ** (8 - DIGITS)
    for _ in range(graphs):
        f = expression(rng, symbols)
        program = program_of(f, symbols)
        middle, half = rng.normal(size=3), 10.0 ** rng.uniform(-4, 0, size=3)
        low, high = middle - half, middle + half
        box = [between(exact(a), exact(b)) for a, b in zip(low, high, strict=True)]
        with precision(64):
            rows = program(Enclosures([box]))
        many = evaluate_many(
            program, [[Intervals(a, b) for a, b in zip(low, high, strict=True)]], "stored"
        )
        flat = [v for row in rows for v in row]
        arrays = [v for row in many for v in row]
        for point in low + rng.random((samples, 3)) * (high - low):
            point = np.clip(point, low, high)
            with mpmath.workdps(DIGITS):
                try:
                    reference = [
                        v for row in program(Exact(list(map(mpmath.mpf, point)))) for v in row
                    ]
                except Undefined:
                    continue
                compared += 1
                for value, enclosure, interval in zip(reference, flat, arrays, strict=True):
                    near = slack * (1 + abs(value))
                    assert interval.low - near <= value <= interval.high + near, f
                    if enclosure.is_finite() and enclosure.abs_upper() < 1e30:  # no gigabytes
                        a, b = (mpmath.mpf(v.numerator) / v.denominator for v in ends(enclosure))
                        assert a - near <= value <= b + near, f
    return compared


def test_random_samples_of_random_expressions_are_in_their_enclosures():
    assert check_random_expressions(seed=1, graphs=120, samples=5) > 150


@pytest.mark.slow
def test_a_hundred_thousand_random_samples_are_in_their_enclosures():
    assert check_random_expressions(seed=2, graphs=4_500, samples=30) > 100_000


def test_gradients_are_those_of_mpmath():
    rng, compared = np.random.default_rng(5), 0
    symbols = [ca.SX.sym(s) for s in "xyz"]
    for _ in range(60):
        f = expression(rng, symbols)
        program, point = program_of(f, symbols), rng.normal(size=3)

        def value(*p, program=program):
            return program(Exact(list(p)))[0][0]

        with mpmath.workdps(30):
            start = tuple(map(mpmath.mpf, point))
            try:
                gradient = program(Exact(list(start)))[1]
                numeric = [
                    mpmath.diff(value, start, tuple(np.eye(3, dtype=int)[i])) for i in range(3)
                ]
            except (Undefined, ValueError):
                continue
            compared += 1
            for a, b in zip(gradient, numeric, strict=True):
                assert abs(a - b) < 1e-8 * (1 + abs(a)), f
    assert compared > 15


def test_constants_are_not_folded():
    """CasADi's own derivative of 0.1*(0.3*x*x) is 0.06*x; the true one has the factor 2*0.1*0.3."""
    x = ca.SX.sym("x")
    program = program_of(0.1 * (0.3 * x * x), [x])
    with precision(200):
        ((_,), (slope,)) = program(Enclosures([[arb(1)]]))
        reference = 2 * exact(0.1) * exact(0.3)
        low, high = ends(slope)
    assert low <= reference <= high
    assert not low <= exact(0.06) <= high


def test_written_constants_are_decimals():
    x = ca.SX.sym("x")
    program = program_of(x - 0.1, [x])
    with precision(200):
        stored = program(Enclosures([[arb(0)]], "stored"))[0][0]
        decimal = program(Enclosures([[arb(0)]], "written"))[0][0]
    assert ends(stored) == (-exact(0.1),) * 2
    low, high = ends(decimal)
    assert low <= exact("-0.1") <= high and not low <= -exact(0.1) <= high


@pytest.mark.parametrize("op", ["sign", "floor", "ceil"])
def test_jumps_of_parameters_are_refused(op):
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    jump = getattr(ca, op)(p)
    s = ns.FilippovSystem([x], surface=x, above=[x + jump], below=[1 + x], parameters={p: 0.5})
    with pytest.raises(ns.NotSmoothError, match="jumps"):
        ns.prove_all(s, [(-1, 1)], "equilibrium")


@pytest.mark.parametrize(
    ("f", "box"),
    [
        (lambda x: ca.atan2(x, -1), (-1, 1)),
        (lambda x: ca.tan(x), (1, 2)),
        (lambda x: 1 / x, (-1, 1)),
        (lambda x: ca.sqrt(x), (-1, 1)),
        (lambda x: ca.log(x), (0, 1)),
        (lambda x: ca.asin(x), (0.5, 1.5)),
        (lambda x: x**0.5, (-1, 1)),
        (lambda x: x**-3, (-1, 1)),
    ],
)
def test_across_a_jump_or_a_pole_nothing_finite_is_returned(f, box):
    x = ca.SX.sym("x")
    program = program_of(f(x), [x])
    (value,), (slope,) = program(Enclosures([[between(*map(exact, box))]]))
    assert not (value.is_finite() and slope.is_finite())
    x = Intervals(np.float64(box[0]), np.float64(box[1]))
    (value,), (slope,) = evaluate_many(program, [[x]], "stored")
    assert not np.isfinite([value.low, value.high, slope.low, slope.high]).all()
