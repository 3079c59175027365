"""The classes of generic two-folds: a decision table, its boundaries, and the meaning of each class.

Da is attracting sliding, Dr repelling, s the two-fold. An orbit Da -> s -> Dr along an eigenline
with kappa < 0 is a canard; along one with kappa > 0 it runs Dr -> s -> Da, a faux canard. The
table was derived for this library from the slope equation of ``ReducedFlow`` and is tested by
integration of every row (Filippov 1988; Teixeira 1990; Colombo & Jeffrey 2011 for parts of it). In
R^n it holds across the (n-3)-dimensional set of two-folds, and "one orbit" reads "a set of
codimension one in the sliding region".
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ...model import OptionError
from ...model.checks import positive
from .reduced_flow import ReducedFlow

MIXED = ("VI", "IV")


@dataclass(frozen=True)
class Row:
    """One class of the table."""

    label: str
    folds: tuple[str, ...]
    condition: str
    holds: Callable[[ReducedFlow], bool]
    into: str  # which orbits of Da reach s: none, one, all or a sector
    out_of: str  # which orbits of Da come from s, and along the same lines those of Dr that reach s
    determinism: str


def _low(flow: ReducedFlow) -> float:
    return float(flow.eigenvalues[0])


def _high(flow: ReducedFlow) -> float:
    return float(flow.eigenvalues[1])


TABLE: tuple[Row, ...] = (
    Row(
        "VV-C1",
        ("VV",),
        "kappa_- < 0",
        lambda f: _low(f) < 0,
        into="one",
        out_of="none",
        determinism="Forward uniqueness is lost on a set of codimension one: a single sliding "
        "orbit, the canard, reaches s and continues into repelling sliding, which it may leave at "
        "any time; every other orbit of Da leaves the surface through a visible fold. Backward, no "
        "orbit of Da comes from s.",
    ),
    Row(
        "VV-F",
        ("VV",),
        "kappa_- > 0 (nu1, nu2 > 0 and nu1 nu2 > 1)",
        lambda f: _low(f) > 0,
        into="none",
        out_of="all",
        determinism="No orbit of Da reaches s, so forward uniqueness holds in Da. Every orbit of "
        "Dr reaches s in finite time, and every orbit of Da comes from s (a fan of faux canards): "
        "any orbit of Da or a visible tangent orbit continues the motion from s.",
    ),
    Row(
        "II-C",
        ("II",),
        "kappa_+ < 0 (nu1, nu2 < 0 and nu1 nu2 > 1)",
        lambda f: _high(f) < 0,
        into="all",
        out_of="none",
        determinism="Determinism breaks on an open set (Teixeira singularity): every orbit of Da "
        "reaches s in finite time, and from s every orbit of Dr is a possible continuation "
        "(infinitely many canards), as are spirals of flights along the diabolo.",
    ),
    Row(
        "II-F",
        ("II",),
        "kappa_+ > 0",
        lambda f: _high(f) > 0,
        into="none",
        out_of="one",
        determinism="No orbit of Da reaches s, so forward uniqueness holds in Da. One faux canard "
        "runs from repelling sliding through s into attracting sliding and is the only "
        "continuation from s.",
    ),
    Row(
        "mix-0",
        MIXED,
        "gap < 2",
        lambda f: f.gap < 2,
        into="none",
        out_of="none",
        determinism="No sliding orbit reaches or leaves s: sliding runs from the invisible to the "
        "visible fold and leaves the surface there. Forward uniqueness holds in Da.",
    ),
    Row(
        "mix-S",
        MIXED,
        "gap > 2, Delta < 0",
        lambda f: f.gap > 2 and f.determinant < 0,
        into="one",
        out_of="one",
        determinism="Forward uniqueness is lost on a set of codimension one: a single sliding "
        "orbit, the canard, reaches s and continues into repelling sliding. One faux canard runs "
        "from repelling sliding through s into attracting sliding.",
    ),
    Row(
        "mix-C",
        MIXED,
        "gap > 2, Delta > 0, T < 0",
        lambda f: f.gap > 2 and f.determinant > 0 and f.trace < 0,
        into="sector",
        out_of="none",
        determinism="Determinism breaks on an open set: every orbit of a sector of Da reaches s in "
        "finite time, and from s a sector of Dr is open (infinitely many canards); the strong "
        "canard, of the faster eigenvalue, bounds the sector. The other orbits leave through the "
        "visible fold.",
    ),
    Row(
        "mix-F",
        MIXED,
        "gap > 2, Delta > 0, T > 0",
        lambda f: f.gap > 2 and f.determinant > 0 and f.trace > 0,
        into="none",
        out_of="sector",
        determinism="No orbit of Da reaches s, so forward uniqueness holds in Da. A sector of Dr "
        "reaches s in finite time and a sector of Da comes from s (a fan of faux canards): at s "
        "itself the continuation is not unique.",
    ),
)

_COUNT = {"none": 0.0, "one": 1.0, "all": math.inf, "sector": math.inf}


@dataclass(frozen=True)
class Slopes:
    """The slopes $m = z3/z2$ of the orbits of Da that connect to s.

    Attributes
    ----------
    kind : {"none", "one", "all", "sector", "undecided"}
        How many slopes connect: none, one, all of them, a sector, or not decided.
    low, high : float
        Closed range of slopes; the open quadrant is $0 < m < inf$. NaN if there is none.
    """

    kind: str
    low: float = math.nan
    high: float = math.nan

    def contains(self, slope: float, tol: float = 1e-9) -> bool:
        """Whether an orbit of this slope connects.

        Parameters
        ----------
        slope : float
            $m = z3/z2$.
        tol : float, optional
            Relative distance within which a single slope counts as equal.
        """
        if self.kind == "one":
            return abs(slope - self.low) <= tol * (1 + abs(self.low))
        return (
            self.kind in ("all", "sector")
            and 0 < slope < math.inf
            and (self.low <= slope <= self.high)
        )


@dataclass(frozen=True)
class Boundary:
    """A degenerate boundary that a two-fold lies on.

    Attributes
    ----------
    name : str
        For example ``"Delta=0"``.
    meaning : str
        What happens on the boundary.
    between : tuple of str
        Classes on its two sides; one class if the boundary leaves the sliding portrait unchanged.
    """

    name: str
    meaning: str
    between: tuple[str, ...]

    @property
    def harmless(self) -> bool:
        """Whether the class is the same on both sides."""
        return len(self.between) == 1


@dataclass(frozen=True)
class Classification:
    """Class of a two-fold.

    Attributes
    ----------
    label : str
        ``"VV-C1"``, ``"VV-F"``, ``"II-C"``, ``"II-F"``, ``"mix-0"``, ``"mix-S"``, ``"mix-C"``,
        ``"mix-F"``; on a boundary where the class changes its name and the classes that meet,
        ``"boundary Delta=0: VV-C1|VV-F"``.
    kind : {"visible", "invisible", "visible-invisible"}
        Whether the two folds are visible.
    canards, faux_canards : float
        0, 1 or inf; NaN on a boundary where the class changes: leading order does not decide.
    into, out_of : Slopes
        Orbits of Da that reach s (with its mirror image in Dr: that leave s), and orbits of Da
        that come from s (in Dr: that reach s).
    determinism : str
        What it means for uniqueness.
    boundaries : tuple of Boundary
        The degenerate boundaries on which $(sigma, nu)$ lies within the tolerance.
    margin : float
        Relative distance to the nearest boundary that changes the class or the crossing
        itinerary; inf if there is none.
    nearest : str
        Name of that boundary, ``""`` if there is none.
    """

    label: str
    kind: str
    canards: float
    faux_canards: float
    into: Slopes
    out_of: Slopes
    determinism: str
    boundaries: tuple[Boundary, ...]
    margin: float
    nearest: str


def _slopes(flow: ReducedFlow, row: Row) -> tuple[Slopes, Slopes]:
    def build(kind: str, slope: float, above: bool) -> Slopes:
        if kind == "none":
            return Slopes("none")
        if kind == "all":
            return Slopes("all", 0.0, math.inf)
        if kind == "one":
            return Slopes("one", slope, slope)
        return Slopes("sector", slope, math.inf) if above else Slopes("sector", 0.0, slope)

    if row.into == row.out_of == "none":
        return Slopes("none"), Slopes("none")
    low, high = (float(m) for m in flow.slopes)
    into = build(row.into, low, above=flow.folds == "IV")
    return into, build(row.out_of, high, above=flow.folds == "VI")


def _near_boundaries(flow: ReducedFlow, tol: float) -> list[tuple[float, Boundary]]:
    """Relative distance to each boundary of the two-fold's kind, and what meets there."""
    n1, n2 = flow.nu
    node = "mix-C" if flow.trace < 0 else "mix-F"
    size = max(1.0, abs(n1), abs(n2))
    found: list[tuple[float, Boundary]] = []
    rank = "rank one, M has a line of zeros"
    if flow.folds in MIXED:
        changes = flow.gap > 0
        between = ("mix-0", node) if changes else ("mix-0",)
        distance = abs(flow.gap - (2 if changes else -2)) / max(2.0, size)
        found.append((distance, Boundary("disc=0", "Jordan block, the eigenlines merge", between)))
        between = ("mix-S", node) if flow.gap >= 2 - tol * size else ("mix-0",)
    elif flow.folds == "VV":
        between = ("VV-C1", "VV-F") if flow.trace > 0 else ("VV-C1",)
    else:
        between = ("II-C", "II-F") if flow.trace < 0 else ("II-F",)
    if len(between) == 2:
        rank += " in the sliding region: pseudo-equilibria"
    distance = abs(flow.determinant) / max(1.0, abs(n1 * n2))
    found.append((distance, Boundary("Delta=0", rank, between)))
    for k, side in ((0, "above"), (1, "below")):
        if flow.folds[k] == "I":
            meaning = f"the itinerary of flights {side} changes"
            distance = abs(flow.nu[k]) / size
            found.append((distance, Boundary(f"nu{k + 1}=0", meaning, (_label(flow),))))
    return found


def _label(flow: ReducedFlow) -> str:
    return next((r.label for r in TABLE if flow.folds in r.folds and r.holds(flow)), "")


def classify_two_fold(
    sigma: tuple[int, int], nu: tuple[float, float], *, tol: float = 1e-9
) -> Classification:
    """Classify a two-fold from the signs and numbers of its normal form.

    Parameters
    ----------
    sigma : (int, int)
        Signs of $L11$ and $L22$.
    nu : (float, float)
        The two numbers $(nu1, nu2)$ of the two-fold.
    tol : float, optional
        Relative distance within which a point is on a boundary: $|Delta|$ against $max(1, |nu1 nu2|)$,
        $|g - 2|$ and $nu_i$ against the larger of 1, $|nu1|$ and $|nu2|$.

    Returns
    -------
    Classification
        The class, and what it means for orbits and for determinism.

    Raises
    ------
    DegenerateError
        A sign is 0 (cusp-fold).
    OptionError
        ``sigma`` or ``nu`` is not a pair of signs or finite numbers; ``tol`` is not positive.

    Examples
    --------
    >>> classify_two_fold((-1, 1), (-2.0, -1.0)).label
    'II-C'
    >>> classify_two_fold((1, -1), (2.0, 0.5)).label
    'boundary Delta=0: VV-C1|VV-F'
    >>> c = classify_two_fold((1, -1), (-2.0, -0.5))
    >>> c.label, c.canards, [b.name for b in c.boundaries]
    ('VV-C1', 1.0, ['Delta=0'])
    """
    positive(tol, "tol")
    flow = ReducedFlow(_pair(sigma, "sigma"), _pair(nu, "nu"))
    near = _near_boundaries(flow, tol)
    on = tuple(boundary for distance, boundary in near if distance <= tol)
    decisive = [(d, b) for d, b in near if not b.harmless or b.name.startswith("nu")]
    margin, nearest = min(((d, b.name) for d, b in decisive), default=(math.inf, ""))
    changing = [b for b in on if not b.harmless]
    if changing:
        return _undecided(flow, changing, on, margin, nearest)
    row = next(r for r in TABLE if flow.folds in r.folds and r.holds(flow))
    into, out_of = _slopes(flow, row)
    return Classification(
        row.label,
        flow.kind,
        _COUNT[row.into],
        _COUNT[row.out_of],
        into,
        out_of,
        row.determinism,
        on,
        margin,
        nearest,
    )


def _pair(values: Any, name: str) -> tuple[Any, Any]:
    try:
        first, second = (float(v) for v in values)
    except (TypeError, ValueError) as error:
        raise OptionError(f"{name}: expected a pair of numbers, received {values!r}.") from error
    whole = name == "sigma" and first.is_integer() and second.is_integer()
    return (int(first), int(second)) if whole else (first, second)


def _undecided(
    flow: ReducedFlow,
    changing: list[Boundary],
    on: tuple[Boundary, ...],
    margin: float,
    nearest: str,
) -> Classification:
    labels = dict.fromkeys(label for b in changing for label in b.between)
    if flow.folds in MIXED and len(changing) == 2:  # g = 2 and T = Delta = 0: all four meet
        labels = dict.fromkeys(("mix-0", "mix-S", "mix-C", "mix-F"))
    names = ", ".join(b.name for b in changing)
    determinism = (
        f"Degenerate: {names} ({'; '.join(b.meaning for b in changing)}). The classes "
        f"{', '.join(labels)} meet here and leading order does not decide between them; higher "
        "derivatives do."
    )
    none = Slopes("undecided")
    label = f"boundary {names}: {'|'.join(labels)}"
    nan = math.nan
    return Classification(label, flow.kind, nan, nan, none, none, determinism, on, margin, nearest)
