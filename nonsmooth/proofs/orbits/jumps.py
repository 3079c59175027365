"""Stops, resets and impacts on a tape: their functions, and the states after them."""

from __future__ import annotations

from ...model import DefinitionError, explain
from ..surface_functions import Written
from .motion import Watch


def jumps_of(written: Written) -> list[Watch]:
    """Everything that is met at a zero of its own: stops, then resets, then impacts."""
    d, system = written.system.definition, written.system
    result: list[Watch] = []
    if d.guards.numel():
        (nodes,) = written.insert([d.guards])
        for k, node in enumerate(nodes):
            if k < len(system.stops):
                name, direction = system.stops[k]
                result.append(Watch("stop", name, node, direction, index=k))
            else:
                name, direction = system.resets[k - len(system.stops)]
                (after,) = written.insert([d.maps[:, k - len(system.stops)]])
                full = (*after, *written.x[len(after) :])
                result.append(Watch("reset", name, node, direction, full, k))
    count = len(result)
    return result + [_impact(written, k, count) for k in range(len(system.impacts))]


def _impact(written: Written, k: int, count: int) -> Watch:
    """Newton's impact law: x + c P with P = -(1 + e) v/(grad v . c), c the reaction's column."""
    d, tape = written.system.definition, written.tape
    name = written.system.impacts[k]
    (gaps,) = written.insert([d.gaps])
    (restitutions,) = written.insert([d.restitutions])
    still = [tape.constant(0)] * d.multipliers.numel()
    rate = tape.dot(written.field(still), written.gradient(gaps[k]))
    multipliers = [tape.symbol(3, i) for i in range(len(still))]
    reactions = [tape.constant(0)] * len(gaps)
    reactions[k] = tape.symbol(4, 0)
    field = written.field(multipliers, reactions)
    column = [tape.gradient(f, [reactions[k]])[0] for f in field]
    inputs = [tape.nodes[a].source for a in tape.ancestors(column) if tape.nodes[a].op == "input"]
    if any(vector in (3, 4) for vector, _ in inputs):
        raise DefinitionError(
            explain(
                "certify_orbit",
                expected=f"an impulse of {name!r} that no multiplier enters",
                received="friction at the contact, or a reaction that enters nonlinearly",
                advice="Impacts with friction are not proven.",
            )
        )
    effect = tape.dot(written.gradient(rate), column)
    jump = tape.apply("mul", [tape.apply("add", [tape.constant(1), restitutions[k]]), rate])
    impulse = tape.apply("neg", [tape.apply("div", [jump, effect])])
    n = d.states.numel()
    after = [
        tape.apply("add", [x, tape.apply("mul", [impulse, c])])
        for x, c in zip(written.x[:n], column[:n], strict=True)
    ]
    return Watch("impact", name, gaps[k], -1, (*after, *written.x[n:]), count + k, impulse)
