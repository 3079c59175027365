"""The base of contact models: what a surface is, for a ball that lands on it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import casadi as ca

import nonsmooth as ns

from ..errors import ModelError
from ..parameters import Names, Parametrised
from .equations import Equations, equations
from .friction import Coulomb, FrictionLaw

if TYPE_CHECKING:
    from .space import Contact3D

Expression = Any
LoadConvention = Literal["contact", "net"]

#: Gravity that changes no bounce of unit speed: a power law's load reaches it within 1e-13 of y = 0.
NO_GRAVITY = 1e-20


class ContactModel(Parametrised, ABC):
    """A surface: two forces written once; equations, simulation and maps follow from them.

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
       that also pulls (adhesion) needs a load and a ``lift_off`` that last until it lets go.
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
    >>> f"{shot.time:.10f}", shot.itinerary  # pi/2, and it stays rolling: nothing is tangential
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
                f"{who}: friction: expected a FrictionLaw such as bounce.Coulomb(), received {law!r}."
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

        Models that differ in their numbers only have equal blueprints, so what is derived from the
        symbols (equations, jets, compiled code) is built once for all of them. Without gravity the
        two load conventions coincide, and "contact" serves both: it knows a power law's end.

        Parameters
        ----------
        weightless : bool, optional
            Whether to take it as one without gravity; by default what ``G`` says.

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
        return Equations(self)

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
        from .space import Contact3D

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
