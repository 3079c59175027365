"""Limit directions of sets of codimension two and three: the directions in which orbits arrive and leave.

Near a set h = 0 with a vector multiplier h' = a - M lambda, lambda = h/|h|. Orbits reach it or leave it
along limit directions u, (M + s) u = a with |u| = 1; s is the rate r' of r = |h|. Where |M^-1 a| < 1 all
rates are negative: sliding (friction holds, the body sticks or rolls). Otherwise one direction leads
away: orbits cross, or pass by.

Source: Antali & Stepan 2018, "Sliding and crossing dynamics in extended Filippov systems", SIAM J. Appl.
Dyn. Syst. 17; 2019, "Nonsmooth analysis of three-dimensional slipping and rolling", Nonlinear Dyn. 97.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...model import (
    Array,
    DefinitionError,
    FilippovSystem,
    Parameters,
    PointError,
    Surfaces,
    coupled_of,
    require_system,
)
from ...model.checks import positive
from ...model.laws.frozen import Frozen, frozen, limit_directions_of
from ..discrete_states import with_discrete_states_held
from .surface_point import TOLERANCE


@dataclass(frozen=True, eq=False)
class LimitDirection:
    """A direction in which orbits reach or leave a set $h = 0$.

    Attributes
    ----------
    direction : ndarray (k,)
        $u = h/|h|$, of length 1.
    rate : float
        $r'$ of $r = |h|$ along it: negative where orbits arrive.
    attracting : bool
        Whether nearby directions of h turn towards this one: all neighbouring orbits that arrive or leave do so
        along it. Other directions belong to single orbits.
    """

    direction: Array
    rate: float
    attracting: bool

    @property
    def leaves(self) -> bool:
        """Whether the orbit leaves the set."""
        return self.rate > 0.0

    def __repr__(self) -> str:
        parts = ", ".join(f"{v:.6g}" for v in self.direction)
        way = "leaves" if self.leaves else "arrives"
        kind = "attracting" if self.attracting else "not attracting"
        return f"LimitDirection([{parts}], {way}, rate {self.rate:.6g}, {kind})"


@with_discrete_states_held
def limit_directions(
    system: FilippovSystem,
    point: ArrayLike,
    *,
    parameters: Parameters | None = None,
    t: float = 0.0,
    surface: int | None = None,
    mode: str | None = None,
    tol: float = TOLERANCE,
) -> list[LimitDirection]:
    """Directions in which orbits reach and leave a set of codimension two or three at a point.

    Parameters
    ----------
    system : FilippovSystem
        With a vector multiplier.
    point : array_like (n,)
        A point on the set: $|h| <= tol (1 + |x|) |grad h|$.
    parameters : mapping, optional
        Values that replace defaults.
    t : float, optional
        Time, where the system depends on it.
    surface : int, optional
        Number of the set among surfaces and sets; the first set by default.
    mode : str, optional
        With several surfaces or sets, one letter each: what the others do. By default the sides on
        which the point is.
    tol : float, optional
        How far off the set the point may be.

    Returns
    -------
    list of LimitDirection
        By descending rate: two, or four ($k = 2$, anisotropic friction and a load inside the astroid
        $|a1|^(2/3) + |a2|^(2/3) < |m1 - m2|^(2/3)$). Where $a = 0$ and M is isotropic every direction
        is one; the axes stand for them.

    Raises
    ------
    PointError
        Off the set, a wrong shape, or not finite.
    DefinitionError
        A system without such sets; a ``surface`` that is none of them; a ``mode`` that it does not have.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        ``tol`` is not positive.

    Examples
    --------
    A block on an incline, slope 0.3 and friction 0.5: it comes to rest from every side.

    >>> import casadi as ca, nonsmooth as ns
    >>> v, lam = (ca.vertcat(ca.SX.sym(n + "1"), ca.SX.sym(n + "2")) for n in ("v", "l"))
    >>> block = ns.FilippovSystem(
    ...     ca.vertsplit(v), field=[0.3 - 0.5 * lam[0], -0.5 * lam[1]],
    ...     surfaces=[v], multipliers=[lam])
    >>> for found in ns.local.limit_directions(block, [0.0, 0.0]):
    ...     print(found)
    LimitDirection([1, 0], arrives, rate -0.2, attracting)
    LimitDirection([-1, 0], arrives, rate -0.8, not attracting)
    """
    law = law_at(system, point, parameters, t, surface, mode, positive(tol, "tol"))
    found = limit_directions_of(law.a, law.m)
    return [LimitDirection(u, s, _attracts(law, s, u)) for s, u in found]


def _attracts(law: Frozen, rate: float, u: Array) -> bool:
    """Whether u' = ((1 - u u^T) (a - M u))/r, times r, is stable at an equilibrium."""
    # Its linearisation in the plane across u is -(P M P + rate).
    k = len(u)
    across = np.linalg.svd(np.eye(k) - np.outer(u, u))[0][:, : k - 1]
    slope = across.T @ (law.m + rate * np.eye(k)) @ across
    return bool(np.linalg.eigvals(slope).real.min() > 0.0)


def law_at(
    system: FilippovSystem,
    point: ArrayLike,
    parameters: Parameters | None,
    t: float,
    surface: int | None,
    mode: str | None,
    tol: float,
) -> Frozen:
    """Check a point of a set and freeze a and M there."""
    require_system(system, sets=True)
    members = _members(system, surface)
    x, p = system.extended_point(point, t), system.parameter_vector(parameters)
    coupled = coupled_of(system)
    h = coupled.heights_at(x, p)
    letters = _letters(system, h, members, mode)
    own = list(members)
    slope = float(np.linalg.norm(Surfaces(system).values(x, p)[1][own]))
    distance = float(np.linalg.norm(h[own]))
    if not distance <= tol * slope * (1.0 + float(np.linalg.norm(x))):
        raise PointError(
            f"point {x}: expected a point on the set {system.surface_names[own[0]]} = 0, received "
            f"h = {h[own].tolist()}. Limit directions belong to points of the set, where all "
            "components vanish."
        )
    law = frozen(coupled, letters, x, np.zeros(coupled.count), p, own)
    if not (np.all(np.isfinite(law.a)) and np.all(np.isfinite(law.m))):
        raise PointError(f"point {x}: expected finite rates of h, received {law.a} and {law.m}.")
    return law


def _members(system: FilippovSystem, surface: int | None) -> tuple[int, ...]:
    if not system.sets:
        raise DefinitionError(
            f"system: {system!r} has no vector multiplier, that is no set of codimension two or three. "
            "At a surface orbits arrive from two sides: see region."
        )
    if surface is None:
        return system.sets[0]
    count = len(system.entries)
    if isinstance(surface, bool) or not isinstance(surface, (int, np.integer)):
        raise DefinitionError(f"surface: expected an index (int), received {surface!r}.")
    if not 0 <= surface < count or system.entries[surface] not in system.sets:
        sets = [k for k, members in enumerate(system.entries) if members in system.sets]
        raise DefinitionError(
            f"surface: expected the number of a set, one of {sets}, received {surface}."
        )
    return system.entries[surface]


def _letters(system: FilippovSystem, h: Array, members: tuple[int, ...], mode: str | None) -> str:
    """Letters of all switching functions, ``s`` for those of the set."""
    if mode is not None:
        system.require_mode(mode)
        letters = list(system.widened(mode).ljust(len(h), "o"))
    else:
        sides = ["+" if value > 0 else "-" for value in h[: system.surface_count]]
        letters = ["*" if i in system.set_of else sides[i] for i in range(len(sides))]
        letters += ["o"] * len(system.impacts)
        for entry in system.entries:
            if entry != members and not any(h[i] for i in entry):
                raise PointError(
                    f"point: it is also on {system.surface_names[entry[0]]} = 0, so it has no side "
                    "there. Give mode=, one letter for each surface and set."
                )
    for i in members:
        letters[i] = "s"
    return "".join(letters)
