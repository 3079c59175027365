"""The command line gives the library's numbers, one-line errors and their exit codes."""

import json
import subprocess
import sys

import numpy as np
import pytest

import bounce
from bounce.cli import CONTACT_MODELS, main

SHOT = "shot --speed 28.5 --angle 37.3 --spin 2094".split()
KV = "--model KelvinVoigt --set mu=0.3 --set d1=0.1 --set d2=0.15 --set eta=0.5".split()


def run(capsys, *argv):
    code = main([str(a) for a in argv])
    out = capsys.readouterr()
    return code, out.out, out.err


def test_shot_is_play(capsys):
    code, out, err = run(capsys, *SHOT, "--turf", "natural", "--json")
    report = json.loads(out)
    landing = bounce.Landing.polar(28.5, np.radians(37.3), 2094)
    expected = bounce.play(bounce.TURFS["natural"].law, landing)
    assert (code, err) == (0, "")
    assert report["run"]["run_out"] == pytest.approx(expected.run_out, rel=1e-12)
    off = expected.bounces[0].rebound.lift_off
    assert report["lift_off"]["spin"] == pytest.approx(off.backspin_rpm, rel=1e-12)
    assert run(capsys, *SHOT)[1].startswith("lift-off  10.71 m/s, 37.3 deg")


def test_units_are_two_views_of_one_shot(capsys):
    golf = json.loads(run(capsys, *SHOT, "--json")[1])
    argv = ["shot", "--speed", 28.5, "--angle", np.radians(37.3), "--spin", 2094 * np.pi / 30]
    si = json.loads(run(capsys, *argv, "--units", "si", "--json")[1])
    assert si["run"] == pytest.approx(golf["run"], rel=1e-9)
    assert si["lift_off"]["angle"] == pytest.approx(np.radians(golf["lift_off"]["angle"]))


def test_shot_on_a_contact_model_and_through_air(capsys):
    argv = [*SHOT, *KV, "--stiffness", "2e4", "--air", "smits-smith", "--json"]
    code, out, _ = run(capsys, *argv)
    report = json.loads(out)
    assert code == 0 and report["contact_time"] > 0 and "G=0.001" in report["model"]
    code, out, _ = run(capsys, *argv, "--first-only")
    assert "run" not in json.loads(out)
    assert run(capsys, *SHOT, *KV, "--stiffness", "2e4")[1].splitlines()[1].startswith("contact")
    stribeck = ["--friction", "Stribeck", "--set", "mu_kinetic=0.2", "--set", "stribeck_speed=0.5"]
    assert "Stribeck" in json.loads(run(capsys, *argv, *stribeck, "--first-only")[1])["model"]


@pytest.mark.parametrize("show", ["region", "slip", "omega", "angle"])
def test_map_pictures(capsys, tmp_path, show):
    path = tmp_path / "map.png"
    over = ["--over", "xdot=-2:2:20", "--over", "omega=-4:4:20"]
    code, out, _ = run(capsys, "map", *KV, *over, "--show", show, "--output", path)
    assert code == 0 and path.stat().st_size > 5000 and "S+ R S-" in out


def test_map_arrays(capsys, tmp_path):
    path = tmp_path / "map.npz"
    over = ["--over", "eta=0.2:1:5", "--over", "omega=-4:4:7"]
    code, out, _ = run(capsys, "map", *KV, *over, "--fix", "xdot=0.3", "--output", path, "--json")
    assert code == 0 and sum(json.loads(out)["share"].values()) == pytest.approx(1.0, abs=1e-5)
    arrays = np.load(path)
    assert arrays["lift_off_xdot"].shape == (7, 5) and arrays["axis_eta"].tolist()[-1] == 1.0


@pytest.fixture
def measured(tmp_path):
    law = bounce.TiltedBounce(mu=0.25, restitution=0.4, tilt=0.2)
    rng = np.random.default_rng(0)
    u, v, w = rng.uniform(5, 25, 30), rng.uniform(5, 20, 30), rng.uniform(-5, 8, 30)
    off = law.lift_off(u, -v, w)
    radius = bounce.GOLF.radius
    columns = [u, -v, w / radius, off.xdot, off.ydot, off.omega / radius]
    path = tmp_path / "data.csv"
    head = "xdot [m/s],ydot [m/s],omega [rad/s],lift_off_xdot [m/s],lift_off_ydot [m/s],lift_off_omega [rad/s]"
    np.savetxt(path, np.column_stack(columns), fmt="%.12g", delimiter=",", header=head, comments="")
    return path


def test_fit(capsys, tmp_path, measured):
    picture = tmp_path / "residuals.png"
    argv = ["fit", measured, "--turf", "natural", "--parameters", "mu,restitution,tilt"]
    code, out, _ = run(capsys, *argv, "--json", "--residuals", picture)
    report = json.loads(out)
    assert code == 0 and picture.exists()
    assert report["values"] == pytest.approx(dict(mu=0.25, restitution=0.4, tilt=0.2), rel=1e-6)
    assert "95 %" in run(capsys, *argv)[1]


def test_models(capsys):
    code, out, _ = run(capsys, "models", "--json")
    report = json.loads(out)
    assert code == 0 and set(report["contact_models"]) == set(CONTACT_MODELS)
    assert all(entry["source"] for entry in report["turfs"].values())
    assert "KelvinVoigt" in run(capsys, "models")[1]


OVER = ["--over", "xdot=-2:2:5", "--over", "omega=-4:4:5", "--output"]


@pytest.mark.parametrize(
    ("argv", "code", "message"),
    [
        ([], 2, "command"),
        (["shot"], 2, "--speed"),
        ([*SHOT[:2], "fast", *SHOT[3:]], 2, "invalid number value: 'fast'"),
        ([*SHOT, "--turf", "mud"], 2, "invalid choice: 'mud'"),
        ([*SHOT, "--turf", "natural", "--model", "Hertz"], 2, "not allowed with"),
        ([*SHOT, "--set", "mu"], 2, "NAME=VALUE, received 'mu'"),
        ([*SHOT, "--set", "mu=-1"], 2, "mu: expected a number > 0"),
        ([*SHOT, "--set", "nu=1"], 2, "received ['nu']"),
        ([*SHOT, *KV], 2, "--stiffness: expected N/m"),
        ([*SHOT, "--model", "TiltedBounce", "--set", "mu=0.3"], 2, "restitution=..., tilt=..."),
        (["shot", "--speed", "28.5", "--angle", "100", "--spin", "0"], 2, "angle: "),
        ([*SHOT, "--turf", "natural-rigid", "--slope", "-10"], 1, "rolling ball stops"),
        (["map", "--turf", "natural", *OVER, "m.png"], 2, "contact model"),
        (["map", *KV, *OVER, "map.txt"], 2, "--output: expected a name ending in"),
        (["map", *KV, "--over", "xdot=1:2", "--output", "m.png"], 2, "NAME=LOW:HIGH:COUNT"),
        (["map", *KV, *OVER, "nowhere/map.png"], 1, "No such file"),
        (["fit", "nowhere.csv", "--parameters", "mu"], 1, "readable CSV file"),
    ],
)
def test_errors_are_one_line_with_a_code(capsys, argv, code, message):
    got, out, err = run(capsys, *argv)
    assert got == code and out == ""
    assert message in err and len(err.strip().splitlines()) == 1


def test_help(capsys):
    code, out, _ = run(capsys, "--help")
    assert code == 0 and all(word in out for word in ("shot", "map", "fit", "models"))


def test_as_a_process():
    argv = [sys.executable, "-m", "bounce.cli", *SHOT, "--turf", "artificial"]
    done = subprocess.run(argv, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0 and done.stdout.startswith("lift-off") and done.stderr == ""
    wrong = subprocess.run(
        [*argv, "--set", "mu=0"], capture_output=True, text=True, timeout=120, check=False
    )
    assert wrong.returncode == 2 and wrong.stderr.startswith("bounce: error: ")
