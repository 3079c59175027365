"""README, CONTRIBUTING, the pages on architecture and on extending describe the packages as they are."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = ["README.md", "CONTRIBUTING.md", "docs/extend.md"]
FOLDERS = "nonsmooth|bounce|tests|papers|docs|benchmarks"


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def tree_of(page):
    """Folders of the tree that a page draws, from its indentation."""
    found, path = [], []
    for indent, names in re.findall(r"^    ( *)((?:\w+/ ?)+)(?= |$)", text_of(page), re.MULTILINE):
        path = path[: len(indent) // 2]
        for name in names.split():
            found.append("/".join([*path, name.rstrip("/")]))
        path.append(names.split()[0].rstrip("/"))
    return found


def packages():
    return {
        folder.relative_to(ROOT).as_posix()
        for top in ("nonsmooth", "bounce")
        for folder in [ROOT / top, *(ROOT / top).rglob("*")]
        if (folder / "__init__.py").is_file()
    }


@pytest.mark.parametrize("page", PAGES)
def test_every_path_that_is_named_exists(page):
    named = re.findall(rf"`((?:{FOLDERS})/[\w./*]*)`", text_of(page))
    assert page == "README.md" or named
    missing = [path for path in named if not list(ROOT.glob(path.rstrip("/")))]
    assert not missing


def test_every_name_is_where_the_page_says():
    named = re.findall(r"`(\w+)`\s+(?:in|of)\s+`([\w/]+\.\w+)`", text_of("docs/extend.md"))
    assert len(named) > 6
    missing = [(name, path) for name, path in named if name not in text_of(path)]
    assert not missing


def test_the_tree_of_the_readme_is_that_of_the_packages():
    tree = tree_of("README.md")
    assert len(tree) == len(set(tree))
    assert all((ROOT / folder).is_dir() for folder in tree)
    assert packages() <= set(tree)


def test_the_layers_are_those_that_lint_enforces():
    contracts = tomllib.loads(text_of("pyproject.toml"))["tool"]["importlinter"]["contracts"]
    layers = {c["containers"][0]: c["layers"] for c in contracts if c["type"] == "layers"}
    shown = re.search(r"## Layers\n(.*?)\n## ", text_of("docs/architecture.md"), re.DOTALL)[1]
    for top in ("nonsmooth", "bounce"):
        block = re.search(rf"^    {top}/.*\n((?:      .*\n)+)", shown, re.MULTILINE)[1]
        rows = [
            set(re.findall(r"(\w+)/", re.split(r"  +", row.strip())[0]))
            for row in block.splitlines()
        ]
        both = [
            [{n for n in names if (ROOT / top / n).is_dir()} for names in found]
            for found in (rows, [re.findall(r"\w+", layer) for layer in layers[top]])
        ]
        here, enforced = ([layer for layer in found if layer] for found in both)
        assert here == enforced
