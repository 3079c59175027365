"""The claims, computed by event-driven simulation and by formula.

The statements are quoted from memory, the abstract's included: the paper was not at hand.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

import nonsmooth as ns

from ..claims import Check, Found, Statements, close
from .model import (
    CALM,
    CLASSES,
    RECURRENT,
    RING,
    arrivals,
    calm_run,
    excursions,
    normal_form,
    recurrent,
    repelling_arrivals,
    ring,
)

claim = Statements(Path(__file__).with_name("README.md"))

#: Orbits of the ring that reach the two-fold from attracting and from repelling sliding, from the
#: project's theory notes.
COUNTS: dict[str, tuple[int, int]] = {
    "VV-C1": (0, 0),
    "VV-F": (0, 120),
    "II-F": (0, 0),
    "II-C": (120, 0),
    "mix-0": (0, 0),
    "mix-S": (0, 0),
    "mix-C": (85, 0),
    "mix-F": (0, 85),
}


@claim("three-kinds")
def kinds() -> Found:
    """Three kinds by the visibility of the two folds."""
    found = {
        sigma: ns.find_two_fold(normal_form((sigma, (-0.3, 0.4))), [0.0, 0.1, 0.1]).kind
        for sigma in ((1, -1), (-1, 1), (1, 1), (-1, -1))
    }
    expected = ["visible", "invisible", "visible-invisible", "visible-invisible"]
    return (
        "the signs sigma of L11 and L22 tell them apart: (+, -), (-, +), and both alike",
        "second Lie derivatives at the two-fold of four normal forms",
        Check(f"kinds {list(found.values())}", list(found.values()) == expected),
    )


@claim("sliding-portraits")
def portraits() -> Found:
    """Rings of sliding orbits in every class."""
    found = {name: (arrivals(n), repelling_arrivals(n)) for name, n in CLASSES.items()}
    text = ", ".join(f"{name} {a}/{r}" for name, (a, r) in found.items())
    return (
        f"orbits of {RING} that reach the two-fold, from attracting and from repelling sliding: {text}",
        "simulation of a ring of starts in each region, for one two-fold of each class",
        *(Check(f"{n}: {found[n]} (expected {COUNTS[n]})", found[n] == COUNTS[n]) for n in COUNTS),
    )


def _either_side(name: str, slope: float) -> tuple[bool, list[str]]:
    """Whether an orbit at a slope reaches the two-fold, and itineraries a little beside it."""
    system = normal_form(CLASSES[name])
    runs = [ns.simulate(system, [0.0, 1.0, slope + d], 20.0, tol=1e-12) for d in (0, -1e-3, 1e-3)]
    return runs[0].status is ns.Status.NON_UNIQUE, [r.itinerary for r in runs[1:]]


@claim("single-canards")
def canards() -> Found:
    """Single canards: an orbit through the singularity between two that miss it."""
    visible = (1 + math.sqrt(5)) / 2  # of VV-C1
    mixed = (3 + math.sqrt(5)) / 2  # of mix-S
    cases = {"VV-C1": (visible, ["s -", "s +"]), "mix-S": (mixed, ["s", "s +"])}
    checks = []
    for name, (slope, expected) in cases.items():
        reaches, beside = _either_side(name, slope)
        checks.append(Check(f"{name}: the orbit of slope {slope:.6f} reaches it", reaches))
        checks.append(Check(f"{name}: 0.001 to either side {beside}", beside == expected))
        label = ns.two_folds.classify_two_fold(*CLASSES[name])
        checks.append(close(f"{name}: slope by formula", label.into.low, slope, 1e-12))
    return (
        f"visible two-fold of class VV-C1: slope {visible:.6f}, neighbours leave to different sides; "
        f"mixed one of class mix-S: {mixed:.6f}",
        "simulation of the orbit on the eigenline and 0.001 beside it",
        *checks,
    )


@claim("severed-link")
def severed() -> Found:
    """No unique past, no unique continuation at an invisible two-fold with nu1 nu2 > 1."""
    system = normal_form(CLASSES["II-C"])
    fold = ns.find_two_fold(system, [0.0, 0.1, 0.1])
    runs = [ns.simulate(system, [0.0, *p], 20.0, tol=1e-11) for p in ring()]
    worst = float(np.abs([r.t[-1] for r in runs] - fold.reach_time(ring())).max())
    past = sum(r.status is ns.Status.NON_UNIQUE for r in runs)
    onward = ns.orbit.funnel(system, [0.0, 0.0, 0.0], 0.5)
    sides = "".join(sorted({d.side for d in onward.departures}))
    gap = float(np.linalg.norm(np.ptp(onward(0.5), axis=0)))
    return (
        f"class II-C: {past} of {RING} sliding orbits arrive in finite time, {worst:.0e} from the "
        "formula; from there orbits slide on for any while and leave up or down: "
        f"{gap:.2f} apart at t = 0.5",
        "simulation, which stops at the two-fold with NON_UNIQUE; funnel of the continuations",
        Check(f"{past} of {RING} arrive", past == RING),
        close("largest error of the time", worst, 0, 1e-9),
        Check(f"continuations leave to the sides {sides}", sides == "+-s"),
        Check(f"continuations {gap:.3f} apart", gap > 0.3),
    )


@claim("open-sets")
def open_sets() -> Found:
    """Which classes lose determinism on an open set."""
    names = [name for name, numbers in CLASSES.items() if arrivals(numbers) > 1]
    kinds_ = {name: ns.two_folds.classify_two_fold(*CLASSES[name]).into.kind for name in CLASSES}
    expected = {"II-C": "all", "mix-C": "sector"}
    found = {name: kinds_[name] for name in names}
    return (
        f"orbits of an open set arrive in the classes {names}: all of attracting sliding in II-C, a "
        f"sector in mix-C ({arrivals(CLASSES['mix-C'])} of {RING})",
        "rings of sliding orbits; slopes by formula",
        Check(f"{found}", found == expected),
    )


@claim("recurrence")
def recurrence() -> Found:
    """Every excursion comes back to the singularity."""
    taken = excursions()
    returned = sum(e.returned for e in taken)
    sizes = np.array([e.amplitude for e in taken])
    times = np.array([e.trajectory.t[-1] for e in taken])
    fold = ns.find_two_fold(recurrent(), [0.0, 0.01, 0.01])
    return (
        f"{returned} of {len(taken)} excursions of the system x > 0: (-y, 1, nu1 + x), x < 0: "
        f"(z, nu2, 1), nu1 = nu2 = {RECURRENT} come back to the two-fold ({fold.label}), after "
        f"{times.min():.1f} to {times.max():.1f}, having been {sizes.min():.2f} to {sizes.max():.2f} "
        "high. The system is ours; the paper's was not at hand",
        "each excursion leaves repelling sliding at a point and to a side drawn by chance",
        Check(f"class {fold.label}", fold.label == "II-C"),
        Check(f"{returned} of {len(taken)} return", returned == len(taken)),
        Check("bounded", float(sizes.max()) < 5),
        Check("no two alike", len(set(np.round(times, 6))) == len(times)),
    )


@claim("no-memory")
def memoryless() -> Found:
    """Nothing of an excursion is left after the singularity."""
    taken = excursions()
    ends = np.array([e.trajectory.x[-1] for e in taken])
    spread = float(np.abs(ends).max())
    sizes = np.array([e.amplitude for e in taken])
    correlation = float(np.corrcoef(sizes[:-1], sizes[1:])[0, 1])
    return (
        f"all {len(taken)} excursions end in the same point, to {spread:.0e}, so none can determine the "
        "next; amplitudes depend on where and to which side repelling sliding is left",
        f"last states of the excursions (correlation of successive amplitudes {correlation:.2f}, by "
        "construction)",
        Check(f"last states differ by {spread:.1e}", spread < 1e-8),
        Check(f"standard deviation of the amplitudes {sizes.std():.3f}", float(sizes.std()) > 0.02),
    )


@claim("robust")
def robust() -> Found:
    """Other parameters do the same."""
    counts = []
    starts = [(-0.1, -0.05), (-0.02, -0.2), (-0.15, -0.15)]
    for nu1, nu2, c in ((-1.05, -1.05, 0.5), (-1.3, -1.0, 1.0), (-1.1, -1.1, 2.0)):
        values = {"nu1": nu1, "nu2": nu2, "c": c}
        for start in starts:
            for mode in "+-":
                run = ns.simulate(
                    recurrent(),
                    [0.0, *start],
                    400.0,
                    parameters=values,
                    start_mode=mode,
                )
                counts.append(run.status is ns.Status.NON_UNIQUE)
    return (
        f"{sum(counts)} of {len(counts)} excursions return for three other sets of nu1, nu2, c",
        "simulation",
        Check(f"{sum(counts)} of {len(counts)}", all(counts)),
    )


@claim("eliminated")
def eliminated() -> Found:
    """Below the bifurcation nothing reaches the singularity."""
    run = calm_run()
    values = {"nu1": CALM, "nu2": CALM}
    starts = np.column_stack([np.zeros(30), 0.2 * ring()[2::4]])
    ends = [ns.simulate(recurrent(), s, 50.0, parameters=values, tol=1e-8).status for s in starts]
    reached = sum(status is ns.Status.NON_UNIQUE for status in ends)
    fold = ns.find_two_fold(recurrent(), [0.0, 0.01, 0.01], parameters=values)
    return (
        f"at nu1 = nu2 = {CALM}, nu1 nu2 < 1, {reached} of {len(ends)} sliding orbits reach the two-fold "
        f"({fold.label}); they slide away",
        "the same system with nu1 nu2 on the other side of 1",
        Check(f"class {fold.label}", fold.label == "II-F"),
        Check(f"{reached} reach it", reached == 0),
        Check(f"a run to t = 400 ends {run.status.name}", run.status is ns.Status.REACHED_END),
    )


@claim("properties-of-chaos")
def properties_of_chaos() -> Found:
    """What is not checked."""
    return (
        "the paper's definitions were not at hand; excursions of many sizes follow from one state",
        "amplitudes of the excursions",
        Check(
            "excursions of different size from one state",
            len({round(e.amplitude, 3) for e in excursions()}) > 10,
        ),
    )
