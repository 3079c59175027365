"""The flow of a fixed duration is exact to rounding, of either sign."""

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

import nonsmooth as ns
from nonsmooth.flow import fixed
from nonsmooth.model.derivatives.variational import variational_field

x, y, k = (ca.SX.sym(name) for name in ("x", "y", "k"))
LINEAR = ns.FilippovSystem([x, y], field=[y, -k * x - 0.3 * y], parameters={k: 4.0})
PENDULUM = ns.FilippovSystem([x, y], field=[y, -k * ca.sin(x)], parameters={k: 1.0})


def integrated(system, start, duration):
    """The matrix (x, X, P) after a duration."""
    field, p = variational_field(system, "", (0,)), system.parameter_vector()
    end = fixed.flow_for(field, field.start(np.array(start)), p, duration)
    return field.matrix(end)


@pytest.mark.parametrize("duration", [0.0, 1e-9, 0.7, -0.7, 25.0])
def test_a_linear_field_has_the_exponential(duration):
    a = np.array([[0.0, 1.0], [-4.0, -0.3]])
    whole = integrated(LINEAR, [1.0, -0.5], duration)
    np.testing.assert_allclose(whole[:, 1:3], expm(a * duration), rtol=0, atol=1e-13)
    np.testing.assert_allclose(whole[:, 0], expm(a * duration) @ [1.0, -0.5], rtol=0, atol=1e-13)


def test_back_and_forth_and_the_area():
    there = integrated(PENDULUM, [0.5, 1.0], 3.0)
    back = integrated(PENDULUM, there[:, 0], -3.0)
    np.testing.assert_allclose(back[:, 0], [0.5, 1.0], rtol=0, atol=1e-14)
    assert np.linalg.det(there[:, 1:3]) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(back[:, 1:3] @ there[:, 1:3], np.eye(2), rtol=0, atol=1e-13)


def test_derivatives_by_a_parameter_are_those_of_rescaled_time():
    """x(t; k) = x(t sqrt(k); 1) with x' scaled: P follows from the field at the end."""
    whole = integrated(PENDULUM, [0.5, 0.0], 2.0)
    angle, rate = whole[:, 0]
    np.testing.assert_allclose(whole[:, 3], [rate, 0.5 * rate - np.sin(angle)], rtol=0, atol=1e-13)


@pytest.mark.parametrize("start", [[1e-265, 0.0], [0.0, -1e-300], [-1e-200, 1e-310]])
def test_what_rounding_leaves_of_zeros_is_no_scale(start):
    """x'' = t - 4 x from near rest at t = 0 has the motion t/4 - sin(2 t)/8 from rest."""
    t = ca.SX.sym("t")
    system = ns.FilippovSystem([x, y], field=[y, t - k * x], parameters={k: 4.0}, time=t)
    end = integrated(system, [*start, 0.0], 3.0)[:2, 0]
    exact = [3.0 / 4 - np.sin(6.0) / 8, (1 - np.cos(6.0)) / 4]
    np.testing.assert_allclose(end, exact, rtol=0, atol=1e-14)


def test_what_is_not_finite_is_refused():
    system = ns.FilippovSystem([x, y], field=[1, x**2 + y**2 + k], parameters={k: 0.0})
    with pytest.raises(ns.ConvergenceError, match="duration"):
        integrated(system, [0.0, 1.0], 5.0)


def test_derivatives_through_implicit_steps_of_a_flow():
    """The Brusselator far from its Hopf point; by differences of the flow."""
    system = ns.FilippovSystem(
        [x, y], field=[1 - k * x + x**2 * y, (k - 1) * x - x**2 * y], parameters={k: 10.0}
    )
    start, steps = np.array([0.174, 24.8]), 1e-5 * np.eye(2)
    for duration in (3.0, 5.0, 8.0):
        found = integrated(system, start, duration)[:, 1:3]
        two = [[integrated(system, start + s * d, duration)[:, 0] for s in (1, -1)] for d in steps]
        differences = np.transpose([(a - b) / 2e-5 for a, b in two])
        np.testing.assert_allclose(found, differences, rtol=0, atol=1e-6 * np.abs(found).max())
