"""Many bounces at once: lift-off over arrays of landings and parameters, and maps of outcomes."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from .contact import ContactModel
from .equations import contact_system, equations, free_system, touch_down_function
from .errors import LandingError, ModelError
from .parameters import LIMITS, number
from .shot import kind
from .touch_down import _AHEAD, _INSTANT

Array = NDArray[np.float64]

#: Position of the last of the times ahead that is passed by one Euler step, plus one.
_SHORT = int(np.searchsorted(_AHEAD, _INSTANT))

INPUTS = ("xdot", "ydot", "omega", "x", "y")


class BounceStatus(IntEnum):
    """How a bounce of an ensemble ended; stored in arrays."""

    LIFTED_OFF = 0
    NO_LIFT_OFF = 1
    NOT_A_LANDING = 2
    NOT_FINITE = 3
    BAD_PARAMETER = 4
    NO_CONTACT = 5
    NON_UNIQUE = 6
    FAILED = 7

    def __str__(self) -> str:
        return self.name

    @property
    def advice(self) -> str:
        """What it means."""
        return _ADVICE[self]


_ADVICE = {
    BounceStatus.LIFTED_OFF: "The load fell to zero.",
    BounceStatus.NO_LIFT_OFF: "The load did not vanish before t_max: the ball stays, or t_max is "
    "too short.",
    BounceStatus.NOT_A_LANDING: "The ball is above the ground or moves away from it.",
    BounceStatus.NOT_FINITE: "An input, or a force on the way, is not a finite number.",
    BounceStatus.BAD_PARAMETER: "A parameter is outside the model's limits.",
    BounceStatus.NO_CONTACT: "The ball passes through the surface without pressing on it.",
    BounceStatus.NON_UNIQUE: "The motion meets a point from which it is not unique.",
    BounceStatus.FAILED: "Too many events or steps: simulate this one to see its message.",
}

_FROM_RUN = {
    ns.Status.STOPPED: BounceStatus.LIFTED_OFF,
    ns.Status.REACHED_END: BounceStatus.NO_LIFT_OFF,
    ns.Status.NON_UNIQUE: BounceStatus.NON_UNIQUE,
    ns.Status.NOT_FINITE: BounceStatus.NOT_FINITE,
}


@dataclass(frozen=True, eq=False, repr=False)
class LiftOffs:
    """Lift-offs, each array of the broadcast shape ``(...)`` of the inputs.

    Attributes
    ----------
    xdot, ydot, omega, x, y : ndarray (...)
        State at lift-off; NaN where ``status`` is not LIFTED_OFF.
    time : ndarray (...)
        Duration of the contact.
    status : ndarray of int8 (...)
        Values of :class:`BounceStatus`.
    itineraries : tuple of str
        Those that occur, sorted.
    itinerary_code : ndarray of int32 (...)
        Position in ``itineraries``; -1 where there was no lift-off.
    """

    xdot: Array
    ydot: Array
    omega: Array
    x: Array
    y: Array
    time: Array
    status: NDArray[np.int8]
    itineraries: tuple[str, ...]
    itinerary_code: NDArray[np.int32]

    @property
    def slip(self) -> Array:
        """H_F = xdot + omega at lift-off (...); below zero is reverse slip."""
        return self.xdot + self.omega

    @property
    def itinerary(self) -> NDArray[np.object_]:
        """Phases as in ``Shot.itinerary`` (...); equal ones are the same object, "" where none."""
        return np.array([*self.itineraries, ""], dtype=object)[self.itinerary_code]

    @property
    def complete(self) -> NDArray[np.bool_]:
        """Where the ball lifted off (...)."""
        return self.status == BounceStatus.LIFTED_OFF

    def __repr__(self) -> str:
        counts = ", ".join(
            f"{BounceStatus(int(s))} {k}"
            for s, k in zip(*np.unique(self.status, return_counts=True), strict=True)
        )
        words = ", ".join(map(repr, self.itineraries[:8])) + (
            ", ..." if len(self.itineraries) > 8 else ""
        )
        return f"LiftOffs(shape {self.time.shape}; {counts}; itineraries {words})"


def lift_off(
    model: ContactModel,
    xdot: ArrayLike,
    ydot: ArrayLike,
    omega: ArrayLike,
    x: ArrayLike = 0.0,
    y: ArrayLike = 0.0,
    *,
    parameters: Mapping[str, ArrayLike] | None = None,
    tol: float = 1e-10,
    t_max: float = 100.0,
    threads: int | None = None,
    executor: Executor | None = None,
    chunk: int = 16384,
    progress: bool = False,
    checkpoint: str | os.PathLike[str] | None = None,
    engine: str = "auto",
) -> LiftOffs:
    """Bounce many balls: inputs and model parameters broadcast against each other.

    Parameters
    ----------
    model : ContactModel
    xdot, ydot, omega, x, y : array_like (...)
        Landings, as in :func:`simulate`.
    parameters : mapping of str to array_like, optional
        Values that replace the model's, e.g. ``{"mu": [0.2, 0.3]}``.
    tol, t_max : float, optional
        As in :func:`simulate`.
    threads, executor, chunk, progress, checkpoint, engine : optional
        As in :func:`nonsmooth.ensemble`.

    Returns
    -------
    LiftOffs
        What cannot be simulated is NaN and named in ``status``; nothing is dropped.

    Raises
    ------
    LandingError
        Inputs that are not numbers or do not broadcast.
    nonsmooth.ParameterError
        An unknown parameter.
    ModelError, nonsmooth.OptionError

    Examples
    --------
    >>> import numpy as np, bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    >>> many = bounce.lift_off(turf, xdot=[0.3, 0.3, np.nan], ydot=-1.0, omega=[[0.1], [1.2]])
    >>> many.itinerary
    array([['+ s -', '+ s -', ''],
           ['+ s +', '+ s +', '']], dtype=object)
    >>> many
    LiftOffs(shape (2, 3); LIFTED_OFF 4, NOT_FINITE 2; itineraries '+ s +', '+ s -')
    """
    if not isinstance(model, ContactModel):
        raise ModelError(f"model: expected a ContactModel, received {model!r}.")
    batch = _Batch(model, dict(zip(INPUTS, (xdot, ydot, omega, x, y), strict=True)), parameters)
    options = dict(
        tol=tol, threads=threads, executor=executor, chunk=chunk, progress=progress, engine=engine
    )
    batch.check()
    batch.touch_down(t_max, options)
    return batch.bounce(t_max, {**options, "checkpoint": checkpoint})


@lru_cache(maxsize=64)
def _load_inputs(blueprint: ContactModel) -> frozenset[str]:
    """Names of the states and parameters on which the load depends along the free motion."""
    eq, system = equations(blueprint), free_system(blueprint)
    rates = dict(zip(eq.names, ca.vertsplit(system.field("")), strict=True))
    names: set[str] = set()
    new = {str(v) for v in ca.symvar(eq.lift_off)}
    while new - names:
        names |= new
        new = {str(v) for n in names & set(rates) for v in ca.symvar(rates[n])}
    return frozenset(names)


class _Batch:
    """Landings as rows, from the checks over the frictionless phase to lift-off."""

    def __init__(
        self,
        model: ContactModel,
        inputs: Mapping[str, ArrayLike],
        parameters: Mapping[str, ArrayLike] | None,
    ):
        self.model, self.blueprint = model, kind(model)
        self.equations = equations(self.blueprint)
        self.given = {name: _numbers(value, name) for name, value in inputs.items()}
        self.given |= {n: np.array(v) for n, v in self.equations.start.items()}
        changed = {str(name): _numbers(v, str(name)) for name, v in (parameters or {}).items()}
        unknown = sorted(set(changed) - set(model.values))
        if unknown:
            raise ns.ParameterError(
                f"parameters: expected names among {list(model.values)}, received {unknown}."
            )
        self.values = {**{n: np.array(v) for n, v in model.values.items()}, **changed}
        arrays = {**self.given, **self.values}
        try:
            self.shape = np.broadcast_shapes(*[a.shape for a in arrays.values()])
        except ValueError as error:
            shapes = {name: a.shape for name, a in arrays.items() if a.ndim}
            raise LandingError(
                f"inputs: expected shapes that broadcast, received {shapes}."
            ) from error
        count = math.prod(self.shape)
        self.states = np.empty((count, len(self.equations.names)))
        for k, name in enumerate(self.equations.names):
            self.states[:, k] = self._rows(self.given[name])
        self.time = np.zeros(count)
        self.free = np.zeros(count, bool)
        self.status = np.full(count, BounceStatus.LIFTED_OFF, np.int8)

    def _rows(self, values: NDArray[Any]) -> NDArray[Any]:
        return np.broadcast_to(values, self.shape).ravel()

    def parameters(self, rows: Any) -> dict[str, Any]:
        """Parameters of some rows: numbers, or arrays where they vary."""
        return {n: self._rows(v)[rows] if v.ndim else float(v) for n, v in self.values.items()}

    def check(self) -> None:
        """Mark rows that are no landings."""
        y, ydot = self.given["y"], self.given["ydot"]
        self._mark((y > 0) | ((y == 0) & (ydot >= 0)), BounceStatus.NOT_A_LANDING)
        limits = self.model.declared_limits()
        for name, values in self.values.items():
            if name in limits:
                allowed = LIMITS[limits[name]]
                bad = [not allowed(v) for v in values.ravel().tolist()]
                self._mark(np.array(bad).reshape(values.shape), BounceStatus.BAD_PARAMETER)
        for values in (*self.values.values(), *self.given.values()):
            self._mark(~np.isfinite(values), BounceStatus.NOT_FINITE)

    def _mark(self, where: Any, status: BounceStatus) -> None:
        if np.any(where):
            self.status[self._rows(np.asarray(where))] = status

    @property
    def going(self) -> NDArray[np.bool_]:
        """Rows that nothing is wrong with so far."""
        return self.status == BounceStatus.LIFTED_OFF

    def touch_down(self, t_max: float, options: dict[str, Any]) -> None:
        """Move rows whose load is not positive at once to where it is.

        As ``touch_down.approach`` does for one; the two are tested against each other.
        """
        first, zero, rough = (self._rows(a) for a in self._rise())
        late = (first > 0) & self.going
        at_once = late & (zero | (first <= _SHORT)) | (self.going & (first == 0) & rough)
        # Off a power law's zero; the speeds change by less than rounding in this time.
        self.states[at_once, 0] += _INSTANT * self.states[at_once, 1]
        self.states[at_once, 2] += _INSTANT * self.states[at_once, 3]
        late &= ~at_once
        for k in np.unique(first[late]):
            longest = _AHEAD[k - 1] / 8 if k <= _AHEAD.size else math.inf
            self._fall(np.flatnonzero(late & (first == k)), longest, t_max, options)

    def _rise(self) -> tuple[NDArray[np.int8], NDArray[np.bool_], NDArray[np.bool_]]:
        """When the load becomes positive, in the shape of the inputs on which this depends.

        Returns
        -------
        first : ndarray of int8
            0 at once, k by the time ``_AHEAD[k - 1]``, the last of which plus one: later.
        zero : ndarray of bool
            Whether it is zero at touch-down and not negative before that time.
        rough : ndarray of bool
            Whether the forces at touch-down change at an infinite rate: a root at its zero.
        """
        names = _load_inputs(self.blueprint)
        states = [self.given[n] if n in names else np.array(0.0) for n in self.equations.names]
        values = [v if n in names else np.array(1.0) for n, v in self.values.items()]
        arrays = np.broadcast_arrays(*states, *values)
        shape, flat = arrays[0].shape, np.array([a.ravel() for a in arrays])
        x, p = flat[: len(states)], flat[len(states) :]
        function = touch_down_function(self.blueprint)
        load, _, field, change = (np.array(v) for v in function(x, p))
        rough = ~np.all(np.isfinite(change), axis=0)
        first = np.where(load[0] > 0, 0, _AHEAD.size + 1).astype(np.int8)
        zero = load[0] == 0
        for k, ahead in enumerate(_AHEAD):
            waiting = np.flatnonzero(first > _AHEAD.size)
            if not waiting.size:
                break
            now = np.array(function(x[:, waiting] + ahead * field[:, waiting], p[:, waiting])[0])[0]
            zero[waiting[now < 0]] = False
            first[waiting[now > 0]] = k + 1
        zero &= (first > 0) & (first <= _AHEAD.size)
        return first.reshape(shape), zero.reshape(shape), rough.reshape(shape)

    def _fall(
        self, rows: NDArray[np.intp], longest: float, t_max: float, options: dict[str, Any]
    ) -> None:
        """Move rows without friction until their load is positive."""
        up = (self.states[rows, 2] < 0) & (self.states[rows, 3] >= 0)
        self.status[rows[up]] = BounceStatus.NOT_A_LANDING
        rows = rows[~up]
        if not rows.size:
            return
        system, parameters = free_system(self.blueprint), self.parameters(rows)
        runs = ns.ensemble(
            system,
            self.states[rows] + _INSTANT * self._derivatives(rows)[2].T,  # off a power law's zero
            t_max,
            t_start=_INSTANT,
            parameters=parameters,
            max_step=longest,
            **options,
        )
        self.states[rows], self.time[rows], self.free[rows] = runs.x, runs.t, True
        self.status[rows] = _translate(runs.status)
        surfaced = self.going[rows] & (self.states[rows, 3] > 0)  # y = 0 came before any load
        self.status[rows[surfaced]] = BounceStatus.NO_CONTACT
        rows = rows[self.going[rows]]
        for _ in range(3):  # onto zero load, to rounding
            load, rate, field, _ = self._derivatives(rows)
            self.states[rows] -= (load / rate * field).T

    def _derivatives(self, rows: NDArray[np.intp]) -> list[NDArray[np.float64]]:
        """What ``touch_down_function`` says of some rows, in columns."""
        parameters = self.parameters(rows)
        p = np.array([np.broadcast_to(parameters[n], rows.size) for n in self.values])
        return [np.array(v) for v in touch_down_function(self.blueprint)(self.states[rows].T, p)]

    def bounce(self, t_max: float, options: dict[str, Any]) -> LiftOffs:
        """Follow the contact with friction."""
        rows = np.flatnonzero(self.going)
        whole = rows.size == self.status.size
        runs = ns.ensemble(
            contact_system(self.blueprint),
            self.states if whole else self.states[rows],
            t_max,
            parameters=self.parameters(rows),
            **options,
        )
        self.status[rows] = _translate(runs.status)
        self.states[rows] = runs.x
        self.time[rows] += runs.t
        self.states[~self.going], self.time[~self.going] = np.nan, np.nan
        words, code = self._itineraries(rows, runs)
        x, xdot, y, ydot, omega = (self.states[:, k].reshape(self.shape) for k in range(5))
        return LiftOffs(
            xdot=xdot,
            ydot=ydot,
            omega=omega,
            x=x,
            y=y,
            time=self.time.reshape(self.shape),
            status=self.status.reshape(self.shape),
            itineraries=words,
            itinerary_code=code.reshape(self.shape),
        )

    def _itineraries(
        self, rows: NDArray[np.intp], runs: ns.Ensemble
    ) -> tuple[tuple[str, ...], NDArray[np.int32]]:
        """Itineraries that occur at lift-off, sorted, and the position of each row's."""
        words = [*runs.itineraries, *(f"F {word}" for word in runs.itineraries)]
        code = np.full(self.status.size, -1, np.int32)
        code[rows] = runs.itinerary_code + len(runs.itineraries) * self.free[rows]
        code[~self.going] = -1
        used = sorted(set(np.unique(code).tolist()) - {-1}, key=lambda k: words[k])
        order = np.full(len(words) + 1, -1, np.int32)
        order[used] = np.arange(len(used))
        return tuple(words[k] for k in used), order[code]


def _translate(status: NDArray[np.int8]) -> NDArray[np.int8]:
    table = [_FROM_RUN.get(s, BounceStatus.FAILED) for s in sorted(ns.Status)]
    return np.array(table, np.int8)[status]


def _numbers(value: ArrayLike, what: str) -> Array:
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise LandingError(f"{what}: expected numbers, received {value!r}.") from error


# Maps --------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class OutcomeMap:
    """Outcomes over a rectangle of two inputs or parameters.

    The first name varies along the last axis (horizontal in a picture), the second along the first.

    Attributes
    ----------
    model : ContactModel
    names : (str, str)
    axes : (ndarray (m,), ndarray (n,))
        Values of the two.
    fixed : dict
        The other inputs, and parameters that were changed.
    lift_offs : LiftOffs
        Arrays (n, m).
    """

    model: ContactModel
    names: tuple[str, str]
    axes: tuple[Array, Array]
    fixed: dict[str, float]
    lift_offs: LiftOffs

    @property
    def regions(self) -> tuple[str, ...]:
        """Names of the itineraries that occur, e.g. ``"S+ R S-"``: slip, rolling, reverse slip."""
        return tuple(map(region_name, self.lift_offs.itineraries))

    @property
    def code(self) -> NDArray[np.int32]:
        """Position in ``regions``, (n, m); -1 where there was no lift-off."""
        return self.lift_offs.itinerary_code

    @property
    def slip(self) -> Array:
        """H_F at lift-off, (n, m)."""
        return self.lift_offs.slip

    @property
    def spin_reversal(self) -> NDArray[np.bool_]:
        """Whether the spin at lift-off has the other sign than at touch-down, (n, m)."""
        spin = np.broadcast_to(self.input("omega"), self.slip.shape)
        return np.asarray(self.lift_offs.omega * spin < 0)

    @property
    def lift_off_angle(self) -> Array:
        """Angle of the velocity at lift-off above the direction of +x, (n, m), rad.

        Above pi/2 the ball goes to negative x.
        """
        return np.arctan2(self.lift_offs.ydot, self.lift_offs.xdot)

    def input(self, name: str) -> Array:
        """Values of an input at touch-down, of a shape that broadcasts to (n, m)."""
        if name == self.names[0]:
            return self.axes[0]
        return self.axes[1][:, None] if name == self.names[1] else np.array(self.fixed[name])

    def share(self) -> dict[str, float]:
        """Fraction of the map in each region."""
        counts = np.bincount(self.code[self.code >= 0], minlength=len(self.regions))
        return dict(zip(self.regions, (counts / self.code.size).tolist(), strict=True))

    def __repr__(self) -> str:
        size = " x ".join(str(len(a)) for a in self.axes)
        return f"OutcomeMap({' x '.join(self.names)}, {size}; regions {', '.join(self.regions)})"


def region_name(itinerary: str) -> str:
    """Name a region by the itinerary in it.

    Examples
    --------
    >>> region_name("+ s -")
    'S+ R S-'
    """
    return " ".join({"+": "S+", "-": "S-", "s": "R"}.get(m, m) for m in itinerary.split())


def outcome_map(
    model: ContactModel,
    over: Mapping[str, ArrayLike],
    fixed: Mapping[str, float] | None = None,
    **options: Any,
) -> OutcomeMap:
    """Map what becomes of landings over any two inputs or parameters.

    Parameters
    ----------
    model : ContactModel
    over : mapping
        Two names with their values, e.g. ``{"xdot": speeds, "omega": spins}`` or
        ``{"eta": ratios, "omega": spins}``; the first is horizontal.
    fixed : mapping, optional
        The other inputs (``ydot`` = -1, ``x`` = ``y`` = 0 unless given), and parameters.
    **options
        As :func:`lift_off` takes: ``tol``, ``threads``, ``progress``, ...

    Returns
    -------
    OutcomeMap

    Raises
    ------
    nonsmooth.OptionError
        Not two names, a name that is neither input nor parameter, a missing or doubled one.
    As :func:`lift_off`.

    Examples
    --------
    >>> import numpy as np, bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    >>> speeds, spins = np.linspace(-2, 2, 20), np.linspace(-4, 4, 20)
    >>> m = bounce.outcome_map(turf, over={"xdot": speeds, "omega": spins})
    >>> m.regions
    ('S+', 'S+ S-', 'S+ R S+', 'S+ R S-', 'S-', 'S- S+', 'S- R S+', 'S- R S-')
    >>> m.slip.shape, m.regions[m.code[-1, -1]]
    ((20, 20), 'S+')
    """
    if not isinstance(model, ContactModel):
        raise ModelError(f"model: expected a ContactModel, received {model!r}.")
    for what, given in dict(over=over, fixed=fixed or {}).items():
        if not isinstance(given, Mapping):
            raise ns.OptionError(f"{what}: expected a dict of names, received {given!r}.")
    axes, others = _checked_map(model, dict(over), dict(fixed or {}))
    first, second = axes
    values: dict[str, Any] = {**others, first: axes[first], second: axes[second][:, None]}
    inputs = {name: values[name] for name in INPUTS}
    parameters = {name: v for name, v in values.items() if name not in INPUTS}
    result = lift_off(model, **inputs, parameters=parameters, **options)
    return OutcomeMap(model, (first, second), (axes[first], axes[second]), others, result)


def _checked_map(
    model: ContactModel, over: dict[str, Any], fixed: dict[str, Any]
) -> tuple[dict[str, Array], dict[str, float]]:
    known = [*INPUTS, *model.values]
    if len(over) != 2:
        raise ns.OptionError(f"over: expected two names, received {list(over)}.")
    unknown = [name for name in (*over, *fixed) if name not in known]
    if unknown:
        raise ns.OptionError(f"over, fixed: expected names among {known}, received {unknown}.")
    doubled = sorted(set(over) & set(fixed))
    if doubled:
        raise ns.OptionError(f"over, fixed: expected each name once, received {doubled} in both.")
    axes = {name: _numbers(values, name) for name, values in over.items()}
    for name, values in axes.items():
        if values.ndim != 1 or values.size == 0:
            raise ns.OptionError(f"over: {name}: expected a list, received shape {values.shape}.")
        if not np.all(np.isfinite(values)):
            raise ns.OptionError(f"over: {name}: expected finite numbers, received {values}.")
    others = {
        "ydot": -1.0,
        "x": 0.0,
        "y": 0.0,
        **{k: number(v, f"fixed: {k}") for k, v in fixed.items()},
    }
    others = {name: v for name, v in others.items() if name not in axes}
    missing = [name for name in INPUTS if name not in axes and name not in others]
    if missing:
        raise ns.OptionError(
            f"fixed: expected values for {missing}, received none, e.g. fixed={{{missing[0]!r}: 0}}."
        )
    return axes, others
