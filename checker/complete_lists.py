"""Check that a list of special points is complete, and that pieces cover ranges of parameters."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from intervals import CheckError, Iv, number, whole
from special_points import Equations, Matrix, check, inverse, krawczyk

_PIECES, _SMALLEST = 20_000, 1e-9


def check_cover(ranges: list[list[str]], records: list[dict[str, Any]]) -> str:
    """Check that the pieces of the records are the whole of the ranges."""
    # They are where they lie inside, do not overlap, and have its volume.
    whole_box = [(number(a), number(b)) for a, b in ranges]
    pieces = [[(number(a), number(b)) for a, b in _ranges(r)] for r in records]
    wide = [k for k, (a, b) in enumerate(whole_box) if a < b]
    volume = Fraction(0)
    for n, piece in enumerate(pieces):
        for (a, b), (low, high) in zip(piece, whole_box, strict=True):
            if not low <= a <= b <= high:
                raise CheckError("a piece is not inside the ranges")
        for other in pieces[:n]:
            if all(piece[k][0] < other[k][1] and other[k][0] < piece[k][1] for k in wide):
                raise CheckError("two pieces overlap")
        volume += _volume(piece, wide)
    if volume != _volume(whole_box, wide):
        raise CheckError("the pieces are not all of the ranges")
    return f"{len(pieces)} pieces cover the ranges of parameters and held states"


def _ranges(record: dict[str, Any]) -> list[list[str]]:
    """Parameters, then the states that are no unknowns."""
    free = {i for vector, i in record.get("unknowns", []) if vector == 0}
    held = [v for i, v in enumerate(record.get("held", [])) if i not in free]
    return [*record["parameters"], *held]


def _volume(box: list[tuple[Fraction, Fraction]], wide: list[int]) -> Fraction:
    result = Fraction(1)
    for k in wide:
        result *= box[k][1] - box[k][0]
    return result


def check_list(record: dict[str, Any]) -> str:
    """Check that a list of special points is complete."""
    if not record["complete"]:
        raise CheckError("the list is not claimed to be complete")
    bounds = [Iv.of(*pair) for pair in record["bounds"]]
    zeros = [*record["zeros"], *record["others"]]
    for zero in zeros:
        check(zero)
        for key in ("graph", "kind", "side", "held", "parameters", "unknowns", "normals", "states"):
            if key != "graph" and zero[key] != record["question"][key]:
                if key == "held" and _same_held(zero, record["question"]):
                    continue
                raise CheckError(f"a zero belongs to another problem: its {key} differs")
    points = [[Iv.of(*pair) for pair in zero["point"]] for zero in zeros]
    for n, one in enumerate(points):
        for other in points[:n]:
            if all(a.a <= b.b and b.a <= a.b for a, b in zip(one, other, strict=True)):
                raise CheckError("two points of the list may be the same")
    equations = Equations(record["question"])
    for n, point in enumerate(points):
        _check_membership(equations, point, bounds, n < len(record["zeros"]))
    boxes = [[Iv.of(*pair) for pair in zero["box"]] for zero in zeros]
    pieces = _nothing_else(equations, bounds, boxes, points)
    return (
        f"exactly {len(record['zeros'])} points of kind {record['question']['kind']} in the box, "
        f"nothing else in {pieces} pieces"
    )


def _same_held(zero: dict[str, Any], question: dict[str, Any]) -> bool:
    """Whether states that are no unknowns are held at the same values."""
    free = {i for vector, i in question["unknowns"] if vector == 0}
    pairs = zip(zero["held"], question["held"], strict=True)
    return all(a == b for i, (a, b) in enumerate(pairs) if i not in free)


def _check_membership(
    equations: Equations, point: list[Iv], bounds: list[Iv], counts: bool
) -> None:
    """Check that a zero is, or is not, in the box and on the sides of the mode."""
    inside = all(b.a <= v.a and v.b <= b.b for v, b in zip(point, bounds, strict=True))
    outside = any(v.b < b.a or b.b < v.a for v, b in zip(point, bounds, strict=True))
    at = equations.local(point)
    signs = [v.v.sign() for v in at.positive]
    if equations.record["kind"] == "equilibrium":
        signs.append(at.h.v.sign() * (1, -1)["+-".index(equations.record["side"])])
    yes = inside and all(s > 0 for s in signs)
    no = (
        outside
        or any(s < 0 for s in signs)
        or (equations.record["kind"] == "equilibrium" and at.h.v.zero)
    )
    if not (yes if counts else no):
        raise CheckError("whether a zero is in the box and on its sides is not as claimed")


def _nothing_else(
    equations: Equations, bounds: list[Iv], boxes: list[list[Iv]], points: list[list[Iv]]
) -> int:
    """Check that every piece of a box has no zeros but known ones."""
    todo, count = [bounds], 0
    sizes = [b.b - b.a for b in bounds]
    while todo:
        piece = todo.pop()
        count += 1
        if count > _PIECES:
            raise CheckError(f"more than {_PIECES} pieces")
        if any(
            all(b.a <= p.a and p.b <= b.b for p, b in zip(piece, box, strict=True)) for box in boxes
        ):
            continue
        rest = _contracted(equations, piece, points)
        if rest is None:
            continue
        shares = [(v.b - v.a) / size for v, size in zip(rest, sizes, strict=True)]
        k = shares.index(max(shares))
        if shares[k] < _SMALLEST:
            raise CheckError("a piece of the box may hold a zero that is not on the list")
        middle = (rest[k].a + rest[k].b) >> 1
        todo.append([Iv(v.a, middle) if i == k else v for i, v in enumerate(rest)])
        todo.append([Iv(middle, v.b) if i == k else v for i, v in enumerate(rest)])
    return count


def _contracted(equations: Equations, piece: list[Iv], points: list[list[Iv]]) -> list[Iv] | None:
    """A piece contracted by Krawczyk's operator; None where it holds known zeros only."""
    try:
        f, J = equations.system(piece)
        if any(v.sign() for v in f):
            return None
        matrix = inverse(J)
        image = krawczyk(equations, piece, matrix)
    except CheckError:
        return piece  # not defined all over it, or no inverse: it is divided
    rest = [Iv(max(k.a, p.a), min(k.b, p.b)) for k, p in zip(image, piece, strict=True)]
    if any(r.a > r.b for r in rest):
        return None
    known = any(
        all(p.a <= v.a and v.b <= p.b for v, p in zip(point, piece, strict=True))
        for point in points
    )
    return None if known and _at_most_one(matrix, J) else rest


def _at_most_one(matrix: Matrix, J: Matrix) -> bool:
    """Whether I - C J is smaller than one, so that two zeros in the piece would be one."""
    n = len(J)
    for i in range(n):
        total = 0
        for k in range(n):
            entry = whole(int(i == k))
            for j in range(n):
                entry = entry - matrix[i][j] * J[j][k]
            total += max(abs(entry.a), abs(entry.b))
        if total >= whole(1).a:
            return False
    return True
