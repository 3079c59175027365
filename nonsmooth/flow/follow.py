"""The smooth flow of one mode, forward or backward in time, with its event functions.

Used by manifolds and dividing surfaces. The mode never changes, so the backward flow is a smooth problem too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..model import (
    Array,
    FilippovSystem,
    Followed,
    OptionError,
    Parameters,
    coupled_of,
    followed,
    real,
    require_system,
    sliding_multipliers,
)
from . import messages
from .engine.arrays import Run, guard_of
from .engine.convert import message_of
from .engine.interpreter import interpreter_for
from .events import Event, Events, Segment, Segments
from .names import guard_name
from .options import Options
from .status import ADVICE, Status
from .trajectory import Steps, Trajectory


def follow(
    system: FilippovSystem,
    point: ArrayLike,
    t_end: float,
    *,
    mode: str,
    until: Sequence[Any] | Any = (),
    watch: Sequence[Any] | Any = (),
    t_start: float = 0.0,
    parameters: Parameters | None = None,
    tol: float = 1e-10,
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float = math.inf,
    max_steps: int = 1_000_000,
) -> Trajectory:
    """Follow the smooth flow of one mode from a point on or off the surface.

    Parameters
    ----------
    system : FilippovSystem
        With scalar multipliers.
    point : array_like (n,)
        Where the orbit starts.
    t_end : float
        Final time; before ``t_start`` the flow is followed backward.
    mode : str
        One letter per surface. With ``s`` the sliding field is followed on the level of h through
        the point.
    until : str, expression, or sequence of them, optional
        End at a zero of these: names of the mode's own event functions (``"h0"``,
        ``"lambda0 = 1"``, ``"lambda0 = -1"``, names of stops and resets) or expressions in states,
        parameters and time. A zero at the start is not counted.
    watch : expression or sequence of them, optional
        Further functions whose zeros are reported (named ``f0``, ``f1``, ...).
    t_start, parameters, tol, rtol, atol, max_step, max_steps : optional
        As in :func:`simulate`.

    Returns
    -------
    Trajectory
        ``events`` of kind ``zero`` for every zero of the mode's event functions and of the watched
        ones, ``stop`` for the one that ended it. The status is REACHED_END, STOPPED,
        STEP_TOO_SMALL, NOT_FINITE or TOO_MANY_STEPS.

    Raises
    ------
    DefinitionError
        ``system`` is none, or has vector multipliers; a ``mode`` that it does not have.
    PointError
        A point of a wrong shape or not finite.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        A tolerance, a limit or a time out of its range; an unknown name in ``until``.
    NotSmoothError
        A watched expression with a kink or a jump.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> system = ns.FilippovSystem([x, y], surface=y, above=[1, -x], below=[1, 1])
    >>> run = ns.flow.follow(system, [2.0, 0.0], -10.0, mode="+", until="h0")
    >>> run.status.name, run.x[-1].round(12) + 0.0
    ('STOPPED', array([-2.,  0.]))
    """
    require_system(system, complementarity=True)
    t_start, t_end = real(t_start, "t_start"), real(t_end, "t_end")
    backward = t_end < t_start
    ends = {"t_end": -t_end, "t_start": -t_start} if backward else {}
    options = Options.of(locals() | ends)
    system.parse_mode(mode)
    untils, further = _several(until), _several(watch)
    expressions = [u for u in untils if not isinstance(u, str)]
    p = system.parameter_vector(parameters)
    made = followed(system, mode, expressions + further, backward)
    names = [guard_name(system, g) for g in made.guards]
    ending = {f"f{k}" for k in range(len(expressions))}
    for name in (u for u in untils if isinstance(u, str)):
        if name not in names:
            raise OptionError(
                f"until has {name!r}, which is no event function. Give a name among {names} or an "
                "expression."
            )
        ending.add(name)
    options = replace(options, passed=tuple(names[k] not in ending for k in made.stops))
    x = system.extended_point(point, t_start)
    unknowns = sliding_multipliers(coupled_of(system), mode, x, p, stable_only=False)
    if made.unknowns and len(unknowns) != 1:
        said = _said("start_solutions", start_mode=mode, where=len(unknowns))
        t, x = np.array([t_start]), x[None, : system.dimension]
        return _finished(system, mode, p, t, x, [], Status.NON_UNIQUE, said, Steps())
    start = x[: system.dimension]
    if made.unknowns:
        start = np.concatenate([start, unknowns[0][list(made.unknowns)]])
    engine = interpreter_for(made.system, options)
    run = engine.run(made.system.extended_point(start, options.t_start), p, options)
    return _trajectory(system, mode, p, made, names, backward, options, run)


def _several(value: Any) -> list[Any]:
    return list(value) if isinstance(value, (list, tuple)) else [value]


def _said(reason: str, **fields: Any) -> str:
    return messages.SENTENCES[reason].format(**fields)


def _finished(
    system: FilippovSystem,
    mode: str,
    p: Array,
    t: Array,
    x: Array,
    events: list[Event],
    status: Status,
    message: str,
    steps: Steps,
) -> Trajectory:
    """A run in one mode, with its events, of which the last is its end or a stop."""
    end = float(t[-1])
    if status is not Status.STOPPED:
        events = [*events, Event("end", end, x[-1].copy(), mode, mode, str(status))]
    return Trajectory(
        system=system,
        parameters=dict(zip(system.parameter_names, p.tolist(), strict=True)),
        t=t,
        x=x,
        events=Events.of(events),
        segments=Segments.of([Segment(mode, float(t[0]), end, 0, len(steps))]),
        status=status,
        message=f"{message} {ADVICE[status]}",
        steps=steps,
    )


def _trajectory(
    system: FilippovSystem,
    mode: str,
    p: Array,
    made: Followed,
    names: Sequence[str],
    backward: bool,
    options: Options,
    run: Run,
) -> Trajectory:
    """A run of a mode's flow, as one of the system."""
    n, sign = system.dimension, -1.0 if backward else 1.0
    t, status = sign * run.t, Status(run.status)
    rows = [*range(n), *([made.system.dimension] if system.time_dependent else [])]
    flips = sign ** np.arange(run.coefficients.shape[2])
    coefficients = run.coefficients[:, rows] * flips
    coefficients[:, n:] *= sign  # the time of the flow is -t
    events = list[Event]()
    happened = run.each()
    for k, (code, time, state) in enumerate(happened):
        at = made.stops[guard_of(made.system, code).index]
        guard, last = made.guards[at], status is Status.STOPPED and k == len(happened) - 1
        kind, x = "stop" if last else "zero", state[:n].copy()
        of = (guard.element, guard.side)
        events.append(Event(kind, sign * time, x, mode, mode, names[at], x, *of))
    end = float(t[-1])
    if status is Status.REACHED_END:
        message = _said("REACHED_END", t_end=end)
    elif status is Status.STOPPED:
        message = _said("STOPPED", stop=events[-1].name, t=end)
    elif status is Status.NOT_FINITE:
        message = _said("field", mode=mode, state=messages.listed(run.x[-1, :n].tolist()))
    else:
        message = message_of(made.system, options, replace(run, t=t))
    steps = Steps(sign * run.starts, coefficients, run.implicit)
    return _finished(system, mode, p, t, run.x[:, :n].copy(), events, status, message, steps)
