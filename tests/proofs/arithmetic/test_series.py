"""Power series: coefficients are those of mpmath, and nothing is known where the value is not."""

import mpmath
import pytest
from flint import arb, arb_series, ctx

from nonsmooth.proofs.arithmetic.intervals import precision
from nonsmooth.proofs.arithmetic.series import Series, length

TWO = ("add", "sub", "mul", "div", "pow", "hypot", "atan2", "fmin", "fmax")
ONE = """
    sqrt exp log sin cos tan asin acos atan erf inv sq neg sinh cosh tanh asinh acosh atanh
    expm1 log1p twice fabs erfinv
""".split()
ENDS = ((-1, 1), (-2, -1), (0, 1), (0.5, 1.5), (-1.5, -0.5), (1.5, 1.6), (0, 0))


def moving(low, high, slope):
    return arb_series([arb(low).union(arb(high)), slope])


@pytest.mark.parametrize("op", (*ONE, *TWO))
def test_where_a_value_is_unknown_no_coefficient_is_known(op):
    with length(6):
        arithmetic = Series([], "stored")
        for a in ENDS:
            for b in ENDS if op in TWO else ENDS[:1]:
                args = [moving(*a, 1), moving(*b, 0.5)][: 1 + (op in TWO)]
                found = arithmetic.apply(op, args)
                finite = [found[k].is_finite() for k in range(ctx.cap)]
                assert finite[0] or not any(finite), (op, a, b)


@pytest.mark.parametrize("op", [op for op in ONE if op != "fabs"])
def test_coefficients_are_those_of_mpmath(op):
    named = {
        "inv": lambda v: 1 / v,
        "sq": lambda v: v * v,
        "neg": lambda v: -v,
        "twice": lambda v: 2 * v,
    }
    start = {"acosh": 1.75}.get(op, 0.375)
    function = named.get(op) or getattr(mpmath, op)
    with mpmath.workdps(60):
        exact = mpmath.taylor(lambda s: function(start + s / 2 + s * s / 4), 0, 6)
    with length(7):
        found = Series([], "stored").apply(op, [arb_series([start, 0.5, 0.25])])
        for k, value in enumerate(exact):
            assert abs(mpmath.mpf(float(found[k].mid())) - value) < 1e-12
            assert float(found[k].rad()) < 1e-12


@pytest.mark.parametrize("turn", [0.4, 1.2, 1.9, 2.8, -0.3, -1.4, -2.9])
def test_the_angle_of_a_uniform_rotation_grows_by_its_speed(turn):
    """atan2(sin(turn + 3 s), cos(turn + 3 s)) = turn + 3 s in every quadrant."""
    with length(6), precision(200):  # tangents of fast angles cancel
        angle = arb_series([arb(turn), 3])
        found = Series([], "stored").apply("atan2", [angle.sin(), angle.cos()])
        expected = [turn, 3, 0, 0, 0, 0]
        assert all(found[k].overlaps(arb(v)) for k, v in enumerate(expected))
        assert all(found[k].rad() < 1e-9 for k in range(6))


def test_what_jumps_has_a_value_only_for_constants():
    with length(4):
        arithmetic = Series([], "stored")
        still = arithmetic.apply("fmax", [arb_series([2]), arb_series([3])])
        assert [still[k] for k in range(4)] == [3, 0, 0, 0]
        moving = arithmetic.apply("fmax", [arb_series([2, 1]), arb_series([3])])
        assert not any(moving[k].is_finite() for k in range(4))
