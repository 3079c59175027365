"""Every paper: its claims hold, its README shows them, its figures are legible, its record is written."""

from __future__ import annotations

import dataclasses
import importlib
import math
from pathlib import Path

import numpy as np
import pytest

from papers import __main__ as program
from papers import pictures
from papers.claims import Check, failures
from papers.pictures import illegible

FOLDER = Path(__file__).parent
PAPERS = {name: program.paper_of(name) for name in program.NAMES}
NAMES = [name for name in PAPERS if name != "biber_2022"]  # its claims have tests of their own
CLAIMS = {f"{n}-{c.__name__}": (n, c) for n in NAMES for c in PAPERS[n].tables[0].rows}
PICTURES = {f"{n}-{picture.name}": picture for n, p in PAPERS.items() for picture in p.pictures}


def readme(name):
    return (FOLDER / name / "README.md").read_text(encoding="utf-8")


@pytest.mark.slow_cases(
    "jeffrey_colombo_2009-single_quantity",
    "jeffrey_colombo_2009-repelling_before",
    "colombo_jeffrey_2011-portraits",
    "colombo_jeffrey_2011-open_sets",
)
@pytest.mark.parametrize(("name", "compute"), CLAIMS.values(), ids=list(CLAIMS))
def test_claim_holds(name, compute):
    claim = compute()
    assert failures(claim) == []
    assert claim.checks and claim.cells()[-1] and claim.statement
    assert claim.place.startswith(("known from memory", "computed here"))
    assert claim.verdict in ("holds", "added here", "not checkable")


@pytest.mark.parametrize("name", NAMES)
def test_readme_says_that_the_paper_was_not_read(name):
    title, source, text = PAPERS[name].title, PAPERS[name].source, readme(name)
    assert title.startswith("After ") and text.startswith("# After ") and "reproduced" not in title
    assert "from memory" in source and "from memory" in text and "no reproduction" in text


@pytest.mark.slow_cases(
    *(f"welander_1982-{name}" for name in ("portraits", "diagram")),
    *(f"kuznetsov_2003-{name}" for name in ("diagram", "regimes", "pseudo_saddle_node")),
    *(f"kuznetsov_2003-{name}" for name in ("boundary_node", "boundary_focus")),
    *(f"jeffrey_colombo_2009-{name}" for name in ("regions", "space", "sliding")),
    *(f"jeffrey_colombo_2009-{name}" for name in ("diabolo", "crossings")),
    *(f"colombo_jeffrey_2011-{name}" for name in ("surface", "visible", "invisible", "mixed")),
    *(f"colombo_jeffrey_2011-{name}" for name in ("space", "maps", "series")),
    *(f"biber_2022-two_fold_{letter}" for letter in "bc"),
    *(f"biber_2022-{name}" for name in ("trajectories", "visible_fp1", "visible_fp2")),
)
@pytest.mark.parametrize("picture", PICTURES.values(), ids=list(PICTURES))
def test_figures_are_fit_for_print(picture):
    figure = picture.draw()
    texts = [t for axes in figure.axes for t in [*axes.texts, axes.xaxis.label, axes.yaxis.label]]
    assert any(t.get_text() for t in texts)
    assert picture.caption
    with pictures.settings():
        assert illegible(figure) == []


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
        assert illegible(figure) == [
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
    claim = PAPERS["welander_1982"].tables[0].rows[0]()
    broken = dataclasses.replace(claim, found=("", "", Check("2 is 3", False)))
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
