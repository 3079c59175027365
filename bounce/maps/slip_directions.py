"""Direction of the slip at lift-off in 3-D: maps over the spin, vortices and their index, and its turn.

In the plane the slip at lift-off changes its sign across a curve of landings. In 3-D it is a vector
that is zero at isolated spins only; around each, a vortex, it turns once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..contact.model import Contact3D, ContactModel
from ..errors import LandingError, ModelError
from ..parameters import number, numbers
from ..shot.simulate import simulate
from .lift_offs import lift_off
from .results import LiftOffs
from .shooting import Shooting

Array = NDArray[np.float64]

#: Turn between neighbouring points of a circle that is still one turn and not another, rad.
_FINE = math.pi / 2
#: How often the points of a circle are doubled, and cells of spins divided.
_DOUBLINGS, _DIVISIONS = 7, 60
#: Distance from a vortex, in cells, of the first secant, and the number of secant steps.
_BESIDE, _SECANTS = 0.01, 6
#: Points of Gauss's rule over the contact.
_POINTS = 60


class Vortex(NamedTuple):
    """A spin at which the slip at lift-off is zero, and around which it turns.

    Attributes
    ----------
    omega : ndarray (2,)
        The spin, $(omega_z, -omega_x)$.
    winding : int
        How often the slip's direction turns around it, in the sense of the spins.
    """

    omega: Array
    winding: int


@dataclass(frozen=True, eq=False, repr=False)
class SlipMap(ns.result_tables.Tabular):
    """Slip at lift-off over a rectangle of spins, ``omega[0]`` along the last axis.

    Attributes
    ----------
    model : Contact3D
        The surface, in 3-D.
    xdot : ndarray (2,)
        Velocity along the ground at touch-down.
    ydot : float
        Velocity into the ground.
    omega : (ndarray (m,), ndarray (n,))
        Spins: for ``xdot`` forward that about the lateral axis (backspin) and that about the axis of
        travel.
    lift_offs : LiftOffs
        Arrays (n, m).
    """

    model: Contact3D
    xdot: Array
    ydot: float
    omega: tuple[Array, Array]
    lift_offs: LiftOffs

    def _tables(self) -> dict[str, ns.result_tables.ResultTable]:
        return {
            "lift_offs": self.lift_offs._over({"omega_1": self.omega[1], "omega_0": self.omega[0]})
        }

    @property
    def angle(self) -> Array:
        """Direction of the slip at lift-off (n, m), rad from forward to the right."""
        return self.lift_offs.slip_angle

    @property
    def vortices(self) -> tuple[Vortex, ...]:
        """Cells of the map around which the direction turns, by their middles."""
        angle = self.angle
        ring = [angle[:-1, :-1], angle[:-1, 1:], angle[1:, 1:], angle[1:, :-1]]
        turns = sum(wrapped(b - a) for a, b in zip(ring, [*ring[1:], ring[0]], strict=True))
        count = np.rint(np.nan_to_num(turns / (2 * math.pi))).astype(int)
        middles = [(values[:-1] + values[1:]) / 2 for values in self.omega]
        return tuple(
            Vortex(np.array([middles[0][k], middles[1][i]]), int(count[i, k]))
            for i, k in np.argwhere(count)
        )

    def __repr__(self) -> str:
        size = " x ".join(str(len(values)) for values in self.omega)
        found = ", ".join(
            f"{v.winding:+d} at [{v.omega[0]:.4g}, {v.omega[1]:.4g}]" for v in self.vortices
        )
        return f"SlipMap({size} spins; vortices: {found or 'none'})"


def wrapped(angle: Array) -> Array:
    """Return angles in [-pi, pi)."""
    return np.asarray((angle + math.pi) % (2 * math.pi) - math.pi)


def slip_map(
    model: ContactModel | Contact3D,
    xdot: ArrayLike,
    omega: tuple[ArrayLike, ArrayLike],
    ydot: float = -1.0,
    **options: Any,
) -> SlipMap:
    """Map the direction of the slip at lift-off over the two components of the spin.

    Parameters
    ----------
    model : ContactModel or Contact3D
        The surface; a model of bounces in the plane is taken in 3-D.
    xdot : array_like (2,)
        Velocity along the ground at touch-down.
    omega : (array_like (m,), array_like (n,))
        Values of the spin's two components, the first horizontal in a picture.
    ydot : float, optional
        Velocity into the ground.
    **options
        As :func:`lift_off` takes: ``tol``, ``work``, ...

    Returns
    -------
    SlipMap
        Slip at lift-off over the grid.

    Raises
    ------
    LandingError
        A velocity that is no pair of finite numbers.
    ModelError
        No contact model.
    nonsmooth.OptionError
        As :func:`lift_off`.

    Examples
    --------
    >>> import numpy as np, bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    >>> spins = np.linspace(0.3, 0.8, 3), np.linspace(-0.25, 0.2, 2)
    >>> bounce.slip_map(turf, [0.2, 0.0], spins, tol=1e-6)
    SlipMap(3 x 2 spins; vortices: +1 at [0.675, -0.025])
    """
    surface = _in_3d(model)
    v = _pair("xdot", xdot)
    axes = [numbers(values, "omega", LandingError) for values in omega]
    if len(axes) != 2 or any(a.ndim != 1 or a.size == 0 for a in axes):
        raise ns.OptionError(
            f"omega: expected two lists of spins, received shapes {[a.shape for a in axes]}."
        )
    spins = np.stack(np.meshgrid(*axes), axis=-1)
    off = lift_off(surface, v, ydot, spins, **options)
    return SlipMap(surface, v, float(ydot), (axes[0], axes[1]), off)


def winding_number(
    model: ContactModel | Contact3D,
    xdot: ArrayLike,
    centre: ArrayLike,
    radius: float,
    ydot: float = -1.0,
    *,
    points: int = 8,
    **options: Any,
) -> int:
    """Return how often the slip at lift-off turns as the spin goes round a circle once.

    It is the sum of the indices of the vortices inside. The circle's points are doubled until no two
    neighbours differ by more than a quarter of a turn.

    Parameters
    ----------
    model : ContactModel or Contact3D
        The surface; a model of bounces in the plane is taken in 3-D.
    xdot : array_like (2,)
        Velocity along the ground at touch-down.
    centre : array_like (2,)
        Spin in the middle of the circle.
    radius : float
        Of the circle.
    ydot : float, optional
        Velocity into the ground.
    points : int, optional
        Points of the circle to begin with, three or more.
    **options
        As :func:`lift_off` takes.

    Returns
    -------
    int
        Turns, positive in the sense of the spin's.

    Raises
    ------
    nonsmooth.ConvergenceError
        The direction still jumps: the circle passes through a vortex, or a ball does not lift off.

    Examples
    --------
    >>> import bounce
    >>> turf = bounce.NormalKelvinVoigt(mu=0.3, d2=0.1)
    >>> bounce.maps.winding_number(turf, [0.2, 0.0], centre=[4.0, 0.0], radius=1.0, tol=1e-6)
    0
    """
    surface, v, middle = _in_3d(model), _pair("xdot", xdot), _pair("centre", centre)
    size = number(radius, "radius", ns.OptionError)
    if size <= 0.0 or points < 3:
        raise ns.OptionError(
            f"radius, points: expected a positive radius and three points or more, received {radius!r}, "
            f"{points!r}."
        )
    known: dict[float, float] = {}
    for _ in range(_DOUBLINGS):
        share = np.arange(points) / points
        new = [q for q in share.tolist() if q not in known]
        turn = 2 * math.pi * np.array(new)
        spins = middle + size * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        off = lift_off(surface, v, ydot, spins, **options)
        known |= dict(
            zip(new, np.where(off.slip_speed > 0, off.slip_angle, np.nan).tolist(), strict=True)
        )
        angles = np.array([known[q] for q in share.tolist()])
        if np.any(np.isnan(angles)):
            raise _jumps(f"{np.isnan(angles).sum()} bounces without a direction of {points}")
        steps = wrapped(np.roll(angles, -1) - angles)
        if np.all(np.abs(steps) < _FINE):
            return round(float(steps.sum()) / (2 * math.pi))
        points *= 2
    raise _jumps(f"steps of {np.abs(steps).max():.3g} rad with {points // 2} points")


def _jumps(received: str) -> ns.ConvergenceError:
    return ns.ConvergenceError(
        f"radius: the slip does not turn continuously on the circle: {received}. "
        "A vortex is on the circle, or a ball on it does not lift off or rolls to its end. Take another "
        "radius."
    )


def find_vortices(
    model: ContactModel | Contact3D,
    xdot: ArrayLike,
    ydot: float = -1.0,
    *,
    largest: float = 10.0,
    cells: int = 400,
    tol: float = 1e-13,
) -> tuple[Array, ...]:
    """Return the spins along the direction of travel at which a ball lifts off without slip.

    They are landings in a vertical plane, where slip is one number with a sign, so they are found
    there: by bisection between changes of sign on a grid of spins.

    Parameters
    ----------
    model : ContactModel or Contact3D
        One without slopes and grain, which would leave the plane of travel.
    xdot : array_like (2,)
        Velocity along the ground at touch-down, not zero.
    ydot : float, optional
        Velocity into the ground.
    largest : float, optional
        Largest spin searched.
    cells : int, optional
        Of the grid.
    tol : float, optional
        Of the bounces.

    Returns
    -------
    tuple of ndarray (2,)
        Spins of the vortices.

    Examples
    --------
    >>> import bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    >>> (spin,) = bounce.maps.find_vortices(turf, [0.2, 0.0])
    >>> f"{spin[0]:.10f}", float(spin[1])
    ('0.5505199102', 0.0)
    """
    surface, v = _in_3d(model), _pair("xdot", xdot)
    speed = float(np.hypot(*v))
    if not surface.isotropic:
        raise ModelError(
            f"model: {surface!r} is not the same in all directions, so its vortices are no planar bounces. "
            "Find them in a slip_map."
        )
    if speed == 0.0:
        raise LandingError(
            "xdot is zero, but vortices are along the direction of travel. Give a speed."
        )
    most = number(largest, "largest", ns.OptionError)

    def slip(spin: Array) -> Array:
        return lift_off(surface.model, speed, ydot, spin, tol=tol).slip

    grid = np.linspace(-most, most, cells + 1)
    values = slip(grid)
    at = np.flatnonzero(values[:-1] * values[1:] < 0)
    low, high, sign = grid[at], grid[at + 1], np.sign(values[at])
    for _ in range(_DIVISIONS if at.size else 0):
        middle = (low + high) / 2
        below = np.sign(slip(middle)) == sign
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    found = np.append((low + high) / 2, grid[values == 0.0])
    shooting = Shooting(surface.model, ydot, tol=tol)
    polished = [_polished(shooting, speed, spin, most / cells) for spin in np.sort(found).tolist()]
    return tuple(spin * v / speed for spin in polished)


def _polished(shooting: Shooting, speed: float, spin: float, near: float) -> float:
    """Refine a spin to full accuracy by the secant method on the tangential force at lift-off."""
    # Slip at lift-off after rolling is quadratic in the distance from the vortex, so its sign gives half
    # of the digits only. The tangential force at the end of rolling is linear in it.
    beside = spin + _BESIDE * near
    modes = simulate(shooting.model, speed, shooting.ydot, beside, tol=shooting.tol).itinerary
    modes = modes.replace("F", "").replace(" ", "")
    if "s" not in modes:
        return spin  # slip itself is linear, and known to rounding
    modes = modes[: modes.rindex("s") + 1]

    def pull(value: float) -> float:
        return float(shooting.passage(np.array([speed, value]), modes).corner[1])

    one, other = beside, spin - _BESIDE * near
    at_one, at_other = pull(one), pull(other)
    for _ in range(_SECANTS):
        if at_one == at_other:
            break
        one, other, at_other = one - at_one * (one - other) / (at_one - at_other), one, at_one
        at_one = pull(one)
    return one if abs(one - spin) <= near else spin


class SlipTurn(NamedTuple):
    """By how much the slip turns from touch-down to lift-off.

    Attributes
    ----------
    eta : ndarray (n,)
        Tangential over normal natural frequency.
    turn : ndarray (n,)
        Computed, rad in $(-pi, pi]$, from forward to the right positive.
    first_order : ndarray (n,)
        By the formula, for a ball that slips throughout.
    """

    eta: Array
    turn: Array
    first_order: Array


def slip_turn(
    model: ContactModel,
    xdot: ArrayLike,
    omega: ArrayLike,
    eta: ArrayLike,
    ydot: float = -1.0,
    *,
    tol: float = 1e-10,
) -> SlipTurn:
    """Turn of the slip's direction with the stiffness along the ground, beside a formula.

    A rigid ground keeps the direction of the slip h. A compliant one pushes against the velocity V of
    the centre, so where V has a component $V_n$ normal to h (to the right of it), to first order

    $$
    turn = -V_n int_0^T (2 d1 eta + eta^2 t)/(|h_0| - (1 + 1/inertia) mu J(t)) dt
    $$

    with T the duration and $J(t)$ the impulse of the load.

    Parameters
    ----------
    model : ContactModel
        One with parameters ``d1`` and ``eta`` and the linear surface along the ground, and the load of
        a motion that does not depend on it.
    xdot, omega : array_like (2,)
        Velocity and spin at touch-down, forward and to the right.
    eta : array_like (n,)
        Tangential over normal natural frequency, one bounce for each.
    ydot : float, optional
        Velocity into the ground.
    tol : float, optional
        Of the bounces.

    Returns
    -------
    SlipTurn
        The turn as computed, and as the formula has it.

    Examples
    --------
    >>> import bounce, numpy as np
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    >>> found = bounce.maps.slip_turn(turf, [2.0, 0.0], [0.5, 1.0], [0.01], tol=1e-9)
    >>> [f"{np.degrees(v[0]):.5f}" for v in (found.turn, found.first_order)]
    ['0.18914', '0.18806']
    """
    if not isinstance(model, ContactModel) or not {"d1", "eta"} <= set(model.values):
        raise ModelError(
            f"model: expected a ContactModel with parameters d1 and eta, received {model!r}."
        )
    v, w, ratios = (
        numbers(a, n, LandingError) for a, n in ((xdot, "xdot"), (omega, "omega"), (eta, "eta"))
    )
    if v.shape != (2,) or w.shape != (2,) or ratios.ndim != 1:
        raise LandingError(
            f"xdot, omega, eta: expected two numbers, two numbers and a list, received shapes {v.shape}, "
            f"{w.shape} and {ratios.shape}."
        )
    slip = v + w
    size = float(np.hypot(*slip))
    if size == 0.0:
        raise LandingError(
            "xdot, omega: the ball does not slip at touch-down. Give a slip, whose turn is computed."
        )
    off = lift_off(model.in_3d(), v, ydot, w, parameters={"eta": ratios}, tol=tol)
    cross = slip[0] * off.slip[:, 1] - slip[1] * off.slip[:, 0]
    turn = np.arctan2(cross + 0.0, off.slip @ slip)
    values = model.values
    shot = simulate(model.replace(eta=0.0), size, ydot, 0.0, tol=tol)
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    t, weights = shot.time * (nodes + 1) / 2, weights * shot.time / 2
    gravity = values["G"] * np.cos(values["slope"]) if model.convention == "contact" else 0.0
    impulse = shot(t)[:, 3] - ydot + gravity * t
    left = size - (1 + 1 / values["inertia"]) * values["mu"] * impulse
    if np.any(left <= 0.0):
        raise ns.OptionError(
            f"omega: with a slip of {size:g} at touch-down the ball does not slip throughout, so the "
            "formula does not hold. Give more slip."
        )
    normal = (slip[0] * v[1] - slip[1] * v[0]) / size
    first = [
        -normal * float(weights @ ((2 * values["d1"] * e + e**2 * t) / left))
        for e in ratios.tolist()
    ]
    return SlipTurn(ratios, turn, np.array(first))


def _in_3d(model: ContactModel | Contact3D) -> Contact3D:
    if isinstance(model, Contact3D):
        return model
    if not isinstance(model, ContactModel):
        raise ModelError(f"model: expected a ContactModel, received {model!r}.")
    return model.in_3d()


def _pair(name: str, value: ArrayLike) -> Array:
    array = numbers(value, name, LandingError)
    if array.shape != (2,) or not np.all(np.isfinite(array)):
        raise LandingError(
            f"{name}: expected two finite numbers, forward and to the right, received {value!r}."
        )
    return array
