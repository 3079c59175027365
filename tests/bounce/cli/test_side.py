"""``bounce shot`` takes side spin, a tilted axis and a side slope, and prints the library's kick."""

import json
import math

import pytest

import bounce

WEDGE = "shot --speed 25 --angle 53 --spin 9000 --first-only".split()
RIGID = "--model RigidBounce --set mu=0.5 --set restitution=0.3".split()
KV = "--model KelvinVoigt --set mu=0.5 --set d1=0.1 --set d2=0.5 --set eta=0.3".split()
DEG = math.pi / 180


def test_axis_tilt_is_side_spin_of_the_library(command):
    code, out, err = command(*WEDGE, *RIGID, "--axis-tilt", 10, "--launch-angle", 28, "--json")
    report = json.loads(out)
    back, side, _ = bounce.golf.axis_spin(9000 * math.pi / 30, 10 * DEG, 28 * DEG)
    landing = bounce.Landing.polar(25, 53 * DEG, back * 30 / math.pi)
    law = bounce.laws.RigidBounce(mu=0.5, restitution=0.3)
    hit = bounce.golf.side_rebound(law, landing, side)
    assert (code, err) == (0, "")
    assert report["kick"] == pytest.approx(hit.kick / DEG, rel=1e-12) and hit.kick > 0
    assert report["side_spin"] == pytest.approx(side * 30 / math.pi, rel=1e-12)
    assert report["lift_off"]["speed"] == pytest.approx(hit.lift_off.speed, rel=1e-12)


def test_side_spin_and_side_slope_in_words(command):
    code, out, _ = command(*WEDGE, *KV, "--stiffness", 20000, "--side-spin", "-500rpm")
    assert code == 0 and " left, side spin -500 rpm before" in out and "(* s" in out
    right = command(*WEDGE, *KV, "--stiffness", 20000, "--side-spin", "500rpm")[1]
    assert right == out.replace(" left", " right").replace("-500", "500").replace(
        out.split("before, ")[1], right.split("before, ")[1]
    )
    assert " left, " in command(*WEDGE, *RIGID, "--side-slope", 3)[1]
    assert "kick      0.0 deg to neither side" in command(*WEDGE, *RIGID, "--side-spin", 0)[1]


def test_published_turf_and_tables(command, tmp_path):
    """The laws of turf are tilted planes; a table has a row for each landing."""
    code, out, _ = command(*WEDGE, "--side-spin", 500)
    assert code == 0 and "kick" in out
    table = tmp_path / "landings.csv"
    table.write_text(
        "speed [m/s],angle [deg],spin [rpm]\n25,53,9000\n20,45,6000\n", encoding="utf-8"
    )
    code, out, _ = command("shot", "--input", table, "--first-only", "--side-spin", 500)
    assert code == 0 and "kick [deg]" in out.splitlines()[0] and len(out.splitlines()) == 3


@pytest.mark.parametrize(
    "argv, message",
    [
        (["--side-spin", "100"], "--side-spin: expected with --first-only"),
        (["--first-only", "--axis-tilt", "10"], "expected together with --launch-angle"),
        (["--first-only", "--launch-angle", "10"], "expected together with --launch-angle"),
        (
            ["--first-only", "--side-spin", "1", "--axis-tilt", "10", "--launch-angle", "9"],
            "expected instead of --side-spin",
        ),
        (["--first-only", "--side-slope", "95"], "side_slope: expected radians"),
    ],
)
def test_usage_errors(command, argv, message):
    code, _, err = command(*"shot --speed 25 --angle 53 --spin 9000".split(), *RIGID, *argv)
    assert code == 2 and message in err
