"""Every displayed equation of the paper, in order of appearance, with its check.

Verdicts: ``agrees``; ``corrected`` (an erratum applies); ``definition`` and ``assumption``, which
are checked for consistency where that means anything.
"""

from __future__ import annotations

import re
from functools import partial

import casadi as ca
import numpy as np

import nonsmooth as ns

from ..claims import Check, Checks, close
from . import results
from .errata import erratum
from .errata_general import fold_of, generic, law
from .errata_linear import kelvin_voigt, scaling_residuals
from .exact import identical
from .model import G, Omega, Xp, Y, Yp, along, d1, d2, eps, eta, generalised, grad_H, mu
from .records import EQUATIONS, Equation

_FORCE_T, _FORCE_N = ca.SX.sym("lT"), ca.SX.sym("lN")


# Section 2 -------------------------------------------------------------------------------------


@EQUATIONS("1", "22")
def contact_point() -> Checks:
    """Velocity of the point below the centre of a turning ball."""
    yt = ca.SX.sym("yt")
    velocity = ca.vertcat(Xp, yt, 0) + ca.cross(ca.vertcat(0, 0, Omega), ca.vertcat(0, -1, 0))
    yield Check(
        "v + omega x r at r = (0, -1) is (x' + omega, y')",
        identical(velocity[0], Xp + Omega) and identical(velocity[1], yt),
    )


@EQUATIONS("2")
def moment_of_inertia() -> Checks:
    """Solid sphere: torque r x F over I."""
    density = 3 / (4 * np.pi)
    disc = np.polynomial.Polynomial([1, 0, -1]) ** 2 * (np.pi * density / 2)
    inertia = float(disc.integ()(1) - disc.integ()(-1))
    torque = ca.cross(ca.vertcat(0, -1, 0), ca.vertcat(_FORCE_T, _FORCE_N, 0))[2]
    yield close("moment of inertia of the solid unit sphere of unit mass", inertia, 0.4, 1e-15)
    yield Check("torque/I = (5/2) lambda_T", identical(5 * torque / 2, 5 * _FORCE_T / 2))


@EQUATIONS("7", "8", "9")
def per_impulse() -> Checks:
    """dv/dn with dn = lambda_N dt."""
    rate = 7 * _FORCE_T / 2 / _FORCE_N
    friction = [ca.substitute(rate, _FORCE_T, -s * mu * _FORCE_N) for s in (1, -1)]
    yield Check("forward slip: dv_T/dv_N = -(7/2) mu", identical(friction[0], -7 * mu / 2))
    yield Check("reverse slip: dv_T/dv_N = +(7/2) mu", identical(friction[1], 7 * mu / 2))
    yield Check("no tangential force: dv_T/dv_N = 0", identical(rate, 0, given=[(_FORCE_T, 0)]))


@EQUATIONS("10", "11", "12")
def cases() -> Checks:
    """Cases I, II, III."""
    return results.rigid_cases().checks


# Section 3 -------------------------------------------------------------------------------------


@EQUATIONS("18")
def kv_rescaled() -> Checks:
    """The scaling that leads from eq. (11) to eq. (15)."""
    e2 = ca.SX.sym("e2")
    y, yt, g = (ca.SX.sym(n) for n in ("y", "yt", "g"))
    normal = e2**2 * (-2 * d2 / e2 * yt - y / e2**2 - g)
    yield Check(
        "X and Omega equations follow from eq. (11) with X = x, Omega = eps2 omega",
        all(identical(r) for r in scaling_residuals(ca.SX(1), e2, e2**2)),
    )
    yield Check("Y equation follows", identical(normal, -2 * d2 * (e2 * yt) - y - e2**2 * g))


@EQUATIONS("31")
def special_case() -> Checks:
    """The linear model is the generalised one with constant functions."""
    model = generalised(2 * d1, 1, 2 * d2, 1, {s: None for s in (mu, G, eps, d1, d2)}, "constant")
    linear = kelvin_voigt()
    at_eta = [(eta, eps)]
    yield Check(
        "upsilon = 2 d1, zeta = 1, delta = 2 d2, kappa = 1, eps = eta: the same forces",
        identical(linear.A, model.A, given=at_eta)
        and identical(linear.Lambda_N, model.Lambda_N, given=at_eta),
    )


@EQUATIONS("36")
def sign_conditions() -> Checks:
    """The polynomial and exponential laws used here meet the assumptions of Sec. 4."""
    rows = []
    for name in ("linear", "polynomial", "exponential"):
        model = law(name)
        slope = ca.jacobian(model.Lambda_N, Y)
        rows.append(
            max(
                model.value(slope, [0.1, 0.3, y, w, -0.3])
                for y in (-1.0, -0.1)
                for w in (-1.0, 0.0, 0.5)
            )
        )
    yield Check(
        "largest dLambda_N/dY over Y in {-1, -0.1}, Y' in {-1, 0, 0.5} for the three laws used "
        "here: " + ", ".join(f"{r:.3g}" for r in rows),
        max(rows) < 0,
    )


@EQUATIONS("23")
def sliding() -> Checks:
    """F_s is tangent to the surface, for every law."""
    model = generic().equations
    yield Check("F_s.grad H = 0 identically", identical(ca.dot(model.F_s, grad_H), 0))
    yield Check(
        "F_s has Lambda_T = -(2/7) A: X'' = (5/7) A, Omega' = -(5/7) A",
        identical(model.F_s[1], 5 * model.A / 7) and identical(model.F_s[4], -5 * model.A / 7),
    )


@EQUATIONS("25")
def full_system() -> Checks:
    """F_s on H = 0 holds only where alpha is in [0, 1]."""
    model = law("linear")
    state = [2.0, 0.5, -0.2, 0.3, -0.5]
    weight = model.value(model.alpha, state)
    region = ns.region(model.system, state)
    yield Check(
        f"on H = 0 at (X, X', Y, Y') = {state[:4]}: alpha = {weight:.3f}, "
        f"{region.name.lower().replace('_', ' ')}: there F_s does not apply",
        not 0 <= weight <= 1 and "CROSSING" in region.name,
    )


# Section 4 -------------------------------------------------------------------------------------


@EQUATIONS("40")
def tangential_scale() -> Checks:
    """u = upsilon, z = zeta gives eps upsilon and eps^2 zeta."""
    u, z, x, xt = (ca.SX.sym(n) for n in ("u", "z", "x", "xt"))
    left = eps**2 * (u * xt + z * x)
    yield Check(
        "eps^2 (u x' + z x) = eps upsilon X' + eps^2 zeta X identically",
        identical(left, eps * u * (eps * xt) + eps**2 * z * x),
    )


@EQUATIONS("48")
def coordinates() -> Checks:
    """z2 = 0 is alpha = 0 and z3 = 0 is alpha = 1."""
    fold, model = fold_of("polynomial"), law("polynomial")
    ends = []
    for z, weight in (((0.0, 0.02), 0.0), ((0.02, 0.0), 1.0)):
        ends.append(abs(model.value(model.alpha, fold.point_at(z)) - weight))
    yield Check(
        f"alpha at z2 = 0 and at z3 = 0 is 0 and 1 within {max(ends):.1e} (polynomial law)",
        max(ends) < 1e-10,
    )


@EQUATIONS("51", "52")
def signs_and_numbers() -> Checks:
    """sigma and nu from second Lie derivatives, compared with ``ns.find_two_fold``."""
    fold, model = fold_of("exponential"), law("exponential")
    second = {k: model.value(model.lie(*k), fold.point) for k in ((1, 1), (1, 2), (2, 1), (2, 2))}
    root = np.sqrt(abs(second[1, 1] * second[2, 2]))
    yield close("nu1 by the definition", second[1, 2] / root, fold.nu[0], 1e-13)
    yield close("nu2 by the definition", -second[2, 1] / root, fold.nu[1], 1e-13)
    yield Check(
        "sigma by the definition",
        (np.sign(second[1, 1]), np.sign(second[2, 2])) == fold.sigma,
    )


@EQUATIONS("54")
def reduced_flow() -> Checks:
    """Equation (48) from equation (47)."""
    z2, z3, s1, s2, n1, n2 = (ca.SX.sym(n) for n in ("z2", "z3", "s1", "s2", "n1", "n2"))
    weight = z2 / (z2 + z3)
    second = (1 - weight) * -s1 + weight * n2
    third = (1 - weight) * n1 + weight * s2
    yield Check(
        "z2' = (nu2 z2 - sigma1 z3)/(z2 + z3)",
        identical(second, (n2 * z2 - s1 * z3) / (z2 + z3)),
    )
    yield Check(
        "z3' = (sigma2 z2 + nu1 z3)/(z2 + z3)",
        identical(third, (s2 * z2 + n1 * z3) / (z2 + z3)),
    )


@EQUATIONS("55")
def regions() -> Checks:
    """Names of the four quadrants."""
    z = ca.SX.sym("z", 3)
    system = ns.FilippovSystem(
        ca.vertsplit(z), surface=z[0], above=[-z[1], -1, -2], below=[z[2], -1, -1]
    )
    target = {
        (1, 1): ns.Region.ATTRACTING,
        (-1, -1): ns.Region.REPELLING,
        (-1, 1): ns.Region.CROSSING_UP,
        (1, -1): ns.Region.CROSSING_DOWN,
    }
    found = {k: ns.region(system, [0.0, *k]) for k in target}
    yield Check("D_att attracts, D_rep repels, C1 crosses upwards, C2 downwards", found == target)


@EQUATIONS("56")
def eigenvalue_cases() -> Checks:
    """The three cases of Sec. 4.2 on a grid of nu."""
    values = np.linspace(-3, 3, 25)
    right = 0
    cases_seen = 0
    for n1 in values:
        for n2 in values:
            if abs(n1 * n2 - 1) < 1e-9:
                continue
            low, high = np.linalg.eigvalsh([[n2, -1.0], [-1.0, n1]])
            slope = n2 - low  # z3/z2 of the lower eigenvalue's direction
            if n1 * n2 < 1:
                good = low < 0 < high and slope > 0
            else:
                good = (0 < low if n1 > 0 else high < 0) and slope > 0
            right += bool(good)
            cases_seen += 1
    yield Check(
        f"signs of the eigenvalues and gamma_- in D_att as stated at {right} of {cases_seen} "
        "pairs (nu1, nu2)",
        right == cases_seen,
    )


@EQUATIONS("58")
def second_lie_order() -> Checks:
    """The second lines of eq. (51) leave out a term with a factor eps."""
    model = generic().equations
    drift = along(ca.vertcat(Xp, 0, Yp, 0, 0), model.A)
    slope = 7 * mu * Yp * ca.jacobian(model.Lambda_N, Y) / 2
    at_s = generic().at_two_fold
    yield Check(
        "(F2.grad)^2 H minus the printed term is X' A_X + Y' A_Y at s, for every law",
        identical(model.lie(2, 2) - slope, drift, given=at_s),
    )
    yield Check(
        "A vanishes with eps, so the rest is O(eps)", identical(model.A, 0, given=[(eps, 0)])
    )


def from_errata(*numbers: str) -> tuple[Check, ...]:
    """Checks of the errata that correct the equation."""
    return tuple(c for n in numbers for c in erratum(n).checks)


EQUATIONS("42")(partial(from_errata, "15"))
EQUATIONS("49")(partial(from_errata, "21"))


@EQUATIONS("24")
def alpha_definition() -> Checks:
    """Equation (21) is the solution of F_s.grad H = 0."""
    model, weight = kelvin_voigt(), ca.SX.sym("weight")
    field = (1 - weight) * model.F1 + weight * model.F2
    yield Check(
        "the only alpha with F_s.grad H = 0",
        identical(ca.substitute(ca.dot(field, grad_H), weight, model.alpha), 0)
        and identical(ca.jacobian(ca.dot(field, grad_H), weight), model.lie(2) - model.lie(1)),
    )


@EQUATIONS("27", "29")
def switching() -> Checks:
    """Equations (24) and (26)."""
    return results.switching().checks


def check(number: str) -> Equation:
    """Check one displayed equation; what an erratum corrects has its checks."""
    if number in EQUATIONS.computed:
        return EQUATIONS.computed[number]()
    said = EQUATIONS.cells[number][2]
    corrects = re.findall(r"\d+", said)
    return Equation(number, *EQUATIONS.cells[number], from_errata(*corrects))


ALL = tuple(partial(check, number) for number in EQUATIONS.cells)
