"""Every paper: its claims hold, its README shows them, its figures have labels, its program runs."""

from __future__ import annotations

import csv
import dataclasses
import importlib
import json
import re
from pathlib import Path

import pytest

from papers import __main__ as everything
from papers import program
from papers.claims import Check
from papers.report import readme_table

FOLDER = Path(__file__).parent
NAMES = [name for name in everything.NAMES if name != "biber_2022"]  # it has tests of its own
PAPERS = {name: importlib.import_module(f"papers.{name}.__main__").PAPER for name in NAMES}
PICTURES = [(name, picture) for name, paper in PAPERS.items() for picture in paper.pictures]


@pytest.fixture(scope="module", params=NAMES)
def computed(request):
    paper = PAPERS[request.param]
    return paper, [compute() for compute in paper.claims]


def test_all_claims_hold(computed):
    _, claims = computed
    assert [c.id for c in claims if not c.holds] == []
    assert all(c.checks and c.how and c.statement for c in claims)
    assert len({c.id for c in claims}) == len(claims)


def test_readme_shows_the_computed_claims(computed):
    paper, claims = computed
    text = (FOLDER / paper.name / "README.md").read_text(encoding="utf-8")
    shown = text.split("in the tests -->\n")[1].split("\n<!-- end of claims -->")[0]
    assert shown == readme_table(claims)


def test_what_is_quoted_from_memory_says_so(computed):
    paper, claims = computed
    text = (FOLDER / paper.name / "README.md").read_text(encoding="utf-8")
    assert "memory" in paper.note and "from memory" in text
    assert all("memory" in c.place or "here" in c.place for c in claims)


@pytest.mark.parametrize(("name", "picture"), PICTURES, ids=[f"{n}-{p.name}" for n, p in PICTURES])
def test_figures_are_drawn_with_labels(name, picture):
    figure = picture.draw()
    texts = [t for axes in figure.axes for t in [*axes.texts, axes.xaxis.label, axes.yaxis.label]]
    assert any(t.get_text() for t in texts)
    assert picture.caption


def test_all_folders_are_listed():
    folders = {p.parent.name for p in FOLDER.glob("*/__main__.py")}
    assert set(everything.NAMES) == folders


def test_program_writes_tables_and_a_self_contained_page(tmp_path, monkeypatch, capsys):
    name = "welander_1982"
    module = importlib.import_module(f"papers.{name}.__main__")
    short = dataclasses.replace(
        module.PAPER, claims=module.PAPER.claims[:2], pictures=module.PAPER.pictures[:1]
    )
    monkeypatch.setattr(module, "PAPER", short)
    assert everything.main([name, "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "2 claims" in printed
    folder = tmp_path / name
    assert len(list(csv.reader((folder / "claims.csv").open(encoding="utf-8")))) == 3
    assert "memory" in json.loads((folder / "claims.json").read_text())["note"]
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 1 and not re.search("https?:", page)


def test_a_failed_check_is_reported(tmp_path, capsys):
    paper = PAPERS["welander_1982"]
    broken = dataclasses.replace(paper.claims[0](), checks=(Check("2 is 3", False),))
    paper = dataclasses.replace(paper, claims=(lambda: broken,), pictures=())
    assert program.reproduce(paper, ["--out", str(tmp_path)]) == 1
    assert broken.id in capsys.readouterr().err


def test_unknown_paper_is_refused(capsys):
    with pytest.raises(SystemExit):
        everything.main(["nobody_1900"])
    assert "no paper named nobody_1900" in capsys.readouterr().err
