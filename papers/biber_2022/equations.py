"""Every displayed equation of the paper, in order of appearance, with its check.

Verdicts: ``agrees``; ``corrected`` (an erratum applies); ``definition`` and ``assumption``, which
are checked for consistency where that means anything.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import casadi as ca
import numpy as np

import nonsmooth as ns

from ..claims import Check, close
from . import results
from .errata import erratum
from .errata_general import fold_of, generic, law
from .errata_linear import kelvin_voigt, scaling_residuals
from .exact import identical
from .model import G, Omega, Xp, Y, Yp, along, d1, d2, eps, eta, generalised, grad_H, mu
from .records import Equation

Checks = tuple[Check, ...]
AGREES, CORRECTED, DEFINITION, ASSUMPTION = "agrees", "corrected", "definition", "assumption"
_FORCE_T, _FORCE_N = ca.SX.sym("lT"), ca.SX.sym("lN")


# Section 2 -------------------------------------------------------------------------------------


def contact_point() -> Checks:
    """Velocity of the point below the centre of a turning ball."""
    yt = ca.SX.sym("yt")
    velocity = ca.vertcat(Xp, yt, 0) + ca.cross(ca.vertcat(0, 0, Omega), ca.vertcat(0, -1, 0))
    return (
        Check(
            "v + omega x r at r = (0, -1) is (x' + omega, y')",
            identical(velocity[0], Xp + Omega) and identical(velocity[1], yt),
        ),
    )


def moment_of_inertia() -> Checks:
    """Solid sphere: torque r x F over I."""
    density = 3 / (4 * np.pi)
    disc = np.polynomial.Polynomial([1, 0, -1]) ** 2 * (np.pi * density / 2)
    inertia = float(disc.integ()(1) - disc.integ()(-1))
    torque = ca.cross(ca.vertcat(0, -1, 0), ca.vertcat(_FORCE_T, _FORCE_N, 0))[2]
    return (
        close("moment of inertia of the solid unit sphere of unit mass", inertia, 0.4, 1e-15),
        Check("torque/I = (5/2) lambda_T", identical(5 * torque / 2, 5 * _FORCE_T / 2)),
    )


def per_impulse() -> Checks:
    """dv/dn with dn = lambda_N dt."""
    rate = 7 * _FORCE_T / 2 / _FORCE_N
    friction = [ca.substitute(rate, _FORCE_T, -s * mu * _FORCE_N) for s in (1, -1)]
    return (
        Check("forward slip: dv_T/dv_N = -(7/2) mu", identical(friction[0], -7 * mu / 2)),
        Check("reverse slip: dv_T/dv_N = +(7/2) mu", identical(friction[1], 7 * mu / 2)),
        Check("no tangential force: dv_T/dv_N = 0", identical(rate, 0, given=[(_FORCE_T, 0)])),
    )


def cases() -> Checks:
    """Cases I, II, III."""
    return results.rigid_cases().checks


# Section 3 -------------------------------------------------------------------------------------


def kv_rescaled() -> Checks:
    """The scaling that leads from eq. (11) to eq. (15)."""
    e2 = ca.SX.sym("e2")
    y, yt, g = (ca.SX.sym(n) for n in ("y", "yt", "g"))
    normal = e2**2 * (-2 * d2 / e2 * yt - y / e2**2 - g)
    return (
        Check(
            "X and Omega equations follow from eq. (11) with X = x, Omega = eps2 omega",
            all(identical(r) for r in scaling_residuals(ca.SX(1), e2, e2**2)),
        ),
        Check("Y equation follows", identical(normal, -2 * d2 * (e2 * yt) - y - e2**2 * g)),
    )


def special_case() -> Checks:
    """The linear model is the generalised one with constant functions."""
    model = generalised(2 * d1, 1, 2 * d2, 1, {s: None for s in (mu, G, eps, d1, d2)}, "constant")
    linear = kelvin_voigt()
    at_eta = [(eta, eps)]
    return (
        Check(
            "upsilon = 2 d1, zeta = 1, delta = 2 d2, kappa = 1, eps = eta: the same forces",
            identical(linear.A, model.A, given=at_eta)
            and identical(linear.Lambda_N, model.Lambda_N, given=at_eta),
        ),
    )


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
    return (
        Check(
            "largest dLambda_N/dY over Y in {-1, -0.1}, Y' in {-1, 0, 0.5} for the three laws used "
            "here: " + ", ".join(f"{r:.3g}" for r in rows),
            max(rows) < 0,
        ),
    )


def sliding() -> Checks:
    """F_s is tangent to the surface, for every law."""
    model = generic().equations
    return (
        Check("F_s.grad H = 0 identically", identical(ca.dot(model.F_s, grad_H), 0)),
        Check(
            "F_s has Lambda_T = -(2/7) A: X'' = (5/7) A, Omega' = -(5/7) A",
            identical(model.F_s[1], 5 * model.A / 7) and identical(model.F_s[4], -5 * model.A / 7),
        ),
    )


def full_system() -> Checks:
    """F_s on H = 0 holds only where alpha is in [0, 1]."""
    model = law("linear")
    state = [2.0, 0.5, -0.2, 0.3, -0.5]
    weight = model.value(model.alpha, state)
    region = ns.region(model.system, state)
    return (
        Check(
            f"on H = 0 at (X, X', Y, Y') = {state[:4]}: alpha = {weight:.3f}, "
            f"{region.name.lower().replace('_', ' ')}: there F_s does not apply",
            not 0 <= weight <= 1 and "CROSSING" in region.name,
        ),
    )


# Section 4 -------------------------------------------------------------------------------------


def tangential_scale() -> Checks:
    """u = upsilon, z = zeta gives eps upsilon and eps^2 zeta."""
    u, z, x, xt = (ca.SX.sym(n) for n in ("u", "z", "x", "xt"))
    left = eps**2 * (u * xt + z * x)
    return (
        Check(
            "eps^2 (u x' + z x) = eps upsilon X' + eps^2 zeta X identically",
            identical(left, eps * u * (eps * xt) + eps**2 * z * x),
        ),
    )


def coordinates() -> Checks:
    """z2 = 0 is alpha = 0 and z3 = 0 is alpha = 1."""
    fold, model = fold_of("polynomial"), law("polynomial")
    ends = []
    for z, weight in (((0.0, 0.02), 0.0), ((0.02, 0.0), 1.0)):
        ends.append(abs(model.value(model.alpha, fold.point_at(z)) - weight))
    return (
        Check(
            f"alpha at z2 = 0 and at z3 = 0 is 0 and 1 within {max(ends):.1e} (polynomial law)",
            max(ends) < 1e-10,
        ),
    )


def signs_and_numbers() -> Checks:
    """sigma and nu from second Lie derivatives, compared with ``ns.find_two_fold``."""
    fold, model = fold_of("exponential"), law("exponential")
    second = {k: model.value(model.lie(*k), fold.point) for k in ((1, 1), (1, 2), (2, 1), (2, 2))}
    root = np.sqrt(abs(second[1, 1] * second[2, 2]))
    return (
        close("nu1 by the definition", second[1, 2] / root, fold.nu[0], 1e-13),
        close("nu2 by the definition", -second[2, 1] / root, fold.nu[1], 1e-13),
        Check(
            "sigma by the definition",
            (np.sign(second[1, 1]), np.sign(second[2, 2])) == fold.sigma,
        ),
    )


def reduced_flow() -> Checks:
    """Equation (48) from equation (47)."""
    z2, z3, s1, s2, n1, n2 = (ca.SX.sym(n) for n in ("z2", "z3", "s1", "s2", "n1", "n2"))
    weight = z2 / (z2 + z3)
    second = (1 - weight) * -s1 + weight * n2
    third = (1 - weight) * n1 + weight * s2
    return (
        Check(
            "z2' = (nu2 z2 - sigma1 z3)/(z2 + z3)",
            identical(second, (n2 * z2 - s1 * z3) / (z2 + z3)),
        ),
        Check(
            "z3' = (sigma2 z2 + nu1 z3)/(z2 + z3)",
            identical(third, (s2 * z2 + n1 * z3) / (z2 + z3)),
        ),
    )


def regions() -> Checks:
    """Names of the four quadrants."""
    z = ca.SX.sym("z", 3)
    system = ns.FilippovSystem(
        ca.vertsplit(z), surface=z[0], above=[-z[1], -1, -2], below=[z[2], -1, -1]
    )
    wanted = {
        (1, 1): ns.Region.ATTRACTING,
        (-1, -1): ns.Region.REPELLING,
        (-1, 1): ns.Region.CROSSING_UP,
        (1, -1): ns.Region.CROSSING_DOWN,
    }
    found = {k: ns.region(system, [0.0, *k]) for k in wanted}
    return (
        Check("D_att attracts, D_rep repels, C1 crosses upwards, C2 downwards", found == wanted),
    )


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
    return (
        Check(
            f"signs of the eigenvalues and gamma_- in D_att as stated at {right} of {cases_seen} "
            "pairs (nu1, nu2)",
            right == cases_seen,
        ),
    )


def second_lie_order() -> Checks:
    """The second lines of eq. (51) leave out a term with a factor eps."""
    model = generic().equations
    drift = along(ca.vertcat(Xp, 0, Yp, 0, 0), model.A)
    slope = 7 * mu * Yp * ca.jacobian(model.Lambda_N, Y) / 2
    at_s = generic().at_two_fold
    return (
        Check(
            "(F2.grad)^2 H minus the printed term is X' A_X + Y' A_Y at s, for every law",
            identical(model.lie(2, 2) - slope, drift, given=at_s),
        ),
        Check(
            "A vanishes with eps, so the rest is O(eps)", identical(model.A, 0, given=[(eps, 0)])
        ),
    )


def from_erratum(*numbers: int) -> Checks:
    """Checks of the errata that correct the equation."""
    return tuple(c for n in numbers for c in erratum(n).checks)


def alpha_definition() -> Checks:
    """Equation (21) is the solution of F_s.grad H = 0."""
    model, weight = kelvin_voigt(), ca.SX.sym("weight")
    field = (1 - weight) * model.F1 + weight * model.F2
    return (
        Check(
            "the only alpha with F_s.grad H = 0",
            identical(ca.substitute(ca.dot(field, grad_H), weight, model.alpha), 0)
            and identical(ca.jacobian(ca.dot(field, grad_H), weight), model.lie(2) - model.lie(1)),
        ),
    )


def switching() -> Checks:
    """Equations (24) and (26)."""
    return results.switching().checks


Entry = tuple[str, str, str, Sequence[int], Callable[[], Checks] | None]

_ENTRIES: tuple[Entry, ...] = (
    ("Sec. 2.1, H", "H = x' + omega", DEFINITION, (), contact_point),
    (
        "Sec. 2.2, motion",
        "x'' = lT, y'' = lN - g, omega' = (5/2) lT",
        AGREES,
        (),
        moment_of_inertia,
    ),
    ("Sec. 2.2, v", "v = [v_Y, v_N]", CORRECTED, (1,), None),
    ("Sec. 2.2, dv/dt", "dv/dt = diag(7/2, 1) lambda", CORRECTED, (25,), None),
    ("Sec. 2.2, dv/dt rescaled", "dv/dt = m^-1 lambda~ + O(eps)", CORRECTED, (1,), None),
    ("Sec. 2.2, n", "n = integral of lambda_N dt~", DEFINITION, (), None),
    ("eq. (7)", "dv/dn = [(7/2) lT/lN, 1]", AGREES, (), per_impulse),
    ("eq. (8)", "dv_T/dv_N = +-(7/2) mu", AGREES, (), per_impulse),
    ("eq. (9)", "dv_T/dv_N = 0", AGREES, (), per_impulse),
    ("case I", "abs(H0/y'0) > (7/2) mu (1+r)", AGREES, (), cases),
    ("case II", "(7/2) mu < abs(H0/y'0) < (7/2) mu (1+r)", AGREES, (), cases),
    ("case III", "abs(H0/y'0) < (7/2) mu", AGREES, (), cases),
    ("Sec. 2.2, r", "r ~ exp(-pi d/2 + d^2/2 + O(d^3))", CORRECTED, (2,), None),
    ("eq. (11)", "linear Kelvin-Voigt model", ASSUMPTION, (), None),
    ("Sec. 3, lambda_N", "lN = -(2 d2/eps2) y' - y/eps2^2 - g", CORRECTED, (4,), None),
    ("Sec. 3, tau", "tau = t/eps2", DEFINITION, (), None),
    ("Sec. 3, eta", "eta = eps2/eps1 << 1", CORRECTED, (5,), None),
    ("eq. (15)", "X'' + 2 d1 eta X' + eta^2 X = Lambda_T, ..", AGREES, (6, 7), kv_rescaled),
    ("eq. (16)", "Lambda_N = -2 d2 Y' - Y - eps2^2 g", CORRECTED, (4,), None),
    ("Sec. 3.1, p'", "p' = F1 if H > 0, F2 if H < 0", DEFINITION, (), None),
    ("eq. (18)", "p = [X, X', Y, Y', Omega]", DEFINITION, (), None),
    ("Sec. 3.1, H", "H = X' + Omega", DEFINITION, (), contact_point),
    ("eq. (20)", "F_s = (1 - alpha) F1 + alpha F2", AGREES, (), sliding),
    ("eq. (21)", "alpha = F1.grad H/((F1 - F2).grad H)", AGREES, (), alpha_definition),
    ("Sec. 3.2, p'", "p' = F_s if H = 0 (where alpha is in [0, 1])", DEFINITION, (), full_system),
    ("Sec. 3.2, alpha", "alpha made explicit", CORRECTED, (9,), None),
    ("eq. (24)", "F1.grad H", AGREES, (), switching),
    ("eq. (25)", "(F1.grad)^2 H", CORRECTED, (11,), None),
    ("eq. (26)", "F2.grad H", AGREES, (), switching),
    ("eq. (27)", "4 d1 eta X' + eta^2 X = 0, Lambda_N = 0", CORRECTED, (10,), None),
    ("eq. (28)", "generalised model", ASSUMPTION, (), special_case),
    ("Sec. 4, slip", "abs(lT) = mu lN", CORRECTED, (4,), None),
    ("Sec. 4, roll", "abs(lT) < mu lN", CORRECTED, (4,), None),
    ("eq. (29)", "lN = -d y' - k y - g = 0", CORRECTED, (4,), None),
    ("eq. (30)", "u_y < 0, d_y < 0", ASSUMPTION, (), None),
    ("eq. (31)", "d lN/dy < 0", ASSUMPTION, (), sign_conditions),
    ("eq. (32)", "sign(u_x' < 0)) = sign x'", CORRECTED, (26,), None),
    ("Sec. 4, tau", "tau = t/eps", DEFINITION, (), None),
    (
        "eq. (34)",
        "k = kappa/eps, d = delta/eps^2",
        CORRECTED,
        (15,),
        None,
    ),
    ("Sec. 4, upsilon, zeta", "upsilon = u, zeta = z", AGREES, (), tangential_scale),
    ("eq. (36)", "derivatives of order one", ASSUMPTION, (), None),
    (
        "eq. (37)",
        "X'' + eps upsilon X' + eps^2 zeta X = Lambda_T, ..",
        AGREES,
        (7, 15),
        partial(from_erratum, 15),
    ),
    (
        "eq. (38)",
        "upsilon_Y < 0, delta_Y < 0, sign upsilon_X' = sign X'",
        ASSUMPTION,
        (),
        None,
    ),
    ("eq. (39)", "d Lambda_N/dY = d/dy(..) < 0", CORRECTED, (27,), None),
    ("Sec. 4, Lambda_T", "Lambda_T = -sign(H) Lambda_N", CORRECTED, (16,), None),
    (
        "Sec. 4, H, Lambda_N",
        "H = X' + Omega, Lambda_N = -(delta Y' + kappa Y + eps^2 g)",
        CORRECTED,
        (4,),
        None,
    ),
    ("generic_filippov", "p' = F1, F2", DEFINITION, (), None),
    (
        "Sec. 4.1, z",
        "z1 = theta H, z2 = -phi F1.grad z1, z3 = F2.grad z1/phi",
        AGREES,
        (),
        coordinates,
    ),
    ("Sec. 4.1, theta, phi", "theta, phi", AGREES, (), partial(from_erratum, 21)),
    (
        "Sec. 4.1, normal form",
        "z' = [-z2, -sigma1, nu1], [z3, nu2, sigma2]",
        CORRECTED,
        (21,),
        None,
    ),
    ("eq. (45)", "sigma_i = sign (F_i.grad)^2 H", DEFINITION, (), signs_and_numbers),
    ("eq. (46)", "nu1, nu2", DEFINITION, (), signs_and_numbers),
    ("eq. (47)", "sliding normal form", CORRECTED, (21,), None),
    ("eq. (48)", "z' = M z/(z2 + z3)", AGREES, (), reduced_flow),
    ("Sec. 4.1, regions", "D_att, D_rep, D_C1, D_C2", AGREES, (), regions),
    ("eq. (50)", "M = [[nu2, -1], [-1, nu1]]", AGREES, (), eigenvalue_cases),
    ("eq. (51)", "(F1.grad)^2 H at s", CORRECTED, (17,), None),
    ("eq. (52)", "(F2.grad)^2 H at s", AGREES, (17,), second_lie_order),
    ("Sec. 4.2, sigma", "sigma1 = 1, sigma2 = -1", CORRECTED, (19,), None),
    ("eq. (54)", "nu1 nu2 = 1 + (20/7) (..) g eps^3", CORRECTED, (18, 22), None),
)


def check(number: int) -> Equation:
    """Check one displayed equation, 1 to 60."""
    label, content, verdict, errata, compute = _ENTRIES[number - 1]
    checks = compute() if compute else from_erratum(*errata)
    return Equation(number, label, content, verdict, checks, tuple(errata))


ALL: tuple[Callable[[], Equation], ...] = tuple(
    partial(check, number) for number in range(1, len(_ENTRIES) + 1)
)
