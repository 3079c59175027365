"""The result of a fit: values, standard errors, intervals and residuals."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..ground import Model
from .least_squares import Start
from .measurements import Measurements, listed
from .profile import Profile

Array = NDArray[np.float64]

#: A parameter is undetermined if half its interval exceeds this many times its value.
_WIDE = 3.0


class IdentifiabilityWarning(UserWarning):
    """The data of a fit do not determine a parameter, or its interval is too narrow."""


@dataclass(frozen=True, repr=False)
class FitResult(ns.result_tables.Tabular):
    """Fitted parameters and what they leave.

    Attributes
    ----------
    model : BounceLaw or ContactModel
        With the fitted values.
    values, errors : dict of str to float
        Fitted values and their standard errors (infinite where the data do not determine one).
    covariance : ndarray (k, k)
        Covariance of the fitted values, in their order.
    residuals : dict of str to ndarray (n,)
        Predicted less measured, for each component measured; m/s, spins as surface speeds (without
        units: in the model's).
    measurements : Measurements
        What was fitted; ``measurements.left_out`` names what was not.
    degrees_of_freedom : int
        Numbers measured less parameters fitted.
    starts : tuple of Start
        The starts of the search, the best first.
    at_bound : tuple of str
        Parameters that ended on a bound; errors and intervals assume that they do not.
    condition : float
        Condition number of the derivatives by relative changes of the parameters: large where a
        combination of them hardly has an effect on what was measured.
    message : str
        Why the least squares stopped.
    narrow : tuple of str
        Parameters whose 95 % interval ends where the sum of squares has hardly risen: it is too
        narrow, and :meth:`profile` has one that is not.
    search : Profile
        The search that :meth:`profile` continues with.
    """

    model: Model
    values: dict[str, float]
    errors: dict[str, float]
    covariance: Array
    residuals: dict[str, Array]
    measurements: Measurements
    degrees_of_freedom: int
    starts: tuple[Start, ...]
    at_bound: tuple[str, ...]
    condition: float
    message: str
    narrow: tuple[str, ...] = ()
    search: Profile | None = field(default=None, compare=False)

    def _tables(self) -> dict[str, ns.result_tables.ResultTable]:
        low, high = zip(*self.interval().values(), strict=True)
        columns = {"value": [*self.values.values()], "error": [*self.errors.values()]}
        fitted = {"parameter": [*self.values]}
        rows = {"row": self.measurements.rows}
        return {
            "parameters": ns.result_tables.ResultTable(
                fitted, columns | {"low": low, "high": high}
            ),
            "residuals": ns.result_tables.ResultTable(rows, self.residuals),
        }

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Parameters that the data do not determine.

        Their 95 % interval reaches further than three times the larger of the fitted value and the
        one started from.
        """
        wide = []
        for name, (low, high) in self.interval().items():
            size = max(abs(self.values[name]), abs(self.starts[0].values[name]))
            if not 0.5 * (high - low) <= _WIDE * size and high > low:
                wide.append(name)
        return tuple(wide)

    @property
    def rms(self) -> dict[str, float]:
        """Root mean square residual of each component."""
        return {n: float(np.sqrt(np.mean(r**2))) for n, r in self.residuals.items()}

    def interval(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Return confidence intervals: Student's t about the linearised fit.

        Parameters
        ----------
        level : float, optional
            Probability that the interval contains the value, in (0, 1).

        Returns
        -------
        dict of str to (float, float)
            Lower and upper end by name.

        Raises
        ------
        nonsmooth.OptionError
            A level outside (0, 1).
        """
        width = self.width(level)
        return {
            n: (v - width * self.errors[n], v + width * self.errors[n])
            for n, v in self.values.items()
        }

    def profile(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Return confidence intervals from the sum of squares itself, the other parameters refitted.

        They reach as far as the data allow, also where the sum of squares is no parabola: friction
        in bounces that mostly roll, for example, has no upper end. Slower than :meth:`interval`.

        Parameters
        ----------
        level : float, optional
            Probability that the interval contains the value, in (0, 1).

        Returns
        -------
        dict of str to (float, float)
            Lower and upper end by name; a bound, or infinite, where the data give none.

        Raises
        ------
        nonsmooth.OptionError
            A level outside (0, 1), or a result that was not made by :func:`fit`.
        """
        width = self.width(level)
        if self.search is None:
            raise ns.OptionError(
                "profile: this result has no search. Use one that bounce.golf.fit returned."
            )
        return {name: self.search.interval(k, width) for k, name in enumerate(self.values)}

    def width(self, level: float) -> float:
        """Return half an interval in standard errors, by Student's t.

        Parameters
        ----------
        level : float
            Probability that the interval contains the value, in (0, 1).

        Returns
        -------
        float
            Half the interval over the standard error.

        Raises
        ------
        nonsmooth.OptionError
            A level outside (0, 1).
        """
        from scipy.stats import t

        if not 0.0 < level < 1.0:
            raise ns.OptionError(f"level: expected a number in (0, 1), received {level!r}.")
        return float(t.ppf((1 + level) / 2, self.degrees_of_freedom))

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers as plain Python, for JSON; None is infinite."""
        return dict(
            model=type(self.model).__name__,
            values=self.values,
            errors={n: _finite(v) for n, v in self.errors.items()},
            interval_95={n: [_finite(v) for v in pair] for n, pair in self.interval().items()},
            rms=self.rms,
            bounces=len(self.measurements.rows),
            left_out=[list(pair) for pair in self.measurements.left_out],
            at_bound=list(self.at_bound),
            undetermined=list(self.undetermined),
            narrow=list(self.narrow),
            condition=_finite(self.condition),
            message=self.message,
        )

    def __repr__(self) -> str:
        lines = [f"{type(self.model).__name__} fitted to {len(self.measurements.rows)} bounces"]
        for name, (low, high) in self.interval().items():
            note = "  (on its bound)" if name in self.at_bound else ""
            if name in self.undetermined:
                note += "  (not determined by these data)"
            elif name in self.narrow:
                note += "  (too narrow: see profile)"
            lines.append(
                f"  {name} = {self.values[name]:.6g}  95 % in [{low:.6g}, {high:.6g}]{note}"
            )
        rms = ", ".join(f"{n} {v:.3g}" for n, v in self.rms.items())
        lines.append(f"  rms residuals: {rms}{' m/s' if self.measurements.si else ''}")
        if self.measurements.left_out:
            lines.append(f"  left out: {listed(dict(self.measurements.left_out))}")
        return "\n".join(lines)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
