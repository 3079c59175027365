"""``bounce map`` works with its own defaults, on all turfs, in physical units and a model's own."""

import json

import matplotlib.colors
import numpy as np
import pytest
from matplotlib.collections import QuadMesh

import bounce
import nonsmooth as ns

KV = "--model KelvinVoigt --set mu=0.3 --set d1=0.1 --set d2=0.15 --set eta=0.5".split()


@pytest.mark.parametrize(
    "show",
    [
        pytest.param("region", marks=pytest.mark.slow),
        pytest.param("slip", marks=pytest.mark.slow),
        pytest.param("omega", marks=pytest.mark.slow),
        pytest.param("angle", marks=pytest.mark.slow),
        "reversal",
    ],
)
def test_map_pictures(command, tmp_path, show):
    path = tmp_path / "map.png"
    over = ["--over", "xdot=-2:2:20", "--over", "omega=-4:4:20"]
    code, out, _ = command("map", *KV, *over, "--show", show, "--output", path)
    assert code == 0 and path.stat().st_size > 5000
    assert "S+ R S-: slips forward, rolls, slips in reverse\n" in out and "sign of" not in out


def test_a_map_is_drawn_in_the_requested_units(command, tmp_path, monkeypatch):
    requested = []
    drawn = bounce.plot.outcome_map
    monkeypatch.setattr(
        bounce.plot,
        "outcome_map",
        lambda *a, **k: requested.append(drawn(*a, **k)) or requested[-1],
    )
    over = ["--over", "speed=40mph:80mph:12", "--over", "angle=20deg:60deg:9"]
    code, *_ = command("map", *over, "--units", "us", "--output", tmp_path / "map.png")
    ax = requested[0].axes[0]
    assert code == 0 and ax.get_xlabel() == "landing speed (mph)"
    assert ax.get_xlim() == pytest.approx((40.0, 80.0))
    with pytest.raises(ns.OptionError, match="speeds"):
        drawn(
            bounce.outcome_map(
                bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5),
                {"xdot": [0, 1], "omega": [0, 1]},
            ),
            speeds="knots",
        )


def test_map_arrays(command, tmp_path):
    path = tmp_path / "map.npz"
    over = ["--over", "eta=0.2:1:5", "--over", "omega=-4:4:7"]
    code, out, _ = command("map", *KV, *over, "--fix", "xdot=0.3", "--output", path, "--json")
    assert code == 0 and sum(json.loads(out)["share"].values()) == pytest.approx(1.0, abs=1e-5)
    arrays = np.load(path)
    assert arrays["lift_off_xdot"].shape == (7, 5) and arrays["axis_eta"].tolist()[-1] == 1.0


def test_its_own_default_is_a_turf(command, tmp_path):
    path = tmp_path / "map.png"
    code, out, err = command("map", "--output", path)
    assert code == 0 and path.stat().st_size > 5000
    assert "III+: slips, then rolls from compression on\n" in out
    assert "+ and - are the sign of the slip at touch-down" in out
    assert "landings are outside those that it was fitted to" in err


@pytest.mark.parametrize("turf", bounce.laws.TURFS)
def test_every_turf(command, tmp_path, turf):
    path = tmp_path / "map.npz"
    over = ["--over", "speed=40:70mph:4", "--over", "angle=30:50:3", "--fix", "spin=2000rpm"]
    code, _, _ = command("map", "--turf", turf, *over, "--output", path)
    arrays = np.load(path)
    speed, angle = arrays["axis_speed"], arrays["axis_angle"]
    assert code == 0 and speed[-1] == pytest.approx(70 * 0.44704)
    landing = bounce.Landing.polar(speed[2], angle[1], 2000)
    law = bounce.laws.TURFS[turf].law.covering(None)
    off = bounce.golf.rebound(law, landing).lift_off
    assert arrays["lift_off_xdot"][1, 2] == pytest.approx(off.xdot, rel=1e-12)
    assert arrays["lift_off_ydot"][1, 2] == pytest.approx(off.ydot, rel=1e-12)


def test_a_contact_model_in_physical_units(command, tmp_path):
    path = tmp_path / "map.npz"
    over = ["--over", "spin=0:4000rpm:3", "--over", "eta=0.2:0.8:2"]
    argv = ["map", *KV, "--stiffness", "2e4", *over, "--fix", "speed=28", "--output", path]
    assert command(*argv)[0] == 0
    scaling = bounce.Scaling.from_stiffness(bounce.golf.GOLF, 2e4)
    turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.15, eta=0.8, G=scaling.gravity)
    landing = bounce.Landing.polar(28, np.radians(40), 2000)
    off = bounce.golf.rebound(turf, landing, scaling=scaling).lift_off
    assert np.load(path)["lift_off_xdot"][1, 1] == pytest.approx(off.xdot, rel=1e-8)
    assert command("map", *KV, "--stiffness", "2e4", "--output", tmp_path / "m.png")[0] == 0


@pytest.mark.slow
def test_regions_have_colours_that_differ_and_the_dividing_curve_is_drawn(
    command, tmp_path, monkeypatch
):
    seen = {}

    def keep(result, quantity, curve=None, **options):
        seen.update(curve=curve, figure=draw(result, quantity, curve=curve, **options))
        return seen["figure"]

    draw = bounce.plot.outcome_map
    monkeypatch.setattr(bounce.plot, "outcome_map", keep)
    over = ["--over", "xdot=-1:1:30", "--over", "omega=-2:2:30"]
    assert command("map", *KV, *over, "--output", tmp_path / "map.png")[0] == 0
    assert seen["curve"] is not None and seen["curve"].two_fold.shape[1] == 2
    mesh = seen["figure"].axes[0].collections[0]
    assert isinstance(mesh.cmap, matplotlib.colors.ListedColormap)


def test_inputs_are_echoed(command, tmp_path):
    over = ["--over", "speed=40:70mph:4", "--over", "angle=30:50:3"]
    report = json.loads(command("map", *over, "--json", "--output", tmp_path / "m.npz")[1])
    speed = report["inputs"]["over"][0]
    assert speed == dict(name="speed", low=40.0, high=70.0, points=4, unit="mph")
    assert report["version"] and report["command"] == "map"
    assert report["inputs"]["fix"] == [{"spin": dict(value=2500.0, unit="rpm")}]  # by default
    contact = json.loads(command("map", *KV, "--json", "--output", tmp_path / "m.npz")[1])
    assert contact["inputs"]["fix"] == [{"ydot": -1.0}] and "usual_turf" not in contact["inputs"]


@pytest.mark.parametrize("turf", [*bounce.laws.TURFS, None])
def test_the_default_landings_show_several_kinds_of_bounce(command, tmp_path, turf):
    ground = [*KV, "--stiffness", "2e4"] if turf is None else ["--turf", turf]
    shares = json.loads(command("map", *ground, "--json", "--output", tmp_path / "map.npz")[1])[
        "share"
    ]
    assert sum(share > 0.005 for share in shares.values()) >= 3
    assert max(shares.values()) < 0.85


@pytest.mark.slow
def test_a_kind_of_bounce_has_one_colour_on_every_map(command, tmp_path, monkeypatch):
    drawn = []

    def keep(result, quantity, curve=None, **options):
        drawn.append((result.regions, draw(result, quantity, curve=curve, **options)))
        return drawn[-1][1]

    draw = bounce.plot.outcome_map
    monkeypatch.setattr(bounce.plot, "outcome_map", keep)
    for over in (["angle=5:75:40", "spin=-9000:9000:40"], ["angle=30:75:40", "spin=2000:9000:40"]):
        both = [word for text in over for word in ("--over", text)]
        argv = ["map", "--turf", "natural-rigid", *both, "--output", tmp_path / "map.png"]
        assert command(*argv)[0] == 0
    meshes = [
        (names, next(c for c in figure.axes[0].collections if isinstance(c, QuadMesh)))
        for names, figure in drawn
    ]
    colours = [dict(zip(names, mesh.cmap.colors, strict=True)) for names, mesh in meshes]
    shared = {*colours[0]} & {*colours[1]}
    assert shared and {*colours[0]} != {*colours[1]}
    assert all(colours[0][name] == colours[1][name] for name in shared)
