"""The report of every paper opens from a file on a desktop and on a phone, and complains of nothing."""

import importlib

import pytest
from matplotlib.figure import Figure

from papers import __main__ as everything
from papers import program
from tests.browser import WIDTHS


def blank(picture, folder):
    """An empty picture: of a figure, the page's layout knows only that it is wide."""
    Figure(figsize=(9, 6)).savefig(folder / f"{picture.name}.png", dpi=150)


@pytest.fixture(scope="module")
def reports(tmp_path_factory):
    """The reports with all their words and tables, and blank pictures."""
    folder = tmp_path_factory.mktemp("reports")
    with pytest.MonkeyPatch.context() as patch:
        for module in (program, importlib.import_module("papers.biber_2022.__main__")):
            patch.setattr(module, "save", blank)
        assert everything.main(["--out", str(folder)]) == 0
    return {name: folder / name / "report.html" for name in everything.NAMES}


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", everything.NAMES)
def test_report_fits_the_window_and_complains_of_nothing(browser, reports, name, width):
    browser.open(reports[name], width)
    assert browser.faults() == {} and browser.unnamed() == []
    assert browser.run("return document.images.length") > 0
