"""The recurrences of power series as C statements, in the order of the interpreter.

Each corresponds to a rule of ``series_rules`` in ``flow/compiled/interpreter/programs.h``, with the same four
chains of sums and the same fused products (MULADD); a test compares the bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from .tape import OPERATIONS, TAPE_RULES, Series


def literal(value: float) -> str:
    """Return a number in C."""
    if not math.isfinite(value):
        return "NAN" if math.isnan(value) else ("INFINITY" if value > 0 else "(-INFINITY)")
    return f"({value!r})"


class Writer:
    """Statements for coefficients of rules; coefficient k of rule j is ``s<j>_<k>`` or what it equals."""

    def __init__(self, series: Series):
        self.s = series
        self.rule = [TAPE_RULES[k] for k in series.rule.tolist()]
        self.a, self.b, self.c = series.a.tolist(), series.b.tolist(), series.c.tolist()
        self.first, self.second = series.first.tolist(), series.second.tolist()
        self.still = set(series.still.tolist())
        self.lines: list[str] = []
        self.names: dict[tuple[int, int], str] = {}
        self._weighted: dict[tuple[str, int], str] = {}
        self._inverse: dict[str, str] = {}
        self._stride = "(P + 1)"

    def name(self, j: int, k: int) -> str:
        """C of a coefficient."""
        found = self.names.get((j, k))
        if found is None:
            assert j in self.still, (self.rule[j], j, k)
            found = "0.0" if k else self._given(j)
            self.names[j, k] = found
        return found

    def _given(self, j: int) -> str:
        """What does not move was prepared by the interpreter."""
        if self.rule[j] == "constant":
            return literal(self.first[j])
        self.lines.append(f"const double q{j} = s[{j} * {self._stride}];")
        return f"q{j}"

    def let(self, name: str, value: str) -> str:
        """Add a statement."""
        self.lines.append(f"const double {name} = {value};")
        return name

    def inverse(self, value: str) -> str:
        """C of a reciprocal, computed once."""
        if value not in self._inverse:
            self._inverse[value] = self.let(f"i{len(self._inverse)}", f"1.0 / {value}")
        return self._inverse[value]

    def over(self, value: str, divisor: str) -> str:
        """C of the interpreter's ``over``."""
        return f"divided({value}, {self.inverse(divisor)})"

    def settled(self, value: str, j: int, divisor: int) -> str:
        """C of the interpreter's ``settled``."""
        return f"settled({value}, {self.name(j, 0)}, {self.name(divisor, 0)})"

    def ratio(self, u: int, v: int) -> str:
        """C of the interpreter's ``ratio`` of two values."""
        value, divisor = self.name(u, 0), self.name(v, 0)
        return f"{value} == 0 && {divisor} == 0 ? NAN : {self.over(value, divisor)}"

    def advance(self, j: int, k: int, given: Callable[[int, int], str], mark: str = "") -> None:
        """Write coefficient k of rule j; inputs are given."""
        rule, u, v = self.rule[j], self.a[j], self.b[j]
        if rule == "input":
            self.names[j, k] = given(v, k)
        elif k and rule in ("shift", "lower"):
            self.names[j, k] = self.name(u, k)
        else:
            value = getattr(self, f"_{rule}")(j, k, u, v)
            self.names[j, k] = self.let(f"s{j}_{k}{mark}", value)

    # sums of products, as in programs.h
    def _chains(self, firsts: Sequence[str], seconds: Sequence[str]) -> str:
        if not firsts:
            return "0.0"
        sums = []
        for start in range(4):
            pairs = list(zip(firsts[start::4], seconds[start::4], strict=True))
            if pairs:
                total = f"{pairs[0][0]} * {pairs[0][1]}"
                for x, y in pairs[1:]:
                    total = f"MULADD({x}, {y}, {total})"
                sums.append(total)
        early, late = " + ".join(sums[:2]), " + ".join(sums[2:])
        return f"({early}) + ({late})" if late else early

    def convolve(self, u: int, v: int, k: int, first: int, last: int) -> str:
        """C of the interpreter's ``convolve``."""
        places = range(first, last + 1)
        return self._chains(
            [self.name(u, i) for i in places], [self.name(v, k - i) for i in places]
        )

    def weigh(self, u: int, v: int, k: int, first: int, last: int) -> str:
        """C of the interpreter's ``weigh``."""
        places = range(first, last + 1)
        weighted = [self._weigh(self.name(u, i), i) for i in places]
        return self._chains(weighted, [self.name(v, k - i) for i in places])

    def _weigh(self, name: str, i: int) -> str:
        if (name, i) not in self._weighted:
            number = f"m{len(self._weighted)}"
            self._weighted[name, i] = self.let(number, f"{float(i)!r} * {name}")
        return self._weighted[name, i]

    # rules
    def _add(self, j: int, k: int, u: int, v: int) -> str:
        return f"{self.name(u, k)} + {self.name(v, k)}"

    def _shift(self, j: int, k: int, u: int, v: int) -> str:
        return f"{self.name(u, 0)} + {self.name(v, 0)}"

    def _sub(self, j: int, k: int, u: int, v: int) -> str:
        return f"{self.name(u, k)} - {self.name(v, k)}"

    def _lower(self, j: int, k: int, u: int, v: int) -> str:
        return f"{self.name(u, 0)} - {self.name(v, 0)}"

    def _below(self, j: int, k: int, u: int, v: int) -> str:
        return f"-{self.name(v, k)}" if k else f"{self.name(u, 0)} - {self.name(v, 0)}"

    def _neg(self, j: int, k: int, u: int, v: int) -> str:
        return f"-{self.name(u, k)}"

    def _twice(self, j: int, k: int, u: int, v: int) -> str:
        return f"{self.name(u, k)} + {self.name(u, k)}"

    def _scale(self, j: int, k: int, u: int, v: int) -> str:
        return f"{self.name(u, k)} * {self.name(v, 0)}"

    def _over(self, j: int, k: int, u: int, v: int) -> str:
        return self.over(self.name(u, k), self.name(v, 0)) if k else self.ratio(u, v)

    def _mul(self, j: int, k: int, u: int, v: int) -> str:
        return self.convolve(u, v, k, 0, k)

    def _sq(self, j: int, k: int, u: int, v: int) -> str:
        middle = self.name(u, k // 2)
        if k == 0:
            return f"{middle} * {middle}"
        half = f"2.0 * ({self.convolve(u, u, k, 0, (k + 1) // 2 - 1)})"
        return half if k % 2 else f"MULADD({middle}, {middle}, {half})"

    def _div(self, j: int, k: int, u: int, v: int) -> str:
        if k == 0:
            return self.ratio(u, v)
        top = f"{self.name(u, k)} - ({self.convolve(j, v, k, 0, k - 1)})"
        return self.settled(self.over(top, self.name(v, 0)), j, v)

    def _under(self, j: int, k: int, u: int, v: int) -> str:
        if k == 0:
            return self.ratio(u, v)
        value = self.over(f"-({self.convolve(j, v, k, 0, k - 1)})", self.name(v, 0))
        return self.settled(value, j, v)

    def _sqrt(self, j: int, k: int, u: int, v: int) -> str:
        if k == 0:
            return f"sqrt({self.name(u, 0)})"
        top = f"0.5 * ({self.name(u, k)} - ({self.convolve(j, j, k, 1, k - 1)}))"
        return self.over(top, self.name(j, 0))

    def _power(self, j: int, k: int, u: int, v: int) -> str:
        e = self.name(v, 0)
        if k == 0:
            return f"operate(OP_pow, {self.name(u, 0)}, {e})"
        total = f"{e} * {float(k)!r} * ({self.name(u, k)} * {self.name(j, 0)})"
        for i in range(1, k):
            factor = f"{e} * {float(k - i)!r} - {float(i)!r}"
            total = f"MULADD({factor}, {self.name(u, k - i)} * {self.name(j, i)}, {total})"
        value = f"{self.over(total, self.name(u, 0))} * (1.0 / {float(k)!r})"
        return self.settled(value, j, u)

    def _affine(self, j: int, k: int, u: int, v: int) -> str:
        factor = literal(self.second[j])
        if k:
            return f"{factor} * {self.name(u, k)}"
        return f"MULADD({factor}, {self.name(u, 0)}, {literal(self.first[j])})"

    def _called(self, j: int, u: int) -> str:
        return f"operate(OP_{OPERATIONS[self.s.op[j]]}, {self.name(u, 0)}, 0)"

    def _integral(self, j: int, k: int, u: int, v: int) -> str:
        if k == 0:
            return self._called(j, u)
        return f"{literal(self.first[j])} / {float(k)!r} * ({self.weigh(u, v, k, 1, k)})"

    def _turn(self, j: int, k: int, u: int, v: int) -> str:
        if k == 0:
            return self._called(j, u)
        return (
            f"{literal(self.first[j])} / {float(k)!r} * ({self.name(u, 1)} * {self.name(v, k - 1)})"
        )

    def _quotient(self, j: int, k: int, u: int, v: int) -> str:
        if k == 0:
            return self._called(j, u)
        known = self.weigh(j, v, k, 1, k - 1)
        top = f"{literal(self.first[j])} * {float(k)!r} * {self.name(u, k)} - ({known})"
        return f"{self.over(top, self.name(v, 0))} * (1.0 / {float(k)!r})"

    def _atan2(self, j: int, k: int, u: int, v: int) -> str:
        if k == 0:
            return f"operate(OP_atan2, {self.name(u, 0)}, {self.name(v, 0)})"
        radius = self.c[j]
        turn = f"({self.weigh(u, v, k, 1, k)}) - ({self.weigh(v, u, k, 1, k)})"
        top = f"{turn} - ({self.weigh(j, radius, k, 1, k - 1)})"
        return f"{self.over(top, self.name(radius, 0))} * (1.0 / {float(k)!r})"

    def _gated(self, j: int, k: int, u: int, v: int) -> str:
        return f"{self.name(u, 0)} != 0 ? {self.name(v, k)} : 0.0"

    def _chosen(self, j: int, k: int, u: int, v: int) -> str:
        known = " || ".join(f"{self.name(u, i)} != 0" for i in range(k + 1))
        return f"{known} ? {self.name(v, k)} : 0.0"
