"""Write authors and version, which are settings of pyproject.toml, into the files that repeat them."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: What a line between two marks of a file is replaced by.
_VERSION = {
    "CITATION.cff": r"(?m)^version: .*$",
    "nonsmooth/__init__.py": r"(?m)^__version__ = .*$",
    "release/recipe.yaml": r"(?m)^  version: .*$",
}


def written() -> dict[str, str]:
    """The text of each file with the settings in it."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    version, authors = project["project"]["version"], project["tool"]["nonsmooth"]["authors"]
    texts = {
        name: (ROOT / name).read_text(encoding="utf-8") for name in (*_VERSION, "joss/paper.md")
    }
    lines = {
        "CITATION.cff": f"version: {version}",
        "nonsmooth/__init__.py": f'__version__ = "{version}"',
        "release/recipe.yaml": f"  version: {version}",
    }
    for name, pattern in _VERSION.items():
        texts[name] = re.sub(pattern, lines[name], texts[name], count=1)
    put = lambda text, pattern, block: re.sub(pattern, lambda _: block, text, count=1)
    texts["CITATION.cff"] = put(
        texts["CITATION.cff"], r"(?m)^authors:\n(?: .*\n)+", _citation(authors)
    )
    texts["joss/paper.md"] = put(
        texts["joss/paper.md"],
        r"(?m)^authors:\n(?: .*\n)+affiliations:\n(?: .*\n)+",
        _paper(authors),
    )
    return texts


def _citation(authors: list[dict[str, str]]) -> str:
    keys = ("name", "orcid", "affiliation")
    rows = (
        "\n    ".join(f'{key}: "{author[key]}"' for key in keys if key in author)
        for author in authors
    )
    return "authors:\n" + "".join(f"  - {row}\n" for row in rows)


def _paper(authors: list[dict[str, str]]) -> str:
    places = list(dict.fromkeys(author["affiliation"] for author in authors))
    rows = []
    for author in authors:
        rows.append(f"  - name: {author['name']}\n")
        if "orcid" in author:
            rows.append(f"    orcid: {author['orcid'].removeprefix('https://orcid.org/')}\n")
        rows.append(f"    affiliation: {places.index(author['affiliation']) + 1}\n")
    own = (f"  - name: {place}\n    index: {i}\n" for i, place in enumerate(places, 1))
    return "authors:\n" + "".join(rows) + "affiliations:\n" + "".join(own)


if __name__ == "__main__":
    for name, text in written().items():
        (ROOT / name).write_text(text, encoding="utf-8")
