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
    reference = bounce.golf.read_measurements(forms[0])
    for form in forms[1:]:
        other = bounce.golf.read_measurements(form)
        assert np.array_equal(other.landing, reference.landing)
        assert all(np.array_equal(other.lift_off[c], v) for c, v in reference.lift_off.items())
    landing = bounce.Landing.polar(28.5, math.radians(37.3), 2094)
    expected = [landing.xdot, landing.ydot, landing.omega * bounce.golf.GOLF.radius]
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
    read = bounce.golf.read_measurements(data)
    assert read.landing[0, :2] == pytest.approx([10.0, -10.0])
    assert read.lift_off["ydot"] == pytest.approx([10.0])


def test_dimensionless():
    read = bounce.golf.read_measurements(
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
    with pytest.raises(bounce.golf.DataError, match=r"row 2: .*xdot; row 3"):
        bounce.golf.read_measurements(data)
    read = bounce.golf.read_measurements(data, bad_rows="leave out")
    assert read.rows.tolist() == [1, 4]
    assert [row for row, _ in read.left_out] == [2, 3]


def without(*names):
    return {k: v for k, v in POLAR.items() if not k.startswith(names)}


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (without("speed"), "xdot"),
        (without("lift_off"), "lift_off_speed"),
        (without("lift_off_angle"), "lift_off_angle"),
        ({**without("spin"), "spin [furlongs]": [1, 2]}, "furlongs"),
        ({**without("spin"), "spin": [1, 2]}, "spin"),
        ({**without("angle"), "angle": [1, 2]}, "angle"),
        ({**without("spin"), "spin [rpm]": [1]}, "spin"),
        ({**without("spin"), "spin [rpm]": [1, "fast"]}, "row 2: .*fast"),
        ({k: [] for k in POLAR}, "data"),
        ({**POLAR, "Speed [mph]": [1, 2]}, "speed"),
        (42, "data"),
        ("nowhere.csv", "nowhere.csv"),
        ("no\0where.csv", r"no\\x00where\.csv"),
    ],
)
def test_messages(data, message):
    with pytest.raises(bounce.golf.DataError, match=message):
        bounce.golf.read_measurements(data)


def test_ragged_and_empty_files(tmp_path):
    path = tmp_path / "ragged.csv"
    path.write_text("xdot,ydot,omega,lift_off_ydot\n1,-1,0\n", encoding="utf-8")
    with pytest.raises(bounce.golf.DataError, match=r"ragged\.csv, row 1"):
        bounce.golf.read_measurements(path)
    path.write_text("", encoding="utf-8")
    with pytest.raises(bounce.golf.DataError, match="ragged"):
        bounce.golf.read_measurements(path)


ROW = "speed [m/s],angle [deg],spin [rpm],lift_off_spin [rpm]"


def test_a_column_twice_is_refused_and_named(tmp_path):
    """Whichever of the two were taken, it could be the wrong one."""
    path = tmp_path / "twice.csv"
    path.write_text(f"{ROW},speed [m/s]\n20,30,3000,-1000,99\n", encoding="utf-8")
    with pytest.raises(bounce.golf.DataError, match=r"speed \[m/s\]"):
        bounce.golf.read_measurements(path)
    path.write_text(f"{ROW},note,note,,\n20,30,3000,-1000,a,b,,\n", encoding="utf-8")
    assert bounce.golf.read_measurements(path).landing.shape == (1, 3)  # others are ignored


def test_a_frame_with_a_column_twice_is_refused():
    """It iterates over titles; for one that occurs twice it gives both columns."""

    class Frame:
        def __iter__(self):
            return iter([*ROW.split(","), "speed [m/s]"])

        def __getitem__(self, title):
            return np.array([[20.0, 99.0]] if title == "speed [m/s]" else [30.0])

    table = Frame()
    with pytest.raises(bounce.golf.DataError, match="speed"):
        bounce.golf.read_measurements(table)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (ROW + "\n20,30,3000," + "9" * 200_000 + "\n", "odd.csv"),
        (ROW + '\n20,30,3000,"-1000\n', "row 1|odd.csv"),
        (b"\xff\xfe" + (ROW + "\n").encode("utf-16-le"), "odd.csv"),
        (ROW.encode() + b"\n20,30,3000,\0\n", "row 1|odd.csv"),
    ],
    ids=["a huge field", "an open quote", "UTF-16", "NUL"],
)
def test_files_that_are_no_csv(tmp_path, content, message):
    path = tmp_path / "odd.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(bounce.golf.DataError, match=message):
        bounce.golf.read_measurements(path)


def test_a_file_without_end_is_refused(monkeypatch):
    monkeypatch.setattr("bounce.golf.fits.columns.LARGEST", 1 << 16)
    with pytest.raises(bounce.golf.DataError, match="bytes"):
        bounce.golf.read_measurements("/dev/zero")
