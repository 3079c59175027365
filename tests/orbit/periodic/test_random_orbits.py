"""Multipliers and orbits of random systems are those of matrix exponentials with 40 digits, and do not
depend on the scale of h, on its sign, or on the units of the states."""

from __future__ import annotations

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import nonsmooth as ns

X = [ca.SX.sym("x"), ca.SX.sym("y")]
T = ca.SX.sym("t")


def relay(seed: int, *, scale: float = 1.0, unit: float = 1.0):
    """A stable linear system with a relay, forced with the period 2 pi, and its matrices (2, 5) above and
    below, which act on (x, y, cos t, sin t, 1)."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(2, 2)) - 1.5 * np.eye(2)
    a -= max(0.0, np.linalg.eigvals(a).real.max() + 0.3) * np.eye(2)
    drive, push = 3 * rng.normal(size=(2, 2)), 0.5 * rng.normal(size=2)
    sides = [np.column_stack([a, drive, s * push]) for s in (1, -1)]
    clock = ca.vertcat(X[0] / unit, X[1] / unit, ca.cos(T), ca.sin(T), 1)
    fields = [ca.vertsplit(unit * ca.mtimes(ca.DM(side), clock)) for side in sides]
    above, below = fields if scale > 0 else fields[::-1]
    system = ns.FilippovSystem(X, surface=scale * X[0], above=above, below=below, time=T)
    return system, dict(zip("+-", sides, strict=True))


def orbit_of(system, unit: float = 1.0) -> ns.orbit.PeriodicOrbit:
    run = ns.simulate(system, [0.3 * unit, 0.2 * unit], 40 * np.pi, tol=1e-12)
    assume(run.status is ns.Status.REACHED_END)
    try:
        return ns.periodic_orbit(system, run)
    except (ns.ConvergenceError, ns.DegenerateError):
        assume(False)
        raise


def returned(legs, sides, x, t, span):
    """State after a period through given legs, each to its own zero of x, in mpmath."""
    state = mp.matrix([*x, mp.cos(t), mp.sin(t), 1])
    whole = {}
    for mode, side in sides.items():
        whole[mode] = mp.zeros(5)
        for i in range(2):
            for j in range(5):
                whole[mode][i, j] = mp.mpf(float(side[i, j]))
        whole[mode][2, 3], whole[mode][3, 2] = -1, 1
    passed = mp.mpf(0)
    for mode, duration in legs:
        wait = mp.mpf(duration)
        for _ in range(4):  # Newton's method: the rate of x is the first row
            there = mp.expm(whole[mode] * wait) * state
            wait -= there[0] / (whole[mode] * there)[0]
        state, passed = mp.expm(whole[mode] * wait) * state, passed + wait
    rest = mp.expm(whole[legs[0][0]] * (span - passed)) * state
    return [rest[0], rest[1]]


@pytest.mark.slow
@settings(deadline=None, max_examples=2)
@given(st.integers(0, 10**6))
def test_multipliers_are_those_of_the_return_map_with_40_digits(seed: int) -> None:
    system, sides = relay(seed)
    orbit = orbit_of(system)
    assume(all(leg.kind == "crossing" for leg in orbit.legs))
    legs = [(leg.mode, leg.duration) for leg in orbit.legs]
    with mp.workdps(40):
        t, span, h = mp.mpf(orbit.legs[0].t), 2 * mp.pi * orbit.problem.periods, mp.mpf(10) ** -14
        start = [mp.mpf(float(v)) for v in orbit.start]
        end = returned(legs, sides, start, t, span)
        assert max(abs(a - b) for a, b in zip(end, start, strict=True)) < 1e-13
        columns = []
        for k in range(2):
            ends = [
                returned(legs, sides, [v + s * h * (j == k) for j, v in enumerate(start)], t, span)
                for s in (1, -1)
            ]
            columns.append([float((a - b) / (2 * h)) for a, b in zip(*ends, strict=True)])
    exact = np.linalg.eigvals(np.array(columns).T)
    for value in exact:
        assert np.abs(orbit.multipliers - value).min() < 1e-11
    size = np.linalg.det(np.array(columns))
    assert abs(np.prod(orbit.multipliers) - size) < 1e-11


@pytest.mark.slow
@settings(deadline=None, max_examples=5)
@given(
    st.integers(0, 10**6), st.sampled_from([1e-4, 7.0, -1.0, -1e5]), st.sampled_from([1e-6, 1e4])
)
def test_scales_of_h_and_units_do_not_matter(seed: int, scale: float, unit: float) -> None:
    plain, changed = relay(seed)[0], relay(seed, scale=scale, unit=unit)[0]
    one, two = orbit_of(plain), orbit_of(changed, unit)
    assume(len(one.legs) == len(two.legs))
    np.testing.assert_allclose(
        np.sort_complex(one.multipliers), np.sort_complex(two.multipliers), rtol=0, atol=1e-11
    )
    first = min(
        range(len(one.legs)), key=lambda k: np.abs(two.start / unit - one.legs[k].start).max()
    )
    np.testing.assert_allclose(two.start / unit, one.legs[first].start, rtol=1e-10, atol=1e-12)
    assert two.stability == one.stability


@settings(deadline=None, max_examples=4)
@given(st.integers(0, 10**6))
def test_a_half_orbit_has_the_square_roots_of_the_multipliers(seed: int) -> None:
    """x -> -x with half a period later is a symmetry of every one of these systems."""
    system = relay(seed)[0]
    whole = orbit_of(system)
    run = ns.simulate(system, [0.3, 0.2], 40 * np.pi, tol=1e-12)
    try:
        half = ns.periodic_orbit(system, run, symmetry="odd")
    except ns.ConvergenceError:
        assume(False)
        raise
    assert abs(half.period - whole.period) < 1e-11
    np.testing.assert_allclose(
        np.sort_complex(half.multipliers), np.sort_complex(whole.multipliers), rtol=0, atol=1e-11
    )
    squares = np.sort_complex(half.half_multipliers**2)
    np.testing.assert_allclose(squares, np.sort_complex(half.multipliers), rtol=0, atol=1e-14)
