"""Measurements come in any of their forms and units as the same numbers; bad ones are named."""

import math

import numpy as np
import pytest

import bounce

POLAR = {
    "speed [m/s]": [28.5, 20.0],
    "angle [deg]": [37.3, 45.0],
    "spin [rpm]": [2094.0, 3000.0],
    "lift_off_speed [m/s]": [10.0, 5.0],
    "lift_off_angle [deg]": [40.0, 120.0],
    "lift_off_spin [rpm]": [-4000.0, 500.0],
}


def rows(columns):
    return [
        dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)
    ]


def csv(tmp_path, columns, **changes):
    path = tmp_path / "data.csv"
    lines = [",".join(columns), *(",".join(map(str, r.values())) for r in rows(columns))]
    path.write_text("# a comment\n" + "\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_every_form_is_the_same(tmp_path):
    pandas_like = {k: np.array(v) for k, v in POLAR.items()}
    forms = [POLAR, pandas_like, rows(POLAR), csv(tmp_path, POLAR), str(csv(tmp_path, POLAR))]
    reference = bounce.read_measurements(forms[0])
    for form in forms[1:]:
        other = bounce.read_measurements(form)
        assert np.array_equal(other.landing, reference.landing)
        assert all(np.array_equal(other.lift_off[c], v) for c, v in reference.lift_off.items())
    landing = bounce.Landing.polar(28.5, math.radians(37.3), 2094)
    expected = [landing.xdot, landing.ydot, landing.omega * bounce.GOLF.radius]
    assert reference.landing[0] == pytest.approx(expected, rel=1e-14)
    assert reference.lift_off["xdot"][1] == pytest.approx(5 * math.cos(math.radians(120)))
    assert reference.si and reference.rows.tolist() == [1, 2]


@pytest.mark.parametrize(
    ("unit", "value"), [("m/s", 10.0), ("km/h", 36.0), ("mph", 10 / 0.44704), ("ft/s", 10 / 0.3048)]
)
def test_units(unit, value):
    data = {
        f"xdot [{unit}]": [value],
        f"ydot ({unit})": [-value],
        "omega [rad/s]": [1.0],
        f"Lift-off ydot [{unit}]": [value],
    }
    read = bounce.read_measurements(data)
    assert read.landing[0, :2] == pytest.approx([10.0, -10.0])
    assert read.lift_off["ydot"] == pytest.approx([10.0])


def test_dimensionless():
    read = bounce.read_measurements(
        dict(xdot=[1.0], ydot=[-1.0], omega=[2.0], lift_off_omega=[0.5])
    )
    assert not read.si and read.landing.tolist() == [[1.0, -1.0, 2.0]]
    assert list(read.lift_off) == ["omega"]


def test_bad_rows_are_named_or_left_out():
    data = dict(
        xdot=[1.0, np.nan, 1.0, 2.0],
        ydot=[-1.0, -1.0, 1.0, -2.0],
        omega=[0.0] * 4,
        lift_off_ydot=[0.5] * 4,
    )
    with pytest.raises(
        bounce.DataError, match=r"row 2: no number in xdot; row 3: it does not approach"
    ):
        bounce.read_measurements(data)
    read = bounce.read_measurements(data, bad_rows="leave out")
    assert read.rows.tolist() == [1, 4]
    assert [row for row, _ in read.left_out] == [2, 3]


def without(*names):
    return {k: v for k, v in POLAR.items() if not k.startswith(names)}


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (without("speed"), r"expected columns \['xdot', 'ydot', 'omega'\] or"),
        (without("lift_off"), "columns of the lift-off"),
        (without("lift_off_angle"), "'lift_off_speed' and 'lift_off_angle' together"),
        (
            {**without("spin"), "spin [furlongs]": [1, 2]},
            r"column 'spin \[furlongs\]': expected a unit among",
        ),
        (
            {**without("spin"), "spin": [1, 2]},
            r"units in all columns or in none, received none in \['spin'\]",
        ),
        ({**without("angle"), "angle": [1, 2]}, r"received none in \['angle'\]"),
        ({**without("spin"), "spin [rpm]": [1]}, "columns of one length"),
        (
            {**without("spin"), "spin [rpm]": [1, "fast"]},
            r"row 2: expected a number, received 'fast'",
        ),
        ({k: [] for k in POLAR}, "at least one row"),
        ({**POLAR, "Speed [mph]": [1, 2]}, "one column 'speed', received two"),
        (42, "path to a CSV file, .* received int"),
        ("nowhere.csv", "readable CSV file"),
    ],
)
def test_messages(data, message):
    with pytest.raises(bounce.DataError, match=message):
        bounce.read_measurements(data)


def test_ragged_and_empty_files(tmp_path):
    path = tmp_path / "ragged.csv"
    path.write_text("xdot,ydot,omega,lift_off_ydot\n1,-1,0\n", encoding="utf-8")
    with pytest.raises(
        bounce.DataError, match=r"ragged\.csv, row 1: expected 4 values, received 3"
    ):
        bounce.read_measurements(path)
    path.write_text("", encoding="utf-8")
    with pytest.raises(bounce.DataError, match="empty file"):
        bounce.read_measurements(path)
