"""Slips found while checking every equation, beyond the 24 errata; none changes a conclusion."""

from __future__ import annotations

import casadi as ca

from ..claims import Check
from .errata_general import generic
from .exact import identical, impose
from .model import Omega, Xp, Y, d1, d2, eps, eta, p
from .records import Erratum


def gravity_in_impact() -> Erratum:
    """25: gravity in the equation of the contact point's velocity."""
    force, gravity, scale = (ca.SX.sym(n) for n in ("lN", "g", "scale"))
    rate = force - gravity
    rescaled = ca.substitute(scale * rate, force, force / scale)
    return Erratum(
        25,
        "Sec. 2.2, dv/dt",
        "dv_N/dt = lambda_N",
        "dv_N/dt = lambda_N - g; gravity drops out in the next equation only, where it is O(eps)",
        (
            Check(
                "y'' = lambda_N - g of the same section is not lambda_N",
                not identical(rate, force),
            ),
            Check(
                "rescaled, dv_N/dt~ = lambda~_N - eps g identically",
                identical(rescaled, force - scale * gravity),
            ),
        ),
    )


def sign_condition() -> Erratum:
    """26: a stray comparison, damping called stiffness, and a condition that nothing needs."""
    g = generic()
    constant, slope = (
        next(s for s in ca.symvar(g.upsilon) if s.name() == f"upsilon_{n}") for n in ("0", "Xp")
    )
    value, other = ca.SX.sym("value"), ca.SX.sym("other")
    load, stiffness, _ = g.at_two_fold
    given = [load, stiffness, (constant, value - (g.upsilon - constant)), (Omega, -Xp)]
    second = [impose(g.equations.lie(i, i), given) for i in (1, 2)]
    return Erratum(
        26,
        "eq. (32) and the text before it",
        "sign(u_x' < 0)) = sign(x'); the stiffness increases when the ball moves to the right",
        "sign(u_x') = sign(x'), a condition on the damping u; no correct result needs it",
        (
            Check(
                "with upsilon held, both (F_i.grad)^2 H at s do not change with upsilon_X', for "
                "every law: sigma and nu do not depend on it",
                all(identical(e, ca.substitute(e, slope, other)) for e in second),
            ),
        ),
    )


def force_slope() -> Erratum:
    """27: the variable of a derivative."""
    y, yt = ca.SX.sym("y"), ca.SX.sym("yt")
    model = generic().equations
    rescaled = ca.substitute(
        model.Lambda_N, ca.vertcat(*ca.vertsplit(p)[2:4]), ca.vertcat(y, eps * yt)
    )
    original = ca.substitute(
        ca.jacobian(model.Lambda_N, Y), ca.vertcat(*ca.vertsplit(p)[2:4]), ca.vertcat(y, eps * yt)
    )
    return Erratum(
        27,
        "eq. (39)",
        "d/dY Lambda_N = d/dy (-delta Y' - kappa Y - eps^2 g)",
        "d/dY on both sides",
        (
            Check(
                "with X = x the two derivatives are the same number, so only the letter is wrong",
                identical(ca.jacobian(rescaled, y), original),
            ),
        ),
    )


def both_positive() -> Erratum:
    """28: the signs of the terms of eq. (25)."""
    values = {"d1": 1.0, "d2": 0.01, "eta": 0.1}
    bracket = 7 * d2 - 5 * d1 * eta
    number = float(
        ca.Function("b", [d1, d2, eta], [bracket])(values["d1"], values["d2"], values["eta"])
    )
    return Erratum(
        28,
        "Sec. 3.2, after eq. (25)",
        "both terms on the right-hand side are positive",
        "the second has the sign of 7 d2 - 5 d1 eta (erratum 11); the sum is positive for small "
        "eta because Lambda_N = O(eta)",
        (Check(f"d1 = 1, d2 = 0.01, eta = 0.1: 7 d2 - 5 d1 eta = {number:.2f} < 0", number < 0),),
    )


def limit_of_compliance() -> Erratum:
    """29: what tends to zero in the rigid limit."""
    model = generic().equations
    share = ca.jacobian(ca.jacobian(model.A, eps), eps)
    return Erratum(
        29,
        "Sec. 4.3",
        "limiting case where the tangential compliance tends to zero, eps -> 0",
        "the normal compliance tends to zero with the tangential one held (u, z = O(1)): over the "
        "bounce the tangential surface gives no force, A = O(eps)",
        (
            Check("A = 0 at eps = 0 for every law", identical(model.A, 0, given=[(eps, 0)])),
            Check(
                "the stiffness enters A with eps^2 zeta, so it is not the limit eps -> 0 that "
                "makes it stiff",
                not identical(share, 0),
            ),
        ),
    )
