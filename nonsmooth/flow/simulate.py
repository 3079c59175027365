"""The verb ``simulate``: from a start to an end, through every switch."""

from __future__ import annotations

import math

from numpy.typing import ArrayLike

from ..model import FilippovSystem, OptionError, Parameters
from .driver import Driver
from .options import Options
from .trajectory import Trajectory


def simulate(
    system: FilippovSystem,
    x0: ArrayLike,
    t_end: float,
    *,
    t_start: float = 0.0,
    parameters: Parameters | None = None,
    tol: float = 1e-10,
    rtol: float | None = None,
    atol: float | None = None,
    start_mode: str | None = None,
    max_step: float = math.inf,
    max_steps: int = 1_000_000,
    max_events: int = 100_000,
    engine: str = "auto",
) -> Trajectory:
    """Integrate a Filippov system through crossings, sliding, stops and resets.

    Parameters
    ----------
    system : FilippovSystem
    x0 : array_like (n,)
        Start; on a surface the mode follows from Filippov's convention.
    t_end : float
        Final time.
    t_start : float, optional
        Time of the start.
    parameters : mapping, optional
        Values that replace defaults; keys are names or symbols.
    tol : float, optional
        Relative and absolute tolerance of the local error and of events.
    rtol, atol : float, optional
        Set them apart.
    start_mode : str, optional
        One letter per surface: which continuation to take where more than one is possible.
    max_step, max_steps, max_events : optional
        Limits.
    engine : {"auto", "reference", "compiled"}
        Which driver runs.

    Returns
    -------
    Trajectory

    Raises
    ------
    PointError, ParameterError, OptionError, DefinitionError

    Notes
    -----
    Every run ends in a status: see :class:`Status`. Where the future is not unique the run stops
    with ``NON_UNIQUE`` and never guesses.

    Examples
    --------
    Dry friction brings an oscillator to rest at t = 4 pi:

    >>> import casadi as ca, nonsmooth as ns
    >>> y1, y2, lam = (ca.SX.sym(s) for s in ("y1", "y2", "lam"))
    >>> system = ns.FilippovSystem(
    ...     [y1, y2], field=[y2, -y1 - 0.4 * lam], multipliers=lam, surface=y2)
    >>> run = ns.simulate(system, [3.0, 0.0], t_end=20.0)
    >>> run.itinerary, bool(abs(run.x[-1, 0] + 0.2) < 1e-9)
    ('- + - + s', True)
    """
    options = Options(
        t_end=t_end,
        t_start=t_start,
        rtol=tol if rtol is None else rtol,
        atol=tol if atol is None else atol,
        max_step=max_step,
        max_steps=max_steps,
        max_events=max_events,
        start_mode=start_mode,
    )
    x = system.extended_point(x0, t_start)
    p = system.parameter_vector(parameters)
    if engine not in ("auto", "reference", "compiled"):
        raise OptionError(
            f"engine: expected 'auto', 'reference' or 'compiled', received {engine!r}."
        )
    return Driver(system, x, p, options).run()
