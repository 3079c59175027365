"""The surfaces found while an expression is lifted: one for each zero set, whatever it came from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import casadi as ca

from ..errors import DefinitionError, explain
from ..expressions.cancel import Sum, normal_forms, simple_zeros

_ROUNDING = 16 * 2.220446049250313e-16


@dataclass(frozen=True)
class LiftedSwitch:
    """A surface that was found in an expression."""

    surface: str
    multiplier: str
    function: str
    origins: tuple[str, ...]
    hidden: bool = False

    def __str__(self) -> str:
        note = "; other readings on the surface: hidden dynamics" if self.hidden else ""
        return f"{self.surface} = {self.function} ({', '.join(self.origins)}){note}"


@dataclass
class Switch:
    """A surface under construction."""

    # ``even`` is the multiplier inside continuous switches, where it makes no difference on h = 0; it
    # becomes ``lam`` at the end.

    h: ca.SX
    lam: ca.SX
    even: ca.SX
    origins: list[str] = field(default_factory=list)
    hidden: bool = False


class Switches:
    """Surfaces with their multipliers, in the order in which they are found."""

    def __init__(self, states: ca.SX, inputs: list[ca.SX]):
        self.states, self.inputs = states, inputs
        self.all: list[Switch] = []
        names = {str(s) for s in ca.vertsplit(ca.vertcat(*inputs))}
        self.prefix = next(p for p in _prefixes() if not any(n.startswith(p) for n in names))

    def __getitem__(self, number: int) -> Switch:
        return self.all[number]

    def find(self, h: ca.SX, origin: str) -> tuple[int | None, int]:
        """Return the number of the surface h = 0 and the sign by which h differs from its
        function."""
        # The number is None where h is a constant; then the sign is that of h.
        h = simple_zeros(h, *self.inputs)
        forms = self._forms([h, *(s.h for s in self.all)])
        if all(monomial == () for monomial in forms[0]):
            c = forms[0].get((), 0.0)
            return None, int(c > 0) - int(c < 0)
        for i, form in enumerate(forms[1:]):
            ratio = _ratio([forms[0], form])
            if ratio:
                if origin not in self.all[i].origins:
                    self.all[i].origins.append(origin)
                return i, 1 if ratio > 0 else -1
        if not ca.depends_on(h, self.states):
            raise DefinitionError(
                explain(
                    "a switch",
                    expected="one that depends on the states",
                    received=f"{origin} of {h}, which is known beforehand",
                    advice="Make the clock a state with derivative 1, and switch on that.",
                )
            )
        k = len(self.all)
        lam, even = ca.SX.sym(f"{self.prefix}{k}"), ca.SX.sym(f"{self.prefix}{k}_even")
        self.all.append(Switch(h, lam, even, [origin]))
        return k, 1

    def _forms(self, expressions: list[ca.SX]) -> list[Sum]:
        return [row[0] for row in normal_forms(self.inputs, expressions)[1]]

    def report(self, f: ca.SX) -> tuple[list[Switch], tuple[LiftedSwitch, ...]]:
        """Return the switches that a field has, in the order of their states, and what they are."""
        kept = [s for s in self.all if ca.depends_on(f, s.lam)]
        kept.sort(key=lambda s: self._states_of(s.h))
        told = tuple(
            LiftedSwitch(f"h{i}", str(s.lam), str(s.h), tuple(sorted(s.origins)), s.hidden)
            for i, s in enumerate(kept)
        )
        return kept, told

    def _states_of(self, h: ca.SX) -> tuple[int, ...]:
        return tuple(i for i in range(self.states.numel()) if ca.depends_on(h, self.states[i]))


def _prefixes() -> Iterator[str]:
    return ("lam" + "_" * k for k in range(100))


def _ratio(forms: Sequence[Sum]) -> float:
    """Return c with forms[0] = c forms[1], or 0 if they are not proportional."""
    first, second = forms
    if first.keys() != second.keys():
        return 0.0
    ratios = [first[monomial] / second[monomial] for monomial in first]
    c = ratios[0]
    return c if all(abs(r - c) <= _ROUNDING * abs(c) for r in ratios) else 0.0
