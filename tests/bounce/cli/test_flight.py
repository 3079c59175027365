"""``bounce flight`` carries a ball as the library does, and on to rest where a ground is given."""

import json
import math

import pytest

import bounce

DRIVER = "flight --speed 167mph --angle 10.9 --spin 2686".split()


def test_carry_is_that_of_the_library(command):
    code, out, err = command(*DRIVER, "--json")
    report = json.loads(out)
    v, a = 167 * 0.44704, math.radians(10.9)
    launch = bounce.Landing(v * math.cos(a), v * math.sin(a), 2686 * math.pi / 30)
    expected = bounce.golf.flight(launch, air=bounce.golf.SMITS_SMITH)
    assert (code, err) == (0, "")
    assert report["carry"] == pytest.approx(expected.range, rel=1e-9)
    assert report["height"] == pytest.approx(expected.height, rel=1e-9)
    assert report["landing"]["angle"] == pytest.approx(math.degrees(expected.landing.angle))
    assert "run" not in report


@pytest.mark.parametrize(("air", "yards"), [("smits-smith", 250), ("quintavalla", 272)])
def test_a_drive_in_yards(command, air, yards):
    """A tour drive of 167 mph carries 275 yards on average; published coefficients come near."""
    out = command(*DRIVER, "--air", air, "--units", "us")[1]
    assert out.startswith(f"carry     {yards}.")
    assert "yd" in out and "ft high" in out and "mph" in out
    assert 0.9 * 275 < yards < 1.1 * 275


def test_on_to_rest(command):
    report = json.loads(command(*DRIVER, "--turf", "natural", "--json")[1])
    assert report["total"] == pytest.approx(report["carry"] + report["run"]["run_out"])
    assert report["inputs"]["air"] == "smits-smith"
    lines = command(*DRIVER, "--turf", "natural")[1].splitlines()
    assert [line.split()[0] for line in lines] == ["carry", "landing", "run", "total"]


def test_a_parabola(command):
    report = json.loads(
        command(*"flight --speed 20 --angle 45 --spin 0 --air none --json".split())[1]
    )
    assert report["carry"] == pytest.approx(400 / 9.80665, rel=1e-12)


def test_a_table_of_launches(command, tmp_path):
    path = tmp_path / "launches.csv"
    path.write_text(
        "speed [mph],angle [deg],spin [rpm]\n167,10.9,2686\n120,16.3,7097\n", encoding="utf-8"
    )
    out = command("flight", "--input", path, "--units", "us", "--turf", "natural")[1]
    head, *rows = [line.split(",") for line in out.splitlines()]
    assert "carry [yd]" in head and "total [yd]" in head and len(rows) == 2
    assert 155 < float(rows[1][head.index("carry [yd]")]) < 190
