"""The errata in order, each a function that derives it again.

Numbers 1 to 24 were known before this reproduction; 25 on were found by it.
"""

from __future__ import annotations

from functools import cache, partial

from . import errata_further, errata_general, errata_linear  # noqa: F401, they register their errata
from .records import ERRATA, Erratum

#: Errata that change what the paper states in words, with what a reader should take instead.
CONCLUSIONS = {
    18: "At the two-fold of the ball nu1 nu2 is exactly 1, not a little below: both fields coincide "
    "there, because friction vanishes with the load. The conclusion drawn from it stands: "
    "rolling passes through the two-fold along one orbit only.",
    19: "The two-fold is visible only under a condition, which stiff tangential surfaces and Hertzian "
    "laws with little gravity break. Where it does not hold, no rolling orbit reaches it.",
    20: "The dividing surface separates forward from reverse slip. It does not separate topspin from "
    "backspin: a ball may leave in reverse slip with backspin.",
    12: "Rolling can end in compression too, where the tangential surface is stiff.",
    13: "It is compliance along the ground that makes the ball lift off slipping, not compliance "
    "across it.",
    14: "A ball without spin and damping retraces its path only if there is no friction.",
    24: "nu1 nu2 = 1 holds for every compliance, not only in the rigid limit, and the nonsmooth "
    "diabolo belongs to invisible two-folds, so not to this ball.",
    3: "d2 < 1 is sufficient for lift-off and not necessary.",
}

#: Errata of formulas and numbers that one would compute with.
FORMULAS = (2, 4, 6, 7, 9, 10, 11, 15, 17, 21, 23, 28)

#: Slips of print: what is meant is clear from the text, and nothing is computed from what is printed.
SLIPS = (1, 5, 8, 16, 22, 25, 26, 27, 29)


@cache
def erratum(number: str) -> Erratum:
    """Derive one erratum (computed once)."""
    result = ERRATA.computed[number]()
    assert isinstance(result, Erratum)
    return result


ROWS = tuple(partial(erratum, number) for number in ERRATA.cells)

#: What of the paper holds as it is.
STANDS = (
    "A ball that rolls during the bounce lifts off slipping, but for a set of landings of codimension "
    "one: rolling lift-off is a two-fold, and a single rolling orbit reaches it.",
    "Compliance and damping along the ground let the slip reverse; rigid laws do not.",
    "A surface of codimension one divides the landings that leave in forward slip from those that "
    "leave in reverse. It has a second part, which the paper does not mention, where the ball slips "
    "throughout.",
    "Not checked: the measurements, which are not public, and the parameters of Fig. 10, which are not "
    "printed.",
)


def opening() -> list[tuple[str, list[str]]]:
    """What to read first: what stands, what changes, what is a slip of print."""
    found = [compute() for compute in ROWS]
    brief = [
        f"Erratum {e.number}, {e.place}: printed {e.printed}; correct {e.correct}." for e in found
    ]
    changes = [f"{text} (Erratum {number}.)" for number, text in CONCLUSIONS.items()]
    return [
        ("What stands", list(STANDS)),
        ("Errata that change a statement", changes),
        ("Errata that change a formula or a number", [brief[n - 1] for n in FORMULAS]),
        ("Slips of print", [brief[n - 1] for n in SLIPS]),
    ]
