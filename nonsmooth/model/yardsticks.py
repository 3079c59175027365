"""Numbers of a system at one point: what steps are measured with."""

from __future__ import annotations

from dataclasses import dataclass

from .values import Array


@dataclass(frozen=True)
class Yardsticks:
    """Numbers at the start of a step.

    Attributes
    ----------
    layer : ndarray (m,)
        G at the multipliers given.
    slope : ndarray (m, m)
        Its derivatives by the unknown of each surface (lambda_i, or nu_i).
    factors : ndarray (m,)
        n_i; 1 where there is none.
    layer_gradient, surface_gradient, stop_gradient, factor_gradient : ndarray (m, N) or (s, N)
        Magnitudes of the state derivatives of G, of surfaces and gaps, of stops and resets.
    """

    layer: Array
    slope: Array
    factors: Array
    layer_gradient: Array
    surface_gradient: Array
    stop_gradient: Array
    factor_gradient: Array
