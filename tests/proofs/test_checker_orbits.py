"""The checker accepts saved orbits from boxes; it refuses altered ones unless these are true."""

import json
import random
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.proofs.checking import run
from tests.proofs.systems import BALL, BELT, FOLD, SPIN, STICK, TABLE, TWO, drop, v, x


def checked(paths):
    """Which of the files are accepted, and the line of each."""
    _, output = run(*paths)
    lines = output.splitlines()
    assert len(lines) == len(paths), output
    return [": checked:" in line for line in lines], lines


PENDULUM = ns.FilippovSystem(
    [x, v], surface=v - 0.1, above=[v, -ca.sin(x) - 0.3], below=[v, -ca.sin(x) + 0.3]
)
DROP = drop(ns.Stop(v - 0.75, -1, "slow"))
WALL = ns.FilippovSystem(  # the jump puts v = 0, so that it is not on the wall any more
    [x, v], field=[1, 0 * x], resets=[ns.Reset(x - 1 + v**2, [x, 0 * v], 1, "wall")]
)
ORBITS = {
    "stick": (STICK, [(-0.01, 0.01), (-0.005, 0.005)], 2, {}, "- s"),
    "friction": (STICK, [0, 0], 5, {"mu": (0.99, 1.01)}, "- s -"),
    "pendulum": (PENDULUM, [(1, 1.001), (0, 0.001)], 6, {}, "- + s"),
    "spin": (SPIN, [("0.9", "1.1"), 0], 10, {}, "o"),
    "fold": (FOLD, [(0.99, 1.01), (-0.01, 0.01), (0, 0.01)], 3, {}, "+ -"),
    "ball": (BALL, [(0.99, 1.01), 0], 3, {}, "o"),
    "table": (TABLE, [("0.499", "0.501"), 0], "0.9", {}, "o"),
    "drop": (DROP, [(0.99, 1.01), (-0.01, 0.01)], 2, {}, "-"),
    "wall": (WALL, [(-1, -0.9), 1], "1.5", {}, "o"),
    "two surfaces": (TWO, [("0.24", "0.25"), (-1.01, -1)], 3, {}, "+- s- s+"),
    "belt": (BELT, [(0, "0.01"), "0.25", (1, 1.01), 0], "1.75", {}, "so"),
}


def proof_of(name):
    system, start, t_end, parameters, itinerary = ORBITS[name]
    proof = ns.certify_orbit(system, start, t_end, parameters=parameters)
    assert proof.proven and proof.itinerary == itinerary, proof
    return proof


QUICK = ["spin", "fold", "ball", "drop", "wall", "two surfaces"]
SLOW = [name for name in ORBITS if name not in QUICK]


@pytest.mark.parametrize("names", [QUICK, pytest.param(SLOW, marks=pytest.mark.slow)])
def test_orbits_from_boxes_and_for_ranges_are_checked(names, tmp_path):
    """Crossing, sliding, exits, stops, impacts, resets, a surface reached while another slides."""
    paths = []
    for name in names:
        paths.append(tmp_path / f"{name}.json")
        proof_of(name).save(paths[-1])
    accepted, lines = checked(paths)
    assert all(accepted), lines


# What is altered ---------------------------------------------------------------------------------

OPERATIONS = {
    "add": lambda p, q: p + q,
    "sub": lambda p, q: p - q,
    "mul": lambda p, q: p * q,
    "div": lambda p, q: p / q,
    "neg": lambda p: -p,
    "twice": lambda p: 2 * p,
    "sq": lambda p: p * p,
    "inv": lambda p: 1 / p,
    "sin": ca.sin,
    "cos": ca.cos,
}


def system_of(record):
    """The system that a record describes, for the simulation."""
    graph, n = record["graph"], len(record["start"])
    states, count = ca.SX.sym("x", n), len(graph["surfaces"])
    lam, given = ca.SX.sym("l", count), ca.SX.sym("p", len(record["parameters"]))
    nodes = []
    for op, *rest in graph["nodes"]:
        if op == "const":
            nodes.append(ca.SX(float(Fraction(rest[0]))))
        elif op == "input":
            nodes.append([states, given, None, lam, ca.SX(8, 1)][rest[0]][rest[1]])
        else:
            nodes.append(OPERATIONS[op](*(nodes[k] for k in rest)))
    at = lambda rows: [nodes[k] for k in rows]
    count = len(record["stops"])
    stops = [
        ns.Stop(nodes[k], s[1], s[0])
        for k, s in zip(graph["guards"][:count], record["stops"], strict=True)
    ]
    resets = [
        ns.Reset(nodes[k], at(rows), r[1], r[0])
        for k, rows, r in zip(graph["guards"][count:], graph["maps"], record["resets"], strict=True)
    ]
    return ns.FilippovSystem(
        ca.vertsplit(states),
        field=at(graph["field"]),
        surfaces=at(graph["surfaces"]),
        multipliers=ca.vertsplit(lam) if lam.numel() else [],
        parameters=dict.fromkeys(ca.vertsplit(given), 0.0) if given.numel() else {},
        stops=stops,
        resets=resets,
    )


def holds(record):
    """Whether simulated orbits from corners, middle and inside of the box are as claimed."""
    system, rng = system_of(record), np.random.default_rng(0)
    n, slack = len(record["start"]), 1e-7
    box = [[float(Fraction(s)) for s in pair] for pair in (*record["start"], *record["parameters"])]
    low, high = np.array(box).T
    shares = [np.zeros(len(low)), np.ones(len(low)), *rng.uniform(size=(4, len(low)))]
    inside = lambda value, claim: (
        float(Fraction(claim[0])) - slack <= value <= float(Fraction(claim[1])) + slack
    )
    for share in shares:
        at = low + share * (high - low)
        values = dict(zip(system.parameter_names, at[n:], strict=True))
        run = ns.simulate(
            system, at[:n], float(Fraction(record["duration"])), parameters=values, rtol=1e-11
        )
        reached = [e for e in run.events if e.kind != "end"]
        if len(reached) != len(record["events"]):
            return False
        for e, claim in zip(reached, record["events"], strict=True):
            words = (e.kind, e.mode_before, e.mode_after)
            if words != (claim["kind"], claim["before"], claim["after"]) or not (
                inside(e.t, claim["t"]) and all(map(inside, e.x_after, claim["x"]))
            ):
                return False
        if not all(map(inside, run.x[-1], record["end"])):
            return False
    return True


def altered(record, rng):
    """A record with one thing changed at random, and what."""
    record = json.loads(json.dumps(record))
    events, graph = record["events"], record["graph"]
    claims = [e["t"] for e in events] + [c for e in events for c in e["x"]] + record["end"]
    pairs = claims + record["start"] + record["parameters"]
    constants = [k for k in graph["nodes"] if k[0] == "const"]
    sums = [k for k in graph["nodes"] if k[0] in ("add", "sub", "mul")]
    what = rng.choice(
        ["pair", "pair", "event", "constant", "constant", "operation", "word", "rows"]
    )
    if what == "pair":
        pair = rng.choice(pairs)
        low, high = map(Fraction, pair)
        by = (high - low or Fraction(1, 100)) * Fraction(rng.choice(["1/1000", "1/10", "2"]))
        low, high = (end + by * rng.choice([-1, 0, 1]) for end in (low, high))
        pair[:] = [str(min(low, high)), str(max(low, high))]
    elif what == "constant" and constants:
        node = rng.choice(constants)
        node[1] = str(Fraction(node[1]) * Fraction(rng.choice(["101/100", "-1", "3", "0"])))
    elif what == "operation" and sums:
        rng.choice(sums)[0] = rng.choice(["add", "sub", "mul"])
    elif what == "rows":
        rows = rng.choice([graph[k] for k in ("field", "surfaces", "guards", "maps") if graph[k]])
        rows[rng.randrange(len(rows))] = rng.choice(rows)
    elif what == "event" and events:
        key = rng.choice(["kind", "name", "before", "after", "drop", "double"])
        k = rng.randrange(len(events))
        if key == "drop":
            del events[k]
        elif key == "double":
            events.insert(k, events[k])
        else:
            events[k][key] = rng.choice(["+", "-", "s", "o", "crossing", "entry", "stop", "reset"])
    else:
        key = rng.choice(["first", "status", "duration"])
        record[key] = {"first": rng.choice("+-so"), "status": rng.choice(["end", "turn", "x"])}.get(
            key, str(Fraction(record["duration"]) * Fraction(rng.choice(["99/100", "3/2"])))
        )
    return record


def tampered(names, count, folder):
    """Check altered records; those that were accepted although simulated orbits are others."""
    rng, records = random.Random(5), []
    for name in names:
        path = folder / f"{name}.json"
        proof_of(name).save(path)
        true = json.loads(path.read_text())["orbit"]
        records += [r for r in (altered(true, rng) for _ in range(count)) if r != true]
    paths = [folder / f"altered{k}.json" for k in range(len(records))]
    for path, record in zip(paths, records, strict=True):
        path.write_text(json.dumps({"orbit": record}))
    accepted, lines = checked(paths)
    kept = [r for r, yes in zip(records, accepted, strict=True) if yes]
    assert len(kept) < len(records) / 2  # most changes are false
    for record, line in zip(records, lines, strict=True):
        assert ": checked:" not in line or holds(record), (line, record)


@pytest.mark.slow
def test_what_is_altered_is_refused_or_true(tmp_path):
    tampered(["drop", "fold", "two surfaces"], 8, tmp_path)


@pytest.mark.slow
def test_what_is_altered_in_orbits_that_slide_is_refused_or_true(tmp_path):
    names = ["stick", "friction", "pendulum", "spin", "fold", "drop", "two surfaces"]
    tampered(names, 20, tmp_path)
