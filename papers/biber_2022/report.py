"""Tables and the report: what was computed, as Markdown, CSV, JSON and one HTML page."""

from __future__ import annotations

import base64
import csv
import html
import json
import textwrap
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from .figures import Picture
from .records import Claim, Equation, Erratum
from .table import Row

TITLE = "Biber, Champneys & Szalai (2022), reproduced"
SOURCE = (
    "S. W. Biber, A. R. Champneys and R. Szalai, Analysis of point-contact models of the bounce of "
    "a hard spinning ball on a compliant frictional surface."
)
_SYMBOLS = {"|": r"\|", "\n": " "}


def numbers(errata: Sequence[int]) -> str:
    """Format erratum numbers."""
    return ", ".join(map(str, errata))


def claims_text(claims: Sequence[Claim], width: int = 100) -> str:
    """Table of the claims for a terminal."""
    lines = [f"{'claim':28}{'verdict':16}{'erratum':9}what was computed", "-" * width]
    for c in claims:
        verdict = c.verdict if c.holds else "CHECK FAILS"
        body = textwrap.wrap(c.value, width - 53) or [""]
        lines.append(f"{c.id:28}{verdict:16}{numbers(c.errata):9}{body[0]}")
        lines += [" " * 53 + line for line in body[1:]]
    return "\n".join(lines)


def summary(
    claims: Sequence[Claim], errata: Sequence[Erratum], equations: Sequence[Equation]
) -> str:
    """One line with the counts."""
    verdicts = Counter(c.verdict for c in claims)
    parts = [f"{len(claims)} claims: " + ", ".join(f"{n} {v}" for v, n in verdicts.items())]
    parts.append(f"{sum(e.confirmed for e in errata)} of {len(errata)} errata confirmed")
    if equations:
        kinds = Counter(e.verdict for e in equations)
        parts.append(
            f"{len(equations)} displayed equations: "
            + ", ".join(f"{n} {v}" for v, n in kinds.items())
        )
    return "; ".join(parts)


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(_escape(c) for c in cells) + " |"

    return "\n".join([line(header), "|" + "---|" * len(header), *map(line, rows)])


def _escape(text: str) -> str:
    for old, new in _SYMBOLS.items():
        text = text.replace(old, new)
    return text


CLAIM_HEADER = ("claim", "where", "the paper", "computed here", "verdict", "erratum", "how")
ERRATUM_HEADER = ("no.", "where", "printed", "correct", "verdict", "computation")
EQUATION_HEADER = ("no.", "equation", "content", "verdict", "erratum", "computation")
TABLE_HEADER = ("surface", "entry", "dimensional", "printed", "computed", "agree")


def claim_rows(claims: Sequence[Claim]) -> list[list[str]]:
    """Cells of the claims table."""
    return [
        [c.id, c.place, c.statement, c.value, c.verdict, numbers(c.errata), c.how] for c in claims
    ]


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


Section = tuple[str, str, Sequence[str], list[list[str]]]


def sections(
    claims: Sequence[Claim],
    errata: Sequence[Erratum],
    equations: Sequence[Equation],
    table: Sequence[Row],
) -> list[Section]:
    """Title, introduction, header and rows of each table of the report."""
    return [
        (
            "Claims",
            "What the paper states and what computing it gives. A row holds only if all of its "
            "checks do.",
            CLAIM_HEADER,
            claim_rows(claims),
        ),
        (
            "Errata",
            "Each is derived again by code: identities in exact rational arithmetic with free "
            "values and gradients of the paper's functions, numbers by simulation.",
            ERRATUM_HEADER,
            erratum_rows(errata),
        ),
        (
            "Displayed equations",
            "All of them in order of appearance, unnumbered ones included.",
            EQUATION_HEADER,
            equation_rows(equations),
        ),
        (
            "Table ics",
            "The dimensionless entries recomputed from the dimensional ones: velocity over the "
            "radius 21.35 mm in 1/s, and rad/s. Agree: within the roundings, for one radius near it.",
            TABLE_HEADER,
            table_rows(table),
        ),
    ]


def markdown(parts: Sequence[Section], pictures: Sequence[Picture], line: str) -> str:
    """The report as Markdown; figures by relative links."""
    text = [f"# {TITLE}", SOURCE, line + "."]
    for title, introduction, header, rows in parts:
        if rows:
            text += [f"## {title}", introduction, _table(header, rows)]
    text.append("## Figures")
    for p in pictures:
        text += [f"### {p.label}", f"![{p.label}]({p.name}.png)", p.caption]
    return "\n\n".join(text) + "\n"


_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;max-width:76rem;margin:2rem auto;padding:0 1rem;color:#111}
table{border-collapse:collapse;width:100%;font-size:13px}
th,td{border-bottom:1px solid #ccc;padding:.35rem .5rem;text-align:left;vertical-align:top}
th{position:sticky;top:0;background:#f4f4f4}
figure{margin:1.5rem 0}figure img{max-width:100%;height:auto}figcaption{max-width:48rem}
.grid{display:grid;grid-template-columns:repeat(auto-fit,minmax(26rem,1fr));gap:1rem}
td.corrected,td.no{color:#a33b00;font-weight:600}td.agrees,td.confirmed{color:#005a8c}
"""


def page(parts: Sequence[Section], pictures: Sequence[Picture], line: str, folder: Path) -> str:
    """The report as one HTML page with embedded figures; opens offline."""
    out = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>"
        f"<title>{TITLE}</title><style>{_STYLE}</style></head><body>",
        f"<h1>{TITLE}</h1><p>{SOURCE}</p><p><b>{html.escape(line)}.</b></p>",
    ]
    for title, introduction, header, rows in parts:
        if not rows:
            continue
        out.append(f"<h2>{title}</h2><p>{introduction}</p><table><tr>")
        out += [f"<th>{html.escape(h)}</th>" for h in header]
        for row in rows:
            cells = "".join(
                f"<td class='{html.escape(c)}'>{html.escape(c)}</td>"
                if c in ("agrees", "corrected", "confirmed", "no")
                else f"<td>{html.escape(c)}</td>"
                for c in row
            )
            out.append(f"</tr><tr>{cells}")
        out.append("</tr></table>")
    out.append("<h2>Figures</h2><div class='grid'>")
    for p in pictures:
        image = base64.b64encode((folder / f"{p.name}.png").read_bytes()).decode()
        out.append(
            f"<figure><img alt='{html.escape(p.label)}' src='data:image/png;base64,{image}'>"
            f"<figcaption><b>{html.escape(p.label)}.</b> {html.escape(p.caption)}</figcaption>"
            "</figure>"
        )
    return "\n".join([*out, "</div></body></html>"]) + "\n"


def write(
    folder: Path,
    claims: Sequence[Claim],
    errata: Sequence[Erratum],
    equations: Sequence[Equation],
    table: Sequence[Row],
    pictures: Sequence[Picture],
) -> list[Path]:
    """Write claims.md/.csv/.json, report.md and report.html; the figures must be there.

    Returns
    -------
    list of Path
    """
    line = summary(claims, errata, equations)
    parts = sections(claims, errata, equations, table)
    data = {
        "claims": [c.as_dict() for c in claims],
        "errata": [e.as_dict() for e in errata],
        "equations": [e.as_dict() for e in equations],
    }
    files = {
        "claims.md": _table(CLAIM_HEADER, claim_rows(claims)) + "\n",
        "claims.json": json.dumps(data, indent=1) + "\n",
        "report.md": markdown(parts, pictures, line),
        "report.html": page(parts, pictures, line, folder),
    }
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    with (folder / "claims.csv").open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows([CLAIM_HEADER, *claim_rows(claims)])
    return [folder / name for name in (*files, "claims.csv")]


def readme_table(claims: Sequence[Claim]) -> str:
    """Return the claims table of README.md: nothing in it depends on rounding."""
    rows = [[c.id, c.place, c.statement, c.verdict, numbers(c.errata)] for c in claims]
    return _table(("claim", "where", "the paper", "verdict", "erratum"), rows)
