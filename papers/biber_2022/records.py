"""The rows of the tables besides claims: errata and equations, each with its checks."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from ..claims import Check


@dataclass(frozen=True)
class Erratum:
    """A misprint or error, what is correct, and the computation that shows both.

    Attributes
    ----------
    number : int
    place : str
    printed, correct : str
    checks : tuple of Check
        Facts that show the printed form wrong and the corrected one right.
    """

    number: int
    place: str
    printed: str
    correct: str
    checks: tuple[Check, ...]

    @property
    def confirmed(self) -> bool:
        """Whether every check holds."""
        return all(c.holds for c in self.checks)

    @property
    def verdict(self) -> str:
        """``confirmed`` or ``not confirmed``."""
        return "confirmed" if self.confirmed else "not confirmed"

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {**asdict(self), "verdict": self.verdict}


@dataclass(frozen=True)
class Equation:
    """A displayed equation and its check.

    Attributes
    ----------
    number : int
        Order of appearance among the displayed equations, unnumbered ones included.
    label : str
        The paper's label, or a few words.
    content : str
    verdict : str
        ``agrees``, ``corrected``, ``definition`` (nothing to compute) or ``assumption``.
    checks : tuple of Check
    errata : tuple of int
    """

    number: int
    label: str
    content: str
    verdict: str
    checks: tuple[Check, ...] = ()
    errata: tuple[int, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether every check holds."""
        return all(c.holds for c in self.checks)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {**asdict(self), "holds": self.holds}
