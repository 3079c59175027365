"""Derivatives of runs with friction in the plane: through sets of codimension two and three.

Surfaces, impacts, resets and stops may be beside the sets.

Between events the variational equation is integrated along the steps of the run (``set_variation``). At a
hit of a set its own formula holds; at every other event that of ``saltation``. A set that is crossed
exactly at h = 0 is a corner, where a run has no derivative.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ..flow.facts import TIE
from ..flow.trajectory import Event, Trajectory
from ..model import Array, DegenerateError
from ..model.event_maps import AtEvent, instant_map
from .legs import corner, parallel, struck_letters
from .saltation import saltation
from .set_variation import Variation
from .variation import Sensitivity


def set_sensitivity(run: Trajectory, names: Sequence[str]) -> Sensitivity:
    """Derivatives of a run of a system with sets; as ``nonsmooth.sensitivity``.

    Raises
    ------
    DegenerateError
        A set that is crossed exactly, a start that leaves one, an event that is grazed, events at one
        instant that do not follow from one another, impacts that accumulate.
    """
    system = run.system
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


#: Switching functions of a set that was held are zero at this part of what they are made of.
_ON_SET = 1e-14


class _Passage:
    """Derivatives on their way along a run."""

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
        met = self._met(event)
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
        """Whether neighbours meet an event at the instant of the one before, which led onto its zero."""
        if _ends_sliding(previous):
            return False
        one = self._at(self.system.widened(previous.mode_before), previous)
        other = self._at(self.system.widened(event.mode_before), event)
        return parallel(other.gradient @ one.after_state, one.gradient)

    def _met(self, event: Event) -> tuple[int, ...]:
        """Switching functions of the surface or set that an event is named after."""
        if event.kind not in ("crossing", "entry", "exit"):
            return ()
        return self.system.entries[int(event.name.removeprefix("lambda").removeprefix("h"))]

    def _at(self, mode: str, event: Event) -> AtEvent:
        """An event's function and the state after it, with derivatives."""
        x, p, letters = self._extended(event.x, event.t), self.law.p, ""
        if event.kind == "impact":
            after = self._extended(event.x_after, event.t)
            choice = lambda w: instant_map(self.system, mode, "impact", event.name, w)(x, p)
            letters = struck_letters(self.system, mode, event.name, choice, after)
        return instant_map(self.system, mode, event.kind, event.name, letters)(x, p)

    def _pass(self, mode: str, event: Event, before: Sequence[tuple[Array, Array]]) -> list[int]:
        """Carry the derivatives through an event; switching functions of the sets that are left there.

        ``before`` are the states and derivatives at the steps since the last event.
        """
        x, following = self._extended(event.x, event.t), self.system.widened(event.mode_after)
        met = self._met(event)
        self.times.append(event.t)
        if event.kind == "entry" and len(met) > 1:
            self.rows.append(self._time_of_hit(mode, met, before))
            self.y = self.law.hit(mode, met, x, self.y)
        elif _ends_sliding(event):
            j = self.system.impacts.index(event.name) if event.kind == "release" else 0
            which = met or (self.system.surface_count + j,)
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
    return event.kind == "release" or event.name.startswith("lambda")
