"""Maps of outcomes: itineraries and lift-offs over any two inputs or parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..contact.model import ContactModel
from ..errors import LandingError, ModelError
from ..parameters import Parametrised, number, numbers
from ..shot.state import INPUTS
from .lift_offs import lift_off
from .results import LiftOffs

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class OutcomeMap(ns.result_tables.Tabular):
    """Outcomes over a rectangle of two inputs or parameters.

    The first name varies along the last axis (horizontal in a picture), the second along the first.

    Attributes
    ----------
    model : ContactModel or BounceLaw
        The surface, or a law in closed form.
    names : (str, str)
        Names of the two that vary.
    axes : (ndarray (m,), ndarray (n,))
        Values of the two.
    fixed : dict
        The other inputs, and parameters that were changed.
    lift_offs : LiftOffs
        Arrays (n, m).
    spin : ndarray
        At touch-down, of a shape that broadcasts to (n, m).
    extrapolated : ndarray of bool (n, m) or None
        Which landings are outside those that a law was fitted to; None where that is not known.
    """

    model: Parametrised
    names: tuple[str, str]
    axes: tuple[Array, Array]
    fixed: dict[str, float]
    lift_offs: LiftOffs
    spin: Array
    extrapolated: NDArray[np.bool_] | None = None

    def _tables(self) -> dict[str, ns.result_tables.ResultTable]:
        axes = dict(zip(reversed(self.names), reversed(self.axes), strict=True))
        return {"lift_offs": self.lift_offs._over(axes)}

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
        """Slip $H_F$ at lift-off, (n, m); below zero is reverse slip."""
        return self.lift_offs.slip

    @property
    def spin_reversal(self) -> NDArray[np.bool_]:
        """Whether the spin at lift-off has the other sign than at touch-down, (n, m)."""
        return np.asarray(self.lift_offs.omega * self.spin < 0)

    @property
    def lift_off_angle(self) -> Array:
        """Angle of the velocity at lift-off above the direction of +x, (n, m), rad.

        Above $pi/2$ the ball goes to negative x.
        """
        return np.arctan2(self.lift_offs.ydot, self.lift_offs.xdot)

    def share(self) -> dict[str, float]:
        """Fraction of the map in each region."""
        counts = np.bincount(self.code[self.code >= 0], minlength=len(self.regions))
        return dict(zip(self.regions, (counts / self.code.size).tolist(), strict=True))

    def __repr__(self) -> str:
        size = " x ".join(str(len(a)) for a in self.axes)
        return f"OutcomeMap({' x '.join(self.names)}, {size}; regions {', '.join(self.regions)})"


def region_name(itinerary: str) -> str:
    """Name a region by its itinerary: "+ s -" is "S+ R S-"."""
    return " ".join({"+": "S+", "-": "S-", "s": "R"}.get(m, m) for m in itinerary.split())


def outcome_map(
    model: ContactModel,
    over: Mapping[str, ArrayLike],
    fixed: Mapping[str, float] | None = None,
    **options: Any,
) -> OutcomeMap:
    """Map itineraries and lift-offs of landings over any two inputs or parameters.

    Parameters
    ----------
    model : ContactModel
        The surface, with its friction.
    over : mapping
        Two names with their values, e.g. ``{"xdot": speeds, "omega": spins}`` or
        ``{"eta": ratios, "omega": spins}``; the first is horizontal.
    fixed : mapping, optional
        The other inputs (``ydot`` = -1, ``x`` = ``y`` = 0 unless given), and parameters.
    **options
        As :func:`lift_off` takes: ``tol``, ``work``, ...

    Returns
    -------
    OutcomeMap
        Itineraries and lift-offs over the grid.

    Raises
    ------
    nonsmooth.OptionError
        Not two names, a name that is neither input nor parameter, a missing or doubled one.
    LandingError, ModelError, nonsmooth.OptionError
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
    usual = {"ydot": -1.0, "x": 0.0, "y": 0.0}
    axes, others = checked_axes(over, fixed or {}, [*INPUTS, *model.values], INPUTS, usual)
    first, second = axes
    values: dict[str, Any] = {**others, first: axes[first], second: axes[second][:, None]}
    inputs = {name: values[name] for name in INPUTS}
    parameters = {name: v for name, v in values.items() if name not in INPUTS}
    result = lift_off(model, **inputs, parameters=parameters, **options)
    spin = np.asarray(values["omega"])
    return OutcomeMap(model, (first, second), (axes[first], axes[second]), others, result, spin)


def checked_axes(
    over: Mapping[str, ArrayLike],
    fixed: Mapping[str, float],
    known: Sequence[str],
    needed: Sequence[str],
    usual: Mapping[str, float] | None = None,
) -> tuple[dict[str, Array], dict[str, float]]:
    """Return the two axes of a map, and the other values, which may have defaults."""
    for what, given in dict(over=over, fixed=fixed).items():
        if not isinstance(given, Mapping):
            raise ns.OptionError(f"{what}: expected a dict of names, received {given!r}.")
    if len(over) != 2:
        raise ns.OptionError(f"over: expected two names, received {list(over)}.")
    unknown = [name for name in (*over, *fixed) if name not in known]
    if unknown:
        raise ns.OptionError(
            f"over, fixed: expected names among {list(known)}, received {unknown}."
        )
    doubled = sorted(set(over) & set(fixed))
    if doubled:
        raise ns.OptionError(f"over, fixed: expected each name once, received {doubled} in both.")
    axes = {name: numbers(values, name, LandingError) for name, values in over.items()}
    for name, values in axes.items():
        if values.ndim != 1 or values.size == 0:
            raise ns.OptionError(f"over: {name}: expected a list, received shape {values.shape}.")
        if not np.all(np.isfinite(values)):
            raise ns.OptionError(f"over: {name}: expected finite numbers, received {values}.")
    others = {**(usual or {}), **{k: number(v, f"fixed: {k}") for k, v in fixed.items()}}
    others = {name: v for name, v in others.items() if name not in axes}
    missing = [name for name in needed if name not in axes and name not in others]
    if missing:
        raise ns.OptionError(
            f"fixed: expected values for {missing}, received none, e.g. fixed={{{missing[0]!r}: 0}}."
        )
    return axes, others
