"""A textbook problem and its reference values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..flow import Trajectory, simulate
from ..local.read_only import ReadOnly
from ..model import Array, FilippovSystem, OptionError

#: Values are compared to nine digits, or to their own if they have fewer.
RELATIVE = 1e-9


def _nothing() -> Mapping[str, float]:
    return ReadOnly({})


@dataclass(frozen=True, eq=False)
class Reference:
    """A known number of a problem.

    Attributes
    ----------
    quantity : str
        Unique within its problem.
    value : float or tuple of float
        The reference solution, known independently of this library.
    tolerance : float
        Largest error relative to each value; absolute where the value is 0.
    how : str
        How to compute it and what to compare.
    at : mapping
        Parameters or states of the start, by name, that replace those of the problem.
    """

    quantity: str
    value: float | tuple[float, ...]
    tolerance: float
    how: str
    at: Mapping[str, float] = field(default_factory=_nothing)

    def error(self, computed: ArrayLike) -> float:
        """Return the largest relative error of a computed value (absolute where the value is 0).

        Parameters
        ----------
        computed : float or array_like
            The value to compare with the answer.

        Examples
        --------
        >>> Reference("period", 2.0, 1e-9, "time between crossings").error(2.1)
        0.050000000000000044
        """
        known = np.atleast_1d(np.asarray(self.value, dtype=float))
        found = np.atleast_1d(np.asarray(computed, dtype=float))
        if found.shape != known.shape:
            raise OptionError(
                f"{self.quantity}: expected shape {known.shape}, received shape {found.shape}. "
                "Compare like with like; `how` says what the value is."
            )
        scale = np.where(known == 0.0, 1.0, np.abs(known))
        return float(np.max(np.abs(found - known) / scale))

    def agrees(self, computed: ArrayLike) -> bool:
        """Whether a computed value is within the tolerance.

        Parameters
        ----------
        computed : float or array_like
            The value to compare with the answer.

        Examples
        --------
        >>> Reference("period", 2.0, 1e-9, "time between crossings").agrees(2 + 1e-10)
        True
        """
        return self.error(computed) <= self.tolerance

    def __str__(self) -> str:
        values = self.value if isinstance(self.value, tuple) else (self.value,)
        numbers = ", ".join(f"{v:.16g}" for v in values)
        where = "".join(f", {name} = {value:g}" for name, value in self.at.items())
        return f"{self.quantity}{where}: {numbers} (to {self.tolerance:.0e}; {self.how})"


def stated(
    quantity: str, how: str, *digits: str, at: Mapping[str, float] | None = None
) -> Reference:
    """Reference from decimal digits; the tolerance is 1e-9, or wider for few digits."""
    numbers = [Decimal(d) for d in digits]
    tolerance = RELATIVE
    for text, number in zip(digits, numbers, strict=True):
        exponent = number.as_tuple().exponent
        if number and "." in text and isinstance(exponent, int):
            if len(number.as_tuple().digits) > 6:  # short ones, such as 1.4, are exact
                tolerance = max(tolerance, float(Decimal((0, (5,), exponent - 1)) / abs(number)))
    values = tuple(float(n) for n in numbers)
    return Reference(
        quantity,
        values[0] if len(values) == 1 else values,
        tolerance,
        how,
        ReadOnly(dict(at or {})),
    )


@dataclass(frozen=True, eq=False)
class Problem:
    """A named system with a start and its known answers.

    Attributes
    ----------
    name : str
        Of the function that makes it.
    title : str
        A short description.
    source : str
        Where it comes from.
    system : FilippovSystem
        The system, with its default parameters.
    parameters : mapping
        Names and values; the defaults of the system.
    start : tuple of float
        Where its standard run starts.
    t_end : float
        When its standard run ends.
    references : tuple of Reference
        Values known independently of this library.
    note : str
        A remark, e.g. on parameters quoted from memory.
    """

    name: str
    title: str
    source: str
    system: FilippovSystem
    parameters: Mapping[str, float]
    start: tuple[float, ...]
    t_end: float
    references: tuple[Reference, ...]
    note: str = ""

    def __getitem__(self, quantity: str) -> Reference:
        """Return the reference of a quantity."""
        for reference in self.references:
            if reference.quantity == quantity:
                return reference
        raise KeyError(f"{quantity!r}: {self.name} has {[r.quantity for r in self.references]}")

    def start_at(self, values: Mapping[str, float]) -> tuple[Array, dict[str, float]]:
        """Return start (n,) and parameters with some of them, or of the states, replaced.

        Parameters
        ----------
        values : mapping
            Names of parameters or states, as in ``Reference.at``.
        """
        x, p = np.array(self.start, dtype=float), dict(self.parameters)
        for name, value in values.items():
            if name in self.system.state_names:
                x[self.system.state_names.index(name)] = value
            else:
                p[name] = float(value)
        return x, p

    def run(
        self, at: Mapping[str, float] | None = None, *, t_end: float | None = None, **options: Any
    ) -> Trajectory:
        """Simulate the problem from its start.

        Parameters
        ----------
        at : mapping, optional
            Parameters or states that replace the problem's.
        t_end : float, optional
            When the run ends; default the problem's.
        **options
            As in :func:`nonsmooth.simulate`.

        Returns
        -------
        Trajectory
            From ``start`` to ``t_end``, with what ``at`` replaces.
        """
        x, p = self.start_at(at or {})
        end = self.t_end if t_end is None else t_end
        return simulate(self.system, x, end, parameters=p, **options)

    def __str__(self) -> str:
        lines = [f"{self.name}: {self.title}", f"  source: {self.source}", f"  {self.system!r}"]
        if self.parameters:
            text = ", ".join(f"{n} = {v:.12g}" for n, v in self.parameters.items())
            lines.append(f"  parameters: {text}")
        names = zip(self.system.state_names, self.start, strict=True)
        start = ", ".join(f"{n} = {v:.12g}" for n, v in names)
        lines.append(f"  start: {start}; until t = {self.t_end:g}")
        if self.note:
            lines.append(f"  note: {self.note}")
        return "\n".join(lines + [f"  - {r}" for r in self.references])


def problem(
    function: Callable[..., Problem],
    system: FilippovSystem,
    start: tuple[float, ...],
    t_end: float,
    *references: Reference,
    title: str,
    note: str = "",
) -> Problem:
    """Build the problem of a function, whose docstring has the source; parameters are the system's."""
    source = " ".join(
        (function.__doc__ or "").partition("Source: ")[2].partition("\n\n")[0].split()
    )
    values = system.parameter_vector().tolist()
    parameters = ReadOnly(dict(zip(system.parameter_names, values, strict=True)))
    return Problem(
        function.__name__, title, source, system, parameters, start, t_end, references, note
    )
