"""A problem as smooth modes with guards, as a user writes it by hand for a solver of smooth equations.

Filippov's rules for the next mode are added here, for all solvers alike: at a surface the signs of the rates, in
sliding the multipliers, Newton's law at impacts. A solver integrates one mode up to the first guard that falls
through zero.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

#: From states and time, a field and guards, to ``leg(t, x, t_end) -> (t, x, guard or None)``.
Solver = Callable[[ca.SX, ca.SX, ca.SX, ca.SX], Callable[[float, np.ndarray, float], Any]]
SECONDS, EVENTS, ON = 5.0, 3000, 1e-9


class NotForModes(Exception):
    """The problem has parts that modes and guards do not express."""


class GaveUp(Exception):
    """A solver, or the choice of the next mode, ended with a message."""


class Modes:
    """The smooth modes of a problem; ``written`` keeps sign(h) in the field instead."""

    def __init__(self, definition: Any, solver: Solver, written: bool = False):
        d = self.d = definition
        if d.complementarity or d.constraints or d.clocks or d.tables or d.hysteresis.numel():
            raise NotForModes("complementarity, joints, clocks, tables or hysteresis")
        if any(size > 1 for size in d.sizes) or (d.whens.numel() and not d.whens.is_constant()):
            raise NotForModes("sets of codimension two, or conditions on events")
        if any(
            len(rule.triggers) != 1 + (direction == 0)
            for rule, (_, direction) in zip(d.rules, (*d.stops, *d.resets), strict=True)
        ) or d.guards.numel() != len(d.rules):
            raise NotForModes("conditions of several functions")
        self.solver, self.written, self.made = solver, written, dict[Any, Any]()
        self.t = d.time if d.time.numel() else ca.SX.sym("t")
        values = (
            [ca.SX(d.defaults[str(p)]) for p in ca.vertsplit(d.parameters)]
            if d.parameters.numel()
            else []
        )
        read = lambda e: ca.substitute(e, d.parameters, ca.vertcat(*values)) if values else e
        self.field, self.h, self.guards, self.maps, self.gaps, self.back = map(
            read, (d.field, d.surfaces, d.guards, d.maps, d.gaps, d.restitutions)
        )
        if self.gaps.numel() and ca.depends_on(ca.jacobian(self.field, d.reactions), d.multipliers):
            raise NotForModes("friction at impacts")
        self.rate = self._rates(self._free(self.field))
        self.at_h = self._function(ca.vertcat(self.h, self.gaps))
        self.normals = self._function(ca.jacobian(self.h, d.states))

    def _free(self, e: ca.SX) -> ca.SX:
        d = self.d
        return (
            ca.substitute(e, d.reactions, ca.SX.zeros(d.reactions.numel(), 1))
            if d.reactions.numel()
            else e
        )

    def _rates(self, field: ca.SX) -> ca.SX:
        d = self.d
        return ca.jacobian(self.h, d.states) @ field + ca.jacobian(self.h, self.t)

    def _function(self, *outputs: ca.SX) -> Any:
        f = ca.Function("f", [self.d.states, self.t], [ca.densify(o) for o in outputs])

        def values(x: np.ndarray, t: float) -> Any:
            found = [np.array(v) for v in f.call([x, t])]
            return (
                found[0].ravel()
                if len(found) == 1 and found[0].shape[1:] == (1,)
                else found[0]
                if len(found) == 1
                else found
            )

        return values

    def mode(self, signs: tuple[int, ...]) -> Any:
        """What makes the leg, multipliers, rates and effects of guards of a mode."""
        if signs not in self.made:
            self.made[signs] = self._mode(signs)
        return self.made[signs]

    def _mode(self, signs: tuple[int, ...]) -> Any:
        d, field = self.d, self._free(self.field)
        if self.written:
            lam = ca.sign(self.h)
        else:
            lam, sliding = (
                ca.SX(ca.DM([*signs])) if signs else ca.SX(0, 1),
                [i for i, s in enumerate(signs) if s == 0],
            )
            for i in sliding:
                lam[i] = d.multipliers[i]
            if sliding:
                unknown = d.multipliers[sliding]
                rates = ca.substitute(self._rates(field), d.multipliers, lam)[sliding]
                slope = ca.jacobian(rates, unknown)
                if ca.depends_on(slope, unknown):
                    raise NotForModes("sliding that is not affine in its multipliers")
                rest = ca.substitute(rates, unknown, ca.SX.zeros(len(sliding), 1))
                found = -ca.solve(slope, rest)
                lam = ca.substitute(lam, unknown, found)
        put = lambda e: ca.substitute(e, d.multipliers, lam) if d.multipliers.numel() else e
        field = put(field)
        rows, effects = list[Any](), list[Any]()
        for i, s in enumerate(signs if not self.written else ()):
            rows += [s * self.h[i]] if s else [1 - lam[i], 1 + lam[i]]
            effects += [("surface", i)] if s else [("exit", i, 1), ("exit", i, -1)]
        names = [
            *(("stop", k) for k in range(len(d.stops))),
            *(("reset", k) for k in range(len(d.resets))),
        ]
        for k, (_, direction) in enumerate((*d.stops, *d.resets)):
            for side in (direction,) if direction else (1, -1):
                rows.append(-side * self.guards[k])
                effects.append(names[k])
        for k in range(self.gaps.numel()):
            rows.append(self.gaps[k])
            effects.append(("impact", k))
        read = [put(row) for row in rows]
        kept = [k for k, row in enumerate(read) if not row.is_constant()]  # the others never fall
        rows, effects = (
            ca.vertcat(ca.SX(0, 1), *(read[k] for k in kept)),
            [effects[k] for k in kept],
        )
        leg = cache(lambda: self.solver(d.states, self.t, field, rows))  # some compile long
        return leg, self._function(ca.densify(put(lam)), self._rates(field)), effects

    def signs(self, x: np.ndarray, t: float, before: Sequence[int | None]) -> tuple[int, ...]:
        """The mode that continues from a point, those of ``before`` that are None being chosen."""
        open_ = [i for i, s in enumerate(before) if s is None]
        admissible = []
        for choice in sorted(
            itertools.product((1, -1, 0), repeat=len(open_)), key=lambda c: c.count(0)
        ):
            signs = list(before)
            for i, s in zip(open_, choice, strict=True):
                signs[i] = s
            try:
                lam, rate = (np.ravel(v) for v in self.mode(tuple(signs))[1](x, t))
            except RuntimeError:
                continue
            if all((signs[i] * rate[i] > 0) if signs[i] else abs(lam[i]) <= 1 for i in open_):
                admissible.append(tuple(signs))
        if len(admissible) != 1:
            raise GaveUp(f"{len(admissible)} modes continue from here")
        return admissible[0]

    def impact(self, x: np.ndarray, t: float, k: int) -> np.ndarray:
        """The state after Newton's impact at a gap."""
        d = self.d
        speed = ca.jacobian(self.gaps[k], d.states) @ self._free(self.field) + ca.jacobian(
            self.gaps[k], self.t
        )
        push = ca.jacobian(self.field, d.reactions[k])
        change = -(1 + self.back[k]) * speed / (ca.jacobian(speed, d.states) @ push)
        zero = lambda e: ca.substitute(e, d.multipliers, ca.SX.zeros(d.multipliers.numel(), 1))
        jump, rate = (np.ravel(v) for v in self._function(zero(push * change), zero(speed))(x, t))
        if float(self.back[k]) * abs(rate[0]) < ON:
            raise GaveUp("a contact closes")
        return x + jump

    def run(self, x: np.ndarray, t_end: float) -> tuple[float, np.ndarray]:
        """The end of the motion from the time 0."""
        t, spent = 0.0, 0.0
        m = self.h.numel()
        values = self.at_h(x, t)[:m] if m else []
        signs: tuple[int, ...] = (
            ()
            if self.written
            else self.signs(x, t, [None if abs(v) < ON else int(np.sign(v)) for v in values])
        )
        for _ in range(EVENTS):
            make, _, effects = self.mode(signs)
            leg = make()
            begin = time.process_time()
            t, x, hit = leg(t, np.asarray(x, dtype=float), t_end)
            spent += time.process_time() - begin
            if not np.all(np.isfinite(x)):
                raise GaveUp("not finite")
            if hit is None:
                return t, x
            if spent > SECONDS:
                raise GaveUp(f"{SECONDS:.0f} s")
            kind, i, *side = effects[hit]
            if kind == "stop":
                return t, x
            if kind == "impact":
                x = self.impact(x, t, i)
                continue
            if kind == "reset":
                x = np.ravel(self._function(self.maps[:, i])(x, t))
                t += 4 * np.spacing(t)  # an event at a time is behind
                if not self.written and m:
                    near = self.at_h(x, t)[:m]
                    signs = self.signs(
                        x, t, [None if abs(v) < ON else int(np.sign(v)) for v in near]
                    )
                continue
            if kind == "exit":
                open_ = [side[0] if j == i else s or None for j, s in enumerate(signs)]
                signs = self.signs(x, t, open_)
                continue
            normal = self.normals(x, t).reshape(m, -1)[i]
            if np.any(normal):
                x = x - self.at_h(x, t)[i] * normal / (normal @ normal)
            near = np.abs(self.at_h(x, t)[:m]) < ON
            signs = self.signs(
                x, t, [None if near[j] or j == i else s for j, s in enumerate(signs)]
            )
        raise GaveUp(f"{EVENTS} events")
