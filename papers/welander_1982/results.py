"""The claims: local objects by ``ns.classify``, the oscillation by simulation.

Statements marked so are quoted from memory, as are the parameters: the paper was not at hand.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

import nonsmooth as ns

from ..claims import Check, Found, Statements, close, named, value_of
from .model import (
    BOUNDARY_MIXED,
    BOUNDARY_RESTING,
    FOLD_FOLD,
    FUSED,
    MERGING,
    MIXED,
    PROBLEM,
    RESTING,
    SYSTEM,
    at,
    cycle,
    point,
    simulate,
    threshold_of,
)

claim = Statements(Path(__file__).with_name("README.md"))


_reference = partial(value_of, PROBLEM)


@claim("oscillation")
def oscillation() -> Found:
    """The self-sustained oscillation."""
    temperature, period, multiplier = cycle(-0.01)
    ends = []
    for start in ([0.1, 0.9], [0.9, 0.1], [0.5, 0.5]):
        run = simulate(np.array(start), -0.01, 40.0)
        ends.append(
            [e for e in run.events if e.mode_after == "-" and e.kind == "crossing"][-1].x[0]
        )
    spread = float(np.abs(np.array(ends) - temperature).max())
    return (
        f"at eps = -0.01 a stable crossing cycle, period {period:.10f}, multiplier {multiplier:.7f}; "
        "resting and mixed phase alternate",
        "Newton's method on the return map; orbits from three starts",
        close("period", period, _reference("period"), 1e-9),
        close("multiplier", multiplier, _reference("multiplier"), 1e-8),
        close("orbits from three starts: distance from the cycle", spread, 0, 1e-9),
    )


@claim("boundary-equilibrium-resting")
def resting_equilibrium() -> Found:
    """The equilibrium of the box that does not mix, on the surface."""
    at_surface = ns.find_boundary_equilibrium(
        SYSTEM, RESTING, vary="eps", side="-", parameters=at(0.19)
    )
    eps = at_surface.value
    found = ns.classify(SYSTEM, at_surface.point, parameters=at_surface.parameters)
    real = ns.find_equilibrium(SYSTEM, RESTING, side="-", parameters=at(0.22))
    pseudo = ns.find_pseudo_equilibrium(SYSTEM, [0.99, 0.97], parameters=at(0.18))
    return (
        f"the resting equilibrium (1, 1) is real for eps > 0.2 and reaches the surface at eps = {eps:.12g}: "
        f"class {found.label}, persistence; for eps < 0.2 a stable pseudo-node takes its place",
        "find_boundary_equilibrium, classify; equilibria 0.02 to either side",
        close("eps", eps, _reference("boundary equilibrium, k = 0"), 1e-12),
        close("by formula, 1 - a", BOUNDARY_RESTING, 0.2, 1e-15),
        Check(
            f"class {found.label} of the field on the side {found.side}",
            (found.label, found.side) == ("BN1", "-"),
        ),
        named("", real, "real", "stable node"),
        named("", pseudo, "real", "stable pseudo-node"),
    )


@claim("pseudo-equilibrium")
def sliding_equilibrium() -> Found:
    """The balance between both phases."""
    found = ns.find_pseudo_equilibrium(SYSTEM, [0.8, 0.7], parameters=at(0.05))
    ends = [simulate(np.array(s), 0.05, 40.0).x[-1] for s in ([0.1, 0.9], [0.9, 0.1], [0.3, 0.3])]
    spread = max(float(np.abs(e - found.point).max()) for e in ends)
    return (
        f"at eps = 0.05 a {found.kind} at T = {found.point[0]:.12f} with the mixing on for a share "
        f"{1 - found.alpha:.4f} of the time; orbits from three starts end there",
        "find_pseudo_equilibrium; simulation",
        close("T", found.point[0], _reference("pseudo-equilibrium T"), 1e-12),
        Check(found.kind, found.kind == "stable pseudo-node"),
        Check(f"in {found.region}", found.region is ns.Region.ATTRACTING),
        close("largest distance of the ends", spread, 0, 1e-9),
    )


@claim("sliding-segment")
def sliding_changes() -> Found:
    """Sliding is attracting above threshold 0 and repelling below it."""
    rows = []
    for eps in (-0.02, -0.005, 0.005, 0.02):
        ends = [
            ns.find_fold(SYSTEM, FOLD_FOLD, side=side, parameters=at(eps)).point[0]
            for side in ("+", "-")
        ]
        middle = ns.region(SYSTEM, point(sum(ends) / 2, eps), parameters=at(eps))
        rows.append((eps, middle, abs(ends[1] - ends[0])))
    expected = [ns.Region.REPELLING] * 2 + [ns.Region.ATTRACTING] * 2
    widths = [w / abs(eps) for eps, _, w in rows]
    return (
        "L1 = L2 - k eps on the surface: a repelling segment for eps < 0 shrinks to a point at eps = 0 "
        f"and is attracting for eps > 0; its width in T is {widths[0]:.4g} abs(eps)",
        "find_fold, region",
        Check("repelling, repelling, attracting, attracting", [r for _, r, _ in rows] == expected),
        close("width over abs(eps)", float(np.ptp(widths)), 0, 1e-9),
        close("k/(a (1 - b))", widths[0], 5 / (0.8 * 0.5), 1e-9),
    )


@claim("onset")
def pseudo_hopf() -> Found:
    """Where the oscillation begins."""
    found = ns.classify(SYSTEM, FOLD_FOLD, parameters=at(FUSED))
    sizes = []
    for eps in (-1e-4, -1e-6):
        run = simulate(FOLD_FOLD + 0.5 * np.sqrt(-eps) * np.array([1, 0.8]), eps, 3.0, tol=1e-13)
        last = [e.x[0] for e in run.events if e.kind == "crossing"][-2:]
        sizes.append(abs(last[1] - last[0]) / np.sqrt(-eps))
    calm = simulate(np.array([0.7, 0.6]), 0.002, 20.0).itinerary
    return (
        f"at eps = 0 a fold-fold of class {found.label} at ({FOLD_FOLD[0]:g}, {FOLD_FOLD[1]:g}), a stable "
        f"fused focus (pseudo-Hopf); for eps < 0 the cycle spans {sizes[1]:.4f} sqrt(-eps) in T; for "
        "eps > 0 orbits end in sliding",
        "classify; simulation at eps = -1e-4 and -1e-6, and 0.002",
        Check(f"class {found.label}", found.label == "II2"),
        Check(f"stability {found.evidence['stability']:.4f} > 0", found.evidence["stability"] > 0),
        close("ratio of the two sizes", sizes[0] / sizes[1], 1, 0.005),
        Check(f"eps = 0.002 ends sliding: {calm[-5:]}", calm.endswith("s")),
    )


@claim("boundary-equilibrium-mixed")
def mixed_equilibrium() -> Found:
    """The equilibrium of the mixing box, on the surface."""
    at_surface = ns.find_boundary_equilibrium(
        SYSTEM, MIXED, vary="eps", side="+", parameters=at(-0.04)
    )
    eps = at_surface.value
    found = ns.classify(SYSTEM, at_surface.point, parameters=at_surface.parameters)
    real = ns.find_equilibrium(SYSTEM, MIXED, side="+", parameters=at(eps - 1e-3))
    saddle = ns.find_pseudo_equilibrium(SYSTEM, [0.17, 0.09], parameters=at(eps - 1e-3))
    virtual = ns.find_equilibrium(SYSTEM, MIXED, side="+", parameters=at(eps + 1e-3))
    return (
        f"the mixed equilibrium (1/6, 1/11) reaches the surface at eps = {eps:.12f} = -7/165. The surface "
        f"next to it repels: class {found.label} of the time-reversed system, nonsmooth fold: for lower "
        "eps the stable node is real, with a pseudo-saddle in repelling sliding; for higher eps both are "
        "gone and the box oscillates",
        "find_boundary_equilibrium, classify; equilibria 0.001 to either side",
        close("eps", eps, -7 / 165, 1e-14),
        close("by formula, b/(b + k) - a/(1 + k)", BOUNDARY_MIXED, -7 / 165, 1e-15),
        Check(
            f"class {found.label}, time reversed",
            found.label == "UN2" and found.detail.time_reversed,
        ),
        Check(found.detail.unfolding, found.detail.unfolding == "nonsmooth fold"),
        named("below: ", real, "real", "stable node"),
        named("below: ", saddle, "real", "pseudo-saddle"),
        Check(f"above: {virtual.status}", virtual.status == "virtual"),
    )


@claim("homoclinic")
def homoclinic() -> Found:
    """The cycle ends in a homoclinic orbit."""
    offsets = (1e-4, 1e-6, 1e-8)
    periods = [cycle(BOUNDARY_MIXED + d)[1] for d in offsets]
    steps = np.diff(periods) / 2  # for each factor 10
    run = simulate(MIXED, BOUNDARY_MIXED, 5.0, "-")
    gap = float(np.abs(run(4.5) - MIXED).max())
    # it comes back along the slow direction of the mixed node, at the rates b + k = 5.5 and 6
    slowest = float(np.log(10) / 5.5)
    return (
        "the orbit that leaves the boundary equilibrium into the resting phase comes back to it "
        f"(within {gap:.0e} after t = 4.5); the period of the cycle grows by {steps[0]:.4f}, then "
        f"{steps[1]:.4f}, for each factor 10 in the distance from -7/165, towards ln(10)/5.5 = "
        f"{slowest:.4f}",
        "simulation from the boundary equilibrium; periods at three distances",
        Check(f"itinerary {run.itinerary[:3]!r}", run.itinerary.startswith("- +")),
        close("distance from the equilibrium at t = 4.5", gap, 0, 1e-6),
        Check(f"periods {np.round(periods, 4).tolist()} grow", bool(np.all(steps > slowest))),
        Check("ever closer to ln(10)/5.5", bool(slowest < steps[1] < steps[0] < 1.2 * slowest)),
    )


@claim("pseudo-saddle-node")
def saddle_node() -> Found:
    """Two pseudo-equilibria in repelling sliding merge."""
    eps = float(threshold_of(MERGING))
    found = ns.classify(SYSTEM, point(MERGING, eps), parameters=at(eps))
    branch = []
    for temperature in (0.2, 0.35, 0.5, 0.7, 0.8, 0.95):
        level = float(threshold_of(temperature))
        near = point(temperature + 1e-3, level)
        pseudo = ns.find_pseudo_equilibrium(SYSTEM, near, parameters=at(level))
        branch.append(abs(pseudo.point[0] - temperature))
    return (
        "eps = b T/(1 - (1 - b) T) - a T along them; the pseudo-saddle and the unstable pseudo-node "
        f"merge at T = (1 - sqrt(b/a))/(1 - b) = {MERGING:.9f}, eps = {eps:.9f}",
        "classify at the point; find_pseudo_equilibrium at six temperatures",
        Check(f"class {found.label}", found.label == "pseudo-saddle-node"),
        close("largest error of the formula", max(branch), 0, 1e-11),
    )
