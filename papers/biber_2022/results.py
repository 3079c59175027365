"""The claims of the paper, each computed: what it states, what comes out, and the verdict.

Numbers that a claim and an erratum share are computed once, in ``errata``.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq

import bounce
import nonsmooth as ns

from ..claims import Check, Found, Statements, close
from .errata import erratum
from .errata_general import fold_of, generic, law, reverse_slip_with_backspin
from .errata_linear import exit_in_compression, kelvin_voigt
from .exact import identical
from .figures_data import FITS, predictions
from .model import LAWS, Array, G, X, Xp, Y, Yp, d1, d2, eta, linear, mu
from .table import recomputed

DATA = Path(__file__).parent / "data"
BASE = dict(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)


@cache
def kv_pert_data() -> dict[str, Any]:
    """Read the reference trajectories of Fig. 10 (50-digit arithmetic)."""
    return json.loads((DATA / "kv_pert.json").read_text())


def paper_ball(**values: float) -> bounce.KelvinVoigt:
    """Equation (15) with the paper's normal load."""
    return bounce.KelvinVoigt(load="net", **{**BASE, **values})


@cache
def kv_pert_shot(name: str) -> bounce.Shot:
    """Simulate one trajectory of Fig. 10: A_printed, A_exact, B or C."""
    data = kv_pert_data()
    x, xdot, y, ydot, omega = (float(v) for v in data["trajectories"][name]["p0"])
    ball = paper_ball(**data["parameters"])
    return bounce.simulate(ball, xdot=xdot, ydot=ydot, omega=omega, x=x, y=y, tol=1e-13)


def last_state(shot: bounce.Shot) -> Array:
    """State p at lift-off."""
    end = shot.lift_off
    return np.array([end.x, end.xdot, end.y, end.ydot, end.omega])


claim = Statements(Path(__file__).with_name("README.md"))


# Section 2 -------------------------------------------------------------------------------------


@claim("rigid-cases")
def rigid_cases() -> Found:
    """Cases I, II and III by integration over the normal impulse."""
    slip, normal, lam = (ca.SX.sym(n) for n in ("vT", "vN", "lam"))
    friction, r, v0 = 0.3, 0.5, 1.25
    system = ns.FilippovSystem(
        [slip, normal],
        field=[-3.5 * friction * lam, 1],
        multipliers=[lam],
        surfaces=[slip],
        stops=[ns.Stop(normal - r * v0, 1)],
    )
    low, high = 3.5 * friction, 3.5 * friction * (1 + r)
    right = []
    for ratio in (0.3, 0.999 * low, 1.001 * low, 0.999 * high, 1.001 * high, 3.0):
        for letter, sign in (("+", 1), ("-", -1)):
            run = ns.simulate(system, [sign * ratio * v0, -v0], 10.0, tol=1e-12)
            target = letter if ratio > high else f"{letter} s"
            entries = [e.x[1] for e in run.events if e.kind == "entry"]
            in_compression = bool(entries) and entries[0] < 0
            right.append(run.itinerary == target and in_compression == (ratio < low))
    return (
        f"{sum(right)} of {len(right)} starts, on both sides of each boundary and of both signs, "
        "behave as stated",
        "impact integrated over the normal impulse, a Filippov system; mu = 0.3, r = 0.5",
        Check("every start falls in its case", all(right)),
    )


@claim("restitution")
def restitution() -> Found:
    """Restitution of a Kelvin-Voigt contact."""
    return (
        "the series is right, next term -pi d^3/16; the stiffness is 1/eps^2; underdamped to d = 2; "
        "exactly exp(-tan b (pi - 2b)), b = arcsin(d/2)",
        "simulation at four d; derivatives of the closed form at d = 0",
        *erratum("2").checks,
    )


@claim("slip-classes")
def slip_classes() -> Found:
    """What the models predict over the ranges of the experiments."""
    counts, checks = [], []
    for surface in FITS:
        h0, compliant, rigid = predictions(surface)
        forward = h0 > 0
        reverse = int(np.sum(compliant[forward] < 0))
        large = int(np.sum(compliant[forward] > 0))
        median, largest = np.median(compliant[compliant < 0]), compliant.max()
        wrong = int(np.sum(rigid[forward] < 0))
        counts.append(
            f"{surface}: {reverse} reverse (median {median:.0f}/s), {large} forward (to "
            f"{largest:.0f}/s), rigid law {wrong} reverse"
        )
        checks.append(Check(counts[-1], wrong == 0 and reverse > 0))
    return (
        "landings with H0 > 0 over the published ranges: "
        + "; ".join(counts)
        + ". The measurements themselves are not public",
        "256 landings for each surface, r and mu of the companion fits, d1 = 0.1, eta = 0.5, G = 0",
        *checks,
    )


# Section 3 -------------------------------------------------------------------------------------


@claim("ball-equations")
def ball_equations() -> Found:
    """The model of ``bounce`` is eq. (15)."""
    paper, worst = kelvin_voigt(), 0.0
    for values in (BASE, {**BASE, "d1": 0.4, "eta": 1.5, "G": 0.02}):
        shot = bounce.simulate(paper_ball(**values), xdot=0.7, ydot=-1.0, omega=0.6)
        run = shot.trajectory
        for state in shot(np.linspace(0, shot.time, 9)):
            for mode, field in (("+", paper.F1), ("-", paper.F2)):
                ours = run.system.evaluate(run.system.field(mode), state, run.parameters)
                theirs = paper.system.evaluate(field, state, values)
                worst = max(worst, float(np.abs(ours - theirs).max()))
    return (
        f"bounce.KelvinVoigt(load='net') has these fields, to {worst:.1e}",
        "both fields along two trajectories with different parameters",
        Check(f"largest difference {worst:.1e}", worst < 1e-14),
    )


@claim("alpha")
def alpha() -> Found:
    """Equation (21) made explicit."""
    return (
        "alpha = 1/2 - (2 d1 eta X' + eta^2 X)/(7 mu (S + G))",
        "identity in exact rational arithmetic; one state in numbers",
        *erratum("9").checks,
    )


@claim("switching")
def switching() -> Found:
    """Equations (24) and (26)."""
    model = kelvin_voigt()
    tangential = -2 * d1 * eta * Xp - eta**2 * X
    normal = 7 * mu * (2 * d2 * Yp + Y + G) / 2
    return (
        "both as printed",
        "identities in exact rational arithmetic",
        Check("F1.grad H as printed", identical(model.lie(1), tangential + normal)),
        Check("F2.grad H as printed", identical(model.lie(2), tangential - normal)),
    )


@claim("rolling-lift-off-conditions")
def two_conditions() -> Found:
    """Equation (27)."""
    return (
        "2 d1 eta X' + eta^2 X = 0; the second condition is right",
        "identity in exact rational arithmetic",
        *erratum("10").checks,
    )


@claim("second-lie-linear")
def second_lie() -> Found:
    """Equation (25)."""
    return (
        "(7/2) mu Y' + mu (7 d2 - 5 d1 eta) Lambda_N - eta^2 X', exactly",
        "identity in exact rational arithmetic on F1.grad H = 0",
        *erratum("11").checks,
    )


@claim("roll-to-slip")
def roll_to_slip() -> Found:
    """Where rolling can end."""
    shot = bounce.simulate(paper_ball(), xdot=0.7, ydot=-1.0, omega=0.6)
    leave = next(e for e in shot.trajectory.events if e.kind == "exit")
    early = exit_in_compression()
    return (
        "true for small eta; a stiff tangential surface (eta = 1) ends it in compression, at "
        f"tau = {early.t:.4f} with Y' = {early.x[3]:.3f}",
        "simulation",
        *erratum("12").checks,
        Check(
            f"d = 0.1, eta = 0.5, start (0, 0.7, 0, -1, 0.6): rolling ends at Y' = {leave.x[3]:.4f} > 0",
            leave.x[3] > 0,
        ),
    )


@cache
def dividing_points() -> list[dict[str, Any]]:
    """Critical spins at two landing speeds: one on each part of the dividing surface."""
    reference = json.loads((DATA / "dividing_points.json").read_text())["points"]
    model = linear(**BASE)
    found = []
    for row in reference:
        xp0, guess = float(row["Xp0"]), float(row["Omega0"])

        def crossing(spin: float, xp0: float = xp0) -> float:
            run = model.bounce([0, xp0, 0, -1, spin], tol=1e-13)
            end = run.x[-1]
            # After rolling H_F is quadratic in the distance from the critical spin, A linear.
            return model.value(model.A, end) if "s" in run.itinerary else float(end[1] + end[4])

        spin = brentq(crossing, guess - 0.01, guess + 0.01, xtol=1e-14)
        sides = [model.bounce([0, xp0, 0, -1, spin + d]).itinerary for d in (-1e-6, 1e-6)]
        found.append({"Xp0": xp0, "Omega0": spin, "error": abs(spin - guess), "sides": sides})
    return found


@claim("dividing-surface")
def dividing_surface() -> Found:
    """The surface between forward and reverse slip at lift-off."""
    rolling, slipping = dividing_points()
    return (
        f"so at X'0 = {rolling['Xp0']:.4f}, Omega0 = {rolling['Omega0']:.9f} "
        f"({rolling['sides'][0]} | {rolling['sides'][1]}); but the surface continues where the ball "
        f"slips throughout and H = 0 at lift-off: X'0 = {slipping['Xp0']:.4f}, Omega0 = "
        f"{slipping['Omega0']:.9f} ({slipping['sides'][0]} | {slipping['sides'][1]}), a second part "
        "that the paper does not mention",
        "root of A (after rolling) or of H at lift-off in Omega0, Y'0 = -1, by simulation",
        Check(
            f"both spins within {max(rolling['error'], slipping['error']):.1e} of the reference",
            max(rolling["error"], slipping["error"]) < 1e-9,
        ),
        Check("rolls on both sides of the first", rolling["sides"] == ["+ s -", "+ s +"]),
        Check("rolls on neither side of the second", slipping["sides"] == ["+ -", "+"]),
    )


@claim("which-compliance")
def normal_compliance() -> Found:
    """Which compliance ends rolling."""
    return (
        "tangential compliance does; with normal compliance only (eta = 0) it lifts off rolling",
        "simulation with eta = 0, 0.05, 0.5",
        *erratum("13").checks,
    )


@claim("slip-reversal")
def slip_reversal() -> Found:
    """One bounce that reverses its slip."""
    shot = bounce.simulate(paper_ball(), xdot=0.7, ydot=-1.0, omega=0.6, tol=1e-13)
    landing = shot.landing.slip
    return (
        f"H0 = {landing:+.2f} -> H_F = {shot.slip:+.6f}, itinerary {shot.itinerary!r}",
        "simulation, mu = 0.3, d1 = d2 = 0.1, eta = 0.5, G = 1e-4, start (0, 0.7, 0, -1, 0.6)",
        Check(
            "H changes sign through rolling",
            landing > 0 > shot.slip and shot.itinerary == "+ s -",
        ),
    )


@claim("no-rolling-lift-off")
def rolling_lift_off(n: int = 20) -> Found:
    """Lift-off on a grid of landings."""
    model = linear(**BASE)
    speeds = np.linspace(-2, 2, n)
    spins = np.linspace(-4, 4, n)
    starts = np.array([[0, u, 0, -1, w] for u in speeds for w in spins])
    runs = [model.bounce(s, tol=1e-10) for s in starts]
    rolled = [r for r in runs if "s" in r.itinerary]
    ending = sum(r.itinerary.endswith("s") for r in runs)
    smallest = min(abs(r.x[-1, 1] + r.x[-1, 4]) for r in runs)
    seen = sorted({r.itinerary for r in runs})
    return (
        f"{ending} of {len(runs)} landings lift off rolling, {len(rolled)} of them roll on the way; "
        f"smallest abs(H_F) = {smallest:.1e}; itineraries {', '.join(seen)}",
        f"simulation of a {n} x {n} grid over X'0 in [-2, 2], Omega0 in [-4, 4], Y'0 = -1 "
        "(the origin, which is on the dividing surface, is not on the grid)",
        Check("none rolls at lift-off, some rolled before", ending == 0 and len(rolled) > n),
    )


# Figure 10 --------------------------------------------------------------------------------


@claim("kv-pert-parameters")
def kv_pert_parameters() -> Found:
    """What the printed start says about the parameters that are not printed."""
    data = kv_pert_data()
    shot = kv_pert_shot("A_exact")
    values = data["parameters"]
    end = shot.lift_off
    residual = 2 * values["d1"] * end.xdot + values["eta"] * end.x
    required = float(data["Xp0_required"])
    printed = float(data["p0_printed"][1])
    return (
        "d1, d2, eta, eps2 are not given. p0 reaches the two-fold if 2 d1 X' + eta X = 0 at "
        f"lift-off; d1 = 0.098, d2 = 0.007, eta = 0.09, G = 0 does, with X'0 = {required:.10f}",
        "simulation of the family's roundest member",
        close("2 d1 X' + eta X at lift-off", residual, 0.0, 1e-15),
        Check("X'0 rounds to the printed digits", round(required, 7) == printed),
    )


@claim("kv-pert")
def kv_pert() -> Found:
    """The three trajectories of Fig. 10."""
    data, worst = kv_pert_data()["trajectories"], 0.0
    for name, reference in data.items():
        shot = kv_pert_shot(name)
        state = np.array([float(v) for v in reference["p_F"]])
        worst = max(
            worst,
            float(np.abs(last_state(shot) - state).max()),
            abs(shot.time - float(reference["tau_F"])),
        )
    slips = {name: kv_pert_shot(name).slip for name in data}
    names = {name: kv_pert_shot(name).itinerary for name in ("A_exact", "B", "C")}
    return (
        f"(A) {names['A_exact']}, H_F = {abs(slips['A_printed']):.0e}; (B) {names['B']}, H_F = "
        f"{slips['B']:.4e}; (C) {names['C']}, H_F = {slips['C']:.4e}",
        "bounce.simulate with the parameters above; B and C: X'0 -+ 0.02, Omega0 = -X'0",
        Check(f"lift-off states and times within {worst:.1e} of the reference", worst < 1e-10),
        Check(
            "A rolls to lift-off, B leaves to forward slip, C to reverse slip",
            list(names.values()) == ["s", "s +", "s -"]
            and abs(slips["A_printed"]) < 1e-15
            and slips["B"] > 0 > slips["C"],
        ),
    )


# Section 4 -------------------------------------------------------------------------------------


@claim("second-lie-general")
def second_lie_general() -> Found:
    """Equations (51) and (52)."""
    return (
        "X' A_X + Y' A_Y -+ (7/2) mu Y' dLambda_N/dY exactly: the second lines are right to O(eps), "
        "the first line is not",
        "identity in exact rational arithmetic for arbitrary values and gradients of the four laws",
        *erratum("17").checks,
    )


@claim("sigma")
def sigma() -> Found:
    """The signs at the two-fold."""
    folds = {name: fold_of(name) for name in LAWS}
    return (
        "; ".join(f"{n} law: sigma = {f.sigma}, {f.kind}" for n, f in folds.items()),
        "ns.find_two_fold near X' = 0.2, Y' = 0.7 for three laws",
        *(
            Check(f"{n}: {f.sigma}", f.sigma == (1, -1) and f.kind == "visible")
            for n, f in folds.items()
        ),
    )


@claim("visible-condition")
def visible() -> Found:
    """When the two-fold is visible."""
    return (
        "if and only if abs(X' A_X + Y' A_Y) < (7/2) mu Y' abs(dLambda_N/dY): not for a stiff "
        "tangential surface, nor for Hertz laws with little gravity (visible-invisible there)",
        "identity, and three two-folds on both sides of the condition",
        *erratum("19").checks,
    )


@claim("nu-product")
def nu_product() -> Found:
    """Equation (54)."""
    products = ", ".join(
        f"{abs(f.nu[0] * f.nu[1] - 1):.1e} ({n})" for n, f in ((n, fold_of(n)) for n in LAWS)
    )
    return (
        f"nu1 nu2 = 1 exactly at every visible two-fold: abs(nu1 nu2 - 1) = {products}",
        "identity for arbitrary laws; ns.find_two_fold for three",
        *erratum("18").checks,
    )


@claim("one-canard")
def one_canard() -> Found:
    """How many orbits reach the two-fold."""
    folds = {name: fold_of(name) for name in LAWS}
    return (
        "; ".join(
            f"{n} law: {f.label}, {f.canards:g} canard, {f.faux_canards:g} faux"
            for n, f in folds.items()
        )
        + ". The saddle of the paper is a singular matrix here, but its portrait is the same",
        "classification of the computed two-folds; both eigenvalues and the negative one's direction "
        "in Da",
        *(
            Check(
                f"{n}: one canard, slope {f.slopes[0]:.4f} > 0, eigenvalues "
                f"{f.eigenvalues[0]:.4f} and {abs(f.eigenvalues[1]):.0e}",
                f.canards == 1 and f.slopes[0] > 0 and abs(f.eigenvalues[1]) < 1e-14,
            )
            for n, f in folds.items()
        ),
    )


@claim("singular-matrix")
def coincident_fields() -> Found:
    """The matrix of eq. (50) at the ball's two-fold."""
    folds = [fold_of(n) for n in LAWS]
    g = generic()
    product = g.equations.lie(1, 2) * g.equations.lie(2, 1)
    square = g.equations.lie(1, 1) * g.equations.lie(2, 2)
    return (
        "det M = nu1 nu2 - 1 = 0: both fields coincide at s and rolling passes through it smoothly; "
        "s is a regular point of the rolling flow",
        "identity for arbitrary laws; three computed two-folds",
        Check(
            "L12 L21 = L11 L22 at s for every law",
            identical(product, square, given=g.at_two_fold),
        ),
        Check(
            "the zero eigenvector lies in the lift-off surface, slope -1/phi^2",
            all(abs(f.slopes[1] + f.phi**-2) < 1e-13 for f in folds),
        ),
        Check("fields coincide at the computed two-folds", all(f.coincident_fields for f in folds)),
    )


@claim("rigid-limit")
def rigid_limit() -> Found:
    """alpha = 1/2 in the rigid limit."""
    return (
        "alpha = 1/2 identically at eta = 0; so it is wherever A = 0",
        "identity in exact rational arithmetic",
        Check("alpha = 1/2 at eta = 0", identical(kelvin_voigt().alpha, 0.5, given=[(eta, 0)])),
        Check(
            "alpha = 1/2 at A = 0",
            identical(law("linear").alpha, 0.5, given=[(X, -2 * d1 * Xp / eta)]),
        ),
    )


@claim("topspin-or-slip")
def spin_and_slip() -> Found:
    """What the dividing surface divides."""
    slip, spin = reverse_slip_with_backspin()
    return (
        f"it divides forward from reverse slip: H_F = {slip:.2e} with Omega_F = {spin:+.4f} is "
        "reverse slip with backspin",
        "simulation",
        *erratum("20").checks,
    )


@claim("table-ics")
def table() -> Found:
    """Table 1."""
    rows = recomputed()
    wrong = [r for r in rows if not r.fits_all]
    listed = "; ".join(f"{r.printed} should be {r.computed:.4g}" for r in wrong)
    return (
        f"{len(wrong)} of {len(rows)} entries do not follow from their dimensional ones: {listed}",
        "recomputed with the roundings of both columns",
        *erratum("23").checks,
    )
