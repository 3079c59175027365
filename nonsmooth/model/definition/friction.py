"""Dry friction by name: a force to be put into the field, with its surface and its multiplier."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass, field

import casadi as ca

from ..errors import DefinitionError
from ..reading import Expression, listed, scalar
from .elements import LARGEST, Element, Entry

#: Longest slip that names its multiplier.
_LONGEST = 40


@dataclass(frozen=True)
class Friction(Element):
    """Dry friction, with stiction, a Stribeck curve and a viscous part: a force against a slip.

    Put ``force`` into the field, and the friction itself into ``surfaces=`` of the system; its multiplier need
    not be named. While it sticks the force is that which keeps the slip at zero, up to ``static * load``.

    Parameters
    ----------
    slip : expression or sequence of two or three
        The velocity of one body against the other; a vector for friction in a plane.
    load : expression or number
        The normal force, not negative; it may depend on states and time.
    kinetic : expression or number
        Coefficient of friction while slipping.
    static : expression or number, optional
        Coefficient at rest, at least ``kinetic``; the same as ``kinetic`` unless given. Without ``stribeck``
        it is the largest force at rest, from which friction drops to ``kinetic`` at once.
    stribeck : expression or number, optional
        The speed over which friction falls from ``static`` to ``kinetic``:
        $mu = kinetic + (static - kinetic) exp(-(slip/stribeck)^2)$.
    viscous : expression or number, optional
        Force over slip, beside the dry part.

    Attributes
    ----------
    multiplier : SX
        Between -1 and 1 while it sticks, the direction of the slip otherwise.
    force : SX
        Scalar, or a column for a vector of slips.

    Raises
    ------
    DefinitionError
        Negative coefficients, static below kinetic, static without ``stribeck`` for a vector of slips.

    Notes
    -----
    Friction that drops at once is a multiplier that enters nonlinearly (hidden dynamics): with the multiplier
    from -1 to 1 the force goes along $kinetic lambda (1 + b (1 - lambda^2))$, whose largest value is
    ``static``, and slip begins at its fold. A start at rest under a force between both is not unique: give
    ``start_mode="s"`` if it sticks. Source: Armstrong-Helouvry, Dupont & Canudas de Wit 1994, "A
    survey of models ... for the control of machines with friction"; Jeffrey 2018, Hidden Dynamics.

    Examples
    --------
    A block that a spring pulls sticks until the spring has reached the static friction:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, v, t = (ca.SX.sym(s) for s in ("x", "v", "t"))
    >>> dry = ns.Friction(v, load=10.0, kinetic=0.3, static=0.4)
    >>> block = ns.FilippovSystem(
    ...     [x, v], field=[v, (t - x) + dry.force], surfaces=[dry], time=t)
    >>> run = ns.simulate(block, [0.0, 0.0], t_end=5.0)
    >>> run.itinerary, bool(abs(run.events[0].t - 4.0) < 1e-9)
    ('s +', True)
    """

    slip: Expression
    load: Expression
    kinetic: Expression
    static: Expression | None = None
    stribeck: Expression | None = None
    viscous: Expression = 0.0
    multiplier: ca.SX = field(init=False, repr=False)
    force: ca.SX = field(init=False, repr=False)

    def __post_init__(self) -> None:
        slips = self._slips("slip")
        load = self._read("load")  # two loads may have the same slip
        words = ", ".join(map(str, slips if load.is_constant() else (*slips, load)))
        short = words if len(words) <= _LONGEST else f"{zlib.crc32(words.encode()):08x}"
        made = ca.SX.sym(f"friction({short})", len(slips))
        object.__setattr__(self, "multiplier", made)
        object.__setattr__(self, "force", self._force(ca.vertcat(*slips), made))

    @property
    def drops(self) -> bool:
        """Whether friction drops at once where slip begins, so that its multiplier enters nonlinearly."""
        return self.static is not None and self.stribeck is None

    def entry(self, what: str) -> Entry:
        """Read the slip, the function of the surface or set."""
        slips = self._slips(f"slip of {what}")
        law = "surface" if len(slips) == 1 else "set"
        return Entry(law, slips, (ca.SX(0),) * len(slips), self.multiplier, hidden=self.drops)

    def _slips(self, what: str) -> tuple[ca.SX, ...]:
        slips = tuple(scalar(s, what) for s in listed(self.slip))
        if not 1 <= len(slips) <= LARGEST:
            raise DefinitionError(
                f"{what}: expected one to {LARGEST} velocities, received {len(slips)}."
            )
        return slips

    def _force(self, slip: ca.SX, lam: ca.SX) -> ca.SX:
        load, kinetic = self._read("load"), self._read("kinetic")
        coefficient, viscous = kinetic, self._read("viscous")
        if self.static is not None:
            static = self._read("static")
            _require_above(static, kinetic)
            if self.stribeck is not None:
                curve = ca.exp(-ca.sumsqr(slip) / self._read("stribeck") ** 2)
                coefficient = kinetic + (static - kinetic) * curve
            elif slip.numel() > 1:
                raise DefinitionError(
                    "static: expected stribeck= beside it for a vector of slips, received none. Friction that "
                    "drops at once is known for one direction only."
                )
            else:
                coefficient = kinetic * (1 + _hump(static / kinetic) * (1 - lam**2))
        elif self.stribeck is not None:
            raise DefinitionError(
                "stribeck: expected static= beside it, received none. Give the coefficient at rest."
            )
        return -load * coefficient * lam - viscous * slip

    def _read(self, name: str) -> ca.SX:
        found = scalar(getattr(self, name), f"{name} of the friction")
        if not found.is_constant():
            return found
        value, least = float(found), "above zero" if name == "stribeck" else "not below zero"
        if not math.isfinite(value) or value < 0.0 or (value == 0.0 and name == "stribeck"):
            raise DefinitionError(
                f"{name} of the friction: expected a finite number {least}, received {value:g}."
            )
        return found


def _require_above(static: ca.SX, kinetic: ca.SX) -> None:
    """Refuse coefficients that are known not to give stiction."""
    if static.is_constant() and kinetic.is_constant() and not float(static) > float(kinetic) > 0.0:
        raise DefinitionError(
            f"static of the friction: expected more than kinetic, {float(kinetic):g}, both positive, received "
            f"{float(static):g}. Leave static= out where they are equal."
        )


def _hump(ratio: ca.SX) -> ca.SX:
    """b, not below 1/2, with max of lambda (1 + b (1 - lambda^2)) = ratio: (1 + b)^3 = 27/4 ratio^2 b."""
    c = 6.75 * ratio**2
    return 2 * ca.sqrt(c / 3) * ca.cos(ca.acos(-1.5 * ca.sqrt(3 / c)) / 3) - 1
