"""Reading ``t_eval=`` and ``at=``: which states of a run, or of many, are kept."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..model import (
    Array,
    FilippovSystem,
    OptionError,
    PointError,
    explain,
    is_function,
    is_real,
    periods,
    read_period,
    real_array,
    surface_of,
    with_section,
)
from .constants import AT_END
from .options import Options
from .section import KINDS_OF_SECTIONS, Hits, Section, Times
from .trajectory import Trajectory


@dataclass(frozen=True)
class View:
    """What of a run is looked at."""

    options: Options
    times: Times | None = None
    room: int | None = None


def read_view(
    system: FilippovSystem, t_eval: ArrayLike | None, at: Any, options: Options, p: Array
) -> View:
    """Read what a user asked for, with the parameters (np,) or (m, np) of all runs."""
    if t_eval is not None and at is not None:
        raise OptionError("t_eval, at: expected one of them, received both. Run twice.")
    if t_eval is not None:
        given = _given(t_eval, options.t_start, options.t_end)
        return View(options, given, len(given.given))
    if at is None:
        return View(options)
    section = at if isinstance(at, Section) else Section(at)
    if isinstance(section.at, str):
        hits = _hits(system, section, options.t_start)
        return View(replace(options, hits=hits), None, hits.count)
    times = _strobe(section, _period(system, section), options, p)
    return View(options, times, times.count)


def sectioned(system: FilippovSystem, at: Any) -> tuple[FilippovSystem, Any]:
    """Give the system the section ``at`` if it is a function of the states, and call it by its
    name."""
    section = at if isinstance(at, Section) else None if at is None else Section(at)
    if section is None or isinstance(section.at, str) or is_real(section.at):
        return system, at
    if not is_function(section.at) or read_period(system, section.at) is not None:
        return system, at
    surface = surface_of(system, section.at)
    if surface is not None:  # the motion may slide there, and stay on it
        name, sign = surface
        return system, replace(section, at=name, direction=sign * section.direction)
    wider = with_section(system, section.at, section.direction)
    return wider, replace(section, at=wider.resets[-1][0], direction=0)


def _period(system: FilippovSystem, section: Section) -> float | str:
    period = read_period(system, section.at)
    if period is None:
        raise OptionError(
            explain(
                "at",
                expected="a Section, a name, a kind of event, a period or an expression",
                received=f"{section.at!r} ({type(section.at).__name__})",
                advice='For example at="h0", or at=nonsmooth.Section("h0", direction=1).',
            )
        )
    if section.direction or section.after:
        raise OptionError(
            "at: expected direction= and after= with a surface, reset or impact only, received one "
            "with a period. Times have no direction."
        )
    return period


def _hits(system: FilippovSystem, section: Section, t_start: float) -> Hits:
    """Events of a name, or of a kind where nothing has the name."""
    name, letter = str(section.at), None
    surfaces = list(dict.fromkeys(system.surface_names))
    items = {
        "stop": [n for n, _ in system.stops],
        "reset": [n for n, _ in system.resets],
        "impact": list(system.impacts),
    }
    given = dict(system.definition.renamed)
    called = {
        kind: [n for n in names if name in (n, given.get(n))] for kind, names in items.items()
    }
    owners = tuple(kind for kind, names in called.items() if names and name not in surfaces)
    kinds: tuple[str, ...] = owners or (name,)
    names = tuple(n for kind in owners for n in called[kind]) or None
    if name in surfaces:
        kinds, names = KINDS_OF_SECTIONS, (name,)
        if section.direction:
            letter = _side_before(system, name, section.direction)
    elif section.direction and (owners or name in KINDS_OF_SECTIONS):
        raise OptionError(
            f"direction: expected 0 for {name!r}, received {section.direction}. Only surfaces are "
            "chosen by direction here; give a stop or a reset its own."
        )
    elif not owners and name not in KINDS_OF_SECTIONS:
        known = [*surfaces, *items["stop"], *items["reset"], *items["impact"]]
        raise OptionError(
            explain(
                "at",
                expected=f"a name of {known} or a kind of {list(KINDS_OF_SECTIONS)}",
                received=repr(name),
                advice="A section that is none of them is an expression in states, at=x - 1.",
            )
        )
    rest = section.every, section.skip, section.count, section.after
    return Hits(kinds, names, letter, *rest, begin=t_start + AT_END * max(1.0, abs(t_start)))


def _side_before(system: FilippovSystem, name: str, direction: int) -> tuple[int, str]:
    """Number of a surface in modes, and its letter before it is crossed in a direction."""
    surface = list(dict.fromkeys(system.surface_names)).index(name)
    if len(system.entries[surface]) > 1:
        raise OptionError(
            f"direction: expected 0 for {name!r}, received {direction}. It is a set, which is reached "
            'from all sides; kinds of events tell them apart, at="entry" and at="exit".'
        )
    return surface, "+" if direction < 0 else "-"


def _given(t_eval: ArrayLike, t_start: float, t_end: float) -> Times:
    try:
        times = real_array(t_eval, "t_eval")
    except PointError as error:
        raise OptionError(
            f"t_eval: expected an array of times, received {t_eval!r}. For example "
            "t_eval=numpy.linspace(t_start, t_end, 101)."
        ) from error
    wrong = None
    if times.ndim != 1 or not times.size:
        wrong = f"shape {times.shape}"
    elif not np.all(np.isfinite(times)):
        wrong = "some that are not finite"
    elif np.any(np.diff(times) < 0.0):
        wrong = "times that go back"
    elif times[0] < t_start or times[-1] > t_end:
        wrong = f"times from {times[0]} to {times[-1]}"
    if wrong:
        raise OptionError(
            f"t_eval: expected times in a row (K,), sorted, from t_start = {t_start} to "
            f"t_end = {t_end}, received {wrong}."
        )
    return Times(given=tuple(times.tolist()))


def _strobe(section: Section, period: float | str, options: Options, p: Array) -> Times:
    """Multiples of a period from t_start to t_end, as many as the shortest has."""
    shortest = float(np.fmin.reduce(periods(period, p), axis=None, initial=math.inf))
    fit = (options.t_end - options.t_start) / shortest * (1 + 4 * np.finfo(float).eps)
    count = int((math.floor(fit) - section.skip) // section.every)
    if section.count is not None:
        count = min(count, section.count)
    if count < 1:
        raise OptionError(
            f"at: expected a run of at least {section.skip + section.every} periods, received "
            f"{fit:.6g} of the length {shortest:.6g}. Raise t_end, or lower skip and every."
        )
    return Times((), period, options.t_start, section.every, section.skip, count)


def sampled(run: Trajectory, times: Array) -> tuple[Array, Array]:
    """Return times (K,) and states (K, n) of a run; NaN beyond its end."""
    t, x = np.full(times.shape, np.nan), np.full((times.size, run.x.shape[1]), np.nan)
    last = float(run.t[-1])
    within, ends = times < last, times == last
    t[within | ends] = times[within | ends]
    x[within] = run(times[within])
    x[ends] = run.x[-1]
    return t, x
