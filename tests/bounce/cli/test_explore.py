"""``bounce explore`` writes the page on one bounce, and says what it wrote."""

import json

import bounce
from bounce.cli import main


def test_writes_the_page(tmp_path, capsys):
    path = tmp_path / "page.html"
    assert main(["explore", "--output", str(path)]) == 0
    assert path.read_text(encoding="utf-8") == bounce.explore().html
    assert capsys.readouterr().out == f"wrote {path}\n"


def test_says_it_as_json(tmp_path, capsys):
    path = tmp_path / "page.html"
    assert main(["explore", "--output", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["output"] == str(path)


def test_a_file_that_cannot_be_written_is_an_error_in_one_line(tmp_path, capsys):
    assert main(["explore", "--output", str(tmp_path / "none" / "page.html")]) == 1
    assert capsys.readouterr().err.startswith("bounce: error: ")
