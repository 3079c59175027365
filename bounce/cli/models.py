"""The command ``bounce models``: models, laws, friction, air and balls with their sources."""

from __future__ import annotations

import argparse
import math
from typing import Any

import nonsmooth as ns

from ..golf import AIRS
from ..laws import TURFS, PublishedFit
from ..units import BALLS
from .choices import CONTACT_MODELS, EXTRA, FRICTION, LAWS
from .report import print_json

HELP = "models, laws, friction, air and balls, with sources"
ABOUT = (
    "List what can be chosen by name, where it is from, and for which landings a turf was measured."
)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(args: argparse.Namespace) -> int:
    """Print the list."""
    report: dict[str, Any] = dict(
        turfs={
            n: dict(law=repr(f.law), source=f.source, checked=f.checked, landings=_covers(f))
            for n, f in TURFS.items()
        },
        contact_models={n: c.declared() for n, c in CONTACT_MODELS.items()},
        laws={n: {**dict.fromkeys(EXTRA.get(c, [])), **c.declared()} for n, c in LAWS.items()},
        friction={n: c.declared() for n, c in FRICTION.items()},
        air={n: a.source for n, a in AIRS.items()},
        balls={n: dict(mass=b.mass, radius=b.radius, inertia=b.inertia, source=b.source) for n, b in BALLS.items()},
    )  # fmt: skip
    if args.json:
        print_json(dict(version=ns.__version__, **report))
        return 0
    for title, entries in report.items():
        print(f"{title.replace('_', ' ')}:")
        for name, entry in entries.items():
            if title in ("contact_models", "laws", "friction"):
                entry = ", ".join(n if v is None else f"{n}={v:g}" for n, v in entry.items())
            elif title == "turfs":
                entry = f"{entry['law']}, for {_said(entry['landings'])}; {entry['source']}"
            elif title == "balls":
                entry = f"{entry['mass']} kg, {entry['radius']} m; {entry['source']}"
            print(f"  {name:24}{entry}")
    return 0


def _covers(fit: PublishedFit) -> dict[str, Any] | None:
    covers = fit.law.covers
    if covers is None:
        return None
    spin = [value * 30 / math.pi for value in covers.spin]
    speeds = {"xdot [m/s]": list(covers.xdot), "ydot [m/s]": list(covers.ydot)}
    return {**speeds, "spin [rpm]": spin, "source": covers.source}


def _said(landings: dict[str, Any] | None) -> str:
    if landings is None:
        return "any landing"
    (a, b), (c, d) = landings["xdot [m/s]"], landings["ydot [m/s]"]
    low, high = landings["spin [rpm]"]
    return f"{a:g} to {b:g} m/s along and {c:g} to {d:g} m/s into the ground, {low:.0f} to {high:.0f} rpm"
