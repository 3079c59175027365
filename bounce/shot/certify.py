"""One bounce proven: how it lifts off, by interval arithmetic (``nonsmooth.certify_orbit``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import nonsmooth as ns

from ..contact.equations import STATES, equations
from ..contact.model import ContactModel
from ..errors import LandingError, ModelError
from ..parameters import LIMITS

#: The name of the stop where a load that was not positive begins to be.
_FIRST_LOAD = "first load"
_SLIP = {"+": "forward", "-": "reverse", "s": "rolling"}


@dataclass(frozen=True, eq=False, repr=False)
class BounceProof:
    """A theorem about one bounce, or about all bounces from a box of landings.

    Attributes
    ----------
    proven : bool
        Whether it is proven to lift off, and how.
    outcome : {"forward", "reverse", "rolling", "undecided"}
        Slip at lift-off.
    orbit : nonsmooth.proofs.OrbitProof
        Itinerary, events and lift-off in enclosures; its states are those of the model's system.
    why : str
        What stood in the way.
    """

    proven: bool
    outcome: str
    orbit: ns.proofs.OrbitProof
    why: str

    @property
    def itinerary(self) -> str:
        """Phases in order: ``+`` and ``-`` slip, ``s`` rolling."""
        return self.orbit.itinerary

    @property
    def time(self) -> ns.proofs.Enclosure:
        """Duration, where it is proven."""
        return self.orbit.t

    @property
    def statement(self) -> str:
        """The theorem in words."""
        if not self.proven:
            return f"Not proven: {self.why}.\n{self.orbit}"
        how = "rolling" if self.outcome == "rolling" else f"with {self.outcome} slip"
        speeds = ", ".join(f"{k} = {self.orbit.end[k]}" for k in ("xdot", "ydot", "omega"))
        return f"The ball lifts off {how} at t = {self.time}: {speeds}.\n{self.orbit}"

    def __str__(self) -> str:
        return self.statement

    def __repr__(self) -> str:
        return f"BounceProof({self.itinerary!r}, {self.outcome})"


def certify(
    model: ContactModel,
    xdot: Any,
    ydot: Any,
    omega: Any,
    *,
    x: Any = 0,
    y: Any = 0,
    parameters: Mapping[str, Any] | None = None,
    t_max: Any = 100,
    **options: Any,
) -> BounceProof:
    """Prove how a ball lifts off: with forward slip, in reverse, through which phases, and when.

    Parameters
    ----------
    model : ContactModel
        Its equations must be smooth at the landing; power laws are not, at $y = 0$.
    xdot, ydot, omega, x, y : number, string or (low, high)
        The landing, dimensionless as the model is; a pair makes the theorem hold for all between.
    parameters : mapping, optional
        Values that replace the model's, or pairs (low, high), within their limits.
    t_max : number or string, optional
        Longest contact looked at.
    **options
        ``numbers``, ``bits``, ``max_bits``, ``max_steps`` of :func:`nonsmooth.certify_orbit`.

    Returns
    -------
    BounceProof
        What was proven about the lift-off, and with what bounds.

    Raises
    ------
    nonsmooth.proofs.MissingError
        python-flint is not installed.
    nonsmooth.ParameterError
        An unknown parameter, or an interval that leaves its limits.
    LandingError
        A ball that does not move into the ground.
    ModelError
        No contact model of bounces in the plane.
    nonsmooth.OptionError
        A landing or a time that is not finite; an option out of its range.

    Examples
    --------
    >>> import bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    >>> proof = bounce.certify(turf, xdot="0.1", ydot=-1, omega=1)
    >>> proof.outcome, proof.itinerary, str(proof.time)
    ('forward', '+ s +', '2.95607532474954959... +- ...')
    """
    if not isinstance(model, ContactModel):
        raise ModelError(f"model: expected a ContactModel, received {model!r}.")
    ranges = {**model.values, **_within_limits(model, parameters or {})}
    landing = {"x": x, "xdot": xdot, "y": y, "ydot": ydot, "omega": omega}
    _require_landing(ydot)
    system, start = _system(model.blueprint(weightless=False))
    x0 = [landing.get(name, start.get(name)) for name in (*STATES, *start)]
    orbit = ns.certify_orbit(system, x0, t_max, parameters=ranges, **options)
    if orbit.proven and orbit.status in ("lift-off", "no load"):
        outcome = _SLIP[orbit.itinerary.split()[-1]]
        return BounceProof(True, outcome, orbit, "")
    why = orbit.why
    if orbit.status == _FIRST_LOAD:
        why = "the load is negative at first, and what happens before it is positive is not proven"
    elif orbit.proven:
        why = f"no lift-off until t = {t_max}"
    return BounceProof(False, "undecided", orbit, why)


@lru_cache(maxsize=32)
def _system(blueprint: ContactModel) -> tuple[ns.FilippovSystem, dict[str, float]]:
    """The contact with a further stop, where a load that is negative at first becomes positive."""
    eq = equations(blueprint)
    return eq.build(None, [ns.Stop(eq.lift_off, 1, _FIRST_LOAD)]), eq.start


def _within_limits(model: ContactModel, given: Mapping[str, Any]) -> dict[str, Any]:
    """Check both ends of every range; limits are intervals, so all between are within too."""
    limits = model.limits_of_values()
    for name, value in given.items():
        if name not in model.values:
            raise ns.ParameterError(
                f"parameters: expected names among {list(model.values)}, received {name!r}."
            )
        ends = value if isinstance(value, (tuple, list)) else (value,)
        for end in ends:
            limit = limits.get(name)
            try:
                fits = limit is None or LIMITS[limit](float(end))
            except (TypeError, ValueError):
                fits = False
            if not fits:
                raise ns.ParameterError(
                    f"{name}: expected values {limit}, received {value!r}. It is physically "
                    "impossible otherwise."
                )
    return dict(given)


def _require_landing(ydot: Any) -> None:
    ends = ydot if isinstance(ydot, (tuple, list)) else (ydot,)
    try:
        down = all(float(v) < 0 for v in ends)
    except (TypeError, ValueError):
        down = False
    if not down:
        raise LandingError(
            f"ydot: expected a speed below zero (into the ground), received {ydot!r}."
        )
