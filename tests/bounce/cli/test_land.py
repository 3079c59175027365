"""``bounce land`` gives the library's numbers in any units, echoes its inputs, and reads tables."""

import csv
import io
import json
import math

import numpy as np
import pytest

import bounce
import nonsmooth as ns

SHOT = "land --speed 28.5 --angle 37.3 --spin 2094".split()
EXPECTED = bounce.golf.play(
    bounce.laws.TURFS["natural"].law, bounce.Landing.polar(28.5, math.radians(37.3), 2094)
)
SPEED, RUN_OUT = EXPECTED.bounces[0].rebound.lift_off.speed, EXPECTED.run_out
KV = "--model KelvinVoigt --set mu=0.3 --set d1=0.1 --set d2=0.15 --set eta=0.5".split()


def test_shot_is_play(command):
    code, out, err = command(*SHOT, "--turf", "natural", "--json")
    report = json.loads(out)
    landing = bounce.Landing.polar(28.5, np.radians(37.3), 2094)
    expected = bounce.golf.play(bounce.laws.TURFS["natural"].law, landing)
    assert (code, err) == (0, "")
    assert report["run"]["run_out"] == pytest.approx(expected.run_out, rel=1e-12)
    off = expected.bounces[0].rebound.lift_off
    assert report["lift_off"]["spin"] == pytest.approx(off.backspin_rpm, rel=1e-12)
    assert command(*SHOT)[1].startswith("lift-off  10.7 m/s, 37.3 deg")


def test_the_turf_that_was_not_typed_is_an_input_too(command):
    shot = json.loads(command(*SHOT, "--json")[1])
    assert shot["inputs"]["turf"] == "natural"
    assert json.loads(command(*SHOT, "--turf", "penner", "--json")[1])["inputs"]["turf"] == "penner"
    contact = json.loads(command(*SHOT, *KV, "--stiffness", "2e4", "--first-only", "--json")[1])
    assert contact["inputs"]["turf"] is None and contact["inputs"]["model"] == "KelvinVoigt"
    flight = "launch --speed 20 --angle 45 --spin 0 --json".split()
    assert json.loads(command(*flight)[1])["inputs"]["turf"] is None  # it has no ground


def test_units_are_two_views_of_one_shot(command):
    golf = json.loads(command(*SHOT, "--json")[1])
    argv = ["land", "--speed", 28.5, "--angle", np.radians(37.3), "--spin", 2094 * np.pi / 30]
    si = json.loads(command(*argv, "--units", "si", "--json")[1])
    assert si["run"] == pytest.approx(golf["run"], rel=1e-9)
    assert si["lift_off"]["angle"] == pytest.approx(np.radians(golf["lift_off"]["angle"]))


def test_shot_on_a_contact_model_and_through_air(command):
    argv = [*SHOT, *KV, "--stiffness", "2e4", "--air", "smits-smith", "--json"]
    code, out, _ = command(*argv)
    report = json.loads(out)
    assert code == 0 and report["contact_time"] > 0 and "G=0.001" in report["model"]
    code, out, _ = command(*argv, "--first-only")
    assert "run" not in json.loads(out)
    assert command(*SHOT, *KV, "--stiffness", "2e4")[1].splitlines()[1].startswith("contact")
    stribeck = ["--friction", "Stribeck", "--set", "mu_kinetic=0.2", "--set", "stribeck_speed=0.5"]
    assert "Stribeck" in json.loads(command(*argv, *stribeck, "--first-only")[1])["model"]


@pytest.mark.parametrize(
    "words",
    [
        "--speed 28.5m/s --angle 37.3deg --spin 2094rpm",
        "--speed 102.6km/h --angle 0.6510078109938851rad --spin 219.2831rad/s",
        "--speed 63.753mph --angle 37.3 --spin 34.9rev/s",
        "--speed 63.753 --angle 37.3 --spin 2094 --units us",
        "--units si --speed 28.5 --angle 37.3deg --spin 2094rpm",
    ],
)
def test_units_are_given_or_those_of_the_system(command, words):
    report = json.loads(command("land", *words.split(), "--json")[1])
    us = "us" in words.split()
    assert report["lift_off"]["speed"] * (0.44704 if us else 1.0) == pytest.approx(SPEED, rel=1e-4)
    assert report["run"]["run_out"] * (0.9144 if us else 1.0) == pytest.approx(RUN_OUT, rel=1e-4)


def test_yards_feet_and_mph(command):
    out = command(*"land --speed 63.753mph --angle 37.3 --spin 2094 --units us".split())[1]
    assert out.startswith(
        f"lift-off  {SPEED / 0.44704:.1f} mph, 37.3 deg, -4536 rpm, slip -3.6 mph"
    )
    assert f"{RUN_OUT / 0.9144:.0f} yd in 4.9 s" in out
    assert f"the first {EXPECTED.first_height / 0.3048:.1f} ft high" in out


def test_every_input_is_echoed_with_the_version(command):
    words = "--turf artificial --air quintavalla --slope -2deg --rolling-friction 0.2 --set mu=0.7"
    report = json.loads(command(*SHOT, *words.split(), "--json")[1])
    assert report["version"] == ns.__version__ and report["command"] == "land"
    inputs = report["inputs"]
    assert inputs["speed"] == dict(value=28.5, unit="m/s")
    assert inputs["angle"] == dict(value=37.3, unit="deg")
    assert inputs["spin"] == dict(value=2094.0, unit="rpm")
    assert inputs["slope"] == dict(value=-2.0, unit="deg")
    assert inputs["set"] == [dict(mu=0.7)]
    for name, value in dict(
        turf="artificial", air="quintavalla", rolling_friction=0.2, ball="golf", units="golf"
    ).items():
        assert inputs[name] == value
    assert report["units"]["speed"] == "m/s" and report["cautions"] == []


def test_angles_of_the_model_have_units(command):
    law = ["--model", "TiltedBounce", "--set", "mu=0.4", "--set", "restitution=0.3"]
    one = command(*SHOT, *law, "--set", "tilt=15deg")[1]
    assert one == command(*SHOT, *law, "--set", "tilt=15")[1]
    assert one == command(*SHOT, *law, "--set", f"tilt={math.radians(15)}rad")[1]
    assert (
        "TiltedBounce" in json.loads(command(*SHOT, *law, "--set", "tilt=15", "--json")[1])["model"]
    )


def test_a_shot_beyond_the_fit_is_cautioned(command):
    code, out, err = command("land", "--speed", 28, "--angle", 90, "--spin", 0)
    assert code == 0 and out.startswith("lift-off")
    assert err.startswith("bounce: caution: TiltedBounce: a landing outside") and "90 deg" in err
    assert len(err.strip().splitlines()) == 1
    report = json.loads(command("land", "--speed", 28, "--angle", 90, "--spin", 0, "--json")[1])
    assert len(report["cautions"]) == 1 and report["run"]["extrapolated"] > 0


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "landings.csv"
    path.write_text(
        "speed [mph],angle [deg],spin [rpm],note\n63.753,37.3,2094,a drive\n40,120,0,wrong\n"
        "60,90,0,a drop\n50,45,,nothing\n",
        encoding="utf-8",
    )
    return path


def test_a_table_of_landings(command, table, tmp_path):
    code, out, err = command("land", "--input", table)
    rows = list(csv.DictReader(io.StringIO(out)))
    assert code == 1 and len(rows) == 4
    assert "1 of 4 rows: see cautions" in err and "2 of 4 rows: see the column error" in err
    alone = json.loads(command(*SHOT[:-1], "2094", "--json")[1])
    assert float(rows[0]["lift_off_speed [m/s]"]) == pytest.approx(
        alone["lift_off"]["speed"], rel=1e-4
    )
    assert float(rows[0]["run_run_out [m]"]) == pytest.approx(alone["run"]["run_out"], rel=1e-4)
    assert rows[0]["error"] == "" and rows[0]["cautions"] == ""
    assert "120 deg" in rows[1]["error"] and rows[1]["itinerary"] == ""
    assert "outside what it was fitted to" in rows[2]["cautions"]
    assert "spin" in rows[3]["error"]
    written = tmp_path / "out.csv"
    assert command("land", "--input", table, "--output", written)[1] == ""
    assert written.read_text(encoding="utf-8") == out
    report = json.loads(command("land", "--input", table, "--json")[1])
    assert [row["row"] for row in report["rows"]] == [1, 2, 3, 4]
    assert report["inputs"]["input"] == str(table)


def test_a_table_without_units_has_those_of_the_system(command, tmp_path):
    path = tmp_path / "plain.csv"
    path.write_text("speed,angle,spin\n28.5,37.3,2094\n", encoding="utf-8")
    rows = list(csv.DictReader(io.StringIO(command("land", "--input", path)[1])))
    assert float(rows[0]["run_run_out [m]"]) == pytest.approx(RUN_OUT, rel=1e-4)
    rows = list(csv.DictReader(io.StringIO(command("land", "--input", path, "--units", "us")[1])))
    assert float(rows[0]["landing_speed [mph]"]) == pytest.approx(28.5)
