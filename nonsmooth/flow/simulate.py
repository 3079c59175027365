"""Integration of one trajectory through crossings, sliding, stops and resets."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from ..model import Array, FilippovSystem, OptionError, Parameters, require_system
from .engine.convert import trajectory
from .engine.interpreter import interpreter_for
from .ensembles.starts import require_start, require_start_mode
from .events import Event
from .options import Options
from .other_names import hinted
from .section import Section, read_sampling, sampled, sectioned
from .trajectory import Trajectory


@hinted
def simulate(
    system: FilippovSystem,
    x0: ArrayLike | None = None,
    t_end: float | None = None,
    *,
    start: Trajectory | Event | None = None,
    t_start: float = 0.0,
    parameters: Parameters | None = None,
    tol: float = 1e-10,
    rtol: float | None = None,
    atol: float | None = None,
    start_mode: str | None = None,
    max_step: float = math.inf,
    max_steps: int = 1_000_000,
    max_events: int = 100_000,
    max_jumps: int = 1_000,
    rest_below: float | None = None,
    t_eval: ArrayLike | None = None,
    at: Any = None,
    dense: bool = True,
    method: str = "auto",
) -> Trajectory:
    """Integrate a Filippov system through crossings, sliding, stops and resets.

    Parameters
    ----------
    system : FilippovSystem
        With one surface, several, sets of higher codimension, or none.
    x0 : array_like (n,)
        Start; on a surface the mode follows from Filippov's convention.
    t_end : float
        Time at which the run ends, not before ``t_start``.
    start : Trajectory or Event, optional
        Run or event to continue, in place of ``x0`` and ``t_start``. The result is that of one unbroken run,
        also where ``max_events`` ended the run between two jumps of one instant. The parameters are those of the
        run.
    t_start : float, optional
        Time of the start.
    parameters : mapping, optional
        Values that replace defaults; keys are names or symbols.
    tol : float, optional
        Relative and absolute tolerance of the local error and of events.
    rtol, atol : float, optional
        Relative and absolute tolerance apart, in place of ``tol``.
    start_mode : str, optional
        One letter per surface: which continuation to take where more than one is possible.
    max_step : float, optional
        Longest step. A step is accepted only where field and guards agree with its polynomials at its
        end and inside; a pulse that is thinner than the spacing of these points, a hundredth of the
        time that a step may bridge, can still be missed. A ``max_step`` of its width excludes that.
    max_steps, max_events, max_jumps : optional
        Limits of the run; of the jumps at one instant, beyond which it ends with ``ENDLESS_JUMPS``.
    rest_below : float, optional
        Speed below which a surface comes to rest if its multiplier first enters the second derivative of its
        function (a relay in a position, a rocking body). The run continues at rest once the rate at two zeros
        in turn is below this speed and falls, with an event of the kind ``"rest_below"`` and an error of the order
        of this speed. Without it a motion that switches infinitely often ends with TOO_MANY_EVENTS.
    t_eval : array_like (K,), optional
        Keep the states at these times, sorted, in ``sample_t`` and ``sample_x`` of the result.
    at : Section, str, number or expression, optional
        Keep the states at a section: at a surface, stop, reset or impact of that name, at a kind of
        event, or after each period. See :class:`Section`.
    method : {"auto", "taylor", "stiff"}, optional
        Steps: explicit Taylor steps; implicit ones (collocation at Radau points, of order 9, or 13 for ``rtol`` below
        3e-9) where a decay rate is much faster than the motion; or, by default, what costs less, mode by mode. Of
        systems with a vector multiplier all steps are explicit. ``run.steps.implicit`` says which steps are.
    dense : bool, optional
        Keep the polynomials of the steps, so that the result can be read at any time. ``False`` keeps points,
        events, segments and samples, which need an eighth of the memory or less. Such a run can be continued
        from its end, but not from its other events if the system has stops, resets or impacts.

    Returns
    -------
    Trajectory
        The run: its states at any time, its events, and how it ended.

    Raises
    ------
    DefinitionError
        ``system`` is none; a ``start_mode`` that it does not have.
    PointError
        A start of a wrong shape or not finite.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        A tolerance, a limit, a time or a section out of its range; a ``start_mode`` that
        contradicts the side on which the run starts.
    CompilerError
        The driver in C is not compiled, and there is no C compiler.

    Notes
    -----
    Every run ends in a status: see :class:`Status`. Where the solution is not unique the run stops
    with ``NON_UNIQUE`` and never guesses.

    Examples
    --------
    Dry friction brings an oscillator to rest at $t = 4 pi$:

    >>> import casadi as ca, nonsmooth as ns
    >>> y1, y2, lam = (ca.SX.sym(s) for s in ("y1", "y2", "lam"))
    >>> system = ns.FilippovSystem(
    ...     [y1, y2], field=[y2, -y1 - 0.4 * lam], multipliers=lam, surface=y2)
    >>> run = ns.simulate(system, [3.0, 0.0], t_end=20.0)
    >>> run.itinerary, bool(abs(run.x[-1, 0] + 0.2) < 1e-9)
    ('- + - + s', True)
    """
    require_system(system, sets=True, hysteresis=True, complementarity=True, joints=True)
    x0, t_start, parameters = _begun(start, x0, t_start, parameters)
    if t_end is None:
        raise OptionError("t_end is missing. Give the time at which the run ends.")
    _require_flag(dense)
    options = Options.of(locals())
    system, at = sectioned(system, at)
    x = system.extended_point(x0, options.t_start)
    p = system.parameter_vector(parameters)
    motion = mode = None
    if start is None:
        require_start(system, x, p)
    else:
        last = start.events[-1] if isinstance(start, Trajectory) else start
        motion, mode = last.motion, last.mode_after if system.remembering else None
    require_start_mode(system, x, p, options)
    sampling = read_sampling(system, t_eval, at, options.t_start, options.t_end, p)
    times = sampling.times
    if sampling.hits is not None:
        options = replace(options, hits=sampling.hits)
    if isinstance(at, Section) and at.count is not None and times is not None:
        options = replace(options, t_end=float(times.of(p)[-1]))
    read_at = None if times is None else times.of(p)
    run = interpreter_for(system, options).run(x, p, options, read_at, motion, mode, dense)
    return _with_samples(trajectory(system, p, options, run), options, read_at, run.sample_x)


def _require_flag(dense: object) -> None:
    if not isinstance(dense, bool):
        raise OptionError(f"dense is {dense!r}. Give True or False.")


def _with_samples(
    made: Trajectory, options: Options, read_at: Array | None, read: Array
) -> Trajectory:
    """Add the samples to a run; ``read`` are those at times if it is not dense."""
    if read_at is not None:
        t, states = sampled(made, read_at, None if made.dense else read)
    elif options.hits is not None:
        t, states = options.hits.samples(made.events)
    else:
        return made
    at_events = read_at is None
    return replace(made, sample_t=t, sample_x=states, sampled_events=at_events)


def _begun(
    start: Trajectory | Event | None, x0: Any, t_start: float, parameters: Any
) -> tuple[Any, float, Any]:
    """State, time and parameters at the start, or where a run or event is continued."""
    if start is None:
        if x0 is None:
            raise OptionError(
                "x0 is missing. Give a start, or start= with a run or event to continue."
            )
        return x0, t_start, parameters
    if not isinstance(start, (Trajectory, Event)):
        raise OptionError(
            f"start is {start!r}. Give a run of nonsmooth.simulate or one of its events."
        )
    if x0 is not None or t_start != 0.0:
        raise OptionError("start= has a state and a time. Leave out x0 and t_start.")
    if isinstance(start, Event) and start.motion is not None and not len(start.motion):
        raise OptionError(
            "start is an event within a run with dense=False, which keeps what a restart needs at its end "
            "only. Continue from the run, or simulate it with dense=True."
        )
    if isinstance(start, Event):
        return start.x_after, start.t, parameters
    return start.x[-1], float(start.t[-1]), start.parameters if parameters is None else parameters
