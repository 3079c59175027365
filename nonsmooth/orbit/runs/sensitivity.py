"""Derivatives of the end of a run, gradients of a cost and vector-Jacobian products."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...flow.status import Status
from ...flow.trajectory import Trajectory
from ...model import (
    Array,
    ConvergenceError,
    DegenerateError,
    OptionError,
    ParameterError,
    PointError,
    real_array,
    require_system,
)
from ...model.derivatives.given_functions import cost_over
from ...result_tables import Tabular
from .legs import parameters_of
from .one_sided import Side, one_sided
from .variation import (
    Passage,
    Sensitivity,
    along,
    discrete_indices,
    numbers_of,
    passages,
    sample_times,
)


def sensitivity(
    run: Trajectory,
    *,
    wrt: str | Sequence[str] = ("x0", "parameters"),
    side: Side | None = None,
) -> Sensitivity:
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
    side : array_like (n,) or mapping, optional
        Direction of the start, or of ``"x0"`` and parameters by name, for one-sided derivatives: of the neighbours in that
        direction. At a corner, a grazing or an event at the very end, others have other derivatives. Without ``side``
        those of corners and grazings are refused, and those of an event at the very end hold for neighbours at which
        it has happened. Its length, in the units of the states, is a distance over which events change little.

    Returns
    -------
    Sensitivity
        Derivatives of the end of the run by its start and its parameters.

    Raises
    ------
    DegenerateError
        An event that is grazed, two independent events at one instant, events that accumulate but are too few to give
        their limit, a derivative that is not finite at the zero of a root, a status without an end.
    ParameterError
        An unknown name in ``wrt``.
    OptionError
        No run of :func:`simulate`, or one without a step.

    Notes
    -----
    A run that starts on a sliding surface has the derivatives of the sliding field: they hold along the
    surface, not for starts off it; of a run that starts at rest, for starts that rest too.

    Where impacts, resets or crossings accumulate the derivatives are those of their limit, extrapolated from events
    before it; they are exact to about 1e-12. A run with the status ACCUMULATION has those of the limit as its end.
    One-sided ones are extrapolated from those of neighbours, which are simulated, to about 1e-9; those of times that are
    not finite, as of a grazing, are NaN.

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
    names = _names(run, wrt)
    return along(run, names) if side is None else _beside(run, side, names)


def _beside(run: Trajectory, side: Side, names: tuple[str, ...]) -> Sensitivity:
    """One-sided derivatives."""
    made = list[Sensitivity]()

    def arrays(found: Sensitivity) -> dict[str, Array]:
        return {name: rows for name, rows in vars(found).items() if isinstance(rows, np.ndarray)}

    def values(near: Trajectory) -> Array:
        made.append(along(near, names))
        return np.concatenate([rows.ravel() for rows in arrays(made[-1]).values()])

    n = run.system.dimension
    limit, kept = one_sided(run, side, values, n * (n + len(names))), arrays(made[0])
    cuts = np.cumsum([rows.size for rows in kept.values()])[:-1]
    parts = zip(kept.items(), np.split(limit, cuts), strict=True)
    limits: dict[str, Any] = {name: part.reshape(rows.shape) for (name, rows), part in parts}
    return replace(made[0], **limits)


@dataclass(frozen=True, eq=False, repr=False)
class Gradient(Tabular):
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
        x0 = ", ".join(f"{v:.6g}" for v in self.x0)
        return f"Gradient(value {self.value:.6g}, x0 [{x0}], parameters {{{of}}})"


def gradient(
    run: Trajectory,
    cost: Any,
    *,
    samples: Mapping[Any, ArrayLike] | None = None,
    wrt: str | Sequence[str] = ("x0", "parameters"),
    side: Side | None = None,
) -> Gradient:
    """Gradient of a cost at the end of a run, or summed over its samples, by the exact discrete adjoint.

    Parameters
    ----------
    run : Trajectory
        The run, from :func:`nonsmooth.simulate`.
    cost : expression
        Of the states at the end, parameters and time. An integral is a further state.
    samples : mapping of symbol to array_like (K,), optional
        The cost is a sum over the samples of the run (see :func:`vjp`). Symbols in it have these values there, such as
        data to be fitted; ``{}`` where it has no symbols of its own.
    wrt, side : optional
        As in :func:`sensitivity`.

    Returns
    -------
    Gradient
        Derivatives along directions that an entry to sliding loses are zero, which is correct.

    Raises
    ------
    DegenerateError
        As :func:`sensitivity`; a cost that is not finite, or has no finite derivatives.
    DefinitionError, NotSmoothError
        A cost with foreign symbols, or with a kink or a jump.
    OptionError, PointError
        As :func:`vjp`; data of a wrong shape.
    ParameterError
        An unknown name in ``wrt``.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> y, v, r, data = (ca.SX.sym(s) for s in ("y", "v", "r", "data"))
    >>> mass = ns.FilippovSystem(
    ...     [y, v], field=[v, -2.0], resets=ns.Reset(y, [y, -r * v], -1), parameters={r: 0.5})
    >>> run = ns.simulate(mass, [0.25, 0.0], t_end=0.75, t_eval=[0.25, 0.75])
    >>> ns.gradient(run, y**2 + v)
    Gradient(value 0.00390625, x0 [3.03125, 1], parameters {r: 1.03125})
    >>> ns.gradient(run, (y - data) ** 2, samples={data: [0.2, 0.1]})
    Gradient(value 0.0015625, x0 [-0.04375, -0.00625], parameters {r: -0.01875})
    """
    system = _require_run(run).system
    names, p = _names(run, wrt), parameters_of(run)
    if side is not None:

        def values(near: Trajectory) -> Array:
            found = gradient(near, cost, samples=samples, wrt=names)
            return np.array([found.value, *found.x0, *found.parameters.values()])

        value, *rest = one_sided(run, side, values).tolist()
        by_p = dict(zip(names, rest[system.dimension :], strict=True))
        return Gradient(value, np.array(rest[: system.dimension]), by_p)
    chosen = numbers_of(run, names)
    parts = _legs(run, chosen)
    if samples is None:
        states = _end(parts)[None]
    else:
        times, states = _require_samples(run)
        states = np.column_stack([states, times]) if system.time_dependent else states
    value, rows, by_parameters = cost_over(
        system, cost, {} if samples is None else samples, states, p
    )
    row, none = np.zeros(states.shape[1]), np.zeros((len(sample_times(run)), states.shape[1]))
    row, rows = (rows[0], none) if samples is None else (row, rows)
    by_start, pulled = _pulled(run, parts, row, rows, chosen)
    numbers = dict(zip(names, (by_parameters[list(chosen)] + pulled).tolist(), strict=True))
    return _finite(Gradient(value, by_start + 0.0, numbers), run)


def _end(parts: Sequence[Passage]) -> Array:
    """The end of a run, integrated as its derivatives are; after a jump that of the run."""
    last = parts[-1].stretch
    if parts[-1].limit is not None:
        return parts[-1].limit.limit.value[1:]
    return parts[-1].flow.end if np.array_equal(last.end, last.after) else last.after


def _finite(found: Gradient, run: Trajectory) -> Gradient:
    """Raise for a cost that is not finite, or has no finite derivatives."""
    if np.isfinite([found.value, *found.x0, *found.parameters.values()]).all():
        return found
    raise DegenerateError(
        f"cost is not finite, or has derivatives that are not, at the end {run.x[-1].tolist()} of the run, or at its "
        f"samples: {found!r}. Check logarithms, roots and divisions there."
    )


def vjp(
    run: Trajectory,
    cotangent: ArrayLike | None = None,
    *,
    samples: ArrayLike | None = None,
    wrt: str | Sequence[str] = ("x0", "parameters"),
    side: Side | None = None,
) -> tuple[Array, Array]:
    """Product of rows with the derivatives of a run, by the discrete adjoint.

    It costs a few runs, however many states, parameters and samples there are.

    Parameters
    ----------
    run : Trajectory
        The run, from :func:`nonsmooth.simulate`.
    cotangent : array_like (n,), optional
        Derivatives of a quantity by the final state.
    samples : array_like (K, n), optional
        Its derivatives by the states ``run.sample_x`` at the times ``t_eval``, which are fixed. A sample at the time of
        an event is taken on the side of ``sample_x``: after the event where the state does not jump.
    wrt, side : optional
        As in :func:`sensitivity`.

    Returns
    -------
    by_start, by_parameters : ndarray (n,), (q,)
        In the order of ``wrt``.

    Raises
    ------
    PointError
        Cotangents of a wrong shape, or at samples that the run does not have; otherwise as :func:`sensitivity`.
    OptionError
        Neither ``cotangent`` nor ``samples``; samples at events, whose times move: :func:`nonsmooth.orbit.poincare` has
        their derivatives.

    Examples
    --------
    >>> import casadi as ca, numpy as np, nonsmooth as ns
    >>> x, a = ca.SX.sym("x"), ca.SX.sym("a")
    >>> system = ns.FilippovSystem([x], field=[a], parameters={a: 2.0})
    >>> run = ns.simulate(system, [0.0], t_end=3.0, t_eval=[1.0, 2.0])
    >>> ns.vjp(run, [1.0])
    (array([1.]), array([3.]))
    >>> ns.vjp(run, samples=2 * (run.sample_x - [[1.5], [4.5]]))  # of sum((x(t_k) - data_k)**2)
    (array([0.]), array([-1.]))
    """
    n = _require_run(run).system.dimension
    chosen = numbers_of(run, _names(run, wrt))
    if cotangent is None and samples is None:
        raise OptionError("cotangent is missing. Give it, or samples=.")
    row = np.zeros(n) if cotangent is None else real_array(cotangent, "cotangent")
    if row.shape != (n,) or not np.all(np.isfinite(row)):
        shown = f"has shape {row.shape}" if row.shape != (n,) else f"is {row.tolist()}"
        raise PointError(
            f"cotangent {shown}, but the system has {n} states. Give one finite number for each."
        )
    rows = _rows_at(run, samples)
    if side is not None:
        values = lambda near: np.concatenate(_pulled(near, _legs(near, chosen), row, rows, chosen))
        found = one_sided(run, side, values)
        return found[:n], found[n:]
    return _pulled(run, _legs(run, chosen), row, rows, chosen)


def _rows_at(run: Trajectory, samples: ArrayLike | None) -> Array:
    """Rows at the samples that a run has."""
    if samples is None:
        return np.zeros((len(sample_times(run)), run.system.dimension))
    rows, (times, states) = real_array(samples, "samples"), _require_samples(run)
    shape = states.shape
    if rows.shape != shape:
        raise PointError(
            f"samples has shape {rows.shape}, but the run has samples of shape {shape}. Give one row for each."
        )
    had = np.isfinite(times)
    if not np.all(np.isfinite(rows[had])) or np.any(rows[~had] != 0.0):
        raise PointError(
            f"samples has rows that are not finite, or rows after the end of the run at t = {run.t[-1]:.6g} that are "
            "not zero. Give finite numbers, and zeros where the run has no sample."
        )
    return np.asarray(rows[had])


def _require_samples(run: Trajectory) -> tuple[Array, Array]:
    """Times (K,) and states (K, n) of the samples of a run, which are not those of a section."""
    if run.sample_t is None or run.sample_x is None:
        raise OptionError("run has no samples. Simulate with t_eval=.")
    if run.sampled_events:
        raise OptionError(
            "run has samples at events, whose times move with the start. Simulate with t_eval=, or take the derivatives "
            "of nonsmooth.orbit.poincare."
        )
    return run.sample_t, run.sample_x


def _legs(run: Trajectory, chosen: tuple[int, ...]) -> list[Passage]:
    """Legs of a run along which rows can be pulled back."""
    times = sample_times(run)
    try:
        return passages(run, chosen, times, back=True)
    except ConvergenceError:  # a leg without Taylor series
        return passages(run, chosen, times)


def _pulled(
    run: Trajectory,
    parts: Sequence[Passage],
    row: Array,
    rows: Array,
    chosen: tuple[int, ...],
) -> tuple[Array, Array]:
    """Pull a row (n,) at the end of a run, and rows (K, n) at its samples, back to the start."""
    if len(row) < run.system.extended_dimension:  # nothing depends on the time
        row, rows = np.append(row, 0.0), np.pad(rows, ((0, 0), (0, 1)))
    found = _pulled_through(run, parts, row, rows, chosen)
    if all(np.isfinite(part).all() for part in found):
        return found
    # Columns have no derivatives that are not finite where those would be multiplied by zero.
    forward = passages(run, chosen, sample_times(run))
    return _pulled_through(run, forward, row, rows, chosen)


def _pulled_through(
    run: Trajectory, parts: Sequence[Passage], row: Array, rows: Array, chosen: tuple[int, ...]
) -> tuple[Array, Array]:
    system, some, last, rows = run.system, list(chosen), parts[-1], np.ascontiguousarray(rows)
    every = np.zeros(len(last.stretch.p))  # by all parameters
    own = every if last.back else np.zeros(len(some))  # by the legs
    pulling = last.flow.carried[0].pulling(every, rows) if last.flow.carried else nullcontext()
    row = row + rows[last.samples.stop :].sum(axis=0)
    added = dict[int, tuple[Array, float]]()  # rows after events that accumulate
    with pulling:
        for i, part in reversed([*enumerate(parts)]):
            event = part.event
            if part.limit is not None:
                added |= part.limit.pull(row, every)
                row = np.zeros_like(row)
            if i in added and event is not None:
                row, later = row + added[i][0], added[i][1]
                row = event.pull(row, every) + later * event.time_by_state
                every += later * event.time_by_parameters
            elif event is not None and part is last and part.stretch.leg.kind == "stop":
                along_flow = float(row @ part.flow.rate)
                every += along_flow * event.time_by_parameters
                row = row + along_flow * event.time_by_state
            elif event is not None:
                row = event.pull(row, every)
            row = part.backward(row, rows, own)
    if parts[0].held is not None:
        every += row @ parts[0].held.by_parameters
        row = row @ parts[0].held.by_state
    row = row.copy()
    row[discrete_indices(system)] = 0.0
    by_parameters = every[some] if last.back else every[some] + own
    return row[: system.dimension], by_parameters


def _require_run(run: Trajectory) -> Trajectory:
    if not isinstance(run, Trajectory):
        raise OptionError(f"run={run!r} is no Trajectory. Give the result of ns.simulate.")
    run.require_dense("its sensitivity")
    if not len(run.steps):
        raise OptionError(f"run has no step ({run.message}) Give a start from which it moves.")
    if run.status not in (Status.REACHED_END, Status.STOPPED, Status.ACCUMULATION):
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
