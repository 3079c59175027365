"""``bounce launch`` carries a ball as the library does, and on to rest where a ground is given."""

import csv
import json
import math

import pytest

import bounce

DRIVER = "launch --speed 167mph --angle 10.9 --spin 2686".split()


def test_carry_is_that_of_the_library(command):
    code, out, err = command(*DRIVER, "--json")
    report = json.loads(out)
    v, a = 167 * 0.44704, math.radians(10.9)
    launch = bounce.Landing(v * math.cos(a), v * math.sin(a), 2686 * math.pi / 30)
    expected = bounce.golf.flight(launch, air=bounce.golf.TOUR_2023)
    assert (code, err) == (0, "")
    assert report["carry"] == pytest.approx(expected.range, rel=1e-9)
    assert report["height"] == pytest.approx(expected.height, rel=1e-9)
    assert report["landing"]["angle"] == pytest.approx(math.degrees(expected.landing.angle))
    assert "run" not in report


def test_on_to_rest(command):
    report = json.loads(command(*DRIVER, "--turf", "natural", "--json")[1])
    assert report["total"] == pytest.approx(report["carry"] + report["run"]["run_out"])
    assert report["inputs"]["air"] == "tour-2023"
    lines = command(*DRIVER, "--turf", "natural")[1].splitlines()
    assert [line.split()[0] for line in lines] == ["carry", "landing", "run", "total"]


def test_a_parabola(command):
    report = json.loads(
        command(*"launch --speed 20 --angle 45 --spin 0 --air none --json".split())[1]
    )
    assert report["carry"] == pytest.approx(400 / 9.80665, rel=1e-12)


def test_a_table_of_launches(command, tmp_path):
    path = tmp_path / "launches.csv"
    path.write_text(
        "speed [mph],angle [deg],spin [rpm]\n167,10.9,2686\n120,16.3,7097\n", encoding="utf-8"
    )
    out = command("launch", "--input", path, "--units", "us", "--turf", "natural")[1]
    head, *rows = [line.split(",") for line in out.splitlines()]
    assert "carry [yd]" in head and "total [yd]" in head and len(rows) == 2
    assert 155 < float(rows[1][head.index("carry [yd]")]) < 190


def test_wind_and_altitude_are_those_of_the_library(command):
    more = "--wind -10mph --altitude 5000ft --temperature 25 --units us --json".split()
    report = json.loads(command(*DRIVER, *more)[1])
    launch = bounce.Landing.polar(167 * 0.44704, math.radians(10.9), 2686)
    launch = bounce.Landing(launch.xdot, -launch.ydot, launch.omega)
    air = bounce.golf.TOUR_2023.at(5000 * 0.3048, 25.0)
    expected = bounce.golf.flight(launch, air=air, wind=(-4.4704, 0.0))
    assert report["carry"] == pytest.approx(expected.range / 0.9144, rel=1e-9)
    assert report["inputs"]["altitude"] == {"value": 5000, "unit": "ft"}
    across = json.loads(command(*DRIVER, "--cross-wind", "5", "--json")[1])
    assert across["side"] > 5.0
    code, _, err = command(*DRIVER, "--air", "none", "--wind", "3")
    assert code == 2 and "--air" in err


MONITOR = """Club,Ball Speed (mph),Launch Angle (deg),Backspin (rpm),carry [yd],Date
driver,167,10.9,2686,275,2026-05-01
7-iron,120,16.3,,172,2026-05-02
"""


def test_headings_of_launch_monitors_are_taken_and_other_columns_kept(command, tmp_path):
    path, out = tmp_path / "shots.csv", tmp_path / "out.csv"
    path.write_text(MONITOR, encoding="utf-8")
    code = command("launch", "--input", path, "--units", "us", "--output", out)[0]
    head, driver, iron = csv.reader(out.read_text().splitlines())
    assert code == 1 and head[:4] == ["row", "Club", "given carry [yd]", "Date"]
    assert driver[:4] == ["1", "driver", "275", "2026-05-01"] and iron[:2] == ["2", "7-iron"]
    assert float(driver[head.index("carry [yd]")]) == pytest.approx(267, abs=1)
    assert "spin" in iron[head.index("error")]
    again = command("launch", "--input", path, "--units", "us", "--output", out, "--resume")
    assert again[0] == 1
    path.write_text(MONITOR.replace("16.3,,", "16.3,7097,"), encoding="utf-8")
    rows = json.loads(command("launch", "--input", path, "--json")[1])["rows"]
    assert rows[1]["others"]["Club"] == "7-iron" and rows[1]["carry"] > 100


@pytest.mark.parametrize(
    "head",
    [
        "BALL SPEED (MPH),LAUNCH ANGLE (DEG),SPIN RATE (RPM)",
        "BallSpeed [mph],LaunchAngle [deg],BackSpin [rpm]",
        "Ball Speed,Launch Angle,Spin Rate\n[mph],[deg],[rpm]",
        "Ball Speed [mph],Launch V [°],Total Spin [rpm]",
    ],
)
def test_headings_may_have_capitals_and_units_a_row_of_their_own(command, tmp_path, head):
    path = tmp_path / "shots.csv"
    path.write_text(f"{head}\n167,10.9,2686\n", encoding="utf-8")
    code, out, _ = command("launch", "--input", path, "--json")
    (row,) = json.loads(out)["rows"]
    assert code == 0 and row["carry"] == pytest.approx(244.1, abs=0.1)


def test_an_exact_heading_counts_before_those_of_launch_monitors(command, tmp_path):
    path = tmp_path / "shots.csv"
    path.write_text("speed,angle,spin,ball speed\n70,11,2700,not this\n", encoding="utf-8")
    code, out, _ = command("launch", "--input", path)
    assert code == 0 and "not this" in out
    path.write_text(
        "Land Angle (°),Impact Speed (m/s),Backspin (rpm)\n40,28,2100\n", encoding="utf-8"
    )
    code, out, _ = command("land", "--input", path)
    assert code == 0 and "lift_off_speed" in out
