"""The paper's equations in its own notation, with its equation numbers.

The state is p = [X, X', Y, Y', Omega] (equation vec_p): position and velocity of the centre along
and normal to the ground, and spin; lengths in ball radii, time in units of the normal contact
(tau = t/eps2). H = X' + Omega is the velocity of the contact point. Names here are the paper's:
``Xp`` and ``Yp`` are X' and Y', ``Lambda_N`` its normal load (gravity included: erratum 4), ``A``
the tangential acceleration besides friction, ``G`` its eps2^2 g.

    X'' = A + Lambda_T,   Y'' = Lambda_N,   Omega' = (5/2) Lambda_T,   Lambda_T = -lambda mu Lambda_N
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

Expression = Any  # a CasADi SX scalar or a number
Array = NDArray[np.float64]

X, Xp, Y, Yp, Omega = (ca.SX.sym(name) for name in ("X", "Xp", "Y", "Yp", "Omega"))
p = ca.vertcat(X, Xp, Y, Yp, Omega)
mu, G, eps = (ca.SX.sym(name) for name in ("mu", "G", "eps"))
d1, d2, eta = (ca.SX.sym(name) for name in ("d1", "d2", "eta"))
H = Xp + Omega
grad_H = ca.jacobian(H, p).T


@dataclass(frozen=True, eq=False)
class Equations:
    """A model of the paper: the two fields of eq. (20); ``A`` is the tangential acceleration but friction."""

    A: ca.SX
    Lambda_N: ca.SX
    parameters: Mapping[ca.SX, float | None] = field(default_factory=dict)
    name: str = ""

    def F(self, lam: Expression) -> ca.SX:
        """Field for Lambda_T = -lam mu Lambda_N; F(1) is F_1 and F(-1) is F_2."""
        friction = -lam * mu * self.Lambda_N
        return ca.vertcat(Xp, self.A + friction, Yp, self.Lambda_N, 5 * friction / 2)

    @property
    def F1(self) -> ca.SX:
        """Forward slip, H > 0."""
        return self.F(1)

    @property
    def F2(self) -> ca.SX:
        """Reverse slip, H < 0."""
        return self.F(-1)

    def lie(self, *fields: int) -> ca.SX:
        """Iterated derivative of H: ``lie(1, 2)`` is (F_1 . grad)(F_2 . grad) H."""
        result = H
        for i in reversed(fields):
            result = along(self.F1 if i == 1 else self.F2, result)
        return result

    @property
    def alpha(self) -> ca.SX:
        """Equation (21)."""
        return self.lie(1) / ca.dot(self.F1 - self.F2, grad_H)

    @property
    def F_s(self) -> ca.SX:
        """Rolling, eq. (20)."""
        return (1 - self.alpha) * self.F1 + self.alpha * self.F2

    @cached_property
    def system(self) -> ns.FilippovSystem:
        """The model as a Filippov system that stops at lift-off."""
        lam = ca.SX.sym("lam")
        return ns.FilippovSystem(
            [X, Xp, Y, Yp, Omega],
            field=ca.vertsplit(self.F(lam)),
            multipliers=[lam],
            surfaces=[H],
            parameters=dict(self.parameters),
            stops=[ns.Stop(self.Lambda_N, -1, "lift-off")],
        )

    def value(self, expression: Expression, state: ArrayLike, **values: float) -> float:
        """Evaluate an expression at a state (a number)."""
        return float(self.system.evaluate(expression, state, values).item())

    def bounce(self, start: ArrayLike, *, tol: float = 1e-12, **values: float) -> ns.Trajectory:
        """Simulate from ``start`` to lift-off (or to tau = 1000)."""
        return ns.simulate(self.system, start, 1000.0, parameters=values, tol=tol)


def along(field_: ca.SX, expression: Expression) -> ca.SX:
    """(F . grad) of a scalar expression."""
    return ca.mtimes(ca.jacobian(ca.SX(expression), p), field_)


def linear(**values: float | None) -> Equations:
    """Equation (15), the linear Kelvin-Voigt model."""
    symbols = (mu, d1, d2, eta, G)
    return Equations(
        A=-(2 * d1 * eta * Xp + eta**2 * X),
        Lambda_N=-2 * d2 * Yp - Y - G,
        parameters={s: values.get(s.name()) for s in symbols},
        name="linear Kelvin-Voigt",
    )


def generalised(
    upsilon: Expression,
    zeta: Expression,
    delta: Expression,
    kappa: Expression,
    parameters: Mapping[ca.SX, float | None],
    name: str,
) -> Equations:
    """Equation (37); ``parameters`` holds every symbol of the four functions, and mu, G and eps."""
    return Equations(
        A=-(eps * upsilon * Xp + eps**2 * zeta * X),
        Lambda_N=-delta * Yp - kappa * Y - G,
        parameters=parameters,
        name=name,
    )


@dataclass(frozen=True, eq=False)
class Generic:
    """The generalised model with free values and gradients of its four functions at a point."""

    upsilon: ca.SX
    zeta: ca.SX
    delta: ca.SX
    kappa: ca.SX
    equations: Equations
    zeta_value: ca.SX

    @classmethod
    def make(cls) -> Generic:
        """Create the symbols."""

        def affine(name: str, of: ca.SX) -> ca.SX:
            slopes = ca.vertcat(*[ca.SX.sym(f"{name}_{s}") for s in ca.vertsplit(of)])
            return ca.SX.sym(f"{name}_0") + ca.dot(slopes, of)

        normal = ca.vertcat(Y, Yp)
        upsilon, zeta = affine("upsilon", p), affine("zeta", p)
        delta, kappa = affine("delta", normal), affine("kappa", normal)
        coefficients = [s for e in (upsilon, zeta, delta, kappa) for s in ca.symvar(e)]
        own = [s for s in coefficients if "_" in s.name()]
        parameters = {s: None for s in (mu, G, eps, *own)}
        equations = generalised(upsilon, zeta, delta, kappa, parameters, "generic")
        constant = next(s for s in own if s.name() == "zeta_0")
        return cls(upsilon, zeta, delta, kappa, equations, constant)

    @property
    def at_two_fold(self) -> list[tuple[ca.SX, ca.SX]]:
        """Substitutions that make the current point a two-fold: H = Lambda_N = A = 0."""
        load = self.equations.Lambda_N + G
        rest = self.zeta - self.zeta_value
        return [
            (G, load),
            (self.zeta_value, -self.upsilon * Xp / (eps * X) - rest),
            (Omega, -Xp),
        ]


def polynomial_law() -> Equations:
    """A nonlinear law that meets the paper's sign conditions for X' > 0, Y < 0, Y' > 0."""
    return generalised(
        upsilon=0.3 - 0.4 * Y + 0.2 * Xp**2,
        zeta=1 + 0.5 * Y**2,
        delta=0.2 + 0.3 * Y**2,
        kappa=1 + 0.5 * Y**2,
        parameters={mu: 0.3, eps: 0.3, G: 1e-3},
        name="polynomial",
    )


def exponential_law() -> Equations:
    """Stiffness and damping that grow exponentially with depth, with coupling to spin."""
    return generalised(
        upsilon=0.4 * ca.exp(-0.5 * Y) * (1 + 0.1 * Xp**2),
        zeta=ca.exp(-0.3 * Y) + 0.2 * Omega**2,
        delta=0.2 * ca.exp(-0.5 * Y),
        kappa=ca.exp(-0.5 * Y),
        parameters={mu: 0.3, eps: 0.3, G: 1e-3},
        name="exponential",
    )


def hunt_crossley_law(gravity: float = 0.0) -> Equations:
    """Hertz stiffness with Hunt-Crossley damping: the load has no slope in Y at lift-off if G = 0."""
    return generalised(
        upsilon=0.2 - 0.3 * Y + 0.1 * Xp**2,
        zeta=1 - 0.5 * Y,
        delta=0.3 * ca.sqrt(-Y) * (-Y),
        kappa=ca.sqrt(-Y),
        parameters={mu: 0.3, eps: 0.2, G: gravity},
        name="Hunt-Crossley",
    )


LAWS: dict[str, Callable[[], Equations]] = {
    "linear": lambda: linear(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4),
    "polynomial": polynomial_law,
    "exponential": exponential_law,
}


def two_fold_point(equations: Equations, xp: float, yp: float, **values: float) -> Array:
    """A two-fold near X' = xp, Y' = yp: a start for ``ns.find_two_fold``, by Newton in (X, Y)."""
    residual = ca.vertcat(equations.A, equations.Lambda_N)
    unknown = ca.vertcat(X, Y)
    jacobian = ca.jacobian(residual, unknown)
    start = np.array([-0.5 * xp, xp, -0.2, yp, -xp])
    for _ in range(50):
        r = equations.system.evaluate(residual, start, values).ravel()
        step = np.linalg.solve(equations.system.evaluate(jacobian, start, values), r)
        start[[0, 2]] -= step
        if np.abs(step).max() < 1e-15:
            break
    return start
