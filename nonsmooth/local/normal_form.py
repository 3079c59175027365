"""Normal form of a two-fold and its sliding flow to leading order.

With L_ij = F_i . grad L_j at a point where h = L1 = L2 = 0,

    sigma1 = sgn L11,  sigma2 = sgn L22,
    nu1 = L12/sqrt|L11 L22|,  nu2 = -L21/sqrt|L11 L22|,
    theta = |L11 L22|^(-1/2),  phi = |L22/L11|^(1/4),
    z1 = theta h,  z2 = -phi theta L1,  z3 = theta L2/phi,

the fields become (-z2, -sigma1, nu1) for z1 > 0 and (z3, nu2, sigma2) for z1 < 0, and sliding
z' = M z/(z2 + z3) with M = [[nu2, -sigma1], [sigma2, nu1]] (Jeffrey & Colombo 2009 and
Colombo & Jeffrey 2011, SIAM J. Appl. Dyn. Syst.; here with two time scales: real time is phi tau
above and tau/phi below).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..model import Array, DegenerateError, OptionError, explain, real


@dataclass(frozen=True)
class ReducedFlow:
    """The linear flow dz/dr = M z that draws the sliding orbits in the (z2, z3) plane.

    Sliding is attracting in Da (z2, z3 > 0), repelling in Dr (z2, z3 < 0). Slopes m = z3/z2 of
    orbits obey dm/dr = sigma2 + (nu1 - nu2) m + sigma1 m^2.

    Attributes
    ----------
    sigma : (int, int)
        +1 or -1 each. The fold of F1 is visible if sigma1 = 1, that of F2 if sigma2 = -1.
    nu : (float, float)

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
        """``"VV"``, ``"II"``, ``"VI"`` (F1 visible) or ``"IV"`` (F2 visible)."""
        return {(1, -1): "VV", (-1, 1): "II", (1, 1): "VI", (-1, -1): "IV"}[self.sigma]

    @property
    def kind(self) -> str:
        """``"visible"``, ``"invisible"`` or ``"visible-invisible"``."""
        return {"VV": "visible", "II": "invisible"}.get(self.folds, "visible-invisible")

    @property
    def matrix(self) -> Array:
        """M = [[nu2, -sigma1], [sigma2, nu1]]; (2, 2)."""
        (s1, s2), (n1, n2) = self.sigma, self.nu
        return np.array([[n2, -s1], [s2, n1]], dtype=float)

    @property
    def trace(self) -> float:
        """T = nu1 + nu2."""
        return self.nu[0] + self.nu[1]

    @property
    def determinant(self) -> float:
        """Delta = nu1 nu2 + sigma1 sigma2."""
        return self.nu[0] * self.nu[1] + self.sigma[0] * self.sigma[1]

    @property
    def discriminant(self) -> float:
        """(nu1 - nu2)^2 - 4 sigma1 sigma2; negative: a focus."""
        return (self.nu[0] - self.nu[1]) ** 2 - 4 * self.sigma[0] * self.sigma[1]

    @property
    def gap(self) -> float:
        """Return g of mixed folds: nu2 - nu1 (VI), nu1 - nu2 (IV); eigenlines slide iff g >= 2."""
        return self.sigma[0] * (self.nu[1] - self.nu[0])

    @property
    def eigenvalues(self) -> NDArray[Any]:
        """Eigenvalues (lambda_-, lambda_+) of M, ascending; complex where ``discriminant < 0``."""
        half, disc = self.trace / 2, self.discriminant
        if disc < 0:
            root = 0.5j * np.sqrt(-disc)
            return np.array([half - root, half + root])
        big = half + np.copysign(np.sqrt(disc) / 2, half)
        # the small one from the product: no cancellation
        return np.sort(np.array([self.determinant / big if big else 0.0, big])) + 0.0

    @property
    def slopes(self) -> NDArray[Any]:
        """Slopes m = z3/z2 = (nu2 - lambda)/sigma1 of the eigenlines, in the eigenvalues' order."""
        (s1, s2), difference, disc = self.sigma, self.nu[0] - self.nu[1], self.discriminant
        if disc < 0:
            return (self.nu[1] - self.eigenvalues) / s1
        big = -(difference + np.copysign(np.sqrt(disc), difference)) / (2 * s1)
        small = s2 / (s1 * big)
        return np.array(sorted((big, small), key=lambda m: -s1 * m))

    @property
    def eigenvectors(self) -> NDArray[Any]:
        """Unit eigenvectors as columns (2, 2), z2 > 0; equal columns for a Jordan block."""
        vectors = np.vstack([np.ones(2), self.slopes])
        return vectors / np.linalg.norm(vectors, axis=0)


@dataclass(frozen=True)
class NormalForm:
    """Leading-order data of a two-fold.

    Attributes
    ----------
    flow : ReducedFlow
        sigma, nu and the matrix M.
    theta, phi : float
        Scales of h and of the two times.
    """

    flow: ReducedFlow
    theta: float
    phi: float


def normal_form(lie: Mapping[str, float]) -> NormalForm:
    """Normal form from the second Lie derivatives.

    Parameters
    ----------
    lie : mapping
        ``L11``, ``L12``, ``L21``, ``L22`` with L_ij = F_i . grad L_j.

    Returns
    -------
    NormalForm

    Raises
    ------
    DegenerateError
        L11 or L22 is zero (cusp-fold).

    Examples
    --------
    >>> form = normal_form({"L11": 4.0, "L12": -2.0, "L21": 2.0, "L22": -1.0})
    >>> form.flow.sigma, form.flow.nu, form.theta, round(form.phi, 6)
    ((1, -1), (-1.0, -1.0), 0.5, 0.707107)
    """
    l11, l12, l21, l22 = _entries(lie)
    sigma = (int(np.sign(l11)), int(np.sign(l22)))
    root = float(np.sqrt(abs(l11)) * np.sqrt(abs(l22))) or 1.0
    flow = ReducedFlow(sigma, (l12 / root, -l21 / root))
    return NormalForm(flow, 1 / root, float(np.sqrt(np.sqrt(abs(l22 / l11)))))


def _entries(lie: Mapping[str, float]) -> list[float]:
    names = ("L11", "L12", "L21", "L22")
    if not isinstance(lie, Mapping) or any(name not in lie for name in names):
        raise OptionError(
            explain(
                "lie",
                expected=f"a mapping with {', '.join(names)}",
                received=repr(lie),
                advice="L_ij = F_i . grad L_j, the second Lie derivatives at the two-fold.",
            )
        )
    return [real(lie[name], name) for name in names]
