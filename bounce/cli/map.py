"""The command ``bounce map``: outcomes of landings over two inputs, written to a file."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

import nonsmooth as ns

from ..contact.model import ContactModel
from ..golf import landing_map
from ..laws import BounceLaw
from ..maps.dividing import DividingCurve, dividing_curve
from ..maps.outcomes import OutcomeMap, outcome_map
from .choices import Chosen, chosen_model, ground_arguments, require_scale
from .report import opening, print_json, with_meaning
from .starts import NAMES
from .values import SYSTEMS, assignment, in_si, span

HELP = "outcomes of landings over two inputs, to a file"
ABOUT = "Map the itinerary, or a quantity at lift-off, of one bounce over two inputs."
_QUANTITIES = dict(
    region="itinerary", slip="slip", omega="omega", angle="lift_off_angle", reversal="spin_reversal"
)
#: Defaults that show every kind of bounce: with units, and for a contact model without.
_LANDINGS = ("angle=5deg:75deg:150", "spin=-10000rpm:10000rpm:150")
_USUAL = ("speed=28m/s", "angle=40deg", "spin=2500rpm")
_DIMENSIONLESS = ("xdot=-2:2:150", "omega=-4:4:150")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    ground_arguments(parser)
    parser.add_argument(
        "--over",
        action="append",
        metavar="NAME=LOW:HIGH:COUNT",
        type=span,
        help="twice, the first is horizontal: speed, angle, spin (with units, as in "
        "speed=20:70mph:50); for a contact model also its parameters, and without --stiffness xdot, "
        f"ydot, omega, x, y as it has them (default: {' '.join(_LANDINGS)}, or "
        f"{' '.join(_DIMENSIONLESS)})",
    )
    parser.add_argument(
        "--fix",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        type=assignment,
        help=f"of the others; again for each (default: {' '.join(_USUAL)}, or ydot=-1)",
    )
    parser.add_argument("--show", choices=list(_QUANTITIES), default="region", help="at lift-off")
    parser.add_argument(
        "--output", required=True, help=".png, .pdf, .svg (picture) or .npz (arrays)"
    )


def run(args: argparse.Namespace) -> int:
    """Compute the map and write it."""
    chosen = chosen_model(args)
    kind = args.output.rpartition(".")[2].lower()
    if kind not in ("png", "pdf", "svg", "npz"):
        raise ns.OptionError(
            f"--output: expected a name ending in .png, .pdf, .svg or .npz, received {args.output!r}."
        )
    result = _map(args, chosen)
    if kind == "npz":
        _save(args.output, result)
    else:
        import matplotlib

        from ..plot import outcome_map as draw

        matplotlib.use("Agg")  # a file, no window

        curve = _curve(result) if args.show == "region" else None
        speeds = SYSTEMS[args.units]["speed"]
        picture = draw(result, _QUANTITIES[args.show], curve=curve, speeds=speeds)
        picture.savefig(args.output, dpi=150)
    shares = {name: round(share, 6) for name, share in result.share().items()}
    if not result.lift_offs.complete.all():
        shares["no lift-off"] = round(1.0 - float(result.lift_offs.complete.mean()), 6)
    if args.json:
        model = repr(chosen.model)
        print_json({**opening(args), "model": model, "output": args.output, "share": shares})
    else:
        print("\n".join(f"{share:8.2%}  {_in_words(name)}" for name, share in shares.items()))
        if isinstance(chosen.model, BounceLaw):
            print("+ and - are the sign of the slip at touch-down")
        print(f"wrote {args.output}")
    return 0


def _in_words(name: str) -> str:
    """A region with its meaning, unless that is long."""
    return name if name == "no lift-off" or len(name.split()) > 4 else with_meaning(name)


def _map(args: argparse.Namespace, chosen: Chosen) -> OutcomeMap:
    """A map in SI units where these are known or requested, else in those of the model."""
    model = chosen.model
    spans, fixed = args.over, dict(args.fix)
    given = {*(s.name for s in spans or ()), *fixed}
    physical = isinstance(model, BounceLaw) or bool(given & set(NAMES))
    physical = physical or (chosen.scaling is not None and spans is None)
    if spans is None:
        spans = args.over = [span(text) for text in (_LANDINGS if physical else _DIMENSIONLESS)]
    over = {s.name: s.values(args.units) for s in spans}
    values = {name: in_si(name, typed, args.units) for name, typed in fixed.items()}
    if isinstance(model, ContactModel) and not physical:
        if "ydot" not in {*over, *values}:
            args.fix = [*args.fix, assignment("ydot=-1")]  # the map's own default, to be reported
        return outcome_map(model, over, values, work=ns.Work())
    for text in _USUAL:
        name, typed = assignment(text)
        if name not in {*over, *values}:
            values[name] = in_si(name, typed, args.units)
            args.fix = [*args.fix, (name, typed)]
    require_scale(args, chosen)
    options: dict[str, Any] = {} if isinstance(model, BounceLaw) else dict(work=ns.Work())
    return landing_map(model, over, values, chosen.ball, scaling=chosen.scaling, **options)


def _curve(result: OutcomeMap) -> DividingCurve | None:
    """The dividing curve of a contact model over xdot and omega, where there is one."""
    if not isinstance(result.model, ContactModel) or {*result.names} != {"xdot", "omega"}:
        return None
    xdot = result.axes[result.names.index("xdot")]
    changed = {n: v for n, v in result.fixed.items() if n in result.model.values}
    try:
        reach = float(np.abs(xdot).max()) / abs(result.fixed["ydot"])
        model = result.model.replace(**changed)
        return dividing_curve(model, result.fixed["ydot"], reach=max(reach, 0.5))
    except (ns.NonsmoothError, ZeroDivisionError):
        return None  # the map draws its own border


def _save(path: str, result: OutcomeMap) -> None:
    off = result.lift_offs
    axes: dict[str, Any] = dict(zip(result.names, result.axes, strict=True))
    np.savez_compressed(
        path,
        regions=np.array(result.regions),
        code=result.code,
        status=off.status,
        time=off.time,
        **{f"axis_{name}": values for name, values in axes.items()},
        **{f"lift_off_{n}": getattr(off, n) for n in ("xdot", "ydot", "omega", "x", "y")},
    )
