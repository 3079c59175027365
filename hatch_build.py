"""What the metadata of the package takes from the one setting `tool.nonsmooth.repository`.

An index page shows README.md away from the repository, so its relative links and pictures would be
broken there. With an address they become absolute; without one pictures are left out and links become
plain text.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

try:
    from hatchling.metadata.plugin.interface import MetadataHookInterface
except ImportError:  # while tests run; only a build has hatchling
    MetadataHookInterface = object

_PICTURE = re.compile(r"!\[(?P<alt>[^\]]*)\]\((?!\w+:)(?P<path>[^)\s]+)\)")
_LINK = re.compile(r"(?<!!)\[(?P<text>[^\]]*)\]\((?!\w+:|#)(?P<path>[^)\s]+)\)")
_TABLE_OF_PICTURES = re.compile(r"^(?:\|[^\S\n]*)+\n\|(?:-+\|)+\n\|.*\n", re.MULTILINE)


def urls(repository: str) -> dict[str, str]:
    """Links of the project; none without a repository."""
    if not repository:
        return {}
    return {
        "Repository": repository,
        "Documentation": f"{repository}/blob/main/docs/index.md",
        "Changelog": f"{repository}/blob/main/CHANGELOG.md",
        "Issues": f"{repository}/issues",
    }


def readme_for_index(text: str, repository: str) -> str:
    """README.md with links and pictures that work on an index page."""
    if repository:
        text = _PICTURE.sub(rf"![\g<alt>]({repository}/raw/main/\g<path>)", text)
        return _LINK.sub(rf"[\g<text>]({repository}/blob/main/\g<path>)", text)
    text = _TABLE_OF_PICTURES.sub("", _PICTURE.sub("", text))
    return _LINK.sub(r"\g<text>", text)


class CustomMetadataHook(MetadataHookInterface):  # type: ignore[misc]
    """Called by hatchling for the fields that pyproject.toml names as dynamic."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Fill in links and the long description."""
        root = Path(self.root)
        project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
        repository = project["tool"]["nonsmooth"]["repository"]
        text = (root / "README.md").read_text(encoding="utf-8")
        metadata["urls"] = urls(repository)
        metadata["readme"] = {
            "content-type": "text/markdown",
            "text": readme_for_index(text, repository),
        }
