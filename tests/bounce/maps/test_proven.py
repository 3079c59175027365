"""The map of proven landings covers its rectangle, and is right wherever it is decided."""

import numpy as np
import pytest

import bounce

TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)


@pytest.mark.slow
def test_decided_pieces_are_what_the_simulation_gives():
    found = bounce.proven_map(TURF, xdot=(0.2, 0.26), omega=(0.6, 0.7), depth=3)
    sizes = (found.boxes[:, 1] - found.boxes[:, 0]) * (found.boxes[:, 3] - found.boxes[:, 2])
    assert sizes.sum() == pytest.approx(0.06 * 0.1)
    assert found.area["forward"] > 0.05 and found.area["reverse"] > 0.05
    assert found.area["undecided"] < 0.7
    rng = np.random.default_rng(1)
    for xdot, omega in rng.uniform([0.2, 0.6], [0.26, 0.7], size=(10, 2)):
        shot = bounce.simulate(TURF, xdot, -1.0, omega)
        allowed = {"undecided", "forward" if shot.slip > 0 else "reverse"}
        assert found.at(xdot, omega) in allowed
    figure = bounce.plot.proven_map(found, curve=bounce.dividing_curve(TURF))
    assert len(figure.axes[0].collections) == 4
    with pytest.raises(bounce.LandingError):
        found.at(9.0, 9.0)


def test_wrong_ranges_are_refused():
    with pytest.raises(bounce.LandingError, match="low < high"):
        bounce.proven_map(TURF, xdot=(1, 0), omega=(0, 1))
