"""Guesses for homoclinic orbits: orbits of an unstable manifold that come back to the saddle."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...flow.simulate import simulate
from ...flow.trajectory import Trajectory
from ...local import Equilibrium, PseudoEquilibrium
from ...local.searches.equilibria import find_equilibrium, kind_of
from ...local.searches.pseudo_equilibria import find_pseudo_equilibrium
from ...model import (
    Array,
    DegenerateError,
    FilippovSystem,
    NonsmoothError,
    PointError,
    Surfaces,
    real_array,
)
from ..periodic.orbit import named
from ..runs.legs import Leg, Stretch, stretches
from .saddle_loops import NEAR, Spectrum, equilibrium_of, spectrum_of

#: A guess comes back to within this part of its size.
_CLOSE = 0.5

#: An orbit is followed until it should have been back, so many times; and with so many directions where
#: the unstable space has two dimensions.
_LONGER, _AROUND = (1.0, 3.0, 10.0), 64


#: An orbit that takes more steps has gone to infinity.
_STEPS = 4000

#: Exponent by which neighbours part over a part of a leg.
_GROWTH = 1.5


@dataclass(frozen=True, eq=False)
class Departure:
    """An orbit that leaves a saddle and comes back near to it.

    Attributes
    ----------
    saddle : ndarray (n,)
    legs : tuple of Leg
    starts, durations : ndarray (N, n), (N,)
    held : tuple of (float or None)
        Durations of parts of legs, see Loop.
    miss, size : float
        Distance from the saddle at its end, on the way back, and largest one before.
    """

    saddle: Array
    legs: tuple[Leg, ...]
    starts: Array
    durations: Array
    held: tuple[float | None, ...]
    miss: float
    size: float


def saddle_at(
    system: FilippovSystem, saddle: object, p: Array
) -> tuple[str, Equilibrium | PseudoEquilibrium]:
    """The saddle that is meant, and its mode."""
    found = list[tuple[str, Equilibrium | PseudoEquilibrium]]()
    if isinstance(saddle, (Equilibrium, PseudoEquilibrium)):
        near = np.asarray(saddle.point, float)
    else:
        near = real_array(saddle, "saddle")
        if near.shape != (system.dimension,):
            raise PointError(
                f"saddle: expected {system.dimension} numbers, received shape {near.shape}."
            )
    given, told = named(system, p), list[str]()
    if system.surface_count == 0:
        found.append(("", _smooth(system, equilibrium_of(system, "", near, p), p)))
    elif not isinstance(saddle, Equilibrium):
        try:
            pseudo = find_pseudo_equilibrium(system, near, parameters=given)
            found.append(("s", pseudo))
        except NonsmoothError as error:
            told.append(str(error))
    if system.surface_count == 1 and not isinstance(saddle, PseudoEquilibrium):
        for side in "+-":
            try:
                at_side = find_equilibrium(system, near, side=side, parameters=given)  # type: ignore[arg-type]
                found.append((side, at_side))
            except NonsmoothError as error:
                told.append(str(error))
    if not found:
        raise DegenerateError(
            f"saddle: expected an equilibrium, received none ({'; '.join(told)})."
        )
    mode, at = min(found, key=lambda pair: float(np.linalg.norm(pair[1].point - near)))
    if not _is_saddle(at):
        raise DegenerateError(
            f"saddle: expected a real saddle or pseudo-saddle, received: {at} Orbits leave it on no "
            "side or come back on none: choose another point or parameter."
        )
    return mode, at


def _is_saddle(at: Equilibrium | PseudoEquilibrium) -> bool:
    if at.status != "real":
        return False
    values = np.real(at.eigenvalues)
    if isinstance(at, PseudoEquilibrium) and at.kind == "pseudo-saddle" and values.size == 1:
        return True
    return bool(values.min() < 0.0 < values.max())


def _smooth(system: FilippovSystem, at: Array, p: Array) -> Equilibrium:
    values = spectrum_of(system, "", at, p).values
    order = np.argsort(values.real)
    kind, margin = kind_of(values[order], float(np.abs(values).max()))
    return Equilibrium(at, "+", "real", kind, values[order], np.inf, margin, 0.0, 0.0, 0, "")


def departures(system: FilippovSystem, mode: str, x: Array, p: Array) -> Iterator[Departure]:
    """Orbits of the unstable manifold that come back, the one that comes nearest first."""
    here = spectrum_of(system, mode, x, p)
    size = max(float(np.abs(here.point).max()), 1e-3)
    found = []
    for direction in _directions(here):
        start = here.point + NEAR * size * direction
        held = [k for k, c in enumerate(mode) if c == "s"]
        if held:
            start = Surfaces(system).project(start, p, held)
        back = _comes_back(system, mode, here, start, p)
        if back is not None:
            found.append(back)
    yield from sorted(found, key=lambda d: d.miss / d.size)


def _directions(here: Spectrum) -> list[Array]:
    basis = here.unstable
    if basis.shape[1] == 1:
        return [basis[:, 0], -basis[:, 0]]
    if basis.shape[1] == 2:
        angles = 2 * np.pi * np.arange(_AROUND) / _AROUND
        return [basis @ np.array([np.cos(a), np.sin(a)]) for a in angles]
    raise DegenerateError(
        f"saddle: expected an unstable manifold of one or two dimensions, received {basis.shape[1]}. "
        "Reverse the time: reversed_system(system) exchanges the two."
    )


def _comes_back(
    system: FilippovSystem, mode: str, here: Spectrum, start: Array, p: Array
) -> Departure | None:
    unit = -np.log(NEAR) * (1.0 / here.leading(False) - 1.0 / here.leading(True))
    for times in _LONGER:
        try:
            run = simulate(
                system,
                start,
                times * unit,
                parameters=named(system, p),
                start_mode=mode or None,
                tol=1e-12,
                max_events=500,
                max_steps=_STEPS,
            )
            found = _nearest(run, mode, here)
        except NonsmoothError:
            return None
        if found is not None:
            return found
    return None


def _nearest(run: Trajectory, mode: str, here: Spectrum) -> Departure | None:
    """The first return of a run to the neighbourhood of the saddle, in its mode."""
    parts = [part for part in stretches(run) if part.duration > 0.0]
    peak, chain = 0.0, list[Stretch]()
    for part in parts:
        chain.append(part)
        times = part.t + part.duration * np.linspace(0.0, 1.0, 201)[1:-1]
        with np.errstate(over="ignore"):
            away = np.linalg.norm(run(times) - here.point, axis=1)
        for k in range(1, len(times) - 1):
            peak = max(peak, float(away[k]))
            back = away[k] < _CLOSE * peak and away[k - 1] >= away[k] <= away[k + 1]
            if back and part.leg.mode == mode:
                first = int(np.argmax(away[:k]))
                wanted = np.sqrt(away[first] * away[k])  # still on its way: nearest it goes along
                k = first + int(np.argmin(np.abs(away[first : k + 1] - wanted)))
                chain[-1] = replace(part, leg=Leg(mode), duration=float(times[k]) - part.t)
                return _in_parts(run, chain, here, float(away[k]), peak)
    return None


def _in_parts(
    run: Trajectory, chain: list[Stretch], here: Spectrum, miss: float, size: float
) -> Departure:
    """Legs in parts over which neighbours part by no more than a factor."""
    growth, n = float(here.values.real.max()), run.system.dimension
    legs, starts, durations = list[Leg](), list[Array](), list[float]()
    held: list[float | None] = []
    for part in chain:
        count = max(1, round(part.duration * growth / _GROWTH))
        step = part.duration / count
        for k in range(count):
            legs.append(part.leg)
            starts.append(part.start[:n] if not k else run(part.t + k * step))
            durations.append(step)
            inside = step if part.leg.timed else 0.0
            held.append(inside if k + 1 < count else None)
    return Departure(
        here.point, tuple(legs), np.array(starts), np.array(durations), tuple(held), miss, size
    )
