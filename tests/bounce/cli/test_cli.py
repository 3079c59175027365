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
