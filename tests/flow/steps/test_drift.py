"""Sliding stays on a curved surface to rounding for 1e4 time units, at the speed of a closed form."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

LONG = 1e4


def circle(a):
    """Unit circle, attracting from both sides; the angle obeys th' = 1 + a cos th."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    turn = 1 + a * x
    return ns.FilippovSystem(
        [x, y],
        surface=x**2 + y**2 - 1,
        above=[-turn * y - x, turn * x - y],
        below=[-turn * y + 2 * x, turn * x + 2 * y],
    )


def angle(t, a):
    """Solution of th' = 1 + a cos th from 0: tan(th/2) = sqrt((1+a)/(1-a)) tan(w t/2)."""
    w = np.sqrt(1 - a**2)
    return 2 * np.arctan(np.sqrt((1 + a) / (1 - a)) * np.tan(w * t / 2))


@pytest.mark.slow
def test_circle():
    a = 0.4
    run = ns.simulate(circle(a), [1.0, 0.0], LONG, tol=1e-12)
    assert run.itinerary == "s" and run.status is ns.Status.REACHED_END
    assert np.max(np.abs(np.sum(run.x**2, axis=1) - 1)) < 1e-12
    t = np.linspace(0.0, LONG, 4001)
    x, th = run(t), angle(t, a)
    assert np.max(np.abs(np.sum(x**2, axis=1) - 1)) < 1e-11  # between steps: the tolerance
    late = np.abs(np.angle((x[:, 0] + 1j * x[:, 1]) * np.exp(-1j * th)))
    assert np.max(late) < 1e-9 and late[0] == 0.0


@pytest.mark.parametrize("long", [LONG / 10, pytest.param(LONG, marks=pytest.mark.slow)])
def test_sphere(long):
    """Rotation about a tilted axis on the unit sphere, pulled in and out with unequal strength."""
    x = ca.SX.sym("x", 3)
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    spin = ca.cross(ca.DM(axis), x)
    system = ns.FilippovSystem(
        ca.vertsplit(x),
        surface=ca.dot(x, x) - 1,
        above=ca.vertsplit(spin - x * (2 + x[0])),
        below=ca.vertsplit(spin + x * (1.5 + x[1])),
    )
    start = np.array([0.6, 0.0, 0.8])
    run = ns.simulate(system, start, long, tol=1e-12)
    assert run.itinerary == "s" and run.status is ns.Status.REACHED_END
    assert np.max(np.abs(np.sum(run.x**2, axis=1) - 1)) < 1e-12
    along = axis * (axis @ start)
    t = np.linspace(0.0, long, 1001)[:, None]
    exact = along + np.cos(t) * (start - along) + np.sin(t) * np.cross(axis, start)
    assert np.max(np.abs(run(t[:, 0]) - exact)) < 1e-9


def test_a_surface_that_moves():
    """h = y - sin(x) - t/100 with x' = 1; x is known, y follows."""
    x, y, t = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("t")
    system = ns.FilippovSystem(
        [x, y], surface=y - ca.sin(x) - t / 100, above=[1, -2], below=[1, 3], time=t
    )
    run = ns.simulate(system, [0.0, 0.0], 1e3, tol=1e-12)
    assert run.itinerary == "s"
    assert np.max(np.abs(run.x[:, 0] - run.t)) < 1e-10
    height = np.sin(run.x[:, 0]) + run.t / 100
    assert np.max(np.abs(run.x[:, 1] - height)) < 1e-12
