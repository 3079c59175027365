"""Landings as rows: from the checks over the frictionless phase to lift-off."""

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
from ..contact.model import NO_GRAVITY, ContactModel
from ..contact.space import Contact3D
from ..errors import EnergyWarning, LandingError
from ..parameters import LIMITS, numbers
from ..shot.energy import advice, gains
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
from .results import BounceStatus

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Rows = NDArray[np.intp]

#: What a bounce takes at touch-down.
INPUTS = ("xdot", "ydot", "omega", "x", "y")

#: Plain numbers are given to NumPy: before Python 3.12 it asks the class of an enum's member for things in
#: Python's code, and drops a Ctrl-C that comes there.
_LIFTED_OFF = int(BounceStatus.LIFTED_OFF)

_FROM_RUN = {
    ns.Status.STOPPED: BounceStatus.LIFTED_OFF,
    ns.Status.REACHED_END: BounceStatus.NO_LIFT_OFF,
    ns.Status.NON_UNIQUE: BounceStatus.NON_UNIQUE,
    ns.Status.NOT_FINITE: BounceStatus.NOT_FINITE,
}


class Part(NamedTuple):
    """Rows that share their equations; ``rows`` is None where these are all."""

    blueprint: Blueprint
    rows: Bools | None


class Batch:
    """Landings as rows, from the checks over the frictionless phase to lift-off.

    Parameters
    ----------
    model : ContactModel or Contact3D
    inputs, parameters : mapping of str to array_like
        Landings, and values that replace the model's; they broadcast against each other.

    Raises
    ------
    LandingError, nonsmooth.ParameterError
    """

    def __init__(
        self,
        model: ContactModel | Contact3D,
        inputs: Mapping[str, ArrayLike],
        parameters: Mapping[str, ArrayLike] | None,
    ):
        self.model = model
        eq = equations(model.blueprint())
        self.names = eq.names
        self.given = {name: numbers(value, name, LandingError) for name, value in inputs.items()}
        self.given |= {name: np.array(value) for name, value in eq.start.items()}
        self.values = self._replaced(parameters or {})
        arrays = {**self.given, **self.values}
        try:
            self.shape = np.broadcast_shapes(*[a.shape for a in arrays.values()])
        except ValueError as error:
            shapes = {name: a.shape for name, a in arrays.items() if a.ndim}
            raise LandingError(
                f"inputs: expected shapes that broadcast, received {shapes}."
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
                f"parameters: expected names among {list(self.model.values)}, received {unknown}."
            )
        return {**{n: np.array(v) for n, v in self.model.values.items()}, **changed}

    def _parts(self) -> tuple[Part, ...]:
        """Where the load is less gravity, rows without gravity have other equations than the rest."""
        weightless = self.values["G"] <= NO_GRAVITY
        if self.model.convention == "contact" or np.all(weightless):
            return (Part(self.model.blueprint(weightless=True), None),)
        if not np.any(weightless):
            return (Part(self.model.blueprint(weightless=False), None),)
        rows = self._rows(weightless)
        return tuple(Part(self.model.blueprint(weightless=w), rows == w) for w in (False, True))

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

    def _going(self, part: Part) -> Bools:
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
        """What :func:`rise` says of each row, asked once for each value that this depends on."""
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
        words: list[str] = []
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
            code[rows] = len(words) + runs.itinerary_code + later
            words += [*runs.itineraries, *(f"F {word}" for word in runs.itineraries)]
            if work.store is not None:  # the second part, if any, has its own
                work = replace(work, store=f"{os.fspath(work.store)}-weightless")
        start = np.stack([self._rows(self.given[n]) for n in ("x", "xdot", "y", "ydot")], axis=-1)
        stay = (self.status == _LIFTED_OFF) & rests(self.states, start)
        self.status[stay] = int(BounceStatus.NO_LIFT_OFF)
        self._look_at_energy(options["tol"])
        failed = self.status != _LIFTED_OFF
        self.states[failed], self.time[failed], code[failed] = np.nan, np.nan, -1
        itineraries, code = _sorted(words, code)
        return itineraries, code.reshape(self.shape)

    def column(self, name: str) -> Array:
        """Values of one state, of the shape of the landings."""
        return self.states[:, self.names.index(name)].reshape(self.shape)

    def _look_at_energy(self, tol: float) -> None:
        """Warn of balls that leave faster than they came, because the surface did work on them."""
        ydot = self.states[:, 3].reshape(self.shape)
        faster = (ydot > -self.given["ydot"]) & (self.given["y"] == 0.0)
        if not np.any(faster):
            return
        count = 0
        for part in self.parts:
            rows = np.flatnonzero(faster.ravel() & self._going(part))
            landing = np.array([self._rows(self.given[name])[rows] for name in self.names])
            p, off = self._columns(rows), self.states[rows].T
            count += int(np.sum(gains(part.blueprint, landing, off, p, tol)))
        if count:
            model = self.model
            surface = model.model if isinstance(model, Contact3D) else model
            said = advice(surface, count, self.status.size)
            warnings.warn(said, EnergyWarning, stacklevel=5)


def _translate(status: NDArray[np.int8]) -> NDArray[np.int8]:
    table = [int(_FROM_RUN.get(s, BounceStatus.FAILED)) for s in sorted(ns.Status)]
    return np.array(table, np.int8)[status]


def _sorted(words: list[str], code: NDArray[np.int32]) -> tuple[tuple[str, ...], NDArray[np.int32]]:
    """Itineraries that occur, sorted, and the position of each row's among them (-1: none)."""
    used = set(np.unique(code).tolist()) - {-1}
    itineraries = sorted({words[k] for k in used})
    order = np.full(len(words) + 1, -1, np.int32)
    for k in used:
        order[k] = itineraries.index(words[k])
    return tuple(itineraries), order[code]
