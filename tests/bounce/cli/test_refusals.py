"""What is typed wrongly is refused in one line that says what was expected; an interrupt has its status."""

import sys

import pytest

from bounce.cli import main as entry

SHOT = "shot --speed 28.5 --angle 37.3 --spin 2094".split()
KV = "--model KelvinVoigt --set mu=0.3 --set d1=0.1 --set d2=0.15 --set eta=0.5".split()


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        ([*SHOT[:-1], "inf"], "--spin"),
        ([*SHOT[:-1], "1e999"], "--spin"),
        ([*SHOT, "--stiffness", "1e400"], "--stiffness"),
        ([*SHOT, "--stiffness", "soft"], "--stiffness"),
        ([*SHOT, "--set", "mu=1e400"], "--set"),
        (["map", "--over", "speed=1:1e400:5"], "--over"),
        ([*SHOT[:-3], "12degrees", "--spin", "0"], "--angle"),
        ([*SHOT, *KV, "--set", "mu=0.3m/s", "--stiffness", "2e4"], "unit"),
        (["map", "--over", "speed=10:40:0"], "--over"),
        (["map", "--over", "speed=10m/s:40mph:5"], "--over"),
        (["map", "--over", "speed=a:b:5"], "--over"),
    ],
)
def test_one_line_says_what_was_expected(argv, said, command):
    code, out, err = command(*argv)
    assert (code, out) == (2, "")
    assert said in err
    assert "Traceback" not in err


def test_a_missing_column_is_named_with_those_that_are_there(command, tmp_path):
    table = tmp_path / "shots.csv"
    table.write_text("speed,angle\n28.5,37.3\n")
    code, _, err = command("shot", "--input", table)
    assert code == 2
    assert "['spin']" in err and "['speed', 'angle']" in err


def test_a_table_with_semicolons_needs_commas(command, tmp_path):
    table = tmp_path / "shots.csv"
    table.write_text("speed [mph];angle [deg];spin [rpm]\n167;10,9;2686\n")
    code, _, err = command("flight", "--input", table)
    assert code == 1
    assert "shots.csv" in err and "commas" in err


def test_typeset_minus_signs_and_degrees_are_read(command, tmp_path):
    """As they are copied from a page: U+2212, and the sign for degrees."""
    plain = command(*"shot --speed 28 --angle 40deg --spin -500 --set mu=0.5".split())
    typeset = command(
        "shot", "--speed", "28", "--angle", "40°", "--spin", "\u2212500", "--set", "mu=0.5"
    )
    assert plain[0] == 0 and typeset == plain
    rows = []
    for name, minus in (("a", "-"), ("b", "\u2212")):
        table = tmp_path / f"{name}.csv"
        text = f"speed [m/s],angle [deg],spin [rpm]\n28,40,{minus}500\n"
        table.write_text(text, encoding="utf-8")
        rows.append(command("shot", "--input", table))
    assert rows[0][0] == 0 and rows[0] == rows[1]


def test_an_interrupt_ends_with_the_status_of_the_signal(capsys, monkeypatch):
    def interrupted(*args, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(sys.modules["bounce.cli.main"], "_joined", interrupted)
    assert entry(SHOT) == 130
    assert capsys.readouterr().err == "bounce: interrupted\n"
