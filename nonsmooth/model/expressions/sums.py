"""Sums of products as one Taylor rule each, which costs less than a rule for each operation.

A ``sum`` has pairs of rules as arguments and a number for each pair: what these three are multiplied to is added, from
left to right. Rule 0 is the constant one. All operations are those of the rules that are joined, in their order, so
that every coefficient has the same rounding.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import accumulate, chain

from .graph import reached
from .long_sums import LongSums
from .taylor_rules import Rule

#: A number and two rules, of which ``_ONE`` is none.
_Term = tuple[float, int, int]
_ONE = -1


def summed(
    rules: Sequence[Rule], rows: Sequence[Sequence[int]]
) -> tuple[list[Rule], list[list[int]]]:
    """Write the rules that rows of outputs need with sums, and the rows with them."""
    roots = [j for row in rows for j in row]
    kept = reached([rule.args for rule in rules], [True] * len(rules), roots)
    joining = _Joining(rules, Counter([*roots, *(a for j in kept for a in rules[j].args)]))
    for j in kept:
        joining.add(j)
    sums = joining.sums
    args: list[Sequence[int]] = [rule.args for rule in rules]
    for j, terms in sums.items():
        args[j] = [a for _, *pair in terms for a in pair]
    known = [[a for a in own if a != _ONE] for own in args]
    kept = reached(known, [True] * len(rules), roots)
    number = {_ONE: 0, **{j: k + 1 for k, j in enumerate(kept)}}
    made = [Rule("constant", numbers=(1.0,))]
    for j in kept:
        own, new = rules[j], tuple(number[a] for a in args[j])
        if j in sums:
            made.append(Rule("sum", new, numbers=tuple(f for f, _, _ in sums[j])))
        else:
            made.append(Rule(own.rule, new, own.operation, own.numbers, own.source))
    return made, [[number[j] for j in row] for row in rows]


class _Joining:
    """Terms of the rules that are sums, so far."""

    def __init__(self, rules: Sequence[Rule], users: Counter[int]):
        self.rules, self.users = rules, users
        self.sums: dict[int, list[_Term]] = {}

    def add(self, j: int) -> None:
        """Join a rule with those that nothing else needs."""
        rule = self.rules[j]
        if rule.rule in ("add", "sub"):
            terms = self._whole(rule.args[0])
            terms += _times(self._single(rule.args[1]), -1.0 if rule.rule == "sub" else 1.0)
            self.sums[j] = terms
        elif rule.rule in ("neg", "twice"):
            self.sums[j] = _times(self._whole(rule.args[0]), -1.0 if rule.rule == "neg" else 2.0)
        elif rule.rule == "affine":
            offset, factor = rule.numbers
            constant = [(offset, _ONE, _ONE)] if offset else []
            self.sums[j] = self._scaled(factor, rule.args[0]) + constant
        elif rule.rule in ("mul", "sq"):
            self.sums[j] = self._product(rule.args[0], rule.args[-1])

    def _whole(self, a: int) -> list[_Term]:
        """Terms of a rule that is added first, to be changed."""
        if a in self.sums and self.users[a] == 1:
            return self.sums.pop(a)
        return self._single(a)

    def _single(self, a: int) -> list[_Term]:
        """Terms of a rule that is added later: its own sum would lose digits."""
        if self.rules[a].rule == "constant":
            return [(self.rules[a].numbers[0], _ONE, _ONE)]
        found = self.sums[a] if a in self.sums and self.users[a] == 1 else ()
        return [*found] if len(found) == 1 else [(1.0, a, _ONE)]

    def _scaled(self, factor: float, a: int) -> list[_Term]:
        own = self._single(a)
        return _times(own, factor) if 1.0 in (abs(own[0][0]), abs(factor)) else [(factor, a, _ONE)]

    def _product(self, a: int, b: int) -> list[_Term]:
        for one, two in ((a, b), (b, a)):
            if self.rules[one].rule == "constant":
                return self._scaled(self.rules[one].numbers[0], two)
        (f, one, x), (g, two, y) = self._single(a)[0], self._single(b)[0]
        if x != _ONE or abs(f) != 1.0:
            f, one = 1.0, a
        if y != _ONE or abs(g) != 1.0:
            g, two = 1.0, b
        return [(f * g, one, two)]


def _times(terms: Sequence[_Term], factor: float) -> list[_Term]:
    return [(factor * own, a, b) for own, a, b in terms]


# Long sums ----------------------------------------------------------------------------------------


def _is_long(rule: Rule, first: int) -> bool:
    """Whether a rule is the input that stands for a long sum."""
    return rule.rule == "input" and rule.source[0] == 0 and rule.source[1] >= first


def with_long_sums(
    rules: Sequence[Rule], rows: Sequence[Sequence[int]], sums: LongSums, first: int
) -> list[Rule]:
    """Rules with long sums in place of their inputs, from ``first`` on, of terms in the first row."""
    made, terms = [*rules], rows[0]
    known = {j: rule.source[1] - first for j, rule in enumerate(rules) if _is_long(rule, first)}
    users = Counter(a for rule in rules for a in rule.args if a in known)
    users.update(j for row in rows for j in row if j in known)
    own = {j: [(terms[k], 0) for k in sums.places[i].tolist()] for j, i in known.items()}
    for j, i in known.items():
        made[j] = Rule(
            "sum", tuple(chain.from_iterable(own[j])), numbers=tuple(sums.factors[i].tolist())
        )
    for k, rule in enumerate(rules):
        if rule.rule != "sum" or users.keys().isdisjoint(rule.args):
            continue
        pairs, numbers = list[tuple[int, int]](), list[float]()
        for factor, a, b in zip(rule.numbers, rule.args[::2], rule.args[1::2], strict=True):
            if a in known and b == 0 and users[a] == 1 and abs(factor) == 1.0:
                pairs += own[a]
                numbers += (factor * sums.factors[known[a]]).tolist()
                made[a] = Rule("constant", numbers=(0.0,))
            else:
                pairs.append((a, b))
                numbers.append(factor)
        made[k] = Rule("sum", tuple(chain.from_iterable(pairs)), numbers=tuple(numbers))
    return made


def written_out(
    rules: Sequence[Rule], rows: Sequence[Sequence[int]], sums: LongSums, first: int
) -> tuple[list[Rule], list[list[int]]]:
    """Plain rules with products and additions in place of the inputs that stand for long sums."""
    sizes = [
        3 * len(sums.places[r.source[1] - first]) - 1 if _is_long(r, first) else 1 for r in rules
    ]
    number, made = [end - 1 for end in accumulate(sizes)], list[Rule]()
    terms = [number[j] for j in rows[0]]
    for rule in rules:
        if not _is_long(rule, first):
            made.append(rule._replace(args=tuple(number[a] for a in rule.args)))
            continue
        i, total = rule.source[1] - first, -1
        for factor, k in zip(sums.factors[i].tolist(), sums.places[i].tolist(), strict=True):
            at = len(made)
            made += [Rule("constant", numbers=(factor,)), Rule("mul", (at, terms[k]))]
            if total >= 0:
                made.append(Rule("add", (total, at + 1)))
            total = len(made) - 1
    return made, [[number[j] for j in row] for row in rows[1:]]
