"""The end or the samples of runs as functions of arrays, with the product of rows and their derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..flow import ensemble, simulate
from ..flow.status import Status
from ..model import (
    Array,
    DegenerateError,
    FilippovSystem,
    ParameterError,
    PointError,
    require_system,
)
from ..orbit import vjp

#: Statuses at which the end of a run has derivatives.
_ENDS = (Status.REACHED_END, Status.STOPPED, Status.ACCUMULATION)


@dataclass(frozen=True, eq=False)
class Runs:
    """Runs of a system from starts (..., n) with parameters (..., q); ``many`` runs them as an ensemble."""

    system: FilippovSystem
    t_end: float
    t_eval: Array | None
    many: bool
    options: dict[str, Any]

    @classmethod
    def of(
        cls, system: FilippovSystem, t_end: float, t_eval: Any, many: bool, options: dict[str, Any]
    ) -> Runs:
        """Runs of what a user gave."""
        require_system(system, sets=True, hysteresis=True, complementarity=True, joints=True)
        times = None if t_eval is None else np.asarray(t_eval, dtype=float)
        return cls(system, float(t_end), times, many, options)

    def require_shapes(self, starts: Sequence[int], parameters: Sequence[int]) -> None:
        """Refuse starts or parameters whose last axis has another length than the system's."""
        names = {"x0": self.system.state_names, "parameters": self.system.parameter_names}
        for (what, own), shape in zip(names.items(), (starts, parameters), strict=True):
            if tuple(shape[-1:]) != (len(own),) or (len(shape) > 1 and not self.many):
                error = PointError if what == "x0" else ParameterError
                many = "..., " if self.many else ""
                raise error(
                    f"{what} has shape {tuple(shape)}. Give one of ({many}{len(own)},) for {list(own)}."
                )

    def shape(self, starts: Sequence[int]) -> tuple[int, ...]:
        """Shape of the values of starts of some shape."""
        samples = () if self.t_eval is None else self.t_eval.shape
        return (*starts[:-1], *samples, starts[-1])

    def values(self, x0: Array, p: Array) -> Array:
        """Ends (..., n), or samples (..., K, n); NaN in ensembles where a run has none."""
        if self.many:
            found = ensemble(self.system, x0, self.t_end, **self._given(p))
            ended = np.isin(found.status, [int(status) for status in _ENDS])
            values = found.x if self.t_eval is None else found.sample_x
            assert values is not None
            return np.where(
                ended.reshape(ended.shape + (1,) * (values.ndim - ended.ndim)), values, np.nan
            )
        run = simulate(self.system, x0, self.t_end, **self._given(p))
        if run.status not in _ENDS:
            raise DegenerateError(
                f"run ended with {run.status} at t = {run.t[-1]:.6g}: {run.message}"
            )
        values = run.x[-1] if self.t_eval is None else run.sample_x
        assert values is not None
        return values

    def pulled(self, x0: Array, p: Array, rows: Array) -> tuple[Array, Array]:
        """Products of rows of the shape of the values with their derivatives; zero where rows are."""
        by_start, by_parameters = np.zeros(x0.shape), np.zeros(p.shape)
        for i in np.ndindex(x0.shape[:-1]):
            if not np.any(rows[i]):
                continue
            keep = {name: v for name, v in self._given(p[i]).items() if name != "work"}
            run = simulate(self.system, x0[i], self.t_end, **keep)
            if self.many and not (run.status in _ENDS and np.all(np.isfinite(rows[i]))):
                by_start[i] = by_parameters[i] = math.nan
                continue
            end, samples = (rows[i], None) if self.t_eval is None else (None, rows[i])
            by_start[i], by_parameters[i] = vjp(run, end, samples=samples)
        return by_start, by_parameters

    def _given(self, p: Array) -> dict[str, Any]:
        values = p.tolist() if p.ndim == 1 else np.moveaxis(p, -1, 0)
        named = dict(zip(self.system.parameter_names, values, strict=True))
        return {**self.options, "t_eval": self.t_eval, "parameters": named}


def parameters_of(
    system: FilippovSystem,
    given: Any,
    stack: Callable[[list[Any]], Any],
    array: Callable[[Any], Any],
) -> Any:
    """Parameters (..., q) in the order of ``parameter_names``, from a mapping of names or an array."""
    names = system.parameter_names
    if given is not None and not isinstance(given, Mapping):
        return array(given)
    values = {
        **system.definition.defaults,
        **{str(name): value for name, value in (given or {}).items()},
    }
    for name, value in values.items():
        if name not in names or value is None:
            raise ParameterError(
                f"parameters: {name!r} "
                + ("has no value." if name in names else "is unknown.")
                + f" The parameters are {list(names)}. Give a mapping from their names to numbers or arrays."
            )
    return stack([array(values[name]) for name in names])
