"""The page of a paper shows its record where there is one; the picture of the architecture is legible."""

from docs.tools import architecture, elsewhere
from papers.__main__ import NAMES
from papers.pictures import illegible


def test_every_paper_has_a_page():
    assert elsewhere.PAPERS == NAMES
    pages = elsewhere.pages()
    assert all(pages[f"papers/{name}.md"].count("\n# ") <= 1 for name in NAMES)


def test_the_record_takes_the_place_of_the_table_of_claims(monkeypatch, tmp_path):
    for folder in ("papers", "build"):
        (tmp_path / folder / "welander_1982").mkdir(parents=True)
    (tmp_path / "papers" / "welander_1982" / "README.md").write_text(
        "# Title\n\nBefore.\n\n<!-- claims: x -->\n| a |\n<!-- end of claims -->\n\nAfter.\n"
    )
    monkeypatch.setattr(elsewhere, "ROOT", tmp_path)
    assert "| a |" in elsewhere.paper("welander_1982")
    (tmp_path / "build" / "welander_1982" / "results.md").write_text(
        "# Title\n\nSource.\n\nSummary.\n\n## Figures\n\n### One\n\n![One](one.png)\n\n## Claims\n"
    )
    (tmp_path / "build" / "welander_1982" / "one.png").touch()
    page = elsewhere.paper("welander_1982")
    assert "| a |" not in page and page.count("# Title") == 1
    assert "Before." in page and "After." in page and "## Claims" in page
    assert "![One](welander_1982/one.png)" in page
    assert "papers/welander_1982/one.png" in elsewhere.pictures()


def test_the_benchmarks_begin_with_the_short_table_and_the_picture():
    page = elsewhere.pages()["benchmarks.md"]
    first, _, rest = page.partition("\n## All of it\n")
    assert elsewhere.measured() in first and "](work_precision.png)" in first
    assert "](work_precision.png)" not in rest and "### Targets" in rest


def test_the_picture_of_the_architecture_is_legible():
    assert illegible(architecture.figure()) == []
