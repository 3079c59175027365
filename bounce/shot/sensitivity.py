"""Derivatives of the lift-off by parameters and landing, exact through the events of one itinerary.

The derivatives of the frictionless phase and of the contact (``nonsmooth.sensitivity``) are chained.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..contact.equations import equations
from ..errors import require
from .shot import Shot

Array = NDArray[np.float64]

#: Components of the landing by which one can differentiate, and the states that change with each: in
#: 3-D slip is a state in the place of spin.
_LANDING = {
    "xdot": ("xdot", "slip_x"),
    "zdot": ("zdot", "slip_z"),
    "ydot": ("ydot",),
    "omega": ("omega", "slip_x"),
    "side_omega": ("slip_z",),
    "spin": ("spin",),
    "x": ("x",),
    "z": ("z",),
}


class Sensitivity(NamedTuple):
    """Derivatives of a lift-off.

    Attributes
    ----------
    names : tuple of str
        The k parameters or landing components.
    state : ndarray (n, k)
        Of ``x, xdot, y, ydot, omega`` and the extra states at lift-off; in 3-D of the states of
        :meth:`Contact3D.system`.
    time : ndarray (k,)
        Of the duration.
    """

    names: tuple[str, ...]
    state: Array
    time: Array


def sensitivity(shot: Shot[Any, Any], names: Sequence[str]) -> Sensitivity:
    """Differentiate a bounce by parameters of its model or by components of its landing.

    The derivative is that of the shot's own itinerary: across a change of itinerary the lift-off is
    continuous, but its derivative is one-sided. At a grazing transition (H or the load falls through
    zero with no speed) it is infinite.

    Parameters
    ----------
    shot : Shot
        The bounce, from :func:`bounce.simulate`.
    names : sequence of str
        Parameters of ``shot.model``, or "xdot", "ydot", "omega", "x" at touch-down; in 3-D also "zdot"
        and "z" (to the right), "side_omega" (the second component of ``omega``), and with drilling
        "spin" (the third).

    Returns
    -------
    Sensitivity
        Derivatives of the lift-off by the landing and the parameters.

    Raises
    ------
    nonsmooth.OptionError
        What is no shot.
    nonsmooth.ParameterError
        A name that is neither a parameter nor a component of the landing.

    Examples
    --------
    The normal speed depends on the damping d2 alone: $r = exp(-2 c cot c)$ with $c = arccos d2$.

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
    require(shot, Shot, "shot", "bounce.simulate returns one.")
    known = [*shot.model.values, *_landing(shot)]
    for name in names:
        if name not in known:
            raise ns.ParameterError(
                f"names has {name!r}, which is no parameter or component of the landing. Choose among "
                f"{known}."
            )
    return _lift_off(shot, tuple(names))


def _landing(shot: Shot[Any, Any]) -> dict[str, tuple[str, ...]]:
    """The landing components of a shot, and the states that change with each."""
    eq = equations(shot.model.blueprint())
    own = set(eq.names) - set(eq.start)
    changed = {name: tuple(s for s in states if s in own) for name, states in _LANDING.items()}
    return {name: states for name, states in changed.items() if states}


def _lift_off(shot: Shot[Any, Any], names: tuple[str, ...]) -> Sensitivity:
    """Chain the derivatives of the approach and of the contact."""
    values = shot.model.values
    varied = [name for name in names if name in values]
    column = {name: k for k, name in enumerate(names)}
    states = shot.trajectory.system.state_names
    state, time = np.zeros((len(states), len(names))), np.zeros(len(names))
    for name in names:
        for changed in () if name in values else _landing(shot)[name]:
            state[states.index(changed), column[name]] = 1.0
    for run in (shot.approach, shot.trajectory):
        if run is None or not len(run.steps):
            continue
        s = ns.sensitivity(run, wrt=["x0", *varied])
        by_parameters = np.zeros((len(states) + 1, len(names)))
        for k, name in enumerate(s.names):
            by_parameters[:, column[name]] = [*s.dx_dp[:, k], s.dt_end_dp[k]]
        time = time + s.dt_end_dx0 @ state + by_parameters[-1]
        state = s.dx_dx0 @ state + by_parameters[:-1]
    return Sensitivity(names, state, time)
