"""The record of a paper: its claims and figures as one Markdown page, which the documentation typesets."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from .claims import Row, Statements
from .pictures import Picture

CLAIMS = ("claim", "where", "statement", "computed here", "verdict", "how")

#: Of papers that were not read.
FROM_MEMORY = (
    "Statements, notation and parameters are quoted from memory; the paper was not at hand, so this is a "
    "model after it and no reproduction of it."
)


@dataclass(frozen=True)
class Table:
    """A table, a function for each row; ``evidence``: its last column has the checks not shown above."""

    title: str
    introduction: str
    header: tuple[str, ...]
    rows: tuple[Callable[[], Row], ...]
    evidence: bool = False


@dataclass(frozen=True)
class Paper:
    """What ``python -m papers`` needs of a paper; ``opening`` has headings with what to read first."""

    name: str
    title: str
    source: str
    tables: tuple[Table, ...]
    pictures: tuple[Picture, ...]
    opening: Callable[[], Sequence[tuple[str, Sequence[str]]]] = tuple


def claims(statements: Statements) -> Table:
    """The table of the claims of a paper."""
    introduction = "What is stated and what computing it gives. A claim holds if all its checks do."
    return Table("Claims", introduction, CLAIMS, statements.rows)


@dataclass
class Done:
    """What has been computed of a paper: rows by the title of their table, and figures drawn."""

    paper: Paper
    rows: dict[str, list[Row]] = field(default_factory=dict)
    pictures: list[Picture] = field(default_factory=list)

    def summary(self) -> str:
        """One line with the number of rows and of each verdict."""
        parts = []
        for title, rows in self.rows.items():
            counts = Counter(row.verdict for row in rows)
            verdicts = ", ".join(f"{n} {verdict}" for verdict, n in counts.items())
            parts.append(f"{len(rows)} {title.lower()}: {verdicts}")
        return "; ".join([*parts, f"{len(self.pictures)} figures"])

    def markdown(self) -> str:
        """The record: what to read first, figures by relative links, tables."""
        text = [f"# {self.paper.title}", self.paper.source, self.summary() + "."]
        for title, items in self.paper.opening():
            text += [f"## {title}", "\n".join(f"- {item}" for item in items)]
        text.append("## Figures")
        for picture in self.pictures:
            text += [f"### {picture.label}", f"![{picture.label}]({picture.name}.png)"]
            text.append(picture.caption)
        shown = set[str]()
        for part in self.paper.tables:
            rows = []
            for row in self.rows.get(part.title, []):
                new = [str(c) for c in row.checks if str(c) not in shown]
                evidence = "; ".join(new) or ("shown above" if row.checks else "")
                rows.append([*row.cells(), *([evidence] if part.evidence else [])])
                shown.update(new if part.evidence else [])
            header = [*part.header, *(["computation"] if part.evidence else [])]
            text += [f"## {part.title}", part.introduction, markdown_table(header, rows)]
        return "\n\n".join(text) + "\n"


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Lay out a Markdown table."""
    lines = [header, ["---"] * len(header), *([c.replace("|", r"\|") for c in row] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
