"""``bounce fit`` finds parameters, and says which the data do not determine."""

import json

import numpy as np
import pytest

import bounce


@pytest.fixture
def measured(tmp_path):
    law = bounce.laws.TiltedBounce(mu=0.25, restitution=0.4, tilt=0.2)
    rng = np.random.default_rng(0)
    u, v, w = rng.uniform(5, 25, 30), rng.uniform(5, 20, 30), rng.uniform(-5, 8, 30)
    off = law.lift_off(u, -v, w)
    radius = bounce.golf.GOLF.radius
    columns = [u, -v, w / radius, off.xdot, off.ydot, off.omega / radius]
    path = tmp_path / "data.csv"
    head = "xdot [m/s],ydot [m/s],omega [rad/s],lift_off_xdot [m/s],lift_off_ydot [m/s],lift_off_omega [rad/s]"
    np.savetxt(path, np.column_stack(columns), fmt="%.12g", delimiter=",", header=head, comments="")
    return path


@pytest.mark.slow
def test_fit(command, tmp_path, measured):
    picture = tmp_path / "residuals.png"
    argv = ["fit", measured, "--turf", "natural", "--parameters", "mu,restitution,tilt"]
    code, out, _ = command(*argv, "--json", "--residuals", picture)
    report = json.loads(out)
    assert report["inputs"]["starts"] == 16 and report["version"]
    assert code == 0 and picture.exists()
    assert report["values"] == pytest.approx(dict(mu=0.25, restitution=0.4, tilt=0.2), rel=1e-6)
    assert "95 %" in command(*argv)[1]


@pytest.mark.slow
def test_parameters_that_are_not_determined(command, tmp_path):
    rng = np.random.default_rng(15)
    u, v, w = rng.uniform(15, 25, 4), -rng.uniform(10, 18, 4), rng.uniform(100, 300, 4)
    columns = [u, v, w, u * 0.4 + rng.normal(size=4), -0.4 * v, -w]
    path = tmp_path / "few.csv"
    head = "xdot [m/s],ydot [m/s],omega [rad/s],lift_off_xdot [m/s],lift_off_ydot [m/s],lift_off_omega [rad/s]"
    np.savetxt(path, np.column_stack(columns), fmt="%.17g", delimiter=",", header=head, comments="")
    code, out, err = command("fit", path, "--parameters", "mu,restitution,tilt")
    assert code == 3 and "(not determined by these data)" in out
    assert err.startswith("bounce: caution: mu: not determined by these data")
    code, out, _ = command("fit", path, "--parameters", "mu,restitution,tilt", "--json")
    assert code == 3 and json.loads(out)["undetermined"] == ["mu"]


@pytest.mark.slow
def test_an_interval_that_is_too_narrow_is_shown_beside_its_profile(command, tmp_path):
    turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    rng = np.random.default_rng(36)
    u = rng.uniform(-0.1, 0.1, 5)
    w = -u + rng.uniform(-0.1, 0.1, 5)
    off = bounce.lift_off(turf, u, -1.0, w)
    lift_off = [getattr(off, n) + rng.normal(size=5) * 0.001 for n in ("xdot", "ydot", "omega")]
    path = tmp_path / "gentle.csv"
    head = "xdot,ydot,omega,lift_off_xdot,lift_off_ydot,lift_off_omega"
    columns = np.column_stack([u, -np.ones(5), w, *lift_off])
    np.savetxt(path, columns, fmt="%.17g", delimiter=",", header=head, comments="")
    values = ["mu=0.4", "d1=0.1", "d2=0.1", "eta=0.5", "G=1e-4"]
    argv = ["fit", path, "--model", "KelvinVoigt", "--parameters", "mu", "--starts", "4"]
    argv += [word for value in values for word in ("--set", value)]
    code, out, err = command(*argv)
    assert code == 0 and "(too narrow: see profile)" in out and "as far as the data allow" in out
    assert err.startswith("bounce: caution: mu: the 95 % interval")
    low, high = json.loads(command(*argv, "--json")[1])["profile_95"]["mu"]
    assert low <= 0.3 and (high is None or high >= 0.3)


def test_bad_rows_are_left_out_by_a_flag_that_the_error_names(command, measured):
    lines = measured.read_text().splitlines()
    lines[2] = "fast" + lines[2][lines[2].index(",") :]
    lines[4] = lines[4][lines[4].index(",") :]
    measured.write_text("\n".join(lines) + "\n")
    argv = ["fit", measured, "--parameters", "mu,restitution,tilt", "--starts", "4"]
    code, _, err = command(*argv)
    assert code == 1 and "leave them out with --leave-out." in err and "bad_rows" not in err
    assert "row 2: expected a number, received 'fast' in column 'xdot [m/s]'" in err
    code, out, _ = command(*argv, "--leave-out", "--json")
    assert code == 0 and [row for row, _ in json.loads(out)["left_out"]] == [2, 4]
