"""Newton's method from good guesses: steps with the last Jacobian lead to the same root with fewer of them."""

import numpy as np
import pytest

from nonsmooth.solvers.newton import converge


def kepler(u):
    """E - e sin E = M, and a second unknown that follows it."""
    return np.array([u[0] - 0.6 * np.sin(u[0]) - 1.0, u[1] - np.exp(u[0])])


def jacobian(u):
    return np.array([[1.0 - 0.6 * np.cos(u[0]), 0.0], [-np.exp(u[0]), 1.0]])


@pytest.mark.parametrize("off", [1e-1, 1e-2, 1e-3, 1e-6])
def test_values_alone_save_jacobians_and_lead_to_the_same_root(off):
    counts = {}

    def equations(name):
        def called(u):
            counts[name] = counts.get(name, 0) + 1
            return kepler(u), jacobian(u)

        return called

    start = np.array([1.5819, np.exp(1.5819)]) + off
    plain = converge(equations("plain"), start, tol=1e-14)
    mixed = converge(equations("mixed"), start, tol=1e-14, values=kepler)
    assert np.abs(mixed - plain).max() < 1e-14
    assert np.abs(kepler(mixed)).max() < 4e-15
    assert counts["mixed"] <= counts["plain"]
    assert counts["mixed"] < counts["plain"] or off == 1e-6


def test_values_that_fail_leave_the_full_steps():
    start = np.array([1.5, 4.8])
    expected = converge(lambda u: (kepler(u), jacobian(u)), start, tol=1e-14)
    for failing in (lambda u: None, lambda u: np.full(2, np.nan)):
        found = converge(lambda u: (kepler(u), jacobian(u)), start, tol=1e-14, values=failing)
        assert np.array_equal(found, expected)
