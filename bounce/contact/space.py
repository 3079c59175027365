"""A contact model in 3-D: both directions along the ground, side spin, drilling, grain."""

from __future__ import annotations

from typing import Any, Self

import nonsmooth as ns

from ..errors import ModelError
from ..parameters import LIMITS, Parametrised, number
from .equations import equations
from .model import ContactModel
from .space_equations import SpaceEquations

#: Options of the contact in 3-D: what they may be, and their default.
_OPTIONS: dict[str, tuple[str, float | None]] = {
    "side_slope": ("in (-pi/2, pi/2)", 0.0),
    "friction_ratio": ("in (0, 1]", None),
    "grain": ("", None),
    "drilling_radius": ("> 0", None),
}


class Contact3D(Parametrised):
    """A contact model for landings with side spin; ``model.in_3d()`` makes one.

    The ground's axes are x (forward), y (up) and z (to the right). With the tangential position
    $X = (x, z)$ and the spin's part of the contact point's velocity $W = (omega_z, -omega_x)$,

    $$
    X'' = tangential_force + F - G (sin(slope), sin(side_slope))
    W' = F / inertia, h = X' + W
    F = -mu load lambda, lambda = h/|h| off h = 0, |lambda| <= 1 on it
    $$

    This is Coulomb friction in the plane. A model's forces are called with vectors ``s.x``, ``s.xdot`` and
    ``s.omega`` of two components, and ``s.slip`` is $|h|$.

    Parameters
    ----------
    model : ContactModel
        The surface, with its slope uphill forward.
    side_slope : float, optional
        Uphill to the right, rad, across the line of the slope.
    friction_ratio : float, optional
        Elliptical friction: the coefficient across the grain over that along it, in (0, 1]. The force
        is that of maximal dissipation, $-mu load E^2 h/|E h|$, where E multiplies the component
        across the grain by the ratio.
    grain : float, optional
        Direction of the grain, rad from forward to the right; needs ``friction_ratio``.
    drilling_radius : float, optional
        Drilling friction: slip and spin $omega_y$ about the vertical share one multiplier of three
        components, $(h, r omega_y)$ with r the drilling radius, of which the third turns with moment
        $-mu load r lambda_3$ (ellipsoidal limit surface). About 2/3 of the contact's radius, in radii
        of the ball.

    Raises
    ------
    nonsmooth.ParameterError
        A slope, ratio or radius outside its limits; a ``grain`` without a ``friction_ratio``.
    ModelError
        A model whose forces are no vectors along the ground, or favour a direction.

    Examples
    --------
    >>> import bounce
    >>> bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5).in_3d(side_slope=0.1)
    Contact3D(KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5), side_slope=0.1)
    """

    model: ContactModel

    def __init__(
        self,
        model: ContactModel,
        *,
        side_slope: float = 0.0,
        friction_ratio: float | None = None,
        grain: float | None = None,
        drilling_radius: float | None = None,
    ):
        if not isinstance(model, ContactModel):
            raise ModelError(f"model: expected a ContactModel, received {model!r}.")
        if grain is not None and friction_ratio is None:
            raise ns.ParameterError(
                f"grain: expected with friction_ratio=, received {grain!r} alone. Friction that is the "
                "same in all directions has no grain."
            )
        if friction_ratio is not None and grain is None:
            grain = 0.0
        given = dict(
            side_slope=side_slope,
            friction_ratio=friction_ratio,
            grain=grain,
            drilling_radius=drilling_radius,
        )
        taken = sorted(set(model.values) & set(given))
        if taken:
            raise ModelError(
                f"{type(model).__name__}: expected parameters other than {list(given)}, received {taken}."
            )
        self._set("model", model)
        own = {name: _checked(name, v) for name, v in given.items() if v is not None}
        self._set("values", {**model.values, **own})

    @property
    def convention(self) -> str:
        """What the load is: that of the model."""
        return self.model.convention

    @property
    def drilling(self) -> bool:
        """Whether friction resists the spin about the vertical too."""
        return "drilling_radius" in self.values

    @property
    def isotropic(self) -> bool:
        """Whether no direction along the ground differs from another."""
        flat = self.values["slope"] == 0.0 == self.values["side_slope"]
        return flat and self.values.get("friction_ratio", 1.0) == 1.0

    def limits_of_values(self) -> dict[str, str]:
        """Every limit of its values."""
        own = {
            name: limit for name, (limit, _) in _OPTIONS.items() if limit and name in self.values
        }
        return {**self.model.limits_of_values(), **own}

    def derived(self) -> SpaceEquations:
        """Return its equations of motion; :func:`equations` keeps those of blueprints."""
        return SpaceEquations(self.model, tuple(self.values))

    def blueprint(self, weightless: bool | None = None) -> Self:
        """Return the same kind of contact with default values, as :meth:`ContactModel.blueprint`.

        Parameters
        ----------
        weightless : bool, optional
            Whether to take it as one without gravity; by default what ``G`` says.
        """
        copy = object.__new__(type(self))
        copy._set("model", self.model.blueprint(weightless))
        copy._set("values", dict.fromkeys(self.values, 0.0))
        return copy

    def system(self) -> ns.FilippovSystem:
        """Build the Filippov system of the contact, with these values as defaults.

        States (x, xdot, y, ydot, z, zdot, slip_x, slip_z; spin about the vertical with drilling;
        extra states); one set, where the slip is zero, of codimension two or three; stop ``"lift-off"``.

        Returns
        -------
        nonsmooth.FilippovSystem
            The equations of motion, for everything that ``nonsmooth`` does.
        """
        return equations(self.blueprint(weightless=False)).build(self.values)

    def replace(self, **changes: Any) -> Self:
        """Return a copy with other parameters, of the model or of these.

        Parameters
        ----------
        **changes : float
            New values by name.

        Examples
        --------
        >>> import bounce
        >>> turf = bounce.NormalKelvinVoigt(mu=0.3, d2=0.1).in_3d()
        >>> turf.replace(mu=0.4, side_slope=0.05)
        Contact3D(NormalKelvinVoigt(mu=0.4, d2=0.1), side_slope=0.05)
        """
        own = {n: changes.pop(n) for n in list(changes) if n in _OPTIONS}
        model = self.model.replace(**changes) if changes else self.model
        return type(self)(model, **{**self._own(), **own})

    def _own(self) -> dict[str, Any]:
        return {name: self.values[name] for name in _OPTIONS if name in self.values}

    def _structure(self) -> tuple[Any, ...]:
        return (type(self.model), self.model._structure(), tuple(self.values))

    def __repr__(self) -> str:
        shown = [f", {n}={v:.6g}" for n, v in self._own().items() if v != _OPTIONS[n][1]]
        return f"Contact3D({self.model!r}{''.join(shown)})"


def _checked(name: str, value: float) -> float:
    limit, result = _OPTIONS[name][0], number(value, name)
    if limit and not LIMITS[limit](result):
        raise ns.ParameterError(f"{name}: expected a number {limit}, received {value!r}.")
    return result
