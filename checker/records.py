"""Files and records as they must be before anything is computed from them."""

from __future__ import annotations

import json
import os
import stat
import sys
from typing import Any

from intervals import CheckError

#: Bytes of a file; instructions of a graph, and how deep they are nested; exponent of a power; states.
_LARGEST, _MOST, _DEEPEST, _EXPONENT, _STATES = 1 << 28, 100_000, 1_000, 1_000, 200

_ONE = """
    exp expm1 log log1p sqrt sq inv sin cos tan atan asin acos
    sinh cosh tanh asinh acosh atanh erf neg twice
""".split()
_TWO = ("add", "sub", "mul", "div", "pow", "hypot", "atan2")
_ARITY = {**dict.fromkeys(_ONE, 1), **dict.fromkeys(_TWO, 2), "pi": 0}

_KINDS = ("two-fold", "fold", "equilibrium", "pseudo-equilibrium")
_LISTS = (
    "above",
    "below",
    "positive",
    "direction",
    "surfaces",
    "field",
    "guards",
    "gaps",
    "restitutions",
)


def read(name: str) -> dict[str, Any]:
    """The content of a file; CheckError unless a proof was saved in it."""
    try:
        handle = os.open(name, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        with os.fdopen(handle, "rb") as file:
            facts = os.fstat(handle)
            if not stat.S_ISREG(facts.st_mode) or facts.st_size > _LARGEST:
                raise CheckError(f"it is no file of at most {_LARGEST} bytes")
            text = _parsed(file.read(_LARGEST))
    except (OSError, ValueError, RecursionError) as error:
        raise CheckError(f"it cannot be read: {error}") from error
    if not isinstance(text, dict) or not isinstance(text.get("proofs", []), list):
        raise CheckError("it holds no proofs")
    return text


def _parsed(content: bytes) -> Any:
    """The value of a JSON text; RecursionError where it is nested deeply."""
    # The limit of the other modules is for calls in Python, not for those of the parser in C.
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(1_000)
    try:
        return json.loads(content)
    finally:
        sys.setrecursionlimit(limit)


def require_graph(graph: dict[str, Any]) -> None:
    """Refuse instructions that are not known, or that have others than earlier ones as arguments."""
    nodes, depths = graph["nodes"], list[int]()
    if not isinstance(nodes, list) or len(nodes) > _MOST:
        raise CheckError(f"the graph is no list of at most {_MOST} instructions")
    for k, node in enumerate(nodes):
        if not isinstance(node, list) or not node:
            raise CheckError(f"instruction {k} is none")
        depths.append(1 + max((depths[i] for i in _arguments(k, *node)), default=0))
    if max(depths, default=0) > _DEEPEST:
        raise CheckError(f"instructions are nested more than {_DEEPEST} deep")
    single = [graph[key] for key in ("surface", "factor") if key in graph]
    rows = [graph[key] for key in _LISTS if key in graph] + list(graph.get("maps", []))
    for hint in graph.get("sliding", {}).values():
        single.append(hint["factor"])
        rows.append(hint["direction"])
    for index in [*single, *(k for row in rows for k in row)]:
        require_index(index, len(nodes), "an instruction")


def _arguments(k: int, op: Any, *rest: Any) -> list[int]:
    """Numbers of the instructions that one has as arguments."""
    if op == "const" and len(rest) == 1:
        return []
    if op == "input" and len(rest) == 2:
        for i in rest:
            require_index(i, _MOST, "an input")
        return []
    if op == "power" and len(rest) == 2:
        require_index(rest[1] - 1, _EXPONENT, "an exponent less one")
        own = list(rest[:1])
    else:
        if not isinstance(op, str) or _ARITY.get(op) != len(rest):
            raise CheckError(
                f"instruction {k}, {op!r} of {len(rest)}, is not known to this checker"
            )
        own = list(rest)
    for i in own:
        require_index(i, k, f"an argument of instruction {k}, {op!r},")
    return own


def require_index(value: Any, count: int, what: str) -> None:
    """Refuse what is no whole number from 0 to below a count."""
    if type(value) is not int or not 0 <= value < count:
        raise CheckError(f"{what} is {value!r}")


def require_orbit(record: dict[str, Any]) -> None:
    """Refuse a record of an orbit with other instructions than there are, or too many parts."""
    require_graph(record["graph"])
    for part in (
        record["start"],
        record["parameters"],
        record["graph"]["surfaces"],
        record["impacts"],
    ):
        require_index(
            len(part), _STATES + 1, "the number of states, parameters, surfaces or impacts"
        )


def require_periodic(record: dict[str, Any]) -> None:
    """Refuse a record of a periodic orbit whose parts do not belong together."""
    require_orbit(record | {"start": record["graph"]["field"]})
    n, sections = len(record["graph"]["field"]), record["sections"]
    require_index(len(sections) - 1, _STATES, "the number of planes less one")
    require_index(record.get("multiplicity", 0), _MOST, "the multiplicity")
    sizes = [len(record[key]) for key in ("box", "point", "matrix")]
    sizes += [len(row) for row in record["matrix"]]
    events = record["claims"]["events"]
    if {len(sections) * (n - 1)} != set(sizes) or len(events) != len(sections):
        raise CheckError("its boxes and events are not as many as its planes")
    for section in sections:
        require_index(section["position"], n, "the state of a plane")
        if section["direction"] not in (1, -1):
            raise CheckError("a direction is neither 1 nor -1")


def require_point(record: dict[str, Any]) -> None:
    """Refuse a record of a special point whose parts do not belong together."""
    if record["kind"] not in _KINDS or record["side"] not in (None, "+", "-"):
        raise CheckError("its kind or side is not known")
    require_graph(record["graph"])
    n, unknowns = record["states"], record["unknowns"]
    require_index(n, _STATES + 1, "the number of states")
    if len(record["held"]) != n or len({(v, i) for v, i in unknowns}) != len(unknowns):
        raise CheckError("its states or unknowns are not as many as it says")
    further = sum(vector == 2 for vector, _ in unknowns)
    for vector, i in unknowns:
        require_index(i, further if vector == 2 else n, "an unknown")
        if vector not in (0, 2):
            raise CheckError("an unknown is neither a state nor a further one")
