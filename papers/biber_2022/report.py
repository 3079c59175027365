"""The report's tables besides the claims: errata, displayed equations, table ics."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from .. import report
from ..claims import Claim
from ..pictures import Picture
from ..report import Section, numbers
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
        [str(e.number), e.place, e.printed, e.correct, e.verdict, "; ".join(map(str, e.checks))]
        for e in errata
    ]


def equation_rows(equations: Sequence[Equation]) -> list[list[str]]:
    """Cells of the equations table."""
    return [
        [
            str(e.number),
            e.label,
            e.content,
            e.verdict,
            numbers(e.errata),
            "; ".join(map(str, e.checks)),
        ]
        for e in equations
    ]


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
    sections = [
        report.claims_section(claims),
        Section(
            "Errata",
            "Each is derived again by code: identities in exact rational arithmetic with free "
            "values and gradients of the paper's functions, numbers by simulation.",
            ERRATUM_HEADER,
            erratum_rows(errata),
        ),
        Section(
            "Displayed equations",
            "All of them in order of appearance, unnumbered ones included.",
            EQUATION_HEADER,
            equation_rows(equations),
        ),
        Section(
            "Table ics",
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
    return report.Report(TITLE, SOURCE, line, sections, pictures, data)
