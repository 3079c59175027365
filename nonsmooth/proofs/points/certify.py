"""Proofs of existence, uniqueness and class of a special point or periodic orbit, also for ranges of parameters."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from ...local import Equilibrium, Fold, PseudoEquilibrium, TwoFold
from ...model import FilippovSystem, real, whole
from ...orbit import PeriodicOrbit
from ..arithmetic.decimals import enclosure, given, inner
from ..arithmetic.flint import arb
from ..arithmetic.intervals import Numbers, between, precision, radius, within
from ..arithmetic.krawczyk import Zero, prove_zero
from ..orbits.periodic import OrbitInstance, orbit_instance
from ..proof import READ, Classification, Proof, hulls, intervals, paragraph
from .problem_instance import ProblemInstance, instance_of

#: A special point or a periodic orbit that is to be proven.
Instance = ProblemInstance | OrbitInstance


def certify(
    found: TwoFold | Fold | Equilibrium | PseudoEquilibrium | PeriodicOrbit,
    *,
    system: FilippovSystem | None = None,
    width: float = 1e-12,
    parameters: Mapping[Any, Any] | None = None,
    hold: Sequence[str] | Mapping[str, Any] = (),
    numbers: Numbers = "stored",
    max_bits: int = 2048,
    max_pieces: int = 64,
) -> Proof:
    """Prove that a special point or periodic orbit exists, is the only one in a named box, and what it is.

    Krawczyk's operator in interval arithmetic of any precision; derivatives are those of the
    expressions as they are stored. Nothing rests on rounding.

    Parameters
    ----------
    found : TwoFold, Fold, Equilibrium, PseudoEquilibrium or PeriodicOrbit
        As a search returns it. Periodic orbits may cross surfaces and jump, but not slide; the time may enter through
        sines and cosines. Their period, multipliers and stability are proven. In systems with more states than equations the theorem is about the
        point on the plane through it, across the set of such points (or of held states).
    system : FilippovSystem, optional
        Needed for folds and points of rest; two-folds and orbits carry their system.
    width : float, optional
        Largest radius of the enclosures, where the parameters are points.
    parameters : mapping, optional
        Values, as numbers or strings, or pairs (low, high): the theorem is then for all of them.
        The others have the value they had in the search, or their default.
    hold : sequence of str, or mapping, optional
        States that keep their value, or have that given, or any of an interval (low, high).
    numbers : {"stored", "written"}
        Whether the constant 0.1 is the double nearest to one tenth, or one tenth.
    max_bits : int, optional
        Where to give up raising the precision; for orbits at 256 or what ``width`` needs.
    max_pieces : int, optional
        How many pieces the intervals of parameters and held states may be divided into.

    Returns
    -------
    Proof
        ``proven`` is False where something stayed undecided; the statement says what.

    Raises
    ------
    MissingError
        python-flint is not installed.
    NotSmoothError
        An operation that jumps or has a kink.
    OptionError
        ``found`` is none of these points, or needs its system; a width or a limit that is not positive.
    ParameterError
        An unknown parameter, one without a value, or a value that is no finite number or interval.
    DefinitionError
        A state to ``hold`` that the system does not have.

    Notes
    -----
    Krawczyk 1969; Neumaier, Interval Methods for Systems of Equations, 1990, ch. 5; the classes are
    those of ``nonsmooth.two_folds``. Arithmetic: Arb (Johansson 2017). Orbits: multiple shooting with
    validated flows, as in Kapela et al. 2021.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, z = (ca.SX.sym(s) for s in "xyz")
    >>> s = ns.FilippovSystem([x, y, z], surface=x, above=[-y, 1, -2], below=[z, -1, 1 + 0.1 * y])
    >>> proof = ns.certify(ns.find_two_fold(s, near=[0.0, 0.1, -0.1]), width=1e-30)
    >>> proof.proven, proof.label, str(proof.point["y"]), str(proof.values["eigenvalue_low"])
    (True, 'II-C', '0', '-2.618033988749894848204586834365... +- ...')
    """
    instance: Instance
    if isinstance(found, PeriodicOrbit):
        instance = orbit_instance(found, hold, numbers, parameters)
    else:
        instance = instance_of(found, system, hold, numbers, parameters)
    limit = real(width, "width", low=5e-324, expected="a positive number")
    whole(max_bits, "max_bits", least=64)
    whole(max_pieces, "max_pieces")
    refusal = getattr(instance, "refusal", "")
    pieces = [_proof(instance, None, 64, refusal)] if refusal else []
    pieces = pieces or _divided(instance, limit, max_bits, max_pieces)
    return pieces[0] if len(pieces) == 1 else _together(instance, pieces)


# Pieces of the parameters --------------------------------------------------------------------------


def _divided(instance: Instance, width: float, max_bits: int, max_pieces: int) -> list[Proof]:
    """Proofs over pieces of the parameters' intervals, which are halved where a proof fails."""
    todo, done, failed = deque([instance]), list[Proof](), 0
    while todo:
        one = todo.popleft()  # the largest first, so that undecided ones do not use up all pieces
        proof, start = _one(one, width, max_bits)
        if (
            proof.proven
            or not _wide(one)
            or len(todo) + len(done) + 2 > max_pieces
            or failed > max_pieces
        ):
            done.append(proof)
            continue
        failed += 1
        todo += one.halves(start, proof.exists)
    return done


def _one(instance: Instance, width: float, max_bits: int) -> tuple[Proof, list[float]]:
    """A proof for one piece, with as many bits as its width and class need."""
    bits = 64
    while 2.0 ** (16 - bits) > width and bits < max_bits:
        bits *= 2
    max_bits = min(max_bits, max(bits, instance.most_bits))
    start: list[arb] = [arb(v) for v in instance.start]
    best: tuple[Zero, Classification] | None = None
    last, why = float("inf"), ""
    while True:
        with precision(bits):
            equations = instance.equations()
            zero = prove_zero(equations, start, known=best[0] if best else None)
            why = "" if zero else instance.failure(equations)
            if zero is not None:
                classification = instance.classification(equations, zero)
                best, start = (zero, classification), [v.mid() for v in zero.point]
                size = max(map(radius, zero.point))
                stuck = size > 0 and size > 0.5 * last  # wide parameters: more digits do not help
                last = size
                if (classification.label and size <= width) or stuck or classification.final:
                    break
            if 2 * bits > max_bits or (zero is None and _wide(instance) and bits > 64):
                break
        bits *= 2
    with precision(bits):
        proof = _proof(instance, best, bits, why)
    return proof, [float(v) for v in start]


def prove_instance(
    instance: ProblemInstance, zero: Zero, width: float, max_bits: int = 1024
) -> Proof | None:
    """A proof for a zero that is known to exist; None if it may be of another zero."""
    start = [float(v.mid()) for v in zero.point]
    proof, _ = _one(replace(instance, start=start), width, max_bits)
    if not proof.exists:
        return None
    with precision(2 * max_bits):
        point, box = (
            [between(Fraction(a), Fraction(b)) for a, b in proof.record[key]]
            for key in ("point", "box")
        )
        # Where one is in the other's box of uniqueness, they are one zero.
        same = within(point, zero.box) or within(zero.point, box)
    return proof if same else None


def _wide(instance: Instance) -> bool:
    return any(a < b for a, b in instance.ranges)


def _proof(
    instance: Instance, best: tuple[Zero, Classification] | None, bits: int, why: str
) -> Proof:
    kind, names = instance.kind, instance.parameter_names
    ranges = [given(*pair) for pair in instance.parameters]
    parameters = dict(zip(names, ranges, strict=True)) | instance.wide_held
    condition = f"For {intervals(parameters)}: " if parameters else ""
    if best is None or not best[1].applies:
        why = f"{best[1].why}." if best else why
        near = [f"{k} = {v:.8g}" for k, v in zip(instance.names, instance.start, strict=True)]
        place = f" near {', '.join(near)} with up to {bits} bits" if near else ""
        statement = paragraph(f"{condition}No proof of a {kind}{place}.", why)
        return Proof(kind, False, False, "", statement, {}, {}, {}, parameters, bits)
    zero, classification = best
    point = dict(zip(instance.names, map(enclosure, zero.point), strict=True))
    box = {
        name: inner(b, k) for name, b, k in zip(instance.names, zero.box, zero.image, strict=True)
    }
    values = {k: enclosure(v) for k, v in classification.values.items() if v.is_finite()}
    statement = instance.statement(classification, condition, point, box, values)
    record = instance.record(zero, classification, bits)
    return Proof(
        kind,
        bool(classification.label),
        True,
        classification.label,
        statement,
        point,
        box,
        values,
        parameters,
        bits,
        record,
    )


def _together(instance: Instance, pieces: list[Proof]) -> Proof:
    """One statement of all pieces."""
    kind, names = instance.kind, instance.parameter_names
    whole_range = [given(*pair) for pair in instance.parameters]
    parameters = dict(zip(names, whole_range, strict=True)) | instance.wide_held
    proven = all(p.proven for p in pieces)
    exists = all(p.exists for p in pieces)
    labels = list(dict.fromkeys(p.label for p in pieces if p.proven))
    head = "Theorem" if proven else "Theorem in part"
    groups = []
    for label in labels:
        count = sum(p.label == label and p.proven for p in pieces)
        groups.append(f"{label} on {count} of {len(pieces)} pieces")
    missing = [p for p in pieces if not p.proven]
    lines = [f"On {intervals(p.parameters)}: {p.statement.splitlines()[0]}" for p in missing[:3]]
    each = "each" if exists else "each that is named"
    size = f"on {each} the box of its piece contains exactly one"
    statement = paragraph(
        f"{head}. For {intervals(parameters)}, divided into {len(pieces)} pieces, {size} {kind}: "
        f"{'; '.join(groups) or 'none proven'}.",
        f"Over all pieces {intervals(hulls([p.point for p in pieces if p.exists]))}.",
        f"Undecided on {len(missing)} pieces." if missing else "",
        *lines,
        READ[instance.numbers],
    )
    points = [p.point for p in pieces if p.exists]
    values = [p.values for p in pieces if p.exists]
    label = labels[0] if proven and len(labels) == 1 else ""
    bits = max(p.bits for p in pieces)
    return Proof(
        kind,
        proven,
        exists,
        label,
        statement,
        hulls(points),
        {},
        hulls(values),
        parameters,
        bits,
        {"ranges": [[str(v) for v in pair] for pair in instance.ranges]},
        tuple(pieces),
    )
