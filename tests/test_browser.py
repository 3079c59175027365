"""The browser of the tests sees what is wrong with a page, and nothing wrong with one that is right."""

import pytest

from tests.browser import WIDTHS, missing

HEAD = "<!doctype html><html lang=en><meta charset=utf-8><link rel=icon href='data:,'>"
VIEWPORT = "<meta name=viewport content='width=device-width, initial-scale=1'>"
RIGHT = "<p>Text.<div style='overflow-x: auto'><div style='width: 3000px'>wide</div></div>"
WRONG = {
    "wider than the window": "<div id=wide style='width: 2000px'>wide</div>",
    "broken picture": "<img alt=none src=none.png>",
    "console": "<script>console.error('a complaint')</script>",
    "request to elsewhere": "<img alt=far src='http://localhost:9/far.png'>",
}


@pytest.fixture
def faults(browser, tmp_path):
    def found(body, width=WIDTHS[0], head=HEAD + VIEWPORT):
        path = tmp_path / "page.html"
        path.write_text(head + body, encoding="utf-8")
        browser.open(path, width)
        return browser.faults()

    return found


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.parametrize("width", WIDTHS)
def test_a_page_that_is_right_has_no_faults(faults, width):
    assert faults(RIGHT, width) == {}


@pytest.mark.browser
@pytest.mark.parametrize("kind", WRONG)
@pytest.mark.parametrize("width", WIDTHS)
def test_each_fault_is_seen(faults, kind, width):
    found = faults(RIGHT + WRONG[kind], width)
    assert kind in found
    if kind == "wider than the window":
        assert set(found) == {kind} and any("DIV#wide" in line for line in found[kind])


@pytest.mark.browser
def test_a_page_that_a_phone_shows_at_a_smaller_scale_is_too_wide(faults):
    assert "wider than the window" in faults(RIGHT, 390, head=HEAD)


@pytest.mark.browser
def test_controls_without_a_name_are_seen(browser, faults):
    faults("<label>a <input></label><input aria-label=b><button>c</button><a href='#'>d</a>")
    assert browser.unnamed() == []
    faults("<input id=one><button></button><svg role=img></svg>")
    assert len(browser.unnamed()) == 3


@pytest.mark.browser
def test_an_error_in_a_script_is_raised(browser, faults):
    faults("")
    assert browser.run("return given[0] + 1", 2) == 3
    with pytest.raises(AssertionError, match="no such"):
        browser.run("throw new Error('no such')")


def test_what_is_missing_is_said(monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert "no chromium on the PATH" in missing()
