"""``bounce land`` and ``bounce launch`` take side spin, a tilted axis and a side slope, and print the library's
kick, curve and place of rest."""

import json
import math

import pytest

import bounce

WEDGE = "land --speed 25 --angle 53 --spin 9000 --first-only".split()
RIGID = "--model RigidBounce --set mu=0.5 --set restitution=0.3".split()
KV = "--model KelvinVoigt --set mu=0.5 --set d1=0.1 --set d2=0.5 --set eta=0.3".split()
DEG = math.pi / 180


def test_axis_tilt_is_side_spin_of_the_library(command):
    code, out, err = command(*WEDGE, *RIGID, "--axis-tilt", 10, "--launch-angle", 28, "--json")
    report = json.loads(out)
    back, side, _ = bounce.golf.axis_spin(9000 * math.pi / 30, 10 * DEG, 28 * DEG)
    landing = bounce.Landing.polar(25, 53 * DEG, back * 30 / math.pi)
    law = bounce.laws.RigidBounce(mu=0.5, restitution=0.3)
    hit = bounce.golf.rebound(law, bounce.golf.SideState.of(landing, side))
    assert (code, err) == (0, "")
    assert report["kick"] == pytest.approx(hit.kick / DEG, rel=1e-12) and hit.kick > 0
    assert report["side_spin"] == pytest.approx(side * 30 / math.pi, rel=1e-12)
    assert report["lift_off"]["speed"] == pytest.approx(hit.lift_off.in_plane.speed, rel=1e-12)


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
    code, out, _ = command("land", "--input", table, "--first-only", "--side-spin", 500)
    assert code == 0 and "kick [deg]" in out.splitlines()[0] and len(out.splitlines()) == 3


def test_a_run_until_rest_with_side_spin(command, tmp_path):
    argv = "land --speed 25 --angle 53 --spin 4000".split()
    law = bounce.laws.TURFS["natural"].law
    landing = bounce.Landing.polar(25, 53 * DEG, 4000)
    state = bounce.golf.SideState.of(landing, 500 * math.pi / 30, 0.0, 2 * DEG)
    run = bounce.golf.play(law, state, side_slope=2 * DEG)
    more = ("--side-spin", 500, "--side-slope", 2)
    code, out, _ = command(*argv, *more, "--json")
    report = json.loads(out)
    assert code == 0 and report["run"]["bounces"] == len(run.bounces)
    rest = [report["run"][n] for n in ("run_out", "run_side")]
    assert rest == pytest.approx([run.run_out, run.side], rel=1e-12)
    assert report["run"]["kick"] == pytest.approx(run.kick / DEG, rel=1e-9)
    words = command(*argv, *more)[1]
    assert f"run       {run.run_out:.1f} m on and {abs(run.side):.1f} m to the " in words
    assert f"over {run.bounced:.1f} m; rolls {run.rolled:.1f} m" in words
    table = tmp_path / "landings.csv"
    table.write_text("speed,angle,spin\n25,53,4000\n", encoding="utf-8")
    code, out, _ = command("land", "--input", table, "--side-spin", 500)
    assert code == 0 and "run_run_side [m]" in out.splitlines()[0]


@pytest.mark.slow
def test_a_flight_curves_with_the_axis(command, tmp_path):
    argv = "launch --speed 70 --angle 11 --spin 2700 --axis-tilt".split()
    report = json.loads(command(*argv, 10, "--turf", "natural", "--json")[1])
    spin = bounce.golf.axis_spin(2700 * math.pi / 30, 10 * DEG, 11 * DEG)
    launch = bounce.Landing(70 * math.cos(11 * DEG), 70 * math.sin(11 * DEG), spin.backspin)
    start = bounce.golf.SideState.of(launch, spin.side, spin.vertical)
    path = bounce.golf.flight(start, air=bounce.golf.TOUR_2023)
    assert report["side"] == pytest.approx(path.side, rel=1e-9) and path.side > 0
    assert report["heading"] == pytest.approx(path.landing.heading / DEG, rel=1e-9)
    assert report["total_side"] == pytest.approx(path.side + report["run"]["run_side"], rel=1e-12)
    code, out, _ = command(*argv, -10, "--turf", "natural")
    assert code == 0 and f"{path.side:.0f} m to the left" in out and "total" in out
    table = tmp_path / "launches.csv"
    table.write_text("speed,angle,spin\n70,11,2700\n", encoding="utf-8")
    assert "side [m]" in command("launch", "--input", table, "--axis-tilt", 10)[1]
