"""The driver's library in a wheel, and what the metadata takes from the settings in `tool.nonsmooth`.

An index page shows README.md away from the repository, so its relative links and pictures would be
broken there. With an address they become absolute; without one pictures are left out and links become
plain text.
"""

from __future__ import annotations

import importlib
import re
import shlex
import subprocess
import sys
import tempfile
import tomllib
import types
from pathlib import Path
from typing import Any

try:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface
    from hatchling.metadata.plugin.interface import MetadataHookInterface
except ImportError:  # while tests run; only a build has hatchling
    MetadataHookInterface = BuildHookInterface = object

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
        settings = project["tool"]["nonsmooth"]
        repository = settings["repository"]
        metadata["authors"] = [{"name": author["name"]} for author in settings["authors"]]
        text = (root / "README.md").read_text(encoding="utf-8")
        metadata["urls"] = urls(repository)
        metadata["readme"] = {
            "content-type": "text/markdown",
            "text": readme_for_index(text, repository),
        }


#: Packages without their `__init__`, of which a build imports modules that need nothing but Python.
_BARE = ("", ".model", ".model.expressions", ".flow", ".flow.engine", ".flow.engine.building")
_BUILDING = "nonsmooth.flow.engine.building"


def building(root: Path) -> tuple[Any, Any]:
    """Modules `core_source` and `compilers` of the sources in a folder."""
    kept = {name: sys.modules.pop(name) for name in [*sys.modules] if _is_ours(name)}
    try:
        for name in (f"nonsmooth{part}" for part in _BARE):
            sys.modules[name] = bare = types.ModuleType(name)
            bare.__path__ = [str(root.joinpath(*name.split(".")))]
        names = ("core_source", "compilers")
        source, compilers = (importlib.import_module(f"{_BUILDING}.{name}") for name in names)
    finally:
        for name in [name for name in sys.modules if _is_ours(name)]:
            del sys.modules[name]
        sys.modules.update(kept)
    return source, compilers


def _is_ours(name: str) -> bool:
    return name.partition(".")[0] == "nonsmooth"


def compiled(root: Path, folder: Path) -> tuple[Path | None, list[str]]:
    """The driver's library in a folder, None without a compiler, and what went wrong."""
    core, compilers = building(root)
    text, library = folder / "core.c", folder / core.packaged_name(sys.platform)
    text.write_text(core.keyed(core.core_source(), core.source_key()), encoding="utf-8")
    failures = list[str]()
    for command in compilers.compilers():
        flags = [*compilers.FLAGS, *compilers.baseline(command)]
        call = [*command, *flags, str(text), "-o", str(library), "-lm"]
        done = subprocess.run(call, capture_output=True, text=True, errors="replace")
        if done.returncode == 0 and library.is_file():
            return library, failures
        failures.append(f"{shlex.join(call)}\n{done.stderr}")
    return None, failures


class CustomBuildHook(BuildHookInterface):  # type: ignore[misc]
    """Puts the driver's library into a wheel; a wheel without it compiles the driver on first use."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile it, unless the installation is editable: a checkout has the library in the cache."""
        if version == "editable":
            return
        from packaging.tags import platform_tags

        self.folder = tempfile.TemporaryDirectory()
        library, failures = compiled(Path(self.root), Path(self.folder.name))
        if library is None:
            self.app.display_warning("The wheel has no library: no C compiler makes one.")
            for failure in failures:
                self.app.display_warning(failure)
            return
        plain = (tag for tag in platform_tags() if not tag.startswith(("manylinux", "musllinux")))
        build_data["tag"], build_data["pure_python"] = f"py3-none-{next(plain)}", False
        build_data["force_include"][str(library)] = f"nonsmooth/flow/engine/{library.name}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the folder of the library."""
        if version != "editable":
            self.folder.cleanup()
