"""The exact period of a system that depends on time: that of the sines and cosines through which it does."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from ..arithmetic.algebra import Algebra
from ..proof import UnprovenError
from ..record import motion_rows
from .modes import Modes


def forcing_period(modes: Modes) -> int:
    """Node of 2 pi/(g r), where all rates of phases are whole multiples of g r."""
    graph, clock, time = modes.graph, modes.clock, modes.system_graph.x[modes.clock]
    roots = [k for row in motion_rows(modes.system_graph) for k in row]
    algebra = Algebra(graph, roots, modes.numbers)
    atoms = [(k, graph.nodes[k]) for k in algebra.atoms]
    # Parameters, and what is made of them alone, may be in a rate.
    still = [
        all(vector == 1 or (vector == 0 and i > clock) for vector, i in graph.inputs([k]))
        for k, _ in atoms
    ]
    where = algebra.atoms.index(time) if time in algebra.atoms else len(atoms)
    pairs = [(algebra[k], "") for k in roots]
    pairs += [(algebra[a], node.op) for _, node in atoms for a in node.args]
    rates = list[Any]()
    for p, op in pairs:
        timed = [powers for powers in p.to_dict() if where < len(atoms) and powers[where]]
        others = {j for powers in timed for j, n in enumerate(powers) if n and j != where}
        linear = all(powers[where] == 1 for powers in timed) and all(still[j] for j in others)
        if timed and not (linear and op in ("sin", "cos")):
            raise UnprovenError(
                "the time enters other than in sines and cosines of phases that grow evenly, so the period of the "
                "forcing is not proven"
            )
        rates += [p.derivative(where)] if timed else []
    if not rates:
        raise UnprovenError("the system depends on time in no sine or cosine, so it has no period")
    ratios = [_ratio(rate, rates[0]) for rate in rates]
    denominator = math.lcm(*(q.denominator for q in ratios))
    divisor = Fraction(math.gcd(*(int(q * denominator) for q in ratios)), denominator)
    turn = graph.apply("mul", [graph.constant(2 / divisor), graph.node("pi")])
    return graph.apply("div", [turn, algebra.node(rates[0])])


def _ratio(rate: Any, other: Any) -> Fraction:
    """The rational number by which one rate is a multiple of another."""
    leading = [max(p.to_dict().items())[1] for p in (rate, other)]
    if rate * leading[1] != other * leading[0]:
        raise UnprovenError("the frequencies of the forcing have no rational ratio")
    q = leading[0] / leading[1]
    return Fraction(int(q.p), int(q.q))
