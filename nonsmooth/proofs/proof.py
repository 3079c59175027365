"""Proofs about special points and periodic orbits: statement, enclosures in decimals, and a record for a checker."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..model import NonsmoothError
from .arithmetic.enclosure import Enclosure

_WIDTH = 98


class UnprovenError(NonsmoothError, RuntimeError):
    """No proof was found; the message says what stood in the way and where."""


class DigitsError(UnprovenError):
    """No proof was found, and more digits would not help."""


#: How constants are read.
READ = {
    "stored": "Constants are the doubles stored in the expressions.",
    "written": "Constants are the decimals that the stored doubles are written as.",
}


@dataclass(frozen=True)
class Classification:
    """The class of a proven zero."""

    label: str
    title: str
    why: str = ""
    lines: list[str] = field(default_factory=list)
    values: dict[str, Any] = field(default_factory=dict)
    claims: dict[str, Any] = field(default_factory=dict)
    applies: bool = True
    final: bool = False  # whether more digits would change nothing


@dataclass(frozen=True, eq=False, repr=False)
class Proof:
    """A theorem about one special point or periodic orbit, or what is left open of it.

    Attributes
    ----------
    kind : str
        ``"two-fold"``, ``"fold"``, ``"equilibrium"``, ``"pseudo-equilibrium"`` or
        ``"periodic orbit"``.
    proven : bool
        Whether existence, uniqueness and class are proven, for all parameters that were given.
    exists : bool
        Whether existence and uniqueness are proven, also where the class is not decided.
    label : str
        The class, kind or stability; a boundary of classes where it is exactly on one; ``""`` if undecided.
    statement : str
        The theorem in words.
    point : mapping of str to Enclosure
        The unknowns, over all parameters; of a periodic orbit the states at a plane for each leg.
    box : mapping of str to Enclosure
        Where there is no other; of a proof in pieces that of each piece.
    values : mapping of str to Enclosure
        For two-folds ``nu1``, ``nu2``, ``Delta``, ``T`` and the eigenvalues; the second
        derivatives ``L11`` ... ; for equilibria the eigenvalues and h; for periodic orbits the
        ``period`` and ``multiplier1``, which is 1, ``multiplier2`` ... by their size; there is no 1
        where the system depends on time.
    parameters : mapping of str to Enclosure
        Values or ranges for which it holds.
    pieces : tuple of Proof
        What is proven where, if the parameters had to be divided.
    bits : int
        Precision that was needed.
    record : mapping
        Everything that an independent program needs; see ``save``.
    """

    kind: str
    proven: bool
    exists: bool
    label: str
    statement: str
    point: Mapping[str, Enclosure]
    box: Mapping[str, Enclosure]
    values: Mapping[str, Enclosure]
    parameters: Mapping[str, Enclosure]
    bits: int
    record: Mapping[str, Any] = field(default_factory=dict)
    pieces: tuple[Proof, ...] = ()

    def __str__(self) -> str:
        return self.statement

    def __repr__(self) -> str:
        state = "proven" if self.proven else "exists" if self.exists else "not proven"
        return f"Proof({self.kind}, {self.label or 'undecided'}, {state})"

    def save(self, path: str | Path) -> None:
        """Write the proof as JSON: the graph, the box, the matrix and the claims.

        ``python checker FILE`` (in the repository) checks it; that program shares no code with the
        one that proved it and needs nothing but Python.

        Parameters
        ----------
        path : str or Path
            Where to write it.
        """
        records = [p.record for p in self.pieces] or [self.record]
        text: dict[str, Any] = {"proofs": records}
        if self.pieces:  # which are to cover the whole
            text["ranges"] = self.record["ranges"]
        Path(path).write_text(json.dumps(text, indent=1), encoding="utf-8")


def paragraph(first: str, *lines: str) -> str:
    """A statement as a title and indented lines."""
    wrapped = [textwrap.fill(first, _WIDTH, subsequent_indent="  ")]
    wrapped += [
        textwrap.fill(line, _WIDTH, initial_indent="  ", subsequent_indent="  ")
        for line in lines
        if line
    ]
    return "\n".join(wrapped)


def listed(values: Mapping[str, Enclosure], joint: str = " = ") -> str:
    """Names and numbers in a row."""
    return ", ".join(f"{name}{joint}{value}" for name, value in values.items())


def intervals(values: Mapping[str, Enclosure]) -> str:
    """Names and intervals in a row."""
    return ", ".join(
        f"{name} = {value.low}" if value.exact else f"{name} in [{value.low}, {value.high}]"
        for name, value in values.items()
    )


def hulls(many: list[Mapping[str, Enclosure]]) -> dict[str, Enclosure]:
    """For each name the smallest interval that holds all."""
    result = {}
    for name in many[0] if many else ():
        if all(name in m for m in many):
            low = min((m[name] for m in many), key=lambda e: e.ends[0]).low
            high = max((m[name] for m in many), key=lambda e: e.ends[1]).high
            result[name] = Enclosure(low, high)
    return result
