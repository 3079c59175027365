"""Slips found while checking every equation, beyond the 24 errata; none changes a conclusion."""

from __future__ import annotations

import casadi as ca

from ..claims import Check, Checks
from .errata_general import generic
from .exact import identical, impose
from .model import Omega, Xp, Y, d1, d2, eps, eta, p
from .records import ERRATA


@ERRATA("25")
def gravity_in_impact() -> Checks:
    """25: gravity in the equation of the contact point's velocity."""
    force, gravity, scale = (ca.SX.sym(n) for n in ("lN", "g", "scale"))
    rate = force - gravity
    rescaled = ca.substitute(scale * rate, force, force / scale)
    yield Check(
        "y'' = lambda_N - g of the same section is not lambda_N",
        not identical(rate, force),
    )
    yield Check(
        "rescaled, dv_N/dt~ = lambda~_N - eps g identically",
        identical(rescaled, force - scale * gravity),
    )


@ERRATA("26")
def sign_condition() -> Checks:
    """26: a stray comparison, damping called stiffness, and a condition that nothing needs."""
    g = generic()
    constant, slope = (
        next(s for s in ca.symvar(g.upsilon) if s.name() == f"upsilon_{n}") for n in ("0", "Xp")
    )
    value, other = ca.SX.sym("value"), ca.SX.sym("other")
    load, stiffness, _ = g.at_two_fold
    given = [load, stiffness, (constant, value - (g.upsilon - constant)), (Omega, -Xp)]
    second = [impose(g.equations.lie(i, i), given) for i in (1, 2)]
    yield Check(
        "with upsilon held, both (F_i.grad)^2 H at s do not change with upsilon_X', for "
        "every law: sigma and nu do not depend on it",
        all(identical(e, ca.substitute(e, slope, other)) for e in second),
    )


@ERRATA("27")
def force_slope() -> Checks:
    """27: the variable of a derivative."""
    y, yt = ca.SX.sym("y"), ca.SX.sym("yt")
    model = generic().equations
    rescaled = ca.substitute(
        model.Lambda_N, ca.vertcat(*ca.vertsplit(p)[2:4]), ca.vertcat(y, eps * yt)
    )
    original = ca.substitute(
        ca.jacobian(model.Lambda_N, Y), ca.vertcat(*ca.vertsplit(p)[2:4]), ca.vertcat(y, eps * yt)
    )
    yield Check(
        "with X = x the two derivatives are the same number, so only the letter is wrong",
        identical(ca.jacobian(rescaled, y), original),
    )


@ERRATA("28")
def both_positive() -> Checks:
    """28: the signs of the terms of eq. (25)."""
    values = {"d1": 1.0, "d2": 0.01, "eta": 0.1}
    bracket = 7 * d2 - 5 * d1 * eta
    number = float(
        ca.Function("b", [d1, d2, eta], [bracket])(values["d1"], values["d2"], values["eta"])
    )
    yield Check(f"d1 = 1, d2 = 0.01, eta = 0.1: 7 d2 - 5 d1 eta = {number:.2f} < 0", number < 0)


@ERRATA("29")
def limit_of_compliance() -> Checks:
    """29: what tends to zero in the rigid limit."""
    model = generic().equations
    share = ca.jacobian(ca.jacobian(model.A, eps), eps)
    yield Check("A = 0 at eps = 0 for every law", identical(model.A, 0, given=[(eps, 0)]))
    yield Check(
        "the stiffness enters A with eps^2 zeta, so it is not the limit eps -> 0 that "
        "makes it stiff",
        not identical(share, 0),
    )
