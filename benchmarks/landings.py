"""Itineraries of random landings in 3-D, computed in several ways.

``python -m benchmarks.landings`` runs what is missing and prints the counts; it can be interrupted. Every
landing is integrated at the default tolerance and at 1e-14, with the spin as a state, and as a bounce, with the
slip as a state. Landings with different results are listed.
"""

from __future__ import annotations

import argparse
import json
import os
import re
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import bounce
import nonsmooth as ns

from .timing import ROOT

Array = NDArray[np.float64]

FOLDER = ROOT / "build" / "benchmarks" / "landings"
LOADS = ("contact", "net")
PARAMETERS = ("mu", "d1", "d2", "eta", "G", "k")
PIECE, TOTAL = 500, 100_000
DEFAULT, TIGHT = 1e-10, 1e-14
T_END = 100.0
WAYS = ("default", "tight", "bounce")


@lru_cache
def ball(load: str = "contact", slip_as_state: bool = False) -> ns.FilippovSystem:
    """A sphere on a spring with Coulomb friction, until the load falls to zero.

    States x1, x2, v1, v2, w1, w2, y, ydot with h = v + w; or h in the place of w.
    """
    x = [ca.SX.sym(n) for n in ("x1", "x2", "v1", "v2", "w1", "w2", "y", "ydot")]
    lam = ca.vertcat(ca.SX.sym("l1"), ca.SX.sym("l2"))
    mu, d1, d2, eta, weight, k = p = [ca.SX.sym(name) for name in PARAMETERS]
    normal = -2 * d2 * x[7] - x[6]
    carried = normal - weight if load == "net" else normal
    force = -mu * carried * lam
    spring = [-2 * d1 * eta * x[2 + i] - eta**2 * x[i] for i in range(2)]
    h = ca.vertcat(x[4], x[5]) if slip_as_state else ca.vertcat(x[2] + x[4], x[3] + x[5])
    turned = force * (1 + 1 / k) + ca.vertcat(*spring) if slip_as_state else force / k
    rates = [x[2], x[3], *[spring[i] + force[i] for i in range(2)], turned[0], turned[1]]
    return ns.FilippovSystem(
        x,
        field=[*rates, x[7], normal - weight],
        surfaces=[h],
        multipliers=[lam],
        parameters=p,
        stops=[ns.Stop(carried, direction=-1, name="lift-off")],
    )


def drawn(piece: int, count: int) -> dict[str, Array]:
    """Landings of a piece."""
    rng = np.random.default_rng([14, piece])
    p = dict(
        mu=rng.uniform(0.05, 1.5, count),
        d1=rng.uniform(0, 0.4, count),
        d2=rng.uniform(0.02, 0.4, count),
        eta=10 ** rng.uniform(-2, 0.9, count),
        G=10 ** rng.uniform(-5, -2, count),
        k=rng.choice([0.4, 2 / 3], count),
    )
    v, w = rng.normal(size=(2, count, 2)) * rng.choice([0.1, 1, 3], (2, count, 1))
    kind = np.arange(count) % 8
    little = 10 ** rng.uniform(-11, -3, (count, 1))
    w = np.where(kind[:, None] == 5, -v + little * rng.normal(size=(count, 2)), w)
    for vector in (v, w):
        vector[kind == 6, 1] = 0.0
    w = np.where(kind[:, None] == 7, v * rng.uniform(-3, 3, (count, 1)), w)
    return dict(**p, v=v, w=w)


def answers(piece: int, count: int, way: str) -> list[str]:
    """Itineraries of landings of a piece; a run without lift-off has its status instead."""
    found = np.empty(count, dtype=object)
    cases, work = drawn(piece, count), ns.Work(progress=False, threads=1)
    for i, load in enumerate(LOADS):
        rows = np.arange(count) // 4 % 2 == i
        if not rows.any():
            continue
        own = {name: values[rows] for name, values in cases.items()}
        v, w = own.pop("v"), own.pop("w")
        if way == "bounce":
            turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4, load=load)
            own["inertia"] = own.pop("k")
            shots = bounce.lift_off(
                turf.in_3d(), v, -1.0, w, parameters=own, t_max=T_END, work=work
            )
            found[rows] = shots.itinerary
            continue
        n = len(v)
        starts = np.column_stack([np.zeros((n, 2)), v, w, np.zeros(n), -np.ones(n)])
        many = ns.ensemble(
            ball(load),
            starts,
            T_END,
            parameters=own,
            tol=DEFAULT if way == "default" else TIGHT,
            work=work,
        )
        ended = many.status == ns.Status.STOPPED
        statuses = [str(ns.Status(s)) for s in many.status]
        found[rows] = np.where(ended, many.itinerary, statuses)
    return [str(one) for one in found]


def _compute(piece: int, way: str, count: int, folder: Path) -> None:
    path = folder / f"{way}-{piece:04d}.json"
    if not path.exists():
        partial = path.with_suffix(f".{os.getpid()}")
        partial.write_text(json.dumps(answers(piece, count, way)))
        partial.replace(path)


def summary(folder: Path = FOLDER, count: int = PIECE) -> dict[str, Any]:
    """Number of landings of each way, and those on which two ways differ."""
    known = {way: {int(f.stem[-4:]): f for f in folder.glob(f"{way}-*.json")} for way in WAYS}
    differ: list[dict[str, Any]] = []
    counts: dict[str, int] = {}
    for piece in sorted(known["default"]):
        found = {
            way: json.loads(files[piece].read_text())
            for way, files in known.items()
            if piece in files
        }
        for i, row in enumerate(zip(*found.values(), strict=True)):
            counts[row[0]] = counts.get(row[0], 0) + 1
            if len(set(row)) > 1:
                differ.append(dict(piece=piece, row=i, **dict(zip(found, row, strict=True))))
                differ[-1]["phases"] = len({phases(itinerary) for itinerary in row}) > 1
    landings = {name: count * len(files) for name, files in known.items()}
    return dict(landings=landings, itineraries=counts, differ=differ)


def phases(itinerary: str) -> str:
    """An itinerary without passes through zero slip, which on a line are events or sharp turns."""
    return re.sub(r"(\* )+\*", "*", itinerary)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what is missing, or only print the results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.landings", description=__doc__)
    parser.add_argument("--count", type=int, default=TOTAL, help="landings (100000)")
    parser.add_argument("--piece", type=int, default=PIECE, help="landings in a piece (500)")
    parser.add_argument("--workers", type=int, default=1, help="processes (1)")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where pieces are kept")
    parser.add_argument("--report", action="store_true", help="print what is known, run nothing")
    options = parser.parse_args(arguments)
    options.folder.mkdir(parents=True, exist_ok=True)
    if not options.report:
        with ProcessPoolExecutor(options.workers) as pool:
            own, pieces = (options.piece, options.folder), range(options.count // options.piece)
            for future in [pool.submit(_compute, k, way, *own) for way in WAYS for k in pieces]:
                future.result()
    found = summary(options.folder, options.piece)
    print(f"landings: {found['landings']}")
    for itinerary, number in sorted(found["itineraries"].items(), key=lambda item: -item[1]):
        print(f"  {number:7d}  {itinerary}")
    differ = found["differ"]
    other = sum(row["phases"] for row in differ)
    print(f"two ways differ on {len(differ)}; in what slips and rolls when, on {other}")
    for row in differ:
        print(f"  {row}")


if __name__ == "__main__":
    main()
