"""Tracing curves of landings whose lift-off has H = 0, from itinerary to itinerary."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..shot.single import simulate
from .shooting import Arrival, Shooting

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Arc:
    """Landings of one itinerary on the dividing curve.

    Attributes
    ----------
    itinerary : str
        Phases up to the one that meets the surface: ``"+ s"`` rolls into the two-fold, ``"+"``
        slips to lift-off.
    points : ndarray (n, 2)
        ``(xdot, omega)`` along the arc.
    entry : ndarray (n,)
        Times at which the last phase begins; at the first point, of the arc before.
    lift_off : ndarray (n, d)
        States at lift-off: ``x, xdot, y, ydot, omega``, extra states.
    end : str
        Why the arc ends where it does.
    """

    itinerary: str
    points: Array
    entry: Array
    lift_off: Array
    end: str

    @property
    def kind(self) -> str:
        """``"two-fold"`` or ``"slipping"``."""
        return "two-fold" if self.itinerary.endswith("s") else "slipping"

    def __repr__(self) -> str:
        return f"Arc({self.itinerary!r}, {len(self.points)} points, {self.end})"


class Landings(ns.continuation.Curve):
    """Landings with one itinerary whose lift-off meets its condition, to be continued.

    Parameters
    ----------
    shooting : Shooting
    word : str
        The itinerary.
    reach : float, optional
        Largest abs(xdot).
    tol : float, optional
        Error relative to the normal speed.
    """

    exact = False

    def __init__(
        self, shooting: Shooting, word: str, reach: float = np.inf, tol: float = 1e-13
    ) -> None:
        self.shooting, self.word, self.reach, self.tol = shooting, word, reach, tol
        self.scale = -shooting.ydot
        self.known: dict[bytes, Arrival] = {}
        self.secant = ns.continuation.Secant(self._condition, -shooting.ydot)

    def equations(self, u: Array) -> tuple[Array, Array]:
        return self.secant(u)

    def _condition(self, u: Array) -> Array:
        """What vanishes on an arc: A at lift-off after rolling, H after slip."""
        arrival = self.shoot(u)
        return np.array([arrival.pull if self.word.endswith("s") else arrival.slip])

    def shoot(self, u: Array) -> Arrival:
        """The end of the contact, computed once for each landing."""
        key = u.tobytes()
        if key not in self.known:
            self.known[key] = self.shooting.shoot(u, self.word)
        return self.known[key]

    def fault(self, u: Array) -> str:
        return self.shoot(u).fault

    def out(self, u: Array) -> str:
        if np.linalg.norm(u) < -1e-6 * self.shooting.ydot:
            return "rest"
        return "reach" if abs(u[0]) >= self.reach or abs(u[1]) >= 3 * self.reach else ""

    def snap(self, u: Array, tangent: Array, reach: float) -> Array | None:
        """The landing ahead that slips to lift-off with H = A = 0 there: the junction."""
        slip, near = self.word.rstrip("s"), reach * -self.shooting.ydot
        if slip == "" or slip[-1] == "s":
            return None

        def both(v: Array) -> Array:
            a = self.shooting.shoot(v, slip)
            return np.array([a.slip, a.pull])

        root = _root(self.shooting, both, u + 0.5 * near * tangent, 1e-13, 8)
        if root is None or not (np.linalg.norm(root - u) < 2 * near and (root - u) @ tangent > 0):
            return None
        return root

    def directions(self, u: Array) -> list[Array]:
        """Both directions along the level of the condition, by fresh differences."""
        self.secant.forget()
        return ns.continuation.directions(self, u)


class Tracer:
    """Follows the curve from rest outward, from arc to arc.

    Each arc is continued by :mod:`nonsmooth.continuation`; where its itinerary ceases to hold the
    end is located, and a junction is solved for. The next itinerary is what simulations on a small
    circle have in common on both sides of the curve.
    """

    def __init__(self, shooting: Shooting, mode: str, rest: bool, reach: float, step: float):
        self.shooting, self.size = shooting, -shooting.ydot
        self.mode, self.rest = mode, rest
        self.reach, self.step = reach * self.size, step
        self.before: Arrival | None = None

    def arcs(self) -> Iterator[Arc]:
        rows = self._first()
        tangent = (rows[-1] - rows[-2]) / _length(rows[-1] - rows[-2])
        first = ns.continuation.Departure(self._landings(self.mode + "s"), rows, tangent)
        traced = ns.continuation.pieces(
            first,
            self._trace,
            self._following,
            last=lambda arc: arc.end in ("reach", "rest", "interrupted"),
        )
        for departure, arc in traced:
            assert isinstance(departure.curve, Landings)
            yield self._made(departure.curve, arc)
            if arc.end == "interrupted":
                raise KeyboardInterrupt

    def _landings(self, word: str) -> Landings:
        return Landings(self.shooting, word, self.reach)

    def _first(self) -> list[Array]:
        """Two landings that soon roll into the two-fold; before them rest, if it is on the curve."""
        model, ydot = self.shooting.model, self.shooting.ydot
        contact, _ = self.shooting.land(np.zeros(2))
        duration = simulate(model, 0.0, ydot, 0.0).time - contact
        first = landing_at(self.shooting, self.mode, contact + 0.01 * duration, np.zeros(2))
        second = None
        if first is not None:
            second = landing_at(self.shooting, self.mode, contact + 0.02 * duration, 2 * first)
        if first is None or second is None or not _length(second - first) > 1e-9 * self.size:
            raise ns.DegenerateError(
                f"{type(model).__name__}: expected landings near rest that roll into the two-fold, "
                "received none. Does the force along the ground depend on x or xdot?"
            )
        return [np.zeros(2), first, second] if self.rest else [first, second]

    def _trace(self, departure: ns.continuation.Departure) -> ns.continuation.Arc:
        first = 0.2 * _length(departure.rows[-1]) / self.size
        return ns.continuation.trace(
            departure.curve,
            departure.rows,
            departure.tangent,
            step=self.step,
            first=first or self.step,
        )

    def _following(
        self, before: ns.continuation.Departure, arc: ns.continuation.Arc
    ) -> ns.continuation.Departure | None:
        """The next arc: its itinerary, first two points and tangent."""
        assert isinstance(before.curve, Landings)
        word, u, tangent = before.curve.word, arc.points[-1].u, arc.points[-1].tangent
        options: Iterator[tuple[str, Array]] = self._round(u, tangent)
        if arc.end == "junction":
            joined = word[:-1] if word.endswith("s") else word + "s"
            ways = self._landings(joined).directions(u)
            options = chain([(joined, d) for d in ways], options)
        for new, direction in options:
            found = ns.continuation.depart(self._landings(new), u, direction, 1e-3, tangent)
            if found is not None:
                return found
        return None

    def _round(self, u: Array, tangent: Array) -> Iterator[tuple[str, Array]]:
        """Itineraries and directions in which the curve leaves a point, by a small circle."""

        def word(angle: float) -> str:
            v = u + 1e-3 * self.size * np.array([np.cos(angle), np.sin(angle)])
            shot = simulate(self.shooting.model, v[0], self.shooting.ydot, v[1], tol=1e-12)
            return shot.itinerary.replace("F", "").replace(" ", "")

        ahead = float(np.arctan2(tangent[1], tangent[0]))
        for angle, a, b in ns.continuation.changes_around(word, _sign, ahead):
            common = _common(a, b)
            if common:
                yield common, np.array([np.cos(angle), np.sin(angle)])

    def _made(self, curve: Landings, arc: ns.continuation.Arc) -> Arc:
        word, points = curve.word, arc.rows
        rolls, joins = word.endswith("s"), arc.end == "junction"
        inner = [curve.shoot(u) for u in points[1:-1]]
        # At a junction the last rolling phase has no length and cannot be shot.
        shoot = self.shooting.shoot
        last = shoot(points[-1], word.rstrip("s") if joins else word)
        first = self.before or shoot(points[0], word if np.any(points[0]) else "s")
        self.before = last
        if joins and rolls:
            last = last._replace(entry=last.t)
        arrivals = [first, *inner, last]
        entry = np.array([a.entry for a in arrivals])
        states = np.array([a.x for a in arrivals])
        return Arc(" ".join(word), np.array(points), entry, states, arc.end)


def landing_at(shooting: Shooting, mode: str, entry: float, guess: Array) -> Array | None:
    """Landing that slips until ``entry`` and then rolls into the two-fold."""

    def both(u: Array) -> Array:
        slip, arrival = shooting.slip_then_roll(u, mode, entry)
        return np.array([slip, arrival.pull])

    return _root(shooting, both, guess, 1e-15, 30)


def _root(
    shooting: Shooting, both: ns.continuation.Values, guess: Array, tol: float, most: int
) -> Array | None:
    """Root of two conditions near a landing."""
    size = -shooting.ydot
    return ns.continuation.converge(
        ns.continuation.Secant(both, size), guess, tol=tol, scale=size, max_iterations=most
    )


def _length(v: Array) -> float:
    return float(np.linalg.norm(v))


def _sign(word: str) -> int:
    return {"+": 1, "-": -1}.get(word[-1:], 0)


def _common(a: str, b: str) -> str:
    """Return what two itineraries begin with."""
    differ = (k for k, (p, q) in enumerate(zip(a, b, strict=False)) if p != q)
    return a[: next(differ, min(len(a), len(b)))]
