"""Proofs as plain data for a checker: graph, box, matrix and claims, all numbers exact."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from .arithmetic import ends, exact, fraction
from .flint import arb
from .tape import Program

FORMAT = "nonsmooth proof 1"


def text(value: Fraction) -> str:
    """A fraction as a string."""
    return str(value)


def interval(a: arb) -> list[str]:
    """Both ends of an enclosure."""
    return [text(v) for v in ends(a)]


def graph_of(question: Any, coincident: bool) -> dict[str, Any]:
    """The surface and the fields as instructions, with constants as exact fractions.

    An instruction is [operation, arguments ...]; ``const`` has its value, ``input`` its vector (0
    states, 1 parameters, 2 further unknowns) and position, ``power`` its argument and exponent.
    """
    described = question.described
    rows = [[described.h], *described.fields]
    difference = question.difference if coincident else None
    if difference is not None:
        rows += [[difference.factor], difference.direction]
    program = Program(described.tape, rows)
    nodes: list[list[Any]] = []
    for node in program.nodes:
        if node.op == "const":
            nodes.append(["const", text(exact(node.payload, question.numbers))])
        elif node.op == "input":
            nodes.append(["input", *node.place])
        elif node.op == "power":
            nodes.append(["power", node.args[0], node.payload])
        else:
            nodes.append([node.op, *node.args])
    (surface,), above, below, *more = program.rows
    graph = {"nodes": nodes, "surface": surface, "above": above, "below": below}
    if more:  # F1 - F2 = factor direction
        graph |= {"factor": more[0][0], "direction": more[1]}
    return graph


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
