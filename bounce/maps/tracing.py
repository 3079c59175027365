"""Landings whose lift-off has H = 0, from rest outward: what the dividing curve of a bounce begins with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..shot.single import simulate
from .shooting import Shooting

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


def arcs_from_rest(
    shooting: Shooting, mode: str, rest: bool, reach: float, step: float
) -> tuple[Arc, ...]:
    """Follow the curve from rest outward, from arc to arc.

    Parameters
    ----------
    shooting : Shooting
    mode : {"+", "-"}
        Of the slip with which it begins.
    rest : bool
        Whether rest is on the curve.
    reach : float
        Largest abs(xdot), in units of the normal speed.
    step : float
        Distance of neighbouring points on bent arcs, in the same units.
    """
    size = -shooting.ydot

    def out(u: Array) -> str:
        if np.linalg.norm(u) < 1e-6 * size:
            return "rest"
        far = abs(u[0]) >= reach * size or abs(u[1]) >= 3 * (reach * size)
        return "reach" if far else ""

    tracer = ns.orbit.DividingTracer(shooting, step, out, lambda u: 0.2 * _length(u) / size)
    found = list[Arc]()
    for arc in tracer.arcs(mode + "s", _first(shooting, mode, rest), "s" if rest else None):
        if arc.end == "interrupted":
            raise KeyboardInterrupt
        found.append(Arc(arc.itinerary, arc.points, arc.entry, arc.decided, arc.end))
    return tuple(found)


def _first(shooting: Shooting, mode: str, rest: bool) -> list[Array]:
    """Two landings that soon roll into the two-fold; before them rest, if it is on the curve."""
    model, ydot = shooting.model, shooting.ydot
    contact, _ = shooting.land(np.zeros(2))
    duration = simulate(model, 0.0, ydot, 0.0).time - contact
    first = landing_at(shooting, mode, contact + 0.01 * duration, np.zeros(2))
    second = None
    if first is not None:
        second = landing_at(shooting, mode, contact + 0.02 * duration, 2 * first)
    if first is None or second is None or not _length(second - first) > -1e-9 * ydot:
        raise ns.DegenerateError(
            f"{type(model).__name__}: expected landings near rest that roll into the two-fold, "
            "received none. Does the force along the ground depend on x or xdot?"
        )
    return [np.zeros(2), first, second] if rest else [first, second]


def landing_at(shooting: Shooting, mode: str, entry: float, guess: Array) -> Array | None:
    """Landing that slips until ``entry`` and then rolls into the two-fold."""

    def both(u: Array) -> Array:
        slip, rolls = shooting.slip_then_roll(u, mode, entry)
        return np.array([slip, rolls.value])

    return ns.orbit.joint_root(both, guess, -shooting.ydot, 1e-15, 30)


def _length(v: Array) -> float:
    return float(np.linalg.norm(v))
