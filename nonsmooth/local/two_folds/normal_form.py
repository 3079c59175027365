"""Normal form of a two-fold from its second Lie derivatives.

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

import numpy as np

from ...model import OptionError, real
from .reduced_flow import ReducedFlow


@dataclass(frozen=True)
class NormalForm:
    """Leading-order data of a two-fold.

    Attributes
    ----------
    flow : ReducedFlow
        The signs, the two numbers and the matrix M.
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
        ``L11``, ``L12``, ``L21``, ``L22`` with $L_ij = F_i . grad L_j$.

    Returns
    -------
    NormalForm
        Signs, numbers and scales of the normal form.

    Raises
    ------
    DegenerateError
        $L11$ or $L22$ is zero (cusp-fold).

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
            f"lie: expected a mapping with {', '.join(names)}, received {lie!r}. L_ij = F_i . "
            "grad L_j, the second Lie derivatives at the two-fold."
        )
    return [real(lie[name], name) for name in names]
