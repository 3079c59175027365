"""The claims, each computed twice: by event-driven simulation and by formula.

The statements are quoted from memory, the abstract's included: the paper was not at hand.
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np

import nonsmooth as ns

from ..claims import Check, Found, Statements, close
from .model import (
    AFTER,
    AT,
    BEFORE,
    SIGMA,
    V,
    flights,
    formula_for_flights,
    landings,
    most_flights,
    ring,
    run,
    simulated_return_matrix,
    system,
)

claim = Statements(Path(__file__).with_name("README.md"))

#: V+, V- and the flights expected, from the table of the project's theory notes.
COUNTS: tuple[tuple[V, int], ...] = (
    ((-0.2, -0.5), 2),
    ((-0.5, -0.5), 2),
    ((-0.75, -1.0), 5),
    ((-0.9, -1.0), 9),
    ((-0.99, -1.0), 31),
)
RING = 120


@cache
def sliding_runs(v: V) -> tuple[ns.Trajectory, ...]:
    """Simulate a ring of starts in the attracting sliding region."""
    return tuple(run(v, tuple(start), 50.0, tol=1e-11) for start in ring(RING))


def reached(v: V) -> int:
    """How many of the ring slide into the two-fold."""
    return sum(r.status is ns.Status.NON_UNIQUE for r in sliding_runs(v))


@claim("normal-form")
def normal_form() -> Found:
    """The general two-fold and the normal form have the same numbers."""
    fold = ns.find_two_fold(system(), [0.0, 0.1, 0.1])
    checks = (
        Check(f"sigma = {fold.sigma}, nu = ({fold.nu[0]:g}, {fold.nu[1]:g})", fold.sigma == SIGMA),
        close(
            "largest difference of nu from (V+, V-)",
            np.abs(np.subtract(fold.nu, AFTER)).max(),
            0,
            1e-14,
        ),
        Check("both folds are invisible", fold.kind == "invisible"),
    )
    return (
        "nonsmooth's normal form with sigma = (-1, +1), nu = (V+, V-)",
        "find_two_fold on the normal form: nu comes from second Lie derivatives",
        *checks,
    )


@claim("return-map")
def return_map() -> Found:
    """One flight above and one below is a linear map with determinant 1."""
    checks = []
    for v in (BEFORE, AFTER, (-0.9, -1.0)):
        p = v[0] * v[1]
        matrix = simulated_return_matrix(v)
        formula = ns.two_folds.return_matrix(v)
        checks.append(
            close(f"V = {v}: error of the matrix", np.abs(matrix - formula).max(), 0, 1e-9)
        )
        checks.append(close("determinant", np.linalg.det(matrix), 1, 1e-9))
        root = np.sqrt(complex(p - 1))
        expected = np.array([(math.sqrt(p) - root) ** 2, (math.sqrt(p) + root) ** 2])
        values = np.linalg.eigvals(matrix)
        gap = max(np.min(np.abs(values - e)) for e in expected)
        checks.append(close("error of the eigenvalues", gap, 0, 1e-8))
    return (
        "[[4 V+ V- - 1, -2 V-], [2 V+, -1]]: determinant 1, eigenvalues "
        "(sqrt(V+ V-) +- sqrt(V+ V- - 1))^2, on the unit circle exactly if 0 <= V+ V- <= 1",
        "two simulated orbits give the matrix; formula for matrix and eigenvalues",
        *checks,
    )


@claim("single-quantity")
def single_quantity() -> Found:
    """Only the product V+ V- and the signs matter."""
    alike = [(-0.9, -1.0), (-1.8, -0.5), (-0.3, -3.0)]
    counts = [most_flights(v) for v in alike]
    reach = [reached(v) for v in ((-2.0, -1.0), (-0.5, -4.0))]
    positive = reached((2.0, 1.0))
    return (
        "the product V+ V- decides, together with the signs: V+ V- = 0.9 gives "
        f"{counts[0]} flights for three pairs of negative V; V+ V- = 2 lets all sliding orbits reach "
        f"the two-fold if V < 0 and {positive} of {RING} if V > 0",
        "simulation of fans of crossing orbits and rings of sliding orbits",
        Check(f"most flights {counts} at V+ V- = 0.9", counts == [9, 9, 9]),
        Check(f"{reach} of {RING} reach at V+ V- = 2, V < 0", reach == [RING, RING]),
        Check(f"{positive} reach at V+ V- = 2, V > 0", positive == 0),
    )


@claim("number-of-crossings")
def crossings() -> Found:
    """How many times an orbit crosses before it slides."""
    found = [(v, most_flights(v), expected) for v, expected in COUNTS]
    text = ", ".join(f"{v[0] * v[1]:.2f}: {n}" for v, n, _ in found)
    return (
        f"at most ceil(pi/arccos sqrt(V+ V-)) - 1 flights; V+ V- and flights: {text}",
        "18 orbits for each pair, over eight decades of starting slopes",
        *(
            Check(
                f"V = {v}: {n} flights (formula {formula_for_flights(v[0] * v[1])})",
                n == expected == formula_for_flights(v[0] * v[1]),
            )
            for v, n, expected in found
        ),
    )


@claim("initially-repelling")
def repelling_before() -> Found:
    """Below the bifurcation no orbit of the ring reaches the singularity."""
    counts = [reached(v) for v in (BEFORE, (-0.9, -1.0))]
    label = ns.two_folds.classify_two_fold(SIGMA, BEFORE)
    return (
        f"for V+ V- < 1 none of {RING} sliding orbits reaches it; exactly one leaves it into the "
        f"attracting region (class {label.label})",
        "ring of sliding orbits; class by the decision table",
        Check(f"{counts} reach it", counts == [0, 0]),
        Check(f"class {label.label}", label.label == "II-F" and label.faux_canards == 1),
    )


@claim("diabolo-bifurcation")
def bifurcation() -> Found:
    """Where invariant lines of the return map appear."""
    none = []
    for v in (BEFORE, (-0.99, -1.0)):
        try:
            ns.two_folds.diabolo_slopes(v)
        except ns.OptionError:
            none.append(v)
    low, high = ns.two_folds.diabolo_slopes(AFTER)
    images = [
        ns.two_folds.flight_below(ns.two_folds.flight_above([-1.0, r], AFTER), AFTER)
        for r in (low, high)
    ]
    ratios = [float(-image[1] / image[0]) for image in images]
    shrink, grow = (float(-image[0]) for image in reversed(images))
    label = ns.two_folds.classify_two_fold(SIGMA, AT).label
    return (
        "at V+ V- = 1 for V+, V- < 0: invariant lines abs(z/y) = abs(V+) (1 -+ sqrt(1 - 1/(V+ V-))) of "
        f"the return map; at V = {AFTER}: {low:.6f} (orbits grow, factor {grow:.6f}) and {high:.6f} "
        f"(shrink, factor {shrink:.6f}). x is quadratic in (y, z) on the arcs through them",
        "the lines from the formula put through both flights",
        Check(f"no lines at {none}", len(none) == 2),
        close("slope after a return on the first", ratios[0], 2 - math.sqrt(2), 1e-12),
        close("slope after a return on the second", ratios[1], 2 + math.sqrt(2), 1e-12),
        close("growth times shrinking", grow * shrink, 1, 1e-12),
        close("growth", grow, 3 + 2 * math.sqrt(2), 1e-12),
        Check(f"class at V+ V- = 1: {label}", label.endswith("II-C|II-F")),
    )


@claim("smooth-but-for-an-edge")
def parabolic() -> Found:
    """The invariant surfaces are parabolic and have an edge on the discontinuity surface."""
    _, high = ns.two_folds.diabolo_slopes(AFTER)
    heights = []
    for size in (1.0, 0.1, 0.01):
        r = run(AFTER, (-size, high * size), 1.9 * size)
        heights.append(float(r(size)[0]) / size**2)
    y, z = landings(run(AFTER, (-1.0, high), 3.0))[1]
    jump = (-float(y), float(z))  # x' on arriving from above and on leaving downwards
    return (
        f"height of the arc over (-r, {high:.4f} r): {heights[0]:.6f} r^2 for r = 1, 0.1, 0.01; at the "
        f"edge x' jumps from {jump[0]:.4f} to {jump[1]:.4f} and (y', z') from (1, {AFTER[0]:g}) to "
        f"({AFTER[1]:g}, 1)",
        "simulation of three arcs; both fields at the landing",
        Check(f"heights over r^2: {heights}", max(abs(h - 0.5) for h in heights) < 1e-9),
        Check("the fields at the edge are not parallel", abs(jump[0] - jump[1]) > 0.1),
    )


@claim("attraction-and-repulsion")
def attraction() -> Found:
    """The surfaces divide attraction from repulsion."""
    low, high = ns.two_folds.diabolo_slopes(AFTER)
    inside = [high * f for f in (1.001, 1.1, 2.0, 10.0)]
    outside = [high * 0.999, (low + high) / 2, low, low / 2, 0.01]
    attracted = [run(AFTER, (-1.0, m), 100.0) for m in inside]
    repelled = [run(AFTER, (-1.0, m), 60.0) for m in outside]
    ends = [r.status is ns.Status.NON_UNIQUE for r in attracted]
    away = [float(np.abs(r.x[-1, 1:]).max()) for r in repelled]
    count = reached(AFTER)
    return (
        f"crossing orbits with abs(z/y) > {high:.4f} make 1 to {max(map(flights, attracted))} flights, "
        "slide, and reach the singularity in finite time; the others cross ever further away. All "
        f"{count} of {RING} sliding orbits reach it",
        "simulation on both sides of the line, and of a ring of sliding orbits",
        Check(f"{sum(ends)} of {len(ends)} inside end at the singularity", all(ends)),
        Check(f"outside, max(abs(y), abs(z)) at the end: {min(away):.3g}", min(away) > 5),
        Check("none outside slides", all("s" not in r.itinerary for r in repelled)),
        Check(f"{count} of {RING} sliding orbits", count == RING),
    )


@claim("accumulation-time")
def accumulation() -> Found:
    """On the line itself infinitely many crossings happen in finite time."""
    _, high = ns.two_folds.diabolo_slopes(AFTER)
    r = run(AFTER, (-1.0, high), 10.0, tol=1e-5)  # rounding keeps a run 1e-8 from the two-fold
    formula = ns.two_folds.accumulation_time(AFTER)
    estimate = float("nan") if r.accumulation_time is None else r.accumulation_time
    times = np.diff([0.0, *(e.t for e in r.events if e.kind == "crossing")])[:8]
    ratios = times[2:] / times[:-2]
    return (
        f"from (0, -1, {high:.4f}) they end at t = {estimate:.9f}; formula "
        f"2 (1 + 2 abs(V+) - r+)/(1 - 1/mu) = {formula:.12f}",
        "simulation, which stops with ACCUMULATION and the estimated limit; geometric series",
        Check(f"status {r.status.name}", r.status is ns.Status.ACCUMULATION),
        close("formula", formula, 3.828427124746, 1e-12),
        close("estimate of the run", estimate, 3.828427124746, 1e-8),
        close("ratio of flight times", ratios.mean(), 3 - 2 * math.sqrt(2), 1e-6),
    )


@claim("determinacy-breaking")
def determinacy() -> Found:
    """Orbits arrive in finite time, and what follows is not determined."""
    runs = sliding_runs(AFTER)
    fold = ns.find_two_fold(system(), [0.0, 0.1, 0.1])
    expected = fold.reach_time(ring(RING))
    worst = max(abs(r.t[-1] - t) for r, t in zip(runs, expected, strict=True))
    stopped = sum(r.status is ns.Status.NON_UNIQUE for r in runs)
    onward = ns.orbit.funnel(system(), [0.0, 0.0, 0.0], 0.5)
    sides = "".join(sorted({d.side for d in onward.departures}))
    spread = float(np.linalg.norm(np.ptp(onward(0.5), axis=0)))
    return (
        f"{stopped} of {RING} arrive, at times that agree with -(1, 1) M^-1 z to {worst:.0e}; from "
        f"there canards slide into repelling sliding and leave it up or down at any time: a funnel of "
        f"{len(onward.trajectories)} of them is {spread:.2f} wide at t = 0.5. The abstract of 2009 "
        "states attraction; the loss of determinacy is the point of the paper of 2011",
        "ring of sliding orbits; funnel of the continuations",
        Check(f"{stopped} of {RING} stop as NON_UNIQUE", stopped == RING),
        close("largest error of the time", worst, 0, 1e-9),
        Check(f"continuations leave to the sides {sides}", sides == "+-s"),
        Check(f"they are {spread:.2f} apart", spread > 0.3),
    )
