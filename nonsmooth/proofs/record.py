"""Proofs as plain data for a checker: graph, box, matrix and claims, with exact numbers."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from typing import Any

from ..model import FilippovSystem
from .arithmetic.algebra import Difference
from .arithmetic.flint import arb
from .arithmetic.instructions import Program
from .arithmetic.intervals import Numbers, ends, exact, fraction
from .arithmetic.krawczyk import Zero
from .surface_functions import SurfaceFunctions, SystemGraph

FORMAT = "nonsmooth proof 1"


def text(value: Fraction) -> str:
    """A fraction as a string."""
    return str(value)


def interval(a: arb) -> list[str]:
    """Both ends of an enclosure."""
    return [text(v) for v in ends(a)]


def graph_of(problem: Any, coincident: bool) -> dict[str, Any]:
    """The surface and the fields as instructions, with constants as exact fractions."""
    # An instruction is [operation, arguments ...]; ``const`` has its value, ``input`` its vector (0
    # states, 1 parameters, 2 further unknowns) and position, ``power`` its argument and exponent.
    functions = problem.functions
    rows = [[functions.h], *functions.fields]
    elsewhere = [node for _, node in functions.elsewhere]
    rows += [elsewhere]
    difference = problem.difference if coincident else None
    if difference is not None:
        rows += [[difference.factor], difference.direction]
    program = Program(functions.graph, rows)
    nodes = _instructions(program, problem.numbers)
    (surface,), above, below, positive, *more = program.rows
    data = {"nodes": nodes, "surface": surface, "above": above, "below": below}
    data |= {"positive": positive}  # other sides and open gaps
    if more:  # F1 - F2 = factor direction
        data |= {"factor": more[0][0], "direction": more[1]}
    return data


def _instructions(program: Program, numbers: Numbers) -> list[list[Any]]:
    nodes: list[list[Any]] = []
    for node in program.nodes:
        if node.op == "const":
            nodes.append(["const", text(exact(node.payload, numbers))])
        elif node.op == "input":
            nodes.append(["input", *node.source])
        elif node.op == "power":
            nodes.append(["power", node.args[0], node.payload])
        else:
            nodes.append([node.op, *node.args])
    return nodes


def motion_of(system: FilippovSystem, numbers: Numbers, modes: Iterable[str]) -> dict[str, Any]:
    """A system as instructions: surfaces, field, guards, maps, gaps and restitutions."""
    # Inputs of vector 3 are multipliers, of vector 4 reactions. For sliding modes, where
    # F1 - F2 = g G has a common factor g, its node and those of G are named.
    system_graph = SystemGraph(system)
    rows = motion_rows(system_graph)
    sliding = {w: _factored(system_graph, w, numbers) for w in modes if "s" in w}
    rows += [[d.factor, *d.direction] for d in sliding.values()]
    program = Program(system_graph.graph, rows)
    names = ("surfaces", "field", "guards", "gaps", "restitutions")
    count = 5 + len(system.resets)
    found, maps = program.rows[:5], program.rows[5:count]
    data: dict[str, Any] = dict(zip(names, found, strict=True)) | {"maps": maps}
    data["sliding"] = {
        w: {"factor": row[0], "direction": row[1:]}
        for w, row in zip(sliding, program.rows[count:], strict=True)
    }
    return {
        "format": "nonsmooth orbit 1",
        "graph": data | {"nodes": _instructions(program, numbers)},
        "stops": [list(s) for s in system.stops],
        "resets": [list(r) for r in system.resets],
        "impacts": list(system.impacts),
    }


def motion_rows(system_graph: SystemGraph) -> list[list[int]]:
    """Nodes of surfaces, field, guards, gaps, restitutions, and then of the map of each reset."""
    graph, d = system_graph.graph, system_graph.system.definition
    lam = [graph.symbol(3, i) for i in range(d.multipliers.numel())]
    reactions = [graph.symbol(4, i) for i in range(d.reactions.numel())]
    field = system_graph.field(lam, reactions)
    one = lambda e: system_graph.insert([e])[0] if e.numel() else []
    maps = [one(d.maps[:, k]) for k in range(len(system_graph.system.resets))]
    return [one(d.surfaces), field, one(d.guards), one(d.gaps), one(d.restitutions), *maps]


def _factored(system_graph: SystemGraph, mode: str, numbers: Numbers) -> Difference:
    """The factor that both fields' difference has where a surface slides."""
    own = SurfaceFunctions(system_graph.system, mode.index("s"), mode, system_graph)
    return Difference(own.graph, own.fields, own.gradient(own.h), numbers)


def problem_record(instance: Any, coincident: bool = False) -> dict[str, Any]:
    """The problem: graph, unknowns, held states, planes and parameters."""
    problem = instance.problem
    return {
        "format": FORMAT,
        "kind": problem.kind,
        "side": getattr(problem, "side", None),
        "numbers": instance.numbers,
        "graph": graph_of(problem, coincident),
        "states": len(instance.values),
        "names": list(instance.names),
        "unknowns": [list(index) for index in instance.unknowns],
        "held": [[text(v) for v in pair] for pair in instance.values],
        "normals": [[text(v) for v in row] for row in instance.normals],
        "through": [text(v) for v in instance.through],
        "parameters": [[text(v) for v in pair] for pair in instance.parameters],
    }


def zero_record(zero: Zero, classification: Any, bits: int) -> dict[str, Any]:
    """Boxes and matrix of a proven zero, and what is claimed of it."""
    return {
        "bits": bits,
        "box": [interval(b) for b in zero.box],
        "matrix": [[text(fraction(v)) for v in row] for row in zero.matrix.tolist()],
        "point": [interval(p) for p in zero.point],
        "claims": dict(classification.claims),
    }


def record_of(instance: Any, zero: Zero, classification: Any, bits: int) -> dict[str, Any]:
    """Everything that a checker needs about one zero."""
    return {
        **problem_record(instance, bool(classification.claims.get("coincident"))),
        **zero_record(zero, classification, bits),
        "values": {
            k: interval(v)
            for k, v in classification.values.items()
            if v.is_finite() and k[0] == "L"
        },
    }
