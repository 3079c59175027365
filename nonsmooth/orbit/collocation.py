"""Variational equations along a known run by Gauss collocation, where they have no Taylor series.

A power law's derivative is not smooth where the law begins, so its variational equations cannot be
expanded there. Along the polynomials of a run they are linear with known coefficients, and collocation
at interior nodes needs no value at the ends of a step (order 24, which exceeds that of the run).

Source: Hairer, Norsett & Wanner 1993, "Solving ordinary differential equations I", sec. II.7.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..flow.trajectory import Trajectory
from ..model import Array
from .legs import Flown, Leg

_STAGES = 12


def collocated(
    run: Trajectory, leg: Leg, t_start: float, t_end: float, p: Array, chosen: tuple[int, ...]
) -> Flown:
    """Derivatives of a run's leg between two times, as ``legs.fly`` gives them.

    Parameters
    ----------
    run : Trajectory
        With its steps.
    leg : Leg
    t_start, t_end : float
    p : ndarray
    chosen : tuple of int
        Parameters by which one differentiates.
    """
    field = leg.field(run.system, chosen)
    n, starts = field.blocks.starts, run.steps.starts
    first = max(int(np.searchsorted(starts, t_start, side="right")) - 1, 0)
    last = max(int(np.searchsorted(starts, t_end, side="left")), first + 1)
    start = _polynomial(run, first, t_start, n)[0]
    initial = field.initial(start, p)
    derivatives = initial[:, 1:]
    nodes, weights, inner = gauss(_STAGES)
    for k in range(first, last):
        low = max(float(starts[k]), t_start)
        high = min(float(starts[k + 1]) if k + 1 < len(starts) else t_end, t_end)
        if high <= low:
            continue
        h = high - low
        values = [field.linear.copied(_polynomial(run, k, low + h * c, n)[0], p)[1:] for c in nodes]
        a = np.array([v[0] for v in values])
        b = np.zeros((_STAGES, *derivatives.shape))
        b[:, :, n:] = np.array([v[1][:, list(chosen)] for v in values])
        derivatives = derivatives + h * _increment(a, b, derivatives, h * inner, weights)
    end, rate = _polynomial(run, last - 1, t_end, n)
    return Flown(end, derivatives[:, :n], derivatives[:, n:], rate)


def _polynomial(run: Trajectory, step: int, t: float, n: int) -> tuple[Array, Array]:
    """State and its rate at a time of a step."""
    c = run.steps.coefficients[step][:n]
    degrees = np.arange(c.shape[1])
    powered = (t - float(run.steps.starts[step])) ** degrees
    return c @ powered, c[:, 1:] @ (degrees[1:] * powered[:-1])


def _increment(a: Array, b: Array, s: Array, inner: Array, weights: Array) -> Array:
    """Increment over h of S' = A S + B by collocation: sum_i w_i K_i, K = A (S + h a K) + B."""
    m, n = a.shape[:2]
    system = np.eye(m * n) - (a[:, :, None, :] * inner[:, None, :, None]).reshape(m * n, m * n)
    rates = np.linalg.solve(system, (a @ s + b).reshape(m * n, -1)).reshape(m, n, -1)
    return np.asarray(np.einsum("i,ijk->jk", weights, rates))


@lru_cache(maxsize=1)
def gauss(stages: int) -> tuple[Array, Array, Array]:
    """Nodes and weights of Gauss on [0, 1] and the integrals a_ij of the Lagrange basis to node i."""
    legendre = np.polynomial.legendre
    x, w = legendre.leggauss(stages)
    values = legendre.legvander(x, stages - 1)
    integrals = np.column_stack(
        [legendre.legval(x, legendre.legint(row, lbnd=-1)) for row in np.eye(stages)]
    )
    return (x + 1) / 2, w / 2, np.linalg.solve(values.T, integrals.T).T / 2
