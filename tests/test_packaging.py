"""What is published works away from the repository: the long description, and the paper's references."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
_spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
hatch_build = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(hatch_build)

README = (ROOT / "README.md").read_text(encoding="utf-8")
ADDRESS = "https://example.org/owner/name"
TARGET = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


def test_with_an_address_every_picture_and_link_is_absolute():
    text = hatch_build.readme_for_index(README, ADDRESS)
    targets = TARGET.findall(text)
    assert f"{ADDRESS}/raw/main/docs/images/two_fold.png" in targets
    assert [t for t in targets if not t.startswith("https://")] == []


def test_pictures_of_the_readme_are_files():
    pictures = re.findall(r"!\[[^\]]*\]\(([^)\s]+)\)", README)
    assert len(pictures) == 2
    assert [p for p in pictures if not (ROOT / p).is_file()] == []


def test_without_an_address_nothing_is_broken_and_the_text_stays():
    text = hatch_build.readme_for_index(README, "")
    assert TARGET.findall(text) == []
    assert "![" not in text and not re.search(r"^\|[ |]*\|$", text, re.MULTILINE)
    programs = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
    assert programs.findall(text) == programs.findall(README)


@pytest.mark.parametrize("kept", ["[a](https://x.org/y)", "[a](#b)", "![a](https://x.org/y.png)"])
def test_what_is_absolute_stays(kept):
    assert hatch_build.readme_for_index(kept, ADDRESS) == kept


def test_links_of_the_project():
    assert hatch_build.urls("") == {}
    assert hatch_build.urls(ADDRESS)["Issues"] == f"{ADDRESS}/issues"
    assert all(u.startswith(ADDRESS) for u in hatch_build.urls(ADDRESS).values())


def test_the_paper_cites_what_it_lists_and_lists_what_it_cites():
    text = (ROOT / "joss" / "paper.md").read_text(encoding="utf-8")
    listed = re.findall(
        r"^@\w+\{(\w+),", (ROOT / "joss" / "paper.bib").read_text("utf-8"), re.MULTILINE
    )
    body = text.split("---\n", 2)[2]
    cited = re.findall(r"@([A-Za-z]+\d{4})", body)
    assert set(cited) == set(listed) and len(listed) == len(set(listed))
