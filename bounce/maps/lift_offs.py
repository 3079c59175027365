"""The verb ``lift_off``: many bounces at once, over arrays of landings and parameters."""

from __future__ import annotations

from collections.abc import Mapping

from numpy.typing import ArrayLike

import nonsmooth as ns

from ..contact.model import ContactModel
from ..errors import ModelError
from .batch import INPUTS, Batch
from .results import LiftOffs


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
) -> LiftOffs:
    """Bounce many balls: inputs and model parameters broadcast against each other.

    Parameters
    ----------
    model : ContactModel
        The contact model.
    xdot, ydot, omega, x, y : array_like (...)
        Landings, as in :func:`simulate`.
    parameters : mapping of str to array_like, optional
        Values that replace the model's, e.g. ``{"mu": [0.2, 0.3]}``.
    tol, t_max : float, optional
        As in :func:`simulate`.
    work : nonsmooth.Work, optional
        Threads, executor, chunk, bar and checkpoint of :func:`nonsmooth.ensemble`; by default no bar.
    engine : {"auto", "reference", "compiled"}
        Which driver: ``"auto"`` takes the compiled one where there is a compiler.

    Returns
    -------
    LiftOffs
        What cannot be simulated is NaN and named in ``status``; nothing is dropped.

    Raises
    ------
    LandingError
        Inputs that are not numbers or do not broadcast.
    nonsmooth.ParameterError
        An unknown parameter.
    ModelError, nonsmooth.OptionError

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
    """
    if not isinstance(model, ContactModel):
        raise ModelError(f"model: expected a ContactModel, received {model!r}.")
    batch = Batch(model, dict(zip(INPUTS, (xdot, ydot, omega, x, y), strict=True)), parameters)
    work = ns.Work(progress=False) if work is None else work
    batch.check()
    batch.touch_down(t_max, work, dict(tol=tol, engine=engine))
    return batch.contact(t_max, work, dict(tol=tol, engine=engine))
