"""Every paper: its claims hold, its README shows them, its figures are legible, its record is written."""

from __future__ import annotations

import dataclasses
import importlib
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from papers import __main__ as program
from papers import pictures
from papers.claims import ADDED, HERE, HOLDS, MEMORY, NOT_CHECKABLE, Check, failures
from papers.pictures import faults
from papers.record import readme_table

FOLDER = Path(__file__).parent
NAMES = [name for name in program.NAMES if name != "biber_2022"]  # it has tests of its own
PAPERS = {name: program.paper_of(name) for name in NAMES}
PICTURES = [(name, picture) for name, paper in PAPERS.items() for picture in paper.pictures]


#: Claims and figures that take over a second: with the slow tests, and by `make reproduce`.
SLOW_CLAIMS = {
    "jeffrey_colombo_2009": ["single_quantity", "repelling_before"],
    "colombo_jeffrey_2011": ["portraits", "open_sets"],
}
SLOW_FIGURES = {
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
        *[(name, name not in SLOW_CLAIMS) for name in NAMES],
        *[pytest.param((name, True), marks=pytest.mark.slow) for name in SLOW_CLAIMS],
    ],
    ids=lambda case: case[0] + ("" if case[1] else ", without the slow"),
)
def computed(request):
    """A paper, its claims, and whether these are all of them."""
    name, whole = request.param
    slow = [] if whole else SLOW_CLAIMS[name]
    (table,) = PAPERS[name].tables
    claims = [compute_once(c) for c in table.rows if c.__name__ not in slow]
    assert len(claims) == len(table.rows) - len(slow)
    return PAPERS[name], claims, whole


def test_all_claims_hold(computed):
    _, claims, _ = computed
    assert [c.name for c in claims if failures(c)] == []
    assert all(c.checks and c.how and c.statement for c in claims)
    assert len({c.name for c in claims}) == len(claims)


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
    assert "from memory" in paper.source and "from memory" in text
    assert all(c.place.startswith((MEMORY, HERE)) for c in claims)
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
        pytest.param(n, p, marks=pytest.mark.slow) if f"{n}-{p.name}" in SLOW_FIGURES else (n, p)
        for n, p in PICTURES
    ],
    ids=[f"{n}-{p.name}" for n, p in PICTURES],
)
def test_figures_are_fit_for_print(name, picture):
    figure = picture.draw()
    texts = [t for axes in figure.axes for t in [*axes.texts, axes.xaxis.label, axes.yaxis.label]]
    assert any(t.get_text() for t in texts)
    assert picture.caption
    with pictures.settings():
        assert faults(figure) == []


def test_what_is_not_legible_is_found():
    with pictures.settings():
        axes = (figure := pictures.new_figure(7.5, 3.0)).add_subplot()
        for k in range(7):
            axes.plot([0, 1], [k, k], label=f"line {k}")
        axes.legend(loc="upper left")
        figure.set_layout_engine("none")
        axes.text(0.5, 3.0, "small", fontsize=6)
        axes.text(0.5, 1.0, "one text", rotation=40)
        axes.text(0.5, 1.1, "another", rotation=40)
        axes.text(0.6, 1.0, "beside", rotation=40)
        axes.text(5.0, 0.5, "outside", clip_on=True)
        figure.text(0.9, 0.5, "a text that leaves the figure on its right side")
        assert faults(figure) == [
            "it is 7.5 inches wide, more than the 7 of a page.",
            "a legend has 7 entries: label the things themselves.",
            "'one text' is on 'another'.",
            "'small' is in 6 point.",
            "'a text that leaves the figure on its right side' is cut off.",
        ]


def test_curves_are_sampled_where_they_bend():
    x, y = pictures.sampled(lambda t: [math.exp(-30 * t), math.sqrt(t)], [0.0, 0.3, 1.0])
    assert y.shape == (len(x), 2) and np.all(np.diff(x) > 0) and 30 < len(x) <= 200
    assert np.array_equal(y[:, 0], [math.exp(-30 * t) for t in x])
    steps = np.column_stack([np.diff(x), np.diff(y[:, 0])])
    turn = np.degrees(np.abs(np.diff(np.arctan2(*steps.T[::-1]))))
    assert turn.max() < 4.5
    assert len(pictures.sampled(lambda t: 2 * t, [0.0, 0.4, 1.0])[0]) == 3  # straight


def test_all_folders_are_listed():
    folders = {p.parent.name for p in FOLDER.glob("*/model.py")}
    assert set(program.NAMES) == folders


def of_few_steps(monkeypatch, *rows):
    """Let the program find a paper with these rows and one figure."""
    paper = PAPERS["welander_1982"]
    (table,) = paper.tables
    axes = pictures.Picture("axes", "empty axes", "Two axes.", lambda: pictures.canvas(2, 2)[0])
    short = dataclasses.replace(table, rows=rows or table.rows[:2])
    paper = dataclasses.replace(paper, tables=(short,), pictures=(axes,))
    monkeypatch.setattr(importlib.import_module("papers.welander_1982"), "PAPER", paper)
    return short.rows[0]()


def test_program_prints_claims_and_writes_the_record_and_the_figures(tmp_path, monkeypatch, capsys):
    first = of_few_steps(monkeypatch)
    assert program.main(["welander_1982", "--out", str(tmp_path)]) == 0
    assert f"{first.name}: {first.value}\n" in capsys.readouterr().out
    record = (tmp_path / "welander_1982" / "results.md").read_text(encoding="utf-8")
    assert "2 claims: 2 holds; 1 figures." in record and "![empty axes](axes.png)" in record
    assert "| " + " | ".join(first.cells()) + " |" in record.splitlines()
    for kind in ("png", "pdf"):
        assert (tmp_path / "welander_1982" / f"axes.{kind}").stat().st_size > 500


def test_a_failed_check_is_reported(tmp_path, monkeypatch, capsys):
    broken = dataclasses.replace(
        PAPERS["welander_1982"].tables[0].rows[0](), checks=(Check("2 is 3", False),)
    )
    of_few_steps(monkeypatch, lambda: broken)
    assert program.main(["welander_1982", "--out", str(tmp_path)]) == 1
    printed = capsys.readouterr().err
    assert "FAILS: 2 is 3" in printed and f"welander_1982: {broken.name}" in printed


def test_an_interruption_keeps_what_was_computed(tmp_path, monkeypatch, capsys):
    def interrupted():
        raise KeyboardInterrupt

    first = PAPERS["welander_1982"].tables[0].rows[0]
    of_few_steps(monkeypatch, first, interrupted)
    assert program.main(["welander_1982", "kuznetsov_2003", "--out", str(tmp_path)]) == 130
    assert "python -m papers welander_1982 kuznetsov_2003" in capsys.readouterr().err
    assert first().value in (tmp_path / "welander_1982" / "results.md").read_text(encoding="utf-8")


def test_unknown_paper_is_refused(capsys):
    with pytest.raises(SystemExit):
        program.main(["nobody_1900"])
    assert "no paper named nobody_1900" in capsys.readouterr().err
