"""Symmetries by which half of an orbit is solved for: what is accepted as one, and whether an orbit has it.

The equations of a half are solved whether or not the system has the symmetry, so the other half is flown.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from ..flow.fixed import flow_for
from ..flow.simulate import simulate
from ..model import Array, FilippovSystem, NonsmoothError, OptionError, Surfaces, explain
from ..model.checks import real_array
from ..model.variational import plain_field, variational_field
from .mirrors import mirrored
from .periodic import PeriodicOrbit

#: The other half may miss the mirror image of the first by this part of the orbit, and of what it magnifies.
_MISS = 1e-8


def mirror_of(system: FilippovSystem, symmetry: ArrayLike | str | None) -> Array | None:
    """The matrix of a symmetry, (n, n); None for none.

    Parameters
    ----------
    system : FilippovSystem
    symmetry : "odd" or array_like (n, n), optional

    Raises
    ------
    OptionError
        A matrix of a wrong shape, not finite, or whose square is not 1.
    """
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
    """Refuse an orbit whose other half is not the mirror image of the half that was solved for.

    Parameters
    ----------
    orbit : PeriodicOrbit
        One that is virtual is looked at in its modes alone, whatever the guards say.

    Raises
    ------
    OptionError
    """
    if not orbit.symmetric:
        return
    surface = _surface_missed(orbit)
    if not surface and _fields_agree(orbit):
        return
    try:
        closed = any("c" in leg.mode for leg in orbit.legs)  # which contact that is, a run says
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
    system, p, m = orbit.system, orbit.parameter_vector, orbit.system.surface_count
    surfaces = system.cached("surfaces of symmetric orbits", lambda: Surfaces(system))
    here, there = (np.sort(np.abs(surfaces.values(x, p)[0])) for x in _beside(orbit, 0))
    if (np.abs(here - there) <= 1e-10 * here).all():
        return ""  # far quicker than to look at the events, which decide where units differ
    legs, count = orbit.legs, len(orbit.problem.legs)
    units = orbit.problem.scales(orbit.unknowns)[: system.dimension]
    for leg, after in pairwise([*legs[count - 1 :], legs[0]]):
        on = [k for k in range(m) if leg.mode[k] != after.mode[k] or after.mode[k] == "s"]
        if not on or leg.kind in ("reset", "impact"):
            continue
        h, gradient = surfaces.values(system.extended_point(after.start, after.t), p)
        allowed = _MISS * np.abs(gradient[:, : units.size]) @ units
        for k in on:
            if not abs(h[k]) <= allowed[k]:
                return system.surface_names[k]
    return ""


def _beside(orbit: PeriodicOrbit, i: int) -> tuple[Array, Array]:
    """A point beside the start of a leg, and its mirror image."""
    problem = orbit.problem
    sizes = problem.scales(orbit.unknowns)[: problem.dimension]
    x = orbit.evaluation.starts[i] + 0.1 * sizes * np.cos(1.0 + np.arange(sizes.size))
    image = problem.wrap @ x
    image[-1] += problem.advance(orbit.parameter_vector)[0]
    return x, image


def _fields_agree(orbit: PeriodicOrbit) -> bool:
    """Whether the fields of all modes are those of their mirror images, beside the orbit.

    That is enough where nothing jumps, and far quicker than to fly; where they are not, flying decides.
    """
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
            one, two = variational_field(system, mode), variational_field(system, other)
            here = one.rate.copied(one.states_at(x, p), p)[0][:n, 0]
            there = two.rate.copied(two.states_at(image, p), p)[0][:n, 0]
            miss, rates = np.abs(there - wrap[:n, :n] @ here), np.abs(here) + np.abs(there)
            if not (miss <= 1e-10 * (rates + rates.max() * sizes[:n] / sizes[:n].max())).all():
                return False
    except NonsmoothError:
        return False
    return True


def _miss_of_legs(orbit: PeriodicOrbit) -> tuple[float, str]:
    """By how much the mirrored legs, flown in their modes, end beside the mirror images of the ends."""
    problem, at, p = orbit.problem, orbit.evaluation, orbit.parameter_vector
    system, n, count = orbit.system, orbit.system.dimension, len(problem.legs)
    units = problem.scales(orbit.unknowns)[:n]
    worst, where = 0.0, ""
    for i, leg in enumerate(orbit.legs[count:]):
        field = variational_field(system, leg.mode)
        start = system.extended_point(leg.start, leg.t)
        y = field.states_at(start, p)
        end = flow_for(plain_field(system, leg.mode), y, p, leg.duration)[:n]
        flown = at.flown[i]
        grows = float(np.abs(flown.by_start[:n, :n] * (units / units[:, None])).max(initial=1.0))
        off = np.abs(end - problem.wrap[:n, :n] @ flown.end[:n]) / units
        miss = float(off.max()) / max(1.0, grows)
        if not miss <= worst:
            worst, where = miss, f"leg {count + i + 1}, in mode {leg.mode or 'o'}"
    return worst, where


def _miss_of_run(orbit: PeriodicOrbit) -> float:
    """By how much a run over half the period, from the middle of the first leg, misses its mirror image."""
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
