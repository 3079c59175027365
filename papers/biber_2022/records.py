"""Rows of the tables besides the claims: errata and displayed equations."""

from __future__ import annotations

from dataclasses import dataclass

from ..claims import Check, corrects


@dataclass(frozen=True)
class Erratum:
    """A misprint or error, what is correct, and the checks that show both."""

    number: int
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
        return [str(self.number), self.place, self.printed, self.correct, self.verdict]


@dataclass(frozen=True)
class Equation:
    """A displayed equation; its verdict is agrees, corrected, definition or assumption."""

    number: int
    label: str
    content: str
    verdict: str
    checks: tuple[Check, ...] = ()
    errata: tuple[int, ...] = ()

    @property
    def name(self) -> str:
        return f"equation {self.number}"

    @property
    def value(self) -> str:
        return f"{self.label}: {self.content}"

    def cells(self) -> list[str]:
        verdict = corrects(self.verdict, self.errata)
        return [str(self.number), self.label, self.content, verdict]
