"""Derivatives of the end of a run, gradients of a cost and vector-Jacobian products."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...flow.status import Status
from ...flow.trajectory import Trajectory
from ...model import (
    Array,
    DegenerateError,
    FilippovSystem,
    OptionError,
    ParameterError,
    PointError,
    read_function,
    real_array,
    require_system,
)
from ...model.derivatives.event_maps import EventMap, function_map
from .variation import Passage, Sensitivity, along, discrete_places, passages


def sensitivity(run: Trajectory, *, wrt: str | Sequence[str] = ("x0", "parameters")) -> Sensitivity:
    """Derivatives of the end of a run, and of its event times, by start and parameters.

    They are exact: state-transition matrices of the legs, integrated beside them to rounding, and
    saltation matrices at the events. They hold for the run's own itinerary; ``clearance`` says how
    far it is from another one.

    Parameters
    ----------
    run : Trajectory
        Of ``simulate``. The derivatives are as accurate as the run; take ``tol`` accordingly.
    wrt : str or sequence of str, optional
        Names of parameters; ``"parameters"`` stands for all of them, ``"x0"`` for the start, which
        is always included.

    Returns
    -------
    Sensitivity
        Derivatives of the end of the run by its start and its parameters.

    Raises
    ------
    DegenerateError
        An event that is grazed, two independent events at one instant, events that accumulate, a derivative that
        is not finite at the zero of a root, a status without an end.
    ParameterError
        An unknown name in ``wrt``.
    OptionError
        No run of :func:`simulate`, or one without a step.

    Notes
    -----
    A run that starts on a sliding surface has the derivatives of the sliding field: they hold along the
    surface, not for starts off it; of a run that starts at rest, for starts that rest too. Where a reset happens exactly at the end of the run, they hold for
    neighbours that have jumped.

    Aizerman & Gantmakher 1958; Leine & Nijmeijer 2004, ch. 7.

    Examples
    --------
    A mass dropped from the height y meets the floor at $t = sqrt(y)$ with $v = -2 sqrt(y)$:

    >>> import casadi as ca, nonsmooth as ns
    >>> y, v, r = (ca.SX.sym(s) for s in "yvr")
    >>> mass = ns.FilippovSystem(
    ...     [y, v], field=[v, -2.0], resets=ns.Reset(y, [y, -r * v], -1), parameters={r: 0.5})
    >>> run = ns.simulate(mass, [0.25, 0.0], t_end=0.75)
    >>> s = ns.sensitivity(run)
    >>> s.dx_dx0.round(12), s.dx_dp.round(12), s.event_times.round(12), s.dt_dx0.round(12)
    (array([[0.25, 0.  ],
           [3.  , 1.  ]]), array([[0.25],
           [1.  ]]), array([0.5]), array([[1. , 0.5]]))
    """
    require_system(_require_run(run).system, sets=True, complementarity=True, joints=True)
    _, result = along(run, _names(run, wrt))
    return result


@dataclass(frozen=True, eq=False, repr=False)
class Gradient:
    """Gradient of a cost at the end of a run.

    Attributes
    ----------
    value : float
        Of the cost.
    x0 : ndarray (n,)
        Derivatives by the start.
    parameters : dict of str to float
        Derivatives by the parameters.
    """

    value: float
    x0: Array
    parameters: dict[str, float]

    def __repr__(self) -> str:
        of = ", ".join(f"{k}: {v:.6g}" for k, v in self.parameters.items())
        return f"Gradient(value {self.value:.6g}, x0 {self.x0.tolist()}, parameters {{{of}}})"


def gradient(
    run: Trajectory, cost: Any, *, wrt: str | Sequence[str] = ("x0", "parameters")
) -> Gradient:
    """Gradient of a cost at the end of a run, by the exact discrete adjoint.

    Parameters
    ----------
    run : Trajectory
        The run, from :func:`nonsmooth.simulate`.
    cost : expression
        Of the states at the end, parameters and time. An integral is a further state.
    wrt : str or sequence of str, optional
        As in :func:`sensitivity`.

    Returns
    -------
    Gradient
        Derivatives along directions that an entry to sliding loses are zero, which is correct.

    Raises
    ------
    DegenerateError
        As :func:`sensitivity`; a cost that is not finite at the end, or has no finite derivatives.
    DefinitionError, NotSmoothError
        A cost with foreign symbols, or with a kink or a jump.
    OptionError
        As :func:`sensitivity`.
    ParameterError
        An unknown name in ``wrt``.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> y, v, r = (ca.SX.sym(s) for s in "yvr")
    >>> mass = ns.FilippovSystem(
    ...     [y, v], field=[v, -2.0], resets=ns.Reset(y, [y, -r * v], -1), parameters={r: 0.5})
    >>> run = ns.simulate(mass, [0.25, 0.0], t_end=0.75)
    >>> ns.gradient(run, y**2 + v)
    Gradient(value 0.00390625, x0 [3.03125, 1.0], parameters {r: 1.03125})
    """
    system, n = _require_run(run).system, run.system.dimension
    names = _names(run, wrt)
    chosen = tuple(system.parameter_names.index(name) for name in names)
    parts = passages(run, chosen)
    p = system.parameter_vector(run.parameters)
    last = parts[-1]
    at = _cost(system, last.stretch.leg.mode, cost)(last.flow.end, p)
    row, by_parameters = _pulled(system, parts, at.gradient, chosen, stopped=_stopped(last))
    by_parameters = by_parameters + at.by_parameters[list(chosen)]
    numbers = dict(zip(names, by_parameters.tolist(), strict=True))
    return _finite(Gradient(at.value, row[:n] + 0.0, numbers), run)


def _finite(found: Gradient, run: Trajectory) -> Gradient:
    """Raise for a cost that is not finite at the end of a run, or has no finite derivatives."""
    if np.isfinite([found.value, *found.x0, *found.parameters.values()]).all():
        return found
    raise DegenerateError(
        f"cost is not finite, or has derivatives that are not, at the end {run.x[-1].tolist()} of the run: "
        f"{found!r}. Check logarithms, roots and divisions there."
    )


def _cost(system: FilippovSystem, mode: str, cost: Any) -> EventMap:
    """A cost as a function of the last leg's states, cached for the same expression object."""
    known = getattr(cost, "element_hash", None)
    if known is None or cost.numel() != 1:
        return function_map(system, mode, read_function(system.definition, cost, "cost"))

    def build() -> tuple[Any, EventMap]:
        # the expression is kept, so that its hash is not used again
        return cost, function_map(system, mode, read_function(system.definition, cost, "cost"))

    return system.cached(("cost", mode, known()), build)[1]


def vjp(
    run: Trajectory, cotangent: ArrayLike, *, wrt: str | Sequence[str] = ("x0", "parameters")
) -> tuple[Array, Array]:
    """Product of a row with the derivatives of the end of a run, by the discrete adjoint.

    Parameters
    ----------
    run : Trajectory
        The run, from :func:`nonsmooth.simulate`.
    cotangent : array_like (n,)
        Derivatives of something by the final state.
    wrt : str or sequence of str, optional
        As in :func:`sensitivity`.

    Returns
    -------
    by_start, by_parameters : ndarray (n,), (q,)
        In the order of ``wrt``.

    Raises
    ------
    PointError
        Cotangents of a wrong shape; otherwise as :func:`sensitivity`.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, a = ca.SX.sym("x"), ca.SX.sym("a")
    >>> run = ns.simulate(ns.FilippovSystem([x], field=[a], parameters={a: 2.0}), [0.0], t_end=3.0)
    >>> ns.vjp(run, [1.0])
    (array([1.]), array([3.]))
    """
    system, n = _require_run(run).system, run.system.dimension
    row = real_array(cotangent, "cotangent")
    if row.shape != (n,) or not np.all(np.isfinite(row)):
        shown = f"has shape {row.shape}" if row.shape != (n,) else f"is {row.tolist()}"
        raise PointError(
            f"cotangent {shown}, but the system has {n} states. Give one finite number for each."
        )
    chosen = tuple(system.parameter_names.index(name) for name in _names(run, wrt))
    parts = passages(run, chosen)
    whole = np.zeros(len(parts[-1].flow.end))
    whole[:n] = row
    back, by_parameters = _pulled(system, parts, whole, chosen, stopped=_stopped(parts[-1]))
    return back[:n], by_parameters


def _stopped(last: Passage) -> bool:
    return last.stretch.leg.kind == "stop"


def _pulled(
    system: FilippovSystem,
    parts: Sequence[Passage],
    row: Array,
    chosen: Sequence[int],
    stopped: bool,
) -> tuple[Array, Array]:
    """Pull a row at the end of the flow of the last leg back to the start."""
    by_parameters = np.zeros(len(chosen))
    last, event = parts[-1].flow, parts[-1].event
    if stopped and event is not None:
        along_flow = float(row @ last.rate)
        by_parameters = by_parameters + along_flow * event.time_by_parameters[list(chosen)]
        row = row + along_flow * event.time_by_state
    elif event is not None:
        by_parameters = (
            by_parameters + row[: len(event.matrix)] @ event.by_parameters[:, list(chosen)]
        )
        row = row[: len(event.matrix)] @ event.matrix
    by_parameters = by_parameters + row @ last.by_parameters
    row = row @ last.by_start
    for part in reversed(parts[:-1]):
        row, more = part.backward(row, chosen)
        by_parameters = by_parameters + more
    row[discrete_places(system)] = 0.0
    return row, by_parameters


def _require_run(run: Trajectory) -> Trajectory:
    if not isinstance(run, Trajectory):
        raise OptionError(f"run={run!r} is no Trajectory. Give the result of ns.simulate.")
    run.require_dense("its sensitivity")
    if not len(run.steps):
        raise OptionError(f"run has no step ({run.message}) Give a start from which it moves.")
    if run.status not in (Status.REACHED_END, Status.STOPPED):
        raise DegenerateError(
            f"run ended with {run.status} at t = {run.t[-1]:.6g}, where its end is not a smooth function of "
            f"its start: {run.message} End it earlier."
        )
    return run


def _names(run: Trajectory, wrt: str | Sequence[str]) -> tuple[str, ...]:
    known, names = run.system.parameter_names, list[str]()
    for name in [wrt] if isinstance(wrt, str) or not isinstance(wrt, Iterable) else list(wrt):
        if name == "parameters":
            names += [n for n in known if n not in names]
        elif name in known:
            names.append(name)
        elif name != "x0":
            raise ParameterError(
                f"wrt: {name!r} is unknown. Give 'x0', 'parameters' or names among {list(known)}."
            )
    return tuple(dict.fromkeys(names))
