"""sigma, nu and the class of a two-fold survive every change that leaves the dynamics alone."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import nonsmooth as ns
from nonsmooth.local import find_two_fold, two_fold
from tests.drawing import at_most

X = ca.vertcat(*(ca.SX.sym(s) for s in "xyz"))
STATES = ca.vertsplit(X)

scale = st.floats(0.1, 10)
entry = st.floats(-2, 2).map(lambda v: round(v, 3))
vector = st.lists(entry, min_size=3, max_size=3).map(np.array)
matrix = st.lists(entry, min_size=9, max_size=9).map(lambda v: np.array(v).reshape(3, 3))
sign = st.sampled_from([-1.0, 1.0])
size = st.floats(0.3, 2)


@st.composite
def definitions(draw):
    """h, F1, F2 with a generic two-fold at 0: curved surface, quadratic terms in the fields.

    The fields are chosen through L1 = -y a + .., L2 = z b + .., so that L11 and L22 are not small.
    """
    x, y, z = STATES
    bend = draw(vector)
    h = x + bend[0] * y**2 + bend[1] * y * z + bend[2] * z**2
    quadratic = ca.vertcat(x * y, y * z, z**2)
    s1, s2 = draw(sign) * draw(size), draw(sign) * draw(size)
    a, b, c, d = draw(size), draw(size), draw(entry), draw(entry)
    f1 = ca.vertcat(-a * y + c * z, s1, draw(entry)) + ca.mtimes(draw(matrix), quadratic)
    f2 = ca.vertcat(b * z + d * y, draw(entry), s2) + ca.mtimes(draw(matrix), quadratic)
    return h, f1, f2


def fold_of(h, f1, f2, point=(0, 0, 0)):
    system = ns.FilippovSystem(STATES, surface=h, above=f1, below=f2)
    try:
        fold = two_fold(system, point)
    except ns.DegenerateError:
        assume(False)
    assume(min(abs(fold.lie["L11"]), abs(fold.lie["L22"])) > 0.05)
    return fold


def same(a, b):
    assert a.sigma == b.sigma
    np.testing.assert_allclose(a.nu, b.nu, rtol=1e-10, atol=1e-11)
    if min(a.classification.margin, b.classification.margin) > 1e-6:
        assert (a.label, a.canards, a.faux_canards) == (b.label, b.canards, b.faux_canards)


@given(definitions(), scale, scale, scale)
def test_rescaling_h_and_the_fields(definition, a, b, c):
    h, f1, f2 = definition
    fold, other = fold_of(h, f1, f2), fold_of(c * h, a * f1, b * f2)
    same(fold, other)
    # the fields' speeds set the two times: theta, phi follow, z2 and z3 change by positive factors
    assert other.phi == pytest.approx(fold.phi * (b / a) ** 0.5)
    assert other.theta == pytest.approx(fold.theta / (a * b * c))


@given(definitions())
def test_swapping_the_sides(definition):
    h, f1, f2 = definition
    fold, other = fold_of(h, f1, f2), fold_of(-h, f2, f1)
    assert other.sigma == (-fold.sigma[1], -fold.sigma[0])
    np.testing.assert_allclose(other.nu, fold.nu[::-1], rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(other.eigenvalues, fold.eigenvalues, rtol=1e-9, atol=1e-9)
    if fold.classification.margin > 1e-6:
        assert (other.label, other.canards, other.faux_canards) == (
            fold.label,
            fold.canards,
            fold.faux_canards,
        )
    x = np.array([0.01, 0.02, -0.03])
    np.testing.assert_allclose(other.coordinates(x), fold.coordinates(x)[[0, 2, 1]] * [-1, 1, 1])


@given(definitions())
def test_reversing_time(definition):
    h, f1, f2 = definition
    fold, other = fold_of(h, f1, f2), fold_of(h, -f1, -f2)
    same(fold, other)
    x = np.array([0.01, 0.02, -0.03])  # Da and Dr change places
    np.testing.assert_allclose(other.coordinates(x), fold.coordinates(x) * [1, -1, -1])


@pytest.mark.slow
@given(definitions(), matrix, matrix, vector, st.booleans())
@at_most(60)
def test_changing_coordinates(definition, linear, quadratic, shift, curved):
    """Pull the system back by x = shift + A u + Q(u): u' = (dx/du)^-1 f(x(u))."""
    h, f1, f2 = definition
    fold = fold_of(h, f1, f2)
    linear = np.eye(3) * 2 + 0.3 * linear
    assume(abs(np.linalg.det(linear)) > 0.5)
    u = X - ca.DM(shift)  # the new two-fold is at shift
    x = ca.mtimes(ca.DM(linear), u)
    if curved:
        x += ca.mtimes(ca.DM(quadratic), ca.vertcat(u[0] * u[1], u[1] ** 2, ca.sin(u[2]) * u[0]))
    pull = ca.inv(ca.jacobian(x, X))
    new = [ca.substitute(e, X, x) for e in definition]
    other = fold_of(new[0], ca.mtimes(pull, new[1]), ca.mtimes(pull, new[2]), shift)
    same(fold, other)
    assert other.theta == pytest.approx(fold.theta) and other.phi == pytest.approx(fold.phi)
    for key, value in fold.lie.items():
        assert other.lie[key] == pytest.approx(value, rel=1e-9, abs=1e-10)


@given(definitions(), st.lists(entry, min_size=3, max_size=3))
def test_more_states_change_nothing(definition, drift):
    """Two decoupled states: the two-fold is the same across its two-dimensional set."""
    h, f1, f2 = definition
    fold = fold_of(h, f1, f2)
    extra = [ca.SX.sym("p"), ca.SX.sym("q")]
    tail = [ca.SX(drift[0]) + extra[1], -extra[0] + drift[1]]
    system = ns.FilippovSystem(
        [*STATES, *extra],
        surface=h,
        above=[*ca.vertsplit(f1), *tail],
        below=[*ca.vertsplit(f2), *tail],
    )
    same(fold, two_fold(system, [0, 0, 0, 0.3, -0.7]))
    found = find_two_fold(system, [0, 0, 0, 0.3, -0.7])
    np.testing.assert_array_equal(found.point[3:], [0.3, -0.7])
