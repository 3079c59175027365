"""Landings whose lift-off has H = 0, from rest outward: ``ns.manifold`` of the two-fold at lift-off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..shot.simulate import simulate
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
    size, first = -shooting.ydot, _first(shooting, mode, rest)
    words = [mode + "s"] * len(first)
    if rest:
        words[0] = "s"
    far = reach * size
    found = ns.manifold(
        shooting.system,
        _two_fold(shooting, first[-1], mode),
        starts=ns.orbit.ComputedStarts(shooting.land, size),
        box=[(-far, far), (-3 * far, 3 * far)],
        duration=shooting.t_max,
        until="lift-off",
        begin=list(zip(words, first, strict=True)),
        spacing=step,
        parameters=shooting.model.values,
        tol=shooting.tol,
    )
    if not found.complete:
        raise KeyboardInterrupt
    ends = {"bound": "reach", "closed": "rest"}
    return tuple(
        Arc(a.itinerary, a.points, a.entry, a.decided, ends.get(a.end, a.end)) for a in found.arcs
    )


def _two_fold(shooting: Shooting, u: Array, mode: str) -> ns.local.TwoFold:
    """The two-fold at lift-off that a landing rolls into."""
    x = shooting.passage(u, mode + "s").x
    return ns.find_two_fold(shooting.system, near=x, parameters=shooting.model.values)


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
