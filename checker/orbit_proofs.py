"""Check of a recorded orbit: integrate it again, in pieces if needed, and compare with its claims."""

from __future__ import annotations

from fractions import Fraction
from itertools import islice, product
from typing import Any

from integration import UNIT, Box, Orbit
from intervals import CheckError, Iv, number
from records import require_orbit

FORMAT = "nonsmooth orbit 1"
_STEPS, _PIECES, _PATIENT, _CORNERS = 4000, 64, 4, 8


class RefutedError(CheckError):
    """A false claim, so that a division into pieces does not help."""


def check_orbit(record: dict[str, Any]) -> str:
    """Integrate a recorded orbit again and compare modes, events and end with its claims."""
    # A box of starts and parameters is divided where it is too wide to be followed in one piece.
    if record.get("format") != FORMAT:
        raise CheckError(f"expected the format {FORMAT!r}, received {record.get('format')!r}")
    if not record["proven"]:
        raise CheckError("the orbit is not claimed to be proven")
    require_orbit(record)
    box = [(number(a), number(b)) for a, b in (*record["start"], *record["parameters"])]
    if any(a > b for a, b in box):
        raise CheckError("a range is empty")
    todo, pieces, steps = [box], 0, 0
    while todo:
        piece = todo.pop()
        pieces += 1
        try:
            steps += _follow(record, piece)
        except RefutedError:
            raise
        except CheckError:
            widths = [
                (b - a) / max(q - p, Fraction(1, 2**1000))
                for (a, b), (p, q) in zip(piece, box, strict=True)
            ]
            if pieces == _PATIENT:
                _refuted(record, box)
            k = widths.index(max(widths))
            if not widths[k] or pieces + len(todo) > _PIECES:
                raise
            (a, b) = piece[k]
            middle = (a + b) / 2
            todo += [[*piece[:k], half, *piece[k + 1 :]] for half in ((middle, b), (a, middle))]
    summary = f" and {pieces} pieces" if pieces > 1 else ""
    return f"the orbit goes through {len(record['events'])} events as claimed, in {steps} steps{summary}"


def _refuted(record: dict[str, Any], box: Box) -> None:
    """Look for an orbit from the middle or a corner of a box that shows the claim to be false."""
    ends = [(a, b) if a < b else (a,) for a, b in box]
    for point in [[(a + b) / 2 for a, b in box], *islice(product(*ends), _CORNERS)]:
        try:
            _follow(record, [(v, v) for v in point])
        except RefutedError:
            raise
        except CheckError:
            continue


def _follow(record: dict[str, Any], piece: Box) -> int:
    """Follow one piece of a box; how many steps it took."""
    orbit, events = Orbit(record, piece), list(record["events"])
    end = Iv.of(record["duration"])
    if record["first"] != orbit.mode:
        raise RefutedError(f"it begins in {orbit.mode!r}, claimed is {record['first']!r}")
    steps, ended, event = 0, False, None
    while not (ended or (event is not None and event[0] == "stop")):
        steps, before = steps + 1, orbit.mode
        if steps > _STEPS:
            raise CheckError(f"more than {_STEPS} steps")
        guard, ended = orbit.advance(end)
        event = orbit.apply(guard) if guard else None
        if event is not None:
            _compare(orbit, before, event, events.pop(0) if events else None)
    if events or record["status"] != ("end" if ended or event is None else event[1]):
        raise RefutedError("the orbit does not end as claimed")
    x = orbit.x
    if (
        ended and orbit.time is not None
    ):  # as after the events, its enclosure has the errors of the other states
        x[orbit.time] = Iv.of(record["start"][orbit.time][0]) + end
    inside(x, record["end"], "the end")
    return steps


def _compare(
    orbit: Orbit, before: str, event: tuple[str, str], claim: dict[str, Any] | None
) -> None:
    kind, name = event
    if claim is None:
        raise RefutedError(f"an event is not claimed: {kind} {name}")
    found = {"kind": kind, "name": name, "before": before, "after": orbit.mode}
    if any(claim[k] != v for k, v in found.items()):
        raise RefutedError(f"claimed is {claim}, found was {found}")
    inside([orbit.t], [claim["t"]], "the time of an event")
    inside(orbit.x, claim["x"], "the state at an event")


def inside(values: list[Iv], claims: list[list[str]], what: str) -> None:
    """Require values to be where they are claimed to be."""
    for v, claim in zip(values, claims, strict=True):
        low, high = (number(c) for c in claim)
        a, b = Fraction(v.a, UNIT), Fraction(v.b, UNIT)
        if b < low or high < a:
            raise RefutedError(f"{what} is not where it is claimed to be")
        if low == high:  # claimed exactly: enclosed to the checker's digits
            low, high = a, a + Fraction(1, 10**12)
        if not (low <= a and b <= high):
            raise CheckError(f"{what} is not proven to be where it is claimed to be")
