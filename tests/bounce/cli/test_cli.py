"""The command line ends in errors of one line with their exit codes, and its help shows the defaults."""

import json
import subprocess
import sys

import pytest

import nonsmooth as ns
from bounce.cli import CONTACT_MODELS, main

SHOT = "land --speed 28.5 --angle 37.3 --spin 2094"
KV = "--model KelvinVoigt --set mu=0.3 --set d1=0.1 --set d2=0.15 --set eta=0.5"


def test_models(command):
    code, out, _ = command("models", "--json")
    report = json.loads(out)
    assert code == 0 and set(report["contact_models"]) == set(CONTACT_MODELS)
    assert all(entry["source"] for entry in report["turfs"].values())
    assert report["turfs"]["natural"]["landings"]["xdot [m/s]"] == [0.0171, 36.8]
    assert report["version"] == ns.__version__
    out = command("models")[1]
    assert "KelvinVoigt" in out and "2.14 to 33 m/s into the ground" in out


OVER = "--over xdot=-2:2:5 --over omega=-4:4:5 --output "
ON = "--model TiltedBounce --set mu=0.3 "


@pytest.mark.parametrize(
    ("argv", "code", "message"),
    [
        ("", 2, "command"),
        ("land", 2, "--speed"),
        ("land --speed fast --angle 37.3 --spin 2094", 2, "--speed"),
        ("land --speed 28furlongs --angle 37.3 --spin 2094", 2, "m/s, km/h, mph, ft/s"),
        ("land --speed -3mph --angle 30 --spin 0", 2, "-3 mph"),
        ("land --speed 28.5 --angle 100 --spin 0", 2, "--angle"),
        ("land --speed 28.5 --angle 2rad --spin 0", 2, "pi/2 rad"),
        ("land --speed 28.5 --angle 12degrees --spin 0", 2, "--angle"),
        ("launch --speed 60 --angle 0 --spin 0", 2, "--angle"),
        ("land --speed 3 --angle 30", 2, "--spin"),
        ("land --speed 28.5 --angle 37.3 --spin inf", 2, "--spin"),
        ("land --speed 28.5 --angle 37.3 --spin 1e999", 2, "--spin"),
        ("land --input nowhere.csv", 1, "nowhere.csv"),
        (f"{SHOT} --input a.csv", 2, "--input"),
        (f"{SHOT} --turf mud", 2, "--turf"),
        (f"{SHOT} --turf natural --model Hertz", 2, "--model"),
        (f"{SHOT} --set mu", 2, "--set"),
        (f"{SHOT} --set mu=-1", 2, "mu"),
        (f"{SHOT} --set nu=1", 2, "nu"),
        (f"{SHOT} --set mu=0.3deg", 2, "--set"),
        (f"{SHOT} --set mu=1e400", 2, "--set"),
        (f"{SHOT} {ON}", 2, "restitution=..., tilt=..."),
        (f"{SHOT} {ON} --set restitution=0.2 --set tilt=95", 2, "--set tilt"),
        (f"{SHOT} {KV}", 2, "--stiffness"),
        (f"{SHOT} {KV} --set mu=0.3m/s --stiffness 2e4", 2, "unit"),
        (f"{SHOT} --stiffness 1e400", 2, "--stiffness"),
        (f"{SHOT} --stiffness soft", 2, "--stiffness"),
        (f"{SHOT} --turf natural-rigid --slope -10", 1, "slope"),
        (f"{SHOT} --slope 95", 2, "--slope"),
        ("map --over speed=1:9furlongs:3 --output m.png", 2, "--over"),
        ("map --over speed=1m/s:9mph:3 --output m.png", 2, "--over"),
        ("map --over speed=1:1e400:5 --output m.png", 2, "--over"),
        ("map --over speed=10:40:0 --output m.png", 2, "--over"),
        ("map --over speed=a:b:5 --output m.png", 2, "--over"),
        (f"map {KV} --over xdot=1:2 --output m.png", 2, "--over"),
        ("map --over speed=1:9:3 --output m.png", 2, "over"),
        (f"map {KV} --over speed=1:9:3 --over angle=10:20:3 --output m.png", 2, "--stiffness"),
        (f"map --turf natural {OVER} m.png", 2, "over"),
        (f"map {KV} {OVER} map.txt", 2, "--output"),
        (f"map {KV} {OVER} nowhere/map.png", 1, "nowhere"),
        ("fit nowhere.csv --parameters mu", 1, "nowhere.csv"),
    ],
)
def test_errors_are_one_line_with_a_code(command, argv, code, message):
    got, out, err = command(*argv.split())
    lines = [line for line in err.strip().splitlines() if not line.startswith("nonsmooth: compil")]
    assert got == code and out == ""
    assert message in err and len(lines) == 1  # a compilation that takes long prints a line


def test_help(command):
    code, out, _ = command("--help")
    assert code == 0 and all(word in out for word in ("land", "launch", "map", "fit", "models"))


@pytest.mark.parametrize(
    ("name", "defaults"),
    [
        ("land", ["natural", "none", "0.131", "golf", "Coulomb"]),
        ("launch", ["tour-2023", "0.131", "golf"]),
        ("map", ["natural", "region", "angle=5deg:75deg:150", "speed=28m/s"]),
        ("fit", ["16", "natural"]),
    ],
)
def test_help_says_the_defaults(command, name, defaults):
    out = " ".join(command(name, "--help")[1].split())
    assert all(f"{value}" in out.partition("(default")[2] for value in defaults)
    assert "(default: None)" not in out and "(default: [])" not in out


@pytest.mark.parametrize("name", ["land", "launch"])
def test_help_says_what_is_not_validated(command, name):
    assert "not been compared with measurements" in " ".join(command(name, "--help")[1].split())


def test_version(command):
    assert command("--version") == (0, f"bounce {ns.__version__}\n", "")


def test_as_a_process():
    argv = [sys.executable, "-m", "bounce", *SHOT.split(), "--turf", "artificial"]
    done = subprocess.run(argv, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0 and done.stdout.startswith("lift-off"), done.stderr
    assert "Error" not in done.stderr and "Warning" not in done.stderr
    wrong = subprocess.run(
        [*argv, "--set", "mu=-1"], capture_output=True, text=True, timeout=120, check=False
    )
    assert wrong.returncode == 2 and wrong.stderr.startswith("bounce: error: ")


def test_a_missing_column_is_named_with_those_that_are_there(command, tmp_path):
    table = tmp_path / "shots.csv"
    table.write_text("speed,angle\n28.5,37.3\n")
    code, _, err = command("land", "--input", table)
    assert code == 2
    assert "['spin']" in err and "['speed', 'angle']" in err


def test_a_table_with_semicolons_needs_commas(command, tmp_path):
    table = tmp_path / "shots.csv"
    table.write_text("speed [mph];angle [deg];spin [rpm]\n167;10,9;2686\n")
    code, _, err = command("launch", "--input", table)
    assert code == 1
    assert "shots.csv" in err and "commas" in err


def test_typeset_minus_signs_and_degrees_are_read(command, tmp_path):
    """As they are copied from a page: U+2212, and the sign for degrees."""
    plain = command(*"land --speed 28 --angle 40deg --spin -500 --set mu=0.5".split())
    typeset = command(
        "land", "--speed", "28", "--angle", "40°", "--spin", "\u2212500", "--set", "mu=0.5"
    )
    assert plain[0] == 0 and typeset == plain
    rows = []
    for name, minus in (("a", "-"), ("b", "\u2212")):
        table = tmp_path / f"{name}.csv"
        text = f"speed [m/s],angle [deg],spin [rpm]\n28,40,{minus}500\n"
        table.write_text(text, encoding="utf-8")
        rows.append(command("land", "--input", table))
    assert rows[0][0] == 0 and rows[0] == rows[1]


def test_an_interrupt_ends_with_the_status_of_the_signal(capsys, monkeypatch):
    def interrupted(*args, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(sys.modules["bounce.cli.main"], "_joined", interrupted)
    assert main(SHOT.split()) == 130
    assert capsys.readouterr().err == "bounce: interrupted\n"
