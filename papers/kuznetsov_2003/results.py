"""The claims: local objects by ``ns.classify``, cycles by simulation.

Statements marked so are quoted from memory, as are the parameters: the paper was not at hand.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

import nonsmooth as ns

from ..claims import Check, Found, Statements, close, named, value_of
from .model import (
    BOUNDARY_FOCUS,
    BOUNDARY_NODE,
    FREE_FOLD,
    HARVESTED_FOLD,
    PROBLEM,
    SADDLE_NODE,
    SYSTEM,
    at,
    free_cycle,
    landing,
    period,
    pseudo_equilibria,
    run_from_fold,
    sliding_homoclinic,
)

claim = Statements(Path(__file__).with_name("README.md"))


_reference = partial(value_of, PROBLEM)


def _kind(point: list[float], alpha: float) -> str:
    found = ns.classify(SYSTEM, point, parameters=at(alpha))
    return f"{found.label} {found.kind}" if found.label != found.kind else found.kind


@claim("sliding-segment")
def folds() -> Found:
    """Folds and the sliding segment between them."""
    free = ns.find_fold(SYSTEM, [0.05, 0.9], side="-", parameters=at(0.9))
    harvested = ns.find_fold(SYSTEM, [0.7, 0.9], side="+", parameters=at(0.9))
    middle = _kind([0.4, 0.9], 0.9)
    outside = [_kind([x, 0.9], 0.9) for x in (0.02, 0.9)]
    return (
        f"attracting sliding for {free.point[0]:.6f} < x1 < {harvested.point[0]:.6f}, whatever alpha; "
        "crossing outside",
        "find_fold; b d/(a - d) and b (d + E)/(a - d - E); classify",
        close("fold of the free field", free.point[0], _reference("fold of F2"), 1e-14),
        close("by formula", FREE_FOLD, _reference("fold of F2"), 1e-14),
        close("fold of the harvested field", harvested.point[0], _reference("fold of F1"), 1e-14),
        close("by formula", HARVESTED_FOLD, _reference("fold of F1"), 1e-14),
        Check(f"between: {middle}", middle == "attracting sliding sliding"),
        Check(f"outside: {outside}", outside == ["crossing down crossing", "crossing up crossing"]),
    )


@claim("pseudo-equilibria")
def pseudo() -> Found:
    """Pseudo-equilibria over the threshold."""
    checks = []
    for alpha in (0.85, 0.95, 1.1):
        saddle, node = pseudo_equilibria(alpha)
        found = ns.find_pseudo_equilibrium(SYSTEM, [node, alpha], parameters=at(alpha))
        checks.append(close(f"alpha = {alpha}: pseudo-node", found.point[0], node, 1e-12))
        checks.append(Check(found.kind, found.kind == "stable pseudo-node"))
        found = ns.find_pseudo_equilibrium(SYSTEM, [saddle, alpha], parameters=at(alpha))
        real = alpha > BOUNDARY_FOCUS
        checks.append(Check(f"the other: {found.status}", (found.status == "real") == real))
        if real:
            checks.append(Check(found.kind, found.kind == "pseudo-saddle"))
    return (
        "(1 - x1)(b + x1) = a alpha: a stable pseudo-node for "
        f"{BOUNDARY_NODE:.6f} < alpha < {SADDLE_NODE:.6f} and a pseudo-saddle for "
        f"{BOUNDARY_FOCUS:.6f} < alpha < {SADDLE_NODE:.6f}",
        "find_pseudo_equilibrium; the quadratic equation",
        *checks,
    )


@claim("boundary-focus")
def boundary_focus() -> Found:
    """The equilibrium of the free field on the threshold."""
    at_surface = ns.find_boundary_equilibrium(
        SYSTEM, [0.04, 0.92], vary="alpha", side="-", parameters=at(0.9)
    )
    point, alpha = at_surface.point, at_surface.value
    found = ns.classify(SYSTEM, point, parameters=at_surface.parameters)
    status = [
        ns.find_equilibrium(SYSTEM, point, side="-", parameters=at(alpha + d))
        for d in (-0.02, 0.02)
    ]
    beyond = found.evidence["landing"] / found.evidence["pseudo"]
    return (
        f"at alpha = {alpha:.12f} an unstable focus of the free field: class {found.label}, nonsmooth "
        "fold. Above it the focus is real and with it appears a pseudo-saddle; the orbit from the "
        f"fold lands {beyond:.4f} times as far from the fold as the pseudo-saddle is, so there is no "
        "small sliding cycle",
        "find_boundary_equilibrium, classify",
        close("alpha", alpha, _reference("boundary focus"), 1e-12),
        close("by formula", BOUNDARY_FOCUS, _reference("boundary focus"), 1e-14),
        Check(
            f"class {found.label} of the field on the side {found.side}",
            (found.label, found.side) == ("BF3", "-"),
        ),
        Check(found.detail.unfolding, found.detail.unfolding == "nonsmooth fold"),
        Check(
            f"{status[0].status} below, {status[1].status} above; {status[1].kind}",
            [s.status for s in status] == ["virtual", "real"]
            and status[1].kind == "unstable focus",
        ),
        Check(f"landing {beyond:.4f} of the distance of the pseudo-saddle", beyond > 1),
    )


@claim("after-the-boundary-focus")
def no_small_cycle() -> Found:
    """Between the boundary focus and the homoclinic orbit everything goes to the pseudo-node."""
    levels = (0.93, 0.95, 1.0, 1.05, 1.1, 1.15, 1.18)
    gaps = [landing(a)[1] - pseudo_equilibria(a)[0] for a in levels]
    ends = [run_from_fold(a, 400.0).x[-1, 0] - pseudo_equilibria(a)[1] for a in levels]
    return (
        "it lands beyond the pseudo-saddle and slides to the pseudo-node, for alpha from 0.93 to 1.18",
        "simulation at seven thresholds",
        Check(f"beyond the pseudo-saddle by {min(gaps):.2g} at least", min(gaps) > 0),
        close("largest distance from the pseudo-node", float(np.abs(ends).max()), 0, 1e-6),
    )


@claim("boundary-node")
def boundary_node() -> Found:
    """The equilibrium of the harvested field on the threshold."""
    at_surface = ns.find_boundary_equilibrium(
        SYSTEM, [0.72, 0.8], vary="alpha", side="+", parameters=at(0.8)
    )
    point, alpha = at_surface.point, at_surface.value
    found = ns.classify(SYSTEM, point, parameters=at_surface.parameters)
    before = ns.find_equilibrium(SYSTEM, point, side="+", parameters=at(alpha - 0.02))
    after = ns.find_pseudo_equilibrium(
        SYSTEM, [pseudo_equilibria(alpha + 0.02)[1], alpha], parameters=at(alpha + 0.02)
    )
    return (
        f"at alpha = {alpha:.12f} a stable node of the harvested field: class {found.label}, "
        "persistence. It turns into the stable pseudo-node",
        "find_boundary_equilibrium, classify; equilibria 0.02 to either side",
        close("alpha", alpha, _reference("boundary node"), 1e-12),
        close("by formula", BOUNDARY_NODE, _reference("boundary node"), 1e-14),
        Check(
            f"class {found.label} of the field on the side {found.side}",
            (found.label, found.side) == ("BN1", "+"),
        ),
        Check(found.detail.unfolding, found.detail.unfolding == "persistence"),
        named("before: ", before, "real", "stable node"),
        named("after: ", after, "real", "stable pseudo-node"),
    )


@claim("pseudo-saddle-node")
def saddle_node() -> Found:
    """Where the two pseudo-equilibria merge."""
    x1 = (1 - 0.3) / 2
    found = ns.classify(SYSTEM, [x1, SADDLE_NODE], parameters=at(SADDLE_NODE))
    counts = [len(pseudo_equilibria(SADDLE_NODE + d)) for d in (-1e-3, 1e-3)]
    return (
        f"at alpha = (1 + b)^2/(4 a) = {SADDLE_NODE:.12f}, x1 = (1 - b)/2: pseudo-saddle and "
        f"pseudo-node merge; second derivative of the sliding speed "
        f"{found.evidence['second derivative of g']:.6f}",
        "classify at the point; number of pseudo-equilibria 0.001 to either side",
        close("alpha", SADDLE_NODE, _reference("pseudo-saddle-node"), 1e-14),
        Check(f"class {found.label}", found.label == "pseudo-saddle-node"),
        Check(f"{counts} pseudo-equilibria", counts == [2, 0]),
    )


@claim("sliding-homoclinic")
def homoclinic() -> Found:
    """A sliding cycle is born shortly before the pseudo-saddle-node."""
    alpha = sliding_homoclinic()
    below, above = (run_from_fold(alpha + d, 4000.0).itinerary for d in (-1e-6, 1e-6))
    middle = (alpha + SADDLE_NODE) / 2
    return (
        f"at alpha = {alpha:.12f} the orbit from the fold lands on the pseudo-saddle; from there to "
        f"the pseudo-saddle-node, {SADDLE_NODE - alpha:.2e} further, a stable sliding cycle and the "
        f"stable pseudo-node coexist; period {period(middle, 2500.0):.2f} in the middle",
        "root of the landing minus the pseudo-saddle; simulation 1e-6 to either side",
        close("the landing there", landing(alpha)[1], pseudo_equilibria(alpha)[0], 1e-10),
        Check(f"1e-6 below: {below}", below == "- s"),
        Check(f"1e-6 above: {above[:7]} ...", above.startswith("- s - s")),
        Check("before the pseudo-saddle-node", 0 < SADDLE_NODE - alpha < 1e-4),
    )


@claim("sliding-cycles")
def sliding_cycles() -> Found:
    """The sliding cycle through the fold, and that it forgets everything."""
    levels = (1.2, 1.5, 2.0, 2.3)
    periods = [period(a) for a in levels]
    entries = []
    for start in ([0.3, 1.2], [0.5, 0.3], [0.1, 1.0]):
        run = ns.simulate(SYSTEM, start, 400.0, parameters=at(1.2))
        entries.append([e.x[0] for e in run.events if e.kind == "entry"][-1])
    spread = float(np.ptp(entries))
    return (
        "through the fold of the free field, periods "
        + ", ".join(f"{p:.4f} at alpha = {a:g}" for a, p in zip(levels, periods, strict=True))
        + "; orbits merge with them in finite time, so their multiplier is 0",
        "simulation from the fold and, at alpha = 1.2, from three other starts",
        Check(f"periods {np.round(periods, 4).tolist()}", bool(np.all(np.isfinite(periods)))),
        close("spread of the landing points", spread, 0, 1e-9),
        close("period, alpha = 1.2, is slip and slide", periods[0], _slip_and_slide(1.2), 1e-7),
    )


def _slip_and_slide(alpha: float) -> float:
    """Time below the threshold plus time of sliding, integral of dx1/speed, by quadrature."""
    from scipy.integrate import quad

    from .model import A, B

    time, x1 = landing(alpha)
    # on x2 = alpha sliding has x1' = x1 (1 - x1) - psi alpha: both fields have that x1'
    slide = quad(lambda x: 1 / (A * x / (B + x) * alpha - x * (1 - x)), FREE_FOLD, x1, epsabs=1e-12)
    return time + float(slide[0])


@claim("grazing-sliding")
def grazing() -> Found:
    """Where the sliding cycle becomes the cycle of the free model."""
    top, _ = free_cycle()
    below, above = landing(top - 1e-3), run_from_fold(top + 1e-3, 300.0)
    short = below[1] - FREE_FOLD
    return (
        f"the cycle of the model without harvest has its largest x2 = {top:.6f} on the fold of the free "
        "field; at that alpha the sliding segment of the cycle shrinks to nothing (grazing-sliding), "
        "and above it the cycle does not reach the threshold",
        "return map of the free field from its fold; simulation 0.001 to either side",
        Check(f"sliding segment {short:.4f} long 0.001 below", 0 < short < 0.05),
        Check(f"itinerary 0.001 above: {above.itinerary}", above.itinerary == "-"),
    )
