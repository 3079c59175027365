"""Variational equation of systems with sets of codimension two and three, with jumps at the sets.

Off a set the multiplier u = h/|h| moves with the state, du = (1 - u u^T) dh/|h|; on it lambda keeps h at
zero, as multipliers of sliding surfaces and reactions of closed contacts do. The variational equation is
integrated along the steps of the run by Gauss collocation, which stays accurate where du is stiff: next
to the set.

At a hit the derivatives by the time of the hit cancel: with h' = a - M lambda and B = df/dlambda

    dx+ = (1 + B M^-1 grad h) dx,

whatever the directions are from which neighbours come; what slides elsewhere is eliminated from a, M and
B. At the end of sliding the field is continuous and dx+ = dx.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np

from ...flow.constants import TIE
from ...flow.events import Event
from ...flow.trajectory import Trajectory
from ...model import (
    Array,
    DegenerateError,
    FilippovSystem,
    multiplier_enters,
    require_plain,
    sliding_multipliers,
)
from ...model.derivatives.event_maps import AtEvent, instant_map
from ...model.laws.frozen import Frozen
from ...model.laws.limit_directions import leaving_direction
from ...model.laws.mode_derivatives import AtMode, Derived, mode_derivatives
from .legs import corner, parallel, struck_letters
from .saltation import saltation
from .variation import Sensitivity

#: Nodes of the collocation on each step.
_NODES = 10

#: Part of |h| from which a set is still reached, in a time that adds nothing.
_GONE = 1e-16

#: Steps of Newton's method for multipliers that do not enter linearly together.
_MOST_STEPS = 30

#: A set is left tangentially where |h'| is below this part of its rates.
_TANGENTIAL = 1e-8


@lru_cache(maxsize=1)
def _gauss() -> tuple[Array, Array, Array]:
    """Nodes in (0, 1), and the integrals of Lagrange's polynomials up to each and up to 1."""
    nodes = 0.5 * (np.polynomial.legendre.leggauss(_NODES)[0] + 1.0)
    powers = np.vander(nodes, increasing=True)
    degrees = np.arange(1, _NODES + 1)
    upto = (nodes[:, None] ** degrees) / degrees
    inner, outer = np.linalg.solve(powers.T, upto.T).T, np.linalg.solve(powers.T, 1.0 / degrees)
    return nodes, np.asarray(inner), np.asarray(outer)


class Variation:
    """The variational equation of a system with sets."""

    # Derivatives y are (N, N + q): by the extended start, then by the chosen parameters. Modes have a letter
    # for each switching function and contact.

    def __init__(self, system: FilippovSystem, p: Array, chosen: Sequence[int]):
        self.system, self.p, self.chosen = system, p, list(chosen)
        self._of = mode_derivatives(system)
        self._coupled = self._of.coupled
        self.acting = np.zeros(self._of.size)
        self.idle = [s for s in system.sets if not multiplier_enters(system, s, p)]

    def at(self, x: Array, acting: Array | None = None) -> AtMode:
        """Values at an extended state with given multipliers and reactions; default zero."""
        given = np.zeros(self._of.size) if acting is None else acting
        return self._of.at(x, given, self.p, self.chosen)

    def moving(self, mode: str, x: Array, slip: Array | None = None) -> tuple[AtMode, Array, Array]:
        """Values at a state of a mode, with derivatives of its multipliers and reactions."""
        # ``slip`` is h with all its digits, where it is known. A set that is left at h = 0 is left in
        # the direction in which the motion goes.
        acting = np.zeros(self._of.size)
        known = self._coupled.held(mode)[: self.system.surface_count]
        acting[: len(known)] = known
        by_state = np.zeros((self._of.size, len(x)))
        by_p = np.zeros((self._of.size, len(self.chosen)))
        h = self.at(x).heights
        values = h.value if slip is None else slip
        left = list[tuple[int, ...]]()
        for s in self.system.sets:
            own = list(s)
            r = math.hypot(*values[own])
            if mode[own[0]] != "*" or (r == 0.0 and s in self.idle):
                continue
            if r == 0.0:
                left.append(s)
                continue
            acting[own] = u = values[own] / r
            turn = (np.eye(len(own)) - np.outer(u, u)) / r
            by_state[own], by_p[own] = turn @ h.x[own], turn @ h.p[own]
        for s in left:
            acting[list(s)] = self._direction(mode, s, x, acting)
        here = self._balanced(mode, x, acting)
        sliding, columns = self._sliding(mode)
        if sliding:
            slope, g = here.rates.a[np.ix_(sliding, columns)], here.rates
            by_state[columns] = -np.linalg.solve(slope, g.along(by_state)[sliding])
            by_p[columns] = -np.linalg.solve(slope, g.by_parameters(by_p)[sliding])
        self.acting = acting
        return here, by_state, by_p

    def _sliding(self, mode: str, but: Sequence[int] = ()) -> tuple[list[int], list[int]]:
        """Sliding surfaces and closed contacts of a mode, and the columns of their unknowns."""
        sliding = [i for i in self._coupled.sliding(mode) if i not in but]
        return sliding, [self._of.column[i] for i in sliding]

    def _balanced(self, mode: str, x: Array, acting: Array, but: Sequence[int] = ()) -> AtMode:
        """Values with the solved multipliers of sliding surfaces, written into ``acting``."""
        sliding, columns = self._sliding(mode, but)
        here = self.at(x, acting)
        if not sliding:
            return here
        linear = self._coupled.affine
        if not linear:
            acting[columns] = self._near(mode, x, columns)
            here = self.at(x, acting)
        for _ in range(1 if linear else _MOST_STEPS):
            step = np.linalg.solve(
                here.rates.a[np.ix_(sliding, columns)], here.rates.value[sliding]
            )
            acting[columns] -= step
            here = self.at(x, acting)
            if np.abs(step).max() <= 1e-16 * (1.0 + np.abs(acting).max()):
                break
        return here

    def _near(self, mode: str, x: Array, columns: Sequence[int]) -> Array:
        """Start of Newton's method for multipliers that enter nonlinearly: the last ones, or solved anew."""
        if self.acting[list(columns)].any():
            return np.asarray(self.acting[list(columns)])
        found = sliding_multipliers(self._coupled, mode, x, self.p)
        if len(found) != 1:
            raise DegenerateError(
                f"mode {self.system.spelled(mode)!r} at {x.tolist()}: expected one set of multipliers "
                f"that keeps the sliding, received {len(found)}. Start elsewhere on the surface."
            )
        return np.asarray(found[0][self._coupled.sliding(mode)])

    def frozen(self, mode: str, s: tuple[int, ...], x: Array, acting: Array) -> Frozen:
        """The law h' = a - M lambda of a set, with what slides elsewhere eliminated."""
        own, rest = list(s), acting.copy()
        rest[own] = 0.0
        rest[[self._of.column[i] for i in own]] = 0.0
        here = self._balanced(mode, x, rest, but=own)
        sliding, columns = self._sliding(mode, but=own)
        g = here.rates
        slope = g.a[np.ix_(own, own)]
        if sliding:
            back = np.linalg.solve(g.a[np.ix_(sliding, columns)], g.a[np.ix_(sliding, own)])
            slope = slope - g.a[np.ix_(own, columns)] @ back
        return Frozen(g.value[own], -slope)

    def _direction(self, mode: str, s: tuple[int, ...], x: Array, acting: Array) -> Array:
        law = self.frozen(mode, s, x, acting)
        if not law.definite or np.abs(law.m - law.m.T).max() > 1e-12 * np.abs(law.m).max():
            raise DegenerateError(
                f"set h{self.system.entries.index(s)} at {x.tolist()}: expected friction that gives the "
                "direction in which it is left, received a matrix that is not symmetric and positive "
                "definite. Start off the set."
            )
        return leaving_direction(law.a, law.m)[1]

    # integration along steps --------------------------------------------------------------------------------

    def across(self, mode: str, c: Array, dt: float, y: Array, leaving: Sequence[int]) -> Array:
        """Carry derivatives over a step with the Taylor coefficients c of the states."""
        # ``leaving`` are switching functions of sets that are left at its start.
        nodes, inner, outer = _gauss()
        n, count = len(c), y.shape[1]
        slips = self._slips(mode, c, dt * nodes, leaving)
        matrix, right = np.eye(_NODES * n), np.zeros((_NODES * n, count))
        for i, node in enumerate(nodes):
            powers = (node * dt) ** np.arange(c.shape[1])
            slip = None if slips is None else slips[:, i]
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                here, by_state, by_p = self.moving(mode, c @ powers, slip)
            jacobian = here.field.along(by_state)
            rows = slice(i * n, (i + 1) * n)
            for j in range(_NODES):
                matrix[rows, j * n : (j + 1) * n] -= dt * inner[i, j] * jacobian
            right[rows] = jacobian @ y
            right[rows, n:] += here.field.by_parameters(by_p)
        if not np.all(np.isfinite(matrix)):
            return np.full_like(y, np.nan)
        rates = np.linalg.solve(matrix, right).reshape(_NODES, n, count)
        return np.asarray(y + dt * np.tensordot(outer, rates, 1))

    def _slips(self, mode: str, c: Array, times: Array, leaving: Sequence[int]) -> Array | None:
        """All h at times after sets were left, without the rounding of what is zero at the start."""
        if not leaving:
            return None
        own, start = list(leaving), self.at(c[:, 0]).heights
        series = start.x @ c
        tangential = np.abs(series[own, 1]) <= _TANGENTIAL * np.abs(start.x[own]) @ np.abs(c[:, 1])
        series[own, 0] = 0.0
        series[np.array(own)[tangential], 1] = 0.0
        found = np.empty((len(start.value), len(times)))
        for i, t in enumerate(times):
            x = c @ t ** np.arange(c.shape[1])
            bent = self.at(x).heights.value - start.value - start.x @ (x - c[:, 0])
            size = np.abs(start.x) @ np.abs(x)
            bent[np.abs(bent) <= 64 * np.finfo(float).eps * size] = 0.0
            linear = series @ t ** np.arange(c.shape[1])
            found[:, i] = start.value + start.x @ (x - c[:, 0]) + bent
            found[own, i] = (linear + bent)[own]
        return found

    # jumps at sets ------------------------------------------------------------------------------------

    def hit(self, mode: str, members: tuple[int, ...], x: Array, y: Array) -> Array:
        """Derivatives after a set is reached, from those just before; ``mode`` is that before."""
        held = "".join("s" if i in members else c for i, c in enumerate(mode))
        here, _, _ = self.moving(held, x)
        sliding, columns = self._sliding(held)
        miss = here.heights.x @ y
        miss[:, len(x) :] += here.heights.p
        required = np.where(np.isin(sliding, members)[:, None], miss[sliding], 0.0)
        back = np.linalg.solve(here.rates.a[np.ix_(sliding, columns)], required)
        return np.asarray(y - here.field.a[:, columns] @ back)

    def time_of_hit(self, mode: str, members: tuple[int, ...], x: Array, y: Array) -> Array:
        """Derivatives of the time at which a set is reached, from some way off; any M."""
        # With u = h/|h| and dt = |h| ds the state, u and log |h| have a regular equation up to the set, and so
        # have their derivatives: u' = (1 - u u^T) h', (log |h|)' = u . h' with h' by the time.
        from scipy.integrate import solve_ivp  # here: it is not needed to import the library

        own, n, k, count = list(members), len(x), len(members), y.shape[1]
        shapes: list[tuple[int, ...]]
        shapes = [(n,), (k,), (1,), (n, count), (k, count), (count,), (count,)]
        edges = np.cumsum([0, *[math.prod(shape) for shape in shapes]])

        def split(z: Array) -> list[Array]:
            parts = zip(pairwise(edges), shapes, strict=True)
            return [z[a:b].reshape(shape) for (a, b), shape in parts]

        def rates(_: float, z: Array) -> Array:
            x, u, log_r, dx, du, dlog = split(z)[:-1]
            u = u / math.hypot(*u)  # an error of its length would grow as 1/|h|^2
            du = du - np.outer(u, u @ du)
            here, change = self._towards(mode, own, x, u, dx, du)
            f, df = here.field.value, change(here.field)
            g, dg, r = here.rates.value[own], change(here.rates)[own], math.exp(log_r[0])
            grows, dgrows = u @ g, u @ dg + g @ du
            turns = dg - np.outer(u, dgrows) - du * grows
            moves = r * (df + np.outer(f, dlog))
            parts = [r * f, g - u * grows, np.array([grows]), moves, turns, dgrows, r * dlog]
            return np.concatenate([part.ravel() for part in parts])

        start = self.at(x).heights
        r0 = math.hypot(*start.value[own])
        u, dh = start.value[own] / r0, start.x[own] @ y
        dh[:, n:] += start.p[own]
        du, size = (dh - np.outer(u, u @ dh)) / r0, r0 * _GONE
        whole: list[Array]
        whole = [x, u, np.array([math.log(r0)]), y, du, u @ dh / r0, np.zeros(count)]
        arrived = lambda _, z: z[n + k] - math.log(size)
        arrived.terminal = True  # type: ignore[attr-defined]
        found = solve_ivp(
            rates,
            (0.0, np.inf),
            np.concatenate([part.ravel() for part in whole]),
            method="DOP853",
            rtol=1e-11,
            atol=1e-13,
            events=arrived,
        )
        return np.asarray(split(found.y[:, -1])[-1])

    def _towards(
        self, mode: str, own: Sequence[int], x: Array, u: Array, dx: Array, du: Array
    ) -> tuple[AtMode, Callable[[Derived], Array]]:
        """Values with a set's multiplier u, and their linear change with the state and u."""
        slip = self.at(x).heights.value
        slip[own] = u
        here, by_state, by_p = self.moving(mode, x, slip)
        acting = by_state @ dx
        acting[:, len(x) :] += by_p
        acting[own] = du
        sliding, columns = self._sliding(mode)

        def change(of: Derived) -> Array:
            changed = of.x @ dx + of.a @ acting
            changed[:, len(x) :] += of.p
            return np.asarray(changed)

        if sliding:
            acting[columns] = 0.0
            slope = here.rates.a[np.ix_(sliding, columns)]
            acting[columns] = -np.linalg.solve(slope, change(here.rates)[sliding])
        return here, change

    def time_of_exit(self, mode: str, which: Sequence[int], x: Array, y: Array) -> Array:
        """Derivatives of the time at which |lambda| of a set or surface reaches 1, or a reaction 0."""
        here, by_state, by_p = self.moving(mode, x)
        own = [self._of.column[i] for i in which]
        lam, n = self.acting[own], here.factors.value[list(which)]
        g_x, g_p = by_state[own], by_p[own]
        if which[0] < self.system.surface_count:
            ratio = (lam / n)[:, None]
            f = here.factors
            g_x = (g_x - ratio * f.along(by_state)[list(which)]) / n[:, None]
            g_p = (g_p - ratio * f.by_parameters(by_p)[list(which)]) / n[:, None]
            g_x, g_p = (lam / n) @ g_x, (lam / n) @ g_p
        else:
            g_x, g_p = g_x[0], g_p[0]
        change = g_x @ y
        change[len(x) :] += g_p
        return np.asarray(-change / (g_x @ here.field.value))


# Sensitivities of runs through sets of codimension two and three.


def set_sensitivity(run: Trajectory, names: Sequence[str]) -> Sensitivity:
    """Derivatives of a run of a system with sets; as ``nonsmooth.sensitivity``."""
    system = run.system
    require_plain(system, "sensitivity with sets")
    chosen = [system.parameter_names.index(name) for name in names]
    passage = _Passage(run, Variation(system, system.parameter_vector(run.parameters), chosen))
    passage.follow()
    n, size = system.dimension, system.extended_dimension
    keep = np.r_[0:n, size : size + len(chosen)]
    by_time = np.array(passage.rows).reshape(len(passage.rows), size + len(chosen))[:, keep]
    y, dt = passage.y[:n, keep], passage.dt_end[keep]
    return Sensitivity(
        dx_dx0=y[:, :n],
        dx_dp=y[:, n:],
        event_times=np.array(passage.times),
        dt_dx0=by_time[:, :n],
        dt_dp=by_time[:, n:],
        dt_end_dx0=dt[:n],
        dt_end_dp=dt[n:],
        names=tuple(names),
        run=run,
    )


#: Down to this part of the largest |h| since the last event the steps carry derivatives towards a hit.
_NEAR = 1e-2


#: Kinds of events of surfaces and sets.
_CHANGES = ("crossing", "entry", "exit")

#: Switching functions of a set that was held are zero at this part of what they are made of.
_ON_SET = 1e-14


class _Passage:
    """Derivatives carried along a run."""

    def __init__(self, run: Trajectory, law: Variation):
        self.run, self.law, self.system = run, law, run.system
        size, q = self.system.extended_dimension, len(law.chosen)
        self.y: Array = np.concatenate([np.eye(size), np.zeros((size, q))], axis=1)
        self.times: list[float] = []
        self.rows: list[Array] = []
        self.dt_end: Array = np.zeros(size + q)
        edges = [*run.steps.starts.tolist(), float(run.t[-1])]
        #: Steps with a duration.
        self._steps = [(k, a, b) for k, (a, b) in enumerate(pairwise(edges)) if a != b]

    def follow(self) -> None:
        """Carry the derivatives to the end."""
        events = self.run.events
        self._begin(events[0].mode_before)
        k, leaving = 0, list[int]()
        before: list[tuple[Array, Array]] = []
        forward = self.run.t[-1] >= self.run.t[0]
        for event, previous in zip(events, [None, *events[:-1]], strict=True):
            mode = self.system.widened(event.mode_before)
            while k < len(self._steps):
                step, a, b = self._steps[k]
                if (a >= event.t) if forward else (a <= event.t):
                    break
                c = np.asarray(self.run.steps.coefficients[step])
                before.append((c[:, 0], self.y))
                # Up to a hit rounding may leave no slip: what is lost there the hit takes away anyway.
                moved = self.law.across(mode, c, b - a, self.y, leaving)
                self.y, leaving, k = moved if np.all(np.isfinite(moved)) else self.y, [], k + 1
            if event.kind in ("end", "stop"):
                if event.kind == "stop":
                    self._stop(mode, event)
                continue
            self._require_caused(event, previous)
            leaving += self._pass(mode, event, before)
            before = []

    def _begin(self, spelled: str) -> None:
        """Neighbours of a start on a set reach it at once."""
        mode, x = self.system.widened(spelled), self._extended(self.run.x[0], self.run.t[0])
        h = self.law.at(x).heights.value
        for s in self.system.sets:
            if mode[s[0]] == "s":
                self.y = self.law.hit(mode, s, x, self.y)
            elif not h[list(s)].any() and s not in self.law.idle:
                raise DegenerateError(
                    "run: expected a start off the sets that it leaves, received one on h = 0. "
                    "Neighbours leave from elsewhere: start a little later."
                )

    def _extended(self, x: Array, t: float) -> Array:
        return np.append(x, t) if self.system.time_dependent else np.asarray(x)

    def _require_caused(self, event: Event, previous: Event | None) -> None:
        """Refuse what has no derivative: corners, and infinitely many impacts."""
        if event.kind == "contact":
            raise DegenerateError(
                f"run: expected finitely many impacts before a contact closes, received impacts on "
                f"{event.name!r} that accumulate at t = {event.t:.10g}. End the run before, or give a "
                "restitution of 0."
            )
        met = self._members(event)
        if event.kind in _CHANGES and not event.side and len(met) < 2:
            raise DegenerateError(
                f"run: the {event.kind} at t = {event.t:.10g} is no zero of a function and has no "
                "derivative. End the run before it."
            )
        if event.kind == "crossing" and len(met) > 1:
            raise DegenerateError(
                f"run: expected hits of sets and ends of sliding only, received {event.kind!r} at "
                f"t = {event.t:.10g}. A set that is crossed exactly is a corner: perturb the start."
            )
        pairs = zip(event.mode_before, event.mode_after, self.system.entries, strict=False)
        others = [s for a, b, s in pairs if a != b and a in "+-*" and s != met]
        if event.kind in ("crossing", "entry", "exit", "release") and others:
            other = f"h{self.system.entries.index(others[0])}"
            raise DegenerateError(corner(event.t, event.name, other))
        if previous is None or abs(event.t - previous.t) > TIE * max(1.0, abs(event.t)):
            return
        if event.kind not in ("reset", "impact") or not self._follows(event, previous):
            raise DegenerateError(corner(event.t, previous.name, event.name))

    def _follows(self, event: Event, previous: Event) -> bool:
        """Whether the previous event causes this one, so that neighbours have both at one instant."""
        if _ends_sliding(previous):
            return False
        one = self._at(self.system.widened(previous.mode_before), previous)
        other = self._at(self.system.widened(event.mode_before), event)
        return parallel(other.gradient @ one.after_state, one.gradient)

    def _members(self, event: Event) -> tuple[int, ...]:
        """Switching functions of the surface or set that an event belongs to."""
        own = event.kind in _CHANGES and 0 <= event.element < len(self.system.entries)
        return self.system.entries[event.element] if own else ()

    def _at(self, mode: str, event: Event) -> AtEvent:
        """An event's function and the state after it, with derivatives."""
        x, p, letters = self._extended(event.x, event.t), self.law.p, ""
        if event.kind == "impact":
            after = self._extended(event.x_after, event.t)
            choice = lambda w: instant_map(self.system, mode, "impact", event.element, w)(x, p)
            letters = struck_letters(self.system, mode, event.element, choice, after)
        return instant_map(self.system, mode, event.kind, event.element, letters)(x, p)

    def _pass(self, mode: str, event: Event, before: Sequence[tuple[Array, Array]]) -> list[int]:
        """Carry the derivatives through an event."""
        # ``before`` are the states and derivatives at the steps since the last event.
        x, following = self._extended(event.x, event.t), self.system.widened(event.mode_after)
        met = self._members(event)
        self.times.append(event.t)
        if event.kind == "entry" and len(met) > 1:
            self.rows.append(self._time_of_hit(mode, met, before))
            self.y = self.law.hit(mode, met, x, self.y)
        elif _ends_sliding(event):
            contact = self.system.surface_count + event.element - len(self.system.entries)
            which = met or (contact,)
            self.rows.append(self.law.time_of_exit(mode, which, x, self.y))
        else:
            self._jump(mode, following, event)
        after = self._slip(mode, self._extended(event.x_after, event.t))
        left = [s for s in self.system.sets if mode[s[0]] == "s" != following[s[0]]]
        return [i for s in left if not after[list(s)].any() for i in s]

    def _slip(self, mode: str, x: Array) -> Array:
        """Switching functions at a state, zero to rounding where a set was held."""
        h = self.law.at(x).heights
        size = np.abs(h.x) @ np.abs(x)
        held = [i for i, letter in enumerate(mode) if letter == "s"]
        value = h.value.copy()
        value[held] = np.where(np.abs(value) <= _ON_SET * size, 0.0, value)[held]
        return value

    def _time_of_hit(
        self, mode: str, met: tuple[int, ...], before: Sequence[tuple[Array, Array]]
    ) -> Array:
        """Derivatives of the time of a hit: from a state at some distance, where h has all its digits."""
        r = [float(np.linalg.norm(self.law.at(x).heights.value[list(met)])) for x, _ in before]
        far = [k for k, size in enumerate(r) if size > _NEAR * max(r)]
        if not far:
            return np.full(self.y.shape[1], np.nan)
        return self.law.time_of_hit(mode, met, *before[far[-1]])

    def _jump(self, mode: str, following: str, event: Event) -> None:
        """Saltation, and the sets onto which a reset or impact leads."""
        at, chosen = self._at(mode, event), self.law.chosen
        x, after = self._extended(event.x, event.t), self._extended(event.x_after, event.t)
        what = f"{event.name!r} at t = {event.t:.10g}"
        n, rates = len(x), list[Array]()
        for letters, state in ((mode, x), (following, after)):
            here, _, _ = self.law.moving(letters, state, self._slip(mode, state))
            rates.append(here.field.value)
        s = saltation(at, rates[0], rates[1], what)
        time = s.time_by_state @ self.y
        time[n:] += s.time_by_parameters[chosen]
        self.rows.append(time)
        self.y = s.matrix @ self.y
        self.y[:, n:] += s.by_parameters[:, chosen]
        if event.kind in ("reset", "impact"):
            for own in self.system.sets:
                if following[own[0]] == "s":
                    self.y = self.law.hit(following, own, after, self.y)

    def _stop(self, mode: str, event: Event) -> None:
        """Derivatives of the end and of its time."""
        at, x = self._at(mode, event), self._extended(event.x, event.t)
        rate = self.law.moving(mode, x)[0].field.value
        s = saltation(at, rate, rate, f"{event.name!r} at t = {event.t:.10g}")
        self.dt_end = s.time_by_state @ self.y
        self.dt_end[len(x) :] += s.time_by_parameters[self.law.chosen]
        self.y = self.y + np.outer(rate, self.dt_end)


def _ends_sliding(event: Event) -> bool:
    """Whether a multiplier or reaction came to its limit, where the field is continuous."""
    slid = event.kind in _CHANGES and event.mode_before[event.element] == "s"
    return event.kind == "release" or slid
