"""Tables and the report of a paper: Markdown, CSV, JSON and one HTML page that opens offline."""

from __future__ import annotations

import base64
import csv
import html
import json
import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .claims import NOT_CHECKABLE, READ, Claim
from .mathematics import typeset
from .pictures import Picture

CLAIM_HEADER = ("claim", "where", "the paper", "computed here", "verdict", "erratum", "how")
MODEL_HEADER = ("claim", "basis", "where", "statement", "computed here", "verdict", "how")
CLAIMS_INTRODUCTION = (
    "What the paper states and what computing it gives. A row holds only if all of its checks do."
)
MODEL_INTRODUCTION = (
    "What is said of the model and what computing it gives. The basis of a statement is what we know "
    "from memory of the paper, or this computation. A row holds only if all of its checks do."
)
_SYMBOLS = {"|": r"\|", "\n": " "}


@dataclass(frozen=True)
class Section:
    """A table of the report.

    Attributes
    ----------
    title, introduction : str
    header : sequence of str
    rows : list of list of str
    """

    title: str
    introduction: str
    header: Sequence[str]
    rows: list[list[str]]


def numbers(errata: Sequence[int]) -> str:
    """Format erratum numbers."""
    return ", ".join(map(str, errata))


def has_errata(claims: Sequence[Claim]) -> bool:
    """Whether any claim names an erratum; without one the tables have no such column."""
    return any(c.errata for c in claims)


def _kept(cells: Sequence[str], claims: Sequence[Claim], column: int) -> list[str]:
    return [c for k, c in enumerate(cells) if has_errata(claims) or k != column]


def claims_text(claims: Sequence[Claim], width: int = 100) -> str:
    """Table of the claims for a terminal."""
    errata = 9 if has_errata(claims) else 0  # width of that column
    word = f"{'erratum':9}" if errata else ""
    lines = [f"{'claim':28}{'verdict':16}{word}what was computed"]
    lines.append("-" * width)
    for c in claims:
        verdict = c.verdict if c.holds else "CHECK FAILS"
        body = textwrap.wrap(c.value, width - 44 - errata) or [""]
        number = f"{numbers(c.errata):9}" if errata else ""
        lines.append(f"{c.id:28}{verdict:16}{number}{body[0]}")
        lines += [" " * (44 + errata) + line for line in body[1:]]
    return "\n".join(lines)


def was_read(claims: Sequence[Claim]) -> bool:
    """Whether the statements are a paper's own, and not from memory or of this computation."""
    return all(c.basis == READ for c in claims)


def verdicts(claims: Sequence[Claim]) -> str:
    """How many claims there are of each verdict, or of each basis where the paper was not read."""
    if not was_read(claims):
        counts = Counter(c.basis for c in claims)
        parts = ", ".join(f"{n} {basis}" for basis, n in counts.items())
        ends = Counter(
            NOT_CHECKABLE if c.verdict == NOT_CHECKABLE else "hold" for c in claims if c.holds
        )
        results = ", ".join(f"{n} {end}" for end, n in ends.items())
        return f"{len(claims)} statements: {parts}; {results}"
    counts = Counter(c.verdict for c in claims)
    return f"{len(claims)} claims: " + ", ".join(f"{n} {v}" for v, n in counts.items())


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Format a Markdown table."""

    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(_escape(c) for c in cells) + " |"

    return "\n".join([line(header), "|" + "---|" * len(header), *map(line, rows)])


def _escape(text: str) -> str:
    for old, new in _SYMBOLS.items():
        text = text.replace(old, new)
    return text


def claims_section(claims: Sequence[Claim], introduction: str = "") -> Section:
    """Return the table of the claims."""
    if not was_read(claims):
        rows = [[c.id, c.basis, c.where, c.statement, c.value, c.verdict, c.how] for c in claims]
        return Section("Statements", introduction or MODEL_INTRODUCTION, MODEL_HEADER, rows)
    rows = [
        [c.id, c.place, c.statement, c.value, c.verdict, numbers(c.errata), c.how] for c in claims
    ]
    kept = [_kept(row, claims, 5) for row in rows]
    return Section(
        "Claims", introduction or CLAIMS_INTRODUCTION, _kept(CLAIM_HEADER, claims, 5), kept
    )


def readme_table(claims: Sequence[Claim]) -> str:
    """Return the claims table of README.md: nothing in it depends on rounding."""
    if not was_read(claims):
        rows = [[c.id, c.basis, c.where, c.statement, c.verdict] for c in claims]
        return table(("claim", "basis", "where", "statement", "verdict"), rows)
    header = ("claim", "where", "the paper", "verdict", "erratum")
    rows = [[c.id, c.place, c.statement, c.verdict, numbers(c.errata)] for c in claims]
    return table(_kept(header, claims, 4), [_kept(row, claims, 4) for row in rows])


@dataclass(frozen=True)
class Report:
    """What is written about a paper.

    Attributes
    ----------
    title, source : str
    summary : str
        One line with the counts.
    sections : list of Section
        The claims first.
    pictures : sequence of Picture
    data : mapping
        For ``claims.json``.
    opening : sequence of (str, sequence of str)
        What a reader should know first: headings with their items.
    """

    title: str
    source: str
    summary: str
    sections: list[Section]
    pictures: Sequence[Picture]
    data: Mapping[str, Any]
    opening: Sequence[tuple[str, Sequence[str]]] = ()

    def markdown(self) -> str:
        """The report as Markdown; figures by relative links."""
        text = [f"# {self.title}", self.source, self.summary + "."]
        for title, items in self.opening:
            text += [f"## {title}", "\n".join(f"- {item}" for item in items)]
        text.append("## Figures")
        for p in self.pictures:
            text += [f"### {p.label}", f"![{p.label}]({p.name}.png)", p.caption]
        for part in self.sections:
            if part.rows:
                text += [f"## {part.title}", part.introduction, table(part.header, part.rows)]
        return "\n\n".join(text) + "\n"

    def page(self, folder: Path) -> str:
        """The report as one HTML page with embedded figures: opening, figures, tables."""
        title = html.escape(self.title)
        out = [
            "<!doctype html><html lang='en'><head><meta charset='utf-8'>"
            "<meta name='viewport' content='width=device-width, initial-scale=1'>"
            f"<title>{title}</title><style>{_STYLE}</style></head><body>",
            f"<h1>{title}</h1><p>{html.escape(self.source)}</p>"
            f"<p><b>{html.escape(self.summary)}.</b></p>",
        ]
        for heading, items in self.opening:
            listed = "".join(f"<li>{typeset(item)}</li>" for item in items)
            out.append(f"<h2>{html.escape(heading)}</h2><ul>{listed}</ul>")
        out += self._figures(folder)
        for part in self.sections:
            if part.rows:
                out.append(_table(part))
        return "\n".join([*out, "</body></html>"]) + "\n"

    def _figures(self, folder: Path) -> list[str]:
        out = ["<h2>Figures</h2><div class='grid'>"]
        for p in self.pictures:
            image = base64.b64encode((folder / f"{p.name}.png").read_bytes()).decode()
            out.append(
                f"<figure><img alt='{html.escape(p.label)}' src='data:image/png;base64,{image}'>"
                f"<figcaption><b>{html.escape(p.label)}.</b> {typeset(p.caption)}</figcaption>"
                "</figure>"
            )
        return [*out, "</div>"]

    def write(self, folder: Path) -> list[Path]:
        """Write claims.md/.csv/.json, report.md and report.html; the figures must be there.

        Returns
        -------
        list of Path
        """
        claims = self.sections[0]
        files = {
            "claims.md": table(claims.header, claims.rows) + "\n",
            "claims.json": json.dumps(dict(self.data), indent=1) + "\n",
            "report.md": self.markdown(),
            "report.html": self.page(folder),
        }
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8")
        with (folder / "claims.csv").open("w", newline="", encoding="utf-8") as stream:
            csv.writer(stream).writerows([claims.header, *claims.rows])
        return [folder / name for name in (*files, "claims.csv")]


def _table(part: Section) -> str:
    head = "".join(f"<th>{html.escape(h)}</th>" for h in part.header)
    rows = (
        "<tr>" + "".join(_cell(text, name) for text, name in zip(row, part.header, strict=True))
        for row in part.rows
    )
    body = "</tr>".join(rows)
    return (
        f"<h2>{part.title}</h2><p>{typeset(part.introduction)}</p>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tr></tbody></table>"
    )


def _cell(text: str, column: str) -> str:
    marked = text in ("agrees", "corrected", "confirmed", "holds", "no")
    whole = "word" if marked or column == "verdict" else ""  # not broken in a narrow column
    names = " ".join(name for name in (text if marked else "", whole) if name)
    name = f" class='{names}'" if names else ""
    return f"<td{name} data-label='{html.escape(column)}'>{typeset(text)}</td>"


_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;max-width:76rem;margin:2rem auto;padding:0 1rem;color:#111;
overflow-wrap:break-word}
math{font-family:"STIX Two Math","Latin Modern Math","Cambria Math",math,serif;font-size:1.05em}
table{border-collapse:collapse;width:100%;font-size:13px}
th,td{border-bottom:1px solid #ccc;padding:.35rem .5rem;text-align:left;vertical-align:top;min-width:4.5em}
th{position:sticky;top:0;background:#f4f4f4}
li,figcaption,td{overflow-wrap:anywhere}td.word{overflow-wrap:normal}li{max-width:52rem;margin:.3rem 0}
figure{margin:1.5rem 0}figure img{max-width:100%;height:auto}figcaption{max-width:48rem}
.grid{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(26rem,100%),1fr));gap:1rem}
td.corrected,td.no{color:#a33b00;font-weight:600}td.agrees,td.confirmed,td.holds{color:#005a8c}
@media(max-width:44rem){thead{position:absolute;width:1px;height:1px;overflow:hidden;
clip-path:inset(50%)}table,tbody,tr,td{display:block}tr{border-top:2px solid #ccc;padding:.3rem 0}
td{border:0;padding:.15rem 0;overflow-x:auto}td:empty{display:none}
td::before{content:attr(data-label)": ";color:#666;font-weight:400}}
"""
