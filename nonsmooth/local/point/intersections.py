"""Intersections of surfaces: admissible modes, and whether sliding attracts.

At a point of k surfaces the rates are w_i = grad h_i . f(x, lambda). A mode is admissible if a surface that is
left upward has lambda_i = +1 and w_i > 0, one that is left downward lambda_i = -1 and w_i < 0, and one that
slides w_i = 0 with lambda_i between: a box-constrained complementarity problem.

With independent multipliers (the bilinear law, which :func:`simulate` follows) the motion along an
intersection is one of many convex combinations of the 2^k fields that stay on it;
``intersection_range`` gives the range of all of them.

Source: Filippov 1988, sec. 4 and 23; Dieci & Lopez 2011, "Sliding motion on discontinuity surfaces of high
co-dimension", Numer. Math. 117; Jeffrey 2014, "Dynamics at a switching intersection: hierarchy,
isonomy, and multiple sliding", SIAM J. Appl. Dyn. Syst. 13, 1082 (the canopy, here "bilinear").
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...flow import point_law
from ...model import (
    Array,
    DefinitionError,
    FilippovSystem,
    LayerNumbers,
    Parameters,
    PointError,
    coupled_of,
    layer_of,
    read_function,
    require_system,
    sliding_multipliers,
)
from ...model.checks import positive
from ..checks import require_surface
from ..discrete_states import with_discrete_states_held
from .surface_point import TOLERANCE

#: Up to this number of surfaces all 3^k modes are tried.
_TRIED = 5

#: Growth across a layer below this, relative to its slope, counts as none.
_NEUTRAL = 1e-9


@dataclass(frozen=True, eq=False)
class Continuation:
    """An admissible mode.

    Attributes
    ----------
    mode : str
        One letter for each surface of the system.
    multipliers : ndarray (m,)
        Of all surfaces.
    velocity : ndarray (n,)
        Velocity of the states in that mode.
    rates : ndarray (k,)
        $d h_i/dt$ of the surfaces that meet at the point.
    eigenvalues : ndarray
        Of the layer problem of those that slide: all with negative real part where it attracts.
    slack : float
        Distance of the mode from being inadmissible: the least of $1 - abs(lambda_i)$ and of the angles
        between the motion and the surfaces that it leaves.
    """

    mode: str
    multipliers: Array
    velocity: Array
    rates: Array
    eigenvalues: NDArray[np.complex128]
    slack: float


@dataclass(frozen=True, eq=False)
class Intersection:
    """A point where several surfaces meet.

    Attributes
    ----------
    point : ndarray (n,)
        The point, in the order of the states.
    surfaces : tuple of int
        Which surfaces meet there, by index.
    continuations : tuple of Continuation
        Admissible modes. One: the continuation is unique for independent multipliers.
    attraction : str
        Whether orbits beside the intersection reach it and slide along it: ``"attracting"`` (in finite
        time, shown by a Lyapunov function), ``"repelling"``, ``"spiralling in"`` and ``"spiralling out"``
        (round a point of the plane, by the return map to second order), ``"unstable across"`` (the layer
        problem grows), ``"not shown"``, or ``""`` where not all of its surfaces can slide.
    distance : float
        To the nearest change of the admissible modes.
    complete : bool
        Whether all modes are known: by trying them, or because one solution was shown to be the only one.
    """

    point: Array
    surfaces: tuple[int, ...]
    continuations: tuple[Continuation, ...]
    attraction: str
    distance: float
    complete: bool

    @property
    def sliding(self) -> Continuation | None:
        """Sliding along all surfaces of the intersection, if it is admissible."""
        whole = [c for c in self.continuations if all(c.mode[i] == "s" for i in self.surfaces)]
        return whole[0] if whole else None

    def __str__(self) -> str:
        names = " = ".join(f"h{i}" for i in self.surfaces)
        modes = ", ".join(c.mode for c in self.continuations) or "none"
        tail = f"; sliding along it: {self.attraction}" if self.attraction else ""
        return f"{names} = 0 at {self.point.tolist()}: admissible modes: {modes}{tail}."


@with_discrete_states_held
def intersection(
    system: FilippovSystem,
    point: ArrayLike,
    *,
    surfaces: Sequence[int] | None = None,
    parameters: Parameters | None = None,
    t: float = 0.0,
    tol: float = TOLERANCE,
) -> Intersection:
    """Find the admissible modes at a point where surfaces meet.

    Parameters
    ----------
    system : FilippovSystem
        Contacts of impacts count as open.
    point : array_like (n,)
        The point, in the order of the states.
    surfaces : sequence of int, optional
        Those that meet at the point; by default those closer than ``tol``.
    parameters, t : optional
        As in :func:`region`.
    tol : float, optional
        A point is on a surface where $abs(h)/|grad h| <= tol (1 + |x|)$.

    Returns
    -------
    Intersection
        The admissible modes from the point, and what attracts.

    Raises
    ------
    PointError
        On no surface, or where the surfaces are not transversal; a wrong shape; not finite.
    DefinitionError
        ``system`` is none, or has no surface, or vector multipliers; a surface that it does not have.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        ``tol`` is not positive.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, a, b = (ca.SX.sym(s) for s in ("x", "y", "a", "b"))
    >>> spiral = ns.FilippovSystem(
    ...     [x, y], field=[-a + 2 * b, -2 * a - b], multipliers=[a, b], surfaces=[x, y])
    >>> found = ns.local.intersection(spiral, [0.0, 0.0])
    >>> [c.mode for c in found.continuations], found.attraction
    (['ss'], 'attracting')
    """
    require_system(system)
    x, p = system.extended_point(point, t), system.parameter_vector(parameters)
    return Meeting.at_point(system, x, p, surfaces, positive(tol, "tol")).intersection()


class Meeting:
    """A point of some surfaces with its parameters."""

    def __init__(
        self,
        system: FilippovSystem,
        x: Array,
        p: Array,
        surfaces: Sequence[int],
        letters: Array | None = None,
    ):
        self.system, self.x, self.p, self.surfaces = system, x, p, list(surfaces)
        self.layer = layer_of(system)
        h = self.layer.at(x, np.zeros(system.surface_count), p).h
        self.held = np.where(h > 0.0, 1.0, -1.0) if letters is None else letters.copy()
        self.held[self.surfaces] = 0.0

    @classmethod
    def at_point(
        cls, system: FilippovSystem, x: Array, p: Array, surfaces: Sequence[int] | None, tol: float
    ) -> Meeting:
        """The intersection at a point, of chosen surfaces or of all those through it."""
        require_surface(system)
        found = layer_of(system).at(x, np.zeros(system.surface_count), p)
        lengths = np.linalg.norm(found.h_x, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            away = np.abs(found.h) / lengths / (1 + np.linalg.norm(x))
        near = [i for i in range(system.surface_count) if away[i] <= tol]
        chosen = near if surfaces is None else [system.surface_index(i) for i in surfaces]
        if not chosen or set(chosen) - set(near):
            expected = "where surfaces meet" if surfaces is None else f"of surfaces {chosen}"
            raise PointError(
                f"point {x}: expected a point {expected}, received h = {found.h.tolist()}. "
                "find_pseudo_equilibrium(system, near, mode=...) finds points of intersections; raise tol "
                "if the point is rounded."
            )
        if np.linalg.matrix_rank(found.h_x[chosen] / lengths[chosen, None]) < min(
            len(chosen), x.size
        ):
            raise PointError(
                f"point {x}: expected independent gradients of surfaces {chosen}, received "
                f"{found.h_x[chosen].tolist()}. Surfaces that touch are not supported."
            )
        return cls(system, x, p, chosen)

    def at(self, multipliers: Array) -> LayerNumbers:
        """Evaluate at multipliers (m,)."""
        return self.layer.at(self.x, multipliers, self.p)

    def intersection(self) -> Intersection:
        """Find all admissible modes."""
        candidates, complete = self._candidates
        slacks = [(self._slack(lam, mode), mode, lam) for mode, lam in candidates]
        going = [self._continuation(mode, lam, s) for s, mode, lam in slacks if s >= 0.0]
        whole = [c for c in going if all(c.mode[i] == "s" for i in self.surfaces)]
        return Intersection(
            point=self.x[: self.system.dimension],
            surfaces=tuple(self.surfaces),
            continuations=tuple(going),
            attraction=self.attraction(whole[0].multipliers) if whole else "",
            distance=min((abs(s) for s, _, _ in slacks), default=float("inf")),
            complete=complete,
        )

    @cached_property
    def _candidates(self) -> tuple[list[tuple[str, Array]], bool]:
        """Modes with their multipliers, those outside [-1, 1] included; whether they are all."""
        k = len(self.surfaces)
        if self.layer.affine:
            found = self.at(self.held)
            a = found.rates[self.surfaces]
            m = found.rates_l[np.ix_(self.surfaces, self.surfaces)]
            if k > _TRIED and point_law.is_unique(m):
                lam = point_law.solve(a, m)
                if lam is not None:
                    letters = np.where(np.abs(lam) < 1.0, 0.0, lam)
                    return [(self._mode(letters), self._with(lam))], True
        if k > _TRIED:
            raise DefinitionError(
                f"surfaces {self.surfaces}: {k} surfaces meet, but the modes of more than {_TRIED} are "
                "found only if the matrix of their rates is a P-matrix. Use simulate to continue from "
                "there."
            )
        every = list(product((1.0, -1.0, 0.0), repeat=k))
        return [pair for letters in every for pair in self._solved(np.array(letters))], True

    def _solved(self, letters: Array) -> Iterable[tuple[str, Array]]:
        mode = self._mode(letters)
        if not np.any(letters) and self.layer.affine:
            lam = self._dependent()
            if lam is not None:
                yield mode, lam
                return
        coupled = coupled_of(self.system)
        for unknowns in sliding_multipliers(coupled, mode, self.x, self.p, stable_only=False):
            lam = self._with(letters)
            held = coupled.held(mode)
            factors = coupled.layer_at(self.x, held, unknowns, self.p).factors
            slides = [i for i in self.surfaces if mode[i] == "s"]
            with np.errstate(divide="ignore", invalid="ignore"):
                lam[slides] = (unknowns / factors)[slides]
            if np.all(np.isfinite(lam)):
                yield mode, lam

    def _dependent(self) -> Array | None:
        """Multipliers of least norm that keep all surfaces, where their matrix is singular; None if there are none."""
        none = self._with(np.zeros(len(self.surfaces)))
        at = self.at(none)
        a, m = at.rates[self.surfaces], at.rates_l[np.ix_(self.surfaces, self.surfaces)]
        size = float(np.abs(m).max(initial=0.0))
        if not size or np.linalg.matrix_rank(m, tol=_NEUTRAL * size) == len(m):
            return None
        lam = np.asarray(np.linalg.lstsq(m, -a, rcond=_NEUTRAL)[0], dtype=np.float64)
        holds = np.abs(a + m @ lam).max() <= _NEUTRAL * (size + np.abs(a).max())
        return self._with(lam) if holds else None

    def _mode(self, letters: Array) -> str:
        values = self._with(letters)
        signs = {1.0: "+", -1.0: "-", 0.0: "s"}
        return "".join(signs[v] for v in values.tolist())

    def _with(self, multipliers: Array) -> Array:
        values = self.held.copy()
        values[self.surfaces] = multipliers
        return values

    def _slack(self, lam: Array, mode: str) -> float:
        """Least margin of the conditions of an admissible mode; negative where it is inadmissible."""
        found = self.at(lam)
        sizes = np.linalg.norm(found.h_x, axis=1) * np.linalg.norm(found.field)
        slack = []
        for i in self.surfaces:
            if mode[i] == "s":
                slack.append(1.0 - abs(float(lam[i])))
            else:
                angle = found.rates[i] / sizes[i] if sizes[i] else 0.0
                if abs(angle) <= TOLERANCE and sizes[i] and not self.system.switching(i).slides:
                    angle = self._bend(found, i) / sizes[i]  # an orbit that touches, or that turns
                slack.append(float(angle if mode[i] == "+" else -angle))
        return min(slack)

    def _bend(self, found: LayerNumbers, i: int) -> float:
        """Second derivative of a surface along the motion, over the field's rate in the layer's mode."""
        speed = float(np.linalg.norm(found.field))
        return float(found.rates_x[i] @ found.field) * (1 + float(np.linalg.norm(self.x))) / speed

    def _continuation(self, mode: str, lam: Array, slack: float) -> Continuation:
        found = self.at(lam)
        slides = [i for i in self.surfaces if mode[i] == "s"]
        return Continuation(
            mode,
            lam,
            found.field[: self.system.dimension],
            found.rates[self.surfaces],
            np.linalg.eigvals(found.rates_l[np.ix_(slides, slides)]).astype(complex),
            slack,
        )

    def attraction(self, lam: Array) -> str:
        """Whether sliding along all surfaces attracts (see ``Intersection``)."""
        chosen, k = self.surfaces, len(self.surfaces)
        m = self.at(lam).rates_l[np.ix_(chosen, chosen)]
        if self._shrinks(lam, m, -1.0):
            return "attracting"
        if self._shrinks(lam, m, 1.0):
            return "repelling"
        if k == 2 and self.system.extended_dimension == 2:
            ratio, bend = self._return_map() or (1.0, 0.0)
            if (ratio, bend) != (1.0, 0.0):
                inward = ratio < 1.0 or (ratio == 1.0 and bend < 0.0)
                return "spiralling in" if inward else "spiralling out"
        growth = float(np.linalg.eigvals(m).real.max())
        return "unstable across" if growth > _NEUTRAL * np.abs(m).max() else "not shown"

    def _return_map(self) -> tuple[float, float] | None:
        """Return map of an orbit around a point of the plane: ratio and bend."""
        rates, slopes, sizes = [], [], []
        for quadrant in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
            found = self.at(self._with(np.array(quadrant, float)))
            h_x = found.h_x[self.surfaces]
            if np.linalg.det(h_x) == 0.0:
                return None
            rates.append(found.rates[self.surfaces])
            sizes.append(np.linalg.norm(h_x, axis=1) * np.linalg.norm(found.field))
            slopes.append(found.rates_x[self.surfaces] @ np.linalg.inv(h_x))
        for turned in (0, 1):
            if np.all(np.abs(np.array(rates)) <= TOLERANCE * np.array(sizes), axis=0)[turned]:
                return _go_round_a_touch(np.array(rates)[:, 1 - turned], np.array(slopes), turned)
        return point_law.go_round(np.array(rates), np.array(slopes))

    def _shrinks(self, lam: Array, m: Array, sign: float) -> bool:
        """Whether V = sum_i d_i abs(h_i) (1 - lambda_i sgn h_i) falls (-1) or rises (+1) beside it."""
        if self.layer.affine and point_law.attracts(-sign * m):
            return True
        if len(self.surfaces) > _TRIED:
            return False
        from scipy.optimize import linprog

        rows = []
        for mode, values in self._candidates[0]:
            if all(mode[i] == "s" for i in self.surfaces) or np.abs(values).max() > 1.0 + _NEUTRAL:
                continue
            terms = ((values - lam) * self.at(values).rates)[self.surfaces]
            rows.append(
                [0.0 if mode[i] == "s" else t for i, t in zip(self.surfaces, terms, strict=True)]
            )
        table = sign * np.array(rows)
        table /= np.abs(table).max(axis=1, initial=1e-300, keepdims=True)
        # weights d from 0 to 1 with the largest rate of change of V below zero
        found = linprog(
            [*[0.0] * len(self.surfaces), -1.0],
            A_ub=np.hstack([-table, np.ones((len(table), 1))]),
            b_ub=np.zeros(len(table)),
            bounds=[(0.0, 1.0)] * len(self.surfaces) + [(None, None)],
        )
        return found.x is not None and bool(found.x[-1] > _NEUTRAL)


def _go_round_a_touch(speeds: Array, slopes: Array, turned: int) -> tuple[float, float] | None:
    """Return map of a point where orbits touch one of the surfaces in all quadrants ++, -+, --, +-.

    Along them $h' = c k$ and $k' = s$, so that k turns from v to $-v sqrt(|s'/s|)$ between two passages of h = 0.
    """
    other = 1 - turned
    c, above = slopes[:, turned, other], np.array([[1, 0, 0, 1], [1, 1, 0, 0]][turned], bool)
    out = np.sign(c[0])
    if not np.all(out * c > 0) or not np.all(np.where(above, -out, out) * speeds > 0):
        return None
    rising = np.array([[1, 1, 0, 0], [1, 0, 0, 1]][turned], bool)  # k > 0
    leaving = above == (rising if out > 0 else ~rising)
    ratio = float(np.sqrt(np.prod(np.abs(speeds[~leaving])) / np.prod(np.abs(speeds[leaving]))))
    return ratio if abs(ratio - 1.0) > _NEUTRAL else 1.0, 0.0


# the range of Filippov's convex set --------------------------------------------------------------


@with_discrete_states_held
def intersection_range(
    system: FilippovSystem,
    point: ArrayLike,
    of: Any,
    *,
    surfaces: Sequence[int] | None = None,
    parameters: Parameters | None = None,
    t: float = 0.0,
) -> tuple[float, float]:
    """Range of d(of)/dt over all convex combinations of fields that stay on an intersection.

    Parameters
    ----------
    system : FilippovSystem
        With the surfaces that meet, and their multipliers.
    point : array_like (n,)
        A point on the surfaces.
    of : expression
        A function of states, parameters and time, such as one of the states.
    surfaces : sequence of int, optional
        Which surfaces meet; all of them by default.
    parameters, t : optional
        As in :func:`region`.

    Returns
    -------
    low, high : float
        Equal where Filippov's convention determines the motion.

    Raises
    ------
    PointError
        No convex combination stays on the intersection; off one of the surfaces; a wrong shape.
    DefinitionError
        ``of`` is no expression in states, parameters and time; a surface that the system does not
        have, or vector multipliers.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, z, a, b = (ca.SX.sym(s) for s in ("x", "y", "z", "a", "b"))
    >>> system = ns.FilippovSystem(
    ...     [x, y, z], field=[-a, -b, 1 + a * b / 2], multipliers=[a, b], surfaces=[x, y])
    >>> low, high = ns.local.intersection_range(system, [0, 0, 0], of=z)
    >>> round(low, 12), round(high, 12)
    (0.5, 1.5)
    """
    from scipy.optimize import linprog

    require_system(system)
    chosen = _chosen(system, surfaces)
    of = read_function(system.definition, of, "of")
    every = range(system.surface_count)
    h = [system.evaluate(system.surface_function(i), point, parameters, t).item() for i in every]
    _refuse_distance(system, point, parameters, t, {i: h[i] for i in chosen})
    letters = ["+" if value > 0 else "-" for value in h]
    rates, normal = [], []
    for combination in product("+-", repeat=len(chosen)):
        for i, letter in zip(chosen, combination, strict=True):
            letters[i] = letter
        mode = "".join(letters)
        rates.append(_rate(system, mode, of, None, point, parameters, t))
        normal.append([_rate(system, mode, None, i, point, parameters, t) for i in chosen])
    equations = np.vstack([np.array(normal).T, np.ones(len(rates))])
    right = np.append(np.zeros(len(chosen)), 1.0)
    results = [linprog(s * np.array(rates), A_eq=equations, b_eq=right) for s in (1.0, -1.0)]
    if any(r.x is None for r in results):
        raise PointError(
            f"point: no convex combination of the fields stays on surfaces {chosen} there (h = "
            f"{[h[i] for i in chosen]}). The motion leaves the intersection."
        )
    return float(results[0].fun), float(-results[1].fun)


def _chosen(system: FilippovSystem, surfaces: Sequence[int] | None) -> list[int]:
    items: Any = range(system.surface_count) if surfaces is None else surfaces
    if isinstance(items, (str, bytes)) or not isinstance(items, (Sequence, np.ndarray)):
        items = [items]
    chosen = [system.surface_index(i) for i in items]
    if not chosen or len(set(chosen)) < len(chosen):
        raise DefinitionError(
            f"surfaces: expected different indices below {system.surface_count}, at least one, "
            f"received {chosen}."
        )
    return chosen


def _refuse_distance(
    system: FilippovSystem,
    point: ArrayLike,
    parameters: Parameters | None,
    t: float,
    values: dict[int, float],
) -> None:
    for i, h in values.items():
        slope = system.evaluate(system.gradient(system.surface_function(i)), point, parameters, t)
        scale = float(np.linalg.norm(slope)) * (
            1.0 + float(np.linalg.norm(np.asarray(point, float)))
        )
        if not abs(h) <= TOLERANCE * scale:
            raise PointError(
                f"point: h{i} = {h:.6g}, but the surfaces are {list(values)}. Give surfaces= those that "
                "meet at the point."
            )


def _rate(
    system: FilippovSystem,
    mode: str,
    of: Any,
    surface: int | None,
    point: ArrayLike,
    parameters: Parameters | None,
    t: float,
) -> float:
    """d(of)/dt, or dh_i/dt, along the field of a mode."""
    derivative = (
        system.lie_derivative([mode], of=of)
        if surface is None
        else system.lie_derivative([mode], surface)
    )
    return system.evaluate(derivative, point, parameters, t).item()
