"""Command lines end with their exit codes and say what they say; errors are one line."""

import json
from pathlib import Path

import pytest

FILE = Path(__file__).parents[2] / "cases" / "commands.json"
ROWS = json.loads(FILE.read_text(encoding="utf-8"))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["argv"])
def test_command(command, tmp_path, row):
    table = tmp_path / "shots.csv"
    table.write_text(row.get("file", ""), encoding="utf-8")
    argv = row["argv"].replace("FILE", str(table)).split()
    code, out, err = command(*argv)
    assert code == row.get("code", 0)
    assert all(text in " ".join(out.split()) for text in row.get("out", []))
    assert all(text in err for text in row.get("err", []))
    assert "absent" not in row or row["absent"] not in err
    if "error" in row:
        # a compilation that takes long prints a line
        lines = [line for line in err.splitlines() if not line.startswith("nonsmooth: compil")]
        assert out == "" and len(lines) == 1 and row["error"] in lines[0]
