"""A claim of a paper, what computing it gives, and the checks behind the verdict."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

AGREES = "agrees"
HOLDS = "holds"  # a statement known from memory, which cannot agree with a text that was not read
CORRECTED = "corrected"
NOT_CHECKABLE = "not checkable"
ADDED = "added here"  # not stated by the paper, as far as recalled

#: Where a statement comes from.
READ, MEMORY, HERE = "read in the paper", "known from memory", "computed here"


@dataclass(frozen=True)
class Check:
    """One computed fact.

    Attributes
    ----------
    what : str
        The fact, with the number computed.
    holds : bool
    """

    what: str
    holds: bool

    def __post_init__(self) -> None:
        object.__setattr__(self, "holds", bool(self.holds))  # numpy's bool is not JSON's

    def __str__(self) -> str:
        return self.what if self.holds else f"FAILS: {self.what}"


@dataclass(frozen=True)
class Claim:
    """A statement of the paper and what computing it gives.

    Attributes
    ----------
    id : str
    place : str
        Section and equation; beginning with ``known from memory`` or ``computed here`` where the paper
        was not at hand.
    statement : str
        What the paper states.
    value : str
        What this code finds.
    verdict : str
        ``agrees``, ``corrected``, ``holds``, ``not checkable`` or ``added here``.
    how : str
        How it was computed.
    checks : tuple of Check
        All hold, or the row is not to be believed.
    errata : tuple of int
        Numbers of the errata that apply.
    """

    id: str
    place: str
    statement: str
    value: str
    verdict: str
    how: str
    checks: tuple[Check, ...]
    errata: tuple[int, ...] = ()

    @property
    def basis(self) -> str:
        """Where the statement comes from: read in the paper, known from memory, or computed here."""
        return next((b for b in (MEMORY, HERE) if self.place.startswith(b)), READ)

    @property
    def where(self) -> str:
        """The place without what is said by :attr:`basis`."""
        return self.place.removeprefix(self.basis).removeprefix(": ")

    @property
    def holds(self) -> bool:
        """Whether every check behind the verdict holds."""
        return all(c.holds for c in self.checks)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {**asdict(self), "holds": self.holds}


def close(what: str, value: float, expected: float, tolerance: float) -> Check:
    """Check that a number is ``expected`` within ``tolerance``; the text shows both."""
    return Check(
        f"{what} = {value:.12g} (expected {expected:.12g})", abs(value - expected) <= tolerance
    )
