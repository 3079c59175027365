"""Paths and names in README, CONTRIBUTING and the page on extending exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = ["README.md", "CONTRIBUTING.md", "docs/architecture.md", "docs/extend.md"]
FOLDERS = "nonsmooth|bounce|tests|papers|docs|benchmarks"


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


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
