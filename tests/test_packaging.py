"""What is published works away from the repository: the long description, and the paper's references."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def _module(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


hatch_build, metadata = _module(ROOT / "hatch_build.py"), _module(ROOT / "release" / "metadata.py")

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


def test_authors_and_version_are_those_of_the_settings():
    for name, text in metadata.written().items():
        assert text == (ROOT / name).read_text(encoding="utf-8"), (
            f"{name}: python release/metadata.py"
        )


def test_an_author_has_orcid_and_affiliation_everywhere(tmp_path, monkeypatch):
    monkeypatch.setattr(metadata, "ROOT", tmp_path)
    for name in (*metadata.written.__globals__["_VERSION"], "joss/paper.md", "pyproject.toml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text((ROOT / name).read_text("utf-8"), "utf-8")
    given = '[{ name = "Ada L", affiliation = "X", orcid = "https://orcid.org/0-1" }, { name = "B", affiliation = "X" }]'
    settings = (tmp_path / "pyproject.toml").read_text("utf-8")
    (tmp_path / "pyproject.toml").write_text(
        re.sub(r"(?m)^authors = .*$", f"authors = {given}", settings)
    )
    texts = metadata.written()
    assert '  - name: "Ada L"\n    orcid: "https://orcid.org/0-1"\n' in texts["CITATION.cff"]
    paper = "  - name: Ada L\n    orcid: 0-1\n    affiliation: 1\n  - name: B\n    affiliation: 1\n"
    assert (
        f"authors:\n{paper}affiliations:\n  - name: X\n    index: 1\ndate:"
        in texts["joss/paper.md"]
    )


def test_the_paper_has_the_headings_that_its_journal_wants():
    text = (ROOT / "joss" / "paper.md").read_text(encoding="utf-8")
    expected = "Summary|Statement of need|State of the field|Software design|Research impact statement|AI usage disclosure"
    assert re.findall(r"(?m)^# (.*)$", text.split("---\n", 2)[2])[:6] == expected.split("|")
    assert len(text.split()) < 1750


def test_the_paper_cites_what_it_lists_and_lists_what_it_cites():
    text = (ROOT / "joss" / "paper.md").read_text(encoding="utf-8")
    listed = re.findall(
        r"^@\w+\{(\w+),", (ROOT / "joss" / "paper.bib").read_text("utf-8"), re.MULTILINE
    )
    body = text.split("---\n", 2)[2]
    cited = re.findall(r"@([A-Za-z]+\d{4})", body)
    assert set(cited) == set(listed) and len(listed) == len(set(listed))
