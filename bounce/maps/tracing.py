"""Tracing curves of landings whose lift-off has H = 0, from itinerary to itinerary."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import chain

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..errors import LiftOffError
from ..shot.single import simulate
from .shooting import Arrival, Newton, Shooting

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
        (xdot, omega) along the arc.
    entry : ndarray (n,)
        Times at which the last phase begins; at the first point, of the arc before.
    lift_off : ndarray (n, d)
        States at lift-off: x, xdot, y, ydot, omega, extra states.
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


class Tracer:
    """Follows the curve from rest outward, from arc to arc.

    Steps go along the tangent and Newton's method across it (pseudo-arclength continuation). A
    step onto which the itinerary does not hold is halved until the end of the arc is located; a
    junction is solved for. The next itinerary is what simulations on a small circle have in common
    on both sides of the curve.
    """

    smallest = 1e-9

    def __init__(self, shooting: Shooting, mode: str, rest: bool, reach: float, step: float):
        self.shooting, self.size = shooting, -shooting.ydot
        self.mode, self.rest, self.most = mode, rest, 24
        self.reach, self.step = reach * self.size, step * self.size
        self.known: dict[tuple[str, bytes], Arrival] = {}
        self.before: Arrival | None = None

    def arcs(self) -> Iterator[Arc]:
        word, rows, ends = self.mode + "s", self._first(), list[Array]()
        tangent = (rows[-1] - rows[-2]) / _length(rows[-1] - rows[-2])
        for _ in range(self.most):
            self.newton = Newton(self.size, 1e-13)
            arc, tangent = self._arc(word, rows, tangent)
            yield arc
            if arc.end in ("reach", "rest"):
                return
            if any(_length(arc.points[-1] - e) < 1e-6 * self.size for e in ends):
                return
            ends.append(arc.points[-1])
            following = self._following(arc, word, tangent)
            if following is None:
                return
            word, rows, tangent = following

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

    def _arc(self, word: str, rows: list[Array], tangent: Array) -> tuple[Arc, Array]:
        """Trace one arc from the last of ``rows``."""
        points = [np.asarray(r, float) for r in rows]
        size, closing, end = 0.2 * _length(points[-1]) or self.step, False, ""
        size = min(size, self.step)
        while not end:
            u = points[-1]
            trial, fault = self._correct(word, _ahead(points, size, tangent), tangent)
            bend = 0.0 if trial is None else _angle(trial - u, tangent)
            if trial is None or fault or bend > 0.3:
                closing = closing or bend <= 0.3
                snapped = self._junction(word, u, tangent, 2 * size) if closing else None
                if snapped is not None:
                    points.append(snapped)
                    end = "junction"
                elif size < self.smallest * self.size:
                    end = fault or "lost"
                size *= 0.5
                continue
            tangent = (trial - u) / np.linalg.norm(trial - u)
            points.append(trial)
            end = self._out(trial)
            if not closing and bend < 0.1:
                straight = 10.0 if bend < 1e-6 else 4.0 if bend < 0.01 else 1.0
                size = min(1.6 * size, straight * self.step)
        return self._made(word, points, end), tangent

    def _shoot(self, u: Array, word: str) -> Arrival:
        key = (word, u.tobytes())
        if key not in self.known:
            self.known[key] = self.shooting.shoot(u, word)
        return self.known[key]

    def _correct(self, word: str, guess: Array, tangent: Array) -> tuple[Array | None, str]:
        if self.newton.jacobian is not None:
            self.newton.jacobian[1] = tangent
        level = float(tangent @ guess)
        try:
            root = self.newton.solve(partial(on_line, self.shooting, word, tangent, level), guess)
            return (root, "" if root is None else self._shoot(root, word).fault)
        except LiftOffError:
            return None, "no lift-off"

    def _out(self, u: Array) -> str:
        if np.linalg.norm(u) < 1e-6 * self.size:
            return "rest"
        return "reach" if abs(u[0]) >= self.reach or abs(u[1]) >= 3 * self.reach else ""

    def _junction(self, word: str, u: Array, tangent: Array, near: float) -> Array | None:
        """The landing ahead that slips to lift-off with H = A = 0 there."""
        slip = word.rstrip("s")
        if slip == "" or slip[-1] == "s":
            return None

        def both(v: Array) -> Array:
            a = self.shooting.shoot(v, slip)
            return np.array([a.slip, a.pull])

        root = Newton(self.size, 1e-13).solve(both, u + 0.5 * near * tangent, iterations=8)
        if root is None or not (np.linalg.norm(root - u) < 2 * near and (root - u) @ tangent > 0):
            return None
        return root

    def _following(
        self, arc: Arc, word: str, tangent: Array
    ) -> tuple[str, list[Array], Array] | None:
        """The next arc: its itinerary, first two points and tangent."""
        u, self.newton = arc.points[-1], Newton(self.size, 1e-13)
        options: Iterator[tuple[str, Array]] = self._round(u, tangent)
        if arc.end == "junction":
            joined = word[:-1] if word.endswith("s") else word + "s"
            options = chain([(joined, d) for d in self._directions(u, joined)], options)
        for new, direction in options:
            first, fault = self._correct(new, u + 1e-3 * self.size * direction, direction)
            if first is None or fault:
                continue
            ahead = (first - u) / _length(first - u)
            if ahead @ tangent > -0.9:  # else it is the way back
                return new, [u, first], ahead
        return None

    def _directions(self, u: Array, word: str) -> list[Array]:
        """Both directions along the level of an itinerary's condition, by differences."""
        delta = 1e-6 * self.size
        rows = [_condition(self.shooting, word, u + delta * e) for e in np.eye(2)]
        slope = (np.array(rows) - _condition(self.shooting, word, u)) / delta
        along = np.array([-slope[1], slope[0]]) / np.linalg.norm(slope)
        return [along, -along]

    def _round(self, u: Array, tangent: Array) -> Iterator[tuple[str, Array]]:
        """Itineraries and directions in which the curve leaves a point, by a small circle."""
        start = np.arctan2(tangent[1], tangent[0])
        angles = start + np.linspace(-np.pi, np.pi, 49)[3:-3]  # without the way it came
        radius = 1e-3 * self.size
        words = [self._word(u, radius, a) for a in angles]
        for k in sorted(range(len(words) - 1), key=lambda k: abs(k - len(words) // 2)):
            (low, high), (a, b) = angles[k : k + 2], words[k : k + 2]
            if _sign(a) * _sign(b) >= 0:
                continue
            for _ in range(12):
                middle = 0.5 * (low + high)
                c = self._word(u, radius, middle)
                low, high, a, b = (
                    (middle, high, c, b) if _sign(c) == _sign(a) else (low, middle, a, c)
                )
            common = _common(a, b)
            if common:
                yield common, np.array([np.cos(middle), np.sin(middle)])

    def _word(self, u: Array, radius: float, angle: float) -> str:
        v = u + radius * np.array([np.cos(angle), np.sin(angle)])
        shot = simulate(self.shooting.model, v[0], self.shooting.ydot, v[1], tol=1e-12)
        return shot.itinerary.replace("F", "").replace(" ", "")

    def _made(self, word: str, points: list[Array], end: str) -> Arc:
        rolls, joins = word.endswith("s"), end == "junction"
        inner = [self._shoot(u, word) for u in points[1:-1]]
        # At a junction the last rolling phase has no length and cannot be shot.
        last = self._shoot(points[-1], word.rstrip("s") if joins else word)
        first = self.before or self._shoot(points[0], word if np.any(points[0]) else "s")
        self.before = last
        if joins and rolls:
            last = last._replace(entry=last.t)
        arrivals = [first, *inner, last]
        entry = np.array([a.entry for a in arrivals])
        return Arc(" ".join(word), np.array(points), entry, np.array([a.x for a in arrivals]), end)


def _condition(shooting: Shooting, word: str, u: Array) -> float:
    """What vanishes on an arc: A at lift-off after rolling, H after slip."""
    arrival = shooting.shoot(u, word)
    return arrival.pull if word.endswith("s") else arrival.slip


def on_line(shooting: Shooting, word: str, axis: Array, level: float, u: Array) -> Array:
    """What vanishes where an itinerary's arc meets the line axis . u = level; (2,)."""
    return np.array([_condition(shooting, word, u), float(axis @ u) - level])


def landing_at(shooting: Shooting, mode: str, entry: float, guess: Array) -> Array | None:
    """Landing that slips until ``entry`` and then rolls into the two-fold."""

    def both(u: Array) -> Array:
        slip, arrival = shooting.slip_then_roll(u, mode, entry)
        return np.array([slip, arrival.pull])

    return Newton(-shooting.ydot).solve(both, guess)


def _ahead(points: list[Array], size: float, tangent: Array) -> Array:
    """Guess for the point ``size`` ahead: the polynomial in arclength through the last six."""
    last = np.array(points[-6:])
    if len(last) < 3:
        return points[-1] + size * tangent
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(last, axis=0), axis=1))])
    nodes = s - s[-1]
    weights = [np.prod([(size - b) / (a - b) for b in nodes if b != a]) for a in nodes]
    return np.asarray(weights @ last)


def _length(v: Array) -> float:
    return float(np.linalg.norm(v))


def _angle(step: Array, tangent: Array) -> float:
    length = _length(step)
    return float(np.arccos(np.clip(step @ tangent / length, -1, 1))) if length else np.pi


def _sign(word: str) -> int:
    return {"+": 1, "-": -1}.get(word[-1:], 0)


def _common(a: str, b: str) -> str:
    """Return what two itineraries begin with."""
    differ = (k for k, (p, q) in enumerate(zip(a, b, strict=False)) if p != q)
    return a[: next(differ, min(len(a), len(b)))]
