"""The restitution of a damped spring is its closed form, at any damping."""

import json
import math
from pathlib import Path

import pytest

import bounce
import nonsmooth as ns

DATA = Path(__file__).parents[2] / "data"
TABLE = json.loads((DATA / "restitution_kelvin_voigt.json").read_text(encoding="utf-8"))["table"]


@pytest.mark.parametrize("row", TABLE, ids=[row["zeta"] for row in TABLE])
def test_restitution_of_kelvin_voigt(row):
    zeta, exact = float(row["zeta"]), float(row["r"])
    assert bounce.laws.kelvin_voigt_restitution(zeta) == pytest.approx(exact, rel=1e-14)
    soft = bounce.NormalKelvinVoigt(mu=0.3, d2=zeta)
    shot = bounce.simulate(soft, 1.0, -1.0, 2.0, tol=1e-13)
    assert abs(shot.restitution - exact) <= 1e-12


def test_restitution_series():
    d = 1e-2
    series = -math.pi * d / 2 + d**2 / 2 - math.pi * d**3 / 16
    assert math.log(bounce.laws.kelvin_voigt_restitution(d / 2)) == pytest.approx(series, abs=2e-9)


def test_negative_damping_is_refused():
    with pytest.raises(ns.ParameterError, match="d2"):
        bounce.laws.kelvin_voigt_restitution(-1)
