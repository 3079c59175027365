"""The verb ``lift_off``: many bounces at once, over arrays of landings and parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..contact.model import ContactModel
from ..contact.space import Contact3D
from ..errors import LandingError, ModelError
from ..parameters import numbers
from ..shot.space import state_3d
from .batch import INPUTS, Batch
from .results import LiftOffs, LiftOffs3D

Array = NDArray[np.float64]


@overload
def lift_off(
    model: ContactModel,
    xdot: ArrayLike,
    ydot: ArrayLike,
    omega: ArrayLike,
    x: ArrayLike = 0.0,
    y: ArrayLike = 0.0,
    *,
    parameters: Mapping[str, ArrayLike] | None = None,
    tol: float = 1e-10,
    t_max: float = 100.0,
    work: ns.Work | None = None,
    engine: str = "auto",
    device: str | None = None,
) -> LiftOffs: ...


@overload
def lift_off(
    model: Contact3D,
    xdot: ArrayLike,
    ydot: ArrayLike,
    omega: ArrayLike,
    x: ArrayLike = 0.0,
    y: ArrayLike = 0.0,
    *,
    parameters: Mapping[str, ArrayLike] | None = None,
    tol: float = 1e-10,
    t_max: float = 100.0,
    work: ns.Work | None = None,
    engine: str = "auto",
    device: str | None = None,
) -> LiftOffs3D: ...


def lift_off(
    model: ContactModel | Contact3D,
    xdot: ArrayLike,
    ydot: ArrayLike,
    omega: ArrayLike,
    x: ArrayLike = 0.0,
    y: ArrayLike = 0.0,
    *,
    parameters: Mapping[str, ArrayLike] | None = None,
    tol: float = 1e-10,
    t_max: float = 100.0,
    work: ns.Work | None = None,
    engine: str = "auto",
    device: str | None = None,
) -> LiftOffs | LiftOffs3D:
    """Bounce many balls: inputs and model parameters broadcast against each other.

    Parameters
    ----------
    model : ContactModel or Contact3D
        The contact model; ``model.in_3d()`` for landings with side spin.
    xdot, ydot, omega, x, y : array_like (...)
        Landings, as in :func:`simulate`. In 3-D ``xdot``, ``omega`` and ``x`` are arrays (..., 2),
        forward and to the right on the last axis; ``omega`` may be (..., 3) with drilling.
    parameters : mapping of str to array_like, optional
        Values that replace the model's, e.g. ``{"mu": [0.2, 0.3]}``.
    tol, t_max : float, optional
        As in :func:`simulate`.
    work : nonsmooth.Work, optional
        Threads, executor, chunk, bar and store of :func:`nonsmooth.ensemble`; by default no bar.
    engine : {"auto", "reference", "compiled"}
        Which driver: ``"auto"`` takes the compiled one where there is a compiler.
    device : {None, "cuda"}, optional
        ``"cuda"`` runs landings in the plane on an NVIDIA card, as :func:`nonsmooth.ensemble` does.

    Returns
    -------
    LiftOffs or LiftOffs3D
        What cannot be simulated is NaN and named in ``status``; nothing is dropped.

    Raises
    ------
    LandingError
        Inputs that are not numbers or do not broadcast.
    nonsmooth.ParameterError
        An unknown parameter. Values outside their limits get the status BAD_PARAMETER.
    ModelError
        No contact model.
    nonsmooth.OptionError
        A tolerance, a time, work or an engine out of its range; a ``device`` for landings in 3-D.

    Warns
    -----
    EnergyWarning
        As :func:`simulate`.

    Examples
    --------
    >>> import numpy as np, bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    >>> many = bounce.lift_off(turf, xdot=[0.3, 0.3, np.nan], ydot=-1.0, omega=[[0.1], [1.2]])
    >>> many.itinerary
    array([['+ s -', '+ s -', ''],
           ['+ s +', '+ s +', '']], dtype=object)
    >>> many
    LiftOffs(shape (2, 3); LIFTED_OFF 4, NOT_FINITE 2; itineraries '+ s +', '+ s -')

    >>> sides = bounce.lift_off(turf.in_3d(), [1.0, 0.0], -1.0, [[0.2, 0.1], [0.2, -0.1]], tol=1e-6)
    >>> sides.itinerary.tolist(), bool(abs(sides.travel_angle.sum()) < 1e-5)
    (['* s *', '* s *'], True)
    """
    if not isinstance(model, (ContactModel, Contact3D)):
        raise ModelError(f"model: expected a ContactModel, received {model!r}.")
    follow = dict(t_max=t_max, work=work, options=dict(tol=tol, engine=engine, device=device))
    if isinstance(model, Contact3D):
        batch = Batch(model, states_3d(model, xdot, ydot, omega, x, y), parameters)
        return _in_3d(batch, model.drilling, follow)
    batch = Batch(model, dict(zip(INPUTS, (xdot, ydot, omega, x, y), strict=True)), parameters)
    ended = _ended(batch, follow)
    ends: dict[str, Any] = {name: batch.column(name) for name in INPUTS}
    return LiftOffs(**ends, **ended)


def _ended(batch: Batch, follow: dict[str, Any]) -> dict[str, Any]:
    """Follow the landings to lift-off; return what does not depend on their dimension."""
    work = ns.Work(progress=False) if follow["work"] is None else follow["work"]
    batch.check()
    batch.touch_down(follow["t_max"], work, follow["options"])
    itineraries, code = batch.contact(follow["t_max"], work, follow["options"])
    return dict(
        time=batch.time.reshape(batch.shape),
        status=batch.status.reshape(batch.shape),
        itineraries=itineraries,
        itinerary_code=code,
    )


def _in_3d(batch: Batch, drilling: bool, follow: dict[str, Any]) -> LiftOffs3D:
    ended = _ended(batch, follow)
    # A law without a set, such as one with bristles, has no letter for its one phase.
    words = tuple({"o": "*", "F o": "F *"}.get(word, word) for word in ended["itineraries"])
    end = state_3d(batch.states.reshape(*batch.shape, len(batch.names)), drilling)
    values = {n: getattr(end, n) for n in ("xdot", "ydot", "omega", "x", "y", "slip")}
    return LiftOffs3D(**values, **{**ended, "itineraries": words})


def states_3d(
    model: Contact3D, xdot: ArrayLike, ydot: ArrayLike, omega: ArrayLike, x: ArrayLike, y: ArrayLike
) -> dict[str, ArrayLike]:
    """Return landings in 3-D by the names of the states, vectors on the last axis.

    Raises
    ------
    LandingError
    """
    v, w = (
        _components("xdot", xdot, (2,)),
        _components("omega", omega, (2, 3) if model.drilling else (2,)),
    )
    place = _components("x", np.zeros(2) if np.ndim(x) == 0 and np.all(x == 0.0) else x, (2,))
    try:
        slip_x, slip_z = v[0] + w[0], v[1] + w[1]
    except ValueError as error:
        raise LandingError(
            f"inputs: expected shapes that broadcast, received xdot {np.shape(xdot)} and omega "
            f"{np.shape(omega)}."
        ) from error
    named = dict(x=place[0], z=place[1], xdot=v[0], zdot=v[1], slip_x=slip_x, slip_z=slip_z)
    turning = dict(spin=w[2] if len(w) > 2 else 0.0) if model.drilling else {}
    return {**named, **turning, "y": y, "ydot": ydot}


def _components(name: str, value: ArrayLike, lengths: tuple[int, ...]) -> list[Array]:
    array = numbers(value, name, LandingError)
    if array.ndim == 0 or array.shape[-1] not in lengths:
        raise LandingError(
            f"{name}: expected an array (..., {' or '.join(map(str, lengths))}), forward and to the "
            f"right on the last axis, received shape {array.shape}."
        )
    return [array[..., k] for k in range(array.shape[-1])]
