"""Rows of the record of a paper: a statement, what computing it gives, and the checks behind it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

AGREES = "agrees"
HOLDS = "holds"  # a statement known from memory, which cannot agree with a text that was not read
CORRECTED = "corrected"
NOT_CHECKABLE = "not checkable"
ADDED = "added here"  # not stated by the paper, as far as recalled

#: How the place of a statement begins if it was not read in the paper.
MEMORY, HERE = "known from memory", "computed here"


@dataclass(frozen=True)
class Check:
    """A computed fact, with its number, and whether it holds."""

    what: str
    holds: bool

    def __post_init__(self) -> None:
        object.__setattr__(self, "holds", bool(self.holds))  # NumPy's bool prints in another way

    def __str__(self) -> str:
        return self.what if self.holds else f"FAILS: {self.what}"


def close(what: str, value: float, expected: float, tolerance: float) -> Check:
    """Check that a number is ``expected`` within ``tolerance``; the text shows both."""
    return Check(
        f"{what} = {value:.12g} (expected {expected:.12g})", abs(value - expected) <= tolerance
    )


class Row(Protocol):
    """A row of a table: it holds if all of its checks do."""

    @property
    def name(self) -> str: ...
    @property
    def verdict(self) -> str: ...
    @property
    def value(self) -> str: ...
    @property
    def checks(self) -> tuple[Check, ...]: ...
    def cells(self) -> list[str]: ...


def failures(row: Row) -> list[str]:
    """The checks of a row that do not hold."""
    return [str(check) for check in row.checks if not check.holds]


def corrects(verdict: str, errata: Sequence[int]) -> str:
    """A verdict with the errata that apply."""
    return f"{verdict} (erratum {', '.join(map(str, errata))})" if errata else verdict


@dataclass(frozen=True)
class Claim:
    """A statement of a paper; ``place`` may begin with MEMORY or HERE, ``value`` is what was computed."""

    name: str
    place: str
    statement: str
    value: str
    verdict: str
    how: str
    checks: tuple[Check, ...]
    errata: tuple[int, ...] = ()

    def cells(self) -> list[str]:
        verdict = corrects(self.verdict, self.errata)
        return [self.name, self.place, self.statement, self.value, verdict, self.how]
