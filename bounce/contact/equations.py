"""The equations of motion of a ball on a contact model, built once per kind of model."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any, ClassVar, Protocol

import casadi as ca

import nonsmooth as ns

from ..errors import ModelError
from ..parameters import Names, number
from .friction import FrictionLaw

#: The ball's own states, in the paper's order p = [X, X', Y, Y', Omega].
STATES = ("x", "xdot", "y", "ydot", "omega")


class Surface(Protocol):
    """What the equations ask of a contact model; ``ContactModel`` says what each thing means."""

    extra_states: ClassVar[Mapping[str, float]]
    vector_states: ClassVar[tuple[str, ...]]
    values: dict[str, float]
    friction: FrictionLaw

    def normal_force(self, s: Names, p: Names) -> Any: ...

    def tangential_force(self, s: Names, p: Names) -> Any: ...

    def load(self, s: Names, p: Names) -> Any: ...

    def lift_off(self, s: Names, p: Names) -> Any: ...

    def friction_coefficient(self, s: Names, p: Names) -> Any: ...

    def extra_rates(self, s: Names, p: Names) -> Any: ...

    def stored_energy(self, s: Names, p: Names) -> Any: ...


class Blueprint(Protocol):
    """What equations of motion are derived from: a contact model, in the plane or in 3-D."""

    values: dict[str, float]

    def derived(self) -> Equations: ...

    def __hash__(self) -> int: ...


class Equations:
    """Symbols, forces and fields of one blueprint.

    Attributes
    ----------
    names : tuple of str
        States: the ball's five, then the model's, then the friction law's.
    start : dict
        Values of the further states at touch-down.
    centre, velocity : tuple of int
        Which states are the place of the centre, and which are its rates.
    along_the_ground : frozenset of str
        The states of the motion along the ground and of the spin.
    steps_off_a_root : bool
        Whether a run cannot begin where the load is zero as a power is.
    """

    steps_off_a_root = False
    centre: tuple[int, ...] = (0, 2)
    velocity: tuple[int, ...] = (1, 3)
    along_the_ground = frozenset({"x", "xdot", "omega"})

    def __init__(self, model: Surface):
        self.model = model
        self._symbols(STATES, further_states(model), model.values)
        self.contact_speed = self.x["xdot"] + self.x["omega"]
        self._slip, self._sign = ca.SX.sym("slip"), ca.SX.sym("sign")
        self.s = Names("state", {**self.x, "slip": self._slip})
        self.q = Names("parameter", self.p)
        self._forces()

    def _symbols(
        self, own: tuple[str, ...], start: dict[str, float], parameters: Iterable[str]
    ) -> None:
        who = type(self.model).__name__
        self.start, self.names = start, (*own, *start)
        if len(set(self.names)) < len(self.names):
            raise ModelError(
                f"{who}: extra_states: expected names other than {own} and those of the friction law, "
                f"received {self.names}."
            )
        self.x = {name: ca.SX.sym(name) for name in self.names}
        self.p = {name: ca.SX.sym(name) for name in parameters}
        clash = sorted(set(self.x) & set(self.p))
        if clash:
            raise ModelError(
                f"{who}: expected states and parameters with different names, received {clash} as both."
            )

    def _forces(self) -> None:
        model, s, q = self.model, self.s, self.q
        self.normal = self._scalar("normal_force", model.normal_force(s, q))
        tangential = self._scalar("tangential_force", model.tangential_force(s, q))
        self.along = tangential - q.G * ca.sin(q.slope)
        self.load = self._scalar("load", model.load(s, q))
        self.lift_off = self._scalar("lift_off", model.lift_off(s, q))
        self._require_end()
        law = model.friction
        set_valued = type(law).traction is FrictionLaw.traction
        if set_valued:
            coefficient = self._scalar("friction_coefficient", model.friction_coefficient(s, q))
            traction = -self._sign * coefficient
        else:
            traction = self._scalar("traction", law.traction(s, q, self._sign))
        self.friction_force = traction * self.load
        rates = self._rates_of(list(self.start), self._sign)
        self.rates = [self._scalar(f"rate of {name}", rates[name]) for name in self.start]
        energy = model.stored_energy(s, q)
        self.stored = None if energy is None else self._scalar("stored_energy", energy)

    def _rates_of(self, names: list[str], direction: ca.SX) -> Mapping[str, Any]:
        """Rates of the further states, as the model and its friction law give them."""
        own = self.model.extra_rates(self.s, self.q)
        if isinstance(own, Mapping):
            own = {**own, **self.model.friction.extra_rates(self.s, self.q, direction)}
        if not isinstance(own, Mapping) or set(own) != set(names):
            received = list(own) if isinstance(own, Iterable) else repr(own)
            raise ModelError(
                f"{type(self.model).__name__}: extra_rates: expected a rate for each of {names}, "
                f"received {received}."
            )
        return own

    def _require_end(self) -> None:
        if not ca.depends_on(self.lift_off, ca.vertcat(*self.x.values())):
            raise ModelError(
                f"{type(self.model).__name__}: load: expected a function of the states, received "
                f"{self.lift_off}. A load that does not change never vanishes, so the ball never "
                "lifts off: normal_force must depend on s.y or s.ydot."
            )

    def _scalar(self, what: str, value: Any) -> ca.SX:
        try:
            result = ca.SX(value)
            if result.shape == (1, 1) and not has_nan(result):
                return ca.densify(result)
            received = f"shape {result.shape}" if result.shape != (1, 1) else f"{result}"
        except (TypeError, ValueError, NotImplementedError):
            received = f"{value!r} ({type(value).__name__})"
        raise ModelError(
            f"{type(self.model).__name__}.{what}: expected a scalar CasADi expression of the states "
            f"and parameters, received {received}. Is the `return` missing, or a function taken from "
            "math instead of casadi?"
        )

    # fields ------------------------------------------------------------------------------------

    def field(self, friction: ca.SX) -> list[ca.SX]:
        """Right-hand side for a tangential friction force."""
        s, q = self.s, self.q
        return [
            s.xdot,
            self.along + friction,
            s.ydot,
            self.normal - q.G * ca.cos(q.slope),
            friction / q.inertia,
            *self.rates,
        ]

    def side(self, sign: float) -> list[ca.SX]:
        """Right-hand side of forward (+1) or reverse (-1) slip."""
        old, new = [self._sign, self._slip], [ca.SX(sign), sign * self.contact_speed]
        return ca.substitute(self.field(self.friction_force), old, new)

    def build(
        self, defaults: Mapping[str, float] | None = None, further: Sequence[ns.Stop] = ()
    ) -> ns.FilippovSystem:
        """Return the Filippov system of the contact phase, with further stops."""
        definition: dict[str, Any]
        field = self.field(self.friction_force)
        if ca.depends_on(ca.vertcat(*field), self._slip):
            definition = dict(above=self.side(1.0), below=self.side(-1.0))
        else:
            definition = dict(field=field, multipliers=self._sign)
        return ns.FilippovSystem(
            list(self.x.values()),
            surface=self.contact_speed,
            parameters=self._defaults(defaults),
            stops=[*self._ends(), *further],
            **definition,
        )

    def _ends(self) -> list[ns.Stop]:
        """What ends the contact: the model's lift-off function, and the load itself.

        The friction that can hold a rolling ball vanishes with the load. Where its approximate zero
        comes a little before that of another function, this ends the contact, not the rolling.
        """
        ends = [ns.Stop(self.lift_off, -1, "lift-off")]
        if not ca.is_equal(self.lift_off, self.load, 10):
            ends.append(ns.Stop(self.load, -1, "no load"))
        return ends

    def build_free(self) -> ns.FilippovSystem:
        """Return the smooth system of the phase before the load is positive (no friction)."""
        return ns.FilippovSystem(
            list(self.x.values()),
            field=ca.substitute(
                self.field(ca.SX(0)), [self._sign, self._slip], [ca.SX(1), self.contact_speed]
            ),
            parameters=self._defaults(None),
            stops=[ns.Stop(self.lift_off, 1, "contact"), ns.Stop(self.s.y, 1, "surface")],
        )

    def _defaults(self, values: Mapping[str, float] | None) -> dict[ca.SX, float | None]:
        return {symbol: None if values is None else values[n] for n, symbol in self.p.items()}

    def inputs(self, expression: ca.SX) -> frozenset[str]:
        """Names of the states and parameters on which it depends along the motion without friction."""
        rates = dict(zip(self.names, self.field(ca.SX(0)), strict=True))
        rates["slip"] = self.contact_speed
        names: set[str] = set()
        new = {str(v) for v in ca.symvar(expression)}
        while new - names:
            names |= new
            new = {str(v) for n in names & set(rates) for v in ca.symvar(ca.SX(rates[n]))}
        return frozenset(names)

    # functions ---------------------------------------------------------------------------------

    def kinetic_along(self) -> ca.SX:
        """Kinetic energy per mass of the motion along the ground and of the spin."""
        return 0.5 * (self.s.xdot**2 + self.q.inertia * self.s.omega**2)

    def height(self) -> tuple[ca.SX, ca.SX]:
        """Scaled gravity times the height of the place along the ground, and over it."""
        return (
            self.q.G * ca.sin(self.q.slope) * self.s.x,
            self.q.G * ca.cos(self.q.slope) * self.s.y,
        )

    def energies(self) -> ca.Function:
        """Return (states, parameters) -> the two energies of :func:`energy_function`."""
        climbed, over = self.height()
        along, normal = self.kinetic_along() + climbed, 0.5 * self.s.ydot**2 + over
        apart = not self.inputs(self.normal) & self.along_the_ground
        return self.function([along + normal, normal if apart else along + normal])

    def function(self, outputs: list[ca.SX]) -> ca.Function:
        """Return the function (states, parameters) -> outputs."""
        x, p = ca.vertcat(*self.x.values()), ca.vertcat(*self.p.values())
        return ca.Function("outputs", [x, p], outputs)


def further_states(model: Surface) -> dict[str, float]:
    """Return the states of a model and its friction law besides the ball's, at touch-down."""
    who = type(model).__name__
    return {
        name: number(value, f"{who}: extra_states: {name}", ModelError)
        for name, value in {**model.extra_states, **model.friction.extra_states}.items()
    }


def has_nan(expression: ca.SX) -> bool:
    """Whether a constant in it is NaN, as ``math.sin`` of a symbol is."""
    tape = ca.Function("tape", ca.symvar(expression), [expression])
    return any(
        tape.instruction_id(k) == ca.OP_CONST and math.isnan(tape.instruction_constant(k))
        for k in range(tape.n_instructions())
    )


@lru_cache(maxsize=64)
def equations(blueprint: Blueprint) -> Equations:
    """Return the equations of a blueprint (see ``ContactModel.blueprint``)."""
    return blueprint.derived()


@lru_cache(maxsize=64)
def contact_system(blueprint: Blueprint) -> ns.FilippovSystem:
    """Return the contact phase of a blueprint; parameters have no defaults."""
    return equations(blueprint).build()


@lru_cache(maxsize=64)
def free_system(blueprint: Blueprint) -> ns.FilippovSystem:
    """Return the frictionless phase of a blueprint; parameters have no defaults."""
    return equations(blueprint).build_free()


@lru_cache(maxsize=64)
def forces_function(blueprint: Blueprint) -> ca.Function:
    """Return (states, parameters) -> load, and friction in forward slip, reverse slip and rolling."""
    eq, system = equations(blueprint), contact_system(blueprint)
    spin = STATES.index("omega")
    friction = [eq.q.inertia * ns.local.mode_field(system, mode)[spin] for mode in "+-s"]
    return eq.function([eq.load, *friction])


@lru_cache(maxsize=64)
def load_inputs(blueprint: Blueprint) -> frozenset[str]:
    """Return the states and parameters on which the time of the first load depends."""
    eq = equations(blueprint)
    return eq.inputs(eq.lift_off)


@lru_cache(maxsize=64)
def energy_function(blueprint: Blueprint) -> ca.Function:
    """Return (states, parameters) -> energy per mass, of the ball and of its motion along y.

    Kinetic and gravitational; of the ball twice where its motion along y depends on the other.
    """
    return equations(blueprint).energies()


@lru_cache(maxsize=64)
def touch_down_function(blueprint: Blueprint) -> ca.Function:
    """Return (states, parameters) -> lift-off function, its rate, field without friction, its rate."""
    eq, system = equations(blueprint), free_system(blueprint)
    field = system.field("")
    rate = system.lie_derivative([""], of=eq.lift_off)
    return eq.function([eq.lift_off, rate, field, ca.jtimes(field, system.extended_states, field)])
