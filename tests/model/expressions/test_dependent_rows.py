"""A row is called dependent only if it is a combination of others for every parameter."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.engine import find_compiler
from nonsmooth.model.expressions.cancel import in_span

x, y, z, p = (ca.SX.sym(name) for name in "xyzp")
STATES = ca.vertcat(x, y, z)
PULSE = ca.exp(-(((x - 0.503) / 3e-2) ** 2))  # its integral is 0.03 sqrt(pi)


def test_combinations_are_seen_and_nothing_else():
    rows = [p * x * y + x, ca.sin(y)]
    functions = [x * y - 2 * p * ca.sin(y) + 1, x**2, p**2 * ca.sin(y) + z]
    assert in_span(functions, rows, STATES, p) == [True, False, True]


@pytest.mark.parametrize(
    "factor", [ca.floor(p / 2), ca.fmax(p, 1.9) - 1.9, ca.if_else(p > 1.8, 1, 0)]
)
def test_a_coefficient_may_vanish_for_some_parameters_only(factor):
    assert in_span([ca.sin(x) + factor * PULSE], [ca.sin(x)], STATES, p) == [False]


@pytest.mark.parametrize("factor", [ca.acosh(p - 2), ca.log(-p), 1 / (p - p)])
def test_a_coefficient_may_have_no_value_for_some_parameters(factor):
    rows = [ca.sin(x), factor * ca.cos(x)]
    assert in_span([2 * ca.sin(x), factor * ca.sin(x)], rows, STATES, p) == [True, False]


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
@pytest.mark.parametrize("factor", [ca.floor(p / 2), ca.acosh(p - 1) / np.arccosh(1.5)])
def test_lanes_see_a_pulse_that_a_parameter_turns_on(factor):
    """The parameter is 2.5; for the values that are drawn to look at the rows there is no pulse."""
    system = ns.FilippovSystem(
        [x, y, z], field=[1, ca.sin(x), ca.sin(x) + factor * PULSE], parameters={p: 2.5}
    )
    many = ns.ensemble(system, np.zeros((64, 3)), 1.0)
    exact = 1 - np.cos(1.0) + 0.03 * np.sqrt(np.pi)
    np.testing.assert_allclose(many.x, np.tile([1.0, 1 - np.cos(1.0), exact], (64, 1)), atol=1e-9)
