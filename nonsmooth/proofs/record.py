"""Proofs as plain data for a checker: graph, box, matrix and claims, all numbers exact."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from typing import Any

from ..model import FilippovSystem
from .arithmetic.algebra import Difference
from .arithmetic.flint import arb
from .arithmetic.instructions import Program
from .arithmetic.intervals import Numbers, ends, exact, fraction
from .surface_functions import Written

FORMAT = "nonsmooth proof 1"


def text(value: Fraction) -> str:
    """A fraction as a string."""
    return str(value)


def interval(a: arb) -> list[str]:
    """Both ends of an enclosure."""
    return [text(v) for v in ends(a)]


def graph_of(question: Any, coincident: bool) -> dict[str, Any]:
    """The surface and the fields as instructions, with constants as exact fractions."""
    # An instruction is [operation, arguments ...]; ``const`` has its value, ``input`` its vector (0
    # states, 1 parameters, 2 further unknowns) and position, ``power`` its argument and exponent.
    described = question.described
    rows = [[described.h], *described.fields]
    elsewhere = [node for _, node in described.elsewhere]
    rows += [elsewhere]
    difference = question.difference if coincident else None
    if difference is not None:
        rows += [[difference.factor], difference.direction]
    program = Program(described.tape, rows)
    nodes = _instructions(program, question.numbers)
    (surface,), above, below, positive, *more = program.rows
    graph = {"nodes": nodes, "surface": surface, "above": above, "below": below}
    graph |= {"positive": positive}  # other sides and open gaps
    if more:  # F1 - F2 = factor direction
        graph |= {"factor": more[0][0], "direction": more[1]}
    return graph


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


def motion_of(system: FilippovSystem, numbers: Numbers, words: Iterable[str]) -> dict[str, Any]:
    """A system as instructions: surfaces, field, guards, maps, gaps and restitutions."""
    # Inputs of vector 3 are multipliers, of vector 4 reactions. Of the modes ``words`` that slide, where
    # F1 - F2 = g G has a common factor g, its node and those of G are named.
    written, d = Written(system), system.definition
    tape = written.tape
    lam = [tape.symbol(3, i) for i in range(d.multipliers.numel())]
    reactions = [tape.symbol(4, i) for i in range(d.reactions.numel())]
    field = written.field(lam, reactions)
    one = lambda e: written.insert([e])[0] if e.numel() else []
    maps = [one(d.maps[:, k]) for k in range(len(system.resets))]
    rows = [one(d.surfaces), field, one(d.guards), one(d.gaps), one(d.restitutions), *maps]
    sliding = {w: _factored(written, rows[0], w, numbers) for w in words if "s" in w}
    rows += [[d.factor, *d.direction] for d in sliding.values()]
    program = Program(tape, rows)
    names = ("surfaces", "field", "guards", "gaps", "restitutions")
    found, maps = program.rows[:5], program.rows[5 : 5 + len(maps)]
    graph: dict[str, Any] = dict(zip(names, found, strict=True)) | {"maps": maps}
    graph["sliding"] = {
        w: {"factor": row[0], "direction": row[1:]}
        for w, row in zip(sliding, program.rows[5 + len(maps) :], strict=True)
    }
    return {
        "format": "nonsmooth orbit 1",
        "graph": graph | {"nodes": _instructions(program, numbers)},
        "stops": [list(s) for s in system.stops],
        "resets": [list(r) for r in system.resets],
        "impacts": list(system.impacts),
    }


def _factored(written: Written, surfaces: list[int], word: str, numbers: Numbers) -> Difference:
    """The factor that both fields' difference has where a surface slides."""
    tape, i = written.tape, word.index("s")
    fields = []
    for s in (1.0, -1.0):
        signs = [1.0 if c == "+" else -1.0 for c in word[: len(surfaces)]]
        signs[i] = s
        fields.append(written.field([tape.constant(v) for v in signs]))
    return Difference(tape, fields, written.gradient(surfaces[i]), numbers)


def asked(subject: Any, coincident: bool = False) -> dict[str, Any]:
    """The question: graph, unknowns, what is held, planes and parameters."""
    question = subject.question
    return {
        "format": FORMAT,
        "kind": question.kind,
        "side": getattr(question, "side", None),
        "numbers": subject.numbers,
        "graph": graph_of(question, coincident),
        "states": len(subject.values),
        "names": list(subject.names),
        "unknowns": [list(place) for place in subject.unknowns],
        "held": [[text(v) for v in pair] for pair in subject.values],
        "normals": [[text(v) for v in row] for row in subject.normals],
        "through": [text(v) for v in subject.through],
        "parameters": [[text(v) for v in pair] for pair in subject.parameters],
    }


def record_of(subject: Any, equations: Any, zero: Any, verdict: Any, bits: int) -> dict[str, Any]:
    """Everything that a checker needs about one zero."""
    n = equations.n
    return {
        **asked(subject, bool(verdict.facts.get("coincident"))),
        "bits": bits,
        "box": [interval(b) for b in zero.box],
        "matrix": [[text(fraction(zero.matrix[i, j])) for j in range(n)] for i in range(n)],
        "point": [interval(p) for p in zero.point],
        "claims": dict(verdict.facts),
        "values": {
            k: interval(v) for k, v in verdict.values.items() if v.is_finite() and k[0] == "L"
        },
    }
