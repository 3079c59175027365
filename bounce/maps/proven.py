"""Map of landings that are proven to lift off forward or in reverse, by interval arithmetic."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..contact.model import ContactModel
from ..errors import LandingError
from ..shot.certify import certify

#: Outcomes by number, as in ``ProvenMap.outcome``.
OUTCOMES = ("undecided", "forward", "reverse", "rolling")
_Box = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class ProvenMap(ns.result_tables.Tabular):
    """Boxes of landings with what is proven about all bounces from each.

    Attributes
    ----------
    model : ContactModel
        The surface, with its friction.
    ydot : float
        Normal speed at touch-down.
    boxes : ndarray (m, 4)
        Columns: lowest and highest ``xdot``, lowest and highest ``omega``.
    outcome : ndarray of int (m,)
        Index in ``OUTCOMES``.
    itinerary : tuple of str
        Proven phases, ``""`` where undecided.
    interrupted : bool
        Whether Ctrl-C ended it; the rest is undecided.
    """

    model: ContactModel
    ydot: float
    boxes: NDArray[np.float64]
    outcome: NDArray[np.int64]
    itinerary: tuple[str, ...]
    interrupted: bool = False

    def _tables(self) -> dict[str, ns.result_tables.ResultTable]:
        sides = ("xdot_low", "xdot_high", "omega_low", "omega_high")
        columns: dict[str, Any] = dict(zip(sides, self.boxes.T, strict=True))
        columns |= {
            "outcome": np.array(OUTCOMES, object)[self.outcome],
            "itinerary": self.itinerary,
        }
        return {"boxes": ns.result_tables.ResultTable({"box": len(self.boxes)}, columns)}

    @property
    def area(self) -> dict[str, float]:
        """Share of the map's area by outcome."""
        sizes = (self.boxes[:, 1] - self.boxes[:, 0]) * (self.boxes[:, 3] - self.boxes[:, 2])
        return {
            name: float(sizes[self.outcome == k].sum() / sizes.sum())
            for k, name in enumerate(OUTCOMES)
        }

    def at(self, xdot: float, omega: float) -> str:
        """Return the outcome that is proven for a landing.

        Parameters
        ----------
        xdot, omega : float
            A landing inside the ranges of the map.

        Returns
        -------
        str
            One of ``OUTCOMES``; ``"undecided"`` where nothing is proven.

        Raises
        ------
        LandingError
            It is outside the map.
        """
        b = self.boxes
        on = (b[:, 0] <= xdot) & (xdot <= b[:, 1]) & (b[:, 2] <= omega) & (omega <= b[:, 3])
        if not on.any():
            raise LandingError(f"xdot, omega: ({xdot}, {omega}) is outside the map.")
        return OUTCOMES[int(self.outcome[on].max())]


def proven_map(
    model: ContactModel,
    xdot: tuple[float, float],
    omega: tuple[float, float],
    *,
    ydot: float = -1.0,
    parameters: Mapping[str, Any] | None = None,
    depth: int = 6,
    **options: Any,
) -> ProvenMap:
    """Divide a rectangle of landings until each piece is proven to lift off one way, or is small.

    Parameters
    ----------
    model : ContactModel
        The surface, with its friction.
    xdot, omega : (float, float)
        Ranges of the landing's speed and spin.
    ydot : float, optional
        Normal speed at touch-down, negative; default -1.
    parameters : mapping, optional
        As in :func:`certify`.
    depth : int, optional
        How often a piece may be quartered; a piece may take 0.1 s.
    **options
        As in :func:`certify`.

    Returns
    -------
    ProvenMap
        Ctrl-C returns what was proven so far.

    Raises
    ------
    LandingError
        A range in the wrong order; a ``ydot`` that is not negative.
    ModelError
        No contact model of bounces in the plane.
    nonsmooth.ParameterError
        An unknown parameter, or an interval that leaves its limits.
    nonsmooth.proofs.MissingError
        python-flint is not installed.

    Examples
    --------
    >>> import bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    >>> found = bounce.maps.proven_map(turf, xdot=(0.1, 0.11), omega=(1.0, 1.02), depth=1)
    >>> found.at(0.105, 1.01)
    'forward'
    """
    todo: list[tuple[_Box, int]] = [((*_range(xdot, "xdot"), *_range(omega, "omega")), 0)]
    found: list[tuple[_Box, str, str]] = []
    interrupted = False
    while todo:
        box, level = todo.pop()
        try:
            a, b, c, d = box
            proof = certify(model, (a, b), ydot, (c, d), parameters=parameters, **options)
            interrupted = proof.why == "interrupted"  # a proof keeps what it has, too
        except KeyboardInterrupt:
            interrupted = True
        if interrupted:
            found += [(rest, "undecided", "") for rest, _ in [*todo, (box, level)]]
            break
        if proof.proven or level >= depth:
            found.append((box, proof.outcome, proof.itinerary if proof.proven else ""))
        else:
            todo += [(part, level + 1) for part in _quarters(box)]
    boxes, outcomes, itineraries = zip(*found, strict=True)
    numbers = np.array([OUTCOMES.index(outcome) for outcome in outcomes])
    return ProvenMap(model, float(ydot), np.array(boxes), numbers, itineraries, interrupted)


def _range(value: Any, name: str) -> tuple[float, float]:
    try:
        low, high = (float(v) for v in value)
    except (TypeError, ValueError):
        low = high = float("nan")
    if not (np.isfinite([low, high]).all() and low < high):
        raise LandingError(f"{name}: expected (low, high) with low < high, received {value!r}.")
    return low, high


def _quarters(box: _Box) -> list[_Box]:
    a, b, c, d = box
    m, n = 0.5 * (a + b), 0.5 * (c + d)
    return [(a, m, c, n), (m, b, c, n), (a, m, n, d), (m, b, n, d)]
