"""Proofs about orbits: statement, enclosures of events and end, and a record for a checker."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..arithmetic.enclosure import Enclosure
from ..proof import intervals, listed, paragraph


@dataclass(frozen=True)
class ProvenEvent:
    """An event of a proven orbit.

    Attributes
    ----------
    kind : {"crossing", "entry", "exit", "stop", "reset"}
        What happens there.
    name : str
        The surface, stop or reset it belongs to.
    t : Enclosure
        Time since the start.
    x : mapping of str to Enclosure
        State; after the jump for a reset.
    before, after : str
        Modes.
    """

    kind: str
    name: str
    t: Enclosure
    x: Mapping[str, Enclosure]
    before: str
    after: str

    def __str__(self) -> str:
        name = "" if self.kind in ("crossing", "entry", "exit") else f" {self.name!r}"
        return f"{self.kind}{name} {self.before} -> {self.after} at t = {self.t}"


@dataclass(frozen=True, eq=False, repr=False)
class OrbitProof:
    """A theorem about one orbit, or about all orbits from a box.

    Attributes
    ----------
    proven : bool
        Whether the proof reaches the end of the time or a stop.
    status : str
        ``"end"``, the name of the stop, or ``"undecided"``.
    why : str
        What stood in the way.
    itinerary : str
        Modes in order, as far as proven.
    events : tuple of ProvenEvent
        The events, each with enclosures of its time and state.
    start, end : mapping of str to Enclosure
        States; the end is the last one proven.
    parameters : mapping of str to Enclosure
        Enclosures of the values of the parameters.
    t : Enclosure
        Time of the end, since the start.
    steps, bits : int
        Steps taken, and bits of the arithmetic.
    numbers : {"stored", "written"}
        How the constants of the system were read: as doubles or as decimals.
    first, duration : str
        The mode at the start, and the exact duration.
    system : FilippovSystem
        Whose orbit it is.
    """

    proven: bool
    status: str
    why: str
    itinerary: str
    events: tuple[ProvenEvent, ...]
    start: Mapping[str, Enclosure]
    end: Mapping[str, Enclosure]
    parameters: Mapping[str, Enclosure]
    t: Enclosure
    steps: int
    bits: int
    numbers: str
    first: str = ""
    duration: str = ""
    system: Any = None

    def save(self, path: str | Path) -> None:
        """Write the proof as JSON, so that ``python checker FILE`` can follow the orbit again.

        Parameters
        ----------
        path : str or Path
            Where to write it.
        """
        from ..record import motion_of  # imported here, as it needs python-flint

        both = lambda values: [[v.low, v.high] for v in values.values()]
        events = [
            {"t": [e.t.low, e.t.high], "x": both(e.x)}
            | {k: getattr(e, k) for k in ("kind", "name", "before", "after")}
            for e in self.events
        ]
        modes = sorted({self.first, *(e.after for e in self.events)})
        record = motion_of(self.system, self.numbers, modes) | {  # type: ignore[arg-type]
            "proven": self.proven,
            "status": self.status,
            "first": self.first,
            "duration": self.duration,
            "start": both(self.start),
            "parameters": both(self.parameters),
            "events": events,
            "end": both(self.end),
        }
        Path(path).write_text(json.dumps({"orbit": record}, indent=1), encoding="utf-8")

    def __repr__(self) -> str:
        return f"OrbitProof({self.itinerary!r}, {self.status})"

    @property
    def statement(self) -> str:
        """The theorem in words."""
        given = intervals({**self.start, **self.parameters})
        many = any(not v.exact for v in (*self.start.values(), *self.parameters.values()))
        who = "Every orbit" if many else "The orbit"
        if self.proven:
            ending = "" if self.status == "end" else f" and ends at {self.status!r}"
            first = f"Theorem. {who} from {given} has the itinerary {self.itinerary}{ending}."
        else:
            first = (
                f"Theorem in part. {who} from {given} has an itinerary that begins "
                f"{self.itinerary or '(nothing)'}."
            )
        return paragraph(
            first,
            *(f"{event}." for event in self.events[:40]),
            f"At t = {self.t}: {listed(self.end)}.",
            "" if self.proven else f"Undecided from there: {self.why}.",
            f"Constants are {'the stored doubles' if self.numbers == 'stored' else 'decimals'}; "
            f"{self.steps} steps, {self.bits} bits.",
        )

    def __str__(self) -> str:
        return self.statement
