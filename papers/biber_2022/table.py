"""Table 1 recomputed from its own dimensional entries, with the rounding of both sides."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from decimal import Decimal
from functools import partial
from itertools import pairwise
from pathlib import Path

from ..claims import Check

DATA = Path(__file__).parent / "data" / "table_ics.json"


@dataclass(frozen=True)
class Row:
    """An entry in 1/s or rad/s; ``radius``: ball radii (mm) for which both printed numbers are right."""

    surface: str
    quantity: str
    unit: str
    dimensional: str
    printed: str
    computed: float
    radius: tuple[float, float] | None
    consistent: bool  # within the roundings, for the stated radius
    fits_all: bool  # for the radius that suits most entries (spins: at all)
    checks: tuple[Check, ...] = ()

    @property
    def name(self) -> str:
        return f"Table 1, {self.surface}, {self.quantity}"

    @property
    def verdict(self) -> str:
        return "agrees" if self.fits_all else "corrected"

    @property
    def value(self) -> str:
        return f"{self.dimensional} {self.unit} is {self.computed:.4g}, printed {self.printed}"

    def cells(self) -> list[str]:
        given = f"{self.dimensional} {self.unit}"
        return [
            *(self.surface, self.quantity, given, self.printed, f"{self.computed:.4g}"),
            self.verdict,
        ]


def rounding_interval(text: str) -> tuple[float, float]:
    """Numbers that round to ``text`` at three significant figures."""
    value = Decimal(text)
    half = Decimal(5).scaleb(value.adjusted() - 3)
    return float(value - half), float(value + half)


def _radius_interval(dimensional: str, printed: str) -> tuple[float, float]:
    low, high = sorted(abs(v) for v in rounding_interval(dimensional))
    least, most = sorted(abs(v) for v in rounding_interval(printed))
    return 1e3 * low / most, 1e3 * high / least


def _deepest(intervals: list[tuple[float, float]]) -> float:
    """Return a radius in as many of the intervals as possible."""
    points = sorted(x for interval in intervals for x in interval)
    middles = [(a + b) / 2 for a, b in pairwise(points)]
    return max(middles, key=lambda r: sum(a <= r <= b for a, b in intervals))


def recomputed() -> list[Row]:
    """Recompute every entry."""
    data = json.loads(DATA.read_text())
    radius = float(data["radius_mm"])
    speeds = [r for r in data["rows"] if r["unit"] == "m/s"]
    common = _deepest([_radius_interval(r["dimensional"], r["printed"]) for r in speeds])
    rows = []
    for r in data["rows"]:
        value = float(r["dimensional"])
        low, high = rounding_interval(r["printed"])
        if r["unit"] == "m/s":
            interval = _radius_interval(r["dimensional"], r["printed"])
            computed = 1e3 * value / radius
            consistent = interval[0] <= radius <= interval[1]
            fits = interval[0] <= common <= interval[1]
        else:
            interval = None
            computed = value * math.pi / 30
            ends = [v * math.pi / 30 for v in rounding_interval(r["dimensional"])]
            consistent = fits = ends[0] <= high and low <= ends[1]
        rows.append(
            Row(**r, computed=computed, radius=interval, consistent=consistent, fits_all=fits)
        )
    return rows


def entry(number: int) -> Row:
    """One entry, from 0."""
    return recomputed()[number]


ROWS = tuple(partial(entry, number) for number in range(12))
