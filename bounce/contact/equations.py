"""The equations of motion of a ball on a contact model, with one or two directions along the ground."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any, ClassVar, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..errors import ModelError
from ..parameters import Names, number
from .friction import FrictionLaw

#: The ball's own states in the plane, in the paper's order p = [X, X', Y, Y', Omega].
STATES = ("x", "xdot", "y", "ydot", "omega")
#: The same in 3-D. The slip is a state, so that its direction is known however small it is.
STATES_3D = ("x", "xdot", "y", "ydot", "z", "zdot", "slip_x", "slip_z")

#: Slip that counts as none in a coefficient that depends on the slip speed: |h| is not smooth at zero.
#: Its error is that times the coefficient's slope, over times of that order.
_NO_SLIP = 1e-8


class Surface(Protocol):
    """The part of ``ContactModel`` that the equations use."""

    extra_states: ClassVar[Mapping[str, float]]
    vector_states: ClassVar[tuple[str, ...]]
    friction: FrictionLaw

    def normal_force(self, s: Names, p: Names) -> Any: ...
    def tangential_force(self, s: Names, p: Names) -> Any: ...
    def load(self, s: Names, p: Names) -> Any: ...
    def lift_off(self, s: Names, p: Names) -> Any: ...
    def friction_coefficient(self, s: Names, p: Names) -> Any: ...
    def extra_rates(self, s: Names, p: Names) -> Any: ...
    def stored_energy(self, s: Names, p: Names) -> Any: ...


class Blueprint(Protocol):
    """A contact model, in the plane or in 3-D, from which equations of motion are derived."""

    values: dict[str, float]

    def derived(self) -> Equations: ...

    def __hash__(self) -> int: ...


class Equations:
    """Symbols, forces and fields of one model; ``directions`` is 1 in the plane and 2 in 3-D."""

    def __init__(self, model: Surface, parameters: Iterable[str], directions: int):
        # Vectors along the ground are SX (directions,).
        self.model, self.directions = model, directions
        names = tuple(parameters)
        self.drilling = "drilling_radius" in names
        self.vectors = (*model.vector_states, *model.friction.vector_states)
        own = STATES if directions == 1 else (*STATES_3D, *(["spin"] if self.drilling else []))
        further = _further_states(model)
        #: Values of the further states at touch-down.
        self.start = {n: v for name, v in further.items() for n in self._components(name)}
        self._symbols(own, names)
        #: Indices of the position of the centre among the states, and of its rates.
        self.centre = (0, 2) if directions == 1 else (0, 2, 4)
        self.velocity = tuple(k + 1 for k in self.centre)
        self.along_the_ground = frozenset(own) - {"y", "ydot", "spin"}
        x, p = self.x, self.p
        if directions == 1:
            self.slip = x["xdot"] + x["omega"]
            self._speed, self._sign = ca.SX.sym("slip"), ca.SX.sym("sign")
            ball = {name: x[name] for name in own}
            self.q = Names("parameter", p)
        else:
            velocity = ca.vertcat(x["xdot"], x["zdot"])
            self.slip = ca.vertcat(x["slip_x"], x["slip_z"])
            self._speed = ca.sqrt(ca.sumsqr(self.slip) + _NO_SLIP**2)
            count = 3 if self.drilling else 2
            self._sign = ca.vertcat(*[ca.SX.sym(f"lambda_{i}") for i in range(count)])
            ball = dict(
                x=ca.vertcat(x["x"], x["z"]), xdot=velocity, y=x["y"], ydot=x["ydot"],
                omega=self.slip - velocity, **{n: x[n] for n in own if n == "spin"},
            )  # fmt: skip
            # In a model, G is the part of gravity normal to the line of the slope.
            self.q = Names("parameter", {**p, "G": p["G"] * ca.cos(p["side_slope"])})
        extra = {n: ca.vertcat(*[x[c] for c in self._components(n)]) for n in further}
        self.s = Names("state", {**ball, **extra, "slip": self._speed})
        self._forces()
        if directions == 2:
            self._require_isotropy()

    @property
    def steps_off_a_root(self) -> bool:
        """Whether a run cannot begin where the load is zero as a power is."""
        return self.directions == 2

    def _components(self, name: str) -> tuple[str, ...]:
        """The states of a further state, which is a vector along the ground or a number."""
        if self.directions == 2 and name in self.vectors:
            return f"{name}_x", f"{name}_z"
        return (name,)

    def _symbols(self, own: tuple[str, ...], parameters: tuple[str, ...]) -> None:
        who = type(self.model).__name__
        self.names = (*own, *self.start)
        if len(set(self.names)) < len(self.names):
            raise ModelError(
                f"{who}: extra_states has one of the ball's names {own}: the states are {self.names}. "
                "Rename it."
            )
        self.x = {name: ca.SX.sym(name) for name in self.names}
        self.p = {name: ca.SX.sym(name) for name in parameters}
        clash = sorted(set(self.x) & set(self.p))
        if clash:
            raise ModelError(f"{who}: {clash} are both states and parameters. Rename one of each.")

    # forces ------------------------------------------------------------------------------------

    def _forces(self) -> None:
        p, q = self.p, self.q
        self.normal = self._scalar("normal_force", self._given("normal_force"))
        tangential = self._along("tangential_force", self._given("tangential_force"))
        uphill = [ca.sin(p["slope"])]
        if self.directions == 2:
            uphill.append(ca.cos(p["slope"]) * ca.sin(p["side_slope"]))
        self._uphill = p["G"] * ca.vertcat(*uphill)
        self.along = tangential - self._uphill
        self._level = q.G * ca.cos(p["slope"])
        self.load = self._scalar("load", self._given("load"))
        self.lift_off = self._scalar("lift_off", self._given("lift_off"))
        self._require_end()
        law = self.model.friction
        self.set_valued = type(law).traction is FrictionLaw.traction
        if self.set_valued or self.directions == 2:
            given = self._given("friction_coefficient")
            self.coefficient = self._scalar("friction_coefficient", given)
        shape = self._shape()
        direction = shape @ self._sign[: self.directions]
        if self.set_valued:
            traction = self._pull()(law, self.s, q, direction, self.coefficient)
        else:
            traction = law.traction(self.s, q, direction)
        self.friction_force = self._along("traction", traction) * self.load
        self.set = shape @ self.slip
        if self.drilling:
            radius = p["drilling_radius"]
            moment = -self.coefficient * self.load * radius * self._sign[2]
            self.friction_force = ca.vertcat(self.friction_force, moment)
            self.set = ca.vertcat(self.set, radius * self.x["spin"])
        self.rates = self._further_rates(direction)
        self.stored = self._stored_energy()

    def _pull(self) -> Callable[..., Any]:
        """The traction of a set-valued law: its own form, unless the model has its own coefficient."""
        given = type(self.model).friction_coefficient
        own = given.__qualname__ != "ContactModel.friction_coefficient"
        if own or self.directions == 1:
            return FrictionLaw.vector_traction
        return type(self.model.friction).vector_traction

    def _shape(self) -> ca.SX:
        """The symmetric matrix of elliptical friction, by which slip and multiplier are stretched."""
        if "friction_ratio" not in self.p:
            return ca.SX.eye(self.directions)
        ratio, grain = self.p["friction_ratio"], self.p["grain"]
        along = ca.vertcat(ca.cos(grain), ca.sin(grain))
        return ratio * ca.SX.eye(2) + (1 - ratio) * along @ along.T

    def _further_rates(self, direction: ca.SX) -> list[ca.SX]:
        who, names = type(self.model).__name__, list(_further_states(self.model))
        own = self.model.extra_rates(self.s, self.q)
        if isinstance(own, Mapping):
            own = {**own, **self.model.friction.extra_rates(self.s, self.q, direction)}
        if not isinstance(own, Mapping) or set(own) != set(names):
            received = list(own) if isinstance(own, Iterable) else repr(own)
            raise ModelError(
                f"{who}: extra_rates returns {received}, but the further states are {names}. Return a "
                "rate for each."
            )
        flat: list[ca.SX] = []
        for name in names:
            read = self._along if name in self.vectors else self._scalar
            flat += ca.vertsplit(read(f"rate of {name}", own[name]))
        return flat

    def _stored_energy(self) -> ca.SX | None:
        energy = self.model.stored_energy(self.s, self.q)
        if energy is None or (self.directions == 2 and ca.SX(energy).shape != (1, 1)):
            return None
        return self._scalar("stored_energy", energy)

    # checks ------------------------------------------------------------------------------------

    def _given(self, method: str) -> Any:
        """Call a method of the model; in 3-D an error of CasADi names the method."""
        try:
            return getattr(self.model, method)(self.s, self.q)
        except (RuntimeError, NotImplementedError, TypeError) as error:
            if self.directions == 1:
                raise
            raise self._no_form(method, str(error).splitlines()[0]) from error

    def _no_form(self, method: str, why: str) -> ModelError:
        return ModelError(
            f"{type(self.model).__name__}.{method} has no form in 3-D: {why}. There s.x, s.xdot and "
            "s.omega are vectors of two components: write speeds as ca.norm_2(s.xdot), squares as "
            "ca.sumsqr(s.x), and a force along the ground as a vector."
        )

    def _require_end(self) -> None:
        if not ca.depends_on(self.lift_off, ca.vertcat(*self.x.values())):
            raise ModelError(
                f"{type(self.model).__name__}: load is {self.lift_off}, which does not depend on the "
                "states, so the ball never lifts off. Let normal_force depend on s.y or s.ydot."
            )

    def _along(self, what: str, value: Any) -> ca.SX:
        """A vector along the ground: a number in the plane."""
        if self.directions == 1:
            return self._scalar(what, value)
        try:
            result = ca.SX(value)
        except (TypeError, ValueError, NotImplementedError):
            raise self._no_form(what, f"it returns {value!r}") from None
        if result.shape == (1, 1) and result.is_zero():
            return ca.SX.zeros(2, 1)
        if result.shape != (2, 1):
            raise self._no_form(what, f"it returns shape {result.shape}")
        if _has_nan(result):
            raise self._no_form(what, f"it returns {result}")
        return self._without_calls(what, ca.densify(result))

    def _scalar(self, what: str, value: Any) -> ca.SX:
        if self.directions == 2 and isinstance(value, ca.SX) and value.shape != (1, 1):
            raise self._no_form(what, f"it returns shape {value.shape}")
        try:
            result = ca.SX(value)
            received = f"shape {result.shape}" if result.shape != (1, 1) else f"{result}"
            right = result.shape == (1, 1) and not _has_nan(result)
        except (TypeError, ValueError, NotImplementedError):
            received, right = f"{value!r} ({type(value).__name__})", False
        if right:
            return self._without_calls(what, ca.densify(result))
        raise ModelError(
            f"{type(self.model).__name__}.{what} returns {received}, not a scalar CasADi expression of "
            "the states and parameters. Add a missing `return`, and take functions from casadi instead "
            "of math."
        )

    def _without_calls(self, what: str, value: ca.SX) -> ca.SX:
        """Write out Functions that CasADi has not inlined; refuse tables, as systems do."""
        symbols = ca.symvar(value)
        if not ca.Function("called", symbols, [value]).find_functions():
            return value
        entries = ca.vertsplit(value)
        states = [ca.SX.sym(f"entry_{k}") for k in range(len(entries))]
        try:
            system = ns.FilippovSystem(states, field=entries, parameters=symbols)
        except ns.DefinitionError as error:
            raise ModelError(f"{type(self.model).__name__}.{what}: {error}") from error
        return system.field("")[: len(entries)]

    def _require_isotropy(self) -> None:
        """Refuse forces that do not turn with the ball, as powers of components do not."""
        rng = np.random.default_rng(0)
        x, p = rng.uniform(0.2, 0.9, (len(self.names), 3)), rng.uniform(0.2, 0.9, (len(self.p), 3))
        x[[2]] *= -1.0
        forces = dict(
            normal_force=self.normal,
            tangential_force=self.along + self._uphill,
            load=self.load,
            friction_coefficient=self.coefficient,
        )
        function = self.function(list(forces.values()))
        pairs = [("x", "z"), ("xdot", "zdot"), ("slip_x", "slip_z")]
        pairs += [(f"{name}_x", f"{name}_z") for name in self.vectors]
        turn, turned = _rotation(1.0), np.array(x)
        for pair in pairs:
            rows = [self.names.index(name) for name in pair]
            turned[rows] = turn @ x[rows]
        both = zip(forces, ns.call(function, x, p), ns.call(function, turned, p), strict=True)
        for name, a, b in both:
            a = turn @ a if a.shape[0] == 2 else a
            known = np.isfinite(a) & np.isfinite(b)
            if not np.allclose(a[known], b[known], rtol=1e-9, atol=1e-12):
                raise self._no_form(name, "it favours a direction along the ground")

    # fields ------------------------------------------------------------------------------------

    def field(self, friction: ca.SX) -> list[ca.SX]:
        """Right-hand side for a friction force along the ground, and the moment of drilling."""
        x, q, along = self.x, self.q, self.along
        up = self.normal - self._level
        if self.directions == 1:
            spin = friction / q.inertia
            return [x["xdot"], along + friction, x["ydot"], up, spin, *self.rates]
        f, both = friction if friction.numel() > 1 else ca.SX.zeros(3, 1), 1 + 1 / q.inertia
        forward, right = along[0] + f[0], along[1] + f[1]
        slip = [along[0] + both * f[0], along[1] + both * f[1]]
        drilling = [f[2] / q.inertia] if self.drilling else []
        centre = [x["xdot"], forward, x["ydot"], up, x["zdot"], right]
        return [*centre, *slip, *drilling, *self.rates]

    def side(self, sign: float) -> list[ca.SX]:
        """Right-hand side of forward (+1) or reverse (-1) slip in the plane."""
        old, new = [self._sign, self._speed], [ca.SX(sign), sign * self.slip]
        return ca.substitute(self.field(self.friction_force), old, new)

    def build(
        self, defaults: Mapping[str, float] | None = None, further: Sequence[ns.Stop] = ()
    ) -> ns.FilippovSystem:
        """Return the Filippov system of the contact phase, with further stops."""
        field = self.field(self.friction_force)
        definition: dict[str, Any] = dict(field=field)
        if self.directions == 1:
            definition |= dict(surface=self.slip, multipliers=self._sign)
            if ca.depends_on(ca.vertcat(*field), self._speed):
                sides = dict(above=self.side(1.0), below=self.side(-1.0))
                definition = dict(surface=self.slip, **sides)
        elif self.set_valued:
            definition |= dict(surfaces=[self.set], multipliers=[self._sign])
        return ns.FilippovSystem(
            list(self.x.values()),
            parameters=self._defaults(defaults),
            stops=[*self._ends(), *further],
            **definition,
        )

    def _ends(self) -> list[ns.Stop]:
        """Functions that end the contact: the model's lift-off function, and the load."""
        # The friction that can hold a rolling ball vanishes with the load. Where its approximate zero
        # comes a little before that of another function, this ends the contact, not the rolling.
        ends = [ns.Stop(self.lift_off, -1, "lift-off")]
        if not ca.is_equal(self.lift_off, self.load, 10):
            ends.append(ns.Stop(self.load, -1, "no load"))
        return ends

    def build_free(self) -> ns.FilippovSystem:
        """Return the smooth system of the phase before the load is positive (no friction)."""
        field = self.field(ca.SX(0))
        if self.directions == 1:
            field = ca.substitute(field, [self._sign, self._speed], [ca.SX(1), self.slip])
        return ns.FilippovSystem(
            list(self.x.values()),
            field=field,
            parameters=self._defaults(None),
            stops=[ns.Stop(self.lift_off, 1, "contact"), ns.Stop(self.x["y"], 1, "surface")],
        )

    def _defaults(self, values: Mapping[str, float] | None) -> dict[ca.SX, float | None]:
        return {symbol: None if values is None else values[n] for n, symbol in self.p.items()}

    def inputs(self, expression: ca.SX) -> frozenset[str]:
        """Names of the states and parameters on which it depends along the motion without friction."""
        rates = dict(zip(self.names, self.field(ca.SX(0)), strict=True))
        rates["slip"] = self.slip
        names: set[str] = set()
        new = {str(v) for v in ca.symvar(expression)}
        while new - names:
            names |= new
            new = {str(v) for n in names & set(rates) for v in ca.symvar(ca.SX(rates[n]))}
        return frozenset(names)

    # functions ---------------------------------------------------------------------------------

    def energies(self) -> ca.Function:
        """Return (states, parameters) -> kinetic and gravitational energy, of the ball and along y."""
        s, spins = self.s, [self.s.omega, *([self.s.spin] if self.drilling else [])]
        turning = ca.sumsqr(ca.vertcat(*spins))
        along = 0.5 * (ca.sumsqr(s.xdot) + self.q.inertia * turning) + ca.dot(self._uphill, s.x)
        normal = 0.5 * s.ydot**2 + self._level * s.y
        # The motion along y has an energy of its own only where it does not depend on the other.
        apart = not self.inputs(self.normal) & self.along_the_ground
        return self.function([along + normal, normal if apart else along + normal])

    def forces(self, system: ns.FilippovSystem) -> tuple[str, ca.Function]:
        """Return letters of modes, and (states, parameters) -> load and the friction in each mode."""
        if self.directions == 1:
            spin = STATES.index("omega")
            friction = [self.q.inertia * ns.local.mode_field(system, mode)[spin] for mode in "+-s"]
            return "+-s", self.function([self.load, *friction])
        slips, rolls = self.friction_force[:2], -self.along / (1 + 1 / self.q.inertia)
        if self.set_valued:
            size = ca.norm_2(self.set)
            slips = ca.substitute(slips, self._sign, self.set / size)
            slips = ca.if_else(size > 0, slips, rolls)
        return "*s", self.function([self.load, ca.densify(slips), ca.densify(rolls)])

    def function(self, outputs: list[ca.SX]) -> ca.Function:
        """Return the function (states, parameters) -> outputs."""
        x, p = ca.vertcat(*self.x.values()), ca.vertcat(*self.p.values())
        return ca.Function("outputs", [x, p], outputs)


def _further_states(model: Surface) -> dict[str, float]:
    """The states of a model and its friction law besides the ball's, at touch-down."""
    who = type(model).__name__
    return {
        name: number(value, f"{who}: extra_states: {name}", ModelError)
        for name, value in {**model.extra_states, **model.friction.extra_states}.items()
    }


def _has_nan(expression: ca.SX) -> bool:
    """Whether a constant in it is NaN, as ``math.sin`` of a symbol is."""
    listed = ca.Function("listed", ca.symvar(expression), [expression])
    return any(
        listed.instruction_id(k) == ca.OP_CONST and math.isnan(listed.instruction_constant(k))
        for k in range(listed.n_instructions())
    )


def _rotation(angle: float) -> NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


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
def forces_function(blueprint: Blueprint) -> tuple[str, ca.Function]:
    """Return letters of modes, and (states, parameters) -> load and the friction in each mode."""
    return equations(blueprint).forces(contact_system(blueprint))


@lru_cache(maxsize=64)
def load_inputs(blueprint: Blueprint) -> frozenset[str]:
    """Return the states and parameters on which the time of the first load depends."""
    eq = equations(blueprint)
    return eq.inputs(eq.lift_off)


@lru_cache(maxsize=64)
def energy_function(blueprint: Blueprint) -> ca.Function:
    """Return (states, parameters) -> energy per mass, of the ball and of its motion along y."""
    return equations(blueprint).energies()


@lru_cache(maxsize=64)
def touch_down_function(blueprint: Blueprint) -> ca.Function:
    """Return (states, parameters) -> lift-off function, its rate, field without friction, its rate."""
    eq, system = equations(blueprint), free_system(blueprint)
    field = system.field("")
    rate = system.lie_derivative([""], of=eq.lift_off)
    return eq.function([eq.lift_off, rate, field, ca.jtimes(field, system.extended_states, field)])
