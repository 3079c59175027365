"""Every paper: its claims hold, its README shows them, its figures have labels, its program runs."""

from __future__ import annotations

import csv
import dataclasses
import importlib
import json
import math
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from papers import __main__ as everything
from papers import look, program
from papers.claims import ADDED, HERE, HOLDS, MEMORY, NOT_CHECKABLE, Check
from papers.pictures import faults
from papers.report import readme_table

FOLDER = Path(__file__).parent
NAMES = [name for name in everything.NAMES if name != "biber_2022"]  # it has tests of its own
PAPERS = {name: importlib.import_module(f"papers.{name}.__main__").PAPER for name in NAMES}
PICTURES = [(name, picture) for name, paper in PAPERS.items() for picture in paper.pictures]


#: Claims and figures that take over a second: with the slow tests, and by `make reproduce`.
DEAR_CLAIMS = {
    "jeffrey_colombo_2009": ["single_quantity", "repelling_before"],
    "colombo_jeffrey_2011": ["portraits", "open_sets"],
}
DEAR_FIGURES = {
    "welander_1982-portraits",
    "welander_1982-diagram",
    "kuznetsov_2003-diagram",
    "kuznetsov_2003-regimes",
    "kuznetsov_2003-pseudo_saddle_node",
    "kuznetsov_2003-boundary_node",
    "kuznetsov_2003-boundary_focus",
    "jeffrey_colombo_2009-regions",
    "colombo_jeffrey_2011-surface",
}
compute_once = cache(lambda compute: compute())


@pytest.fixture(
    params=[
        *[(name, name not in DEAR_CLAIMS) for name in NAMES],
        *[pytest.param((name, True), marks=pytest.mark.slow) for name in DEAR_CLAIMS],
    ],
    ids=lambda case: case[0] + ("" if case[1] else ", without the dear"),
)
def computed(request):
    """A paper, its claims, and whether these are all of them."""
    name, whole = request.param
    dear = [] if whole else DEAR_CLAIMS[name]
    claims = [compute_once(c) for c in PAPERS[name].claims if c.__name__ not in dear]
    assert len(claims) == len(PAPERS[name].claims) - len(dear)
    return PAPERS[name], claims, whole


def test_all_claims_hold(computed):
    _, claims, _ = computed
    assert [c.id for c in claims if not c.holds] == []
    assert all(c.checks and c.how and c.statement for c in claims)
    assert len({c.id for c in claims}) == len(claims)


def test_readme_shows_the_computed_claims(computed):
    paper, claims, whole = computed
    text = (FOLDER / paper.name / "README.md").read_text(encoding="utf-8")
    shown = text.split("in the tests -->\n")[1].split("\n<!-- end of claims -->")[0]
    table = readme_table(claims)
    assert set(table.splitlines()) <= set(shown.splitlines())
    assert shown == table or not whole


def test_what_is_quoted_from_memory_says_so(computed):
    paper, claims, _ = computed
    text = (FOLDER / paper.name / "README.md").read_text(encoding="utf-8")
    assert "memory" in paper.note and "from memory" in text
    assert {c.basis for c in claims} <= {MEMORY, HERE}
    assert {c.verdict for c in claims} <= {HOLDS, ADDED, NOT_CHECKABLE}


def test_only_what_was_read_is_called_reproduced():
    for name, paper in PAPERS.items():
        text = (FOLDER / name / "README.md").read_text(encoding="utf-8")
        assert paper.title.startswith("After ") and text.startswith("# After ")
        assert "reproduced" not in paper.title and "no reproduction" in text


@pytest.mark.slow_cases(
    "jeffrey_colombo_2009-space",
    "jeffrey_colombo_2009-sliding",
    "jeffrey_colombo_2009-diabolo",
    "jeffrey_colombo_2009-crossings",
    "colombo_jeffrey_2011-visible",
    "colombo_jeffrey_2011-invisible",
    "colombo_jeffrey_2011-mixed",
    "colombo_jeffrey_2011-space",
    "colombo_jeffrey_2011-maps",
    "colombo_jeffrey_2011-series",
)
@pytest.mark.parametrize(
    ("name", "picture"),
    [
        pytest.param(n, p, marks=pytest.mark.slow) if f"{n}-{p.name}" in DEAR_FIGURES else (n, p)
        for n, p in PICTURES
    ],
    ids=[f"{n}-{p.name}" for n, p in PICTURES],
)
def test_figures_are_fit_for_print(name, picture):
    figure = picture.draw()
    texts = [t for axes in figure.axes for t in [*axes.texts, axes.xaxis.label, axes.yaxis.label]]
    assert any(t.get_text() for t in texts)
    assert picture.caption
    with look.settings():
        assert faults(figure) == []


def test_faults_of_print_are_found():
    with look.settings():
        figure = look.new_figure(7.5, 3.0)
        axes = figure.add_subplot()
        axes.plot([0, 1], [0, 1])
        figure.set_layout_engine("none")
        axes.text(0.5, 0.5, "small", fontsize=6)
        figure.text(0.9, 0.5, "a text that leaves the figure on its right side")
        axes.text(5.0, 0.5, "outside", clip_on=True)
        axes.set_title("high", y=1.5)
        found = " ".join(faults(figure))
    assert "7.5 inches wide" in found and "'small' is in 6 point" in found
    assert "right side' is cut off" in found and "outside" not in found
    assert "'high' is cut off" in found


def test_long_legends_and_texts_on_one_another_are_found():
    with look.settings():
        figure = look.new_figure(7.0, 3.0)
        axes = figure.add_subplot()
        for k in range(7):
            axes.plot([0, 1], [k, k], label=f"line {k}")
        axes.legend(loc="upper left")
        assert faults(figure) == ["a legend has 7 entries: label the things themselves."]
        axes.get_legend().remove()
        axes.text(0.5, 1.0, "one text", rotation=40)
        axes.text(0.5, 1.1, "another", rotation=40)
        axes.text(0.6, 1.0, "beside", rotation=40)
        assert faults(figure) == ["'one text' is on 'another'."]


def test_curves_are_sampled_where_they_bend():
    x, y = look.sampled(lambda t: [math.exp(-30 * t), math.sqrt(t)], [0.0, 0.3, 1.0])
    assert y.shape == (len(x), 2) and np.all(np.diff(x) > 0) and 30 < len(x) <= 200
    assert np.array_equal(y[:, 0], [math.exp(-30 * t) for t in x])
    steps = np.column_stack([np.diff(x), np.diff(y[:, 0])])
    turn = np.degrees(np.abs(np.diff(np.arctan2(*steps.T[::-1]))))
    assert turn.max() < 4.5
    assert len(look.sampled(lambda t: 2 * t, [0.0, 0.4, 1.0])[0]) == 3  # straight


def test_all_folders_are_listed():
    folders = {p.parent.name for p in FOLDER.glob("*/__main__.py")}
    assert set(everything.NAMES) == folders


@pytest.mark.slow
def test_program_writes_tables_and_a_self_contained_page(tmp_path, monkeypatch, capsys):
    name = "jeffrey_colombo_2009"
    module = importlib.import_module(f"papers.{name}.__main__")
    cheap = [p for p in module.PAPER.pictures if f"{name}-{p.name}" not in DEAR_FIGURES]
    short = dataclasses.replace(
        module.PAPER, claims=module.PAPER.claims[:2], pictures=tuple(cheap[:1])
    )
    monkeypatch.setattr(module, "PAPER", short)
    assert everything.main([name, "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "2 statements" in printed
    folder = tmp_path / name
    assert len(list(csv.reader((folder / "claims.csv").open(encoding="utf-8")))) == 3
    assert "memory" in json.loads((folder / "claims.json").read_text())["note"]
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "name='viewport'" in page and page.index("<h2>Figures") < page.index("<table>")
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
