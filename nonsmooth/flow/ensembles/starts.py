"""Starts and parameters of many runs, broadcast against each other and cut into chunks."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...model import Array, FilippovSystem, OptionError, PointError, Surfaces, clock_periods
from ...model.definition.discrete_states import require_allowed
from ..constants import ON_SURFACE
from ..options import Options
from .lazy_starts import Index, LazyStarts, part_of


@dataclass(frozen=True)
class Cut:
    """Starts and parameters of some trajectories; lazy starts are sent to another process as their rule."""

    p: Array
    x: Array | None = None
    lazy: LazyStarts | None = None
    shape: tuple[int, ...] = ()
    first: int = 0
    last: int = 0
    t_start: float | None = None

    def rows(self) -> tuple[Array, Array]:
        """Return the extended starts (m, N) and parameters."""
        if self.x is not None or self.lazy is None:
            assert self.x is not None
            return self.x, self.p
        x = part_of(self.lazy, self.shape, np.arange(self.first, self.last))
        return _extended(x, self.t_start), self.p


class Starts:
    """Starts and parameters of all trajectories; any part of them is computed on request."""

    def __init__(
        self,
        system: FilippovSystem,
        x0: ArrayLike | LazyStarts,
        parameters: Mapping[Any, ArrayLike] | None,
        t_start: float,
    ):
        self.system, self.t_start = system, t_start
        self.x0 = x0 if isinstance(x0, LazyStarts) else _numbers(x0, "x0")
        own = (*x0.shape, x0.dimension) if isinstance(x0, LazyStarts) else np.shape(self.x0)
        if own == () or own[-1] != system.dimension:
            raise PointError(
                f"x0 has shape {own}, but the system has {system.dimension} states, "
                f"{system.state_names}. Give shape (..., {system.dimension})."
            )
        if parameters is not None and not isinstance(parameters, Mapping):
            system.parameter_vector(parameters)  # refuses what is no mapping
        arrays = {str(k): _numbers(v, f"parameter {k}") for k, v in (parameters or {}).items()}
        sample = {k: _sample(v) for k, v in arrays.items()}
        self.p = system.parameter_vector(sample)
        self.varied = {system.parameter_names.index(k): v for k, v in arrays.items() if v.ndim > 0}
        shapes = [own[:-1], *[v.shape for v in self.varied.values()]]
        try:
            self.shape = np.broadcast_shapes(*shapes)
        except ValueError as error:
            raise PointError(
                f"x0 and parameters have shapes {shapes}. Give shapes that broadcast."
            ) from error
        self.count = math.prod(self.shape)

    def digest(self) -> str:
        """Return a hash of all numbers."""
        code = hashlib.sha256(repr((self.shape, np.shape(self.x0))).encode())
        if not isinstance(self.x0, np.ndarray):
            code.update(repr(self.x0.state()).encode())
        else:
            code.update(np.ascontiguousarray(self.x0).data)
        code.update(self.p.tobytes())
        for column, values in sorted(self.varied.items()):
            code.update(repr((column, values.shape)).encode())
            code.update(np.ascontiguousarray(values).data)
        return code.hexdigest()

    def every_parameter(self) -> Array:
        """Parameters (np,) or (m, np) of all trajectories."""
        return self.part(0, self.count)[1]

    def part(self, first: int, last: int) -> tuple[Array, Array]:
        """Extended starts and parameters of the trajectories first to last - 1."""
        return self.rows(slice(first, last))

    def cut(self, first: int, last: int) -> Cut:
        """Starts and parameters of the trajectories first to last - 1, for another process."""
        if not isinstance(self.x0, LazyStarts):
            x, p = self.part(first, last)
            return Cut(p, x)
        t_start = self.t_start if self.system.time_dependent else None
        p = self._parameters(slice(first, last), last - first)
        return Cut(p, None, self.x0, self.shape, first, last, t_start)

    def rows(self, which: slice | Index) -> tuple[Array, Array]:
        """Extended starts and parameters of some trajectories, by their numbers."""
        n = self.system.dimension
        if not isinstance(self.x0, np.ndarray):
            x = part_of(self.x0, self.shape, _numbered(which))
        else:
            x = _rows(self.x0, self.shape, which, n)
        x = _extended(x, self.t_start if self.system.time_dependent else None)
        return x, self._parameters(which, len(x))

    def _parameters(self, which: slice | Index, count: int) -> Array:
        if not self.varied:
            return self.p
        p = np.tile(self.p, (count, 1))
        for column, values in self.varied.items():
            p[:, column] = _rows(values[..., None], self.shape, which, 1)[:, 0]
        return p


def _extended(x: Array, t_start: float | None) -> Array:
    """States (m, n) with the time where there is one."""
    return x if t_start is None else np.concatenate([x, np.full((len(x), 1), t_start)], axis=1)


def require_start_mode(system: FilippovSystem, x: Array, p: Array, options: Options) -> None:
    """Raise OptionError where a start mode contradicts the sides of the start (N,)."""
    if options.start_mode is None or not system.surface_count:
        return
    mode = options.start_mode
    system.require_mode(mode)
    h, gradient = Surfaces(system).values(x, p)
    steep = np.where(np.isfinite(gradient), np.abs(gradient), 0.0)  # not that of a root at zero
    scale = steep @ (options.size + np.abs(x))
    sides = np.sign(np.where(np.abs(h) <= ON_SURFACE * scale, 0.0, h))
    wrong = []
    for k, members in enumerate(system.entries):
        own = list(members)
        letter = "*" if len(own) > 1 else "+" if sides[own[0]] > 0 else "-"
        is_free = own[0] in system.remembering  # between its thresholds, as C finds
        if np.any(sides[own]) and mode[k] != letter and not is_free:
            value = ", ".join(f"{v:.6g}" for v in h[own])
            wrong.append(f"h{k} = {value if len(own) == 1 else f'[{value}]'} ({letter!r})")
    if wrong:
        raise OptionError(
            f"start_mode is {mode!r}, but the start is where {', '.join(wrong)}. Give these letters; only "
            "on a surface or set, h = 0, is there a choice."
        )


def require_start(system: FilippovSystem, x: Array, p: Array) -> None:
    """Refuse starts (..., N) with other values of discrete states, or phases outside their periods."""
    d, n = system.definition, system.dimension
    for k, values in enumerate(d.discrete):
        own, name = x[..., n - len(d.discrete) + k], system.state_names[n - len(d.discrete) + k]
        wrong = np.isfinite(own) & ~np.isin(own, values or own)
        if wrong.any():
            require_allowed(name, float(np.extract(wrong, own)[0]), values, "x0 has ")
    for k, (_, state) in enumerate(d.clocks):
        period = clock_periods(system, k, p)
        phase = x[..., state]
        wrong = np.isfinite(phase) & ~((phase >= 0.0) & (phase < period))
        if wrong.any():
            name = system.state_names[state]
            raise OptionError(
                f"x0 has {name} = {np.extract(wrong, phase)[0]:g}, but the phase of a clock starts from 0 to "
                f"below its period, {float(np.max(period)):g}. Give the time since the last tick."
            )


def _numbered(which: slice | Index) -> Index:
    return np.arange(which.start, which.stop) if isinstance(which, slice) else which


def _rows(values: Array, shape: tuple[int, ...], which: slice | Index, n: int) -> Array:
    """Some rows of values broadcast to ``(*shape, n)``, without an array of that shape."""
    if values.shape == (*shape, n):
        return values.reshape(-1, n)[which]
    index = np.unravel_index(_numbered(which), shape) if shape else ()
    return np.broadcast_to(values, (*shape, n))[index]


def _numbers(value: ArrayLike, what: str) -> Array:
    try:
        return np.asarray(value, dtype=float, order="C")
    except (TypeError, ValueError) as error:
        raise PointError(f"{what} is {value!r}. Give numbers.") from error


def _sample(values: Array) -> float:
    """Any finite entry, to check names with; entries are checked one by one later."""
    if values.ndim == 0:
        return float(values)
    finite = values[np.isfinite(values)]
    return float(finite.flat[0]) if finite.size else 0.0
