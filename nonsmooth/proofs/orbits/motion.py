"""One smooth motion of a system, and the functions whose zeros end it, in enclosures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..arithmetic.flint import arb, arb_mat
from ..arithmetic.instructions import Program, Tape
from ..arithmetic.intervals import Enclosures, Numbers
from ..arithmetic.series import along, coefficients


@dataclass(frozen=True)
class Watch:
    """A function whose zero means something."""

    kind: str
    name: str
    node: int
    direction: int = 0
    map: tuple[int, ...] = ()
    index: int = 0
    impulse: int | None = None

    @property
    def passes(self) -> bool:
        """Whether it may have either sign: only its passages in one direction mean anything."""
        return self.kind in ("stop", "reset", "impact")


class Mode:
    """Field and watched functions of a mode, evaluated in enclosures."""

    def __init__(
        self,
        tape: Tape,
        field: Sequence[int],
        watches: Sequence[Watch],
        x: Sequence[int],
        numbers: Numbers,
    ):
        self.watches, self.numbers, self.n = tuple(watches), numbers, len(x)
        rows = [tape.gradient(f, x) for f in field]
        nodes = [w.node for w in watches]
        self._field = Program(tape, [list(field)])
        self._jacobian = Program(tape, rows)
        self._both = Program(tape, [list(field), *rows])
        self._watched = Program(tape, [nodes])
        self._slopes = Program(tape, [tape.gradient(k, x) for k in nodes])
        moving = tape.ancestors(k for row in rows for k in row)
        places = [tape.nodes[k].payload for k in moving if tape.nodes[k].op == "input"]
        self.affine = all(place[0] == 1 for place in places)  # type: ignore[index]
        rows = [tape.gradient(k, x) for k in nodes]
        self.affine_watches = [
            all(
                tape.nodes[a].op != "input" or tape.nodes[a].source[0] == 1
                for a in tape.ancestors(row)
            )
            for row in rows
        ]

    def _values(self, program: Program, x: Sequence[arb], p: Sequence[arb]) -> list[list[arb]]:
        return program(Enclosures([x, p, []], self.numbers))

    def field(self, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """Rates of the extended states."""
        return self._values(self._field, x, p)[0]

    def jacobian(self, x: Sequence[arb], p: Sequence[arb]) -> arb_mat:
        """Derivatives of the rates."""
        return arb_mat(self._values(self._jacobian, x, p))

    def watched(self, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """Values of the watched functions."""
        return self._values(self._watched, x, p)[0]

    def slope(self, k: int, x: Sequence[arb], p: Sequence[arb]) -> list[arb]:
        """Gradient of a watched function."""
        return self._values(self._slopes, x, p)[k]

    def series(self, x: Sequence[arb], p: Sequence[arb], count: int) -> list[list[arb]]:
        """Taylor coefficients of the motion from x, ``count`` of them for each state."""
        if not self.affine:
            return coefficients(self._field, x, p, count, self.numbers)
        matrix, rate = self.jacobian(x, p), arb_mat([[f] for f in self.field(x, p)])
        result = [[v] for v in x]
        for k in range(1, count):
            for i in range(self.n):
                result[i].append(rate[i, 0] / k)
            rate = matrix * rate / k
        return result

    def narrowed(
        self,
        wide: list[list[arb]],
        middle: Sequence[arb],
        spread: tuple[arb_mat, arb_mat],
        p: Sequence[arb],
    ) -> list[list[arb]]:
        """Taylor coefficients of affine functions along an affine motion, from middle + frame r."""
        # They are affine in the start: those of the middle plus row A^k/k! frame r, in which the
        # states keep what ties them together.
        if not self.affine or not wide:
            return wide
        frame, r = spread
        own = self.watched_series(self.series(middle, p, len(wide[0])), p)
        rows = self._values(self._slopes, middle, p)
        matrix, power = self.jacobian(middle, p), frame
        result = [list(c) for c in wide]
        for k in range(len(wide[0]) - 1):  # the last one is the remainder's
            for i, row in enumerate(rows):
                if self.affine_watches[i]:
                    value = own[i][k] + ((arb_mat([row]) * power) * r)[0, 0]
                    if value.is_finite() and value.overlaps(wide[i][k]):
                        result[i][k] = value.intersection(wide[i][k])
            power = matrix * power / (k + 1)
        return result

    def watched_series(self, c: Sequence[Sequence[arb]], p: Sequence[arb]) -> list[list[arb]]:
        """Taylor coefficients of the watched functions along a motion."""
        return along(self._watched, c, p, self.numbers)[0]

    def variation(
        self, c: Sequence[Sequence[arb]], p: Sequence[arb], start: arb_mat
    ) -> list[arb_mat]:
        """Taylor coefficients of V' = J V along a motion, V(0) = ``start``."""
        rows, n, count = along(self._jacobian, c, p, self.numbers), self.n, len(c[0])
        jacobians = [
            arb_mat([[rows[i][j][k] for j in range(n)] for i in range(n)]) for k in range(count - 1)
        ]
        result = [start]
        for k in range(count - 1):
            total = jacobians[0] * result[k]
            for i in range(1, k + 1):
                total = total + jacobians[i] * result[k - i]
            result.append(total / (k + 1))
        return result
