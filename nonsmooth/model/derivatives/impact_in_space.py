"""Impacts with friction in space: impulses and slip after them solve equations, which are differentiated there.

The normal impulses p give friction the bound n(p). It takes all of the slip, or slips with v after the impact, and
then has the impulse n(p) v / |v|. By Poisson's law a contact gives back a part of its impulse after that, with the
bound that this part gives.

Source: Moreau 1988, "Unilateral contact and dry friction in finite freedom dynamics"; Glocker 2001,
"Set-valued force laws", for both laws.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import casadi as ca
import numpy as np

from ..definition.system import FilippovSystem
from ..laws.coupled import coupled_of
from ..laws.evaluators import Evaluator
from ..laws.switches import Guard
from ..values import Array
from .event_maps import AtEvent, EventMap, struck_by, takes_in_space

#: Part of its bound up to which friction is taken to stick: closer to it, derivatives are one-sided.
_HOLDS = 1 - 1e-6

#: Newton's iterations, and residuals to a part of the values.
_ITERATIONS, _SOLVED = 30, 1e-11

#: Condition of equations that determine the impulses.
_DETERMINED = 1e12

#: Steps in which friction grows to what it is, where one is too long.
_PARTS = 20


class ImpactInSpace(EventMap):
    """The map of an impact in which contacts and friction take part as ``letters`` say.

    For each phase of the impact a letter for each friction (``s`` sticks, ``*``, ``+`` and ``-`` slip), then one for
    each contact that takes an impulse (``c``) or none (``o``).
    """

    def __init__(self, system: FilippovSystem, mode: str, contact: int, letters: str):
        d, x = system.definition, system.extended_states
        self._parties = _Parties(system, mode, contact)
        self._friction = ca.SX.sym("part of friction")
        self._unknowns: list[ca.SX] = []
        self._equations: list[ca.SX] = []
        #: Not negative where the letters agree with the impact.
        self._margins: list[ca.SX] = []
        size, none = (
            len(self._parties.letters_of_phase),
            {j: ca.SX(0) for j in self._parties.contacts},
        )
        rates = d.gap_rates
        if d.impact_law == "poisson":
            first, impulses = self._phase(x, letters[:size], none, none)
            back = {j: d.restitutions[j] * impulses[j] for j in impulses}
            pushed = first + ca.mtimes(
                self._parties.columns_of(back, x), ca.vertcat(*back.values())
            )
            after, _ = self._phase(pushed, letters[size:], back, none)
        else:
            target = {**none, contact: -d.restitutions[contact] * rates[contact]}
            after, _ = self._phase(x, letters, none, target)
        element = len(system.entries) + contact
        super().__init__(system, x, d.gaps[contact], Guard("impact", contact, 0, element), after)
        self._build(ca.densify(after), d.gaps[contact], x, system.parameter_symbols)

    def _phase(
        self, x: ca.SX, letters: str, before: dict[int, ca.SX], target: dict[int, ca.SX]
    ) -> tuple[ca.SX, dict[int, ca.SX]]:
        """State after impulses at a state, and those of the contacts; ``before``: impulses that give friction a bound too."""
        own, at = self._parties, len(self._unknowns)
        frictions, contacts = letters[: len(own.frictions)], letters[len(own.frictions) :]
        fresh = lambda k: ca.SX.sym(f"unknown{at}", k)
        impulses = {
            j: fresh(1) if a == "c" else ca.SX(0)
            for j, a in zip(own.contacts, contacts, strict=True)
        }
        bounds = {j: impulses[j] + before[j] for j in impulses}
        slips, forces = list[ca.SX](), list[ca.SX]()
        for members, letter in zip(own.frictions, frictions, strict=True):
            n = own.bound(members[0], bounds, x)
            v = fresh(len(members)) if letter in "s*" else ca.SX(0)
            if letter == "*":
                slips.append(v)
                forces.append(self._friction * n * v / ca.norm_2(v))
            elif letter == "s":
                slips.append(ca.SX.zeros(len(members)))
                forces.append(v)
                self._margins.append(_HOLDS * ca.fabs(n) - ca.norm_2(v))
            else:
                forces.append(self._friction * (n if letter == "+" else -n))
            if letter in "s*":
                self._unknowns.append(v)
        held = fresh(len(own.joints))
        every = ca.vertcat(held, *forces, *impulses.values())
        columns = own.columns(x)
        rates = own.rates(x) + ca.mtimes(own.slope(x, columns), every)
        self._unknowns += [held, *[impulses[j] for j in impulses if not impulses[j].is_zero()]]
        row = held.numel()
        self._equations.append(rates[:row])
        for members, letter in zip(own.frictions, frictions, strict=True):
            after, row = rates[row : row + len(members)], row + len(members)
            if letter in "s*":
                self._equations.append(after - slips.pop(0))
            else:
                self._margins.append(after if letter == "+" else -after)
        for j, letter in zip(own.contacts, contacts, strict=True):
            missing = rates[row] - target[j]
            self._margins.append(impulses[j] if letter == "c" else missing)
            if letter == "c":
                self._equations.append(missing)
            row += 1
        return x + ca.mtimes(columns, every), impulses

    def _build(self, after: ca.SX, gap: ca.SX, x: ca.SX, p: ca.SX) -> None:
        z, f = ca.vertcat(*self._unknowns), ca.densify(ca.vertcat(*self._equations))
        self._count = z.numel()
        given = [ca.vertcat(z, self._friction, x), p]
        outputs = [ca.densify(e) for e in (f, ca.jacobian(f, z))]
        self._solving = Evaluator(ca.Function("solving", given, outputs, {"cse": True}))
        outputs = [after, gap, ca.vertcat(*self._margins), ca.jacobian(f, z)]
        outputs += [ca.jacobian(e, v) for e in (after, f, gap) for v in (x, p)]
        outputs.append(ca.jacobian(after, z))
        outputs = [ca.densify(e) for e in outputs]
        self._solution = Evaluator(ca.Function("struck", given, outputs, {"cse": True}))

    def _newton(self, z: Array, part: float, x: Array, p: Array) -> Array | None:
        """Impulses and slips close to ``z``; None where there are none."""
        for _ in range(_ITERATIONS):
            f, slope = self._solving.copied(np.concatenate([z, [part], x]), p)
            if not (np.isfinite(f).all() and np.isfinite(slope).all()):
                return None
            try:
                step = np.linalg.solve(slope, f[:, 0])
            except np.linalg.LinAlgError:
                return None
            z = z - step
            if abs(step).max(initial=0.0) <= 1e-15 * abs(z).max(initial=0.0):
                break
        f = self._solving.copied(np.concatenate([z, [part], x]), p)[0]
        return z if abs(f).max(initial=0.0) <= _SOLVED * (1.0 + abs(z).max(initial=0.0)) else None

    def _solved(self, x: Array, p: Array) -> Array | None:
        first = self._newton(np.ones(self._count), 0.0, x, p)
        if first is None:
            return None
        found = self._newton(first, 1.0, x, p)
        if found is not None:
            return found
        for k in range(1, _PARTS + 1):
            first = self._newton(first, k / _PARTS, x, p)
            if first is None:
                return None
        return first

    def at(self, x: Array, p: Array) -> tuple[AtEvent, float]:
        """The event at a state, and the least of the margins by which the letters agree with it."""
        z = self._solved(x, p)
        known = np.full(self._count, np.nan) if z is None else z
        found = self._solution.copied(np.concatenate([known, [1.0], x]), p)
        after, gap, margins, fz, after_x, after_p, fx, fp, gap_x, gap_p, after_z = found
        least = float(margins.min(initial=np.inf))
        if z is None or (self._count and np.linalg.cond(fz) > _DETERMINED):
            least = -np.inf
            after_x[:] = after_p[:] = np.nan
        elif self._count:
            after_x -= after_z @ np.linalg.solve(fz, fx)
            after_p -= after_z @ np.linalg.solve(fz, fp)
        return AtEvent(after[:, 0], after_x, after_p, float(gap[0, 0]), gap_x[0], gap_p[0]), least

    def __call__(self, y: Array, p: Array) -> AtEvent:
        """Evaluate at the end of a leg."""
        return self.at(y, p)[0]


class _Parties:
    """Contacts, friction and joints that take part in an impact, with the effect of their impulses."""

    def __init__(self, system: FilippovSystem, mode: str, contact: int):
        self._system, self._coupled = system, coupled_of(system)
        others = struck_by(system, mode, contact)
        self.joints = [*system.joints]
        self.frictions = [members for members in system.entries if members[0] in others.carried]
        self.contacts = [contact, *others.closed]
        m, coupled = system.surface_count, self._coupled
        every = [*self.joints, *[i for members in self.frictions for i in members]]
        kept = [[system.definition.open_surfaces[i], *coupled.lower[i]][-1] for i in every]
        self._rates = ca.vertcat(*kept, system.definition.gap_rates[self.contacts])
        self._every = [*every, *[m + j for j in self.contacts]]
        self._numbers = ca.SX(
            [{"+": 1.0, "-": -1.0}.get(mode[i], 0.0) * (i not in every) for i in range(m)]
        )

    @property
    def letters_of_phase(self) -> list[str]:
        """Possible letters of each friction and contact, in one phase."""
        frictions = ["s*" if len(members) > 1 else "s+-" for members in self.frictions]
        return [*frictions, *["co"] * len(self.contacts)]

    def _at(self, expression: ca.SX, x: ca.SX) -> ca.SX:
        """An expression without multipliers and reactions, at a state."""
        n, moving = self._system.extended_dimension, self._coupled.moving
        rest = ca.vertcat(self._numbers, ca.SX.zeros(moving.numel() - n - self._numbers.numel()))
        return ca.substitute(expression, moving, ca.vertcat(x, rest))

    def columns(self, x: ca.SX) -> ca.SX:
        """Jump of the state by all impulses."""
        coupled = self._coupled
        return self._at(ca.jacobian(coupled.field, coupled.symbols_of(self._every)), x)

    def columns_of(self, impulses: dict[int, ca.SX], x: ca.SX) -> ca.SX:
        """Jump of the state by impulses of contacts."""
        return self.columns(x)[:, -len(impulses) :]

    def rates(self, x: ca.SX) -> ca.SX:
        """Rates of joints, slips and gaps."""
        return ca.densify(self._at(self._rates, x))

    def slope(self, x: ca.SX, columns: ca.SX) -> ca.SX:
        """Jump of the rates by impulses."""
        return ca.mtimes(
            self._at(ca.jacobian(self._rates, self._system.extended_states), x), columns
        )

    def bound(self, first: int, impulses: dict[int, ca.SX], x: ca.SX) -> ca.SX:
        """Bound of the friction of a set, with its sign, by impulses in place of reactions."""
        reactions = self._system.definition.reactions
        which = ca.vertcat(*[reactions[j] for j in impulses])
        factor = ca.substitute(self._coupled.factors[first], which, ca.vertcat(*impulses.values()))
        return self._at(factor, x)


def holding(system: FilippovSystem, mode: str, contact: int, letters: str) -> list[int]:
    """First functions of the sets of friction that sticks to the end of an impact."""
    if not takes_in_space(system, mode := system.widened(mode), contact):
        return []
    parties = _Parties(system, mode, contact)
    last = letters[-len(parties.letters_of_phase) :]
    pairs = zip(parties.frictions, last, strict=False)
    return [members[0] for members, letter in pairs if letter == "s" and len(members) > 1]


def ways_of(system: FilippovSystem, mode: str, contact: int, after: Array) -> Iterator[str]:
    """Letters of the ways in which contacts and friction may take part, the likely ones first.

    ``after`` (m + 2 c,) are surfaces, gaps and rates of gaps after the impact, those that vanish as zeros.
    """
    parties = _Parties(system, system.widened(mode), contact)
    poisson, rates = system.definition.impact_law == "poisson", after[-len(system.impacts) :]
    last = list(parties.letters_of_phase)
    for k, members in enumerate(parties.frictions):
        if len(members) > 1:
            last[k] = "*" if after[list(members)].any() else "s"
    for k, j in enumerate(parties.contacts, len(parties.frictions)):
        if poisson or j != contact:
            last[k] = "o" if rates[j] else "oc" if j == contact else "co"
    phases = [parties.letters_of_phase, last] if poisson else [last]
    for letters in product(*[own for phase in phases for own in phase]):
        yield "".join(letters)
