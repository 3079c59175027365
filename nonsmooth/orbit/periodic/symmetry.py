"""Symmetries of periodic orbits: multiplicity, half orbits, and a check that an orbit is symmetric.

The equations of a half are solved even if the system lacks the symmetry, so the other half is integrated
and compared.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
from numpy.typing import ArrayLike

from ...flow.fixed import flow_for
from ...flow.simulate import simulate
from ...model import Array, FilippovSystem, NonsmoothError, OptionError, Surfaces, explain
from ...model.checks import real_array
from ...model.derivatives.variational import plain_field, states_at
from ..runs.legs import Leg, integrate_leg, rate_at
from .boundary_value_problem import BoundaryProblem, mirrored
from .orbit import PeriodicOrbit

# Reduction to the prime period, and to half orbits.

#: Largest multiplicity that is tested for an orbit without events.
_MOST_MULTIPLICITY = 60

#: Halves of an orbit that are each other's image to this part of it are so at a branch point.
_MIRRORED = 1e-6

#: Up to so many states all reflections of coordinates are tried.
_MOST_STATES = 8

#: Starts of legs that are as near as this, relative to the orbit, are one.
_SAME = 1e-7

#: Multiple of the distance by which an orbit does not close below which its states are zero.
_OPEN = 10.0


def prime_period(problem: BoundaryProblem, u: Array, p: Array) -> tuple[BoundaryProblem, Array]:
    """Reduce an orbit that is traversed several times to its prime period."""
    # A half of a symmetric orbit has odd multiplicity.
    starts, durations = problem.split(u)
    count, n = len(problem.legs), problem.system.dimension
    if problem.legs[-1].timed:
        return _prime_period_of_leg(problem, starts[0], float(durations[0]), p)
    size = problem.scales(u)[:n] if count > 1 else np.ones(n)
    whole = float(np.abs(durations).sum()) or 1.0
    for k in range(1, count // 2 + 1):
        if count % k or (problem.symmetry is not None and count // k % 2 == 0):
            continue
        apart = starts[k : 2 * k, :n] @ problem.wrap[:n, :n].T - starts[:k, :n]
        later = np.abs(durations[k : 2 * k] - durations[:k]).max() / whole
        if not max(np.abs(apart / size).max(), later) < _SAME:
            continue
        legs = problem.legs[:k]
        following = legs if problem.symmetry is None else [mirrored(problem, leg) for leg in legs]
        if any(problem.legs[i] != (legs, following)[i // k % 2][i % k] for i in range(count)):
            continue
        # a part of a period where that was given as several
        once = replace(problem, legs=legs, periods=problem.periods * k / count)
        return once, once.pack(starts[:k], durations[:k])
    return problem, u


def _prime_period_of_leg(
    problem: BoundaryProblem, x: Array, duration: float, p: Array
) -> tuple[BoundaryProblem, Array]:
    """The same for an orbit without events."""
    n, half, leg = problem.system.dimension, problem.symmetry is not None, problem.legs[0]
    size = np.abs(x[:n]).max() or 1.0
    multiplicity = round(2 * problem.periods) if half else round(problem.periods)
    most = multiplicity if problem.forcing is not None else _MOST_MULTIPLICITY
    after = lambda t: problem.wrap[:n, :n] @ integrate_leg(problem.system, leg, x, t, p).end[:n]
    if size <= _OPEN * np.abs(after(duration) - x[:n]).max():  # rounding of zero, which repeats
        size = np.inf
    for k in range(most, 1, -1):
        if (half and k % 2 == 0) or (problem.forcing is not None and multiplicity % k):
            continue
        if np.abs(after(duration / k) - x[:n]).max() < _SAME * size:
            once = replace(problem, periods=problem.periods / k)
            return once, once.pack(x, np.array([duration / k]))
    return problem, problem.pack(x, np.array([duration]))


def halves(problem: BoundaryProblem, u: Array, p: Array) -> Iterator[tuple[BoundaryProblem, Array]]:
    """The same orbit as a half, for every reflection of coordinates that maps it to the other half."""
    # Whether the system has that symmetry is not checked.
    n, count = problem.system.dimension, len(problem.legs)
    single = problem.legs[-1].timed
    if problem.symmetry is not None or n > _MOST_STATES or (not single and count % 2):
        return
    starts, durations = problem.split(u)
    k = count if single else count // 2
    spans = durations / 2 if single else durations[:k]
    if single:
        other = integrate_leg(problem.system, problem.legs[0], starts[0], float(spans[0]), p).end[
            None, :
        ]
    else:
        other = starts[k:]
        if np.abs(durations[k:] - spans).max() > _MIRRORED * np.abs(durations).sum():
            return
    size = np.abs(starts[:, :n]).max() or 1.0
    close = _MIRRORED * size
    if (np.abs(np.abs(other[:, :n]) - np.abs(starts[:k, :n])) > close).any():
        return
    for signs in product((-1.0, 1.0), repeat=n):
        reflection = np.diag(signs)
        if (np.abs(other[:, :n] @ reflection - starts[:k, :n]) > close).any() or min(signs) > 0.0:
            continue
        half = replace(
            problem, legs=problem.legs[:k], symmetry=reflection, periods=problem.periods / 2
        )
        if not single and any(
            mirrored(half, leg) != then
            for leg, then in zip(half.legs, problem.legs[k:], strict=True)
        ):
            continue
        yield half, half.pack(starts[:k], spans)


#: Largest distance of the other half from the image of the first, relative to the orbit and its magnification.
_MISS = 1e-8


def symmetry_matrix(system: FilippovSystem, symmetry: ArrayLike | str | None) -> Array | None:
    """The matrix of a symmetry, (n, n); None for none."""
    n = system.dimension
    if symmetry is None:
        return None
    if isinstance(symmetry, str):
        if symmetry != "odd":
            raise OptionError(
                f"symmetry: expected 'odd' or a matrix ({n}, {n}), received {symmetry!r}."
            )
        return -np.eye(n)
    matrix = real_array(symmetry, "symmetry")
    squares = matrix.shape == (n, n) and bool(np.isfinite(matrix).all())
    if not squares or np.abs(matrix @ matrix - np.eye(n)).max() > 1e-9:
        raise OptionError(
            explain(
                "symmetry",
                expected=f"'odd' or a matrix ({n}, {n}) whose square is 1",
                received=f"{matrix.tolist()} of shape {matrix.shape}",
                advice="R maps half of the orbit to the other half.",
            )
        )
    return matrix


def require_symmetric(orbit: PeriodicOrbit) -> None:
    """Refuse an orbit whose other half is not the image under the symmetry of the half that was solved for."""
    if not orbit.symmetric:
        return
    surface = _surface_missed(orbit)
    if not surface and _fields_agree(orbit):
        return
    try:
        closed = any("c" in leg.mode for leg in orbit.legs)  # a run decides which contact
        closed |= bool(orbit.system.sets)
        miss, where = (0.0, "") if closed else _miss_of_legs(orbit)
        jumps = closed or any(leg.kind in ("reset", "impact") for leg in orbit.legs)
        if miss <= _MISS and jumps and not orbit.is_virtual:
            miss, where = _miss_of_run(orbit), "its end"
    except NonsmoothError as error:
        miss, where = np.inf, str(error)
    if miss <= _MISS and not surface:
        return
    received = f"one for which the other half of the orbit is off by {miss:.2g} of it ({where})"
    if surface:
        received = f"one for which events of the other half of the orbit are not on {surface} = 0"
    later = " half a forcing period later" if orbit.system.time_dependent else ""
    raise OptionError(
        explain(
            "symmetry",
            expected=f"a matrix that maps motions of the system to motions{later}",
            received=received,
            advice="Leave symmetry= out: the whole orbit is solved for then.",
        )
    )


def _surface_missed(orbit: PeriodicOrbit) -> str:
    """Name of a surface on which events of the other half should be and are not; empty for none."""
    system, p, entries = orbit.system, orbit.parameter_vector, orbit.system.entries
    surfaces = system.cached("surfaces of symmetric orbits", lambda: Surfaces(system))
    here, there = (np.sort(np.abs(surfaces.values(x, p)[0])) for x in _beside(orbit, 0))
    if (np.abs(here - there) <= 1e-10 * here).all():
        return ""  # far quicker than evaluating the events, which decide where units differ
    legs, count = orbit.legs, len(orbit.problem.legs)
    units = orbit.problem.scales(orbit.unknowns)[: system.dimension]
    for leg, after in pairwise([*legs[count - 1 :], legs[0]]):
        changed = [
            leg.mode[k] != after.mode[k] or after.mode[k] == "s" for k in range(len(entries))
        ]
        on = [i for own, members in zip(changed, entries, strict=True) if own for i in members]
        if not on or leg.kind in ("reset", "impact"):
            continue
        h, gradient = surfaces.values(system.extended_point(after.start, after.t), p)
        allowed = _MISS * np.abs(gradient[:, : units.size]) @ units
        for k in on:
            if not abs(h[k]) <= allowed[k]:
                return system.surface_names[k]
    return ""


def _beside(orbit: PeriodicOrbit, i: int) -> tuple[Array, Array]:
    """A point beside the start of a leg, and its image under the symmetry."""
    problem = orbit.problem
    sizes = problem.scales(orbit.unknowns)[: problem.dimension]
    x = orbit.evaluation.starts[i] + 0.1 * sizes * np.cos(1.0 + np.arange(sizes.size))
    image = problem.wrap @ x
    image[-1] += problem.advance(orbit.parameter_vector)[0]
    return x, image


def _fields_agree(orbit: PeriodicOrbit) -> bool:
    """Whether the fields of all modes are symmetric beside the orbit."""
    # That suffices without jumps and is far quicker than integration, which decides otherwise.
    problem, p, system = orbit.problem, orbit.parameter_vector, orbit.system
    legs, wrap, n = problem.legs, problem.wrap, system.dimension
    if system.impacts or system.resets or problem.symmetry is None:
        return False
    key = ("modes and their mirror images", problem.symmetry.tobytes(), legs)
    modes = system.cached(
        key, lambda: {leg.mode: (i, mirrored(problem, leg).mode) for i, leg in enumerate(legs)}
    )
    sizes = problem.scales(orbit.unknowns)[: problem.dimension]
    try:
        for mode, (i, other) in modes.items():
            x, image = _beside(orbit, i)
            here = rate_at(system, Leg(mode), x, p)[:n]
            there = rate_at(system, Leg(other), image, p)[:n]
            miss, rates = np.abs(there - wrap[:n, :n] @ here), np.abs(here) + np.abs(there)
            if not (miss <= 1e-10 * (rates + rates.max() * sizes[:n] / sizes[:n].max())).all():
                return False
    except NonsmoothError:
        return False
    return True


def _miss_of_legs(orbit: PeriodicOrbit) -> tuple[float, str]:
    """Distances of the ends of the mapped legs, integrated in their modes, from the images of the ends."""
    problem, at, p = orbit.problem, orbit.evaluation, orbit.parameter_vector
    system, n, count = orbit.system, orbit.system.dimension, len(problem.legs)
    units = problem.scales(orbit.unknowns)[:n]
    worst, where = 0.0, ""
    for i, leg in enumerate(orbit.legs[count:]):
        y = states_at(system, leg.mode, system.extended_point(leg.start, leg.t), p)
        end = flow_for(plain_field(system, leg.mode), y, p, leg.duration)[:n]
        flow = at.by_leg[i]
        grows = float(np.abs(flow.by_start[:n, :n] * (units / units[:, None])).max(initial=1.0))
        off = np.abs(end - problem.wrap[:n, :n] @ flow.end[:n]) / units
        miss = float(off.max()) / max(1.0, grows)
        if not miss <= worst:
            worst, where = miss, f"leg {count + i + 1}, in mode {leg.mode or 'o'}"
    return worst, where


def _miss_of_run(orbit: PeriodicOrbit) -> float:
    """Distance of the end of a run over half the period, from the middle of the first leg, from the image of its start."""
    system, problem, n = orbit.system, orbit.problem, orbit.system.dimension
    leg, half = orbit.legs[0], 0.5 * orbit.period
    begin = leg.t + 0.5 * leg.duration
    state = orbit.trajectory(begin)
    other = problem.wrap[:n, :n] @ state
    end, given = begin + 2.0 * half, orbit.parameters
    run = simulate(system, other, end, t_start=begin + half, parameters=given, tol=1e-12)
    units = problem.scales(orbit.unknowns)[:n]
    grows = max(1.0, float(np.abs(orbit.monodromy).max()))
    miss = float((np.abs(run.x[-1] - state) / units).max()) / grows
    return miss if run.t[-1] == end else np.inf
