"""Contact models: the surface on which a ball bounces, in the plane and in 3-D."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

import casadi as ca

import nonsmooth as ns

from ..errors import ModelError
from ..parameters import LIMITS, Names, Parametrised, number
from .equations import Equations, equations
from .friction import Coulomb, FrictionLaw

Expression = Any
LoadConvention = Literal["contact", "net"]

#: Gravity that changes no bounce of unit speed: a power law's load reaches it within 1e-13 of y = 0.
NO_GRAVITY = 1e-20

#: Options of the contact in 3-D: their limit and their default.
_OPTIONS: dict[str, tuple[str, float | None]] = {
    "side_slope": ("in (-pi/2, pi/2)", 0.0),
    "friction_ratio": ("in (0, 1]", None),
    "grain": ("", None),
    "drilling_radius": ("> 0", None),
}


class ContactModel(Parametrised, ABC):
    """A surface, defined by a normal and a tangential force.

    A ball of unit radius and mass moves with centre (x, y), $y = 0$ at touch-down and negative in the
    ground, and spin $omega$:

    $$
    x'' = tangential_force + Lambda_T - G sin(slope)
    y'' = normal_force - G cos(slope)
    omega' = Lambda_T / inertia
    Lambda_T = -lambda mu load, lambda in Sgn(H), H = x' + omega
    $$

    To write a contact model, derive a class and provide

    1. ``parameters``: a dict of names and defaults; None means that the user must give it. Always
       there: ``mu`` (no default), ``G`` = 0 (scaled gravity), ``inertia`` = 2/5 (the moment of inertia over $m R^2$)
       and ``slope`` = 0 (rad, uphill for positive x; axes along and normal to the ground).
    2. ``normal_force(s, p)``: the surface's force on the ball, positive in compression, as a smooth
       CasADi expression of the states ``s.x, s.xdot, s.y, s.ydot, s.omega`` and parameters
       ``p.mu, ...``.
    3. ``tangential_force(s, p)``: the surface's other force along x, besides friction.

    and, if needed,

    4. ``limits``: names and what holds for their values, such as ``"> 0"``, ``">= 0"`` or
       ``"in (0, 1]"``; values outside are refused.
    5. ``extra_states`` (names and values at touch-down) and ``extra_rates(s, p)`` (names and rates) for
       internal states such as a Maxwell element; they appear as ``s.name``.
    6. ``load(s, p)``: what ``mu`` multiplies; its first downward zero is lift-off. By default the
       normal force, or for ``load="net"`` the normal force less gravity, as in the paper. A surface
       that also pulls (adhesion) needs a load and a ``lift_off`` that last until adhesion ends.
    7. ``lift_off(s, p)``: a function with the sign of the load that falls through zero with a
       nonzero rate, where the load itself does not (a power law that ends at $y = 0$).
    8. ``friction_coefficient(s, p)``: by default that of ``friction``; may use the slip speed
       ``s.slip``, which is not negative.
    9. ``stored_energy(s, p)``: elastic energy, for the energy balance of a shot.

    Parameters
    ----------
    load : {"contact", "net"}
        What multiplies ``mu`` and ends the contact: the force of the surface (physical), or that
        less gravity (Biber et al. 2022, eq. for $Lambda_N$, where gravity counts twice).
    friction : FrictionLaw
        Coulomb's by default.
    **values : float
        Parameters by name.

    Raises
    ------
    nonsmooth.ParameterError
        Unknown or missing name, not a finite number, outside its limit.
    ModelError
        A force that is not a scalar expression of the declared names.

    Examples
    --------
    >>> import bounce
    >>> class Spring(bounce.ContactModel):
    ...     parameters = dict(mu=0.3, stiffness=4.0)
    ...     limits = dict(stiffness="> 0")
    ...     def normal_force(self, s, p):
    ...         return -p.stiffness * s.y
    ...     def tangential_force(self, s, p):
    ...         return 0
    >>> shot = bounce.simulate(Spring(), xdot=1.0, ydot=-1.0, omega=0.2)
    >>> f"{shot.time:.10f}", shot.itinerary  # pi/2; without a tangential force it continues rolling
    ('1.5707963268', '+ s')
    """

    parameters: ClassVar[Mapping[str, float | None]] = dict(
        mu=None, G=0.0, inertia=2 / 5, slope=0.0
    )
    limits: ClassVar[Mapping[str, str]] = dict(
        mu=">= 0", G=">= 0", inertia="in (0, 1]", slope="in (-pi/2, pi/2)"
    )
    extra_states: ClassVar[Mapping[str, float]] = {}
    #: Those of ``extra_states`` that have a component along each direction of the ground in 3-D.
    vector_states: ClassVar[tuple[str, ...]] = ()

    convention: LoadConvention
    friction: FrictionLaw

    def __init__(
        self,
        *,
        load: LoadConvention = "contact",
        friction: FrictionLaw | None = None,
        **values: float,
    ):
        who = type(self).__name__
        if load not in ("contact", "net"):
            raise ModelError(
                f"{who}: load: expected 'contact' (the surface's force) or 'net' (less gravity, the "
                f"paper's), received {load!r}."
            )
        law = Coulomb() if friction is None else friction
        if not isinstance(law, FrictionLaw):
            raise ModelError(
                f"{who}: friction: expected a FrictionLaw such as bounce.contact.Coulomb(), received {law!r}."
            )
        self._set("convention", load)
        self._set("friction", law)
        names = {**self.declared(), **law.declared()}
        self._set("values", self._checked(names, {**law.values, **values}))

    # what a model provides ---------------------------------------------------------------------

    @abstractmethod
    def normal_force(self, s: Names, p: Names) -> Expression:
        """Return the surface's force along y, positive in compression.

        Parameters
        ----------
        s : namespace
            Symbols of the states: ``s.x``, ``s.xdot``, ``s.y``, ``s.ydot``, ``s.omega``, extra states.
        p : namespace
            Symbols of the parameters by name.

        Returns
        -------
        expression
            The force, in units of the model.
        """

    @abstractmethod
    def tangential_force(self, s: Names, p: Names) -> Expression:
        """Return the surface's force along x besides friction.

        Parameters
        ----------
        s, p : namespace
            As for :meth:`normal_force`.

        Returns
        -------
        expression
            The force, in units of the model.
        """

    def load(self, s: Names, p: Names) -> Expression:
        """Return what ``mu`` multiplies; lift-off is its first downward zero.

        Parameters
        ----------
        s, p : namespace
            As for :meth:`normal_force`.
        """
        force = self.normal_force(s, p)
        return force - p.G * ca.cos(p.slope) if self.convention == "net" else force

    def lift_off(self, s: Names, p: Names) -> Expression:
        """Return a function of the load's sign that crosses zero at lift-off.

        Parameters
        ----------
        s, p : namespace
            As for :meth:`normal_force`.
        """
        return self.load(s, p)

    def friction_coefficient(self, s: Names, p: Names) -> Expression:
        """Return the friction coefficient at slip speed ``s.slip``.

        Parameters
        ----------
        s, p : namespace
            As for :meth:`normal_force`, with ``s.slip``.
        """
        return self.friction.coefficient(s, p)

    def extra_rates(self, s: Names, p: Names) -> dict[str, Expression]:
        """Return the rates of ``extra_states``.

        Parameters
        ----------
        s, p : namespace
            As for :meth:`normal_force`.

        Returns
        -------
        dict of str to expression
            A rate for each extra state.
        """
        return {}

    def stored_energy(self, s: Names, p: Names) -> Expression | None:
        """Return the elastic energy of the surface, or None where a model defines none.

        Parameters
        ----------
        s, p : namespace
            As for :meth:`normal_force`.
        """
        return None

    def limits_of_values(self) -> dict[str, str]:
        """Every limit of its values, those of the friction law included, which may be stricter."""
        return {**self.declared_limits(), **self.friction.declared_limits()}

    # what follows from it ----------------------------------------------------------------------

    def system(self) -> ns.FilippovSystem:
        """Build the Filippov system of the contact, with this model's values as defaults.

        States ``x, xdot, y, ydot, omega`` and the extra ones; surface ``xdot + omega``, the slip; stop
        ``"lift-off"``.

        Returns
        -------
        nonsmooth.FilippovSystem
            The equations of motion, for everything that ``nonsmooth`` does.

        Examples
        --------
        >>> import bounce
        >>> bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5).system()
        FilippovSystem(5 states: x, xdot, y, ydot, omega; 1 surface; parameters: ...
        """
        if "_cached_system" not in vars(self):
            blueprint = self.blueprint(weightless=False)  # its user may change G
            self._set("_cached_system", equations(blueprint).build(self.values))
        system: ns.FilippovSystem = vars(self)["_cached_system"]
        return system

    def blueprint(self, weightless: bool | None = None) -> Self:
        """Return the same kind of model with default values.

        Models that differ in their numbers only have equal blueprints, so equations and compiled code
        are built once for all of them. Without gravity the two load conventions coincide, and "contact"
        is taken for both, since its lift-off function is regular where a power law ends.

        Parameters
        ----------
        weightless : bool, optional
            Whether it is one without gravity; by default, whether ``G`` is zero.

        Returns
        -------
        ContactModel
            The model with its default values.
        """
        copy = object.__new__(type(self))
        for name, value in vars(self).items():
            if not name.startswith("_cached"):
                copy._set(name, value)
        if self.values["G"] <= NO_GRAVITY if weightless is None else weightless:
            copy._set("convention", "contact")
        law = object.__new__(type(self.friction))
        law.__setstate__({**vars(self.friction), "values": {}})
        copy._set("friction", law)
        copy._set("values", dict.fromkeys(self.values, 0.0))
        return copy

    def derived(self) -> Equations:
        """Return its equations of motion in the plane; :func:`equations` keeps those of blueprints."""
        return Equations(self, self.values, 1)

    def in_3d(
        self,
        *,
        side_slope: float = 0.0,
        friction_ratio: float | None = None,
        grain: float | None = None,
        drilling_radius: float | None = None,
    ) -> Contact3D:
        """Return the surface with both directions along the ground, for landings with side spin.

        Parameters
        ----------
        side_slope, friction_ratio, grain, drilling_radius : float, optional
            As :class:`Contact3D` takes them.

        Returns
        -------
        Contact3D
            The model with a second direction along the ground.

        Examples
        --------
        >>> import bounce
        >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
        >>> shot = bounce.simulate(turf.in_3d(), [1.0, 0.0], -1.0, [0.2, 0.1])
        >>> shot.itinerary
        '* s *'
        """
        return Contact3D(
            self,
            side_slope=side_slope,
            friction_ratio=friction_ratio,
            grain=grain,
            drilling_radius=drilling_radius,
        )

    def _structure(self) -> tuple[Any, ...]:
        return (self.convention, self.friction._structure(), type(self.friction))

    def options(self) -> dict[str, Any]:
        options: dict[str, Any] = {}
        if self.convention != "contact":
            options["load"] = self.convention
        if type(self.friction) is not Coulomb:
            options["friction"] = self.friction
        return options

    def __repr__(self) -> str:
        text = super().__repr__()
        law = type(self.friction).__name__
        return text.replace(f"friction={self.friction!r}", f"friction={law}")


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
        A model whose forces are not vectors along the ground, or not isotropic.

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
                f"grain is {grain!r}, but friction is the same in all directions. Give friction_ratio too."
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
                f"{type(model).__name__}: its parameters {taken} are options of Contact3D too. Rename them."
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

    def derived(self) -> Equations:
        """Return its equations of motion; :func:`equations` keeps those of blueprints."""
        return Equations(self.model, self.values, 2)

    def blueprint(self, weightless: bool | None = None) -> Self:
        """Return the same kind of contact with default values, as :meth:`ContactModel.blueprint`.

        Parameters
        ----------
        weightless : bool, optional
            Whether it is one without gravity; by default, whether ``G`` is zero.
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
