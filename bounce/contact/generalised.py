"""The generalised model of Biber et al. (2022) from four functions, and its conditions by sampling."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..errors import ModelError
from ..parameters import Names
from .equations import STATES, equations
from .friction import FrictionLaw
from .model import ContactModel, LoadConvention

Expression = Any
Coefficient = Callable[[Any, Any], Expression]

#: Default box of the samples; it ends just below y = 0, where power laws are
#: not differentiable.
BOX = dict(x=(-1.0, 1.0), xdot=(-1.0, 1.0), y=(-1.0, -1e-3), ydot=(-1.0, 1.0), omega=(-1.0, 1.0))


class GeneralisedContact(ContactModel):
    """Nonlinear coefficients of stiffness and damping, coupled between the directions.

    $X'' + eps upsilon X' + eps^2 zeta X = Lambda_T$,  $Y'' + delta Y' + kappa Y = -G$.

    Source: Biber, Champneys & Szalai 2022, Sec. 4, eq. (generic_rescaled).

    Parameters
    ----------
    upsilon, zeta : callable (s, p) -> expression
        Tangential damping and stiffness, of all five states.
    delta, kappa : callable (s, p) -> expression
        Normal damping and stiffness, of ``s.y`` and ``s.ydot`` only.
    parameters : mapping, optional
        Names and values of the parameters of these functions (``p.name``).
    lift_off : callable (s, p) -> expression, optional
        See obligation 7 of :class:`ContactModel`: needed where the load ends in a power law's
        zero, such as Hertz's without gravity.
    mu, eps : float
        Friction coefficient; ratio of time scales, small for a hard normal contact.
    G : float, optional
        Gravity relative to the contact force.

    Examples
    --------
    >>> import bounce
    >>> soft = bounce.GeneralisedContact(
    ...     upsilon=lambda s, p: p.u * (1 - s.y + s.xdot**2), zeta=lambda s, p: 1.0,
    ...     delta=lambda s, p: 0.2 - 0.3 * s.y, kappa=lambda s, p: 1 + s.y**2,
    ...     parameters=dict(u=0.3), mu=0.3, eps=0.3, G=1e-3)
    >>> soft
    GeneralisedContact(mu=0.3, eps=0.3, G=0.001, u=0.3, functions of <doctest ...>)
    >>> bounce.simulate(soft, xdot=0.3, ydot=-1.0, omega=0.4).itinerary
    '+ s -'
    >>> print(soft.conditions())
    upsilon_Y < 0                    holds      worst -0.3
    delta_Y < 0                      holds      worst -0.3
    sign upsilon_X' = sign X'        holds      worst -0.00016...
    d Lambda_N / dY < 0              holds      worst -0.702...
    coefficients and slopes = O(1)   holds      worst 1.999...
    eps << 1                         holds      worst 0.3
    """

    parameters = dict(mu=None, eps=None, G=0.0)
    limits = dict(eps="> 0")

    def __init__(
        self,
        upsilon: Coefficient,
        zeta: Coefficient,
        delta: Coefficient,
        kappa: Coefficient,
        *,
        parameters: Mapping[str, float] | None = None,
        lift_off: Coefficient | None = None,
        load: LoadConvention = "contact",
        friction: FrictionLaw | None = None,
        **values: float,
    ):
        functions = dict(upsilon=upsilon, zeta=zeta, delta=delta, kappa=kappa)
        for name, function in functions.items():
            if not callable(function):
                raise ModelError(
                    f"{name} is {function!r}, not a function (s, p) -> expression. For a constant write "
                    f"lambda s, p: {function!r}."
                )
        self._set("functions", functions)
        self._set("end", lift_off)
        self._set("own", dict(parameters or {}))
        super().__init__(load=load, friction=friction, **{**self.own, **values})

    functions: dict[str, Coefficient]
    end: Coefficient | None
    own: dict[str, float]

    def _checked(
        self, declared: Mapping[str, float | None], values: Mapping[str, float]
    ) -> dict[str, float]:
        taken = sorted(set(self.own) & set(self.declared()) - {"mu", "eps", "G"})
        if taken:
            raise ModelError(f"parameters: {taken} are parameters of every model. Rename them.")
        return super()._checked({**declared, **self.own}, values)

    def normal_force(self, s: Names, p: Names) -> Expression:
        only = Names("state of delta and kappa", dict(y=s.y, ydot=s.ydot))
        delta, kappa = self.functions["delta"](only, p), self.functions["kappa"](only, p)
        return -(delta * s.ydot + kappa * s.y)

    def tangential_force(self, s: Names, p: Names) -> Expression:
        upsilon, zeta = self.functions["upsilon"](s, p), self.functions["zeta"](s, p)
        return -(p.eps * upsilon * s.xdot + p.eps**2 * zeta * s.x)

    def lift_off(self, s: Names, p: Names) -> Expression:
        """The function given, or the load."""
        return self.load(s, p) if self.end is None else self.end(s, p)

    def conditions(
        self,
        box: Mapping[str, tuple[float, float]] | None = None,
        *,
        order_one: float = 10.0,
        samples: int = 4096,
    ) -> Conditions:
        """Check the paper's conditions on the four functions at random states of a box.

        Parameters
        ----------
        box : mapping, optional
            Names of states with their ranges (low, high); states left out take those of ``BOX``.
        order_one : float
            What still counts as O(1).
        samples : int
            Number of sampled states.

        Returns
        -------
        Conditions
            One row per condition; print it.
        """
        ranges = {**BOX, **(box or {})}
        unknown = sorted(set(ranges) - set(STATES))
        if unknown:
            raise ModelError(f"box has {unknown}, but the states are {list(STATES)}.")
        values = _derivatives(self, ranges, samples)
        worst = [
            ("upsilon_Y < 0", "functions_constraints", values["upsilon_y"].max()),
            ("delta_Y < 0", "functions_constraints", values["delta_y"].max()),
            ("sign upsilon_X' = sign X'", "functions_constraints_horizontal", values["turn"].max()),
            ("d Lambda_N / dY < 0", "force_constraints", values["load_y"].max()),
        ]
        rows = [Condition(name, eq, _below_zero(value), value) for name, eq, value in worst]
        size = float(np.abs(values["sizes"]).max())
        rows.append(
            Condition("coefficients and slopes = O(1)", "derivatives_constraint",
                      "holds" if size <= order_one else "fails", size)
        )  # fmt: skip
        eps = self.values["eps"]
        rows.append(Condition("eps << 1", "Sec. 4", "holds" if eps < 1 else "fails", eps))
        return Conditions(tuple(rows))

    def _structure(self) -> tuple[Any, ...]:
        return (*super()._structure(), tuple(self.functions.items()), self.end, tuple(self.own))

    def options(self) -> dict[str, Any]:
        more: dict[str, Any] = {**self.functions, "parameters": self.own}
        if self.end is not None:
            more["lift_off"] = self.end
        return {**super().options(), **more}

    def __repr__(self) -> str:
        declared = {**self.declared(), **self.friction.declared()}
        shown = [f"{k}={v:.6g}" for k, v in self.values.items() if v != declared.get(k)]
        shown += [f"{k}={v!r}" for k, v in ContactModel.options(self).items()]
        where = {
            getattr(getattr(f, "__code__", None), "co_filename", "?")
            for f in self.functions.values()
        }
        return f"GeneralisedContact({', '.join(shown)}, functions of {', '.join(sorted(where))})"


@dataclass(frozen=True)
class Condition:
    """One condition of the paper on the coefficients of a generalised model.

    Attributes
    ----------
    name : str
        The condition.
    equation : str
        Its label in the paper.
    verdict : {"holds", "equality", "fails"}
        Result at the sampled states.
    worst : float
        The value that is nearest to breaking it, or breaks it most.
    """

    name: str
    equation: str
    verdict: str
    worst: float


@dataclass(frozen=True)
class Conditions:
    """The conditions of a generalised model, as sampled.

    Attributes
    ----------
    rows : tuple of Condition
        One for each condition.
    """

    rows: tuple[Condition, ...]

    @property
    def hold(self) -> bool:
        """Whether none fails (equality, as with constant coefficients, is no failure)."""
        return all(row.verdict != "fails" for row in self.rows)

    def __str__(self) -> str:
        return "\n".join(f"{r.name:<32} {r.verdict:<10} worst {r.worst:.6g}" for r in self.rows)


def _below_zero(worst: float) -> str:
    if worst < 0:
        return "holds"
    return "equality" if worst == 0 else "fails"


def _derivatives(
    model: GeneralisedContact, ranges: Mapping[str, tuple[float, float]], samples: int
) -> dict[str, NDArray[np.float64]]:
    """What the conditions speak of, at random states; ``turn`` is -sign(X') upsilon_X'."""
    eq = equations(model.blueprint())
    coefficients = {name: ca.SX(f(eq.s, eq.q)) for name, f in model.functions.items()}
    x = ca.vertcat(*eq.x.values())
    all_four = ca.vertcat(*coefficients.values())
    slopes = ca.vec(ca.jacobian(all_four, x))
    outputs = {
        "upsilon_y": ca.jacobian(coefficients["upsilon"], eq.s.y),
        "delta_y": ca.jacobian(coefficients["delta"], eq.s.y),
        "turn": -ca.sign(eq.s.xdot) * ca.jacobian(coefficients["upsilon"], eq.s.xdot),
        "load_y": ca.jacobian(eq.normal, eq.s.y),
        "sizes": ca.vertcat(all_four, slopes),
    }
    rng = np.random.default_rng(0)
    bounds = np.array([ranges[name] for name in STATES])
    states = rng.uniform(bounds[:, :1], bounds[:, 1:], (len(STATES), samples))
    states = np.vstack([states, np.zeros((len(eq.names) - len(STATES), samples))])
    values = np.repeat(np.array(list(model.values.values()))[:, None], samples, axis=1)
    results = eq.function([ca.densify(e) for e in outputs.values()])(states, values)
    return {name: np.array(r) for name, r in zip(outputs, results, strict=True)}
