"""A constructed two-fold is found from starts around it, quadratically, and traced along its set."""

import math
import pickle
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import nonsmooth as ns
from nonsmooth.local import find_two_fold, two_fold
from nonsmooth.local.point.surface_point import surface_at
from nonsmooth.orbit import TraceError, trace_two_folds
from nonsmooth.solvers.newton import solve
from tests.drawing import at_most

signs = st.sampled_from([(1, -1), (-1, 1), (1, 1), (-1, -1)])
numbers = st.floats(-3, 3)
seeds = st.integers(0, 10**6)


def hidden(sigma, nu, seed, extra=0):
    """Normal form with cubic terms, in coordinates of a random diffeomorphism; and where s is.

    ``extra`` decoupled states give a set of two-folds of that dimension.
    """
    rng, n = np.random.default_rng(seed), 3 + extra
    u = ca.vertcat(*(ca.SX.sym(f"u{i}") for i in range(n)))
    s = rng.normal(size=n)
    rotation = np.linalg.qr(rng.normal(size=(n, n)))[0] * rng.uniform(0.5, 2, size=n)
    y = ca.mtimes(ca.DM(rotation), u - s)
    bend = 0.1 * rng.normal(size=(n, n))
    z = y + ca.mtimes(ca.DM(bend), ca.sin(y) * y)  # identity to first order at s
    more = lambda: ca.mtimes(ca.DM(0.2 * rng.normal(size=(3, 3))), z[:3] ** 2)
    tail = [ca.SX(v) for v in rng.normal(size=extra)]
    f1 = ca.vertcat(ca.vertcat(-z[1], -sigma[0], nu[0]) + more(), *tail)
    f2 = ca.vertcat(ca.vertcat(z[2], nu[1], sigma[1]) + more(), *tail)
    pull = ca.inv(ca.jacobian(z, u))
    system = ns.FilippovSystem(
        ca.vertsplit(u), surface=z[0], above=ca.mtimes(pull, f1), below=ca.mtimes(pull, f2)
    )
    return system, s, rotation


@pytest.mark.slow
@at_most(40)
@given(signs, numbers, numbers, seeds)
def test_found_from_starts_around_it(sigma, n1, n2, seed):
    system, s, rotation = hidden(sigma, (n1, n2), seed)
    rng = np.random.default_rng(seed + 1)
    for _ in range(4):
        offset = np.linalg.solve(rotation, 0.2 * rng.uniform(-1, 1, size=3))
        fold = find_two_fold(system, s + offset)
        assume(np.linalg.norm(fold.point - s) < 0.5)  # cubic terms can make other two-folds
        np.testing.assert_allclose(fold.point, s, atol=1e-12)
        assert fold.distance == pytest.approx(np.linalg.norm(offset), abs=1e-12)
        assert fold.residual < 1e-14
        assert fold.sigma == sigma
        np.testing.assert_allclose(fold.nu, (n1, n2), atol=1e-11)
        assert fold.theta == pytest.approx(1) and fold.phi == pytest.approx(1)
        assert fold.iterations <= 8


@pytest.mark.slow
@at_most(20)
@given(signs, numbers, numbers, seeds)
def test_least_norm_in_five_dimensions(sigma, n1, n2, seed):
    system, s, rotation = hidden(sigma, (n1, n2), seed, extra=2)
    across = np.linalg.qr(rotation[:3].T)[0]  # where h, L1 and L2 change at s
    offset = across @ (0.02 * np.random.default_rng(seed).uniform(-1, 1, size=3))
    fold = find_two_fold(system, s + offset)
    np.testing.assert_allclose(fold.nu, (n1, n2), atol=1e-1)
    # the foot of the start on the set, up to curvature
    assert np.linalg.norm(fold.point - s) < 0.2 * np.linalg.norm(offset) + 1e-3
    assert fold.residual < 1e-14


def test_convergence_is_quadratic():
    system, s, rotation = hidden((-1, 1), (-2.0, -1.0), 3)
    target = two_fold(system, s)

    def equations(x):
        numbers = target.chart.where.at(x)
        return np.array([numbers.h, *numbers.lie]), numbers.gradients

    start = s + np.linalg.solve(rotation, [0.15, -0.15, 0.1])
    history = solve(equations, start, tol=1e-12, max_iterations=30, what="two-fold").history
    exponents = [math.log(b) / math.log(a) for a, b in pairwise(history) if 1e-7 < a < 0.02]
    assert len(exponents) >= 2 and min(exponents) > 1.6


@pytest.mark.slow
@at_most(25)
@given(signs, numbers, numbers, seeds)
def test_coordinates_and_point_at_are_inverse(sigma, n1, n2, seed):
    for extra in (0, 2):
        system, s, _ = hidden(sigma, (n1, n2), seed, extra)
        fold = two_fold(system, s)
        z = 0.05 * np.random.default_rng(seed).uniform(-1, 1, size=(2, 4, 3))
        x = fold.point_at(z)
        assert x.shape == (2, 4, 3 + extra)
        np.testing.assert_allclose(fold.coordinates(x), z, atol=1e-13)
        flat = fold.point_at(z[0, 0, 1:])
        np.testing.assert_allclose(fold.coordinates(flat), [0, *z[0, 0, 1:]], atol=1e-13)
        assert fold.coordinates(x[0, 0]).shape == (3,)


@at_most(25)
@given(signs, numbers, numbers, seeds)
def test_coordinates_move_as_the_normal_form_says(sigma, n1, n2, seed):
    system, s, _ = hidden(sigma, (n1, n2), seed)
    fold, step = two_fold(system, s), 1e-6
    for mode, rate, clock in (
        ("+", [0, -sigma[0], n1], 1 / fold.phi),
        ("-", [0, n2, sigma[1]], fold.phi),
    ):
        velocity = system.evaluate(system.field(mode), s)[:, 0]
        both = fold.coordinates(np.array([s + step * velocity, s - step * velocity]))
        np.testing.assert_allclose(
            (both[0] - both[1]) / (2 * step), np.array(rate) * clock, atol=1e-6
        )


def test_reach_time_of_each_set():
    x, y, z = (ca.SX.sym(s) for s in "xyz")

    def fold(sigma, nu):
        return two_fold(
            ns.FilippovSystem(
                [x, y, z],
                surface=x,
                above=[-y / 2, -sigma[0] / 2, nu[0] / 2],
                below=[3 * z, 3 * nu[1], 3 * sigma[1]],
            ),
            [0, 0, 0],
        )

    teixeira = fold((-1, 1), (-2, -1))
    np.testing.assert_allclose(teixeira.nu, (-2, -1))
    start = np.array([0.01, 0.02])
    run = ns.simulate(teixeira.system, teixeira.point_at(start), t_end=1.0, tol=1e-12)
    assert run.t[-1] == pytest.approx(float(teixeira.reach_time(start)), rel=1e-9)
    assert teixeira.reach_time(-start) == pytest.approx(
        -teixeira.reach_time(start)
    )  # it came from s
    visible = fold((1, -1), (-2, -1))
    m = visible.slopes[0]
    times = visible.reach_time([[0.01, 0.01 * m], [0.01, 0.02 * m], [-0.01, 0.01]])
    assert times[0] > 0 and np.all(np.isnan(times[1:]))
    fan = fold((1, -1), (2, 1))  # all of Da came from s, all of Dr reaches it
    assert fan.reach_time(start) < 0 < fan.reach_time(-start)


# tracing ---------------------------------------------------------------------------------------

X, Y, Z, W, A = (ca.SX.sym(s) for s in ("x", "y", "z", "w", "a"))
# two-folds at y = sin(a) + w, z = a w; nu1 = -2 - w changes along the set
FAMILY = ns.FilippovSystem(
    [X, Y, Z, W],
    surface=X,
    above=[-(Y - ca.sin(A) - W), 1, -2 - W, 0],
    below=[Z - A * W, -1, 1, 0],
    parameters={A: 0.5},
)


def test_trace_over_a_parameter():
    values = np.linspace(0, 3, 31)
    folds = trace_two_folds(FAMILY, [0, 0, 0, 0], over=A, values=values, hold=["w"])
    np.testing.assert_allclose([f.point[1] for f in folds], np.sin(values), atol=1e-14)
    assert [f.parameters["a"] for f in folds] == list(values)
    # parameters= may name the same parameter; the trace wins
    again = trace_two_folds(FAMILY, [0] * 4, over="a", values=[1.0], parameters={"a": 7.0})
    assert again[0].parameters["a"] == 1.0


def test_trace_over_a_state():
    values = np.linspace(0, 1, 11)
    folds = trace_two_folds(FAMILY, [0, 0, 0, 0], over="w", values=values)
    np.testing.assert_allclose(
        [f.point for f in folds],
        np.column_stack([0 * values, np.sin(0.5) + values, 0.5 * values, values]),
        atol=1e-14,
    )
    np.testing.assert_allclose([f.nu[0] for f in folds], -2 - values)


def test_trace_that_ends_keeps_what_it_found():
    x, y, z, a = X, Y, Z, A
    system = ns.FilippovSystem(  # y^2 = 1 - a: no two-fold beyond a = 1
        [x, y, z], surface=x, above=[1 - a - y**2, 1, -2], below=[z, -1, 1], parameters={a: 0.0}
    )
    with pytest.raises(TraceError, match=r"a = 1.2.*3 of 5") as caught:
        trace_two_folds(system, [0, 1, 0], over="a", values=[0, 0.4, 0.8, 1.2, 1.6])
    error = caught.value
    assert error.value == 1.2 and len(error.folds) == 3
    np.testing.assert_allclose([f.point[1] for f in error.folds], np.sqrt([1, 0.6, 0.2]))
    assert error.residual > 0.1 and error.point.shape == (3,)
    with pytest.raises(TraceError, match="dependent") as caught:  # the turning point itself
        trace_two_folds(system, [0, 1, 0], over="a", values=[0.8, 1.0])
    assert isinstance(caught.value.__cause__, ns.DegenerateError)


def test_bad_traces():
    with pytest.raises(ns.DefinitionError, match="over"):
        trace_two_folds(FAMILY, [0] * 4, over="b", values=[1])
    with pytest.raises(ns.DefinitionError, match="values"):
        trace_two_folds(FAMILY, [0] * 4, over="a", values=[1, math.nan])
    with pytest.raises(ns.DefinitionError, match="free states"):
        trace_two_folds(FAMILY, [0] * 4, over="w", values=[1], hold=["y"])


# errors ----------------------------------------------------------------------------------------

NORMAL = ns.FilippovSystem([X, Y, Z], surface=X, above=[-Y, 1, -2], below=[Z, -1, 1])


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: find_two_fold(NORMAL, [0, 0]), ns.PointError, "point.*shape"),
        (lambda: find_two_fold(NORMAL, [0, math.nan, 0]), ns.PointError, "point.*finite"),
        (lambda: find_two_fold(NORMAL, "abc"), ns.PointError, "point.*numbers"),
        (lambda: find_two_fold(NORMAL, [0, 0, 0], parameters={"q": 1}), ns.ParameterError, "'q'"),
        (lambda: find_two_fold(NORMAL, [0, 0, 0], tol=0), ns.OptionError, r"\btol\b"),
        (
            lambda: find_two_fold(NORMAL, [0] * 3, max_iterations=0),
            ns.OptionError,
            "max_iterations",
        ),
        (
            lambda: find_two_fold(NORMAL, [0] * 3, max_iterations=1.5),
            ns.OptionError,
            "max_iterations",
        ),
        (lambda: find_two_fold(NORMAL, [0] * 3, surface=1), ns.DefinitionError, "surface"),
        (lambda: find_two_fold(NORMAL, [0] * 3, surface="x"), ns.DefinitionError, "surface"),
        (lambda: find_two_fold(NORMAL, [0] * 3, hold=["q"]), ns.DefinitionError, r"\['q'\]"),
        (lambda: find_two_fold(NORMAL, [0] * 3, hold=["x"]), ns.DefinitionError, "free states"),
        (lambda: two_fold(NORMAL, [0.1, 0, 0]), ns.PointError, "h = 0.1"),
        (lambda: two_fold(NORMAL, [0, 0.1, 0]), ns.PointError, "L1 = -0.1"),
        (lambda: two_fold(NORMAL, [0] * 3).coordinates([1, 2]), ns.PointError, "states.*shape"),
        (lambda: two_fold(NORMAL, [0] * 3).coordinates([1, 2, math.inf]), ns.PointError, "finite"),
        (lambda: two_fold(NORMAL, [0] * 3).point_at([1, 2, 3, 4]), ns.PointError, r"\bz\b"),
        (lambda: two_fold(NORMAL, [0] * 3).reach_time([1.0]), ns.PointError, r"\bz\b"),
    ],
)
def test_bad_input(call, error, message):
    with pytest.raises(error, match=message):
        call()


def make(h, above, below, states=(X, Y, Z)):
    return ns.FilippovSystem(list(states), surface=h, above=above, below=below)


def test_no_two_fold_nearby():
    system = make(X, [-1 - Y**2, 1, -2], [Z, -1, 1])  # L1 never vanishes
    with pytest.raises(ns.ConvergenceError, match=r"two-fold.*residual") as caught:
        find_two_fold(system, [0, 0.5, 0.5])
    assert caught.value.residual > 0.1 and np.all(np.isfinite(caught.value.point))
    with pytest.raises(ns.ConvergenceError, match="budget"):
        find_two_fold(make(X, [-ca.exp(Y) + 1, 1, -2], [Z, -1, 1]), [0, 3, 1], max_iterations=2)


def test_start_where_the_field_is_undefined():
    system = make(X, [-ca.sqrt(Y) + 1, 1, -2], [Z, -1, 1])
    with pytest.raises(ns.PointError, match=r"\bnear\b"):
        find_two_fold(system, [0, -1, 0])
    assert find_two_fold(system, [0, 3.9, 0]).point[1] == pytest.approx(1)


def test_in_the_plane_there_is_advice():
    system = make(X, [-Y, 1], [Y, 1], (X, Y))
    with pytest.raises(ns.DefinitionError, match="free states"):
        find_two_fold(system, [0, 0])
    with pytest.raises(ns.DefinitionError, match="2 states"):
        two_fold(system, [0, 0])


def test_degenerate_two_folds_name_the_condition():
    dependent = make(X, [-Y, 1, -2], [Y + Z**2, -1, 1])
    for call in (two_fold, find_two_fold):
        with pytest.raises(ns.DegenerateError, match="dependent"):
            call(dependent, [0, 0, 0])
    cusp = make(X, [-Y, Z, -2], [Z, -1, 1])
    with pytest.raises(ns.DegenerateError, match=r"L11.*sigma1.*cusp-fold"):
        two_fold(cusp, [0, 0, 0])
    cusp = make(X, [-Y, 1, -2], [Z, -1, Y])
    with pytest.raises(ns.DegenerateError, match=r"L22.*sigma2.*cusp-fold"):
        find_two_fold(cusp, [0, 0.1, 0.1])
    singular = make(X, [-(Y**2), 1, -2], [Z, -1, 1])  # a double root
    with pytest.raises(ns.DegenerateError, match=r"grad L1.*linearly"):
        find_two_fold(singular, [0, 0.5, 0.1])
    flat = make(X * ca.sin(X), [-Y, 1, -2], [Z, -1, 1])
    with pytest.raises(ns.PointError, match="grad h = 0"):
        two_fold(flat, [0, 0, 0])


# description -----------------------------------------------------------------------------------


def test_in_words():
    text = str(find_two_fold(NORMAL, [0.1, 0.1, 0.1]))
    for part in (
        "Invisible two-fold",
        "class II-C",
        "nu = (-2, -1)",
        "infinitely many",
        "Found 0.173",
    ):
        assert part in text
    assert max(map(len, text.splitlines())) <= 98
    boundary = make(X, [-Y, -1, 2], [Z, 0.5, -1])
    text = str(two_fold(boundary, [0, 0, 0]))
    assert "boundary Delta=0: VV-C1|VV-F" in text and "not decided at leading order" in text
    focus = make(X, [-Y, -1, 0], [Z, 0.5, 1])
    assert "eigenvalues 0.25-0.968246i" in str(two_fold(focus, [0, 0, 0]))
    itinerary = make(X, [-Y, 1, 0], [Z, 0.7, 1])
    assert "On the boundary nu1=0" in str(two_fold(itinerary, [0, 0, 0]))
    friction = make(X, [Z - Y, 1, 0.5 + 0.3 * Y], [Z + Y, 1, 0.5 - 0.3 * Y])
    assert "The two fields coincide at s" in str(two_fold(friction, [0, 0, 0]))
    assert "Found" not in str(two_fold(NORMAL, [0, 0, 0]))
    assert repr(two_fold(NORMAL, [0, 0, 0])) == "TwoFold(II-C, invisible, point=[0.0, 0.0, 0.0])"
    assert not two_fold(NORMAL, [0, 0, 0]).coincident_fields


def test_explicit_time():
    t = ca.SX.sym("t")
    system = ns.FilippovSystem(
        [X, Y, Z], surface=X, above=[-(Y - t / 2), 1, -2], below=[Z, -1, 1], time=t
    )
    fold = find_two_fold(system, [0, 0, 0], t=0.5)
    np.testing.assert_allclose(fold.point, [0, 0.25, 0])
    assert fold.t == 0.5 and "t = 0.5" in str(fold)
    assert fold.lie["L11"] == pytest.approx(-0.5)
    system = ns.FilippovSystem(
        [X, Y, Z], surface=X, above=[-(Y - 2 * t), 1, -2], below=[Z, -1, 1], time=t
    )
    fold = find_two_fold(system, [0, 0, 0], t=0.5)
    assert fold.lie["L11"] == pytest.approx(1)  # -(1 - 2): visible because the fold line moves


def test_one_of_several_surfaces():
    l1, l2 = ca.SX.sym("l1"), ca.SX.sym("l2")
    # the second surface switches the sign of nu1
    system = ns.FilippovSystem(
        [X, Y, Z, W],
        surfaces=[X, W],
        multipliers=[l1, l2],
        field=[
            (1 + l1) / 2 * -Y + (1 - l1) / 2 * Z,
            (1 + l1) / 2 - (1 - l1) / 2,
            (1 + l1) / 2 * 2 * l2 + (1 - l1) / 2,
            0,
        ],
    )
    assert find_two_fold(system, [0.1, 0.1, 0.1, -1]).label == "II-C"
    assert find_two_fold(system, [0.1, 0.1, 0.1, 1]).label == "II-F"
    assert find_two_fold(system, [0.1, 0.1, 0.1, 1], mode="s-").label == "II-C"
    with pytest.raises(ns.PointError, match="mode="):
        find_two_fold(system, [0.1, 0.1, 0.1, 0])
    with pytest.raises(ns.DefinitionError, match="mode 'ss'"):
        find_two_fold(system, [0.1, 0.1, 0.1, 0], mode="ss")


def test_the_parameters_are_read_only_and_the_system_is_kept():
    fold = trace_two_folds(FAMILY, [0] * 4, over="a", values=[0.0])[0]
    with pytest.raises(TypeError):
        fold.parameters["a"] = 1
    assert pickle.loads(pickle.dumps(fold.system)).state_names == fold.system.state_names


def test_point_at_far_away_is_found_or_refused():
    system = make(X, [-ca.tanh(Y), 1, -2], [Z, -1, 1])
    fold = two_fold(system, [0, 0, 0])
    far = fold.point_at([[0.999, 0.1], [0.1, 0.1]])  # undamped Newton overshoots the first
    np.testing.assert_allclose(fold.coordinates(far)[:, 1:], [[0.999, 0.1], [0.1, 0.1]], atol=1e-13)
    with pytest.raises(ns.ConvergenceError, match=r"state at z = \[0.0, 1.1, 0.1\]"):
        fold.point_at([1.1, 0.1])
    assert fold.point_at(np.zeros((0, 2))).shape == (0, 3)
    assert fold.coordinates(np.zeros((0, 3))).shape == (0, 3)


def test_threads_share_a_system():
    """Each finds its own two-fold, although all evaluate the same compiled functions."""
    x, y, z, a = (ca.SX.sym(s) for s in "xyza")
    system = ns.FilippovSystem(
        [x, y, z],
        surface=x + 0.1 * y * z,
        above=[-y + a, -1 + 0.3 * z, 0.5 + x],
        below=[z + 0.2 * y**2, -2, 1 + 0.1 * y],
        parameters={a: 0.0},
    )
    values = np.linspace(-0.5, 0.5, 200)
    find = lambda value: find_two_fold(system, [0.0, 0.0, 0.0], parameters={"a": value})
    alone = [find(value) for value in values]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(find, values))
    for one, other in zip(alone, together, strict=True):
        assert np.array_equal(one.point, other.point) and one.label == other.label


def test_numbers_at_a_point_outlive_the_next_evaluation():
    system, s, _ = hidden((1, -1), (0.5, 1.5), 3)
    where, x = surface_at(system, s)
    first = where.at(x)
    kept = first.lie_gradients.copy(), first.fields.copy(), first.gradient.copy()
    where.at(x + 0.3)
    for old, now in zip(kept, (first.lie_gradients, first.fields, first.gradient), strict=True):
        assert np.array_equal(old, now)
