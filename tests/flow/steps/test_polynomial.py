"""The first root on an interval is found, whatever lies beside it, and no double crossing is missed."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from nonsmooth.flow.polynomial import first_crossing, first_root, shift


def from_roots(roots, scale=1.0):
    """Coefficients in increasing powers of a polynomial that is positive at 0."""
    c = scale * np.poly(roots)[::-1]
    return (c if c[0] > 0 else -c).tolist()


roots_in_view = st.lists(st.floats(0.01, 3.0), min_size=1, max_size=6)


@given(roots_in_view, st.floats(0.1, 10.0))
def test_first_of_several_real_roots(roots, scale):
    roots = sorted(roots)
    assume(all(b - a > 1e-3 for a, b in pairwise(roots)))
    c = from_roots(roots, scale)
    found = first_root(c, 1.0)
    if roots[0] < 1.0 - 1e-6:
        # The condition of the root: residual rounding over the slope.
        slope = abs(np.polyval(np.polyder(c[::-1]), roots[0]))
        noise = 1e-15 * sum(abs(v) for v in c) / slope
        assert found == pytest.approx(roots[0], abs=50 * noise + 1e-14)
    elif roots[0] > 1.0 + 1e-6:
        assert found is None


@given(st.floats(0.05, 0.95), st.floats(-14.0, -2.0))
def test_two_crossings_of_a_shallow_dip_are_found(centre, log_depth):
    """p = (t - c)^2 - depth dips below zero between two positive ends."""
    depth = 10.0**log_depth
    c = [centre**2 - depth, -2 * centre, 1.0]
    assume(c[0] > 0 and (1 - centre) ** 2 > depth)
    found = first_root(c, 1.0)
    assert found is not None
    assert found == pytest.approx(centre - np.sqrt(depth), abs=3e-15 / np.sqrt(depth) + 1e-14)


@given(st.floats(0.05, 0.95), st.floats(-12.0, -2.0))
def test_a_dip_that_stays_positive_is_no_root(centre, log_depth):
    depth = 10.0**log_depth
    assert first_root([centre**2 + depth, -2 * centre, 1.0], 1.0) is None


@given(st.floats(0.05, 0.95), st.floats(0.1, 10.0))
def test_a_touch_is_no_root(centre, scale):
    """A double root crosses nothing, whatever rounding makes of it."""
    assert first_root([scale * centre**2, -2 * scale * centre, scale], 1.0) is None


def test_a_root_found_late_by_rounding_is_polished():
    """Two shallow dips seen over a long interval: the first root is accurate to its condition."""
    a, d = 2.137940228912001, 1e-9
    one = np.array([a * a - d, -2 * a, 1.0])
    b = a + 1
    two = np.array([b * b - d, -2 * b, 1.0])
    found = first_root(np.convolve(one, two).tolist(), 10.0)
    assert found == pytest.approx(a - np.sqrt(d), abs=2e-9)


def test_the_end_of_the_interval_belongs_to_it():
    """To rounding: a root at the very end is found in this step or at the start of the next."""
    assert first_root([1.0, -1.0], 1.0 + 1e-14) == pytest.approx(1.0, abs=1e-15)
    assert first_root([1.0, -1.0], 0.999999) is None


def test_not_positive_at_the_start_is_a_root_at_once():
    assert first_root([0.0, 1.0], 1.0) == 0.0
    assert first_root([-1.0, 2.0], 1.0) == 0.0


@pytest.mark.slow
def test_high_degree_against_all_roots_at_40_digits():
    import mpmath as mp

    rng = np.random.default_rng(7)
    with mp.workdps(40):
        for _ in range(40):
            c = (rng.normal(size=15) * 2.0 ** -np.arange(15)).tolist()
            c[0] = abs(c[0])
            real = [
                float(r.real)
                for r in mp.polyroots(
                    [mp.mpf(v) for v in c[::-1]], maxsteps=500, extraprec=200, asc=False
                )
                if abs(r.imag) < 1e-25 and 0 < r.real <= 1.5
            ]
            found = first_root(c, 1.5)
            assert (found is None) == (not real)
            if real:
                assert found == pytest.approx(min(real), abs=1e-11)


@pytest.mark.parametrize(
    ("direction", "expected"), [(-1, 1.0), (0, 1.0), (1, 2.0)], ids=["falling", "either", "rising"]
)
def test_direction(direction, expected):
    """(t - 1)(t - 2) falls at 1 and rises at 2."""
    assert first_crossing([2.0, -3.0, 1.0], 3.0, direction) == pytest.approx(expected, abs=1e-14)


def test_falling_after_rising():
    """-(t - 1)(t - 2) starts below zero, rises at 1 and falls at 2."""
    assert first_crossing([-2.0, 3.0, -1.0], 3.0, -1) == pytest.approx(2.0, abs=1e-14)
    assert first_crossing([-2.0, 3.0, -1.0], 1.5, -1) is None


def test_leading_zeros_are_a_start_on_the_root():
    assert first_crossing([0.0, 1.0, -1.0], 2.0, -1) == pytest.approx(1.0)
    assert first_crossing([0.0, 0.0], 2.0, 0) is None


@given(st.lists(st.floats(-2, 2), min_size=1, max_size=8), st.floats(-1, 1), st.floats(-1, 1))
def test_shift_is_the_same_polynomial(c, t, s):
    whole = sum(v * (t + s) ** k for k, v in enumerate(c))
    moved = sum(v * s**k for k, v in enumerate(shift(c, t)))
    assert moved == pytest.approx(whole, abs=1e-10)
