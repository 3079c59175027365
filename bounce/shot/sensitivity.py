"""Derivatives of the lift-off by parameters and landing, exact through the events of one itinerary.

Along a phase S = dx/dq obeys the linear equation S' = (df/dx) S + df/dq, solved here by Gauss
collocation over the Taylor steps of the known trajectory (its order, 2 x 12, exceeds theirs). Where
the field jumps at H = 0, at a time that moves by dt/dq = -(H_x S)/(H_x f), the sensitivity jumps by
(f_before - f_after) dt/dq (the saltation matrix); at lift-off it moves on by f dt/dq. Where the
field is continuous (from rolling into slip, and where the load begins) nothing jumps.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..contact.equations import contact_system, equations, free_system
from ..contact.model import ContactModel
from .single import Shot

Array = NDArray[np.float64]

_STAGES = 12
#: Landing components by which one can differentiate.
LANDING = ("xdot", "ydot", "omega", "x")


class Sensitivity(NamedTuple):
    """Derivatives of a lift-off.

    Attributes
    ----------
    names : tuple of str
        The k parameters or landing components.
    state : ndarray (n, k)
        Of (x, xdot, y, ydot, omega, extra states) at lift-off.
    time : ndarray (k,)
        Of the duration.
    """

    names: tuple[str, ...]
    state: Array
    time: Array


def sensitivity(shot: Shot, names: Sequence[str]) -> Sensitivity:
    """Differentiate a bounce by parameters of its model or by components of its landing.

    The derivative is that of the shot's own itinerary: across a change of itinerary the lift-off is
    continuous, but its derivative is one-sided. At a grazing transition (H or the load falls through
    zero with no speed) it is infinite.

    Parameters
    ----------
    shot : Shot
    names : sequence of str
        Parameters of ``shot.model``, or "xdot", "ydot", "omega", "x" at touch-down.

    Returns
    -------
    Sensitivity

    Raises
    ------
    nonsmooth.ParameterError
        Unknown name.

    Examples
    --------
    Without friction's help the normal speed depends on d2 alone, r = exp(-2 c cot c), c = arccos d2:

    >>> import bounce
    >>> shot = bounce.simulate(bounce.NormalKelvinVoigt(mu=0.3, d2=0.1), 1.0, -1.0, 0.5, tol=1e-12)
    >>> s = bounce.sensitivity(shot, ["d2", "ydot", "mu"])
    >>> h = 1e-6
    >>> r = bounce.laws.kelvin_voigt_restitution
    >>> bool(abs(s.state[3, 0] - (r(0.1 + h) - r(0.1 - h)) / (2 * h)) < 1e-9)
    True
    >>> f"{s.state[3, 1]:.10f}", f"{-r(0.1):.10f}", bool(abs(s.state[3, 2]) < 1e-12)
    ('-0.7440793977', '-0.7440793977', True)
    """
    model = shot.model
    known = [*model.values, *LANDING]
    for name in names:
        if name not in known:
            raise ns.ParameterError(
                f"sensitivity: expected names among {known}, received {name!r}."
            )
    return _Chain(shot, tuple(names)).run()


class _Chain:
    """One shot's sensitivities, phase after phase."""

    def __init__(self, shot: Shot, names: tuple[str, ...]):
        self.shot, self.names = shot, names
        self.blueprint = shot.model.blueprint()
        eq = equations(self.blueprint)
        values = shot.model.values
        self.p = np.array(list(values.values()))
        order = list(values)
        self.columns = [order.index(n) if n in values else -1 for n in names]
        self.S = np.zeros((len(eq.names), len(names)))
        for k, name in enumerate(names):
            if name not in values:
                self.S[eq.names.index(name), k] = 1.0

    def run(self) -> Sensitivity:
        if self.shot.approach is not None:
            self._phase("F", self.shot.approach, 0, len(self.shot.approach.t) - 1)
        run = self.shot.trajectory
        for k, segment in enumerate(run.segments):
            self._phase(segment.mode, run, segment.first, segment.last)
            if segment.mode != "s" and k + 1 < len(run.segments):
                x = run.x[segment.last]
                before, _, _ = self._field(segment.mode, x[:, None])
                after, _, _ = self._field(run.segments[k + 1].mode, x[:, None])
                self.S = self.S + np.outer(before[0] - after[0], self._moves("slip", x, before[0]))
        mode, x = run.segments[-1].mode, run.x[-1].copy()
        field, _, _ = self._field(mode, x[:, None])
        if not np.all(np.isfinite(field)):  # a power law's end, y = 0 but for rounding
            x[2] = min(x[2], 0.0)
            field, _, _ = self._field(mode, x[:, None])
        time = self._moves("lift-off", x, field[0])
        return Sensitivity(self.names, self.S + np.outer(field[0], time), time)

    def _phase(self, mode: str, run: ns.Trajectory, first: int, last: int) -> None:
        nodes, weights, inner = _gauss(_STAGES)
        for start, end in zip(run.t[first:last], run.t[first + 1 : last + 1], strict=True):
            h = end - start
            if h <= 0.0:
                continue
            _, A, B = self._field(mode, run(start + h * nodes).T)
            self.S = self.S + h * _collocate(A, B, self.S, h * inner, weights)

    def _field(self, mode: str, states: Array) -> tuple[Array, Array, Array]:
        """Field (m, n), its derivatives (m, n, n) by states and (m, n, k) by names, at m states."""
        m = states.shape[1]
        parameters = np.repeat(self.p[:, None], m, axis=1)
        f, fx, fp = (np.array(v) for v in _derivatives(self.blueprint, mode)(states, parameters))
        n = f.shape[0]
        # a mapped CasADi function lays matrices side by side
        fx = fx.reshape(n, m, n).transpose(1, 0, 2)
        fp = fp.reshape(n, m, -1).transpose(1, 0, 2)
        return f.T, fx, self._selected(fp)

    def _selected(self, by_parameters: Array) -> Array:
        result = np.zeros((*by_parameters.shape[:-1], len(self.columns)))
        for k, column in enumerate(self.columns):
            if column >= 0:
                result[..., k] = by_parameters[..., column]
        return result

    def _moves(self, event: str, x: Array, field: Array) -> Array:
        """How the time of an event moves: dt/dq = -(h_x S + h_p)/(h_x f)."""
        hx, hp = (np.array(v) for v in _event(self.blueprint, event)(x, self.p))
        with np.errstate(divide="ignore", invalid="ignore"):
            moved: Array = -(hx @ self.S + self._selected(hp))[0] / (hx @ field)[0]
        return moved


def _collocate(A: Array, B: Array, S: Array, inner: Array, weights: Array) -> Array:
    """Increment over h of S' = A S + B by Gauss collocation: sum_i b_i K_i, K = A (S + h a K) + B."""
    m, n = A.shape[:2]
    system = np.eye(m * n) - (A[:, :, None, :] * inner[:, None, :, None]).reshape(m * n, m * n)
    rates = np.linalg.solve(system, (A @ S + B).reshape(m * n, -1)).reshape(m, n, -1)
    increment: Array = np.einsum("i,ijk->jk", weights, rates)
    return increment


@lru_cache(maxsize=1)
def _gauss(stages: int) -> tuple[Array, Array, Array]:
    """Nodes and weights of Gauss on [0, 1] and the integrals a_ij of the Lagrange basis to node i."""
    legendre = np.polynomial.legendre
    x, w = legendre.leggauss(stages)
    values = legendre.legvander(x, stages - 1)
    integrals = np.column_stack(
        [legendre.legval(x, legendre.legint(row, lbnd=-1)) for row in np.eye(stages)]
    )
    return (x + 1) / 2, w / 2, np.linalg.solve(values.T, integrals.T).T / 2


@lru_cache(maxsize=64)
def _derivatives(blueprint: ContactModel, mode: str) -> ca.Function:
    """(states, parameters) -> field of a mode and its Jacobians."""
    eq = equations(blueprint)
    x, p = ca.vertcat(*eq.x.values()), ca.vertcat(*eq.p.values())
    free = mode == "F"
    field = free_system(blueprint).field("") if free else contact_system(blueprint).mode_field(mode)
    outputs = [field, ca.jacobian(field, x), ca.jacobian(field, p)]
    return eq.function([ca.densify(o) for o in outputs])


@lru_cache(maxsize=64)
def _event(blueprint: ContactModel, event: str) -> ca.Function:
    """(states, parameters) -> gradients of an event function by states and parameters."""
    eq = equations(blueprint)
    x, p = ca.vertcat(*eq.x.values()), ca.vertcat(*eq.p.values())
    h = eq.contact_speed if event == "slip" else eq.lift_off
    return eq.function([ca.densify(ca.jacobian(h, x)), ca.densify(ca.jacobian(h, p))])
