"""The claims, computed by event-driven simulation and by formula.

The statements are quoted from memory, the abstract's included: the paper was not at hand.
"""

from __future__ import annotations

import math

import numpy as np

import nonsmooth as ns

from ..claims import HOLDS, NOT_CHECKABLE, Check, Claim, close
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


def kinds() -> Claim:
    """Three kinds by the visibility of the two folds."""
    found = {
        sigma: ns.find_two_fold(normal_form((sigma, (-0.3, 0.4))), [0.0, 0.1, 0.1]).kind
        for sigma in ((1, -1), (-1, 1), (1, 1), (-1, -1))
    }
    expected = ["visible", "invisible", "visible-invisible", "visible-invisible"]
    return Claim(
        "three-kinds",
        "known from memory: abstract",
        "two-folds are generic in three dimensions, and of three kinds: visible, invisible and mixed",
        "the signs sigma of L11 and L22 tell them apart: (+, -), (-, +), and both alike",
        HOLDS,
        "second Lie derivatives at the two-fold of four normal forms",
        (Check(f"kinds {list(found.values())}", list(found.values()) == expected),),
    )


def portraits() -> Claim:
    """Rings of sliding orbits in every class."""
    found = {name: (arrivals(n), repelling_arrivals(n)) for name, n in CLASSES.items()}
    text = ", ".join(f"{name} {a}/{r}" for name, (a, r) in found.items())
    return Claim(
        "sliding-portraits",
        "known from memory: local dynamics of all two-folds",
        "the sliding flow is a saddle, a node or a focus of a linear flow whose direction is reversed "
        "in repelling sliding; this gives all portraits",
        f"orbits of {RING} that reach the two-fold, from attracting and from repelling sliding: {text}",
        HOLDS,
        "simulation of a ring of starts in each region, for one two-fold of each class",
        tuple(
            Check(f"{n}: {found[n]} (expected {COUNTS[n]})", found[n] == COUNTS[n]) for n in COUNTS
        ),
    )


def _either_side(name: str, slope: float) -> tuple[bool, list[str]]:
    """Whether an orbit at a slope reaches the two-fold, and itineraries a little beside it."""
    system = normal_form(CLASSES[name])
    runs = [ns.simulate(system, [0.0, 1.0, slope + d], 20.0, tol=1e-12) for d in (0, -1e-3, 1e-3)]
    return runs[0].status is ns.Status.NON_UNIQUE, [r.itinerary for r in runs[1:]]


def canards() -> Claim:
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
    return Claim(
        "single-canards",
        "known from memory: saddles",
        "where the sliding flow is a saddle, a single orbit passes from attracting to repelling sliding",
        f"visible two-fold of class VV-C1: slope {visible:.6f}, neighbours leave to different sides; "
        f"mixed one of class mix-S: {mixed:.6f}",
        HOLDS,
        "simulation of the orbit on the eigenline and 0.001 beside it",
        tuple(checks),
    )


def severed() -> Claim:
    """No unique past, no unique future at an invisible two-fold with nu1 nu2 > 1."""
    system = normal_form(CLASSES["II-C"])
    fold = ns.find_two_fold(system, [0.0, 0.1, 0.1])
    runs = [ns.simulate(system, [0.0, *p], 20.0, tol=1e-11) for p in ring()]
    worst = float(np.abs([r.t[-1] for r in runs] - fold.reach_time(ring())).max())
    past = sum(r.status is ns.Status.NON_UNIQUE for r in runs)
    onward = ns.orbit.funnel(system, [0.0, 0.0, 0.0], 0.5)
    sides = "".join(sorted({d.side for d in onward.departures}))
    gap = float(np.linalg.norm(np.ptp(onward(0.5), axis=0)))
    return Claim(
        "severed-link",
        "known from memory: abstract",
        "where the flow passes through the two-fold it is unique in neither forward nor backward time: "
        "the causal link between inward and outward dynamics is severed",
        f"class II-C: {past} of {RING} sliding orbits arrive in finite time, {worst:.0e} from the "
        "formula; from there orbits slide on for any while and leave up or down: "
        f"{gap:.2f} apart at t = 0.5",
        HOLDS,
        "simulation, which stops at the two-fold with NON_UNIQUE; funnel of the continuations",
        (
            Check(f"{past} of {RING} arrive", past == RING),
            close("largest error of the time", worst, 0, 1e-9),
            Check(f"continuations leave to the sides {sides}", sides == "+-s"),
            Check(f"continuations {gap:.3f} apart", gap > 0.3),
        ),
    )


def open_sets() -> Claim:
    """Which classes lose determinism on an open set."""
    names = [name for name, numbers in CLASSES.items() if arrivals(numbers) > 1]
    kinds_ = {name: ns.two_folds.classify_two_fold(*CLASSES[name]).into.kind for name in CLASSES}
    expected = {"II-C": "all", "mix-C": "sector"}
    found = {name: kinds_[name] for name in names}
    return Claim(
        "open-sets",
        "known from memory: invisible and mixed two-folds",
        "an open set of orbits enters the singularity at an invisible two-fold with nu1 nu2 > 1, and "
        "at a mixed one; at a visible one only single orbits do",
        f"orbits of an open set arrive in the classes {names}: all of attracting sliding in II-C, a "
        f"sector in mix-C ({arrivals(CLASSES['mix-C'])} of {RING})",
        HOLDS,
        "rings of sliding orbits; slopes by formula",
        (Check(f"{found}", found == expected),),
    )


def recurrence() -> Claim:
    """Every excursion comes back to the singularity."""
    taken = excursions()
    returned = sum(e.returned for e in taken)
    sizes = np.array([e.amplitude for e in taken])
    times = np.array([e.trajectory.t[-1] for e in taken])
    fold = ns.find_two_fold(recurrent(), [0.0, 0.01, 0.01])
    return Claim(
        "recurrence",
        "known from memory: abstract",
        "in one scenario this occurs recurrently: the flow makes repeated, but nonperiodic, excursions "
        "from the singularity",
        f"{returned} of {len(taken)} excursions of the system x > 0: (-y, 1, nu1 + x), x < 0: "
        f"(z, nu2, 1), nu1 = nu2 = {RECURRENT} come back to the two-fold ({fold.label}), after "
        f"{times.min():.1f} to {times.max():.1f}, having been {sizes.min():.2f} to {sizes.max():.2f} "
        "high. The system is ours; the paper's was not at hand",
        HOLDS,
        "each excursion leaves repelling sliding at a point and to a side drawn by chance",
        (
            Check(f"class {fold.label}", fold.label == "II-C"),
            Check(f"{returned} of {len(taken)} return", returned == len(taken)),
            Check("bounded", float(sizes.max()) < 5),
            Check("no two alike", len(set(np.round(times, 6))) == len(times)),
        ),
    )


def memoryless() -> Claim:
    """Nothing of an excursion is left after the singularity."""
    taken = excursions()
    ends = np.array([e.trajectory.x[-1] for e in taken])
    spread = float(np.abs(ends).max())
    sizes = np.array([e.amplitude for e in taken])
    correlation = float(np.corrcoef(sizes[:-1], sizes[1:])[0, 1])
    return Claim(
        "no-memory",
        "known from memory: abstract",
        "path and amplitude of an excursion are not determined by previous excursions",
        f"all {len(taken)} excursions end in the same point, to {spread:.0e}, so none can determine the "
        "next; amplitudes depend on where and to which side repelling sliding is left",
        HOLDS,
        f"last states of the excursions (correlation of successive amplitudes {correlation:.2f}, by "
        "construction)",
        (
            Check(f"last states differ by {spread:.1e}", spread < 1e-8),
            Check(
                f"standard deviation of the amplitudes {sizes.std():.3f}", float(sizes.std()) > 0.02
            ),
        ),
    )


def robust() -> Claim:
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
    return Claim(
        "robust",
        "known from memory: abstract",
        "this behaviour is robust",
        f"{sum(counts)} of {len(counts)} excursions return for three other sets of nu1, nu2, c",
        HOLDS,
        "simulation",
        (Check(f"{sum(counts)} of {len(counts)}", all(counts)),),
    )


def eliminated() -> Claim:
    """Below the bifurcation nothing reaches the singularity."""
    run = calm_run()
    values = {"nu1": CALM, "nu2": CALM}
    starts = np.column_stack([np.zeros(30), 0.2 * ring()[2::4]])
    ends = [ns.simulate(recurrent(), s, 50.0, parameters=values, tol=1e-8).status for s in starts]
    reached = sum(status is ns.Status.NON_UNIQUE for status in ends)
    fold = ns.find_two_fold(recurrent(), [0.0, 0.01, 0.01], parameters=values)
    return Claim(
        "eliminated",
        "known from memory: abstract",
        "the chaotic behaviour can be eliminated by varying a single parameter, the angular jump of the "
        "field across the two-fold",
        f"at nu1 = nu2 = {CALM}, nu1 nu2 < 1, {reached} of {len(ends)} sliding orbits reach the two-fold "
        f"({fold.label}); they slide away",
        HOLDS,
        "the same system with nu1 nu2 on the other side of 1",
        (
            Check(f"class {fold.label}", fold.label == "II-F"),
            Check(f"{reached} reach it", reached == 0),
            Check(f"a run to t = 400 ends {run.status.name}", run.status is ns.Status.REACHED_END),
        ),
    )


def properties_of_chaos() -> Claim:
    """What is not checked."""
    return Claim(
        "properties-of-chaos",
        "known from memory: abstract",
        "the flow has many of the properties associated with chaos",
        "the paper's definitions were not at hand; excursions of many sizes follow from one state",
        NOT_CHECKABLE,
        "amplitudes of the excursions",
        (
            Check(
                "excursions of different size from one state",
                len({round(e.amplitude, 3) for e in excursions()}) > 10,
            ),
        ),
    )


ALL = (
    kinds,
    portraits,
    canards,
    severed,
    open_sets,
    recurrence,
    memoryless,
    robust,
    eliminated,
    properties_of_chaos,
)
