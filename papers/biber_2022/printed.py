"""Formulas as the paper prints them, where they are wrong, to compare with the corrected ones."""

from __future__ import annotations

import casadi as ca

from .model import Equations, Expression, G, X, Xp, Y, Yp, d1, d2, eps, eta, mu

_S = 2 * d2 * Yp + Y


def alpha() -> ca.SX:
    """Equation (21) made explicit, Sec. 3.2, without its O(eps2^2)."""
    return (7 * mu * _S - 4 * d1 * eta * Xp - eta**2 * X) / (7 * mu * _S)


def two_conditions() -> tuple[ca.SX, ca.SX]:
    """Equation (27): both vanish at a rolling lift-off."""
    return 4 * d1 * eta * Xp + eta**2 * X, _S + G


def second_lie_kv() -> ca.SX:
    """Equation (25) without its O(eta^2)."""
    return 7 * mu * Yp / 2 + (7 * d2 + 2 * d1 * eta) * (-_S - G)


def second_lie_general(delta: Expression, kappa: Expression) -> tuple[ca.SX, ca.SX]:
    """Equation (51): its first and second line without O(eps)."""
    slope = ca.jacobian(delta, Y) * Yp + ca.jacobian(kappa, Y) * Y + kappa
    damping = ca.jacobian(delta, Yp) * Yp + delta + ca.jacobian(kappa, Yp) * Y
    first = 7 * mu * slope * Yp / 2 + 7 * mu * damping * (-delta - kappa - G) / 2
    load = -delta * Yp - kappa * Y - G
    return first, -7 * mu * ca.jacobian(load, Y) * Yp / 2


def nu_product(equations: Equations, upsilon: Expression, by: ca.SX = Yp) -> ca.SX:
    """Equation (54) without its O(eps^4); ``by`` is the variable of d Lambda_N."""
    upper = ca.jacobian(upsilon, Xp) * Xp
    lower = ca.jacobian(equations.Lambda_N, by) * Yp
    return 1 + 20 * upper * G * eps / (7 * lower)  # g eps^3 = G eps
