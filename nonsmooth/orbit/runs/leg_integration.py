"""Integration of all legs of an orbit or run in one call, with derivatives of legs and events.

The results of :func:`~nonsmooth.orbit.runs.legs.integrate_leg` and
:meth:`~nonsmooth.orbit.runs.legs.Leg.at_event` are stacked, legs on the first axis.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import accumulate, pairwise

import numpy as np

from ...flow.engine.columns import CarriedLegs
from ...flow.engine.smooth import LegsProgram
from ...flow.fixed import MOST_STEPS, TOLERANCE, legs_program, stuck
from ...flow.variation import Arc, carry_legs, require_done
from ...model import Array, ConvergenceError, DegenerateError, FilippovSystem
from ...model.derivatives.event_maps import AtEvent, surface_map
from ...model.derivatives.variational import VariationalField, plain_field
from .legs import Leg, LegFlow, leg_name
from .limit_leg import limit_flow
from .saltation import Ended

#: Local errors of the steps in extended precision.
EXTENDED = 2.0**-64


#: Relative difference of two fields below which they are that of one leg.
_SAME = 1e-3


@dataclass(frozen=True, eq=False)
class LegFlows:
    """Flows of legs; rows of legs with fewer states than S end in zeros."""

    #: States of each leg.
    sizes: tuple[int, ...]
    #: end, before, rate (L, S): States at the ends, fields at the starts and at the ends.
    end: Array
    before: Array
    rate: Array
    #: by_start, by_parameters (L, S, N), (L, S, q): Derivatives of ``end``.
    by_start: Array
    by_parameters: Array
    #: after, after_state, after_parameters (L, N), (L, N, S), (L, N, np): States after the events,
    #: and their derivatives.
    after: Array
    after_state: Array
    after_parameters: Array
    #: value, gradient, value_parameters (L,), (L, S), (L, np): The events' functions, and their
    #: derivatives.
    value: Array
    gradient: Array
    value_parameters: Array

    @property
    def ended(self) -> Ended:
        """Ends and events, for saltation matrices."""
        maps = self.after_state, self.after_parameters
        return Ended(self.rate, *maps, self.gradient, self.value_parameters)

    @cached_property
    def by_leg(self) -> tuple[LegFlow, ...]:
        """Leg by leg."""
        rows = zip(self.sizes, self.end, self.by_start, self.by_parameters, self.rate, strict=True)
        return tuple(LegFlow(end[:k], x[:k], by_p[:k], rate[:k]) for k, end, x, by_p, rate in rows)

    @cached_property
    def events(self) -> tuple[AtEvent, ...]:
        """Event by event."""
        return tuple(
            AtEvent(
                self.after[i],
                self.after_state[i, :, :k],
                self.after_parameters[i],
                float(self.value[i]),
                self.gradient[i, :k],
                self.value_parameters[i],
            )
            for i, k in enumerate(self.sizes)
        )


@lru_cache(maxsize=256)
def _event_offsets(n: int, most: int, q: int) -> tuple[int, ...]:
    """Where g, g_x, g_p, e, e_x and e_p begin and end."""
    return (0, *accumulate((n, n * most, n * q, 1, most, q)))


class LegIntegrator:
    """Legs that are integrated repeatedly, with derivatives by the ``chosen`` parameters."""

    def __init__(
        self,
        system: FilippovSystem,
        legs: Sequence[Leg],
        chosen: tuple[int, ...] = (),
        by_leg: bool = False,
    ):
        self.system, self.legs, self.chosen = system, tuple(legs), chosen
        #: Whether parameters are given leg by leg, (L, np).
        self._by_leg = by_leg
        # events at one instant follow from each other: composed in Python
        self._composed = [i for i, leg in enumerate(self.legs) if leg.further and not leg.timed]
        self._plain = [i for i, leg in enumerate(self.legs) if leg.timed]

    @cached_property
    def fields(self) -> list[VariationalField]:
        """The field of each leg."""
        distinct = {leg: leg.field(self.system, self.chosen) for leg in set(self.legs)}
        return [distinct[leg] for leg in self.legs]

    @cached_property
    def sizes(self) -> tuple[int, ...]:
        """States of each leg; those of infinitely many events have the time to their limit."""
        return tuple(self.system.extended_dimension + bool(leg.repeats) for leg in self.legs)

    @cached_property
    def _units(self) -> Array:
        """States of zero with the identity as their derivatives, leg by leg."""
        n = self.system.extended_dimension
        return np.tile(np.eye(1 + n + len(self.chosen), n, -1), (len(self.legs), 1, 1))

    @cached_property
    def _most(self) -> int:
        return max(self.sizes)

    @cached_property
    def _are_explicit(self) -> bool:
        """Whether each leg is a flow of the states alone."""
        if self.system.sets or any(leg.repeats for leg in self.legs):
            return False
        return all(field.entries == field.by_start for field in self.fields)

    @cached_property
    def _program(self) -> LegsProgram:
        maps = {leg: None if leg.further else leg.map(self.system) for leg in set(self.legs)}
        events = [maps[leg] for leg in self.legs]
        return legs_program(self.fields, events, len(self.system.parameter_names), self._by_leg)

    @cached_property
    def _plain_program(self) -> LegsProgram | None:
        """Legs without derivatives, where each is a flow of the states to one event."""
        if self._plain or self._composed or not self._are_explicit:
            return None
        maps = {leg: leg.map(self.system) for leg in set(self.legs)}
        fields = {leg.mode: plain_field(self.system, leg.mode) for leg in set(self.legs)}
        events = [at.plain for leg in self.legs if (at := maps[leg]) is not None]
        of_legs = [fields[leg.mode] for leg in self.legs]
        return legs_program(of_legs, events, len(self.system.parameter_names), self._by_leg)

    def ends(
        self, starts: Array, durations: Array, p: Array, extended: bool
    ) -> tuple[Array, Array | None, Array] | None:
        """States (L, N) after the events and the events' functions (L,), or None where a leg fails."""
        # Between them what rounding leaves of the states, in extended precision. None, too, where not each leg
        # is a flow of the states to one event.
        program = self._plain_program
        if program is None:
            return None
        n = starts.shape[1]
        if extended:
            found = program.extended(starts, p, durations, EXTENDED, MOST_STEPS)
            if found is None:
                return None
            results, rest = found
            return results[:, :n], rest[:, :n], results[:, n]
        flow = program(starts, p, durations, TOLERANCE, MOST_STEPS)
        if flow.failed >= 0:
            return None
        return flow.results[:, :n], None, flow.results[:, n]

    def __call__(
        self, starts: Array, durations: Array, p: Array, tol: float = TOLERANCE
    ) -> LegFlows:
        """Integrate all legs."""
        if not self._are_explicit:
            return self._by_modes(starts, durations, p)
        n = starts.shape[1]
        columns = 1 + n + len(self.chosen)
        z = self._units.copy()
        z[:, 0] = starts
        flow = self._program(z, p, durations, tol, MOST_STEPS)
        if flow.failed >= 0:
            i = flow.failed
            error = stuck(float(durations[i]), flow.left, flow.ends[i, :n])
            raise ConvergenceError(f"{self._named(i)}: {error}", point=error.point)
        whole = flow.ends.reshape(len(starts), columns, n).swapaxes(1, 2)
        end, x, by_p = whole[:, :, 0], whole[:, :, 1 : 1 + n], whole[:, :, 1 + n :]
        result = LegFlows(
            self.sizes,
            end,
            flow.before[:, :n],
            flow.after[:, :n],
            x,
            by_p,
            *self._events(flow.results, n, p.shape[-1]),
        )
        return self._completed(result, p)

    def _each(self, p: Array) -> Array:
        """Parameters of each leg (L, np)."""
        return p if self._by_leg else np.broadcast_to(p, (len(self.legs), p.size))

    def _events(self, results: Array, n: int, q: int) -> tuple[Array, ...]:
        """Outputs of the events' programs: g, g_x, g_p, e, e_x, e_p."""
        count, most = len(self.legs), self._most
        at = _event_offsets(n, most, q)
        if not results.shape[1]:
            results = np.zeros((count, at[-1]))
        g, gx, gp, e, ex, ep = [results[:, a:b] for a, b in pairwise(at)]
        return (
            g,
            gx.reshape(count, most, n).swapaxes(1, 2),
            gp.reshape(count, q, n).swapaxes(1, 2),
            e[:, 0],
            ex,
            ep,
        )

    def _completed(self, flows: LegFlows, p: Array) -> LegFlows:
        """Fill in legs that end at a time, and events with several changes at one instant."""
        if not self._plain and not self._composed:
            return flows
        for i in self._composed:
            self._fill(flows, i, self.legs[i].at_event(self.system, flows.end[i], self._each(p)[i]))
        return self._without_events(flows)

    def _without_events(self, flows: LegFlows) -> LegFlows:
        n = flows.after.shape[1]
        for i in self._plain:
            flows.after[i] = flows.end[i, :n]
            flows.after_state[i] = np.eye(n, self._most)
            for rows in (flows.after_parameters, flows.gradient, flows.value_parameters):
                rows[i] = 0.0
            flows.value[i] = 0.0
        return flows

    def _fill(self, flows: LegFlows, i: int, at: AtEvent) -> None:
        k = self.sizes[i]
        flows.after[i], flows.after_state[i, :, :k] = at.after, at.after_state
        flows.after_parameters[i], flows.value[i] = at.after_parameters, at.value
        flows.gradient[i, :k], flows.value_parameters[i] = at.gradient, at.by_parameters

    def _by_modes(self, starts: Array, durations: Array, p: Array) -> LegFlows:
        """Integrate all legs by the law of their modes."""
        system, (count, n), q = self.system, starts.shape, len(self.chosen)
        arcs, onto, own = list[Arc](), dict[int, list[Array]](), self._each(p)
        for i, (leg, x, t) in enumerate(zip(self.legs, starts, durations.tolist(), strict=True)):
            if leg.left:
                x, *onto[i] = _onto_set(system, leg, x, own[i])
            arcs.append(leg.arc(system, x, 0.0 if leg.repeats else t))
        found = carry_legs(system, arcs, p, self.chosen)
        with self._naming(found.failed):
            require_done(system, arcs, found)
        by = found.derivatives
        for i, (by_start, by_p) in onto.items():
            by[i, :, n:] += by[i, :, :n] @ by_p[:, list(self.chosen)]
            by[i, :, :n] = by[i, :, :n] @ by_start
        flows, most = self._empty(count, n, q, p.shape[-1]), slice(n)
        flows.end[:, most], flows.before[:, most], flows.rate[:, most] = (
            found.ends,
            found.before,
            found.rates,
        )
        flows.by_start[:, most], flows.by_parameters[:, most] = by[:, :, :n], by[:, :, n:]
        for i, leg in enumerate(self.legs):
            if leg.repeats:
                self._to_limit(flows, i, starts[i], float(durations[i]), own[i])
            elif leg.reaches_set(system):
                self._fill(flows, i, self._reached(flows, found, i, own[i]))
            elif not leg.timed:
                self._fill(flows, i, leg.at_event(system, flows.end[i, :n], own[i]))
        return self._without_events(flows)

    def _empty(self, count: int, n: int, q: int, parameters: int) -> LegFlows:
        """Flows of ``count`` legs of zeros."""
        most = self._most
        end, before, rate = (np.zeros((count, most)) for _ in range(3))
        x, by_p = np.zeros((count, most, n)), np.zeros((count, most, q))
        events = self._events(np.zeros((count, 0)), n, parameters)
        return LegFlows(self.sizes, end, before, rate, x, by_p, *events)

    def _to_limit(self, flows: LegFlows, i: int, x: Array, duration: float, p: Array) -> None:
        """Fill in a leg of infinitely many events."""
        leg, following = self.legs[i], (i + 1) % len(self.legs)
        with self._naming(i):
            part, after = limit_flow(self.system, leg, x, duration, p, self.chosen)
        before = flows.before[following, : len(x)]
        if np.abs(before - after).max() <= _SAME * np.abs(after).max():
            before[:] = after  # equal up to residuals: lost directions are so exactly
        flows.end[i], flows.rate[i] = part.end, part.rate
        flows.by_start[i], flows.by_parameters[i] = part.by_start, part.by_parameters
        self._fill(flows, i, leg.at_event(self.system, part.end, p))

    def _reached(self, flows: LegFlows, found: CarriedLegs, i: int, p: Array) -> AtEvent:
        """The end of a leg at a set: the motion continues over the whole duration as it reaches the set."""
        n, members = flows.after.shape[1], self.system.entries[self.legs[i].element]
        end, rate = flows.end[i, :n], flows.rate[i, :n]
        h = [surface_map(self.system, k)(end, p).value for k in members]
        left, gradient = float(found.left[i]), found.gradients[i]
        end += left * rate
        value = float(np.linalg.norm(h)) + left * float(gradient[:n] @ rate)
        return AtEvent.smooth_at(end, value, gradient[:n], gradient[n:])

    @contextmanager
    def _naming(self, i: int) -> Iterator[None]:
        """Name the leg in its errors."""
        try:
            yield
        except ConvergenceError as error:
            raise ConvergenceError(f"{self._named(i)}: {error}", point=error.point) from None
        except DegenerateError as error:
            raise DegenerateError(f"{self._named(i)}: {error}") from None

    def _named(self, i: int) -> str:
        return f"leg {i + 1} {leg_name(self.system, self.legs[i])}"


def _onto_set(system: FilippovSystem, leg: Leg, x: Array, p: Array) -> tuple[Array, Array, Array]:
    """The state to first order on the sets that a leg leaves, with derivatives by state and parameters."""
    at = [surface_map(system, i)(x, p) for i in leg.left]
    rows = np.array([own.gradient for own in at])
    back = np.zeros(rows.T.shape)
    back[: system.dimension] = np.linalg.pinv(rows[:, : system.dimension])  # at the same time
    by_p = -back @ np.array([own.by_parameters for own in at])
    return x - back @ [own.value for own in at], np.eye(len(x)) - back @ rows, by_p
