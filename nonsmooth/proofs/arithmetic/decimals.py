"""Decimals around or inside of intervals."""

from __future__ import annotations

from fractions import Fraction

from .enclosure import Enclosure, decimals_of, rounded
from .flint import arb
from .intervals import ends


def enclosure(a: arb) -> Enclosure:
    """Write a finite enclosure as decimals, rounded outward."""
    low, high = ends(a)
    if low == high and len(str(low.denominator)) <= 40:  # a binary fraction is a finite decimal
        text = rounded(low, low.denominator.bit_length() - 1, 0)
        return Enclosure(text, text)
    width = high - low if high > low else abs(low) / 2**200
    places = decimals_of(width) + 2
    return Enclosure(rounded(low, places, -1), rounded(high, places, 1))


def given(low: Fraction, high: Fraction) -> Enclosure:
    """Write an interval exactly as it was given: decimals where they end, else fractions."""
    return Enclosure(_exactly(low), _exactly(high))


def _exactly(value: Fraction) -> str:
    rest, twos, fives = value.denominator, 0, 0
    while rest % 2 == 0:
        rest, twos = rest // 2, twos + 1
    while rest % 5 == 0:
        rest, fives = rest // 5, fives + 1
    return rounded(value, max(twos, fives), 0) if rest == 1 else str(value)


def inner(box: arb, core: arb) -> Enclosure:
    """Decimals inside a box and around what it surely holds, as short as they can be."""
    # What holds in the box holds in what is written, where existence in ``core`` is proven.
    (low, high), (first, last) = ends(box), ends(core)
    places = max(0, decimals_of(high - low))
    while True:
        a, b = rounded(low, places, 1), rounded(high, places, -1)
        if low <= Fraction(a) <= first and last <= Fraction(b) <= high:
            return Enclosure(a, b)
        places += 1
