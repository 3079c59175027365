"""Rows of a table are written as they are computed, an interrupted table continues, a wrong row costs no other."""

import csv
import io
import json
import sys

import pytest

HEAD = "speed [m/s],angle [deg],spin [rpm]\n"
LAUNCHES = [(70, 10.9, 2686), (60, 14, 3000), (50, 18, 5000), (40, 24, 7000), (30, 40, 9000)]
MODULE = sys.modules["bounce.cli.launch"]


def rows_of(text):
    return list(csv.DictReader(io.StringIO(text)))


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "launches.csv"

    def write(launches=LAUNCHES):
        lines = (",".join(map(str, launch)) + "\n" for launch in launches)
        path.write_text(HEAD + "".join(lines), encoding="utf-8")
        return path

    return write


@pytest.fixture
def stopped(monkeypatch):
    """Let Ctrl-C come at a flight; counts flights, and runs something at each."""
    fly = MODULE.flight

    def stop(at=None, look=lambda: None):
        seen = []

        def flight(*args, **options):
            seen.append(look())
            if len(seen) == at:
                raise KeyboardInterrupt
            return fly(*args, **options)

        monkeypatch.setattr(MODULE, "flight", flight)
        return seen

    return stop


def test_a_row_is_in_the_file_before_the_next_is_computed(command, table, tmp_path, stopped):
    out = tmp_path / "out.csv"
    seen = stopped(look=lambda: out.read_text().count("\n"))
    assert command("launch", "--input", table(), "--output", out)[0] == 0
    assert seen == [0, 2, 3, 4, 5]  # the names come with the first row


@pytest.mark.parametrize("cut", [0, 7])
def test_an_interrupted_table_continues_to_the_same_file(command, table, tmp_path, stopped, cut):
    out, whole = tmp_path / "out.csv", tmp_path / "whole.csv"
    command("launch", "--input", table(), "--output", whole)
    stopped(at=4)
    code, said, err = command("launch", "--input", table(), "--output", out)
    assert (code, said) == (130, "")
    assert "3 of 5 rows" in err and str(out) in err and "--resume" in err
    text = whole.read_text().splitlines(keepends=True)
    assert out.read_text() == "".join(text[:4])
    if cut:  # a process that was killed left a part of a row
        out.write_text(out.read_text()[:-cut])
    seen = stopped()
    assert command("launch", "--input", table(), "--output", out, "--resume")[::2] == (0, "")
    assert out.read_text() == whole.read_text()
    assert len(seen) == (
        5 if cut else 4
    )  # two to see that the inputs are the same, and what is left
    seen = stopped()
    assert command("launch", "--input", table(), "--output", out, "--resume")[0] == 0
    assert len(seen) == 2 and out.read_text() == whole.read_text()


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: content.replace(b",", b"\xff", 3),
        lambda content: content + b"9" * 200_000 + b"\n",
        lambda content: content[:-200] + b"\n3\n",
        lambda content: content.replace(b"\n", b"\n3,4\n", 2),
    ],
    ids=["no text", "a huge field", "cut", "short rows"],
)
def test_a_damaged_output_is_not_gone_on_with(damage, command, table, tmp_path):
    out = tmp_path / "out.csv"
    command("launch", "--input", table(), "--output", out)
    out.write_bytes(damage(out.read_bytes()))
    code, _, err = command("launch", "--input", table(), "--output", out, "--resume")
    assert code == 2 and "--resume" in err


def test_other_inputs_are_refused_and_nothing_is_lost(command, table, tmp_path):
    out = tmp_path / "out.csv"
    command("launch", "--input", table(), "--output", out)
    before = out.read_text()
    changed = [*LAUNCHES[:2], (51, 18, 5000), *LAUNCHES[3:]]
    for launches, options, where in [
        (changed, [], "row 3"),
        (LAUNCHES[:3], [], "5 rows"),
        (LAUNCHES, ["--air", "none"], "row 1"),
        (LAUNCHES, ["--turf", "natural"], "row 1"),
    ]:
        argv = ["launch", "--input", table(launches), "--output", out, "--resume"]
        code, _, err = command(*argv, *options)
        assert code == 2 and "--resume" in err and where in err
        assert out.read_text() == before


def test_what_was_computed_is_printed_at_an_interrupt(command, table, stopped):
    for options, count in (([], rows_of), (["--json"], lambda out: json.loads(out)["rows"])):
        stopped(at=3)
        code, out, err = command("launch", "--input", table(), *options)
        assert code == 130 and len(count(out)) == 2
        assert "2 of 5 rows" in err


WRONG = [
    ("fast,11,2700", "'fast' in column 'speed [m/s]'"),
    ("70,11", "3 values"),
    ("70,,2700", "angle"),
    ("-70,11,2700", "-70 m/s"),
    ("1e400,11,2700", "inf m/s"),
    ("70,11,nan", "spin"),
]


@pytest.mark.parametrize("name", ["launch", "land"])
@pytest.mark.parametrize("first", [True, False])
def test_what_is_wrong_with_a_row_is_in_it_and_the_others_are_computed(
    command, tmp_path, name, first
):
    path, good = tmp_path / "rows.csv", ["70,41,2700"]
    lines = [line for line, _ in WRONG]
    path.write_text(HEAD + "\n".join(lines + good if first else good + lines) + "\n")
    out = tmp_path / "out.csv"
    code, _, err = command(name, "--input", path, "--output", out)
    rows = rows_of(out.read_text())
    assert code == 1 and "6 of 7 rows" in err
    computed = rows.pop(-1 if first else 0)
    assert computed["error"] == "" and float(computed[f"{_echo(name)}_speed [m/s]"]) == 70.0
    for row, (_, said) in zip(rows, WRONG, strict=True):
        assert said in row["error"]
    before = out.read_text()
    assert command(name, "--input", path, "--output", out, "--resume")[0] == 1
    assert out.read_text() == before


def _echo(name):
    return "launch" if name == "launch" else "landing"


def test_a_table_of_nothing_but_errors_continues_too(command, tmp_path):
    path, out = tmp_path / "rows.csv", tmp_path / "out.csv"
    path.write_text(HEAD + "fast,11,2700\n")
    command("launch", "--input", path, "--output", out)
    assert [row["row"] for row in rows_of(out.read_text())] == ["1"]
    path.write_text(HEAD + "fast,11,2700\n70,11,2700\n")
    assert command("launch", "--input", path, "--output", out, "--resume")[0] == 1
    assert [bool(row["error"]) for row in rows_of(out.read_text())] == [True, False]


@pytest.mark.parametrize("side", [[], ["--side-spin", "100"]])
@pytest.mark.parametrize("name", ["launch", "land"])
def test_what_was_given_is_echoed_as_it_was_typed(command, tmp_path, name, side):
    """A number that goes through radians and velocities and back differs in its last digits."""
    path, what = tmp_path / "rows.csv", _echo(name)
    path.write_text("speed [mph],angle [deg],spin [rpm]\n40.1,10.9,2686\n")
    for units, speed in (("us", 40.1), ("golf", 40.1 * 0.44704)):
        (row,) = rows_of(command(name, "--input", path, "--units", units, *side)[1])
        assert [row[f"{what}_angle [deg]"], row[f"{what}_spin [rpm]"]] == ["10.9", "2686.0"]
        speed_said = {"us": "40.1", "golf": "17.9263"}[units]
        assert speed_said in [row.get(f"{what}_speed [{unit}]") for unit in ("mph", "m/s")]
        typed = "--speed 40.1mph --angle 10.9 --spin 2686 --json --units".split()
        report = json.loads(command(name, *typed, units, *side)[1])[what]
        assert report == dict(speed=speed, angle=10.9, spin=2686.0)


@pytest.mark.parametrize("name", [["launch", "--turf", "natural"], ["land"]])
def test_a_table_has_the_six_digits_that_are_meant(command, table, name):
    """The table is JSON's to half a unit of the sixth digit, and has no more digits."""
    (row, *_) = rows_of(command(*name, "--input", table())[1])
    (report, *_) = json.loads(command(*name, "--input", table(), "--json")[1])["rows"]
    flat = _flat({key: value for key, value in report.items() if key != _echo(name[0])})
    found = [
        (float(row[next(c for c in row if c.split(" [")[0] == key)]), flat[key]) for key in flat
    ]
    assert len(found) > 5
    for short, whole in found:
        assert short == pytest.approx(whole, rel=5e-6) and short == float(f"{short:.6g}")


def _flat(report, head=""):
    """Nested numbers with joined names."""
    flat = {}
    for key, value in report.items():
        if isinstance(value, dict):
            flat |= _flat(value, f"{head}{key}_")
        elif isinstance(value, float):
            flat[head + key] = value
    return flat


def test_a_tilted_axis_takes_a_part_of_the_spin(command):
    argv = "land --speed 25 --angle 53 --spin 9000 --axis-tilt 10 --launch-angle 28 --json".split()
    assert json.loads(command(*argv)[1])["landing"]["spin"] < 9000


def test_a_launch_beyond_what_was_measured_is_cautioned(command, tmp_path):
    argv = "launch --angle 10 --spin 3000 --speed".split()
    assert command(*argv, 76)[2] == ""
    for more in ([], ["--side-spin", "100"]):
        code, _, err = command(*argv, 1e9, *more)
        assert code == 0 and "1e+09 m/s" in err and "78.2 m/s" in err
    (caution,) = json.loads(command(*argv, 1e9, "--json")[1])["cautions"]
    assert "extrapolation" in caution
    path = tmp_path / "rows.csv"
    path.write_text(HEAD + "1e9,10,3000\n")
    (row,) = rows_of(command("launch", "--input", path)[1])
    assert row["cautions"] == caution
