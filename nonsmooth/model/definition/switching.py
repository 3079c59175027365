"""The class of a switching surface, by the part of the field that jumps on it.

With h > 0 above, F1 there and F2 below, n = grad h, L = n F1 and J = F2 - F1, a surface is continuous
where J = 0, velocity continuous where n J = 0, and generic otherwise: only then can anything slide.

Source: di Bernardo et al. 2008, Piecewise-smooth Dynamical Systems, section 2.3 (degree of smoothness).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import casadi as ca

from ..expressions.identity import decide_zero

if TYPE_CHECKING:
    from ..reading import Parameters
    from .system import FilippovSystem

#: Largest order that is computed.
_MOST = 6

Kind = Literal["continuous", "velocity continuous", "generic", "undecided"]


@dataclass(frozen=True)
class Switching:
    """The class of a switching surface.

    Attributes
    ----------
    kind : {"continuous", "velocity continuous", "generic", "undecided"}
        ``"continuous"``: the fields are equal on the surface (springs, stops, Chua, ReLU).
        ``"velocity continuous"``: only a part along the surface jumps, so that every orbit that reaches
        the surface with a speed goes through (preload, dashpot). ``"generic"``: the speed
        of h jumps (friction, relays), so there may be sliding, folds and two-folds.
    order : int or None
        Of a continuous surface the m of $J = h^m K$; of a velocity continuous one the k of
        $J = L^k G$ on it, with $L$ the speed of h. None where there is none up to 6, or it is undecided.
    touch_order : float or None
        How the return map of an orbit that touches the surface departs from that of the orbit that does
        not: like this power of the depth. 1/2 (a square root) is that of a jumping force.
    decided_by : str
        Exact arithmetic, perhaps but for the rounding of the numbers, or doubles at random points, which prove nothing.
    """

    kind: Kind
    order: int | None
    touch_order: float | None
    decided_by: str

    @property
    def slides(self) -> bool:
        """Whether there can be sliding, folds and two-folds: also where the class is undecided."""
        return self.kind in ("generic", "undecided")

    @property
    def force_jumps(self) -> bool:
        """Whether the fields differ where an orbit touches the surface and nothing slides, as by a preload."""
        return self.kind == "velocity continuous" and self.order == 0

    def __str__(self) -> str:
        means = "" if self.slides else "; nothing slides here"
        return f"{self.name}{means} (by {self.decided_by})"

    @property
    def name(self) -> str:
        """The kind with its order."""
        return self.kind if self.order is None else f"{self.kind} of order {self.order}"


def class_of(
    system: FilippovSystem, surface: int, mode: str | None, parameters: Parameters | None
) -> Switching:
    """The class of a surface, for all values of parameters or for given ones."""
    if surface in system.half_lines and surface not in system.algebraic:
        how = "its definition as a condition of relative degree 1"
        return Switching("generic", None, None, how)
    if surface in system.algebraic and not _changes_alone(system, surface):
        return Switching("undecided", None, None, "conditions that open and close together")
    h, x, jump, above = _jump(system, surface, mode)
    if parameters is not None:
        p, values = system.parameter_symbols, ca.DM(system.parameter_vector(parameters))
        h, jump, above = (ca.substitute(e, p, values) for e in (h, jump, above))
    gradient = ca.jacobian(h, x)
    zero, how = decide_zero(ca.vertsplit(jump), [h], x)
    if zero:
        m, how = _first(ca.vertsplit(jump), gradient.T, [h], x, how, 1)
        return Switching("continuous", m, None if m is None else m + 0.5, how)
    if zero is None:
        return Switching("undecided", None, None, how)
    speed_jumps, how = decide_zero([ca.mtimes(gradient, jump)], [h], x)
    if not speed_jumps:
        return Switching("undecided" if speed_jumps is None else "generic", None, None, how)
    speed = ca.mtimes(gradient, above)
    of_speed = ca.jacobian(speed, x)
    if of_speed.is_zero():  # h has one rate on both sides
        return Switching("velocity continuous", None, None, how)
    along = of_speed - gradient * ca.mtimes(gradient, of_speed.T) / ca.mtimes(gradient, gradient.T)
    k, how = _first(ca.vertsplit(jump), along.T, [h, speed], x, how, 0)
    return Switching("velocity continuous", k, None if k is None else 1.5 if k else 0.5, how)


def _changes_alone(system: FilippovSystem, condition: int) -> bool:
    """Whether a condition's own multiplier is in its y."""
    d = system.definition
    return bool(ca.depends_on(d.surfaces[condition], d.multipliers[condition]))


def _jump(
    system: FilippovSystem, surface: int, mode: str | None
) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """h, the states, F2 - F1 and F1 for the other multipliers as they are, or as a mode has them."""
    d, x = system.definition, system.extended_states
    free = [ca.SX.sym(f"lambda{j}") for j in range(system.surface_count)]
    slides, condition = list[int](), surface in system.algebraic
    if mode is not None:
        for j, letter in enumerate(system.parse_mode(mode)):
            if j != surface and letter == 0:
                slides.append(j)
            elif j != surface and letter != 2:
                free[j] = ca.SX(0 if j in system.half_lines else letter)
    fields = []
    for side in (0.0,) if condition else (1.0, -1.0):
        values, found = [*free], []
        if not condition:
            values[surface] = ca.SX(side)
        else:
            found = [ca.substitute(d.surfaces[surface], d.multipliers, ca.vertcat(*values))]
        field = system.field_with(ca.vertcat(*values), d.reactions)
        found = [ca.densify(field), *found]
        if slides:
            unknown = ca.vertcat(*[free[j] for j in slides])
            rows = ca.vertcat(*[_row(system, j, values, field, unknown) for j in slides])
            middle = ca.substitute(rows, unknown, ca.SX.zeros(len(slides), 1))
            solution = -ca.solve(ca.jacobian(rows, unknown), middle)
            found = [ca.substitute(e, unknown, solution) for e in found]
        fields.append(found)
    if not condition:
        return d.surfaces[surface], x, fields[1][0] - fields[0][0], fields[0][0]
    field, y = fields[
        0
    ]  # affine in the condition's own multiplier, which is -h over its factor in y
    own = free[surface]
    h, open_field = (ca.substitute(e, own, 0) for e in (y, field))
    jump = -h / ca.jacobian(y, own) * ca.jacobian(field, own)
    return h, x, ca.densify(jump), ca.densify(open_field)


def _row(
    system: FilippovSystem, j: int, values: list[ca.SX], field: ca.SX, unknown: ca.SX
) -> ca.SX:
    """The first derivative along a field, of a function kept at zero, that contains an unknown."""
    row = ca.substitute(
        system.definition.surfaces[j], system.definition.multipliers, ca.vertcat(*values)
    )
    for _ in range(_MOST if j not in system.algebraic else 0):
        row = ca.mtimes(ca.jacobian(row, system.extended_states), field)
        if ca.depends_on(row, unknown):
            break
    return row


def _first(
    jump: list[ca.SX], direction: ca.SX, zeros: list[ca.SX], x: ca.SX, how: str, order: int
) -> tuple[int | None, str]:
    """Order of the first derivative of the jump along a direction that is not zero where ``zeros`` are."""
    value = ca.vertcat(*jump)
    for k in range(_MOST + 1):
        if k >= order:
            zero, found = decide_zero(ca.vertsplit(value), zeros, x)
            how = found if found != how and how.startswith("exact") else how
            if zero is None:
                return None, how
            if not zero:
                return k, how
        value = ca.densify(ca.jtimes(value, x, direction))
    return None, how
