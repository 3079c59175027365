"""Rows of the record of a paper: a statement, what computing it gives, and the checks behind it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial, wraps
from pathlib import Path
from typing import Any, Protocol


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


def named(what: str, found: Any, status: str, kind: str) -> Check:
    """Check the status and the kind of a point that was found."""
    return Check(f"{what}{found.status} {found.kind}", (found.status, found.kind) == (status, kind))


def value_of(problem: Any, quantity: str) -> float:
    """A reference value of a problem of the textbook that is a number."""
    value = problem[quantity].value
    assert isinstance(value, float)
    return value


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


#: What a row is computed to: checks; of a claim the value and how it was computed before them.
Checks = Iterable[Check]
Found = tuple[Any, ...]


@dataclass(frozen=True)
class Claim:
    """A statement of a paper with its verdict as in the README, and what computing it gave."""

    name: str
    place: str
    statement: str
    said: str
    found: Found

    @property
    def verdict(self) -> str:
        return self.said.partition(" (")[0]

    @property
    def value(self) -> str:
        return self.found[0]

    @property
    def checks(self) -> tuple[Check, ...]:
        return self.found[2:]

    def cells(self) -> list[str]:
        return [self.name, self.place, self.statement, self.value, self.said, self.found[1]]


class Statements:
    """The rows of a Markdown table of what a paper states, each with the function that computes it.

    ``row`` makes a row of the record from the cells and from what the function returns.
    """

    def __init__(self, path: Path, row: Callable[..., Row] = Claim):
        text = path.read_text(encoding="utf-8").rpartition("<!-- claims")[2]
        table = text.partition("<!-- end")[0]
        lines = [line for line in table.splitlines() if line.startswith("| ")][2:]
        rows = [line[2:-2].split(" | ") for line in lines]
        self.cells = {row[0]: [cell.replace(r"\|", "|") for cell in row[1:]] for row in rows}
        self.row, self.computed = row, dict[str, Callable[[], Row]]()

    def __call__(self, *names: str) -> Callable[[Callable[[], Any]], Callable[[], Row]]:
        """Register a function for the rows with these first cells."""

        def register(compute: Callable[[], Any]) -> Callable[[], Row]:
            def make(name: str) -> Row:
                return self.row(name, *self.cells[name], tuple(compute()))

            for name in names:
                self.computed[name] = wraps(compute)(partial(make, name))
            return self.computed[names[-1]]

        return register

    @property
    def rows(self) -> tuple[Callable[[], Row], ...]:
        """The functions in the order of the table; every row has one."""
        return tuple(self.computed[name] for name in self.cells)
