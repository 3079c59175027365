"""The paper's main statements as theorems, proven in interval arithmetic (``nonsmooth.certify``).

Decimals are meant as written: mu = 0.3 is three tenths.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import casadi as ca

import bounce
import nonsmooth as ns

from ..claims import Check, Found
from .errata import erratum
from .results import claim, kv_pert_data, paper_ball

#: Ranges around the paper's parameters and of the state at lift-off, for which the theorem is.
PARAMETERS = {
    "mu": ("0.2", "0.4"),
    "d1": ("0.08", "0.12"),
    "d2": ("0.05", "0.15"),
    "eta": ("0.4", "0.6"),
    "G": ("0", "0.001"),
    "inertia": ("0.38", "0.42"),
    "slope": ("-0.01", "0.01"),
}
LIFT_OFF = {"ydot": ("0.6", "1"), "omega": ("-0.6", "0.6")}


@cache
def two_fold_proof() -> ns.proofs.Proof:
    """The ball's two-fold for all parameters and lift-off speeds of the ranges."""
    fold = ns.find_two_fold(
        paper_ball().system(), near=[-0.06, 0.1, -0.1, 0.8, -0.1], hold=["ydot", "omega"]
    )
    return ns.certify(fold, parameters=PARAMETERS, hold=LIFT_OFF, numbers="written", max_pieces=256)


@cache
def neighbour(name: str) -> ns.proofs.OrbitProof:
    """Trajectory B or C of Fig. 10, with its parameters as decimals."""
    data = kv_pert_data()
    ball = bounce.KelvinVoigt(load="net", **data["parameters"])
    start = data["trajectories"][name]["p0"]
    return ns.certify_orbit(ball.system(), start, 10, numbers="written")


def _everywhere(proof: ns.proofs.Proof, word: str) -> bool:
    pieces = proof.pieces or (proof,)
    return proof.proven and all(word in p.statement for p in pieces)


@claim("proven-nu-product")
def nu_product() -> Found:
    """nu1 nu2 = 1 and F1 = F2, for all parameters of a box."""
    proof = two_fold_proof()
    pieces = proof.pieces or (proof,)
    zero = all(p.values["Delta"].low == p.values["Delta"].high == "0" for p in pieces)
    negative = proof.values["nu1"].ends[1] < 0 and proof.values["nu2"].ends[1] < 0
    return (
        "theorem: for all mu in [0.2, 0.4], d1 in [0.08, 0.12], d2 in [0.05, 0.15], eta in [0.4, 0.6], G in "
        "[0, 0.001], inertia in [0.38, 0.42], ground inclined by up to 0.01, Y' in [0.6, 1], Omega in "
        "[-0.6, 0.6] there is exactly one two-fold (in a named box), F1 = F2 there and nu1 nu2 = 1 "
        "exactly, nu1, nu2 < 0",
        "ns.certify: Krawczyk's operator for existence and uniqueness, exact common factor of F1 - F2",
        *erratum("18").checks,
        Check("one two-fold for all parameters of the box", proof.exists),
        Check("F1 = F2 there by algebra, Delta = 0", zero and _everywhere(proof, "F1 = F2 there")),
        Check("nu1 and nu2 are negative", negative),
    )


@claim("proven-class")
def two_fold_class() -> Found:
    """The class, for all parameters of the box."""
    proof = two_fold_proof()
    return (
        "theorem: class VV-C1, one canard and no faux canard, for all parameters and lift-off speeds "
        "of the same box",
        "ns.certify: signs of L11, L22, T and Delta in enclosures",
        Check("visible on both sides and VV-C1 everywhere", proof.label == "VV-C1"),
        Check("one canard", _everywhere(proof, "Canards (Da -> s -> Dr): one")),
    )


@claim("proven-slip-reversal")
def slip_reversal() -> Found:
    """The neighbours of Fig. 10 lift off to both sides."""
    data = kv_pert_data()["trajectories"]
    checks = []
    for name, mode in (("B", "+"), ("C", "-")):
        proof, row = neighbour(name), data[name]
        ended = proof.proven and proof.status == "lift-off"
        checks.append(Check(f"{name} lifts off with itinerary s {mode}", ended))
        checks[-1] = Check(checks[-1].what, ended and proof.itinerary == f"s {mode}")
        # The reference is printed to 40 digits.
        near = all(
            abs(value.middle - float(v)) < 1e-14
            for value, v in zip(proof.end.values(), row["p_F"], strict=True)
        )
        checks.append(Check(f"{name} ends at the reference", near))
    return (
        "theorem: from the printed p0 with X'(0) lowered by 0.02 (B) the ball rolls, then lifts off in "
        "forward slip; raised by 0.02 (C), in reverse",
        "ns.certify_orbit: validated Taylor steps, events by interval Newton, decimals as written",
        *checks,
    )


#: Speeds X'(0) among which the canard is looked for: from B to C.
BETWEEN = ("-0.1803128", "-0.1403128")
#: How long before lift-off the canard is followed as an orbit.
LAST = Fraction(1, 10**9)


def rolling_ball() -> tuple[ns.FilippovSystem, dict[str, str]]:
    """A system whose points of rest (t, V) are zero load and force of Fig. 10's rolling ball."""
    data = kv_pert_data()
    numbers = {k: str(v) for k, v in data["parameters"].items()}
    x0, _, y0, w0, _ = data["trajectories"]["A_exact"]["p0"]
    names = ["k", "d1", "d2", "eta", "G", "X0", "Y0", "W0"]
    values = ["5/7", *(numbers[n] for n in names[1:5]), x0, y0, w0]
    p = dict(zip(names, map(ca.SX.sym, names), strict=True))
    k, d1, d2, eta, g, x, y, w = p.values()
    t, v = ca.SX.sym("t"), ca.SX.sym("V")
    lift, deep = _oscillation(t, y + g, w, d2, ca.SX(1))
    shift, speed = _oscillation(t, x, v, k * d1 * eta, k * eta**2)
    load, along = -2 * d2 * deep - lift, -2 * d1 * eta * speed - eta**2 * shift
    both = ns.FilippovSystem(
        [t, v], surface=t, above=[load, along], below=[1, 1], parameters=dict.fromkeys(p.values())
    )
    return both, dict(zip(names, values, strict=True))


def _oscillation(t: ca.SX, u: ca.SX, rate: ca.SX, d: ca.SX, stiff: ca.SX) -> tuple[ca.SX, ca.SX]:
    """u(t) and u'(t) of u'' + 2 d u' + stiff u = 0."""
    w = ca.sqrt(stiff - d**2)
    c, s, fall = ca.cos(w * t), ca.sin(w * t), ca.exp(-d * t)
    slope = (rate + d * u) / w
    return fall * (u * c + slope * s), fall * (rate * c - (d * rate + stiff * u) / w * s)


@cache
def canard_speed() -> ns.proofs.Census:
    """Every speed and time at which load and tangential force of the rolling ball vanish together."""
    both, values = rolling_ball()
    return ns.prove_all(
        both,
        [("0.001", "0.1"), BETWEEN],
        "equilibrium",
        parameters=values,
        numbers="written",
        width=1e-30,
    )


@cache
def canard_orbit() -> ns.proofs.OrbitProof:
    """The canard until shortly before its lift-off, with an edge of the friction cone as a stop."""
    data = kv_pert_data()
    speed, time = (canard_speed().zeros[0].point[name] for name in ("V", "t"))
    x, v, y, w = (ca.SX.sym(n) for n in ("X", "V", "Y", "W"))
    names = ["k", "mu", "d1", "d2", "eta", "G"]
    k, mu, d1, d2, eta, g = p = [ca.SX.sym(n) for n in names]
    load, along = -2 * d2 * w - y - g, -2 * d1 * eta * v - eta**2 * x
    system = ns.FilippovSystem(
        [x, v, y, w],
        field=[v, k * along, w, load],
        stops=[
            ns.Stop(load, -1, "load"),
            ns.Stop(mu * load - (1 - k) * along, -1, "forward"),
            ns.Stop(mu * load + (1 - k) * along, -1, "reverse"),
        ],
        parameters=p,
    )
    x0, _, y0, w0, _ = data["trajectories"]["A_exact"]["p0"]
    values = ["5/7", *(str(data["parameters"][n]) for n in names[1:])]
    return ns.certify_orbit(
        system,
        [x0, (speed.low, speed.high), y0, w0],
        Fraction(time.low) - LAST,
        parameters=dict(zip(names, values, strict=True)),
        numbers="written",
        bits=128,
    )


@claim("proven-canard")
def canard() -> Found:
    """One trajectory between B and C lifts off rolling."""
    found, orbit = canard_speed(), canard_orbit()
    reference = kv_pert_data()["trajectories"]["A_exact"]["p0"][1]
    speed = found.zeros[0].point["V"] if found.zeros else None
    near = speed is not None and abs(speed.ends[0] - Fraction(reference)) < Fraction(1, 10**30)
    followed = orbit.proven and orbit.status == "end" and not orbit.events
    return (
        "theorem: for X'(0) from B's to C's there is exactly one at which load and tangential force of "
        f"the rolling ball vanish together before t = 0.1, X'(0) = {speed}; until 1e-9 before, that ball "
        "is inside the friction cone",
        "ns.prove_all on the closed form of rolling; ns.certify_orbit with the cone's edges as stops",
        Check("exactly one speed and time, and the list is complete", _only(found)),
        Check("it is the canard's speed computed to 40 digits", near),
        Check("the ball rolls inside the cone until 1e-9 before", followed),
    )


def _only(found: ns.proofs.Census) -> bool:
    return found.complete and len(found.zeros) == 1
