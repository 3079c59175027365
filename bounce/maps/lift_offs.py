"""Lift-offs of many bounces at once, over arrays of landings and parameters."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..contact.equations import (
    Blueprint,
    contact_system,
    equations,
    free_system,
    load_inputs,
    touch_down_function,
)
from ..contact.model import NO_GRAVITY, Contact3D, ContactModel
from ..errors import EnergyWarning, LandingError, ModelError
from ..parameters import LIMITS, numbers
from ..shot.energy import advice, gains
from ..shot.state import landings, state_of
from ..shot.touch_down import (
    INSTANT,
    Rise,
    instant_later,
    leaving,
    onto_zero_load,
    rests,
    rise,
    surfaced,
)
from .results import BounceStatus, LiftOffs

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Rows = NDArray[np.intp]

#: A plain number: before Python 3.12 NumPy calls Python code for a member of an enum, where a Ctrl-C is
#: lost.
_LIFTED_OFF = int(BounceStatus.LIFTED_OFF)

_FROM_RUN = {
    ns.Status.STOPPED: BounceStatus.LIFTED_OFF,
    ns.Status.REACHED_END: BounceStatus.NO_LIFT_OFF,
    ns.Status.NON_UNIQUE: BounceStatus.NON_UNIQUE,
    ns.Status.NOT_FINITE: BounceStatus.NOT_FINITE,
}


def lift_off(
    model: ContactModel | Contact3D,
    xdot: ArrayLike,
    ydot: ArrayLike,
    omega: ArrayLike,
    x: ArrayLike = 0.0,
    y: ArrayLike = 0.0,
    *,
    parameters: Mapping[str, ArrayLike] | None = None,
    tol: float = 1e-10,
    t_max: float = 100.0,
    work: ns.Work | None = None,
    device: str | None = None,
) -> LiftOffs:
    """Bounce many balls: inputs and model parameters broadcast against each other.

    Parameters
    ----------
    model : ContactModel or Contact3D
        The contact model; ``model.in_3d()`` for landings with side spin.
    xdot, ydot, omega, x, y : array_like (...)
        Landings, as in :func:`simulate`. In 3-D ``xdot``, ``omega`` and ``x`` are arrays (..., 2),
        forward and to the right on the last axis; ``omega`` may be (..., 3) with drilling.
    parameters : mapping of str to array_like, optional
        Values that replace the model's, e.g. ``{"mu": [0.2, 0.3]}``.
    tol, t_max : float, optional
        As in :func:`simulate`.
    work : nonsmooth.Work, optional
        Threads, executor, chunk, bar and store of :func:`nonsmooth.ensemble`; by default no bar.
    device : {None, "cuda"}, optional
        ``"cuda"`` runs landings in the plane on an NVIDIA card, as :func:`nonsmooth.ensemble` does.

    Returns
    -------
    LiftOffs
        A bounce that cannot be simulated is NaN, with the reason in ``status``; nothing is dropped.

    Raises
    ------
    LandingError
        Inputs that are not numbers or do not broadcast.
    nonsmooth.ParameterError
        An unknown parameter. Values outside their limits get the status BAD_PARAMETER.
    ModelError
        No contact model.
    nonsmooth.OptionError
        A tolerance, a time or work out of its range; a ``device`` for landings in 3-D.

    Warns
    -----
    EnergyWarning
        As :func:`simulate`.

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

    >>> sides = bounce.lift_off(turf.in_3d(), [1.0, 0.0], -1.0, [[0.2, 0.1], [0.2, -0.1]], tol=1e-6)
    >>> sides.itinerary.tolist(), bool(abs(sides.travel_angle.sum()) < 1e-5)
    (['* s *', '* s *'], True)
    """
    if not isinstance(model, (ContactModel, Contact3D)):
        raise ModelError(f"model: expected a ContactModel, received {model!r}.")
    given = dict(xdot=xdot, ydot=ydot, omega=omega, x=x, y=y)
    bounces = _Bounces(model, given, parameters)
    work = ns.Work(progress=False) if work is None else work
    options = dict(tol=tol, device=device)
    bounces.check()
    bounces.touch_down(t_max, work, options)
    itineraries, code = bounces.contact(t_max, work, options)
    count = bounces.gained(tol)
    if count:
        warnings.warn(advice(model, count, code.size), EnergyWarning, stacklevel=2)
    end = state_of(bounces.equations, bounces.states.reshape(*bounces.shape, len(bounces.names)))
    motion = {n: np.asarray(getattr(end, n)) for n in ("xdot", "ydot", "omega", "x", "y", "slip")}
    return LiftOffs(
        **motion,
        time=bounces.time.reshape(bounces.shape),
        status=bounces.status.reshape(bounces.shape),
        itineraries=itineraries,
        itinerary_code=code,
    )


class _Part(NamedTuple):
    """Rows that share their equations; ``rows`` is None where these are all."""

    blueprint: Blueprint
    rows: Bools | None


class _Bounces:
    """Landings as rows: their checks, the frictionless phase, and the contact to lift-off."""

    def __init__(
        self,
        model: ContactModel | Contact3D,
        inputs: Mapping[str, ArrayLike],
        parameters: Mapping[str, ArrayLike] | None,
    ):
        self.model = model
        self.equations = equations(model.blueprint())
        self.names = self.equations.names
        self.given = landings(model, inputs, lambda v, name: numbers(v, name, LandingError))
        self.given |= {name: np.array(value) for name, value in self.equations.start.items()}
        self.values = self._replaced(parameters or {})
        arrays = {**self.given, **self.values}
        try:
            self.shape = np.broadcast_shapes(*[a.shape for a in arrays.values()])
        except ValueError as error:
            shapes = {name: a.shape for name, a in arrays.items() if a.ndim}
            raise LandingError(
                f"landings and parameters do not broadcast: their shapes are {shapes}."
            ) from error
        count = math.prod(self.shape)
        self.states = np.empty((count, len(self.names)))
        for k, name in enumerate(self.names):
            self.states[:, k] = self._rows(self.given[name])
        self.time = np.zeros(count)
        self.free = np.zeros(count, bool)
        self.status = np.full(count, _LIFTED_OFF, np.int8)
        self.parts = self._parts()

    def _replaced(self, parameters: Mapping[str, ArrayLike]) -> dict[str, NDArray[Any]]:
        changed = {str(n): numbers(v, str(n), LandingError) for n, v in parameters.items()}
        unknown = sorted(set(changed) - set(self.model.values))
        if unknown:
            raise ns.ParameterError(
                f"parameters has {unknown}, but the model's are {list(self.model.values)}."
            )
        return {**{n: np.array(v) for n, v in self.model.values.items()}, **changed}

    def _parts(self) -> tuple[_Part, ...]:
        """Where the load is less gravity, rows without gravity have other equations than the rest."""
        weightless = self.values["G"] <= NO_GRAVITY
        if self.model.convention == "contact" or np.all(weightless):
            return (_Part(self.model.blueprint(weightless=True), None),)
        if not np.any(weightless):
            return (_Part(self.model.blueprint(weightless=False), None),)
        rows = self._rows(weightless)
        return tuple(_Part(self.model.blueprint(weightless=w), rows == w) for w in (False, True))

    def _rows(self, values: NDArray[Any]) -> NDArray[Any]:
        return np.broadcast_to(values, self.shape).ravel()

    def parameters(self, rows: Any) -> dict[str, Any]:
        """Parameters of some rows: numbers, or arrays where they vary."""
        return {n: self._rows(v)[rows] if v.ndim else float(v) for n, v in self.values.items()}

    def check(self) -> None:
        """Mark rows that are no landings."""
        y, ydot = self.given["y"], self.given["ydot"]
        self._mark((y > 0) | ((y == 0) & (ydot >= 0)), BounceStatus.NOT_A_LANDING)
        limits = self.model.limits_of_values()
        for name, values in self.values.items():
            if name in limits:
                allowed = LIMITS[limits[name]]
                bad = [not allowed(v) for v in values.ravel().tolist()]
                self._mark(np.array(bad).reshape(values.shape), BounceStatus.BAD_PARAMETER)
        for values in (*self.values.values(), *self.given.values()):
            self._mark(~np.isfinite(values), BounceStatus.NOT_FINITE)

    def _mark(self, where: Any, status: BounceStatus) -> None:
        if np.any(where):
            self.status[self._rows(np.asarray(where))] = int(status)

    def _going(self, part: _Part) -> Bools:
        """Rows of a part that nothing is wrong with so far."""
        going = self.status == _LIFTED_OFF
        return going if part.rows is None else going & part.rows

    def touch_down(self, t_max: float, work: ns.Work, options: dict[str, Any]) -> None:
        """Move rows whose load is not positive at once to where it is; this needs no store."""
        options = {**options, "work": replace(work, store=None)}
        for part in self.parts:
            root, short, later, longest = self._rise(part.blueprint)
            going = self._going(part)
            over, later = (root | short) & going, later & going
            self.states[over] = instant_later(part.blueprint, self.states[over])
            for step in np.unique(longest[later]):
                rows = np.flatnonzero(later & (longest == step))
                self._fall(part.blueprint, rows, float(step), t_max, options)

    def _rise(self, blueprint: Blueprint) -> Rise:
        """:func:`rise` of each row, computed once for each value that it depends on."""
        names = load_inputs(blueprint)
        states = [self.given[n] if n in names else np.array(0.0) for n in self.names]
        values = [v if n in names else np.array(1.0) for n, v in self.values.items()]
        arrays = np.broadcast_arrays(*states, *values)
        shape, flat = arrays[0].shape, np.array([a.ravel() for a in arrays])
        found = rise(blueprint, flat[: len(states)], flat[len(states) :])
        return Rise(*(self._rows(a.reshape(shape)) for a in found))

    def _fall(
        self,
        blueprint: Blueprint,
        rows: Rows,
        longest: float,
        t_max: float,
        options: dict[str, Any],
    ) -> None:
        """Move rows without friction until their load is positive."""
        up = leaving(self.states[rows])
        self.status[rows[up]] = int(BounceStatus.NOT_A_LANDING)
        rows = rows[~up]
        if not rows.size:
            return
        runs = ns.ensemble(
            free_system(blueprint),
            self.states[rows]
            + INSTANT * self._velocities(blueprint, rows),  # off a power law's zero
            t_max,
            t_start=INSTANT,
            parameters=self.parameters(rows),
            max_step=longest,
            **options,
        )
        self.states[rows], self.time[rows], self.free[rows] = runs.x, runs.t, True
        self.status[rows] = _translate(runs.status)
        rows = rows[self.status[rows] == _LIFTED_OFF]
        unpressed = surfaced(self.states[rows])
        self.status[rows[unpressed]] = int(BounceStatus.NO_CONTACT)
        rows = rows[~unpressed]
        self.states[rows] = onto_zero_load(blueprint, self.states[rows].T, self._columns(rows)).T

    def _velocities(self, blueprint: Blueprint, rows: Rows) -> Array:
        """Rates of the states of some rows without friction."""
        field = ns.call(touch_down_function(blueprint), self.states[rows].T, self._columns(rows))[2]
        return np.array(field).T

    def _columns(self, rows: Rows) -> Array:
        """Parameters of some rows, in columns."""
        values = self.parameters(rows)
        return np.array([np.broadcast_to(values[n], rows.size) for n in self.values])

    def contact(
        self, t_max: float, work: ns.Work, options: dict[str, Any]
    ) -> tuple[tuple[str, ...], NDArray[np.int32]]:
        """Follow the contact with friction; return the itineraries and each row's among them."""
        named: list[str] = []
        code = np.full(self.status.size, -1, np.int32)
        for part in self.parts:
            rows = np.flatnonzero(self._going(part))
            runs = ns.ensemble(
                contact_system(part.blueprint),
                self.states if rows.size == self.status.size else self.states[rows],
                t_max,
                parameters=self.parameters(rows),
                work=work,
                **options,
            )
            self.status[rows] = _translate(runs.status)
            self.states[rows] = runs.x
            self.time[rows] += runs.t
            later = len(runs.itineraries) * self.free[rows]
            code[rows] = len(named) + runs.itinerary_code + later
            named += [*runs.itineraries, *(f"F {itinerary}" for itinerary in runs.itineraries)]
            if work.store is not None:  # the second part, if any, has its own
                work = replace(work, store=f"{os.fspath(work.store)}-weightless")
        start = np.stack([self._rows(self.given[n]) for n in ("x", "xdot", "y", "ydot")], axis=-1)
        stay = (self.status == _LIFTED_OFF) & rests(self.states, start)
        self.status[stay] = int(BounceStatus.NO_LIFT_OFF)
        failed = self.status != _LIFTED_OFF
        self.states[failed], self.time[failed], code[failed] = np.nan, np.nan, -1
        itineraries, code = _sorted(named, code)
        return itineraries, code.reshape(self.shape)

    def gained(self, tol: float) -> int:
        """Count balls that leave faster than they came, because the surface did work on them."""
        ydot = self.states[:, 3].reshape(self.shape)
        faster = (ydot > -self.given["ydot"]) & (self.given["y"] == 0.0)
        count = 0
        for part in self.parts if np.any(faster) else ():
            rows = np.flatnonzero(faster.ravel() & self._going(part))
            landing = np.array([self._rows(self.given[name])[rows] for name in self.names])
            p, off = self._columns(rows), self.states[rows].T
            count += int(np.sum(gains(part.blueprint, landing, off, p, tol)))
        return count


def _translate(status: NDArray[np.int8]) -> NDArray[np.int8]:
    table = [int(_FROM_RUN.get(s, BounceStatus.FAILED)) for s in sorted(ns.Status)]
    return np.array(table, np.int8)[status]


def _sorted(named: list[str], code: NDArray[np.int32]) -> tuple[tuple[str, ...], NDArray[np.int32]]:
    """Itineraries that occur, sorted, and the position of each row's among them (-1: none)."""
    # A law without a set, such as one with bristles in 3-D, has no letter for its one phase.
    named = [{"o": "*", "F o": "F *"}.get(itinerary, itinerary) for itinerary in named]
    used = set(np.unique(code).tolist()) - {-1}
    itineraries = sorted({named[k] for k in used})
    order = np.full(len(named) + 1, -1, np.int32)
    for k in used:
        order[k] = itineraries.index(named[k])
    return tuple(itineraries), order[code]
