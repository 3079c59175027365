"""Regions, alpha and the sliding field are Filippov's, and questions without an answer are refused."""

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import nonsmooth as ns
from nonsmooth.local import Region, alpha, region, sliding_field

X, V, BELT, FRICTION = (ca.SX.sym(s) for s in ("x", "v", "belt", "friction"))
OSCILLATOR = ns.FilippovSystem(
    [X, V],
    surface=V - BELT,
    above=[V, -X - FRICTION],
    below=[V, -X + FRICTION],
    parameters={BELT: 0.3, FRICTION: 0.4},
)

x, y, z, w, t = (ca.SX.sym(s) for s in "xyzwt")


@pytest.mark.parametrize(
    ("position", "expected"),
    [
        (0.2, Region.ATTRACTING),
        (-0.5, Region.CROSSING_UP),
        (0.5, Region.CROSSING_DOWN),
        (-0.4, Region.TANGENT_ABOVE),
        (0.4, Region.TANGENT_BELOW),
    ],
)
def test_stick_and_slip(position, expected):
    assert region(OSCILLATOR, [position, 0.3]) is expected
    back = ns.FilippovSystem([X, V], surface=V - 0.3, above=[-V, X + 0.4], below=[-V, X - 0.4])
    mirrored = {
        Region.ATTRACTING: Region.REPELLING,
        Region.CROSSING_UP: Region.CROSSING_DOWN,
        Region.CROSSING_DOWN: Region.CROSSING_UP,
    }
    assert region(back, [position, 0.3]) is mirrored.get(expected, expected)


def test_parameters_and_words():
    assert region(OSCILLATOR, [0.45, 0.3], parameters={"friction": 0.5}).sliding
    assert not region(OSCILLATOR, [0.45, 0.3]).sliding
    assert str(region(OSCILLATOR, [0.2, 0.3])) == "attracting sliding"


def test_alpha_and_sliding_field_by_hand():
    assert alpha(OSCILLATOR, [0.2, 0.3]) == pytest.approx(0.75)
    assert alpha(OSCILLATOR, [-0.4, 0.3]) == 0 and alpha(OSCILLATOR, [0.4, 0.3]) == 1
    for position in (-0.4, 0.2, 0.4):
        np.testing.assert_allclose(sliding_field(OSCILLATOR, [position, 0.3]), [0.3, 0], atol=1e-15)


entry = st.floats(-2, 2)


@given(st.lists(entry, min_size=8, max_size=8), st.floats(0.1, 10), st.floats(0.1, 10))
def test_sliding_field_is_tangent_and_rescaling_h_changes_nothing(c, a, b):
    h = x + c[0] * y * z + c[1] * z**2
    f1 = [-1 - c[2] ** 2 + y, c[3], c[4] * z]
    f2 = [1 + c[5] ** 2 + z, c[6] + y, c[7]]
    system = ns.FilippovSystem([x, y, z], surface=h, above=f1, below=f2)
    p = np.array([-(c[0] * 0.06 + c[1] * 0.09), 0.2, 0.3])
    assume(region(system, p).sliding)
    velocity, weight = sliding_field(system, p), alpha(system, p)
    gradient = np.array([1, c[0] * p[2], c[0] * p[1] + 2 * c[1] * p[2]])
    assert gradient @ velocity == pytest.approx(0, abs=1e-13)
    above, below = (system.evaluate(system.field(m), p)[:, 0] for m in "+-")
    np.testing.assert_allclose(velocity, (1 - weight) * above + weight * below, atol=1e-13)
    scaled = ns.FilippovSystem([x, y, z], surface=a * h, above=f1, below=f2)
    assert alpha(scaled, p) == pytest.approx(weight)
    faster = ns.FilippovSystem(
        [x, y, z], surface=h, above=[b * e for e in f1], below=[a * e for e in f2]
    )
    assert region(faster, p) is region(system, p)


def test_two_fold_with_different_fields_has_no_sliding_field():
    system = ns.FilippovSystem([x, y, z], surface=x, above=[-y, 1, -2], below=[z, -1, 1])
    assert region(system, [0, 0, 0]) is Region.TWO_FOLD
    with pytest.raises(ns.PointError, match=r"alpha.*two-fold"):
        alpha(system, [0, 0, 0])
    with pytest.raises(ns.PointError, match=r"sliding field.*tangent"):
        sliding_field(system, [0, 0, 0])
    # rounding of a search does not turn a two-fold into something else
    assert region(system, [0, 1e-15, -3e-16]) is Region.TWO_FOLD
    assert region(system, [0, 1e-6, 1e-6]) is Region.ATTRACTING


def test_two_fold_with_equal_fields_has_one():
    lam = ca.SX.sym("lam")
    system = ns.FilippovSystem(
        [x, y, z], surface=x, multipliers=lam, field=[z - lam * y, 1, 0.5 - 0.3 * lam * y]
    )
    np.testing.assert_allclose(sliding_field(system, [0, 0, 0]), [0, 1, 0.5])
    # approached from the sliding region it is continuous, down to rounding
    for size in (1e-3, 1e-6, 1e-9, 1e-12):
        velocity = sliding_field(system, [0, size, 0.5 * size])
        np.testing.assert_allclose(velocity, [0, 1, 0.5 - 0.15 * size], atol=1e-15)
    with pytest.raises(ns.PointError, match="0/0"):
        alpha(system, [0, 0, 0])


def test_moving_surface():
    system = ns.FilippovSystem([x], surface=x - t**2, above=[-1], below=[3], time=t)
    assert region(system, [0.25], t=0.5) is Region.ATTRACTING
    assert region(system, [4.0], t=2.0) is Region.CROSSING_DOWN  # h falls at rate 3 - 4
    assert region(system, [2.25], t=1.5) is Region.TANGENT_BELOW
    np.testing.assert_allclose(sliding_field(system, [0.25], t=0.5), [1.0])  # follows the surface


def test_several_surfaces():
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    system = ns.FilippovSystem(
        [x, y], surfaces=[x, y], multipliers=[a, b], field=[-a + 0.5 * b, -b]
    )
    assert region(system, [0, 1.0]) is Region.ATTRACTING
    assert alpha(system, [0, 1.0]) == pytest.approx(0.25)
    assert alpha(system, [0, -1.0]) == pytest.approx(0.75)
    np.testing.assert_allclose(sliding_field(system, [0, 1.0]), [0, -1])
    np.testing.assert_allclose(sliding_field(system, [2.0, 0], surface=1), [-1, 0])
    with pytest.raises(ns.PointError, match=r"point.*mode="):
        region(system, [0, 0])
    assert region(system, [0, 0], mode="s+") is Region.ATTRACTING
    with pytest.raises(ns.DefinitionError, match="mode"):
        region(system, [0, 0], mode="+")


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: region(OSCILLATOR, [0.2, 0.31]), ns.PointError, "h = 0.01"),
        (lambda: region(OSCILLATOR, [0.2, 0.31]), ns.PointError, r"\[0.2, 0.3\]"),
        (lambda: region(OSCILLATOR, [0.2]), ns.PointError, "point.*shape"),
        (lambda: region(OSCILLATOR, [0.2, math.inf]), ns.PointError, "point.*finite"),
        (lambda: region(OSCILLATOR, None), ns.PointError, "2"),
        (lambda: region(OSCILLATOR, [0.2, 0.3], tol=-1), ns.OptionError, r"\btol\b"),
        (lambda: region(OSCILLATOR, [0.2, 0.3], tol="x"), ns.OptionError, "tol.*'x'"),
        (lambda: region(OSCILLATOR, [0.2, 0.3], surface=-1), ns.DefinitionError, "surface"),
        (
            lambda: region(OSCILLATOR, [0.2, 0.3], parameters={"mu": 1}),
            ns.ParameterError,
            "parameters.*'mu'",
        ),
        (lambda: alpha(OSCILLATOR, [0.5, 0.3]), ns.PointError, "alpha.*crossing down"),
        (lambda: sliding_field(OSCILLATOR, [-0.5, 0.3]), ns.PointError, "crossing up"),
        (
            lambda: region(ns.FilippovSystem([X], field=[-X]), [0.0]),
            ns.DefinitionError,
            "switching surface",
        ),
        (
            lambda: region(
                ns.FilippovSystem([X, V], surface=V, above=[ca.log(X), 1], below=[0, 1]), [-1.0, 0]
            ),
            ns.PointError,
            "point.*finite",
        ),
    ],
)
def test_refusals(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_following_the_advice_for_a_point_off_a_curved_surface():
    system = ns.FilippovSystem([x, y], surface=x**2 + y**2 - 1, above=[-x, -y], below=[x, y + 0.5])
    point = [0.9, 0.5]
    for _ in range(4):
        try:
            assert region(system, point) is Region.ATTRACTING
            break
        except ns.PointError as error:
            numbers = str(error).split("about [")[-1].split("]")[0]
            point = [float(v) for v in numbers.split(",")]
    else:
        raise AssertionError("not on the surface after the steps advised")


def test_a_root_whose_slope_is_infinite_on_the_surface_is_crossed_or_slides():
    """The field is finite on the surface, its derivative there is not."""
    root = ca.sign(x) * ca.sqrt(ca.fabs(x))
    twisting = ns.FilippovSystem.from_expression([x, y], [y - root, -ca.sign(x)])
    assert ns.region(twisting, [0.0, 0.1]) is Region.CROSSING_UP
    assert ns.classify(twisting, [0.0, 0.1]).label == "crossing up"
    with pytest.raises(ns.PointError, match="derivatives"):
        ns.classify(twisting, [0.0, 0.0])
    relay = ns.FilippovSystem.from_expression([x, y], [-ca.sign(x) - root, 1])
    assert ns.region(relay, [0.0, 0.1]) is Region.ATTRACTING
    assert (alpha(relay, [0.0, 0.1]), *sliding_field(relay, [0.0, 0.1])) == (0.5, 0.0, 1.0)
    assert ns.classify(relay, [0.0, 0.1]).label == "attracting sliding"
