"""Pages of the site that are kept elsewhere in the repository: changelog, citation, benchmarks, papers.

They are read from where they are and only their links are changed, so there is one of each.
"""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAPERS = (
    "biber_2022",
    "jeffrey_colombo_2009",
    "colombo_jeffrey_2011",
    "kuznetsov_2003",
    "welander_1982",
)


def text_of(path: str) -> str:
    """Text of a file of the repository."""
    return (ROOT / path).read_text(encoding="utf-8")


def pages() -> dict[str, str]:
    """Return the pages by their address."""
    found = {
        "changelog.md": text_of("CHANGELOG.md"),
        "benchmarks.md": benchmarks(),
        "testset.md": text_of("testset/README.md"),
        "cite.md": cite(),
    }
    for name in PAPERS:
        found[f"papers/{name}.md"] = paper(name)
    return {uri: _without_comments(text) for uri, text in found.items()}


def pictures() -> dict[str, Path]:
    """Pictures of those pages, by their address; those of papers as `make reproduce` drew them."""
    found = {"work_precision.png": ROOT / "benchmarks" / "work_precision.png"}
    for name in PAPERS:
        for path in sorted((ROOT / "build" / name).glob("*.png")):
            found[f"papers/{name}/{path.name}"] = path
    return found


def benchmarks() -> str:
    """The page of the benchmarks: the short table and the picture, then the README without its picture."""
    title, _, rest = text_of("benchmarks/README.md").partition("\n\n")
    (picture,) = re.findall(r"^!\[.*\]\(work_precision.png\)$", rest, re.MULTILINE)
    return f"{title}\n\n## In short\n\n{measured()}\n\n{picture}\n\n## All of it\n\n{rest.replace(picture, '')}"


def cite() -> str:
    """The page on how to cite, from CITATION.cff."""
    return (
        "# How to cite\n\n"
        "The licence is Apache-2.0 (file `LICENSE`). "
        "Cite the software, and the papers whose mathematics you used. This is `CITATION.cff`, which "
        "reference managers read:\n\n```yaml\n" + text_of("CITATION.cff").rstrip() + "\n```\n"
    )


def paper(name: str) -> str:
    """The page of a paper: its README, with the record instead of the table of claims where there is one."""
    text = text_of(f"papers/{name}/README.md")
    record = ROOT / "build" / name / "results.md"
    if not record.is_file():
        return text
    before, after = re.split(r"<!-- claims.*?<!-- end of claims -->\n", text, flags=re.DOTALL)
    found = record.read_text(encoding="utf-8").partition("\n\n## ")[2]
    found = re.sub(r"\]\((?=\w+\.png\))", f"]({name}/", found)
    return f"---\nhide:\n  - toc\n---\n\n{before}{after}\n## {found}"


def measured() -> str:
    """A table of measured speeds and errors with their conditions, from the benchmarks' own tables."""
    text = text_of("benchmarks/README.md")
    fast, many = _rows(text, "### Linear bounce"), _rows(text, "### Nonlinear bounce")
    targets = {row[0]: row for row in _rows(text, "### Targets").values()}
    heyoka, scipy = (
        _value(targets, f"linear bounce: times {peer}") for peer in ("heyoka", "scipy")
    )
    cold, cached = (
        _value(targets, f"first result, simulate, {how}")
        for how in ("compiled, cold", "compiled, cached")
    )
    wrong, near = (_value(targets, f"wrong itineraries, {where}") for where in ("random", "within"))
    ours, nonlinear = fast["nonsmooth"], many["nonsmooth"]
    callbacks = fast["heyoka, one integrator and callbacks"]
    rows = [
        (
            "bounces with friction",
            f"{_millions(ours)} million a second",
            f"linear contact, one thread; largest error of 500 is {ours[4]}",
        ),
        (
            "bounces with friction",
            f"{_millions(nonlinear)} million a second",
            f"nonlinear contact; largest error {nonlinear[4]}",
        ),
        (
            "how many times faster than heyoka, and than scipy",
            f"{heyoka:.0f} and {scipy:.0f}",
            "linear contact; each solver at its fastest tolerance with errors below 1e-9; "
            f"{_rate(ours) / _rate(callbacks):.0f} beside heyoka's fastest form, with callbacks",
        ),
        (
            "wrong sequences of slipping and rolling",
            f"{wrong:.0f} of 1,000,000",
            f"random starts; and {near:.0f} among starts within 1e-9 of a boundary between two sequences",
        ),
        (
            "first answer of a new process",
            f"{cached:.2g} s of processor time",
            f"{cold:.2g} s with the compilation of its system",
        ),
    ]
    head = "| what | measured | conditions |\n| --- | --- | --- |\n"
    return head + "\n".join("| " + " | ".join(row) + " |" for row in rows)


def _rows(text: str, title: str) -> dict[str, list[str]]:
    part = text.split(title + "\n", 1)[1].split("\n### ", 1)[0]
    cells = [
        [c.strip() for c in line.strip("|").split("|")]
        for line in part.splitlines()
        if line.startswith("|")
    ]
    return {row[0]: row for row in cells[2:]}


def _value(targets: dict[str, list[str]], start: str) -> float:
    return next(float(row[2]) for what, row in targets.items() if what.startswith(start))


def _millions(row: list[str]) -> str:
    return f"{_rate(row) / 1e6:.1f}"


def _rate(row: list[str]) -> float:
    return float(row[1].replace(",", ""))


def _without_comments(text: str) -> str:
    return re.sub(r"^<!--.*?-->\n", "", text, flags=re.MULTILINE | re.DOTALL)
