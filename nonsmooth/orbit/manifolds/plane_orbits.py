"""Orbits of a planar system in a box: evenly spaced orbits and separatrices."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np

from ...flow import Status, Trajectory, simulate
from ...local.point.regions import Region
from ...local.point.surface_point import SIDES
from ...local.scans.plane_scan import PlaneScan
from ...model import Array, FilippovSystem, Stop
from ...model.definition.elements import Complementarity
from .evenly_spaced_orbits import Cut, SpacedOrbit, evenly_spaced, polyline, until_rest

_TOLERANCE = 1e-8  # far below the resolution of a picture
_CHUNK, _LONGEST = 12, 600  # steps after which an orbit is cut, and the most steps
_EVENTS = 200
_PASSES = 40.0  # passages of the box by a typical orbit in the longest time
_NEAR = 1e-4  # in units of the box: starts from a saddle, and the gap of a closed orbit


class PlaneOrbits:
    """Orbits through crossing and sliding, forward and backward, to a little outside the box."""

    # They end where an event of the scan is due, at a gap, and backward at the boundary of a condition.

    def __init__(self, scan: PlaneScan, t_end: float | None = None):
        self.scan = scan
        self.t_end = _duration(scan) if t_end is None else t_end

    @cached_property
    def rests(self) -> list[Array]:
        """Where orbits rest."""
        found = [at.point for at in [*self.scan.equilibria, *self.scan.boundary_equilibria]]
        return found + [at.point for at in self.scan.pseudo_equilibria]

    @cached_property
    def _systems(self) -> dict[bool, FilippovSystem]:
        """The system and its time reversal."""
        return {ahead: _bounded(self.scan, ahead) for ahead in (True, False)}

    def follow(
        self,
        start: Array,
        ahead: bool = True,
        cut: Cut | None = None,
        mode: str | None = None,
        landing: bool = False,
    ) -> Array:
        """Follow one orbit, a few steps at a time, until ``cut`` shortens it."""
        if not np.all(np.isfinite(start)) or self.scan.is_excluded(start[None, :])[0]:
            return np.empty((0, 2))
        curve, x, t, events = start[None, :], start, 0.0, list[Array]()
        for _ in range(_LONGEST // _CHUNK):
            part = simulate(
                self._systems[ahead],
                x,
                t_end=self.t_end,
                t_start=t,
                tol=_TOLERANCE,
                start_mode=mode,
                max_events=_EVENTS,
                max_steps=_CHUNK,
            )
            entry = next(
                (e for e in part.events if landing and e.kind in ("entry", "contact")), None
            )
            until = None if entry is None else (entry.t, entry.x)
            curve = np.vstack([curve, polyline(part, self.scan.box.size, until=until)[1:]])
            kept = curve if cut is None else cut(curve)
            events += [event.x for event in part.events[:-1]]
            done = part.status is not Status.TOO_MANY_STEPS or len(events) > _EVENTS
            done |= entry is not None
            if done or len(kept) < len(curve) or self._closed(events):
                return kept
            x, t, mode = part.x[-1], float(part.t[-1]), _mode_at_end(part)
        return curve

    def _closed(self, events: list[Array]) -> bool:
        """Whether the last event is at the state of an earlier one: a cycle, drawn once."""
        if len(events) < 3:
            return False
        gaps = (np.array(events[:-2]) - events[-1]) / self.scan.box.size
        return bool(np.min(np.linalg.norm(gaps, axis=1)) < _NEAR)

    def spaced(self, count: int = 12, avoid: Sequence[Array] = ()) -> Iterator[SpacedOrbit]:
        """Orbits in the direction of time, evenly spaced, up to sliding or rest; none starts beside ``avoid``."""
        follow = partial(self.follow, landing=True)
        return evenly_spaced(self.scan.box, count, follow, avoid=avoid, rests=self.rests)

    def separatrices(self) -> Iterator[tuple[str, Array]]:
        """Orbits through visible folds and manifolds of saddles and pseudo-saddles, with names."""
        for fold in self.scan.folds:
            if fold.kind == "visible":
                for ahead in (False, True):
                    yield "fold orbit", self._from(fold.point, ahead, fold.side)
        for found in self.scan.equilibria:
            if found.kind == "saddle":
                directions = self.scan.eigenvectors(found)
                for direction, ahead in zip(directions, (False, True), strict=True):
                    step = _NEAR * float(self.scan.box.size.min()) * direction
                    for start in (found.point + step, found.point - step):
                        yield "separatrix", self._from(start, ahead)
        for rest in self.scan.pseudo_equilibria:
            if rest.kind == "pseudo-saddle":
                ahead = rest.region is not Region.ATTRACTING
                for side in self.scan.sides:
                    yield "separatrix", self._from(rest.point, ahead, side)

    def _from(self, start: Array, ahead: bool, mode: str | None = None) -> Array:
        """An orbit up to its end, which may be a focus, in the direction of time."""
        if self.scan.where.one_sided:
            mode = "o" if ahead else None
        curve = self.follow(start, ahead, self._to_rest, mode=mode)
        return curve[:: 1 if ahead else -1]

    def _to_rest(self, curve: Array) -> Array:
        rested = until_rest(curve, self.rests, self.scan.box.size)
        return curve if rested is None else rested


def _mode_at_end(run: Trajectory) -> str | None:
    """Mode in which a run continues, where its last state is on the surface; else None."""
    mode, on_event = run.events[-1].mode_after, False
    if len(run.events) > 1:
        on_event = run.events[-2].t == run.t[-1]
    return mode if set("sc") & set(mode) or on_event else None


def _bounded(scan: PlaneScan, ahead: bool) -> FilippovSystem:
    """The system, or its time reversal, with stops a little outside the box, at events and at gaps."""
    where, box, direction = scan.where, scan.box, 1 if ahead else -1
    x, y = where.system.extended_states[0], where.system.extended_states[1]
    dx, dy = 0.03 * box.size
    walls = [x - (box.x0 - dx), (box.x1 + dx) - x, y - (box.y0 - dy), (box.y1 + dy) - y]
    stops = [Stop(wall, -1, f"wall {k}") for k, wall in enumerate(walls)]
    gaps = scan.whole.definition.gaps
    stops += [Stop(gaps[j], -1, f"gap {j}") for j in range(gaps.numel())]
    stops += [event.stop(ahead) for event in scan.events]
    sides = SIDES if where.mode else ("",)
    fields = [[direction * where.system.field(s)[k] for k in (0, 1)] for s in sides]
    law: dict[str, Any] = {"field": fields[0]}
    if where.one_sided and ahead:
        d = scan.whole.definition
        law = {
            "field": d.field,
            "complementarity": Complementarity(d.surfaces[0], d.multipliers[0]),
        }
    elif where.one_sided:
        stops.append(Stop(where.system.surface_function(), -1, "boundary"))
    elif where.mode:
        h = where.system.surface_function()
        law = {"surface": h, "above": fields[0], "below": fields[1]}
    symbols = [where.system.parameter_symbols[k] for k in range(len(where.parameters))]
    values = dict(zip(symbols, where.parameters.tolist(), strict=True))
    return FilippovSystem([x, y], **law, parameters=values, stops=stops)


def _duration(scan: PlaneScan) -> float:
    """Time in which a typical orbit passes the box several times."""
    points = scan.box.corner + np.random.default_rng(0).uniform(size=(400, 2)) * scan.box.size
    values = scan.at(points)
    fields = np.where(values.h[:, None] > 0, values.fields[:, 0], values.fields[:, 1])
    speed = np.linalg.norm(fields / scan.box.size, axis=1)
    speed = speed[np.isfinite(speed) & (speed > 0)]
    return _PASSES / float(np.quantile(speed, 0.25)) if speed.size else 1.0
