"""The command line: ``bounce shot``, ``bounce map``, ``bounce fit`` and ``bounce models``.

Exit codes: 0 done, 1 it could not be computed or read, 2 it was asked for wrongly.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

import numpy as np

import nonsmooth as ns

from .algebraic import TURFS, CrossBounce, PennerBounce, TiltedBounce, rebound
from .contact import ContactModel
from .fitting import fit
from .flight import AIRS
from .friction import Coulomb, Dahl, ExponentialDecay, FrictionLaw, LuGre, Stribeck, Viscous
from .models import (
    DepthDampedKelvinVoigt,
    Hertz,
    HuntCrossley,
    KelvinVoigt,
    KuwabaraKono,
    Maxwell,
    Tsuji,
)
from .outcomes import OutcomeMap, outcome_map
from .rigid import NormalKelvinVoigt, RigidBounce
from .rollout import GREEN_ROLLING_FRICTION, Run, play
from .units import BALLS, Ball, Landing, Scaling

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
LAWS: dict[str, type[RigidBounce]] = {
    c.__name__: c for c in (RigidBounce, TiltedBounce, PennerBounce, CrossBounce)
}
FRICTION: dict[str, type[FrictionLaw]] = {
    c.__name__: c for c in (Coulomb, Stribeck, ExponentialDecay, Viscous, LuGre, Dahl)
}
#: Arguments of laws besides their parameters.
_EXTRA = {
    RigidBounce: ["restitution"],
    TiltedBounce: ["restitution", "tilt"],
    CrossBounce: ["restitution"],
}
_USAGE = (ns.ParameterError, ns.OptionError, ns.DefinitionError, ns.PointError)


class _Parser(argparse.ArgumentParser):
    """Errors in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; those of the process by default.

    Returns
    -------
    int
        0 done, 1 not computable or readable, 2 wrong usage.

    Examples
    --------
    >>> main("shot --speed 28.5 --angle 37.3 --spin 2094 --turf natural".split())
    lift-off  10.71 m/s, 37.3 deg, -4536 rpm, slip -1.61 m/s (III+)
    run       23.19 m in 4.94 s: 13 bounces, the first 2.14 m high, over 23.00 m; rolls 0.18 m
    0
    """
    parser = _arguments()
    try:
        args = parser.parse_args(argv)
        return int(args.run(args))
    except SystemExit as stop:
        return int(stop.code or 0)
    except (ns.NonsmoothError, OSError) as error:
        line = " ".join(str(error).split())
        print(f"bounce: error: {line}", file=sys.stderr)
        return 2 if isinstance(error, _USAGE) else 1
    except KeyboardInterrupt:
        print("bounce: interrupted", file=sys.stderr)
        return 130


# Arguments ---------------------------------------------------------------------------------------


def _arguments() -> argparse.ArgumentParser:
    parser = _Parser(prog="bounce", description="The bounce of a spinning ball on the ground.")
    commands = parser.add_subparsers(metavar="command", required=True, parser_class=_Parser)
    shot = commands.add_parser("shot", help="one landing: the bounce, and the run until rest")
    for name in ("speed", "angle", "spin"):
        shot.add_argument(f"--{name}", type=_number, required=True, help=_UNITS_HELP[name])
    _model_arguments(shot)
    shot.add_argument("--air", choices=["none", *AIRS], default="none", help="during the hops")
    shot.add_argument(
        "--slope", type=_number, default=0.0, help="of the ground, in the unit of angles"
    )
    shot.add_argument("--rolling-friction", type=_number, default=GREEN_ROLLING_FRICTION)
    shot.add_argument("--first-only", action="store_true", help="the first bounce only")
    shot.set_defaults(run=_shot)
    plan = commands.add_parser("map", help="what becomes of landings over two inputs, to a file")
    _model_arguments(plan)
    plan.add_argument(
        "--over",
        action="append",
        required=True,
        metavar="NAME=LOW:HIGH:COUNT",
        type=_range,
        help="twice; the first is horizontal",
    )
    plan.add_argument("--fix", action="append", default=[], metavar="NAME=VALUE", type=_assignment)
    plan.add_argument("--show", choices=["region", "slip", "omega", "angle"], default="region")
    plan.add_argument("--output", required=True, help=".png, .pdf, .svg (picture) or .npz (arrays)")
    plan.set_defaults(run=_map)
    fitting = commands.add_parser("fit", help="parameters from a CSV file of measured bounces")
    fitting.add_argument("data", help="columns such as 'speed [m/s]', 'lift_off_spin [rpm]'")
    _model_arguments(fitting)
    fitting.add_argument("--parameters", required=True, help="names to fit, with commas")
    fitting.add_argument("--starts", type=int, default=16)
    fitting.add_argument("--leave-out", action="store_true", help="leave out (and name) bad rows")
    fitting.add_argument("--residuals", metavar="FILE", help="picture of the residuals")
    fitting.set_defaults(run=_fit)
    models = commands.add_parser(
        "models", help="models, laws, friction, air and balls, with sources"
    )
    models.add_argument("--json", action="store_true")
    models.set_defaults(run=_models)
    return parser


_UNITS_HELP = dict(
    speed="m/s",
    angle="of descent from the ground; degrees (golf) or rad (si)",
    spin="backspin positive; rpm (golf) or rad/s (si)",
)


def _model_arguments(parser: argparse.ArgumentParser) -> None:
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--turf", choices=list(TURFS), help="a published law (default natural)")
    which.add_argument("--model", choices=[*CONTACT_MODELS, *LAWS])
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        type=_assignment,
        help="a parameter of the model; again for each (angles in rad)",
    )
    parser.add_argument("--friction", choices=list(FRICTION), default="Coulomb")
    parser.add_argument(
        "--stiffness", type=_number, help="of the ground, N/m: the scale of a contact model"
    )
    parser.add_argument("--ball", choices=list(BALLS), default="golf")
    parser.add_argument("--units", choices=["golf", "si"], default="golf")
    parser.add_argument("--json", action="store_true")


def _number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


_number.__name__ = "number"  # what argparse calls it in its messages


def _assignment(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    try:
        return (name.strip(), _number(value)) if equals else _fail(text, "NAME=VALUE")
    except ValueError:
        _fail(text, "NAME=VALUE")


def _range(text: str) -> tuple[str, Any]:
    name, _, values = text.partition("=")
    try:
        low, high, count = values.split(":")
        return name.strip(), np.linspace(_number(low), _number(high), int(count))
    except ValueError:
        _fail(text, "NAME=LOW:HIGH:COUNT")


def _fail(text: str, form: str) -> NoReturn:
    raise argparse.ArgumentTypeError(f"expected {form}, received {text!r}")


def _model(args: argparse.Namespace) -> tuple[RigidBounce | ContactModel, Ball, Scaling | None]:
    ball, values = BALLS[args.ball], dict(args.set)
    if args.model is None:
        law = TURFS[args.turf or "natural"].law
        return law.replace(**{"inertia": ball.inertia, **values}), ball, None
    values = {"inertia": ball.inertia, **values}
    if args.model in LAWS:
        kind = LAWS[args.model]
        missing = [n for n in _EXTRA.get(kind, []) if n not in values]
        if missing:
            raise ns.ParameterError(
                f"--set: expected {', '.join(f'{n}=...' for n in missing)} for {args.model}, received "
                "none."
            )
        return kind(**values), ball, None
    scaling = None
    if args.stiffness is not None:
        scaling = Scaling.from_stiffness(ball, args.stiffness)
        values.setdefault("G", scaling.gravity)
    friction = FRICTION[args.friction]
    own = {n: values.pop(n) for n in list(values) if n in friction.declared()}
    return CONTACT_MODELS[args.model](friction=friction(**own), **values), ball, scaling


# Commands ----------------------------------------------------------------------------------------


def _shot(args: argparse.Namespace) -> int:
    model, ball, scaling = _model(args)
    if isinstance(model, ContactModel) and scaling is None:
        raise ns.OptionError(
            f"--stiffness: expected N/m for the contact model {args.model}, received none."
        )
    golf = args.units == "golf"
    angle, slope = (math.radians(a) if golf else a for a in (args.angle, args.slope))
    spin = args.spin if golf else args.spin * 30 / math.pi
    landing = Landing.polar(args.speed, angle, spin)
    if isinstance(model, ContactModel):
        model = model.replace(slope=slope)
    hit = rebound(model, landing, ball, scaling=scaling)
    report: dict[str, Any] = dict(
        model=repr(model),
        units=args.units,
        landing=_polar(landing, golf),
        lift_off=_polar(hit.lift_off, golf),
        slip=hit.lift_off.xdot + ball.radius * hit.lift_off.omega,
        itinerary=hit.itinerary,
        contact_time=hit.time,
    )
    if not args.first_only:
        air = None if args.air == "none" else AIRS[args.air]
        friction = args.rolling_friction
        report["run"] = _run(
            play(
                model,
                landing,
                ball,
                scaling=scaling,
                air=air,
                slope=slope,
                rolling_friction=friction,
            )
        )
    print(json.dumps(report, indent=2) if args.json else _shot_text(report, golf))
    return 0


def _polar(state: Landing, golf: bool) -> dict[str, float]:
    """Speed, angle from the positive x axis towards up or down, and spin, in the units asked for."""
    angle = math.atan2(abs(state.ydot), state.xdot)
    return dict(
        speed=state.speed,
        angle=math.degrees(angle) if golf else angle,
        spin=state.backspin_rpm if golf else state.omega,
    )


def _run(run: Run) -> dict[str, float]:
    return dict(
        bounces=len(run.bounces),
        first_height=run.first_height,
        bounced=run.bounced,
        rolled=run.rolled,
        run_out=run.run_out,
        time=run.time,
    )


def _shot_text(report: dict[str, Any], golf: bool) -> str:
    angle, spin = ("deg", "rpm") if golf else ("rad", "rad/s")
    off, slip = report["lift_off"], report["slip"]
    digits = 1 if golf else 4
    lines = [
        f"lift-off  {off['speed']:.2f} m/s, {off['angle']:.{digits}f} {angle}, {off['spin']:.0f} {spin}, "
        f"slip {slip:.3g} m/s ({report['itinerary']})"
    ]
    if report["contact_time"]:
        lines.append(f"contact   {1e3 * report['contact_time']:.3g} ms")
    if "run" in report:
        run = report["run"]
        lines.append(
            f"run       {run['run_out']:.2f} m in {run['time']:.2f} s: {run['bounces']} bounces, the "
            f"first {run['first_height']:.2f} m high, over {run['bounced']:.2f} m; rolls "
            f"{run['rolled']:.2f} m"
        )
    return "\n".join(lines)


def _map(args: argparse.Namespace) -> int:
    model, _, _ = _model(args)
    if not isinstance(model, ContactModel):
        raise ns.OptionError(
            "--model: expected a contact model, received a law: see bounce models."
        )
    kind = args.output.rpartition(".")[2].lower()
    if kind not in ("png", "pdf", "svg", "npz"):
        raise ns.OptionError(
            f"--output: expected a name ending in .png, .pdf, .svg or .npz, received {args.output!r}."
        )
    result = outcome_map(model, dict(args.over), dict(args.fix), progress=sys.stderr.isatty())
    if kind == "npz":
        off = result.lift_offs
        first, second = result.names
        axes: dict[str, Any] = {first: result.axes[0], second: result.axes[1]}
        np.savez_compressed(
            args.output,
            regions=np.array(result.regions),
            code=result.code,
            status=off.status,
            time=off.time,
            **{f"axis_{name}": values for name, values in axes.items()},
            **{f"lift_off_{n}": getattr(off, n) for n in ("xdot", "ydot", "omega", "x", "y")},
        )
    else:
        _map_figure(result, args.show).savefig(args.output, dpi=150)
    shares = {name: round(share, 6) for name, share in result.share().items()}
    if args.json:
        print(json.dumps(dict(model=repr(model), output=args.output, share=shares), indent=2))
    else:
        print("\n".join(f"{share:8.2%}  {name}" for name, share in shares.items()))
        print(f"wrote {args.output}")
    return 0


def _map_figure(result: OutcomeMap, show: str) -> Any:
    from matplotlib import colormaps
    from matplotlib.colors import BoundaryNorm
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.8, 5.2), layout="constrained")
    ax = figure.add_subplot()
    x, y = result.axes
    if show == "region":
        count = len(result.regions)
        colors = colormaps["cividis"].resampled(max(count, 1))
        values = np.where(result.code < 0, np.nan, result.code)
        mesh = ax.pcolormesh(
            x,
            y,
            values,
            cmap=colors,
            norm=BoundaryNorm(np.arange(-0.5, count), count),
            shading="nearest",
            rasterized=True,
        )
        bar = figure.colorbar(mesh, ax=ax, ticks=range(count))
        bar.ax.set_yticklabels(result.regions)
    else:
        values = {
            "slip": result.slip,
            "omega": result.lift_offs.omega,
            "angle": result.lift_off_angle,
        }[show]
        finite = np.abs(values[np.isfinite(values)])
        limit = float(finite.max()) if finite.size else 1.0
        mesh = ax.pcolormesh(
            x, y, values, cmap="RdBu_r", vmin=-limit, vmax=limit, shading="nearest", rasterized=True
        )
        figure.colorbar(mesh, ax=ax, label=f"{show} at lift-off")
    ax.set_xlabel(result.names[0])
    ax.set_ylabel(result.names[1])
    return figure


def _fit(args: argparse.Namespace) -> int:
    model, ball, scaling = _model(args)
    found = fit(
        model,
        args.data,
        parameters=[name.strip() for name in args.parameters.split(",") if name.strip()],
        ball=ball,
        scaling=scaling,
        starts=args.starts,
        bad_rows="leave out" if args.leave_out else "raise",
        progress=True,
    )
    print(json.dumps(found.to_dict(), indent=2) if args.json else repr(found))
    if args.residuals:
        found.plot_residuals().savefig(args.residuals, dpi=150)
    return 0


def _models(args: argparse.Namespace) -> int:
    report: dict[str, Any] = dict(
        turfs={n: dict(law=repr(f.law), source=f.source, checked=f.checked) for n, f in TURFS.items()},
        contact_models={n: _parameters(c) for n, c in CONTACT_MODELS.items()},
        laws={n: {**dict.fromkeys(_EXTRA.get(c, [])), **_parameters(c)} for n, c in LAWS.items()},
        friction={n: _parameters(c) for n, c in FRICTION.items()},
        air={n: a.source for n, a in AIRS.items()},
        balls={n: dict(mass=b.mass, radius=b.radius, inertia=b.inertia, source=b.source) for n, b in BALLS.items()},
    )  # fmt: skip
    if args.json:
        print(json.dumps(report, indent=2))
        return 0
    for title, entries in report.items():
        print(f"{title.replace('_', ' ')}:")
        for name, entry in entries.items():
            if title in ("contact_models", "laws", "friction"):
                entry = ", ".join(n if v is None else f"{n}={v:g}" for n, v in entry.items())
            elif title == "turfs":
                entry = f"{entry['law']}; {entry['source']}"
            elif title == "balls":
                entry = f"{entry['mass']} kg, {entry['radius']} m; {entry['source']}"
            print(f"  {name:24}{entry}")
    return 0


def _parameters(
    kind: type[ContactModel] | type[RigidBounce] | type[FrictionLaw],
) -> dict[str, float | None]:
    return kind.declared()


if __name__ == "__main__":
    sys.exit(main())
