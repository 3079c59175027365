"""Legs integrated together equal those integrated one by one; extended precision gives more digits."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.engine import find_compiler
from nonsmooth.flow.fixed import flow_for
from nonsmooth.model.derivatives.variational import plain_field, states_at
from nonsmooth.orbit.runs import leg_integration
from nonsmooth.orbit.runs.guards import watch
from nonsmooth.orbit.runs.leg_integration import LegIntegrator
from nonsmooth.orbit.runs.legs import Leg

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

x, y, z, t, a, b, lam, other = (ca.SX.sym(s) for s in "x y z t a b lam other".split())

BELT = ns.FilippovSystem(
    [x, y],
    surface=y - a,
    above=[y, b * ca.cos(2 * t) - x - 1 + 0.1 * y**3],
    below=[y, b * ca.cos(2 * t) - x + 1 + 0.1 * y**3],
    time=t,
    parameters={a: 0.3, b: 0.5},
    resets=ns.Reset(x - 3, [x - 4, -y * b], 1, "wall"),
)
HIDDEN = ns.FilippovSystem(
    [x, y],
    surface=y,
    multipliers=lam,
    field=[1 + lam, a * x - 2 * lam + 0.3 * lam**2 * x],
    parameters={a: 0.5},
    hidden=True,
)
MIXED = [Leg("-", "entry", 0, -1), Leg("s", "exit", 0, 1), Leg("+", "reset", 0, -1), Leg("-")]


def test_legs_by_their_program_equal_those_by_their_modes():
    integrator, p = LegIntegrator(BELT, MIXED, (0,)), BELT.parameter_vector()
    starts = np.array([[0.2, 0.1, 0.4], [0.4, 0.3, 0.5], [1, 0.4, 2], [0, -0.5, 1]])
    given = starts, np.array([1, 0, -0.5, 2]), p
    both = integrator(*given), integrator._by_modes(*given)
    for name in leg_integration.LegFlows.__dataclass_fields__:
        one, two = (np.asarray(getattr(found, name)) for found in both)
        np.testing.assert_allclose(one, two, rtol=1e-12, atol=1e-13, err_msg=name)


@pytest.mark.parametrize("leg", [Leg("s"), Leg("s", "exit", 0, 1), Leg("+", "entry", 0, 1)])
def test_legs_of_hidden_dynamics(leg):
    """Ends are those of the flow with its multipliers as states, derivatives those of differences."""
    start, p = np.array([0.2, 0.0 if "s" in leg.mode else 0.1]), HIDDEN.parameter_vector()
    found = LegIntegrator(HIDDEN, [leg], (0,))(start[None], np.array([0.2]), p)
    field = plain_field(HIDDEN, leg.mode)

    def end(x, q):
        return flow_for(field, states_at(HIDDEN, leg.mode, x, q), q, 0.2)[:2]

    np.testing.assert_allclose(found.end[0], end(start, p), rtol=1e-13, atol=1e-14)
    by_x = (end(start + np.array([1e-6, 0]), p) - end(start - np.array([1e-6, 0]), p)) / 2e-6
    by_p = (end(start, p + 1e-6) - end(start, p - 1e-6)) / 2e-6
    np.testing.assert_allclose(found.by_start[0, :, 0], by_x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.by_parameters[0, :, 0], by_p, rtol=0, atol=1e-9)


def test_a_leg_that_fails_is_named():
    system = ns.FilippovSystem([x], surface=x - 9, above=[1], below=[x**2])
    legs = [Leg("-"), Leg("-", "crossing", 0, -1)]
    with pytest.raises(ns.ConvergenceError, match=r"leg 2 \(-, ended by h0\)"):
        LegIntegrator(system, legs)(np.array([[0.1], [1.0]]), np.array([1.0, 2.0]), np.zeros(0))


def test_residuals_have_more_digits_than_doubles():
    """x'' = -4 x, y' = x y from binary numbers, against the closed form with 40 digits."""
    system = ns.FilippovSystem([x, y, z], surface=x, above=[y, -4 * x, x * z], below=[1, 0, 0])
    start, duration = np.array([[0.75, 1.5, 1.25]]), np.array([0.875])
    found = LegIntegrator(system, [Leg("+", "crossing", 0, 1)]).ends(
        start, duration, np.zeros(0), extended=True
    )
    if found is None or np.finfo(np.longdouble).eps > 1e-18:
        pytest.skip("no extended precision on this machine")
    after, rest, value = found
    with mp.workdps(40):
        angle = 2 * mp.mpf(0.875)
        s, c = mp.sin(angle), mp.cos(angle)
        u = mp.mpf(0.75)
        area = (u * s + u * (1 - c)) / 2  # of x = u (cos 2t + sin 2t)
        end = [u * (c + s), 2 * u * (c - s), mp.mpf(1.25) * mp.exp(area)]
        errors = [
            abs(mp.mpf(float(after[0, i])) + mp.mpf(float(rest[0, i])) - end[i]) for i in range(3)
        ]
    assert max(errors) < 2e-18 and value[0] == float(end[0])


def test_extrema_of_a_guard_are_those_of_its_closed_form():
    """h = sin(3 t) + 1.1 along x = t: minima at t = pi/2, 7 pi/6, ... with h = 0.1."""
    system = ns.FilippovSystem([x, y], surface=ca.sin(3 * x) + 1.1, above=[1, 0], below=[1, 0])
    seen = watch(system, Leg("+"), np.array([0.0, 0.0]), 5.0, np.zeros(0))
    times = [near.t for near in seen.approaches]
    np.testing.assert_allclose(times, np.pi / 2 + 2 * np.pi / 3 * np.arange(2), rtol=1e-13)
    np.testing.assert_allclose([near.value for near in seen.approaches], 0.1, rtol=1e-13)
    assert not seen.violations
