"""What `make docs` does besides turning pages into HTML (an mkdocs hook).

It draws the gallery by running the programs of docs/examples, writes the API's pages, and puts the
generated parts into the pages. All of it lands in build/, nothing in docs/.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS))

import api  # noqa: E402  (neighbours; docs is not a package)
import generate  # noqa: E402
from mkdocs.structure.files import File, Files  # noqa: E402

PICTURES = DOCS.parent / "build" / "gallery"
_ROLE = re.compile(r":(?:class|func|meth|mod|attr):(?=<code>|`)")


def on_files(files: Files, config: Any) -> Files:
    """Add the pictures of the gallery, the pages of the API and the explorers."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name in generate.GALLERY:
        path = PICTURES / f"{name}.svg"
        figure = generate.run_example(name)["figure"]
        figure.savefig(path, bbox_inches="tight", dpi=120, metadata={"Date": None})
        files.append(File.generated(config, f"gallery/{name}.svg", abs_src_path=str(path)))
    for uri, text in {**api.pages(), **generate.explorers()}.items():
        files.append(File.generated(config, uri, content=text))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the generated parts into a page."""
    return generate.fill(markdown)


def on_page_content(html: str, **_: Any) -> str:
    """Take Sphinx's roles out of docstrings; what they name is set as code."""
    return _ROLE.sub("", html)
