"""Classification of a point: which local object of the theory it is, with distances to other classes.

Each object is a set of equations (h = 0, L1 = 0, F1 = 0, ...) and inequalities. Equations hold
within ``tol``, inequalities by ``margin``. A point in between is degenerate, with the distance. All
distances are dimensionless and unchanged when h or a field is multiplied by a positive number.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..model import (
    Array,
    DegenerateError,
    FilippovSystem,
    Parameters,
    PointError,
    call,
    layer_of,
    require_system,
)
from ..model.checks import positive
from ..result_tables import Tabular
from .checks import MARGIN, require_linear
from .discrete_states import with_discrete_states_held
from .point.elements_at import acts
from .point.intersections import Intersection, Meeting
from .point.one_sided import one_sided_at
from .point.regions import Region, region_of
from .point.surface_point import FIELDS, SIDES, LocalSurface, Numbers, surface_at
from .read_only import ReadOnly
from .searches.boundary_equilibria import boundary_equilibrium_at
from .searches.equilibria import equilibrium_distance, kind_of
from .searches.find_two_fold import independence, two_fold_at
from .searches.fold_folds import fold_fold_of
from .searches.folds import Fold, bend, fold_at
from .searches.pseudo_equilibria import (
    along_intersection,
    equilibrium_of,
    pseudo_equilibrium_at,
    pseudo_kind,
    sliding_expansion,
    sliding_matrix,
)
from .searches.search import Found
from .two_folds import classify_two_fold


@dataclass(frozen=True, eq=False)
class LocalObject(Tabular):
    """The class of a point, with its distance from other classes.

    Attributes
    ----------
    kind : str
        ``"crossing"``, ``"sliding"``, ``"fold"``, ``"cusp"``, ``"fold-fold"`` (plane),
        ``"two-fold"``, ``"touch"`` (of a surface on which nothing slides), ``"rest"`` (between the two
        forces there), ``"equilibrium"``, ``"pseudo-equilibrium"``, ``"boundary equilibrium"``,
        ``"intersection"`` (of surfaces, where no mode or several are admissible) or ``"degenerate"``. On the
        boundary of a complementarity condition or contact also ``"leaving"``, ``"closed"`` and ``"impact"``.
    label : str
        Its class: ``"crossing up"``, ``"attracting sliding"``, ``"visible"``, ``"II2"``,
        ``"VV-C1"``, ``"stable focus"``, ``"pseudo-saddle"``, ``"BF3"``, ``"crossing to +-"``, ...
    side : {"+", "-", ""}
        The field to which a fold, cusp, equilibrium or boundary equilibrium belongs.
    point : ndarray (n,)
        The point, in the order of the states.
    distance : float
        To the nearest degenerate case; below the margin the kind is ``"degenerate"``.
    nearest : str
        Which condition that is, e.g. ``"L1 = 0"``.
    margins : mapping
        Distance from each condition that was checked.
    evidence : mapping
        Numbers: ``h``, ``L1``, ``L2``, and what decided the class.
    detail : object
        The Fold, TwoFold, FoldFold, BoundaryEquilibrium, PseudoEquilibrium or Intersection, if there is
        one.
    """

    kind: str
    label: str
    side: str
    point: Array
    distance: float
    nearest: str
    margins: Mapping[str, float]
    evidence: Mapping[str, float]
    detail: Any = None

    def __str__(self) -> str:
        field = f" of {FIELDS[self.side]}" if self.side else ""
        name = self.label if self.label == self.kind else f"{self.kind}: {self.label}"
        numbers = ", ".join(f"{k} = {v:.6g}" for k, v in self.evidence.items())
        away = f"{self.distance:.3g} from {self.nearest}" if self.nearest else "nothing is near"
        return f"{name}{field} at {self.point.tolist()} ({away}). {numbers}"


def spectrum(eigenvalues: NDArray[Any]) -> dict[str, float]:
    """Eigenvalues as numbers: real parts, and imaginary parts where they are not zero."""
    values: dict[str, float] = {}
    for i, v in enumerate(eigenvalues, 1):
        values[f"Re lambda{i}"] = float(v.real)
        if v.imag:
            values[f"Im lambda{i}"] = float(v.imag)
    return values


@with_discrete_states_held
def classify(
    system: FilippovSystem,
    point: ArrayLike,
    *,
    parameters: Parameters | None = None,
    t: float = 0.0,
    surface: int = 0,
    mode: str | None = None,
    tol: float = 1e-9,
    margin: float = MARGIN,
) -> LocalObject:
    """Classify a point: the local object of a surface, or an equilibrium off it.

    Parameters
    ----------
    system, point, parameters, t, surface, mode
        As in :func:`region`. A point on several surfaces is classified as their intersection, unless
        ``mode`` chooses sides; a mode with several ``s`` says which surfaces meet.
    tol : float, optional
        An equation holds if its dimensionless distance is at most this.
    margin : float, optional
        A point closer than this to a change of class is degenerate.

    Returns
    -------
    LocalObject
        The class of the point, with its margins and the numbers that decide it.

    Notes
    -----
    Conditions, closed contacts and joints have the admissible letters at the point unless ``mode`` gives them.
    Eigenvalues are those of motions that keep their functions at zero. Where a condition or contact opens or closes, rest
    while it is closed is a pseudo-equilibrium, and ``evidence`` has its multiplier; a condition whose y contains its
    multiplier is a continuous surface.

    Raises
    ------
    PointError
        Off the surface, or without one, and no equilibrium; off a constraint, or where a gap is negative; on several
        conditions at once; a wrong shape; not finite.
    DefinitionError
        Hidden dynamics; vector multipliers; a ``mode`` or ``surface`` that the system does not have.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        ``tol`` or ``margin`` is not positive.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[1, x], below=[-2, 1 + x])
    >>> for x0 in (1.0, 0.0, -0.5, -1 / 3, 1e-8):
    ...     found = classify(s, [x0, 0.0])
    ...     print(found.kind, "-", found.label)
    crossing - crossing up
    fold - visible
    sliding - attracting sliding
    pseudo-equilibrium - pseudo-saddle
    degenerate - near L1 = 0
    """
    positive(tol, "tol"), positive(margin, "margin")
    meeting = meeting_at(system, point, parameters, t, mode, tol)
    if meeting is not None:
        return classify_intersection(meeting, tol, margin)
    where, x = surface_at(system, point, parameters, t, surface, mode, smooth=True, tol=tol)
    if not where.mode:
        return _Classifier(where, where.at(x), tol, margin).smooth()
    require_linear(system, surface if where.element is None else where.element.surface, "classify")
    numbers = where.finite_at(x, slopes=where.one_sided)
    if not np.any(numbers.gradient):
        raise PointError(
            f"point {x}: expected a regular point of surface {surface}, received grad h = 0. Write "
            "h with a nonzero gradient."
        )
    away = numbers.distance / (1 + float(np.linalg.norm(x)))
    if away > tol or np.abs(numbers.angles).min() <= tol:
        where.finite_at(x)
    classifier = _Classifier(where, numbers, tol, margin)
    if where.one_sided:
        return classifier.one_sided()
    if away > tol:
        return classifier.off_surface(away)
    return classifier.on_surface()


class _Classifier:
    """One point with the numbers, tolerances and margins that its classification uses."""

    def __init__(self, where: LocalSurface, numbers: Numbers, tol: float, margin: float):
        self.where, self.numbers, self.tol, self.margin = where, numbers, tol, margin
        self.n = where.system.dimension
        self.derivatives = where.jacobians(numbers.x)
        self.margins: dict[str, float] = {}
        lie = dict(zip(("L1", "L2"), map(float, numbers.lie), strict=True))
        self.evidence: dict[str, float] = {"h": float(numbers.h), **lie}
        self.to_zero = [float("inf"), float("inf")]  # distance to a zero of F1, F2
        if not where.system.time_dependent:
            for k, (f, d) in enumerate(zip(numbers.fields, self.derivatives, strict=True)):
                if np.all(np.isfinite(d)):  # a root on the surface may have an infinite slope
                    self.to_zero[k] = equilibrium_distance(f, d, numbers.x)

    # the result -----------------------------------------------------------------------------------

    def result(self, kind: str, label: str, side: str = "", detail: Any = None) -> LocalObject:
        """Name the object unless a margin forbids it."""
        finite = {name: v for name, v in self.margins.items() if np.isfinite(v)}
        distance, nearest = min(((v, k) for k, v in finite.items()), default=(float("inf"), ""))
        if distance < self.margin:
            kind, label = "degenerate", f"near {nearest}" if distance > self.tol else nearest
        return LocalObject(
            kind,
            label,
            side,
            self.numbers.x[: self.n],
            distance,
            nearest,
            ReadOnly(self.margins),
            ReadOnly(self.evidence),
            detail,
        )

    def is_zero(self, value: float, name: str) -> bool:
        """Whether an equation holds; if not, its distance becomes a margin."""
        if value <= self.tol:
            return True
        self.margins[name] = value
        return False

    def smooth(self) -> LocalObject:
        """An equilibrium of a smooth system."""
        self.evidence.clear()
        if self.to_zero[0] > self.margin:
            why = "it is inside a mode" if self.where.element else "the system has no surface"
            basis, field = self.where.along(self.numbers.x), self.numbers.fields[0]
            field = field if basis is None else basis @ field
            raise PointError(
                f"point {self.numbers.x}: expected an equilibrium, as {why}, received the "
                f"field {field.tolist()}. find_equilibrium goes to one nearby."
            )
        self.is_zero(self.to_zero[0], "F = 0")
        return replace(self._equilibrium(0, "real"), side="")

    # off the surface ---------------------------------------------------------------------------

    def off_surface(self, away: float) -> LocalObject:
        """An equilibrium of the field that acts there, or of the other one (virtual)."""
        self.margins["h = 0"] = away
        own = 0 if self.numbers.h > 0 else 1
        for k in (own, 1 - own):
            if self.to_zero[k] <= self.margin:
                self.is_zero(self.to_zero[k], f"F{k + 1} = 0")
                status = "real" if k == own else "virtual"
                return self._equilibrium(k, status)
        x, gradient = self.numbers.x, self.where.free.at(self.numbers.x).gradient
        foot = x - self.numbers.h * gradient / (gradient @ gradient)
        raise PointError(
            f"point {x}: expected a point of the surface h = 0, or an equilibrium of a field, "
            f"received h = {self.numbers.h:.6g} (about {self.numbers.distance:.3g} away), F1 = "
            f"{self.numbers.fields[0].tolist()}, F2 = {self.numbers.fields[1].tolist()}. The "
            f"nearest point of the surface is about {foot.tolist()}."
        )

    def _equilibrium(self, k: int, status: str) -> LocalObject:
        eigenvalues = np.linalg.eigvals(self.derivatives[k])
        scale = float(np.max(np.abs(eigenvalues), initial=0.0))
        kind, hyperbolic = kind_of(eigenvalues, scale)
        self.margins["an eigenvalue without real part"] = hyperbolic
        self._gaps(eigenvalues, scale, kind)
        self.evidence.update(spectrum(eigenvalues))
        name = kind if status == "real" else f"virtual {kind}"
        return self.result("equilibrium", name, SIDES[k])

    def _gaps(self, eigenvalues: NDArray[Any], scale: float, kind: str) -> None:
        """Add the distance from equal eigenvalues, where a node turns into a focus."""
        if eigenvalues.size < 2 or not kind.endswith(("node", "focus")):
            return
        i, j = np.triu_indices(eigenvalues.size, 1)
        gaps = np.abs(eigenvalues[i] - eigenvalues[j]) / scale
        # the gap is the square root of the discriminant, which is the distance
        self.margins["equal eigenvalues"] = float(np.min(gaps)) ** 2

    # on the boundary of a condition or contact ---------------------------------------------------

    def one_sided(self) -> LocalObject:
        """Rest, an impact, the border of release, release, or motion along the boundary, in this order."""
        found = one_sided_at(self.where, self.numbers)
        del self.evidence["L2"]
        if self.is_zero(self.to_zero[0], "F1 = 0"):
            return self._boundary_equilibrium(0, "+")
        if not self.is_zero(abs(found.rate), "rate of the gap = 0"):
            name = "leaving" if found.rate > 0 else "impact"
            return self.result(name, name)
        self.evidence["multiplier"] = found.load
        matrix = found.tangents.T @ self.derivatives[1] @ found.tangents
        along = found.tangents.T @ self.numbers.fields[1]
        away = equilibrium_distance(along, matrix, self.numbers.x) if along.size else 0.0
        if self.where.system.time_dependent or found.drive > self.tol:
            away = float("inf")
        rests = self.is_zero(away, "a pseudo-equilibrium")
        border = self.is_zero(abs(found.drive), "release")
        if rests and not border:
            return self._closed_equilibrium(matrix)
        if border:
            self.evidence["next derivative"] = found.next
            label = "visible" if found.next > 0 else "invisible"
            if not found.next:
                self.margins["next derivative = 0"] = 0.0
            return self.result("fold", label, "+")
        name = "leaving" if found.drive > 0 else "closed"
        return self.result(name, name)

    def _closed_equilibrium(self, matrix: Array) -> LocalObject:
        """Rest of a closed condition or contact."""
        eigenvalues = np.linalg.eigvals(matrix)
        self.evidence.update(spectrum(eigenvalues))
        scale = float(np.max(np.abs(eigenvalues), initial=0.0))
        kind, hyperbolic = kind_of(eigenvalues, scale)
        self.margins["a sliding eigenvalue without real part"] = hyperbolic
        self._gaps(eigenvalues, scale, kind)
        return self.result("pseudo-equilibrium", pseudo_kind(kind, Region.ATTRACTING))

    # on the surface ----------------------------------------------------------------------------

    def on_surface(self) -> LocalObject:
        """Zero of a field, tangency of both or one, sliding or crossing, in this order."""
        found = self.where.switching
        if not found.slides:
            return self._without_sliding(not found.force_jumps)
        vanish = [self.is_zero(self.to_zero[k], f"F{k + 1} = 0") for k in (0, 1)]
        if all(vanish):
            self.margins["F1 = F2 = 0"] = 0.0
            return self.result("degenerate", "")
        if any(vanish):
            return self._boundary_equilibrium(vanish.index(True), SIDES[vanish.index(True)])
        angles = np.abs(self.numbers.angles)
        tangent = [self.is_zero(float(angles[k]), f"L{k + 1} = 0") for k in (0, 1)]
        if all(tangent):
            return self._fold_fold() if self._planar else self._two_fold()
        if any(tangent):
            return self._tangency(tangent.index(True))
        region = region_of(self.numbers, self.tol)
        if not region.sliding:
            return self.result("crossing", str(region))
        return self._sliding(str(region))

    @property
    def _planar(self) -> bool:
        return self.numbers.gradient.size == 2

    def _boundary_equilibrium(self, k: int, side: str) -> LocalObject:
        found = boundary_equilibrium_at(self.where, self.numbers, k, self.derivatives, 1e-300)
        self.margins.update(found.margins)
        self.evidence.update(found.numbers, **spectrum(found.eigenvalues))
        return self.result("boundary equilibrium", found.label, side, found)

    def _without_sliding(self, is_continuous: bool) -> LocalObject:
        """Crossing, touch or equilibrium where the speed of h is the same on both sides."""
        vanish = [self.is_zero(self.to_zero[k], f"F{k + 1} = 0") for k in (0, 1)]
        if all(vanish) if is_continuous else any(vanish):
            k = vanish.index(True)
            return self._boundary_equilibrium(k, "" if is_continuous else SIDES[k])
        numbers = self.numbers
        angle = float(np.abs(numbers.angles).min())
        if not self.is_zero(angle, "L = 0"):
            return self.result("crossing", str(region_of(numbers, self.tol)))
        bends = [numbers.second[name] for name in ("L11", "L22")]
        for k, second in enumerate(bends):
            self.evidence[f"L{k + 1}{k + 1}"] = second
            self.margins[f"L{k + 1}{k + 1} = 0"] = bend(numbers, k, second)
        if is_continuous or bends[0] * bends[1] > 0:
            return self.result("touch", "from above" if bends[0] > 0 else "from below")
        label = f"{'visible' if bends[0] > 0 else 'invisible'} on both sides"
        f1, f2 = numbers.fields
        lengths = float(np.linalg.norm(f1) * np.linalg.norm(f2))
        away = math.sqrt(max(1.0 - (float(f1 @ f2) / lengths) ** 2, 0.0)) if lengths else 0.0
        if f1 @ f2 < 0 and self.is_zero(away, "rest"):
            self.evidence["nu"] = float(np.linalg.norm(f1) / np.linalg.norm(f1 - f2))
            if self._planar and bends[0] < 0:
                label = f"{self._turning(bends)}, {label}"
            return self.result("rest", label)
        return self.result("touch", label)

    def _turning(self, bends: list[float]) -> str:
        """Stability of rest around which orbits turn: of L -> L + (2/3) (b1/|L11| + b2/|L22|) L^2, b = dLii/dL."""
        numbers, tangent = self.numbers, self.numbers.tangents[:, 0]
        hessians, growth = self.where.hessians(numbers.x)[0], 0.0
        for k, second in enumerate(bends):
            along = numbers.lie_gradients[k]
            slope = self.derivatives[k].T @ along + hessians[1 + k] @ numbers.fields[k]
            growth += float(slope @ tangent) / float(along @ tangent) / abs(second)
        self.evidence["growth"] = growth
        shrinks = self._jumps()
        if abs(shrinks - 1.0) > self.margin:
            self.evidence["jumps"] = shrinks
            return "stable" if shrinks < 1.0 else "unstable"
        speed = float(np.linalg.norm(numbers.fields[0]) * np.linalg.norm(numbers.gradient))
        if abs(growth) * speed < self.margin:
            return "neutral"
        return "stable" if growth < 0 else "unstable"

    def _jumps(self) -> float:
        """By what the resets on this surface multiply L in a turn round the point, which they keep."""
        system, x = self.where.system, self.numbers.x
        if not system.resets or not system.definition.plain:
            return 1.0
        d, first, ratio = system.definition, len(system.stops), 1.0
        guards = [d.guards[first + k] for k in range(len(system.resets))]
        maps = [d.maps[:, k] for k in range(len(system.resets))]
        function = system.function(
            ("jumps",),
            lambda: [
                *guards,
                *map(system.gradient, guards),
                *maps,
                *(system.gradient(m[i]) for m in maps for i in range(self.n)),
            ],
        )
        values, count = call(function, x, self.where.parameters), len(guards)
        tangent = self.numbers.tangents[:, 0]
        for k, (_, direction) in enumerate(system.resets):
            gradient = values[count + k].ravel()
            across = abs(float(gradient @ tangent)) > self.tol * float(np.linalg.norm(gradient))
            kept = np.allclose(values[2 * count + k].ravel(), x, rtol=0.0, atol=self.tol)
            if abs(float(values[k].item())) > self.tol or across or not kept:
                continue
            rows = values[3 * count + k * self.n : 3 * count + (k + 1) * self.n]
            along = abs(float(tangent @ np.array([row.ravel() for row in rows]) @ tangent))
            ratio *= along if direction else along**2
        return ratio

    def _fold_fold(self) -> LocalObject:
        found = fold_fold_of(self.where, self.numbers, 1e-300)
        self.margins.update(found.margins)
        self.evidence.update(found.numbers)
        return self.result("fold-fold", found.label, "", found)

    def _two_fold(self) -> LocalObject:
        numbers = self.numbers
        self.evidence.update(numbers.second)
        for k in (0, 1):
            name = f"L{k + 1}{k + 1}"
            self.margins[f"{name} = 0"] = bend(numbers, k, numbers.second[name])
        self.margins["dependent grad h, grad L1, grad L2"] = independence(numbers)
        if min(self.margins.values()) < self.margin:
            return self.result("degenerate", "")
        try:
            found = two_fold_at(self.where, Found(numbers.x))
        except DegenerateError:
            self.margins["the two-fold's normal form"] = 0.0
            return self.result("degenerate", "")
        c = classify_two_fold(found.sigma, found.nu, tol=self.margin)
        undecided = any(not boundary.harmless for boundary in c.boundaries)
        if undecided or not c.nearest.startswith("nu"):
            self.margins[c.nearest or "no boundary"] = c.margin
        self.evidence.update(nu1=found.nu[0], nu2=found.nu[1])
        free = self.where.along(numbers.x) is None and self.n > 2
        own = found if free else None  # it has coordinates of all states
        return self.result("two-fold", found.label, "", own)

    def _tangency(self, k: int) -> LocalObject:
        numbers, name = self.numbers, f"L{k + 1}{k + 1}"
        second = numbers.second[name]
        self.evidence[name] = second
        if self.is_zero(bend(numbers, k, second), f"{name} = 0"):
            return self._cusp(k)
        visible = (second > 0) == (k == 0)
        label = "visible" if visible else "invisible"
        return self.result("fold", label, SIDES[k], self._fold(k))

    def _cusp(self, k: int) -> LocalObject:
        numbers = self.numbers
        value = 6.0 * float(self.where.orbit(numbers.x, SIDES[k], 3)[1][3])
        name = f"L{k + 1}" + 2 * f"{k + 1}"
        self.evidence[name] = value
        speed = float(np.linalg.norm(numbers.fields[k]))
        length = 1 + float(np.linalg.norm(numbers.x))
        size = speed**3 * float(np.linalg.norm(numbers.gradient))
        self.margins[f"{name} = 0"] = abs(value) / size * length**2
        return self.result("cusp", "cusp", SIDES[k], self._fold(k))

    def _fold(self, k: int) -> Fold:
        found = Found(self.numbers.x, residual=self.numbers.distance)
        return fold_at(self.where, found, SIDES[k], 6, self.tol)

    def _sliding(self, region: str) -> LocalObject:
        numbers = self.numbers
        l1, l2 = numbers.lie
        self.evidence["alpha"] = float(l1 / (l1 - l2))
        if self.where.system.time_dependent or not np.all(np.isfinite(self.derivatives)):
            return self.result("sliding", region)
        speed = (l2 * numbers.fields[0] - l1 * numbers.fields[1]) / (l2 - l1)
        matrix, basis = sliding_matrix(numbers, self.derivatives)
        along = basis.T @ speed
        away = equilibrium_distance(along, matrix, numbers.x) if along.size else 0.0
        still = self._speed_ratio(along)
        if not self.is_zero(min(away, still), "a pseudo-equilibrium"):
            return self.result("sliding", region)
        return self._pseudo_equilibrium()

    def _speed_ratio(self, along: Array) -> float:
        """Sliding speed relative to the fields if within ``tol``, else inf; for zeros with g' = 0."""
        slow = min(float(np.linalg.norm(f)) for f in self.numbers.fields)
        ratio = float(np.linalg.norm(along)) / slow
        return ratio if ratio <= self.tol else float("inf")

    def _pseudo_equilibrium(self) -> LocalObject:
        numbers = self.numbers
        found = pseudo_equilibrium_at(self.where, Found(numbers.x, residual=numbers.distance))
        self.evidence.update(spectrum(found.eigenvalues))
        if found.eigenvalues.size == 0:
            return self.result("pseudo-equilibrium", found.kind, "", found)
        scale = float(max(np.linalg.norm(d, 2) for d in self.derivatives)) or 1.0
        slowest = float(np.min(np.abs(found.eigenvalues.real))) / scale
        if not self.is_zero(slowest, "pseudo-saddle-node"):
            largest = float(np.max(np.abs(found.eigenvalues)))
            self._gaps(found.eigenvalues, largest, found.kind)
            return self.result("pseudo-equilibrium", found.kind, "", found)
        if not self._planar:
            self.margins["a sliding eigenvalue without real part"] = 0.0
            return self.result("degenerate", "")
        _, second = sliding_expansion(self.where, numbers)
        self.evidence["second derivative of g"] = 2 * second
        self.margins["second derivative of g = 0"] = (
            abs(second) * (1 + float(np.linalg.norm(numbers.x))) / scale
        )
        return self.result("pseudo-equilibrium", "pseudo-saddle-node", "", found)


# where several surfaces meet ---------------------------------------------------------------------


def meeting_at(
    system: FilippovSystem,
    point: ArrayLike,
    parameters: Parameters | None,
    t: float,
    mode: str | None,
    tol: float,
) -> Meeting | None:
    """The intersection at a point, or None if only one surface is to be classified."""
    require_system(system, complementarity=True, joints=True)
    x, p = system.extended_point(point, t), system.parameter_vector(parameters)
    if system.surface_count < 2 or acts(system, x, p, mode, tol):
        return None
    chosen = None
    if mode is not None:
        chosen = [i for i, sign in enumerate(system.parse_mode(mode)) if sign == 0]
        if len(chosen) < 2:
            return None
    if chosen is None:
        at = layer_of(system).at(x, np.zeros(system.surface_count), p)
        lengths = np.linalg.norm(at.h_x, axis=1) * (1.0 + np.linalg.norm(x))
        if np.count_nonzero(np.abs(at.h) <= tol * lengths) < 2:
            return None
    return Meeting.at_point(system, x, p, chosen, tol)


def classify_intersection(meeting: Meeting, tol: float, margin: float) -> LocalObject:
    """Classify a point where several surfaces meet."""
    found = meeting.intersection()
    margins = {"a change of the admissible modes": found.distance}
    whole = found.sliding
    evidence: dict[str, float] = {}
    if whole is not None:
        evidence.update({f"multiplier {i}": float(whole.multipliers[i]) for i in found.surfaces})
    kind, label = _named(found)
    detail: object = found
    if whole is not None and len(found.continuations) == 1 and not meeting.system.time_dependent:
        at = meeting.at(whole.multipliers)
        matrix, basis = along_intersection(at, meeting.surfaces)
        along = basis.T @ at.field if basis.size else np.zeros(0)
        away = equilibrium_distance(along, matrix, meeting.x) if along.size else 0.0
        if away <= tol:
            here = Found(meeting.x)
            rest = equilibrium_of(meeting, whole.multipliers[meeting.surfaces], here)
            kind, label, detail = "pseudo-equilibrium", rest.kind, rest
            evidence.update(spectrum(rest.eigenvalues))
            if rest.eigenvalues.size:
                scale = float(np.linalg.norm(at.field_x, 2)) or 1.0
                slowest = float(np.abs(rest.eigenvalues.real).min())
                margins["a sliding eigenvalue without real part"] = slowest / scale
        else:
            margins["a pseudo-equilibrium"] = away
    nearest = min(margins, key=lambda name: margins[name])
    if margins[nearest] < margin:
        kind, label = "degenerate", f"near {nearest}"
    return LocalObject(
        kind,
        label,
        "",
        found.point,
        margins[nearest],
        nearest,
        ReadOnly(margins),
        ReadOnly(evidence),
        detail,
    )


def _named(found: Intersection) -> tuple[str, str]:
    """Kind and label of an intersection that is no pseudo-equilibrium."""
    modes = [c.mode for c in found.continuations]
    if found.sliding is not None and found.attraction in ("repelling", "spiralling out"):
        return "sliding", "repelling sliding"
    if len(modes) == 1:
        if found.sliding is not None:
            attracts = found.attraction in ("attracting", "spiralling in")
            return "sliding", "attracting sliding" if attracts else f"sliding, {found.attraction}"
        still = any(modes[0][i] == "s" for i in found.surfaces)
        return (
            ("sliding", f"sliding on in {modes[0]}")
            if still
            else ("crossing", f"crossing to {modes[0]}")
        )
    if not modes:
        return "intersection", "no mode is admissible"
    return "intersection", f"several modes are admissible: {', '.join(modes)}"
