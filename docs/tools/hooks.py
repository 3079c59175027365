"""Hooks of mkdocs: draw the gallery, write the pages of the API, fill in tables, typeset formulas.

Everything that is generated is written to build/.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

DOCS = Path(__file__).parents[1]
sys.path.insert(0, str(DOCS.parent))  # mkdocs runs this file by its path

from docs.tools import (  # noqa: E402
    animations,
    api,
    elsewhere,
    formulas,
    generate,
    notebooks,
    typeset,
)

PICTURES = DOCS.parent / "build" / "gallery"
#: A list of exceptions in brackets, and a dash before a description that is not there.
_LISTED = re.compile(r"(?<=<code>)\(((?:<(a|autoref) [^>]*>\w+</\2>(?:, )?)+)\)(?=</code>)")
_NOTHING = re.compile(r"\s*–\s*<div class=\"doc-md-description\">\s*</div>")
#: Pages that the search lists after those that explain: lists of names, pictures, records, pages for developers.
_BEHIND = re.compile(
    "api/|papers|decisions/|(architecture|benchmarks|changelog|cite|extend|gallery|gpu|testset|textbook|vision)\\.md"
)
_ROLE = re.compile(r":(?:class|func|meth|mod|attr):(?=<code>|`)")


def on_config(config: Any) -> Any:
    """Show the version, and link the repository where pyproject.toml names one."""
    project = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))
    config.copyright = f"nonsmooth-dynamics {project['project']['version']}, Apache-2.0"
    repository = project["tool"]["nonsmooth"]["repository"]
    if repository:
        config.repo_url, config.repo_name = repository, "Repository"
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the pictures of the gallery, the pages of the API and the explorers."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name in generate.GALLERY:
        for picture, figure in generate.drawn(name, generate.run_example(name)).items():
            path = PICTURES / f"{picture}.svg"
            figure.savefig(path, bbox_inches="tight", dpi=120, metadata={"Date": None})
            files.append(File.generated(config, f"gallery/{path.name}", abs_src_path=str(path)))
    for path in generate.draw_problems(PICTURES):
        files.append(File.generated(config, f"gallery/{path.name}", abs_src_path=str(path)))
    for animation in animations.ANIMATIONS:
        for path in animations.write(animation, PICTURES):
            files.append(File.generated(config, f"gallery/{path.name}", abs_src_path=str(path)))
    for page in sorted(DOCS.glob("tutorial_*.md")):
        done = notebooks.run(page.read_text(encoding="utf-8"), page.stem)
        for uri, content in notebooks.files(done, page.stem).items():
            files.append(File.generated(config, uri, content=content))
    for uri, path in elsewhere.pictures().items():
        files.append(File.generated(config, uri, abs_src_path=str(path)))
    for uri, text in {**api.pages(), **elsewhere.pages(), **generate.explorers()}.items():
        files.append(File.generated(config, uri, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Put the generated parts into a page, a tutorial's pictures and notebook, and its weight in the search."""
    if _BEHIND.match(page.file.src_uri):
        page.meta["search"] = {"boost": 0.3}
    name = Path(page.file.src_uri).stem
    if name.startswith("tutorial_"):
        title, _, rest = notebooks.with_pictures(markdown, name).partition("\n")
        offer = f"[The same as a notebook, executed](tutorials/{name}.ipynb){{ download }}"
        markdown = f"{title}\n\n{offer}\n{rest}"
    return generate.fill(markdown)


def on_page_content(html: str, page: Any, **_: Any) -> str:
    """Take Sphinx's roles out of docstrings, typeset formulas, label the cells of tables."""
    read = typeset.formula
    if page.file.src_uri.startswith("api/") or page.file.src_uri == "gallery.md":
        read = formulas.formula  # docstrings have formulas as plain text
        html = _LISTED.sub(lambda found: found[1].replace(">, <", "></code>, <code><"), html)
        html = _NOTHING.sub("", html)
    if page.file.src_uri.startswith(("papers/", "benchmarks")):  # plain text, for terminals too
        html = formulas.page(html)
    html = typeset.mathematics(_ROLE.sub("", html), read)
    return typeset.labelled(typeset.unbroken(html))
