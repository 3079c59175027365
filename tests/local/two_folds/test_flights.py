"""Flights at an invisible fold follow the crossing map: counts, diabolo and accumulation time."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import nonsmooth as ns
from nonsmooth.local.two_folds import (
    accumulation_time,
    diabolo_slopes,
    flight_above,
    flight_below,
    max_flights,
    return_matrix,
)


def flights(z, nu, most=2000):
    """Flights of an invisible two-fold until sliding, the time, and the point."""
    z, count, time = np.array(z, dtype=float), 0, 0.0
    while z[0] * z[1] < 0 and count < most:
        time += 2 * abs(min(z))
        z = flight_above(z, nu) if z[0] < 0 else flight_below(z, nu)
        count += 1
    return count, time, z


def most_flights(nu):
    angles = (np.arange(20_000) + 0.5) * np.pi / 40_000
    z = np.concatenate([[-np.cos(angles), np.sin(angles)], [np.sin(angles), -np.cos(angles)]], 1).T
    for count in range(100):
        flying = z[:, 0] * z[:, 1] < 0
        if not flying.any():
            return count
        up = flying & (z[:, 0] < 0)
        down = flying & ~up
        z[up], z[down] = flight_above(z[up], nu), flight_below(z[down], nu)
    raise AssertionError("no end")


@pytest.mark.parametrize(
    ("nu", "expected"),
    [
        ((-0.5, -0.5), 2), ((-0.9, -1), 9), ((-0.99, -1), 31), ((-0.3, -2), 4), ((-0.05, -0.05), 2),
        ((1, 2), 1), ((0.1, -3), 2), ((-3, 0.1), 2), ((-1, 0), 2), ((0, 0), 1),
    ],
)  # fmt: skip
def test_largest_number_of_flights(nu, expected):
    assert max_flights((-1, 1), nu) == expected
    if 0 not in nu:
        assert most_flights(nu) == expected


def test_flights_of_other_two_folds():
    assert max_flights((1, -1), (1.0, 1.0)) == 0
    assert max_flights((1, 1), (1.0, 1.0)) == max_flights((-1, -1), (1.0, 1.0)) == 1
    assert max_flights((-1, 1), (-1.0, -1.0)) == math.inf


numbers = st.floats(-3, 3)


@pytest.mark.slow
@given(numbers, numbers, st.floats(-2, -0.01), st.floats(-2, 2))
def test_flights_are_orbits_of_the_normal_form(n1, n2, down, other):
    nu, s = (n1, n2), ns.textbook.two_fold((-1, 1), (n1, n2)).system
    run = ns.flow.follow(s, [0, down, other], 2 * abs(down), mode="+")
    np.testing.assert_allclose(run.x[-1], [0, *flight_above([down, other], nu)], atol=1e-12)
    run = ns.flow.follow(s, [0, other, down], 2 * abs(down), mode="-")
    np.testing.assert_allclose(run.x[-1], [0, *flight_below([other, down], nu)], atol=1e-12)


@given(numbers, numbers)
def test_return_matrix(n1, n2):
    z = np.array([-1.0, 5.0])
    np.testing.assert_allclose(
        return_matrix((n1, n2)) @ z, flight_below(flight_above(z, (n1, n2)), (n1, n2)), atol=1e-12
    )
    assert np.linalg.det(return_matrix((n1, n2))) == pytest.approx(1, abs=1e-10)
    assert np.trace(return_matrix((n1, n2))) == pytest.approx(4 * n1 * n2 - 2)


@pytest.mark.parametrize("nu", [(-2.0, -1.0), (-1.0, -2.0), (-1.2, -0.9)])
def test_diabolo(nu):
    low, high = diabolo_slopes(nu)
    growth = 4 * nu[0] * nu[1] - 2
    growth = (growth + math.sqrt(growth**2 - 4)) / 2  # larger root of mu^2 - trace mu + 1
    p = return_matrix(nu)
    np.testing.assert_allclose(p @ [-1, low], growth * np.array([-1, low]), rtol=1e-10)
    np.testing.assert_allclose(p @ [-1, high], np.array([-1, high]) / growth, rtol=1e-9, atol=1e-12)
    # above high: finitely many flights, then attracting sliding; below: it spirals away
    _, _, end = flights((-1, high * 1.001), nu)
    assert end.min() > 0
    count, _, end = flights((-1, high * 0.999), nu, most=200)
    assert count == 200 and np.abs(end).max() > 1e6


def test_accumulation_time():
    # on the contracting line, summed flight by flight in 50 digits
    mpmath = pytest.importorskip("mpmath")
    for n1, n2, phi in ((-2, -1, 1), (-1, -2, 1), (-2, -1, 2.5)):
        with mpmath.workdps(60):
            a, b = mpmath.mpf(-n1), mpmath.mpf(-n2)
            z = [mpmath.mpf(-1), a * (1 + mpmath.sqrt(1 - 1 / (a * b)))]
            time = mpmath.mpf(0)
            for _ in range(20):
                time += 2 * phi * abs(z[0])
                z = [-z[0], z[1] - 2 * n1 * z[0]]
                time += 2 * abs(z[1]) / mpmath.mpf(phi)
                z = [z[0] - 2 * n2 * z[1], -z[1]]
        assert accumulation_time((n1, n2), phi) == pytest.approx(float(time), rel=1e-13)
    assert accumulation_time((-2, -1)) == pytest.approx(3.828427124746, abs=1e-12)
    assert accumulation_time((-2, -1)) == pytest.approx(1 + 2 * math.sqrt(2), rel=1e-15)


@pytest.mark.parametrize("nu", [(-0.5, -1), (2, 1), (-1, 1)])
def test_no_diabolo(nu):
    with pytest.raises(ns.OptionError, match="nu1"):
        diabolo_slopes(nu)
    with pytest.raises(ns.OptionError):
        accumulation_time(nu)


def test_time_scale_is_positive():
    with pytest.raises(ns.OptionError, match="phi"):
        accumulation_time((-2, -1), 0)
