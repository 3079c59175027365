"""Choices by name on the command line: models, laws, friction, balls, air and slopes."""

from __future__ import annotations

import argparse
import math
from typing import Any, NamedTuple

import nonsmooth as ns

from ..contact.friction import (
    Coulomb,
    Dahl,
    ExponentialDecay,
    FrictionLaw,
    LuGre,
    Stribeck,
    Viscous,
)
from ..contact.model import ContactModel
from ..contact.models import (
    DepthDampedKelvinVoigt,
    Hertz,
    HuntCrossley,
    KelvinVoigt,
    KuwabaraKono,
    Maxwell,
    NormalKelvinVoigt,
    Tsuji,
)
from ..golf import AIRS
from ..laws import TURFS, BounceLaw, CrossBounce, PennerBounce, RigidBounce, TiltedBounce
from ..units import BALLS, Ball, Scaling
from .values import SYSTEMS, angle_within, assignment, in_si, number, quantity

CONTACT_MODELS: dict[str, type[ContactModel]] = {
    c.__name__: c
    for c in (
        KelvinVoigt,
        NormalKelvinVoigt,
        DepthDampedKelvinVoigt,
        Hertz,
        HuntCrossley,
        Tsuji,
        KuwabaraKono,
        Maxwell,
    )
}
LAWS: dict[str, type[BounceLaw]] = {
    c.__name__: c for c in (RigidBounce, TiltedBounce, PennerBounce, CrossBounce)
}
FRICTION: dict[str, type[FrictionLaw]] = {
    c.__name__: c for c in (Coulomb, Stribeck, ExponentialDecay, Viscous, LuGre, Dahl)
}
#: Arguments of laws besides their parameters.
EXTRA: dict[type[BounceLaw], list[str]] = {
    RigidBounce: ["restitution"],
    TiltedBounce: ["restitution", "tilt"],
    CrossBounce: ["restitution"],
}


class Chosen(NamedTuple):
    """The ground, the ball, and the units of a contact model where a stiffness was given."""

    model: BounceLaw | ContactModel
    ball: Ball
    scaling: Scaling | None


def ground_arguments(parser: argparse.ArgumentParser, turf: str | None = "natural") -> None:
    """Add the arguments of ground, ball and units."""
    parser.set_defaults(usual_turf=turf)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--turf", choices=list(TURFS), help=f"a published law{_default(turf)}")
    which.add_argument("--model", choices=[*CONTACT_MODELS, *LAWS], help="a law or contact model")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        type=assignment,
        help="a parameter of the model, such as mu=0.3 or tilt=15deg; again for each",
    )
    parser.add_argument(
        "--friction", choices=list(FRICTION), default="Coulomb", help="of a contact model"
    )
    parser.add_argument(
        "--stiffness", type=number, help="of the ground, N/m: the scale of a contact model"
    )
    parser.add_argument(
        "--ball", choices=list(BALLS), default="golf", help="its mass, radius and moment of inertia"
    )
    parser.add_argument(
        "--units",
        choices=list(SYSTEMS),
        default="golf",
        help="of the output, and of numbers without a unit: golf (m/s, deg, rpm, m), us (mph, deg, "
        "rpm, yd), si (m/s, rad, rad/s, m)",
    )
    parser.add_argument("--json", action="store_true", help="print JSON, with every input")


def _default(turf: str | None) -> str:
    return "" if turf is None else f" (default: {turf})"


def chosen_model(args: argparse.Namespace) -> Chosen:
    """Return the model and the ball that the arguments name."""
    ball = BALLS[args.ball]
    values: dict[str, Any] = {"inertia": ball.inertia}
    values |= {name: in_si(name, typed, args.units) for name, typed in args.set}
    _require_tilt(args)
    if args.model is None:
        law = TURFS[args.turf or "natural"].law
        return Chosen(law.replace(**values), ball, None)
    if args.model in LAWS:
        law_type = LAWS[args.model]
        missing = [n for n in EXTRA.get(law_type, []) if n not in values]
        if missing:
            raise ns.ParameterError(
                f"--set: expected {', '.join(f'{n}=...' for n in missing)} for {args.model}, received "
                "none."
            )
        return Chosen(law_type(**values), ball, None)
    scaling = None
    if args.stiffness is not None:
        scaling = Scaling.from_stiffness(ball, args.stiffness)
        values.setdefault("G", scaling.gravity)
    if getattr(args, "slope", None) is not None:
        values.setdefault("slope", _slope(args))
    friction = FRICTION[args.friction]
    own = {n: values.pop(n) for n in list(values) if n in friction.declared()}
    return Chosen(CONTACT_MODELS[args.model](friction=friction(**own), **values), ball, scaling)


def air_arguments(parser: argparse.ArgumentParser, usual: str, when: str) -> None:
    """Add the arguments of air, wind and weather."""
    parser.add_argument(
        "--air", choices=["none", *AIRS], default=usual, help=f"drag and lift {when}"
    )
    parser.add_argument(
        "--wind", type=quantity("speed"), help="from behind; negative from the front"
    )
    parser.add_argument("--cross-wind", type=quantity("speed"), help="to the right")
    parser.add_argument(
        "--altitude", type=quantity("height"), help="above the sea, for the density of air"
    )
    parser.add_argument("--temperature", type=number, help="of the air, degrees C (default: 20)")


def surroundings(args: argparse.Namespace) -> dict[str, Any]:
    """Air, wind and slopes of the ground, as the functions of ``bounce.golf`` take them."""
    air = None if args.air == "none" else AIRS[args.air]
    weather = {"altitude": args.altitude, "temperature": args.temperature}
    weather = {
        k: v.si(args.units) if k == "altitude" else v for k, v in weather.items() if v is not None
    }
    wind = tuple(0.0 if v is None else v.si(args.units) for v in (args.wind, args.cross_wind))
    if air is None and (weather or any(wind)):
        raise ns.OptionError(
            "--wind, --altitude, --temperature: expected together with --air, received none."
        )
    air = air.at(**weather) if air is not None and weather else air
    return dict(air=air, wind=wind, slope=_slope(args), side_slope=side_slope(args))


def side_slope(args: argparse.Namespace) -> float:
    """The side slope in radians, 0 unless it was given."""
    return 0.0 if args.side_slope is None else float(args.side_slope.si(args.units))


def _slope(args: argparse.Namespace) -> float:
    return angle_within("--slope", args.slope, args.units, -90, 90, closed=False)


def require_scale(args: argparse.Namespace, chosen: Chosen) -> None:
    """Refuse a contact model without a scale, where landings have units."""
    if isinstance(chosen.model, ContactModel) and chosen.scaling is None:
        raise ns.OptionError(
            f"--stiffness: expected N/m, because landings have units and {args.model} is dimensionless, "
            "received none."
        )


def _require_tilt(args: argparse.Namespace) -> None:
    """Refuse a tilt out of its range, in the unit in which it was typed."""
    for name, typed in args.set:
        if name == "tilt" and not 0.0 <= in_si(name, typed, args.units) < math.pi / 2:
            raise ns.ParameterError(
                "--set tilt: expected an angle from 0 to below 90 deg, received "
                f"{typed.text(args.units)}."
            )
