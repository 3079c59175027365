"""The dividing curve and surface: landings that lift off without slip, H_F = 0.

They separate forward from reverse slip at lift-off. For a given normal speed they form a curve in the
plane of landings (xdot, omega), made of arcs:

- on *two-fold* arcs the ball rolls into the two-fold set H = L1 = L2 = 0 at lift-off. On one side
  it stops rolling just before lift-off and slips forward, on the other side in reverse;
- on *slipping* arcs it slips up to lift-off, where H vanishes just then.

Arcs end where the itinerary changes. A two-fold arc and a slipping arc meet at their junction, where
the last rolling phase has length zero: H = A = 0 at lift-off after slip.

Biber, Champneys & Szalai (2022) construct the two-fold arc by integration backward from the
two-fold set. Here landings are integrated forward with the itinerary fixed, a smooth problem, and
Newton's method solves the conditions at lift-off (the same curve, to rounding). This needs no
formula for lift-off, so it also works where the normal motion depends on the tangential one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..contact.model import ContactModel
from ..parameters import number
from ..shot.simulate import simulate
from ..shot.state import State, require_model
from .shooting import Shooting

Array = NDArray[np.float64]


#: A speed this near to that of a point, relative to the next one, is that point: at a junction rounding
#: may put the landing on the other arc.
_AT_POINT = 1e-13


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


@dataclass(frozen=True, eq=False, repr=False)
class DividingCurve(ns.result_tables.Tabular):
    """Landings ``(xdot, omega)`` that lift off without slip, at one normal speed.

    Attributes
    ----------
    model : ContactModel
        The surface, with its friction.
    ydot : float
        Normal speed at touch-down.
    arcs : tuple of Arc
        The half that begins at rest with forward slip, outward, each where the one before ends.
    reverse : tuple of Arc
        The other half, on a slope or for a model that is not symmetric.
    mirrored : bool
        Whether the other half is the mirror image of this one, with ``-xdot`` and ``-omega``.
    tol : float
        Tolerance of the runs that the curve was found with.
    """

    model: ContactModel
    ydot: float
    arcs: tuple[Arc, ...]
    reverse: tuple[Arc, ...]
    mirrored: bool
    tol: float

    def _tables(self) -> dict[str, ns.result_tables.ResultTable]:
        parts = [
            {
                "kind": np.full(len(arc.points), arc.kind, object),
                "xdot": arc.points[:, 0],
                "ydot": np.full(len(arc.points), self.ydot),
                "omega": arc.points[:, 1],
            }
            for arc in (*self.arcs, *self.reverse)
        ]
        return {"points": ns.result_tables.joined("arc", parts)}

    @property
    def two_fold(self) -> Array:
        """Landings that reach the two-fold, (n, 2) of ``(xdot, omega)``; arcs follow each other."""
        return self._points("two-fold")

    @property
    def slipping(self) -> Array:
        """Landings that slip up to lift-off with $H = 0$ there, (n, 2) of ``(xdot, omega)``."""
        return self._points("slipping")

    @property
    def junction(self) -> Array | None:
        """The first landing ``(xdot, omega)`` shared by a two-fold and a slipping arc, or None."""
        for first, second in zip(self.arcs, self.arcs[1:], strict=False):
            if first.kind != second.kind:
                return first.points[-1]
        return None

    @property
    def complete(self) -> bool:
        """Whether the curve was traced to ``reach``; ``arcs[-1].end`` is the reason if not."""
        halves = [half for half in (self.arcs, self.reverse) if half]
        return all(half[-1].end == "reach" for half in halves)

    @property
    def points(self) -> Array:
        """The whole half that begins with forward slip, (n, 2)."""
        return np.concatenate([arc.points for arc in self.arcs])

    def _points(self, which: str) -> Array:
        chosen = [arc.points for arc in self.arcs if arc.kind == which]
        return np.concatenate(chosen) if chosen else np.empty((0, 2))

    def omega(self, xdot: ArrayLike) -> Array:
        """Spin on the curve at given speeds; solved for, not interpolated (some ms each).

        Parameters
        ----------
        xdot : array_like (...)
            Beyond the half that begins with forward slip, the mirrored half is used.

        Returns
        -------
        ndarray (...)
            Where the curve has several spins for a speed, the first one from rest.

        Raises
        ------
        nonsmooth.PointError
            A speed that the curve does not reach.
        """
        speeds = np.asarray(xdot, dtype=float)
        shooting = Shooting(self.model, self.ydot, tol=_integration(self.tol))
        curves: dict[str, ns.orbit.StartCurve] = {}
        values = [self._omega(float(v), shooting, curves) for v in speeds.ravel()]
        return np.array(values).reshape(speeds.shape)

    def _omega(
        self, xdot: float, shooting: Shooting, curves: dict[str, ns.orbit.StartCurve]
    ) -> float:
        for sign in (1.0, -1.0) if self.mirrored else (1.0,):
            for arc in (*self.arcs, *self.reverse):
                found = _bracket(arc.points[:, 0], sign * xdot)
                if found is None:
                    continue
                k, weight = found
                guess = (1 - weight) * arc.points[k] + weight * arc.points[k + 1]
                if min(weight, 1.0 - weight) <= _AT_POINT:
                    return sign * float(guess[1])
                modes = arc.itinerary.replace(" ", "")
                curve = curves.setdefault(modes, ns.orbit.StartCurve(shooting, modes, tol=1e-15))
                guess[0] = sign * xdot
                root = curve.correct(guess, np.array([1.0, 0.0]), max_iterations=30)
                if root is not None:
                    return sign * float(root[1])
        ends = np.concatenate([arc.points[:, 0] for arc in (*self.arcs, *self.reverse)])
        low, high = ends.min(), ends.max()
        both = " and its mirror image" if self.mirrored else ""
        raise ns.PointError(
            f"xdot is {xdot!r}, but the curve is known in [{low:.6g}, {high:.6g}]{both}. Give "
            "dividing_curve a larger reach."
        )

    def at_entry(self, time: float, itinerary: str = "+ s") -> State:
        """Landing that begins to roll at a given time and rolls into the two-fold.

        Parameters
        ----------
        time : float
            After touch-down, before lift-off.
        itinerary : {"+ s", "- s"}
            Forward or reverse slip before it rolls.

        Returns
        -------
        State
            The state at touch-down.

        Raises
        ------
        nonsmooth.PointError
            There is no such landing.
        LiftOffError
            ``time`` is not before lift-off.

        Examples
        --------
        >>> import bounce
        >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4, load="net")
        >>> start = bounce.dividing_curve(turf).at_entry(1.5)
        >>> f"{start.xdot:.12f}, {start.omega:.12f}"
        '0.291276497193, 0.852376712353'
        """
        modes = itinerary.replace(" ", "")
        if modes not in ("+s", "-s"):
            raise ns.OptionError(f"itinerary: expected '+ s' or '- s', received {itinerary!r}.")
        shooting = Shooting(self.model, self.ydot, tol=_integration(self.tol))
        root = _landing_at(shooting, modes[0], time, np.zeros(2))
        fault = "Newton's method finds none"
        if root is not None:
            fault = shooting.slip_then_roll(root, modes[0], time)[1].fault
        if root is None or fault:
            raise ns.PointError(
                f"time is {time!r}, at which no ball begins to roll that reaches the two-fold: {fault}."
            )
        return State(xdot=float(root[0]), ydot=self.ydot, omega=float(root[1]))

    def __repr__(self) -> str:
        arcs = ", ".join(f"{arc.itinerary!r} ({len(arc.points)})" for arc in self.arcs)
        where = (
            "none" if self.junction is None else f"({self.junction[0]:.6g}, {self.junction[1]:.6g})"
        )
        return f"DividingCurve(ydot={self.ydot:g}, arcs {arcs}, junction {where})"


def dividing_curve(
    model: ContactModel,
    ydot: float = -1.0,
    *,
    reach: float = 3.0,
    step: float = 0.05,
    tol: float = 1e-12,
) -> DividingCurve:
    """Trace the curve $H_F = 0$ that divides forward from reverse slip at lift-off.

    Parameters
    ----------
    model : ContactModel
        The surface, with its friction.
    ydot : float
        Normal speed at touch-down, negative.
    reach : float, optional
        Largest ``abs(xdot)`` traced, in units of ``abs(ydot)``.
    step : float, optional
        Distance of neighbouring points on bent arcs, in the same units.
    tol : float, optional
        Error of the points relative to ``abs(ydot)``.

    Returns
    -------
    DividingCurve
        The part that is connected to rest, ``xdot = omega = 0``.

    Raises
    ------
    nonsmooth.DegenerateError
        A lift-off without a visible two-fold: the load ends with zero rate (Hertz without
        gravity), friction is single-valued (a bristle), or no force acts along the ground.
    ModelError
        No contact model of bounces in the plane.
    nonsmooth.OptionError
        ``ydot`` is not negative; ``reach``, ``step`` or ``tol`` is not positive.

    Examples
    --------
    >>> import bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4, load="net")
    >>> curve = bounce.dividing_curve(turf)
    >>> [arc.itinerary for arc in curve.arcs]
    ['+ s', '+']
    >>> [f"{v:.12f}" for v in curve.junction]
    ['0.444625790183', '1.596758407029']
    >>> f"{curve.omega(2.0):.9f}"
    '1.596825491'
    """
    require_model(model)
    speed = number(ydot, "ydot", ns.OptionError)
    numbers = dict(reach=reach, step=step, tol=tol)
    checked = {k: number(v, k, ns.OptionError) for k, v in numbers.items()}
    for name, value in {**checked, "-ydot": -speed}.items():
        if value <= 0:
            raise ns.OptionError(f"{name}: expected a positive number, received {value!r}.")
    shooting = Shooting(model, speed, tol=_integration(tol))
    _require_two_fold(shooting)
    mirrored = _symmetric(shooting)
    halves = [
        _arcs_from_rest(shooting, mode, mirrored, checked["reach"], checked["step"])
        for mode in ("+" if mirrored else "+-")
    ]
    return DividingCurve(model, speed, halves[0], (*halves, ())[1], mirrored, checked["tol"])


@dataclass(frozen=True, eq=False, repr=False)
class DividingSurface(ns.result_tables.Tabular):
    """$H_F = 0$ in the space of landings (xdot, ydot, $omega$), as curves at several normal speeds.

    Attributes
    ----------
    curves : tuple of DividingCurve
        In the order of ``ydot``.
    """

    curves: tuple[DividingCurve, ...]

    def _tables(self) -> dict[str, ns.result_tables.ResultTable]:
        parts = [curve._tables()["points"].columns for curve in self.curves]
        return {"points": ns.result_tables.joined("curve", parts)}

    @property
    def ydot(self) -> Array:
        """Normal speeds, (k,)."""
        return np.array([curve.ydot for curve in self.curves])

    @property
    def two_fold(self) -> list[Array]:
        """For each normal speed (n, 3) of (xdot, ydot, $omega$)."""
        return [_with_ydot(curve.two_fold, curve.ydot) for curve in self.curves]

    @property
    def slipping(self) -> list[Array]:
        """For each normal speed (n, 3) of (xdot, ydot, $omega$)."""
        return [_with_ydot(curve.slipping, curve.ydot) for curve in self.curves]

    @property
    def junction(self) -> Array:
        """Line where the parts meet, (k, 3); NaN where they do not."""
        rows = [np.full(2, np.nan) if c.junction is None else c.junction for c in self.curves]
        return np.column_stack([np.array(rows)[:, 0], self.ydot, np.array(rows)[:, 1]])

    def __repr__(self) -> str:
        return f"DividingSurface({len(self.curves)} curves, ydot = {self.ydot.tolist()})"


def dividing_surface(
    model: ContactModel,
    ydot: ArrayLike,
    *,
    reach: float = 3.0,
    step: float = 0.05,
    tol: float = 1e-12,
) -> DividingSurface:
    """Trace the dividing surface at several normal speeds.

    Without gravity a linear model's field is homogeneous of degree one and the surface is a cone.

    Parameters
    ----------
    model : ContactModel
        The surface, with its friction.
    ydot : array_like (k,)
        Normal speeds at touch-down, $< 0$.
    reach, step, tol : float, optional
        As in :func:`dividing_curve`.

    Returns
    -------
    DividingSurface
        The dividing curves, one for each normal speed.

    Raises
    ------
    LandingError, ModelError, nonsmooth.OptionError
        As :func:`dividing_curve`.

    Examples
    --------
    >>> import bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    >>> surface = bounce.maps.dividing_surface(turf, [-0.5, -1.0])
    >>> (surface.junction / surface.ydot[:, None]).round(9)
    array([[-0.444..., 1. , -1.59...],
           [-0.444..., 1. , -1.59...]])
    """
    speeds = np.atleast_1d(np.asarray(ydot, dtype=float))
    if speeds.ndim != 1 or speeds.size == 0:
        raise ns.OptionError(f"ydot: expected a list of speeds, received shape {speeds.shape}.")
    return DividingSurface(
        tuple(dividing_curve(model, v, reach=reach, step=step, tol=tol) for v in speeds.tolist())
    )


def _with_ydot(points: Array, ydot: float) -> Array:
    return np.column_stack([points[:, 0], np.full(len(points), ydot), points[:, 1]])


def critical_eta(
    model: ContactModel,
    *,
    name: str = "eta",
    bounds: tuple[float, float] = (0.05, 3.0),
    ydot: float = -1.0,
    xdot: float = 1e-4,
) -> float:
    """Smallest tangential frequency ratio at which a slow shot without spin lifts off in topspin slip.

    A slow shot without spin soon rolls, with $x = 0$ and $x' > 0$, and lifts off with $H_F$ of the sign
    of its tangential acceleration A there: negative (reverse slip) for a soft ground. The value
    returned is the first zero of A at lift-off.

    Parameters
    ----------
    model : ContactModel
        The surface, with its friction.
    name : str, optional
        The parameter that is varied.
    bounds : (float, float), optional
        Range of the search for the zero.
    ydot, xdot : float, optional
        Landing; ``xdot`` is small, so that what depends on its square is lost in rounding.

    Returns
    -------
    float
        The smallest such ratio.

    Raises
    ------
    ModelError
        What is no contact model.
    nonsmooth.ConvergenceError
        No change of sign within the bounds.

    Examples
    --------
    >>> import bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    >>> f"{bounce.maps.critical_eta(turf):.6f}"
    '1.19...'
    """
    require_model(model)
    from scipy.optimize import brentq  # slow to import

    def pull(value: float) -> float:
        shooting = Shooting(model.replace(**{name: value}), ydot)
        k = 1.0 / model.values["inertia"]
        rolling = xdot * k / (1 + k)  # slip ends at once: xdot - omega/k... is conserved
        return shooting.passage(np.array([rolling, -rolling]), "s").value / rolling

    grid = np.linspace(*bounds, 60)
    values = [pull(v) for v in grid]
    for k in range(len(grid) - 1):
        if values[k] < 0 <= values[k + 1]:
            return float(brentq(pull, grid[k], grid[k + 1], xtol=1e-13, rtol=1e-14))
    raise ns.ConvergenceError(
        f"{name} has no change to forward slip within {bounds}: A at lift-off per speed is "
        f"{values[0]:.4g} and {values[-1]:.4g} at the ends. Widen bounds.",
        residual=min(map(abs, values)),
        point=grid,
    )


def _arcs_from_rest(
    shooting: Shooting, mode: str, rest: bool, reach: float, step: float
) -> tuple[Arc, ...]:
    """Trace the curve outward from rest, which is on it or not, with slip of this mode."""
    size, first = -shooting.ydot, _first(shooting, mode, rest)
    itineraries = [mode + "s"] * len(first)
    if rest:
        itineraries[0] = "s"
    far = reach * size
    found = ns.manifold(
        shooting.system,
        _two_fold(shooting, first[-1], mode),
        starts=ns.orbit.ComputedStarts(shooting.land, size),
        box=[(-far, far), (-3 * far, 3 * far)],
        duration=shooting.t_max,
        until="lift-off",
        begin=list(zip(itineraries, first, strict=True)),
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
    first = _landing_at(shooting, mode, contact + 0.01 * duration, np.zeros(2))
    second = None
    if first is not None:
        second = _landing_at(shooting, mode, contact + 0.02 * duration, 2 * first)
    if first is None or second is None or not np.linalg.norm(second - first) > -1e-9 * ydot:
        raise ns.DegenerateError(
            f"{type(model).__name__} has no landings near rest that roll into the two-fold. Let its force "
            "along the ground depend on x or xdot."
        )
    return [np.zeros(2), first, second] if rest else [first, second]


def _landing_at(shooting: Shooting, mode: str, entry: float, guess: Array) -> Array | None:
    """Landing that slips until ``entry`` and then rolls into the two-fold."""

    def both(u: Array) -> Array:
        slip, rolls = shooting.slip_then_roll(u, mode, entry)
        return np.array([slip, rolls.value])

    return ns.orbit.joint_root(both, guess, -shooting.ydot, 1e-15, 30)


def _bracket(values: Array, target: float) -> tuple[int, float] | None:
    """First interval of a sequence that holds a value, and the weight of its right end."""
    low, high = np.minimum(values[:-1], values[1:]), np.maximum(values[:-1], values[1:])
    inside = np.flatnonzero((low <= target) & (target <= high) & (low < high))
    if not inside.size:
        return None
    k = int(inside[0])
    return k, float((target - values[k]) / (values[k + 1] - values[k]))


def _integration(tol: float) -> float:
    """Tolerance of the integration for points to ``tol``."""
    return max(0.1 * tol, 1e-14)


def _symmetric(shooting: Shooting) -> bool:
    """Whether (x, xdot, omega) -> -(x, xdot, omega) maps forward slip to reverse slip."""
    system, flip = shooting.system, np.ones(shooting.system.dimension)
    flip[[0, 1, 4]] = -1.0
    rng = np.random.default_rng(0)
    above, below = system.field("+"), system.field("-")
    for _ in range(5):
        x = rng.uniform(-1, 1, system.dimension)
        x[2] = -abs(x[2])
        x[4] = abs(x[1]) + abs(x[4])
        one = system.evaluate(above, x, shooting.model.values)[:, 0]
        other = system.evaluate(below, flip * x, shooting.model.values)[:, 0]
        if not np.allclose(one, flip * other, rtol=1e-12, atol=1e-12):
            return False
    return True


def _require_two_fold(shooting: Shooting) -> None:
    """Refuse models whose lift-off has no visible two-fold of dry friction."""
    who = type(shooting.model).__name__
    u = -0.3 * shooting.ydot * np.ones(2)
    phase = shooting.first_phase(u)
    middle = 0.5 * (float(phase.t[0]) + float(phase.t[-1]))
    above, below = shooting.numbers(phase(middle), middle).lie
    law = type(shooting.model.friction).__name__
    if not below > above:
        raise ns.DegenerateError(
            f"{who} has the friction law {law}, which is not set-valued at H = 0: there is no rolling "
            "phase and no two-fold, and H_F = 0 is a smooth level. Find it with scipy from "
            "bounce.lift_off."
        )
    slip = shooting.slip(u)
    rate = shooting.load(slip.x[-1])[1]
    load = shooting.load(slip(0.5 * (slip.t[0] + slip.t[-1])))[0]
    duration = float(slip.t[-1] - slip.t[0])
    if not abs(rate) * duration > 1e-3 * abs(load):
        raise ns.DegenerateError(
            f"{who}: the load falls to zero at lift-off with rate {rate:.3g} (dLambda_N/dY = 0 there, as "
            "for Hertz's law without gravity). Then L11 = L22, the two-fold at lift-off is "
            'visible-invisible, and no rolling ball reaches it. Take gravity with load="net".'
        )
