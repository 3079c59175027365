"""The example programs of the public API run as written, and their comments hold."""

import math
import runpy
from pathlib import Path

import numpy as np
import pytest

PROGRAMS = Path(__file__).parent / "programs"


def run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # what a program saves stays out of the repository
    return runpy.run_path(str(PROGRAMS / f"{name}.py"))


def test_two_fold(tmp_path, monkeypatch, capsys):
    fold = run("two_fold", tmp_path, monkeypatch)["fold"]
    assert fold.label == "II-C" and fold.kind == "invisible"
    assert fold.sigma == (-1, 1) and fold.nu == pytest.approx((-2.0, -1.0))
    assert fold.canards == math.inf and fold.faux_canards == 0
    assert fold.coincident_fields is False
    assert sorted(fold.eigenvalues) == pytest.approx([-2.618033988749895, -0.381966011250105])
    assert fold.matrix == pytest.approx(np.array([[-1.0, 1.0], [1.0, -2.0]]))
    printed = capsys.readouterr().out
    assert "II-C" in printed and "sigma" in printed and "eigenvalues" in printed
    assert (tmp_path / "two_fold.png").stat().st_size > 10_000


def test_trajectory(tmp_path, monkeypatch):
    names = run("trajectory", tmp_path, monkeypatch)
    first, many = names["run"], names["many"]
    assert first.x.shape == (len(first.t), 2)
    assert first.itinerary.startswith("- s -")
    assert first(np.linspace(0, 50, 1001)).shape == (1001, 2)
    assert many.x.shape == (100_000, 2) and many.complete.all()
    assert many.itinerary.shape == (100_000,) and (many.t == 10.0).all()
    assert (tmp_path / "trajectory.png").stat().st_size > 10_000


def test_bounce(tmp_path, monkeypatch):
    names = run("bounce", tmp_path, monkeypatch)
    shot, many, curve = names["shot"], names["many"], names["curve"]
    assert shot.itinerary == "+ s -" and shot.slip < 0
    assert shot.slip == pytest.approx(shot.lift_off.xdot + shot.lift_off.omega)
    assert many.slip.shape == many.omega.shape == many.itinerary.shape == (1000, 1000)
    assert curve.two_fold.shape[1] == curve.slipping.shape[1] == 2
    # The million landings change the sign of their slip where the dividing curve says.
    speeds, spins = names["speeds"], names["spins"]
    column = int(np.argmin(abs(speeds[0] - 0.2)))
    signs = np.sign(many.slip[:, column])
    above = spins[np.flatnonzero(np.diff(signs) > 0)[-1], column]
    assert above == pytest.approx(curve.omega(speeds[0, column]), abs=8 / 999)
    assert (tmp_path / "cone.png").stat().st_size > 10_000


def test_proof(tmp_path, monkeypatch, capsys):
    names = run("proof", tmp_path, monkeypatch)
    assert names["proof"].label == "II-C" and names["proof"].values["nu1"].low == "-2"
    assert names["everything"].zeros[0].label == "II-C"
    printed = capsys.readouterr().out
    assert "exactly one two-fold" in printed and "itinerary + -" in printed


@pytest.mark.slow
def test_orbit(tmp_path, monkeypatch, capsys):
    names = run("orbit", tmp_path, monkeypatch)
    kinds = [event.kind for event in names["branch"].events]
    assert kinds == ["adding-sliding", "grazing-sliding"]
    assert names["orbit"].stability == "asymptotically stable"
    assert (tmp_path / "branch.png").stat().st_size > 10_000
    printed = capsys.readouterr().out
    assert "grazing-sliding 25.118" in printed and "LyapunovSpectrum" in printed


def test_explore(tmp_path, monkeypatch):
    run("explore", tmp_path, monkeypatch)
    text = (tmp_path / "belt.html").read_text(encoding="utf-8")
    assert "belt" in text and "friction" in text and "https:" not in text
