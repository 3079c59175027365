"""The equations of motion of a ball with both directions along the ground (``Contact3D``)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..errors import ModelError
from ..parameters import Names
from .equations import Equations, Surface, further_states, has_nan
from .friction import FrictionLaw

#: The ball's own states; the slip is one of them, so that its direction is known however small it is.
STATES_3D = ("x", "xdot", "y", "ydot", "z", "zdot", "slip_x", "slip_z")

#: Slip that counts as none in a coefficient that depends on the slip speed: |h| is not smooth at zero.
#: Its error is that times the coefficient's slope, over times of that order.
_NO_SLIP = 1e-8


class SpaceEquations(Equations):
    """Symbols, forces and fields in 3-D; attributes as those of :class:`Equations`.

    Parameters
    ----------
    model : ContactModel
    parameters : sequence of str
        Those of the model, and the options of :class:`Contact3D` that are used.
    """

    steps_off_a_root = True
    centre = (0, 2, 4)
    velocity = (1, 3, 5)
    along_the_ground = frozenset({"x", "z", "xdot", "zdot", "slip_x", "slip_z"})

    def __init__(self, model: Surface, parameters: Sequence[str]):
        self.model = model
        self.vectors = (*model.vector_states, *model.friction.vector_states)
        start: dict[str, float] = {}
        for name, value in further_states(model).items():
            start |= {
                n: value for n in ((f"{name}_x", f"{name}_z") if name in self.vectors else (name,))
            }
        drilling = "drilling_radius" in parameters
        self._symbols((*STATES_3D, *(["spin"] if drilling else [])), start, parameters)
        x, p = self.x, self.p
        velocity = ca.vertcat(x["xdot"], x["zdot"])
        self.slip = ca.vertcat(x["slip_x"], x["slip_z"])
        self._sign = ca.vertcat(*[ca.SX.sym(f"lambda_{i}") for i in range(3 if drilling else 2)])
        speed = ca.sqrt(ca.sumsqr(self.slip) + _NO_SLIP**2)
        further = {name: self._state(name) for name in further_states(model)}
        own = dict(
            x=ca.vertcat(x["x"], x["z"]), xdot=velocity, y=x["y"], ydot=x["ydot"],
            omega=self.slip - velocity, slip=speed,
        )  # fmt: skip
        self.s = Names("state", {**own, **further, **({"spin": x["spin"]} if drilling else {})})
        # What a model knows of gravity is its part normal to the ground.
        self.q = Names("parameter", {**p, "G": p["G"] * ca.cos(p["side_slope"])})
        self._forces()
        self._require_isotropy()

    def _state(self, name: str) -> ca.SX:
        if name in self.vectors:
            return ca.vertcat(self.x[f"{name}_x"], self.x[f"{name}_z"])
        return self.x[name]

    def _forces(self) -> None:
        model, s, q, p = self.model, self.s, self.q, self.p
        law = model.friction
        self.normal = self._scalar("normal_force", self._asked("normal_force", s, q))
        self.tangential = self._vector("tangential_force", self._asked("tangential_force", s, q))
        down = p["G"] * ca.vertcat(ca.sin(p["slope"]), ca.cos(p["slope"]) * ca.sin(p["side_slope"]))
        self.along = self.tangential - down
        self.load = self._scalar("load", self._asked("load", s, q))
        self.lift_off = self._scalar("lift_off", self._asked("lift_off", s, q))
        self._require_end()
        shape = self._shape()
        direction = shape @ self._sign[:2]
        self.coefficient = self._scalar(
            "friction_coefficient", self._asked("friction_coefficient", s, q)
        )
        self.set_valued = type(law).traction is FrictionLaw.traction
        if self.set_valued:
            given = type(model).friction_coefficient
            own = given.__qualname__ != "ContactModel.friction_coefficient"
            pull: Callable[..., Any] = (
                FrictionLaw.vector_traction if own else type(law).vector_traction
            )
            traction = pull(law, s, q, direction, self.coefficient)
        else:
            traction = law.traction(s, q, direction)
        self.friction_force = self._vector("traction", traction) * self.load
        if "drilling_radius" in p:
            moment = -self.coefficient * self.load * p["drilling_radius"] * self._sign[2]
            self.friction_force = ca.vertcat(self.friction_force, moment)
        self.set = ca.vertcat(
            shape @ self.slip,
            *([p["drilling_radius"] * self.x["spin"]] if "drilling_radius" in p else []),
        )
        self.rates = self._further_rates(direction)
        energy = model.stored_energy(s, q)
        scalar = energy is not None and ca.SX(energy).shape == (1, 1)
        self.stored = self._scalar("stored_energy", energy) if scalar else None

    def _shape(self) -> ca.SX:
        """The symmetric matrix of elliptical friction, by which slip and multiplier are stretched."""
        if "friction_ratio" not in self.p:
            return ca.SX.eye(2)
        ratio, grain = self.p["friction_ratio"], self.p["grain"]
        along = ca.vertcat(ca.cos(grain), ca.sin(grain))
        return ratio * ca.SX.eye(2) + (1 - ratio) * along @ along.T

    def _further_rates(self, direction: ca.SX) -> list[ca.SX]:
        names = list(further_states(self.model))
        rates = self._rates_of(names, direction)
        flat: list[ca.SX] = []
        for name in names:
            read = self._vector if name in self.vectors else self._scalar
            flat += ca.vertsplit(read(f"rate of {name}", rates[name]))
        return flat

    def _asked(self, method: str, s: Names, q: Names) -> Any:
        """What a method of the model says of vectors; CasADi's complaints name the method."""
        try:
            return getattr(self.model, method)(s, q)
        except (RuntimeError, NotImplementedError, TypeError) as error:
            raise self._no_form(method, str(error).splitlines()[0]) from error

    def _no_form(self, method: str, why: str) -> ModelError:
        return ModelError(
            f"{type(self.model).__name__}.{method}: expected an expression that holds in 3-D, where s.x, "
            f"s.xdot and s.omega are vectors of two components, received {why}. Speeds are "
            "ca.norm_2(s.xdot), squares ca.sumsqr(s.x); a force along the ground is a vector."
        )

    def _vector(self, what: str, value: Any) -> ca.SX:
        try:
            result = ca.SX(value)
        except (TypeError, ValueError, NotImplementedError):
            raise self._no_form(what, f"{value!r} ({type(value).__name__})") from None
        if result.shape == (1, 1) and result.is_zero():
            return ca.SX.zeros(2, 1)
        if result.shape != (2, 1):
            raise self._no_form(what, f"shape {result.shape}")
        if has_nan(result):
            raise self._no_form(what, f"{result}")
        return ca.densify(result)

    def _scalar(self, what: str, value: Any) -> ca.SX:
        if isinstance(value, ca.SX) and value.shape != (1, 1):
            raise self._no_form(what, f"shape {value.shape}")
        return super()._scalar(what, value)

    def _require_isotropy(self) -> None:
        """Refuse forces that do not turn with the ball, as powers of components do not."""
        rng = np.random.default_rng(0)
        x, p = rng.uniform(0.2, 0.9, (len(self.names), 3)), rng.uniform(0.2, 0.9, (len(self.p), 3))
        x[[2]] *= -1.0
        turned = self._turned(x, 1.0)
        asked: dict[str, ca.SX] = dict(
            normal_force=self.normal,
            tangential_force=self.tangential,
            load=self.load,
            friction_coefficient=self.coefficient,
        )
        one = ns.call(self.function(list(asked.values())), x, p)
        other = ns.call(self.function(list(asked.values())), turned, p)
        for name, a, b in zip(asked, one, other, strict=True):
            a = _rotation(1.0) @ a if a.shape[0] == 2 else a
            known = np.isfinite(a) & np.isfinite(b)
            if not np.allclose(a[known], b[known], rtol=1e-9, atol=1e-12):
                raise self._no_form(name, "one that favours a direction along the ground")

    def _turned(self, x: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
        turned = np.array(x)
        pairs = [("x", "z"), ("xdot", "zdot"), ("slip_x", "slip_z")]
        pairs += [(f"{name}_x", f"{name}_z") for name in self.vectors]
        for pair in pairs:
            rows = [self.names.index(name) for name in pair]
            turned[rows] = _rotation(angle) @ x[rows]
        return turned

    # fields ------------------------------------------------------------------------------------

    def field(self, friction: ca.SX) -> list[ca.SX]:
        """Right-hand side for a friction force of two components, and the moment of drilling."""
        x, q, p = self.x, self.q, self.p
        f = friction if friction.numel() > 1 else ca.SX.zeros(3, 1)
        along, both = self.along, 1 + 1 / q.inertia
        drilling = [f[2] / q.inertia] if "spin" in x else []
        return [
            x["xdot"],
            along[0] + f[0],
            x["ydot"],
            self.normal - q.G * ca.cos(p["slope"]),
            x["zdot"],
            along[1] + f[1],
            along[0] + both * f[0],
            along[1] + both * f[1],
            *drilling,
            *self.rates,
        ]

    def build(
        self, defaults: Mapping[str, float] | None = None, further: Sequence[ns.Stop] = ()
    ) -> ns.FilippovSystem:
        """Return the Filippov system of the contact phase, with further stops."""
        sets: dict[str, Any] = {}
        if self.set_valued:
            sets = dict(surfaces=[self.set], multipliers=[self._sign])
        return ns.FilippovSystem(
            list(self.x.values()),
            field=self.field(self.friction_force),
            parameters=self._defaults(defaults),
            stops=[*self._ends(), *further],
            **sets,
        )

    def build_free(self) -> ns.FilippovSystem:
        """Return the smooth system of the phase before the load is positive (no friction)."""
        return ns.FilippovSystem(
            list(self.x.values()),
            field=self.field(ca.SX(0)),
            parameters=self._defaults(None),
            stops=[ns.Stop(self.lift_off, 1, "contact"), ns.Stop(self.x["y"], 1, "surface")],
        )

    def inputs(self, expression: ca.SX) -> frozenset[str]:
        """Names of the states and parameters on which it depends along the motion without friction."""
        rates = dict(zip(self.names, self.field(ca.SX(0)), strict=True))
        names: set[str] = set()
        new = {str(v) for v in ca.symvar(expression)}
        while new - names:
            names |= new
            new = {str(v) for n in names & set(rates) for v in ca.symvar(ca.SX(rates[n]))}
        return frozenset(names)

    # functions ---------------------------------------------------------------------------------

    def kinetic_along(self) -> ca.SX:
        """Kinetic energy per mass of the motion along the ground and of the spin."""
        s, q = self.s, self.q
        turning = self.x["spin"] ** 2 if "spin" in self.x else 0
        return 0.5 * (ca.sumsqr(s.xdot) + q.inertia * (ca.sumsqr(s.omega) + turning))

    def height(self) -> tuple[ca.SX, ca.SX]:
        """Scaled gravity times the height of the place along the ground, and over it."""
        p, q = self.p, self.q
        climbed = ca.sin(p["slope"]) * self.x["x"]
        climbed += ca.cos(p["slope"]) * ca.sin(p["side_slope"]) * self.x["z"]
        return p["G"] * climbed, q.G * ca.cos(p["slope"]) * self.x["y"]

    def forces(self) -> ca.Function:
        """Return (states, parameters) -> load, friction off the set and on it, of two components.

        On the set friction takes what would make the ball slip; off it the first is NaN at no slip.
        """
        slips = self.friction_force[:2]
        if self.set_valued:
            direction = self.set / ca.norm_2(self.set)
            slips = ca.substitute(slips, self._sign, direction)
        rolls = -self.along / (1 + 1 / self.q.inertia)
        return self.function([self.load, ca.densify(slips), ca.densify(rolls)])


def _rotation(angle: float) -> NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])
