"""Homoclinic orbits to pseudo-saddles of the plane, which they reach in finite time.

The unstable manifold of a pseudo-saddle on attracting sliding is the surface itself. It leads to a visible
fold, from where the orbit flies and, at one value of a parameter, lands on the pseudo-saddle. For the
legs i = 1 .. N of the flight, the fold point x_1, the pseudo-saddle P with its weight alpha and the
parameter mu,

    h(x_1) = 0,  L_i(x_1) = 0,  phi_i(x_i, T_i) = x_(i+1),  h(x_(i+1)) = 0,  phi_N(x_N, T_N) = P,
    h(P) = 0,  (1 - alpha) F1(P) + alpha F2(P) = 0:

no asymptotics. Source: Kuznetsov, Rinaldi & Gragnani 2003, "One-parameter bifurcations in planar Filippov
systems".
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...flow.simulate import simulate
from ...local.searches.folds import find_fold
from ...local.searches.pseudo_equilibria import PseudoEquilibrium, find_pseudo_equilibrium
from ...model import Array, ConvergenceError, FilippovSystem, NonsmoothError
from ...model.derivatives.event_maps import event_map, surface_map
from ...model.derivatives.variational import variational_field
from ..periodic.orbit import named
from ..runs.legs import Leg, stretches
from .loops import Loop

#: A flight that is to become homoclinic lands within this part of its size from the pseudo-saddle.
_CLOSE = 0.5


def flight_to(
    system: FilippovSystem, saddle: PseudoEquilibrium, p: Array
) -> tuple[str, list[Leg], list[Array], list[float]]:
    """The flight from a visible fold that lands nearest to the pseudo-saddle."""
    values, best = named(system, p), None
    told: list[str] = []
    for side in "+-":
        try:
            fold = find_fold(system, saddle.point, side=side, parameters=values)  # type: ignore[arg-type]
        except NonsmoothError as error:
            told.append(f"side {side!r}: {error}")
            continue
        if fold.kind != "visible":
            told.append(f"side {side!r}: its fold at {fold.point.tolist()} is not visible")
            continue
        size = float(np.linalg.norm(fold.point - saddle.point)) or 1.0
        for k in range(9):
            run = simulate(
                system, fold.point, 4.0**k, parameters=values, start_mode=side, tol=1e-12
            )
            if any(e.kind == "entry" for e in run.events):
                break
        flown = []
        for part in stretches(run):
            flown.append(part)
            if part.leg.kind == "entry":
                break
        if flown[-1].leg.kind != "entry":
            told.append(f"side {side!r}: the orbit of the fold does not land")
            continue
        miss = float(np.linalg.norm(flown[-1].end - saddle.point)) / size
        if miss > _CLOSE:
            told.append(
                f"side {side!r}: the orbit lands {miss:.2g} of the distance to the fold away"
            )
        elif best is None or miss < best[0]:
            starts, times = [f.start for f in flown], [f.duration for f in flown]
            best = (miss, side, [f.leg for f in flown], starts, times)
    if best is None:
        raise ConvergenceError(
            f"homoclinic orbit: expected a visible fold whose orbit lands near the pseudo-saddle "
            f"{saddle.point.tolist()}, received none ({'; '.join(told)}). Give a better guess of the "
            "parameter.",
            point=saddle.point,
        )
    return best[1:]


class PseudoSaddleLoop(Loop):
    """A flight from a visible fold to a pseudo-saddle of a planar system."""

    def __init__(
        self,
        system: FilippovSystem,
        legs: Sequence[Leg],
        free: tuple[int, ...],
        p: Array,
        side: str,
    ):
        super().__init__(system, legs, free, p)
        fold = event_map(system, "s", "exit", 0, 1 if side == "+" else -1)
        self._fold = (surface_map(system, 0), fold)
        self._fields = [variational_field(system, mode).linear for mode in "+-"]

    def pack(
        self, starts: Sequence[Array], durations: Sequence[float], saddle: PseudoEquilibrium
    ) -> Array:
        """Unknowns: starts, durations, pseudo-saddle, alpha, parameters."""
        end = [saddle.alpha, *self.p[list(self.free)]]
        return np.concatenate([np.ravel(starts), durations, saddle.point, end])

    def _further(self, size: float) -> Array:
        return np.append(np.full(self.system.dimension, size), 1.0)

    def equations(self, u: Array) -> tuple[Array, Array]:
        n, k, free, p = (
            self.system.dimension,
            len(self.free),
            list(self.free),
            self.parameters_at(u),
        )
        place = self.chained
        at, alpha, last = u[place : place + n], float(u[place + n]), len(self.legs) - 1
        values = np.zeros(u.size - k + 1)
        jacobian = np.zeros((values.size, u.size))
        for row, condition in enumerate(self._fold):
            e = condition(self.split(u)[0][0], p)
            values[row], jacobian[row, :n] = e.value, e.gradient
            jacobian[row, -k:] = e.by_parameters[free]
        row, flown = self.chain(u, values, jacobian, 2)
        rows = slice(row, row + n)
        values[rows] = flown.end - at
        jacobian[rows, last * n : (last + 1) * n] = flown.by_start
        jacobian[rows, len(self.legs) * n + last] = flown.rate
        jacobian[rows, place : place + n] = -np.eye(n)
        jacobian[rows, -k:] = flown.by_parameters
        row += n
        e = surface_map(self.system, 0)(at, p)
        values[row], jacobian[row, place : place + n] = e.value, e.gradient
        jacobian[row, -k:] = e.by_parameters[free]
        (f1, x1, p1), (f2, x2, p2) = (f.copied(at, p) for f in self._fields)
        rows = slice(row + 1, row + 1 + n)
        values[rows] = ((1 - alpha) * f1 + alpha * f2)[:, 0]
        jacobian[rows, place : place + n] = (1 - alpha) * x1 + alpha * x2
        jacobian[rows, place + n] = (f2 - f1)[:, 0]
        jacobian[rows, -k:] = ((1 - alpha) * p1 + alpha * p2)[:, free]
        return values, jacobian

    def tests(self, u: Array) -> dict[str, float]:
        found, alpha = super().tests(u), float(u[self.chained + self.system.dimension])
        slope = self.saddle(u).eigenvalues
        return found | {
            "boundary equilibrium of F1": alpha,
            "boundary equilibrium of F2": 1.0 - alpha,
            "pseudo-saddle-node": float(np.real(slope[0])),
        }

    def saddle(self, u: Array) -> PseudoEquilibrium:
        at = u[self.chained : self.chained + self.system.dimension]
        given = named(self.system, self.parameters_at(u))
        return find_pseudo_equilibrium(self.system, at, parameters=given)
