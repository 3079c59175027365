"""Special points that can be proven: the equations of each kind and the classification of a zero."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from typing import Any

from ...local.point.surface_point import FIELDS, Side, side_index
from ...local.two_folds.classification import TABLE
from ...model import DefinitionError
from ..arithmetic.algebra import Difference
from ..arithmetic.eigenvalues import eigenvalue_kind
from ..arithmetic.flint import arb
from ..arithmetic.instructions import Program
from ..arithmetic.intervals import Enclosures, Numbers, sign
from ..proof import Classification
from ..surface_functions import SurfaceFunctions
from .two_fold_class import FOLDS, proven_class


class PointProblem:
    """The equations of one kind of special point, and its classification."""

    kind: str
    further: Sequence[tuple[str, Fraction, Fraction]] = ()
    dimension = 1

    def __init__(self, functions: SurfaceFunctions, numbers: Numbers):
        self.functions, self.numbers = functions, numbers

    @property
    def nodes(self) -> list[int]:
        raise NotImplementedError

    def classified(self, inputs: Sequence[Sequence[arb]]) -> Classification:
        """Classify the zero, if both fields are those of the mode there."""
        raise NotImplementedError

    def own(self, inputs: Sequence[Sequence[arb]]) -> bool | None:
        """Whether a zero is a point of this kind, if both fields are those of the mode there."""
        return True

    def classification(self, inputs: Sequence[Sequence[arb]]) -> Classification:
        """Classify the zero enclosed in the inputs."""
        _, why = self._in_mode(inputs)
        why = why and f"The fields were those of other sides: {why}"
        return Classification("", self.kind, why, applies=False) if why else self.classified(inputs)

    def qualifies(self, inputs: Sequence[Sequence[arb]]) -> bool | None:
        """Whether a zero is a point of this kind in this mode; None if undecided."""
        answers = (self._in_mode(inputs)[0], self.own(inputs))
        return False if False in answers else None if None in answers else True

    @cached_property
    def _conditions(self) -> Program:
        return Program(self.functions.graph, [[node for _, node in self.functions.elsewhere]])

    def _in_mode(self, inputs: Sequence[Sequence[arb]]) -> tuple[bool | None, str]:
        """Whether the zero is where the mode's fields apply, and what is not proven of that."""
        if not self.functions.elsewhere:
            return True, ""
        (values,) = self.values(self._conditions, inputs)
        open_ = [
            (v, f"that it is on {name} is not proven, its distance is in {v.str(5)}")
            for (name, _), v in zip(self.functions.elsewhere, values, strict=True)
            if not v > 0
        ]
        if not open_:
            return True, ""
        return (False if any(v < 0 for v, _ in open_) else None), open_[0][1]

    def values(self, program: Program, inputs: Sequence[Sequence[arb]]) -> list[list[arb]]:
        """Enclose a program's values."""
        return program(Enclosures(inputs, self.numbers))


class TwoFolds(PointProblem):
    """h = L1 = L2 = 0."""

    kind = "two-fold"

    @cached_property
    def nodes(self) -> list[int]:
        """h, L1, L2."""
        return [self.functions.h, *self.functions.lie]

    @cached_property
    def _second(self) -> Program:
        return Program(self.functions.graph, [self.functions.second])

    @cached_property
    def difference(self) -> Difference:
        """F1 - F2 with its common factor."""
        d = self.functions
        return Difference(d.graph, d.fields, d.gradient(d.h), self.numbers)

    @cached_property
    def _transverse(self) -> Program:
        return Program(self.functions.graph, [[self.difference.transverse]])

    def classified(self, inputs: Sequence[Sequence[arb]]) -> Classification:
        """Class, by enclosures of the second derivatives; exact algebra for coincident fields."""
        (second,) = self.values(self._second, inputs)
        found, coincident, reason = proven_class(second), False, ""
        if found.numbers and found.numbers["Delta"].contains(0):
            coincident, reason = self._coincident(inputs)
            if coincident:
                found = proven_class(second, coincident=True)
        values = dict(zip(("L11", "L12", "L21", "L22"), second, strict=True)) | found.numbers
        if self.functions.nonlinear:
            why = (
                "the multiplier enters nonlinearly, and the classes are those of Filippov's sliding"
            )
            return Classification("", "two-fold", why, values=values)
        claims = {"sigma": list(found.sigma), "label": found.label, "coincident": coincident}
        if 0 in found.sigma:
            return Classification("", "two-fold", found.why, values=values)
        folds = FOLDS[found.sigma]
        title = {"VV": "visible two-fold", "II": "invisible two-fold"}.get(
            folds, "visible-invisible two-fold"
        )
        lines = [reason] if reason else []
        return Classification(
            found.label, title, found.why, lines + _meaning(found.label), values, claims
        )

    def _coincident(self, inputs: Sequence[Sequence[arb]]) -> tuple[bool, str]:
        difference, program = self.difference, self._transverse
        if difference.identical:
            return True, "F1 = F2 everywhere, so Delta = 0 exactly."
        ((transverse,),) = self.values(program, inputs)
        if not transverse.is_finite() or transverse.contains(0):
            return False, ""
        return True, (
            "F1 = F2 there, so Delta = 0 and nu1 nu2 = -sigma1 sigma2 exactly: F1 - F2 = g G with an "
            f"exact common factor g, and grad h . G in {transverse.str(6)} is not zero, so g is. The "
            "sliding field is smooth through the two-fold."
        )


def _meaning(label: str) -> list[str]:
    row = next((r for r in TABLE if r.label == label), None)
    if row is None:
        return []
    canards = {"none": "none", "one": "one", "all": "infinitely many", "sector": "infinitely many"}
    return [
        f"Canards (Da -> s -> Dr): {canards[row.into]}; faux canards: {canards[row.out_of]}.",
        row.determinism,
    ]


class OfOneField(PointProblem):
    """A problem about F1 or F2."""

    def __init__(self, functions: SurfaceFunctions, numbers: Numbers, side: Side):
        super().__init__(functions, numbers)
        self.side, self._k = side, side_index(side)
        if self.kind == "equilibrium":
            _autonomous(functions, self.kind)


class Folds(OfOneField):
    """h = L_i = 0."""

    kind = "fold"

    @cached_property
    def nodes(self) -> list[int]:
        """h and L_i."""
        return [self.functions.h, self.functions.lie[self._k]]

    @cached_property
    def _test_functions(self) -> Program:
        d, k = self.functions, self._k
        second = d.lie_derivative(k, d.lie[k])
        return Program(d.graph, [[second, d.lie_derivative(k, second), d.lie[1 - k]]])

    def classified(self, inputs: Sequence[Sequence[arb]]) -> Classification:
        """Visible, invisible, or a cusp where L_ii is zero exactly."""
        ((second, third, other),) = self.values(self._test_functions, inputs)
        i, d = self._k + 1, self.functions
        values = {f"L{i}{i}": second, f"L{2 - self._k}": other}
        claims: dict[str, Any] = {"side": self.side}
        s = sign(second)
        if s:
            visible = (s > 0) == (self._k == 0)
            label = "visible" if visible else "invisible"
            title = f"{label} fold of {FIELDS[self.side]}"
            lines = [] if d.nonlinear else [_beside(other, self._k)]
            return Classification(label, title, "", lines, values, claims | {"label": label})
        values |= {f"L{i}{i}{i}": third}
        if second.is_zero() and sign(third):
            claims |= {"label": "cusp"}
            return Classification(
                "cusp", f"cusp of {FIELDS[self.side]}", values=values, claims=claims
            )
        why = f"L{i}{i} in {second.str(5)}: its sign is undecided (a cusp?)"
        return Classification(
            "", f"tangency of {FIELDS[self.side]}", why, values=values, claims=claims
        )


def _beside(other: arb, k: int) -> str:
    """The sliding that begins at a fold, by L of the other field."""
    s = sign(other)
    if s == 0:
        return "The other field's Lie derivative has no proven sign: it may be tangent too."
    sliding = "attracting" if (s > 0) == (k == 0) else "repelling"
    return f"The other field crosses the surface there; {sliding} sliding begins at the fold."


class Equilibria(OfOneField):
    """F_i = 0."""

    kind = "equilibrium"

    @property
    def nodes(self) -> list[int]:
        """The field."""
        return list(self.functions.fields[self._k])

    @cached_property
    def _test_functions(self) -> Program:
        d = self.functions
        return Program(d.graph, [[d.h], *(d.gradient(f) for f in d.fields[self._k])])

    def own(self, inputs: Sequence[Sequence[arb]]) -> bool | None:
        """Whether it is on its field's own side."""
        h = self.values(self._test_functions, inputs)[0][0]
        s = sign(h)
        return None if s == 0 and not h.is_zero() else s == (1, -1)[self._k]

    def classified(self, inputs: Sequence[Sequence[arb]]) -> Classification:
        """Real or virtual, and its kind by the signs of the eigenvalues."""
        (h,), *jacobian = self.values(self._test_functions, inputs)
        kind, why, values = eigenvalue_kind(jacobian)
        own = (1, -1)[self._k]
        status = "boundary" if h.is_zero() else {own: "real", -own: "virtual"}.get(sign(h), "")
        why = why or ("" if status else f"h in {h.str(5)}: the side is undecided")
        label = f"{status} {kind}" if status and kind else ""
        title = f"{label or 'equilibrium'} of {FIELDS[self.side]}"
        claims = {"side": self.side, "label": label}
        return Classification(label, title, why, values={"h": h} | values, claims=claims)


class PseudoEquilibria(PointProblem):
    """h = 0 and (1 + lambda)/2 F1 + (1 - lambda)/2 F2 = 0; lambda is a further unknown."""

    kind = "pseudo-equilibrium"
    further = (("lambda", Fraction(-1), Fraction(1)),)

    def __init__(self, functions: SurfaceFunctions, numbers: Numbers):
        super().__init__(functions, numbers)
        _autonomous(functions, self.kind)
        if functions.nonlinear:
            raise DefinitionError(
                "the multiplier enters nonlinearly (hidden dynamics), but proofs of a pseudo-equilibrium follow "
                "Filippov's convex combination. Give a field that is linear in it."
            )

    @cached_property
    def nodes(self) -> list[int]:
        """h and the convex combination, as mean plus lambda times half the difference."""
        d, graph = self.functions, self.functions.graph
        lam = graph.symbol(2, 0)
        rows = []
        for a, b in zip(*d.fields, strict=True):
            mean = graph.apply("div", [graph.add(a, b), graph.constant(2)])
            half = graph.apply("div", [graph.apply("sub", [a, b]), graph.constant(2)])
            rows.append(graph.add(mean, graph.apply("mul", [lam, half])))
        return [d.h, *rows]

    @cached_property
    def _test_functions(self) -> Program:
        d, graph = self.functions, self.functions.graph
        ratio = graph.apply("div", [d.lie[0], graph.apply("sub", list(d.lie))])
        field = [
            graph.apply("sub", [a, graph.apply("mul", [ratio, graph.apply("sub", [a, b])])])
            for a, b in zip(*d.fields, strict=True)
        ]
        gradient = d.gradient(d.h)
        return Program(graph, [list(d.lie), gradient, *(d.gradient(f) for f in field)])

    def own(self, inputs: Sequence[Sequence[arb]]) -> bool | None:
        """Whether it slides: -1 < lambda < 1."""
        lam = inputs[2][0]
        if lam > -1 and lam < 1:
            return True
        return False if lam < -1 or lam > 1 or lam == 1 or lam == -1 else None

    def classified(self, inputs: Sequence[Sequence[arb]]) -> Classification:
        """Region, and kind along the surface."""
        lie, gradient, *jacobian = self.values(self._test_functions, inputs)
        l1, l2 = map(sign, lie)
        kind, why, values = _along_surface(gradient, jacobian)
        real = self.own(inputs)
        status = {True: "real", False: "virtual", None: ""}[real]
        region = {(-1, 1): "attracting sliding", (1, -1): "repelling sliding"}.get((l1, l2), "")
        if l1 * l2 > 0:
            region = "crossing"
        if not status or not region:
            why = f"lambda in {inputs[2][0].str(5)}, L1 in {lie[0].str(5)}, L2 in {lie[1].str(5)}"
        name = kind.replace("node", "pseudo-node").replace("focus", "pseudo-focus")
        name = name.replace("saddle", "pseudo-saddle")
        label = f"{status} {name}" if status and region and kind else ""
        title = f"{label or 'pseudo-equilibrium'}"
        lines = [f"It lies in {region}."] if region else []
        return Classification(label, title, why, lines, values, {"label": label})


def _along_surface(
    gradient: Sequence[arb], jacobian: Sequence[Sequence[arb]]
) -> tuple[str, str, dict[str, arb]]:
    """Eigenvalues on the tangent space, eliminating one coordinate."""
    n = len(gradient)
    k = max(range(n), key=lambda i: float(gradient[i].abs_lower()))
    if gradient[k].contains(0):
        return "", "grad h is not proven to be nonzero", {}
    rest = [i for i in range(n) if i != k]
    reduced = [
        [jacobian[i][j] - jacobian[i][k] * gradient[j] / gradient[k] for j in rest] for i in rest
    ]
    return eigenvalue_kind(reduced)


def _autonomous(functions: SurfaceFunctions, what: str) -> None:
    if functions.system.time_dependent:
        raise DefinitionError(
            f"the system depends on {functions.system.definition.time}, the time, but a proof of a "
            f"{what} needs an autonomous system. Hold time at a value."
        )


PROBLEMS: Mapping[str, Callable[[SurfaceFunctions, Numbers, Side], PointProblem]] = {
    "two-fold": lambda d, numbers, side: TwoFolds(d, numbers),
    "fold": Folds,
    "equilibrium": Equilibria,
    "pseudo-equilibrium": lambda d, numbers, side: PseudoEquilibria(d, numbers),
}
