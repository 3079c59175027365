"""The paper's main statements as theorems, proven in interval arithmetic (``nonsmooth.certify``).

Decimals are meant as written: mu = 0.3 is three tenths.
"""

from __future__ import annotations

from functools import cache

import bounce
import nonsmooth as ns

from ..claims import AGREES, Check, Claim
from .results import corrected, kv_pert_data, paper_ball

#: Ranges around the paper's parameters and of the state at lift-off, for which the theorem is.
PARAMETERS = {
    "mu": ("0.25", "0.35"),
    "d1": ("0.08", "0.12"),
    "d2": ("0.08", "0.12"),
    "eta": ("0.45", "0.55"),
    "G": ("0", "0.001"),
    "inertia": "0.4",
    "slope": 0,
}
LIFT_OFF = {"ydot": ("0.6", "1"), "omega": ("-0.6", "0.6")}


@cache
def two_fold_proof() -> ns.Proof:
    """The ball's two-fold for all parameters and lift-off speeds of the ranges."""
    fold = ns.find_two_fold(
        paper_ball().system(), near=[-0.06, 0.1, -0.1, 0.8, -0.1], hold=["ydot", "omega"]
    )
    return ns.certify(fold, parameters=PARAMETERS, hold=LIFT_OFF, numbers="written")


@cache
def neighbour(name: str) -> ns.OrbitProof:
    """Trajectory B or C of figure kv_pert, with its parameters as decimals."""
    data = kv_pert_data()
    ball = bounce.KelvinVoigt(load="net", **data["parameters"])
    start = data["trajectories"][name]["p0"]
    return ns.certify_orbit(ball.system(), start, 10, numbers="written")


def _everywhere(proof: ns.Proof, word: str) -> bool:
    pieces = proof.pieces or (proof,)
    return proof.proven and all(word in p.statement for p in pieces)


def nu_product() -> Claim:
    """nu1 nu2 = 1 and F1 = F2, for all parameters of a box."""
    proof = two_fold_proof()
    pieces = proof.pieces or (proof,)
    zero = all(p.values["Delta"].low == p.values["Delta"].high == "0" for p in pieces)
    negative = proof.values["nu1"].ends[1] < 0 and proof.values["nu2"].ends[1] < 0
    claim = corrected(
        "proven-nu-product",
        "(nus_calc)",
        "nu1 nu2 = 1 + O(eps^3) < 1 at the two-fold of the ball",
        "theorem: for all mu in [.25, .35], d1, d2 in [.08, .12], eta in [.45, .55], G in [0, .001], "
        "Y' in [.6, 1], Omega in [-.6, .6] there is exactly one two-fold (in a named box), F1 = F2 "
        "there and nu1 nu2 = 1 exactly, nu1, nu2 < 0",
        18,
        "ns.certify: Krawczyk's operator for existence and uniqueness, exact common factor of F1 - F2",
    )
    checks = (
        Check("one two-fold for all parameters of the box", proof.exists),
        Check("F1 = F2 there by algebra, Delta = 0", zero and _everywhere(proof, "F1 = F2 there")),
        Check("nu1 and nu2 are negative", negative),
    )
    return Claim(**{**vars(claim), "checks": (*claim.checks, *checks)})


def two_fold_class() -> Claim:
    """The class, for all parameters of the box."""
    proof = two_fold_proof()
    return Claim(
        "proven-class",
        "Sec. 4, after (nus_calc)",
        "the two-fold is visible and one orbit, a canard, lifts off rolling",
        "theorem: class VV-C1, one canard and no faux canard, for all parameters and lift-off speeds "
        "of the same box",
        AGREES,
        "ns.certify: signs of L11, L22, T and Delta in enclosures",
        (
            Check("visible on both sides and VV-C1 everywhere", proof.label == "VV-C1"),
            Check("one canard", _everywhere(proof, "Canards (Da -> s -> Dr): one")),
        ),
    )


def slip_reversal() -> Claim:
    """The neighbours of figure kv_pert lift off to both sides."""
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
    return Claim(
        "proven-slip-reversal",
        "figure kv_pert",
        "trajectories on both sides of the canard lift off in forward and in reverse slip",
        "theorem: from the printed p0 with X'(0) lowered by .02 (B) the ball rolls, then lifts off in "
        "forward slip; raised by .02 (C), in reverse",
        AGREES,
        "ns.certify_orbit: validated Taylor steps, events by interval Newton, decimals as written",
        tuple(checks),
    )


ALL = (nu_product, two_fold_class, slip_reversal)
