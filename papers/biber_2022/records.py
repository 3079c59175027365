"""Rows of the tables besides the claims: errata and displayed equations."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..claims import Check, Statements
from ..pictures import Pictures

FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class Erratum:
    """A misprint or error, what is correct, and the checks that show both."""

    number: str
    place: str
    printed: str
    correct: str
    checks: tuple[Check, ...]

    @property
    def name(self) -> str:
        return f"erratum {self.number}"

    @property
    def verdict(self) -> str:
        return "confirmed" if all(c.holds for c in self.checks) else "not confirmed"

    @property
    def value(self) -> str:
        return f"{self.place}: {self.correct}"

    def cells(self) -> list[str]:
        return [self.number, self.place, self.printed, self.correct, self.verdict]


@dataclass(frozen=True)
class Equation:
    """A displayed equation; its verdict is agrees, corrected, definition or assumption."""

    number: str
    label: str
    content: str
    said: str
    checks: tuple[Check, ...]

    @property
    def verdict(self) -> str:
        return self.said.partition(" (")[0]

    @property
    def name(self) -> str:
        return f"equation {self.number}"

    @property
    def value(self) -> str:
        return f"{self.label}: {self.content}"

    def cells(self) -> list[str]:
        return [self.number, self.label, self.content, self.said]


#: What the paper prints, with the functions that derive it again.
ERRATA = Statements(FOLDER / "errata.md", Erratum)
EQUATIONS = Statements(FOLDER / "equations.md", Equation)

picture = Pictures()
