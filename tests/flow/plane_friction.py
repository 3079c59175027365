"""Systems with friction in the plane, as in ``tests/data/vector_friction.json``."""

import json
import math
from functools import lru_cache
from pathlib import Path

import casadi as ca

import nonsmooth as ns
from benchmarks.landings import ball

_FILE = Path(__file__).parents[1] / "data" / "vector_friction.json"

#: Cases by name; numbers are strings of 24 digits.
CASES = {case["name"]: case for case in json.loads(_FILE.read_text())["cases"]}


def columns(*names):
    """Symbols of these names."""
    return [ca.SX.sym(name) for name in names]


@lru_cache
def unloaded():
    """The ball before a net load is positive: no friction, until it is."""
    x = columns("x1", "x2", "v1", "v2", "w1", "w2", "y", "ydot")
    p = columns("mu", "d1", "d2", "eta", "G", "k")
    _, d1, d2, eta, weight, _ = p
    normal = -2 * d2 * x[7] - x[6]
    spring = [-2 * d1 * eta * x[2 + i] - eta**2 * x[i] for i in range(2)]
    rates = [x[2], x[3], *spring, 0, 0, x[7], normal - weight]
    return ns.FilippovSystem(
        x, field=rates, parameters=p, stops=[ns.Stop(normal - weight, 1, name="load")]
    )


def bounce(case, tol, **options):
    """One bounce from a case's landing: the run, and the time at which the load began."""
    p = {name: float(value) for name, value in case["parameters"].items()}
    landing, load, begun = case["landing"], case["load"], 0.0
    v, w, ydot = (
        [float(c) for c in landing["v"]],
        [float(c) for c in landing["w"]],
        landing["ydot"],
    )
    start = [0.0, 0.0, *v, *w, 0.0, float(ydot)]
    if load == "net" and -2 * p["d2"] * start[7] < p["G"]:
        before = ns.simulate(unloaded(), start, 10.0, parameters=p, tol=1e-15)
        start, begun = before.x[-1], before.t[-1]
    return ns.simulate(ball(load), start, 20.0, parameters=p, tol=tol, **options), begun


def sliding_body(case):
    """The system of a case that is no ball."""
    p, kind = case["parameters"], case["kind"]
    mu, spin = float(p["mu"]), float(p.get("spin", 0))
    slope, radius = float(p.get("slope", 0)), float(p.get("radius", 0))
    axes = json.loads(p.get("axes", "[1, 1]"))
    lam = ca.vertcat(*columns("l1", "l2", "l3"))
    if kind == "pivoting_disc":
        v = columns("v1", "v2", "omega")
        field = [-mu * lam[0], -mu * lam[1], -2 * mu * radius * lam[2]]
        surface = ca.vertcat(v[0], v[1], radius * v[2])
        return ns.FilippovSystem(v, field=field, surfaces=[surface], multipliers=[lam])
    x, v, w = (columns(name + "1", name + "2") for name in "xvw")
    lam, load = lam[:2], math.cos(slope)
    force = [-mu * load * axes[i] * lam[i] for i in range(2)]
    floor = [-spin * x[1], spin * x[0]]
    if kind == "turntable":
        surface = ca.vertcat(*[v[i] + w[i] - floor[i] for i in range(2)])
        field = [*v, force[0], force[1] - math.sin(slope), *[2.5 * f for f in force]]
        return ns.FilippovSystem([*x, *v, *w], field=field, surfaces=[surface], multipliers=[lam])
    surface = ca.vertcat(*[axes[i] * (v[i] - floor[i]) for i in range(2)])
    field = [*v, force[0] + math.sin(slope), force[1]]
    return ns.FilippovSystem([*x, *v], field=field, surfaces=[surface], multipliers=[lam])


def run_of(case, tol, **options):
    """A case's run, and by how much its times are late."""
    if case["kind"] == "ball":
        return bounce(case, tol, **options)
    start, t_end = [float(v) for v in case["start"]], float(case["t_end"])
    return ns.simulate(sliding_body(case), start, t_end, tol=tol, **options), 0.0


def errors(case, run, begun):
    """Largest errors of the last state and of the times of events."""
    end = case["end"] if "end" in case else list(case["lift_off"].values())[:-1]
    of_state = max(abs(a - float(b)) for a, b in zip(run.x[-1], end, strict=True))
    times = [event.t + begun for event in run.events]
    given = [float(t) for _, t in case["events"]]
    if len(given) < len(times):
        given.append(float(case["t_end"]))
    of_times = max(abs(a - b) for a, b in zip(times, given, strict=True))
    return of_state, of_times
