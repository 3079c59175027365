"""Complete lists of the special points in a box, or the parts of the box that stay undecided."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, Literal

import numpy as np

from ...local.point.surface_point import FIELDS, Side
from ...model import FilippovSystem, OptionError, real, require_continuous, require_system, whole
from ..arithmetic.decimals import given
from ..arithmetic.enclosure import Enclosure
from ..arithmetic.flint import arb
from ..arithmetic.interval_arrays import Floats, of_fractions
from ..arithmetic.intervals import Numbers, enclose, exact, precision
from ..arithmetic.krawczyk import Zero
from ..proof import READ, Classification, Proof, intervals, paragraph
from ..record import problem_record, record_of
from ..surface_functions import SurfaceFunctions, parameter_ranges
from .census import Census, Undecided
from .certify import prove_instance
from .problem_instance import ProblemInstance
from .special_points import PROBLEMS, PointProblem
from .subdivide import Search, clusters

Kind = Literal["two-fold", "fold", "equilibrium", "pseudo-equilibrium"]


#: Wider boxes overflow.
_WIDEST = Fraction(10) ** 300


def prove_all(
    system: FilippovSystem,
    box: Sequence[Any],
    kind: Kind = "two-fold",
    *,
    side: Side = "+",
    surface: int = 0,
    mode: str | None = None,
    parameters: Mapping[Any, Any] | None = None,
    t: float = 0.0,
    numbers: Numbers = "stored",
    width: float = 1e-12,
    max_boxes: int = 200_000,
) -> Census:
    """Find every special point in a box, with proof that there are no others.

    Parameters
    ----------
    system : FilippovSystem
        With scalar multipliers, and with operations of interval arithmetic.
    box : sequence of n pairs (low, high)
        For each state its range; a number holds a state at that value. As many states must be left
        free as there are equations: 3 for two-folds, 2 for folds, all for points of rest.
    kind : {"two-fold", "fold", "equilibrium", "pseudo-equilibrium"}, optional
        Equilibria are those of one field on its own side, pseudo-equilibria those that slide.
    side : {"+", "-"}, optional
        For folds and equilibria the field $F1$ or $F2$.
    surface, mode
        As in :func:`nonsmooth.region`.
    parameters : mapping, optional
        Values, or pairs (low, high): the list is then complete for each of them.
    t : float, optional
        Time of two-folds and folds, where the system depends on it.
    numbers, width
        As in :func:`certify`.
    max_boxes : int, optional
        How many pieces of the box may be examined.

    Returns
    -------
    Census
        Ctrl-C ends the search and returns what was proven so far.

    Raises
    ------
    MissingError
        python-flint is not installed.
    OptionError
        A box with too many or too few free states, or without an inside; an unknown ``kind``; a width
        or a limit that is not positive.
    ParameterError
        An unknown parameter, one without a value, or a value that is no finite number or interval.
    DefinitionError
        Vector multipliers; a ``mode``, ``surface`` or ``side`` that the system does not have.
    NotSmoothError
        An operation that jumps or has a kink.

    Notes
    -----
    Subdivision with interval extensions and Krawczyk's operator; see Kearfott 1996, Rigorous Global
    Search. Zeros that are not simple (double ones, curves) stay undecided, and are named.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, z = (ca.SX.sym(s) for s in "xyz")
    >>> s = ns.FilippovSystem([x, y, z], surface=x, above=[y**2 - z, 1, 1], below=[y + z, 1, -1])
    >>> everything = ns.prove_all(s, [(-1, 1), (-2, 2), (-2, 2)])
    >>> everything.complete, [p.label for p in everything.zeros]
    (True, [...])
    """
    require_system(system)
    require_continuous(system, "prove_all")
    if kind not in PROBLEMS:
        raise OptionError(f"kind={kind!r} is not one of {list(PROBLEMS)}.")
    limit = real(width, "width", low=5e-324, expected="a positive number")
    most = whole(max_boxes, "max_boxes")
    problem = PROBLEMS[kind](SurfaceFunctions(system, surface, mode), numbers, side)
    ranges = _read_box(system, box, numbers)
    ranges += [exact(t, numbers, "t")] if system.time_dependent else []
    instance = _instance(problem, ranges, parameters, numbers)
    bounds = [v for v in ranges if isinstance(v, tuple)]
    bounds += [(low, high) for _, low, high in problem.further]
    with precision(128):
        around = [of_fractions(*pair) for pair in bounds]
        low = np.array([float(v.low) for v in around])
        high = np.array([float(v.high) for v in around])
        search = Search(instance.equations(), low, high, max_boxes=most)
        search.run()
    return _census(instance, search, bounds, limit)


def _read_box(system: FilippovSystem, box: Sequence[Any], numbers: Numbers) -> list[Any]:
    """Ranges of the states, or values of those that are held, as fractions."""
    names = system.state_names
    try:
        given = list(box)
    except TypeError:
        given = []
    if len(given) != len(names):
        raise OptionError(
            f"box={box!r} does not have {len(names)} ranges (low, high) or numbers, for {', '.join(names)}."
        )
    result: list[Any] = []
    for name, value in zip(names, given, strict=True):
        what = f"box of {name!r}"
        if isinstance(value, (tuple, list, np.ndarray)):
            ends = [exact(v, numbers, what) for v in value]
            if len(ends) != 2 or not 0 < ends[1] - ends[0] < _WIDEST:
                raise OptionError(
                    f"{what} is {value!r}, but must be (low, high) with low < high, finite and less than 1e300 "
                    "apart. A number instead of a pair holds the state."
                )
            result.append((ends[0], ends[1]))
        else:
            result.append(exact(value, numbers, what))
    return result


def _instance(
    problem: PointProblem, ranges: list[Any], parameters: Mapping[Any, Any] | None, numbers: Numbers
) -> ProblemInstance:
    system = problem.functions.system
    free = [i for i, v in enumerate(ranges) if isinstance(v, tuple)]
    unknown = len(free) + len(problem.further)
    if unknown != len(problem.nodes):
        advice = (
            f"Otherwise points form a set of dimension {unknown - len(problem.nodes)}: give numbers to "
            "hold states."
            if unknown > len(problem.nodes)
            else "Give more states a range."
        )
        raise OptionError(
            f"box leaves {len(free)} states free, but a {problem.kind} needs "
            f"{len(problem.nodes) - len(problem.further)}, as many as equations. {advice}"
        )
    values = [(v[0], v[0]) if isinstance(v, tuple) else (v, v) for v in ranges]
    return ProblemInstance(
        problem,
        [0.0] * unknown,
        [(0, i) for i in free] + [(2, k) for k in range(len(problem.further))],
        [system.state_names[i] for i in free] + [name for name, *_ in problem.further],
        values,
        [],
        [Fraction(0)] * len(free),
        parameter_ranges(system, parameters, numbers),
        numbers,
    )


def _census(
    instance: ProblemInstance, search: Search, bounds: list[tuple[Fraction, Fraction]], width: float
) -> Census:
    zeros, edge, left, others = [], [], [], []
    for found in search.zeros:
        position = _position(found.point, bounds)
        qualifies = instance.problem.qualifies(search.equations.inputs(found.point))
        if position == "outside" or qualifies is False:
            others.append(_of_another(instance, search, found))
            continue
        proof = prove_instance(instance, found, width)
        if proof is None or qualifies is None:
            why = "a zero on the surface or at the end of sliding: its status is undecided"
            left.append(Undecided(proof.point if proof else {}, why))
        elif position == "edge":
            edge.append(proof)
        else:
            zeros.append(proof)
    for low, high in clusters(search.undecided, search.size):
        box = {
            name: Enclosure(repr(float(a)), repr(float(b)))
            for name, a, b in zip(instance.names, low, high, strict=True)
        }
        left.append(Undecided(box, _reason(low, high, search)))
    complete = not left and not edge
    statement = _words(instance, search, bounds, zeros, edge, left, complete)
    kind = instance.problem.kind
    record = {
        "complete": complete,
        "question": problem_record(instance),
        "bounds": [[str(v) for v in pair] for pair in bounds],
        "zeros": [p.record for p in zeros],
        "others": others,
    }
    found_all = tuple(zeros), tuple(edge), tuple(left)
    return Census(kind, complete, *found_all, search.boxes, statement, record)


def _of_another(instance: ProblemInstance, search: Search, found: Zero) -> dict[str, Any]:
    """The record of a zero outside the box, or with fields that do not apply there."""
    nothing = Classification("", instance.problem.kind, claims={"label": "", "coincident": False})
    return record_of(instance, found, nothing, 128)


def _position(point: Sequence[arb], bounds: Sequence[tuple[Fraction, Fraction]]) -> str:
    """Whether a point is in the closed box: "inside", "outside" or "edge"."""
    result = "inside"
    with precision(256):
        for v, (a, b) in zip(point, bounds, strict=True):
            low, high = enclose(a), enclose(b)
            if v < low or v > high:
                return "outside"
            if not (v >= low and v <= high):
                result = "edge"
    return result


def _reason(low: Floats, high: Floats, search: Search) -> str:
    share = float(np.max((high - low) / search.size))
    if search.stopped in ("interrupted",) or search.stopped.endswith("pieces"):
        return f"not examined further ({search.stopped})"
    if share > 0.02:
        return (
            "zeros that are not isolated (a curve or a surface of them), or expressions that are "
            "not defined there"
        )
    return (
        "a zero that is not simple (a double one, or several that are too close to separate), or a "
        "branch point of an expression"
    )


def _words(
    instance: ProblemInstance,
    search: Search,
    bounds: Sequence[tuple[Fraction, Fraction]],
    zeros: list[Proof],
    edge: list[Proof],
    left: list[Undecided],
    complete: bool,
) -> str:
    kind = instance.problem.kind
    ranges = intervals({n: given(*pair) for n, pair in zip(instance.names, bounds, strict=True)})
    parameters = zip(instance.parameter_names, instance.parameters, strict=True)
    condition = intervals({name: given(*pair) for name, pair in parameters})
    side = getattr(instance.problem, "side", None)
    what = f"{kind} of {FIELDS[side]}" if side else kind
    count = {0: f"no {what}", 1: f"exactly one {what}"}.get(
        len(zeros), f"exactly {len(zeros)} points of kind {what}"
    )
    if not complete:
        count = f"at least {len(zeros)} of kind {what}; the list is not proven complete"
    lines = [
        f"{p.label or 'class undecided'}: {', '.join(f'{k} = {v}' for k, v in p.point.items())}."
        for p in zeros[:20]
    ]
    lines += [f"On the edge: {', '.join(f'{k} = {v}' for k, v in p.point.items())}." for p in edge]
    lines += [f"Undecided: {u}." for u in left[:10]]
    head = "Theorem" if complete else "Theorem in part"
    return paragraph(
        f"{head}. {f'For {condition}: the' if condition else 'The'} box {ranges}{instance.where} "
        f"holds {count}.",
        *lines,
        f"Pieces of the box that were examined: {search.boxes}. {READ[instance.numbers]}",
    )
