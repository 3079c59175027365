"""Lists of the special points in a box, complete or not."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..arithmetic.enclosure import Enclosure
from ..proof import Proof, intervals


@dataclass(frozen=True)
class Undecided:
    """A part of the box that is undecided.

    Attributes
    ----------
    box : dict of str to Enclosure
        Range of each unknown.
    why : str
        What stopped the proof, in words.
    """

    box: Mapping[str, Enclosure]
    why: str

    def __str__(self) -> str:
        return f"{intervals(self.box)}: {self.why}"


@dataclass(frozen=True, eq=False, repr=False)
class Census:
    """The special points of one kind in a box, with the parts that are undecided.

    Attributes
    ----------
    kind : str
        Kind of the points: ``"two-fold"``, ``"fold"`` and so on.
    complete : bool
        Whether the list is proven to be complete.
    zeros : tuple of Proof
        Points proven to be in the box.
    edge : tuple of Proof
        Points proven to exist, on an undecided side of the box's face.
    undecided : tuple of Undecided
        Parts of the box where nothing is proven.
    boxes : int
        Pieces of the box that were examined.
    statement : str
        The theorem, or the part of it that is proven.
    record : mapping
        Everything that an independent program needs; see ``save``.
    """

    kind: str
    complete: bool
    zeros: tuple[Proof, ...]
    edge: tuple[Proof, ...]
    undecided: tuple[Undecided, ...]
    boxes: int
    statement: str
    record: Mapping[str, Any] = field(default_factory=dict)

    def save(self, path: str | Path) -> None:
        """Write the list as JSON, so that ``python checker FILE`` can check that it is complete.

        Parameters
        ----------
        path : str or Path
            Where to write it.
        """
        Path(path).write_text(json.dumps({"list": self.record}, indent=1), encoding="utf-8")

    def __str__(self) -> str:
        return self.statement

    def __repr__(self) -> str:
        state = "complete" if self.complete else "incomplete"
        return f"Census({len(self.zeros)} of kind {self.kind}, {state})"
