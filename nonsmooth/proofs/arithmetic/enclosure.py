"""Enclosures of numbers as decimal strings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from typing import Any


@dataclass(frozen=True)
class Enclosure:
    """A number known to lie between two decimals.

    Attributes
    ----------
    low, high : str
        Decimals; the number is in the closed interval between them. Ends that were given as
        fractions without finite decimals stay fractions, ``"5/7"``.

    Examples
    --------
    >>> third = Enclosure("0.333", "0.334")
    >>> str(third), "1/3" in third, third.exact
    ('0.3335 +- 5e-4', True, False)
    """

    low: str
    high: str

    @property
    def exact(self) -> bool:
        """Whether both ends are the same."""
        return self.low == self.high

    @property
    def ends(self) -> tuple[Fraction, Fraction]:
        """Both ends as fractions."""
        return Fraction(self.low), Fraction(self.high)

    @property
    def middle(self) -> float:
        """The middle, rounded to a double."""
        low, high = self.ends
        return float((low + high) / 2)

    @property
    def radius(self) -> float:
        """Half the width, rounded upward."""
        low, high = self.ends
        half = float((high - low) / 2)
        return math.nextafter(half, math.inf) if half or low != high else 0.0

    def __contains__(self, value: Any) -> bool:
        low, high = self.ends
        return low <= Fraction(value) <= high

    def __str__(self) -> str:
        low, high = self.ends
        if low == high:
            return self.low
        places = decimals_of((high - low) / 2) + 1
        middle = rounded((low + high) / 2, places, 0)
        wide = max(high - Fraction(middle), Fraction(middle) - low)
        return f"{middle} +- {_two_digits(wide)}"

    def __repr__(self) -> str:
        return f"Enclosure({self.low!r}, {self.high!r})"


def _two_digits(width: Fraction) -> str:
    """A positive number with two digits, rounded up."""
    places = decimals_of(width) + 1
    while (digits := math.ceil(width * Fraction(10) ** places)) > 99:
        places -= 1
    return f"{Decimal(digits).scaleb(-places):.1e}".replace(".0e", "e")


def decimals_of(width: Fraction) -> int:
    """Decimals at which a positive width shows one digit."""
    if width <= 0:
        return 0
    digits = len(str(width.numerator)) - len(str(width.denominator))
    return 1 - digits


def rounded(q: Fraction, places: int, direction: int) -> str:
    """A decimal with so many places, rounded down (-1), up (1) or to the nearest (0)."""
    scaled = q * Fraction(10) ** places
    whole = math.floor(scaled) if direction < 0 else math.ceil(scaled)
    if direction == 0:
        whole = round(scaled)
    with localcontext() as context:
        context.prec = max(28, len(str(abs(whole))) + abs(places) + 5)
        value = Decimal(whole).scaleb(-places)
        value = value.normalize() if value else Decimal(0)
        return f"{value:f}" if -places < 30 and value.adjusted() > -7 else f"{value}"
