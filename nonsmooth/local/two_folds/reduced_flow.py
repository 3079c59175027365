"""The sliding flow of the normal form of a two-fold, with its orbits in closed form.

The sliding flow is z' = M z/(z2 + z3): its orbits are those of the linear flow dz/dr = M z, in the
direction of real time where z2 + z3 > 0 (Da) and against it in Dr, which is the mirror image
z -> -z with time reversed. An orbit is the exponential of a 2 x 2 matrix, and the times at which it
leaves a quadrant are inverse tangents.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...model import Array, DegenerateError, OptionError

#: An orbit this close to s, relative to its start, counts as reaching it.
_SMALL = 2e-3
_LARGE = 30.0


@dataclass(frozen=True)
class ReducedFlow:
    """The linear flow $dz/dr = M z$ that draws the sliding orbits in the $(z2, z3)$ plane.

    Sliding is attracting in Da ($z2, z3 > 0$), repelling in Dr ($z2, z3 < 0$). Slopes $m = z3/z2$ of
    orbits obey $dm/dr = sigma2 + (nu1 - nu2) m + sigma1 m^2$.

    Attributes
    ----------
    sigma : (int, int)
        +1 or -1 each. The fold of $F1$ is visible if $sigma1 = 1$, that of $F2$ if $sigma2 = -1$.
    nu : (float, float)
        The two numbers $(nu1, nu2)$ of the two-fold.

    Examples
    --------
    >>> flow = ReducedFlow((1, -1), (-2.0, -0.5))
    >>> flow.eigenvalues, flow.slopes
    (array([-2.5,  0. ]), array([ 2. , -0.5]))
    """

    sigma: tuple[int, int]
    nu: tuple[float, float]

    def __post_init__(self) -> None:
        if len(self.sigma) != 2 or any(s not in (-1, 0, 1) for s in self.sigma):
            raise OptionError(f"sigma: expected two signs, +1 or -1, received {self.sigma!r}.")
        if 0 in self.sigma:
            raise DegenerateError(
                f"sigma: expected nonzero second derivatives L11 and L22, received signs "
                f"{self.sigma!r}. A field has a cusp at the two-fold (cusp-fold); its "
                "classification needs third derivatives and is not built."
            )
        if len(self.nu) != 2 or not np.all(np.isfinite(self.nu)):
            raise OptionError(f"nu: expected two finite numbers, received {self.nu!r}.")

    @property
    def folds(self) -> str:
        """``"VV"``, ``"II"``, ``"VI"`` ($F1$ visible) or ``"IV"`` ($F2$ visible)."""
        return {(1, -1): "VV", (-1, 1): "II", (1, 1): "VI", (-1, -1): "IV"}[self.sigma]

    @property
    def kind(self) -> str:
        """``"visible"``, ``"invisible"`` or ``"visible-invisible"``."""
        return {"VV": "visible", "II": "invisible"}.get(self.folds, "visible-invisible")

    @property
    def matrix(self) -> Array:
        """The matrix $M = [[nu2, -sigma1], [sigma2, nu1]]$; (2, 2)."""
        (s1, s2), (n1, n2) = self.sigma, self.nu
        return np.array([[n2, -s1], [s2, n1]], dtype=float)

    @property
    def trace(self) -> float:
        """Trace of M, $T = nu1 + nu2$."""
        return self.nu[0] + self.nu[1]

    @property
    def determinant(self) -> float:
        """Determinant of M, $Delta = nu1 nu2 + sigma1 sigma2$."""
        return self.nu[0] * self.nu[1] + self.sigma[0] * self.sigma[1]

    @property
    def discriminant(self) -> float:
        """Discriminant of M, $(nu1 - nu2)^2 - 4 sigma1 sigma2$; negative: a focus."""
        return (self.nu[0] - self.nu[1]) ** 2 - 4 * self.sigma[0] * self.sigma[1]

    @property
    def gap(self) -> float:
        """Return g of mixed folds: $nu2 - nu1$ (VI), $nu1 - nu2$ (IV); eigenlines slide iff $g >= 2$."""
        return self.sigma[0] * (self.nu[1] - self.nu[0])

    @property
    def eigenvalues(self) -> NDArray[Any]:
        """Eigenvalues $(kappa_-, kappa_+)$ of M, ascending; complex where ``discriminant < 0``."""
        half, disc = self.trace / 2, self.discriminant
        if disc < 0:
            root = 0.5j * np.sqrt(-disc)
            return np.array([half - root, half + root])
        big = half + np.copysign(np.sqrt(disc) / 2, half)
        # the small one from the product: no cancellation
        return np.sort(np.array([self.determinant / big if big else 0.0, big])) + 0.0

    @property
    def slopes(self) -> NDArray[Any]:
        """Slopes $m = z3/z2 = (nu2 - kappa)/sigma1$ of the eigenlines, in the eigenvalues' order."""
        (s1, s2), difference, disc = self.sigma, self.nu[0] - self.nu[1], self.discriminant
        if disc < 0:
            return (self.nu[1] - self.eigenvalues) / s1
        big = -(difference + np.copysign(np.sqrt(disc), difference)) / (2 * s1)
        small = s2 / (s1 * big)
        return np.array(sorted((big, small), key=lambda m: -s1 * m))

    @property
    def eigenvectors(self) -> NDArray[Any]:
        """Unit eigenvectors as columns (2, 2), $z2 > 0$; equal columns for a Jordan block."""
        vectors = np.vstack([np.ones(2), self.slopes])
        return vectors / np.linalg.norm(vectors, axis=0)


def exponential(matrix: ArrayLike, r: ArrayLike) -> Array:
    """Matrix exponential exp(M r) of a real 2 x 2 matrix, in closed form."""
    m, r = np.asarray(matrix, dtype=float), np.asarray(r, dtype=float)[..., None, None]
    half = np.trace(m) / 2
    rest = m - half * np.eye(2)
    square = rest[0, 0] * rest[1, 1] - rest[0, 1] * rest[1, 0]  # minus the squared rate
    if square < 0:
        w = math.sqrt(-square)
        # e^{half r} cosh(w r) as two exponentials: no overflow of one times underflow of the other
        up, down = np.exp((half + w) * r), np.exp((half - w) * r)
        return (up + down) / 2 * np.eye(2) + (up - down) / (2 * w) * rest
    w = math.sqrt(square)
    sine = np.sin(w * r) / w if w > 0 else r
    return np.exp(half * r) * (np.cos(w * r) * np.eye(2) + sine * rest)


def leaving(matrix: ArrayLike, z: ArrayLike) -> tuple[float, int]:
    """Time r > 0 at which exp(M r) z leaves the open first quadrant, and the component; inf, -1."""
    m, z = np.asarray(matrix, dtype=float), np.asarray(z, dtype=float)
    half = np.trace(m) / 2
    rest = m - half * np.eye(2)
    square = rest[0, 0] * rest[1, 1] - rest[0, 1] * rest[1, 0]
    times = [_first_zero(z[i], (rest @ z)[i], square) for i in (0, 1)]
    component = int(np.argmin(times))
    return times[component], component if times[component] < math.inf else -1


def _first_zero(value: float, slope: float, square: float) -> float:
    """First r > 0 with value c(r) + slope s(r) = 0, c and s the (hyperbolic) cosine and sine."""
    w = math.sqrt(abs(square))
    if w < 1e-12:
        return -value / slope if value * slope < 0 else math.inf
    if square > 0:
        angle = math.atan2(-value * w, slope)  # tan(w r) = -value w/slope
        return (angle % math.pi or math.pi) / w
    ratio = -value * w / slope if slope else math.inf
    return math.atanh(ratio) / w if 0 < ratio < 1 else math.inf


@dataclass(frozen=True)
class Orbit:
    """One sliding orbit of Da in the direction of real time; ``-points[::-1]`` is one of Dr."""

    points: Array
    comes_from: str
    goes_to: str


def orbit(flow: ReducedFlow, z: ArrayLike, count: int = 250) -> Orbit:
    """Return the whole stay in Da of the sliding orbit through a point."""
    z = np.asarray(z, dtype=float)
    forward, goes_to = _end(flow.matrix, z)
    backward, comes_from = _end(-flow.matrix, z)
    r = np.concatenate([-backward[:0:-1], forward])
    points = np.einsum("...ij,j->...i", exponential(flow.matrix, r), z)
    # evenly spaced relative to the distance from s, since copies of all scales are drawn
    steps = np.hypot(*np.diff(points, axis=0).T) / np.linalg.norm(points[1:], axis=1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    r = np.interp(np.linspace(0.0, length[-1], count), length, r)
    points = np.einsum("...ij,j->...i", exponential(flow.matrix, r), z)
    return Orbit(np.maximum(points, 0.0), comes_from, goes_to)


def _end(matrix: Array, z: Array) -> tuple[Array, str]:
    """Times from 0 to the end of the stay in Da, and the name of the end."""
    last, component = leaving(matrix, z)
    if component >= 0:
        times = np.linspace(0.0, last, 1500)
        size = np.linalg.norm(exponential(matrix, times) @ z, axis=-1)
        return times[: _cut(size, float(np.linalg.norm(z)))], ("z2=0", "z3=0")[component]
    rates = np.linalg.eigvals(matrix).real
    rate = max(abs(v) for v in rates) or 1.0
    start = float(np.linalg.norm(z))
    times = np.concatenate([[0.0], np.geomspace(1e-3 / rate, 1e3 / rate, 3000)])
    with np.errstate(over="ignore", invalid="ignore"):
        size = np.linalg.norm(exponential(matrix, times) @ z, axis=-1)
    keep = _cut(np.nan_to_num(size, nan=np.inf), start)
    final = float(size[keep - 1])
    end = "s" if final <= 2 * _SMALL * start else "infinity"
    if _SMALL * 2 * start < final < _LARGE * start / 2:
        end = "equilibrium"
    return times[:keep], end


def _cut(size: Array, start: float) -> int:
    outside = np.flatnonzero((size < _SMALL * start) | (size > _LARGE * start))
    return int(outside[0]) + 1 if outside.size else len(size)


@dataclass(frozen=True)
class Sector:
    """A sector of Da between neighbouring eigenlines and folds; its orbits are scaled copies."""

    low: float
    high: float
    orbit: Orbit

    @property
    def middle(self) -> Array:
        """Unit vector along the middle."""
        angle = (self.low + self.high) / 2
        return np.array([math.cos(angle), math.sin(angle)])


def eigenlines(flow: ReducedFlow) -> list[tuple[float, float]]:
    """Return (eigenvalue, slope) of the eigenlines that lie in the sliding regions."""
    if flow.discriminant < -1e-9:
        return []
    pairs = zip(np.real(flow.eigenvalues), np.real(flow.slopes), strict=True)
    found = [(float(value), float(m)) for value, m in pairs if m > 0]
    if len(found) == 2 and abs(found[0][1] - found[1][1]) < 1e-4 * found[0][1]:
        return found[:1]  # Jordan block: one line
    return found


def sectors(flow: ReducedFlow) -> list[Sector]:
    """Return the sectors of Da, from the z2 axis to the z3 axis."""
    angles = sorted([0.0, math.pi / 2, *(math.atan(m) for _, m in eigenlines(flow))])
    result = []
    for low, high in pairwise(angles):
        middle = np.array([math.cos((low + high) / 2), math.sin((low + high) / 2)])
        result.append(Sector(low, high, orbit(flow, middle)))
    return result
