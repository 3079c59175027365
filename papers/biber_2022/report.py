"""The report's tables besides the claims: errata, displayed equations, table ics."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from .. import report
from ..claims import Claim
from ..pictures import Picture
from ..report import Section, numbers
from . import errata as all_errata
from .places import equation, readable
from .records import Equation, Erratum
from .table import Row

TITLE = "Biber, Champneys & Szalai (2022), reproduced"
SOURCE = (
    "S. W. Biber, A. R. Champneys and R. Szalai, Analysis of point-contact models of the bounce of "
    "a hard spinning ball on a compliant frictional surface."
)
ERRATUM_HEADER = ("no.", "where", "printed", "correct", "verdict", "computation")
EQUATION_HEADER = ("no.", "equation", "content", "verdict", "erratum", "computation")
TABLE_HEADER = ("surface", "entry", "dimensional", "printed", "computed", "agree")


def summary(
    claims: Sequence[Claim], errata: Sequence[Erratum], equations: Sequence[Equation]
) -> str:
    """One line with the counts."""
    parts = [report.verdicts(claims)]
    parts.append(f"{sum(e.confirmed for e in errata)} of {len(errata)} errata confirmed")
    if equations:
        kinds = Counter(e.verdict for e in equations)
        parts.append(
            f"{len(equations)} displayed equations: "
            + ", ".join(f"{n} {v}" for v, n in kinds.items())
        )
    return "; ".join(parts)


def erratum_rows(errata: Sequence[Erratum]) -> list[list[str]]:
    """Cells of the errata table."""
    return [
        [
            str(e.number),
            readable(e.place),
            e.printed,
            e.correct,
            e.verdict,
            "; ".join(map(str, e.checks)),
        ]
        for e in errata
    ]


def equation_rows(equations: Sequence[Equation], shown: Sequence[Erratum] = ()) -> list[list[str]]:
    """Cells of the equations table; evidence that the errata or a row above show is not repeated."""
    before = {str(check): "" for e in shown for check in e.checks}
    rows = []
    for e in equations:
        evidence = _evidence(e, before)
        rows.append(
            [str(e.number), equation(e.label), e.content, e.verdict, numbers(e.errata), evidence]
        )
        for check in e.checks:
            before.setdefault(str(check), f"see no. {e.number}")
    return rows


def _evidence(e: Equation, before: Mapping[str, str]) -> str:
    """Its checks; of those shown before, where they are."""
    errata = f"see erratum {numbers(e.errata)}" if e.errata else "see the errata"
    told = [before.get(str(check)) for check in e.checks]
    own = [str(check) for check, where in zip(e.checks, told, strict=True) if where is None]
    return "; ".join([*own, *dict.fromkeys(w or errata for w in told if w is not None)])


def opening(errata: Sequence[Erratum]) -> list[tuple[str, list[str]]]:
    """What a reader should know first: what stands, what changes, what is only a slip of print."""
    known = {e.number: e for e in errata}

    def brief(numbers: Sequence[int]) -> list[str]:
        return [
            readable(f"Erratum {n}, {e.place}: printed {e.printed}; correct {e.correct}.")
            for n, e in ((n, known[n]) for n in numbers if n in known)
        ]

    changes = [f"{text} (Erratum {n}.)" for n, text in all_errata.CONCLUSIONS.items() if n in known]
    return [
        ("What stands", list(STANDS)),
        ("Errata that change a statement", changes),
        ("Errata that change a formula or a number", brief(all_errata.FORMULAS)),
        ("Slips of print", brief(all_errata.SLIPS)),
    ]


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


def table_rows(rows: Sequence[Row]) -> list[list[str]]:
    """Cells of table ics."""
    return [
        [
            r.surface,
            r.quantity,
            f"{r.dimensional} {r.unit}",
            r.printed,
            f"{r.computed:.4g}",
            "yes" if r.fits_all else "no",
        ]
        for r in rows
    ]


def build(
    claims: Sequence[Claim],
    errata: Sequence[Erratum],
    equations: Sequence[Equation],
    table: Sequence[Row],
    pictures: Sequence[Picture],
) -> report.Report:
    """Put the report together."""
    places = [replace(c, place=readable(c.place)) for c in claims]
    sections = [
        report.claims_section(places),
        Section(
            "Errata",
            "Each is derived again by code: identities in exact rational arithmetic with free "
            "values and gradients of the paper's functions, numbers by simulation.",
            ERRATUM_HEADER,
            erratum_rows(errata),
        ),
        Section(
            "Displayed equations",
            "All of them in order of appearance, unnumbered ones included. Numbers in brackets are those of the "
            "source on arXiv (2208.11685) when it is compiled.",
            EQUATION_HEADER,
            equation_rows(equations, errata),
        ),
        Section(
            "Table 1",
            "The dimensionless entries recomputed from the dimensional ones: velocity over the "
            "radius 21.35 mm in 1/s, and rad/s. Agree: within the roundings, for one radius near it.",
            TABLE_HEADER,
            table_rows(table),
        ),
    ]
    data = {
        "claims": [c.as_dict() for c in claims],
        "errata": [e.as_dict() for e in errata],
        "equations": [e.as_dict() for e in equations],
    }
    line = summary(claims, errata, equations)
    pictures = [replace(p, label=readable(p.label), caption=readable(p.caption)) for p in pictures]
    sections = [replace(s, rows=[[readable(c) for c in row] for row in s.rows]) for s in sections]
    return report.Report(TITLE, SOURCE, line, sections, pictures, data, opening(errata))
