"""Mean value forms of the checker enclose values at random points of a set."""

import importlib
import sys
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest

from tests.proofs.checking import CHECKER


@pytest.fixture(scope="module")
def checker():
    """The modules of the checker, which is a program and no package."""
    names = ("intervals", "mean_value_forms", "zeros")
    before = dict(sys.modules)
    sys.path.insert(0, str(CHECKER))
    try:
        yield {name: importlib.import_module(name) for name in names}
    finally:
        sys.path.remove(str(CHECKER))
        for name in set(sys.modules) - set(before):
            if Path(getattr(sys.modules[name], "__file__", None) or ".").parent == CHECKER:
                del sys.modules[name]


def functions(elementary):
    """Pairs of the same function, for the checker and for mpmath."""
    m, f = mpmath, elementary
    return [
        (lambda p, q: p * q - q / p, lambda p, q: p * q - q / p),
        (lambda p, q: f.whole(2) / (p - q * q), lambda p, q: 2 / (p - q * q)),
        (lambda p, q: f.exp(p - q).sq() - q, lambda p, q: m.exp(p - q) ** 2 - q),
        (lambda p, q: f.sin(p * q) + f.cos(q) / p, lambda p, q: m.sin(p * q) + m.cos(q) / p),
        (lambda p, q: f.sqrt(p + q.sq()) - f.log(p), lambda p, q: m.sqrt(p + q * q) - m.log(p)),
        (lambda p, q: f.atan(p / q) * f.erf(q), lambda p, q: m.atan(p / q) * m.erf(q)),
        (lambda p, q: f.power(p - q, 3) - p, lambda p, q: (p - q) ** 3 - p),
    ]


@pytest.mark.parametrize("k", range(7))
def test_values_are_in_their_ranges_and_moved_sets_hold_their_points(k, checker):
    intervals, forms, rng = (
        checker["intervals"],
        checker["mean_value_forms"],
        np.random.default_rng(k),
    )
    iv, unit = intervals.Iv, intervals.whole(1).a
    ours, theirs = functions(intervals)[k]
    holds = lambda enclosure, value: (
        mpmath.mpf(enclosure.a) / unit <= value <= mpmath.mpf(enclosure.b) / unit
    )
    with mpmath.workdps(60):
        for _ in range(10):
            low = rng.uniform([1.5, 0.3], [2.5, 0.9])
            high = low + 10.0 ** rng.uniform(-8, -1, size=2)
            states = forms.States(
                [iv.of(Fraction(a), Fraction(b)) for a, b in zip(low, high, strict=True)], True
            )
            p, q = states.values
            first = [ours(p, q), p + q * intervals.whole(3)]
            states.become(first)
            second = states.values[0] - states.values[1] * states.values[0]
            natural = ours(forms.span(p), forms.span(q))
            assert first[0].b - first[0].a <= natural.b - natural.a
            for share in rng.uniform(size=(5, 2)):
                at = [
                    mpmath.mpf(a) + mpmath.mpf(s) * (mpmath.mpf(b) - mpmath.mpf(a))
                    for a, b, s in zip(low, high, share, strict=True)
                ]
                x, y = theirs(*at), at[0] + 3 * at[1]
                assert holds(first[0], x) and holds(states.values[0], x)
                assert holds(first[1], y) and holds(states.values[1], y)
                assert holds(second, x - y * x)


def test_what_sets_are_tied_by_is_kept(checker):
    """x - x is nothing on a set, and a rotation there and back gives the set again."""
    forms, iv, whole = (
        checker["mean_value_forms"],
        checker["intervals"].Iv,
        checker["intervals"].whole,
    )
    states = forms.States([iv.of("9/10", "11/10"), iv.of("-1/10", "1/10")], True)
    p, q = states.values
    assert (p - p).zero
    wide = p.b - p.a
    for _ in range(10):
        p, q = states.values
        states.become([whole(3) * p - whole(4) * q, whole(4) * p + whole(3) * q])
        p, q = states.values
        back = whole(25)
        states.become([(whole(3) * p + whole(4) * q) / back, (whole(3) * q - whole(4) * p) / back])
    assert states.values[0].b - states.values[0].a < 1.0001 * wide


def test_the_time_of_a_zero_is_a_function_on_the_set(checker):
    """x0 + v t falls through zero at -x0/v, and where it is then is known to second order."""
    forms, zeros, iv = checker["mean_value_forms"], checker["zeros"], checker["intervals"].Iv
    unit = checker["intervals"].whole(1).a
    x, v = forms.States([iv.of("9/10", "11/10"), iv.of("-2", "-9/5")], True).values
    time = zeros.first_zero([x, v], unit, 0)
    exact = Fraction(9, 20), Fraction(11, 18)
    assert Fraction(time.a, unit) <= exact[0] and exact[1] <= Fraction(time.b, unit)
    assert (time.b - time.a) / unit < 1.2 * float(exact[1] - exact[0])
    reached = zeros.passed([x, v], time)
    assert reached.a <= 0 <= reached.b
    narrow = [iv.of("99/100", "101/100"), iv.of("-191/100", "-189/100")]
    c = list(forms.States(narrow, True).values)
    other = zeros.passed(c, zeros.first_zero(c, unit, 0))
    assert other.b - other.a < (reached.b - reached.a) / 50  # of second order: ten times narrower
    with pytest.raises(zeros.UnsureError):
        zeros.first_zero([x, v], unit // 2, 0)  # some pass it, some do not yet
    assert zeros.first_zero([x, v], unit // 3, 0) is None
