"""Sliding orbits that leave a two-fold forward in time.

Near a two-fold s write x - s = a F1 + b F2: a and b are the times spent with each field, so a + b is
the time since s. With dt = (L2 - L1) dtau the sliding field becomes x' = L2 F1 - L1 F2, smooth and
zero at s, and to first order (a, b)' = A (a, b) with A = [[L12, L22], [-L11, -L21]]. Its real
eigenlines that lie in sliding regions are the canards (outgoing where a + b > 0 with L1 > 0 > L2)
and faux canards (with L1 < 0 < L2). Where both eigenvalues have the sign of the outgoing direction
s is a node of the sliding flow, and a whole sector of orbits leaves it. They are computed backward,
because forward they all approach the weak eigenline.

Source: Filippov 1988, sec. 19; Colombo & Jeffrey 2011; the coordinates (a, b) hold in R^n and where
the system depends on time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...flow.concatenation import forward, join, straight
from ...flow.follow import follow
from ...flow.names import guard_name
from ...flow.options import Tolerances
from ...flow.status import Status
from ...flow.trajectory import Trajectory
from ...local.point.regions import coincide
from ...local.point.surface_point import LocalSurface, Numbers
from ...model import Array, OptionError, Surfaces, motion

#: Relative time at which a path along an eigenline begins, and relative L2 - L1 at which one of a node
#: has reached s. The error is of second order in it.
_NEAR = 1e-5

#: Distances from s at which orbits of a node are chosen in their sector, in turn, relative to the time
#: left: nearer they are close to the weak eigenline, farther they have left the sector.
_DISTANCES = (0.25, 0.08, 0.16)


@dataclass(frozen=True)
class Path:
    """A sliding orbit from a point at which forward uniqueness fails.

    Attributes
    ----------
    run : Trajectory
        The sliding motion from that point.
    repelling : bool
        Whether it can be left at any time.
    """

    run: Trajectory
    repelling: bool


@dataclass(frozen=True)
class Slider:
    """Integration of the sliding flow of one surface to the end of its region."""

    where: LocalSurface
    surfaces: Surfaces
    t_end: float
    tolerances: Tolerances

    def on(self, x: Array) -> Array:
        """Move an extended state onto the surface."""
        return self.surfaces.project(x, self.where.parameters, [self.where.surface])

    @property
    def parameters(self) -> dict[str, float]:
        """Names and values."""
        names = self.where.system.parameter_names
        return dict(zip(names, self.where.parameters.tolist(), strict=True))

    def follow(self, x: Array, t: float, t_end: float, delta: float) -> Trajectory:
        """Follow until a fold, another surface, a stop, or abs(L1 - L2) = ``delta`` (if not 0)."""
        system, i = self.where.system, self.where.surface
        names = [guard_name(system, g) for g in motion(system, self.where.mode).guards]
        l1, l2 = (system.lie_derivative([self.where.side(c)], i) for c in "+-")
        near = [(l1 - l2) ** 2 - delta**2] if delta else []
        return follow(
            system,
            x[: system.dimension],
            t_end,
            mode=self.where.mode,
            until=[*names, *near],
            t_start=t,
            parameters=self.parameters,
            rtol=self.tolerances.rtol,
            atol=self.tolerances.atol,
        )

    def path(self, x: Array, t: float) -> Trajectory:
        """Follow forward from an extended state to ``t_end`` or the end of the region."""
        lie = self.where.at(x).lie
        return self.follow(x, t, self.t_end, 1e-9 * float(abs(lie[0] - lie[1])))


def paths_from(s: Array, t: float, slider: Slider, samples: int) -> list[Path]:
    """Sliding orbits that leave a two-fold.

    Parameters
    ----------
    s : ndarray (N,)
        The two-fold (extended state).
    t : float
        Time there.
    slider : Slider
    samples : int
        Number of members of the funnel. Where a sector of orbits leaves s, as many of them are
        computed, or, if each can be left at many times, about the square root of half as many.

    Returns
    -------
    list of Path
    """
    if not isinstance(slider, Slider):
        raise OptionError(
            f"slider={slider!r} is no Slider. Give one of the surface of the two-fold."
        )
    numbers = slider.where.at(s)
    if coincide(numbers, 1e-9):
        return _through(slider, s, t, numbers)
    if slider.where.system.extended_dimension == 2:
        return _planar(slider, s, t, numbers)
    second = numbers.second
    matrix = np.array([[second["L12"], second["L22"]], [-second["L11"], -second["L21"]]])
    lie = np.array([[second["L11"], second["L21"]], [second["L12"], second["L22"]]])
    values, vectors = np.linalg.eig(matrix)
    if np.iscomplexobj(values):
        return []
    lines = [(v, _outgoing(vectors[:, k], lie)) for k, v in enumerate(values)]
    lines.sort(key=lambda line: abs(line[0]))
    (weak_value, weak), (strong_value, strong) = lines
    if weak is None or weak_value * strong_value <= 0.0:
        chosen = [v for value, v in lines if v is not None and value != 0.0]
        return [_along(slider, s, t, numbers, v) for v in chosen]
    paths = [] if strong is None else [_along(slider, s, t, numbers, strong)]
    repelling = bool((lie @ weak)[0] > 0.0)
    count = max(2, round(math.sqrt(samples / 2))) if repelling else samples - len(paths)
    for k, ab in enumerate(_sector(weak, strong, lie, count)):
        path = _of_node(slider, s, t, numbers, ab, _DISTANCES[k % len(_DISTANCES)])
        if path is not None:
            paths.append(path)
    return paths


def _outgoing(v: Array, lie: Array) -> Array | None:
    """An eigenvector scaled to times with the sum 1; None outside sliding regions."""
    l1, l2 = lie @ v
    return v / v.sum() if l1 * l2 < 0.0 and v.sum() != 0.0 else None


def _sector(weak: Array, strong: Array | None, lie: Array, count: int) -> Iterator[Array]:
    """Directions inside the sector of orbits that leave s, the weak eigenline within it."""
    side = np.sign((lie @ weak)[0])
    edges = []
    for row, sign in ((0, -side), (1, side)):  # L1 = 0 with the sign of L2, and L2 = 0 with L1's
        v = np.array([lie[row, 1], -lie[row, 0]])
        edges.append(v if (lie @ v)[1 - row] * sign > 0.0 else -v)
    if strong is not None:
        beyond = [np.sign(_cross(weak, strong)) == np.sign(_cross(weak, e)) for e in edges]
        edges = [strong, edges[beyond.index(False)]]
    first, second = (e / np.abs(e).sum() for e in edges)
    for k in range(count):
        u = (k + 0.5) / count
        v = (1 - u) * first + u * second
        if v.sum() > 0.0:
            yield v / v.sum()


def _cross(v: Array, w: Array) -> float:
    return float(v[0] * w[1] - v[1] * w[0])


def _scale(slider: Slider, s: Array, t: float, v: Array) -> float:
    """The time in which the motion along v goes as far as the size of the state."""
    n = slider.where.system.dimension
    speed = float(np.linalg.norm(v[:n]))
    return min(slider.t_end - t, (1.0 + float(np.linalg.norm(s[:n]))) / max(speed, 1e-300))


def _repelling(numbers: Numbers) -> bool:
    return bool(numbers.lie[0] > numbers.lie[1])


def _through(slider: Slider, s: Array, t: float, numbers: Numbers) -> list[Path]:
    """The sliding orbit through a two-fold at which the fields coincide and sliding is regular."""
    step = _NEAR * _scale(slider, s, t, numbers.fields[0])
    ahead = slider.where.at(slider.on(s + step * numbers.fields[0]))
    if ahead.lie[0] * ahead.lie[1] >= 0.0:
        return []
    return [Path(slider.follow(s, t, slider.t_end, 0.0), _repelling(ahead))]


def _planar(slider: Slider, s: Array, t: float, numbers: Numbers) -> list[Path]:
    """The sliding orbits that leave a planar two-fold, on both sides of it."""
    tangent = np.array([-numbers.gradient[1], numbers.gradient[0]])
    tangent /= np.linalg.norm(tangent)
    step = _NEAR * (1.0 + float(np.linalg.norm(s)))
    paths = []
    for side in (1.0, -1.0):
        x = slider.on(s + side * step * tangent)
        beside = slider.where.at(x)
        if beside.lie[0] * beside.lie[1] >= 0.0:
            continue
        weights = np.array([-beside.lie[1], beside.lie[0]]) / (beside.lie[0] - beside.lie[1])
        speed = side * float(weights @ beside.fields @ tangent)
        if speed * (slider.t_end - t) > step:
            run = slider.path(x, t + step / speed)
            paths.append(Path(join([straight(run, t, s), run]), _repelling(beside)))
    return paths


def _along(slider: Slider, s: Array, t: float, numbers: Numbers, ab: Array) -> Path:
    """The sliding orbit from a start near s on an eigenline; deviations from it decay."""
    v = ab @ numbers.fields
    step = _NEAR * _scale(slider, s, t, v)
    x = slider.on(s + step * v)
    run = slider.path(x, t + step)
    start = straight(run, t, s[: slider.where.system.dimension])
    return Path(join([start, run]), _repelling(slider.where.at(x)))


def _of_node(
    slider: Slider, s: Array, t: float, numbers: Numbers, ab: Array, distance: float
) -> Path | None:
    """The orbit from s through the point at ``distance`` along ``ab``, computed backward."""
    # With more than three states or explicit time other two-folds are near: the point is moved until the
    # orbit comes from s.
    n, v = slider.where.system.dimension, ab @ numbers.fields
    distance *= _scale(slider, s, t, v)
    for _ in range(10):
        shift, late = np.zeros(n), 0.0
        for _ in range(8):
            x, moment = s + distance * v, t + distance + late
            x[:n] += shift
            x[n:] = moment
            x = slider.on(x)
            found = _backward(slider, x, moment, t - 3.0 * distance)
            if found is None:
                break
            back, foot, foot_time = found
            miss, late_by = s[:n] - foot, t - foot_time
            if np.abs(miss).max() <= 1e-3 * _NEAR * distance * np.abs(v).max() + 1e-13:
                if not slider.where.system.time_dependent:
                    back = _moved(back, late_by)
                    moment, late_by = moment + late_by, 0.0
                if abs(late_by) <= 1e-9 * distance:
                    return _complete(slider, s[:n], t, back, x, moment)
            shift, late = shift + miss, late + late_by
        distance *= 0.5
    return None


def _backward(
    slider: Slider, x: Array, t: float, t_low: float
) -> tuple[Trajectory, Array, float] | None:
    """Follow backward to near a two-fold; return the run, the two-fold and the time there."""
    lie = slider.where.at(x).lie
    delta = _NEAR * float(abs(lie[0] - lie[1]))
    back = slider.follow(x, t, t_low, delta)
    if back.status is not Status.STOPPED or back.events[-1].name != "f0":
        return None
    n = slider.where.system.dimension
    end = slider.where.system.extended_point(back.x[-1], float(back.t[-1]))
    numbers = slider.where.at(end)
    second = numbers.second
    lie = np.array([[second["L11"], second["L21"]], [second["L12"], second["L22"]]])
    ab = np.linalg.solve(lie, numbers.lie)
    return back, back.x[-1] - ab @ numbers.fields[:, :n], float(back.t[-1] - ab.sum())


def _moved(run: Trajectory, by: float) -> Trajectory:
    """The same curve at other times, for an autonomous system."""
    return replace(run, t=run.t + by, steps=replace(run.steps, starts=run.steps.starts + by))


def _complete(
    slider: Slider, s: Array, t: float, back: Trajectory, x: Array, moment: float
) -> Path | None:
    first = forward(back)
    if first.t[0] <= t:
        return None
    pieces = [straight(first, t, s), first]
    if moment < slider.t_end:
        pieces.append(slider.path(x, moment))
    return Path(join(pieces), _repelling(slider.where.at(x)))
