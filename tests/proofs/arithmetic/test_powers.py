"""Natural powers enclose the exact ones in every arithmetic."""

import math
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
from flint import arb, arb_series

import nonsmooth as ns
from nonsmooth.proofs.arithmetic import interval_arrays, intervals, series
from nonsmooth.proofs.arithmetic.series import length

EXPONENTS = (0, 1, 2, 3, 7, 12)


@pytest.mark.parametrize("n", EXPONENTS)
def test_powers_of_numbers_are_exact(n):
    assert intervals.power(arb(-3), n) == (-3) ** n
    found = interval_arrays.power(interval_arrays.points(np.array([-3.0, 1.5])), n)
    low, high = found.low, found.high
    reference = np.array([-3.0, 1.5]) ** n  # doubles hold these exactly
    assert np.all((low <= reference) & (reference <= high))
    assert np.all(high - low <= 1e-12 * np.abs(reference))


@pytest.mark.parametrize("n", EXPONENTS)
def test_powers_of_intervals_hold_both_ends_and_their_middle(n):
    wide = intervals.power(arb(0, 2), n)  # [-2, 2]
    assert all(wide.contains(arb(v) ** n) for v in (-2, 0, 2))
    many = interval_arrays.power(interval_arrays.Intervals(np.array(-2.0), np.array(2.0)), n)
    for v in (-2.0, 0.0, 2.0):
        assert many.low <= v**n <= many.high


@pytest.mark.parametrize("n", EXPONENTS)
def test_powers_of_series_are_the_binomial_ones(n):
    with length(14):
        found = series.Series.power(arb_series([1, 1]), n)
        assert [found[k] for k in range(14)] == [math.comb(n, k) for k in range(14)]


def test_a_high_power_of_a_state_has_its_value_and_gradient_in_the_proof():
    """CasADi multiplies powers up to 100 out and keeps higher ones: (1/2)^101 and 101 (1/2)^100."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    system = ns.FilippovSystem([x, y], surface=y + 9, above=[1 - 2 * x, x**101 - y], below=[0, 1])
    proof = ns.certify(ns.find_equilibrium(system, [0.4, 0.1]), system=system, width=1e-40)
    assert proof.label == "real stable node"
    assert Fraction(1, 2**101) in proof.point["y"]
    below = ns.FilippovSystem([x, y], surface=y + 9, above=[x**-101 - 1, -y], below=[0, 1])
    proof = ns.certify(ns.find_equilibrium(below, [1.001, 0.1]), system=below)
    assert Fraction(-101) in proof.values["eigenvalue1"]
