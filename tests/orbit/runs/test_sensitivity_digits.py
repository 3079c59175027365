"""Derivatives through an entry, an exit, a clock, a wall that moves and a stop have the digits of closed
forms that are differentiated with 40 digits, by start, by parameters, and of the times."""

from __future__ import annotations

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import nonsmooth as ns

START = {"x": 0.0, "v": 0.5}
VALUES = {"a": 0.8, "mu": 1.0, "k": 0.3, "L": 0.9, "c": 0.05, "r": 0.7, "T": 1.6, "e": 1.03}


def pushed_block() -> ns.FilippovSystem:
    """A block that slides, rests, is pushed off, kicked by a clock and thrown back by a moving wall."""
    x, v, t = (ca.SX.sym(s) for s in "xvt")
    p = {name: ca.SX.sym(name) for name in VALUES}
    push, mu, c = p["a"] * t, p["mu"], p["c"]
    return ns.FilippovSystem(
        [x, v],
        surface=v,
        above=[v, push - mu],
        below=[v, push + mu],
        time=t,
        parameters={p[name]: value for name, value in VALUES.items()},
        clocks=ns.Clock(p["T"], map=[x, v + p["k"]]),
        resets=ns.Reset(x - p["L"] - c * t, [x, c - p["r"] * (v - c)], 1, "wall"),
        stops=ns.Stop(x - p["e"], -1),
    )


def closed_form(x0, v0, a, mu, k, L, c, r, T, e):
    """Speed at the stop and all event times, in mpmath."""

    def moved(x, v, t, s, sign):
        d = s - t
        speed = v + a * (s**2 - t**2) / 2 - sign * mu * d
        place = x + v * d + a * (s**3 - t**3) / 6 - a * t**2 * d / 2 - sign * mu * d**2 / 2
        return place, speed

    entry = (mu - mp.sqrt(mu**2 - 2 * a * v0)) / a
    rest = moved(x0, v0, mp.mpf(0), entry, 1)[0]
    leaves = mu / a
    place, speed = moved(rest, mp.mpf(0), leaves, T, 1)
    speed += k
    wall = mp.findroot(lambda s: moved(place, speed, T, s, 1)[0] - L - c * s, 2.83)
    place, speed = moved(place, speed, T, wall, 1)
    speed = c - r * (speed - c)
    stop = mp.findroot(lambda s: moved(place, speed, wall, s, -1)[0] - e, wall + 0.06)
    return moved(place, speed, wall, stop, -1)[1], [entry, leaves, T, wall, stop]


@pytest.fixture(scope="module")
def exact():
    """Values and derivatives of the speed at the stop and of the times, by start and parameters."""
    with mp.workdps(40):
        given = [mp.mpf(value) for value in (*START.values(), *VALUES.values())]
        speed, times = closed_form(*given)
        slopes = []
        for i in range(len(given)):
            h = mp.mpf(10) ** -12
            ends = [
                closed_form(*(g + s * h * (j == i) for j, g in enumerate(given))) for s in (1, -1)
            ]
            rows = [[e[0], *e[1]] for e in ends]
            slopes.append([float((p - m) / (2 * h)) for p, m in zip(*rows, strict=True)])
        return float(speed), [float(t) for t in times], np.array(slopes).T


@pytest.fixture(scope="module")
def run():
    found = ns.simulate(pushed_block(), [*START.values(), 0.0], 9.0, tol=1e-14)
    kinds = [(event.kind, event.name) for event in found.events[:4]]
    assert kinds == [
        ("entry", "h0"),
        ("exit", "lambda0 = 1"),
        ("reset", "clock"),
        ("reset", "wall"),
    ]
    assert found.status is ns.Status.STOPPED
    return found


def test_derivatives_have_the_digits_of_the_closed_form(run, exact):
    speed, times, slopes = exact
    assert run.x[-1, 1] == pytest.approx(speed, rel=1e-13)
    s = ns.sensitivity(run)
    assert s.event_times == pytest.approx(times, rel=1e-13)
    found = np.hstack([s.dx_dx0[1:2, :2], s.dx_dp[1:2]])
    np.testing.assert_allclose(found, slopes[:1], rtol=1e-12, atol=1e-13)
    found = np.hstack([s.dt_dx0[:, :2], s.dt_dp])
    np.testing.assert_allclose(found, slopes[1:], rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(s.dt_end_dp, slopes[-1, 2:], rtol=1e-12, atol=1e-13)


def test_the_gradient_is_the_same_row(run, exact):
    system = run.system
    speed = system.definition.states[1]
    found = ns.gradient(run, speed)
    np.testing.assert_allclose(found.x0[:2], exact[2][0, :2], rtol=1e-12, atol=1e-13)
    by_name = [found.parameters[name] for name in VALUES]
    np.testing.assert_allclose(by_name, exact[2][0, 2:], rtol=1e-12, atol=1e-13)
