"""The command line ends in errors of one line with their exit codes, and says its defaults."""

import json
import subprocess
import sys

import pytest

import nonsmooth as ns
from bounce.cli import CONTACT_MODELS

SHOT = "shot --speed 28.5 --angle 37.3 --spin 2094".split()
KV = "--model KelvinVoigt --set mu=0.3 --set d1=0.1 --set d2=0.15 --set eta=0.5".split()


def test_models(command):
    code, out, _ = command("models", "--json")
    report = json.loads(out)
    assert code == 0 and set(report["contact_models"]) == set(CONTACT_MODELS)
    assert all(entry["source"] for entry in report["turfs"].values())
    assert report["turfs"]["natural"]["landings"]["xdot [m/s]"] == [0.0171, 36.8]
    assert report["version"] == ns.__version__
    out = command("models")[1]
    assert "KelvinVoigt" in out and "2.14 to 33 m/s into the ground" in out


OVER = ["--over", "xdot=-2:2:5", "--over", "omega=-4:4:5", "--output"]


@pytest.mark.parametrize(
    ("argv", "code", "message"),
    [
        ([], 2, "command"),
        (["shot"], 2, "--speed"),
        (
            [*SHOT[:2], "fast", *SHOT[3:]],
            2,
            "--speed",
        ),
        ([*SHOT, "--turf", "mud"], 2, "--turf"),
        ([*SHOT, "--turf", "natural", "--model", "Hertz"], 2, "--model"),
        ([*SHOT, "--set", "mu"], 2, "--set"),
        ([*SHOT, "--set", "mu=-1"], 2, "mu"),
        ([*SHOT, "--set", "nu=1"], 2, "nu"),
        ([*SHOT, *KV], 2, "--stiffness"),
        ([*SHOT, "--model", "TiltedBounce", "--set", "mu=0.3"], 2, "restitution=..., tilt=..."),
        (
            ["shot", "--speed", "28.5", "--angle", "100", "--spin", "0"],
            2,
            "--angle",
        ),
        (
            ["shot", "--speed", "28.5", "--angle", "2rad", "--spin", "0"],
            2,
            "pi/2 rad",
        ),
        (
            ["shot", "--speed", "-3mph", "--angle", "30", "--spin", "0"],
            2,
            "-3 mph",
        ),
        (
            [*SHOT[:2], "28furlongs", *SHOT[3:]],
            2,
            "m/s, km/h, mph, ft/s",
        ),
        (
            ["shot", "--speed", "3", "--angle", "30"],
            2,
            "--spin",
        ),
        ([*SHOT, "--input", "a.csv"], 2, "--input"),
        (["shot", "--input", "nowhere.csv"], 1, "nowhere.csv"),
        (["flight", "--speed", "60", "--angle", "0", "--spin", "0"], 2, "--angle"),
        (
            [
                *SHOT,
                "--model",
                "TiltedBounce",
                "--set",
                "mu=0.3",
                "--set",
                "restitution=0.2",
                "--set",
                "tilt=95",
            ],
            2,
            "--set tilt",
        ),
        ([*SHOT, "--set", "mu=0.3deg"], 2, "--set"),
        (["map", "--over", "speed=1:9furlongs:3", "--output", "m.png"], 2, "--over"),
        (["map", "--over", "speed=1m/s:9mph:3", "--output", "m.png"], 2, "--over"),
        (["map", "--over", "speed=1:9:3", "--output", "m.png"], 2, "over"),
        (
            ["map", *KV, "--over", "speed=1:9:3", "--over", "angle=10:20:3", "--output", "m.png"],
            2,
            "--stiffness",
        ),
        ([*SHOT, "--turf", "natural-rigid", "--slope", "-10"], 1, "slope"),
        (
            [*SHOT, "--slope", "95"],
            2,
            "--slope",
        ),
        (
            ["map", "--turf", "natural", *OVER, "m.png"],
            2,
            "over",
        ),
        (["map", *KV, *OVER, "map.txt"], 2, "--output"),
        (["map", *KV, "--over", "xdot=1:2", "--output", "m.png"], 2, "--over"),
        (["map", *KV, *OVER, "nowhere/map.png"], 1, "nowhere"),
        (["fit", "nowhere.csv", "--parameters", "mu"], 1, "nowhere.csv"),
    ],
)
def test_errors_are_one_line_with_a_code(command, argv, code, message):
    got, out, err = command(*argv)
    told = [line for line in err.strip().splitlines() if not line.startswith("nonsmooth: compil")]
    assert got == code and out == ""
    assert message in err and len(told) == 1  # a compilation that takes long says so


def test_help(command):
    code, out, _ = command("--help")
    assert code == 0 and all(word in out for word in ("shot", "flight", "map", "fit", "models"))


@pytest.mark.parametrize(
    ("name", "defaults"),
    [
        ("shot", ["natural", "none", "0.131", "golf", "Coulomb"]),
        ("flight", ["smits-smith", "0.131", "golf"]),
        ("map", ["natural", "region", "angle=5deg:75deg:150", "speed=28m/s"]),
        ("fit", ["16", "natural"]),
    ],
)
def test_help_says_the_defaults(command, name, defaults):
    out = " ".join(command(name, "--help")[1].split())
    assert all(f"{value}" in out.partition("(default")[2] for value in defaults)
    assert "(default: None)" not in out and "(default: [])" not in out


@pytest.mark.parametrize("name", ["shot", "flight"])
def test_help_says_what_is_not_validated(command, name):
    assert "not been compared with measurements" in " ".join(command(name, "--help")[1].split())


def test_version(command):
    assert command("--version") == (0, f"bounce {ns.__version__}\n", "")


def test_as_a_process():
    argv = [sys.executable, "-m", "bounce", *SHOT, "--turf", "artificial"]
    done = subprocess.run(argv, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0 and done.stdout.startswith("lift-off"), done.stderr
    assert "Error" not in done.stderr and "Warning" not in done.stderr
    wrong = subprocess.run(
        [*argv, "--set", "mu=-1"], capture_output=True, text=True, timeout=120, check=False
    )
    assert wrong.returncode == 2 and wrong.stderr.startswith("bounce: error: ")
