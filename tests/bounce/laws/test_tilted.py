"""A tilted plane is rigid impact turned, and Penner's law gives the heights that he printed."""

import math

import numpy as np
import pytest

import bounce


def test_penner_formulas():
    assert bounce.laws.penner_restitution([0.0, 20.0, 20.1, 50.0]).tolist() == pytest.approx(
        [0.510, 0.1212, 0.120, 0.120]
    )
    angle = float(bounce.laws.penner_tilt(18.6, math.radians(90 - 44.4)))
    assert math.degrees(angle) == pytest.approx(15.4, rel=1e-14)
    assert float(bounce.laws.penner_tilt(18.6, math.pi / 2)) == 0.0


@pytest.mark.parametrize(
    ("speed", "from_vertical", "spin", "printed", "exact"),
    [(26.2, 46.2, 315.0, 1.17, 1.1756), (26.8, 68.0, 224.0, 2.82, 2.8170)],
)
def test_penner_worked_heights(speed, from_vertical, spin, printed, exact):
    """Penner 2002, p. 936: the heights of the first bounce of his two drives, to his rounding."""
    angle = math.radians(90 - from_vertical)
    landing = bounce.Landing(speed * math.cos(angle), -speed * math.sin(angle), spin)
    after = bounce.golf.rebound(bounce.laws.PennerBounce(), landing)
    height = after.lift_off.ydot**2 / (2 * 9.80665)
    assert after.itinerary == "III+"
    assert height == pytest.approx(printed, abs=6e-3)
    assert height == pytest.approx(exact, abs=1e-4)


def test_tilted_plane_by_hand():
    """Frictionless: the normal speed of the tilted plane is reversed, the other kept."""
    tilt = math.radians(20)
    law = bounce.laws.TiltedBounce(mu=1e-300, restitution=0.5, tilt=tilt)
    shot = law.lift_off(3.0, -4.0, 1.0)
    normal, along = (
        np.array([-math.sin(tilt), math.cos(tilt)]),
        np.array([math.cos(tilt), math.sin(tilt)]),
    )
    v = np.array([3.0, -4.0])
    expected = along * (v @ along) - 0.5 * normal * (v @ normal)
    assert [float(shot.xdot), float(shot.ydot)] == pytest.approx(expected.tolist(), rel=1e-14)
