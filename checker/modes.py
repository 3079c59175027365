"""Modes of a recorded system: Filippov's rules on surfaces, and maps of resets and impacts."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from derivatives import D, run
from intervals import CheckError, Iv, number, whole

#: States and parameters.
At = tuple[list[Iv], list[Iv]]
UNIT = whole(1).a

#: Rational numbers of more bits are not kept.
_BITS = 1 << 16


class Modes:
    """Modes and jumps at points of a recorded system."""

    def __init__(self, record: dict[str, Any]):
        self.graph = record["graph"]
        self.count = len(self.graph["surfaces"])
        self.contacts = len(record["impacts"])
        ends = [("stop", *s) for s in record["stops"]] + [("reset", *r) for r in record["resets"]]
        ends += [("impact", name, -1) for name in record["impacts"]]
        nodes = [*self.graph["guards"], *self.graph["gaps"]]
        self.ends = [(*e, node) for e, node in zip(ends, nodes, strict=True)]
        self.stops = len(record["stops"])
        self.start_surface: int | None = None

    def surfaces_of(self, mode: str) -> str:
        """The letters of the surfaces."""
        return mode[: self.count]

    def _at(self, x: list[Iv], p: list[Iv], lam: list[Iv], further: bool = False) -> list[D]:
        """Values with derivatives by the states, and then by multipliers and reactions."""
        n, more = len(x), (len(lam) + self.contacts) * further
        size = n + more
        unit = [[whole(int(i == j)) for j in range(size)] for i in range(size)]
        zero = [[whole(0)] * size for _ in range(size)]
        states = [D(v, unit[i], zero) for i, v in enumerate(x)]
        signs = [D(v, unit[n + i], zero) if further else D(v) for i, v in enumerate(lam)]
        none = [
            D(whole(0), unit[n + len(lam) + i], zero) if further else D(whole(0))
            for i in range(self.contacts)
        ]
        values = run(self.graph, states, [D(v) for v in p], [], signs, none)
        empty = [whole(0)] * size
        return [v if v.g else D(v.v, empty, zero) for v in values]

    def heights(self, x: list[Iv], p: list[Iv]) -> list[Iv]:
        values = self._at(x, p, [whole(0)] * self.count)
        return [values[k].v for k in self.graph["surfaces"]]

    def mode_at(self, x: list[Iv], p: list[Iv], slides: int | None = None) -> str:
        """The mode of a point that lies on no surface, or on the one given."""
        signs = [h.sign() for h in self.heights(x, p)]
        if not all(s for j, s in enumerate(signs) if j != slides):
            raise CheckError("the side of a surface is undecided")
        mode = "".join("+" if s > 0 else "-" for s in signs) + "o" * self.contacts
        if slides is None:
            return mode
        after, _ = self._beyond((x, p), mode, slides)
        if after[slides] != "s":
            raise CheckError("a jump that ends the sliding is not checked here")
        return after

    def start(self, x: list[Iv], p: list[Iv], box: list[tuple[Fraction, Fraction]]) -> str:
        """The mode of the start, which may lie on one surface exactly."""
        signs = [h.sign() for h in self.heights(x, p)]
        on = [j for j, s in enumerate(signs) if not s]
        if not on:
            return self.mode_at(x, p)
        values = _rational(self.graph, box[: len(x)], box[len(x) :])
        if len(on) > 1 or values[self.graph["surfaces"][on[0]]] != 0:
            raise CheckError("the side of a surface at the start is undecided")
        mode = "".join({1: "+", -1: "-", 0: "?"}[s] for s in signs) + "o" * self.contacts
        self.start_surface = on[0]
        return self._beyond((x, p), mode, on[0])[0]

    def rates(self, at: At, mode: str, surface: int) -> tuple[Iv, Iv]:
        """L1 and L2 at a surface."""
        found = []
        for s in (1, -1):
            lam = [whole(1 if w == "+" else -1) for w in self.surfaces_of(mode)]
            lam[surface] = whole(s)
            found.append(self._rate(at, lam, surface)[0])
        return found[0], found[1]

    def _rate(self, at: At, lam: list[Iv], surface: int) -> tuple[Iv, list[Iv]]:
        """Rate of a switching function along a field, and that field."""
        values = self._at(*at, lam)
        f = [values[k].v for k in self.graph["field"]]
        return _dot(values[self.graph["surfaces"][surface]].g, f), f

    def _beyond(self, at: At, mode: str, j: int) -> tuple[str, int]:
        signs = tuple(v.sign() for v in self.rates(at, mode, j))
        letters = {(-1, 1): ("s", 0), (1, 1): ("+", 1), (-1, -1): ("-", 1)}
        if signs not in letters:
            raise CheckError("what follows at a surface is undecided")
        letter, zeros = letters[signs]
        return mode[:j] + letter + mode[j + 1 :], zeros

    def switched(
        self, at: At, mode: str, guard: str, j: int, direction: int
    ) -> tuple[str, int, str]:
        """The mode after an event at a surface, zeros of its function, and the event's kind."""
        if guard == "exit":
            l1, l2 = self.rates(at, mode, j)
            if (l2 if direction > 0 else -l1).sign() <= 0:
                raise CheckError("the other field at an exit is undecided")
            return mode[:j] + ("+" if direction > 0 else "-") + mode[j + 1 :], 2, "exit"
        if "s" in mode:
            return self._across(at, mode, j), 1, "crossing"
        after, zeros = self._beyond(at, mode, j)
        return after, zeros, "entry" if after[j] == "s" else "crossing"

    def _across(self, at: At, mode: str, j: int) -> str:
        """The mode after a surface is crossed while another slides."""
        # For every multiplier of the crossed surface the other attracts, and sliding on it leads across.
        i, found = mode.index("s"), []
        for s in (1, -1):
            lam = [whole(1 if w == "+" else -1) for w in self.surfaces_of(mode)]
            lam[i], lam[j] = whole(s), Iv(-UNIT, UNIT)
            found.append(self._rate(at, lam, i))
        (l1, f1), (l2, f2) = found
        side = 1 if mode[j] == "-" else -1
        if l1.sign() >= 0 or l2.sign() <= 0:
            raise CheckError("whether a surface continues sliding is undecided")
        a = l1 / (l1 - l2)
        values = self._at(*at, [whole(0)] * self.count)
        field = [p - a * (p - q) for p, q in zip(f1, f2, strict=True)]
        if _dot(values[self.graph["surfaces"][j]].g, field).sign() != side:
            raise CheckError(
                "what follows where a surface is reached while another slides is undecided"
            )
        return mode[:j] + ("+" if side > 0 else "-") + mode[j + 1 :]

    def jumped(
        self, x: list[Iv], p: list[Iv], mode: str, index: int
    ) -> tuple[list[Iv], bool, int | None]:
        """The state after a reset or an impact."""
        # Also whether its own function stays zero, and the surface that slides if it is not left.
        kind, _, _, node = self.ends[index]
        if kind == "reset":
            rows = self.graph["maps"][index - self.stops]
            values = self._at(x, p, [whole(0)] * self.count)
            new = [values[k].v for k in rows] + x[len(rows) :]
            moved = {i for i, k in enumerate(rows) if self.graph["nodes"][k] != ["input", 0, i]}
        else:
            new, moved = self._struck(x, p, index - len(self.ends) + self.contacts)
        slides = mode.index("s") if "s" in mode else None
        if slides is not None and self._depends(self.graph["surfaces"][slides], moved):
            slides = None
        return new, not self._depends(node, moved), slides

    def _depends(self, node: int, states: set[int]) -> bool:
        """Whether a node depends on one of these states."""
        todo, seen = [node], set[int]()
        while todo:
            k = todo.pop()
            if k in seen:
                continue
            seen.add(k)
            op, *rest = self.graph["nodes"][k]
            if op == "input" and rest[0] == 0 and rest[1] in states:
                return True
            todo += [] if op in ("const", "input") else rest[:1] if op == "power" else rest
        return False

    def _struck(self, x: list[Iv], p: list[Iv], contact: int) -> tuple[list[Iv], set[int]]:
        """State after Newton's impact law, and the states that change; there is no friction here."""
        n, graph = len(x), self.graph
        values = self._at(x, p, [whole(0)] * self.count, further=True)
        gap, f = values[graph["gaps"][contact]], [values[k] for k in graph["field"]]
        reaction = n + self.count + contact
        column = [v.g[reaction] for v in f]
        if any(not v.zero for d in f for v in d.H[reaction][n:]):
            raise CheckError("an impulse that a multiplier enters is not checked here")
        rate, effect = _dot(gap.g[:n], [d.v for d in f]), whole(0)
        for i in range(n):
            slope = whole(0)
            for j in range(n):
                slope = slope + gap.H[i][j] * f[j].v + gap.g[j] * f[j].g[i]
            effect = effect + slope * column[i]
        e = values[graph["restitutions"][contact]].v
        impulse = -((whole(1) + e) * rate) / effect
        if impulse.sign() <= 0:
            raise CheckError("an impulse is not proven to push")
        moved = {i for i, c in enumerate(column) if not c.zero}
        return [v + impulse * c for v, c in zip(x, column, strict=True)], moved


def _dot(a: list[Iv], b: list[Iv]) -> Iv:
    return sum((s * t for s, t in zip(a, b, strict=True) if not (s.zero or t.zero)), whole(0))


def _rational(
    graph: dict[str, Any], *boxes: list[tuple[Fraction, Fraction]]
) -> list[Fraction | None]:
    """Exact values of nodes; None where they are not one rational number."""
    inputs = [[a if a == b else None for a, b in box] for box in boxes]
    values: list[Fraction | None] = []
    for op, *rest in graph["nodes"]:
        if op == "const":
            values.append(number(rest[0]))
        elif op == "input":
            values.append(inputs[rest[0]][rest[1]] if rest[0] < 2 else None)
        elif op == "power":
            a = values[rest[0]]
            values.append(None if a is None else a ** rest[1])
        else:
            values.append(_exactly(op, [values[k] for k in rest]))
        known = values[-1]
        if known is not None and max(abs(known.numerator), known.denominator).bit_length() > _BITS:
            values[-1] = None
    return values


def _exactly(op: str, args: list[Fraction | None]) -> Fraction | None:
    known = [a for a in args if a is not None]
    if len(known) < len(args):
        return None
    if op in ("add", "sub"):
        return known[0] + (known[1] if op == "add" else -known[1])
    if op == "mul":
        return known[0] * known[1]
    if op in ("div", "inv"):
        below = known[-1]
        return None if below == 0 else (known[0] if op == "div" else Fraction(1)) / below
    return (
        {"neg": lambda a: -a, "twice": lambda a: 2 * a, "sq": lambda a: a * a}.get(
            op, lambda a: None
        )(known[0])
        if known
        else None
    )
