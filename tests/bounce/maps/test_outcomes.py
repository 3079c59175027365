"""Maps name their regions, are symmetric, and hold what single bounces give."""

import math

import numpy as np
import pytest

import bounce
import nonsmooth as ns

TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
PAPER = ("S+", "S+ S-", "S+ R S+", "S+ R S-", "S-", "S- S+", "S- R S+", "S- R S-")


@pytest.fixture(scope="module")
def outcomes():
    over = dict(xdot=np.linspace(-2, 2, 60), omega=np.linspace(-4, 4, 80))
    return bounce.outcome_map(TURF, over)


def test_a_map_has_the_papers_eight_regions(outcomes):
    assert outcomes.regions == PAPER
    assert outcomes.code.shape == outcomes.slip.shape == (80, 60)
    assert math.isclose(sum(outcomes.share().values()), 1.0)
    last = np.array([name[-1] == "+" for name in PAPER])[outcomes.code]
    assert (last == (outcomes.slip > 0)).mean() > 0.999  # up to rounding at the border


def test_the_map_is_symmetric(outcomes):
    assert np.abs(outcomes.slip + outcomes.slip[::-1, ::-1]).max() < 1e-12
    swap = str.maketrans("+-", "-+")
    mirrored = [PAPER.index(name.translate(swap)) for name in PAPER]
    assert (np.array(mirrored)[outcomes.code] == outcomes.code[::-1, ::-1]).all()


def test_quantities_of_a_map(outcomes):
    row, column = 50, 10
    xdot, omega = outcomes.axes[0][column], outcomes.axes[1][row]
    shot = bounce.simulate(TURF, xdot, -1.0, omega)
    end = shot.lift_off
    assert abs(outcomes.slip[row, column] - shot.slip) < 1e-9
    assert outcomes.spin_reversal[row, column] == (end.omega * omega < 0)
    assert abs(outcomes.lift_off_angle[row, column] - math.atan2(end.ydot, end.xdot)) < 1e-9


def test_a_map_over_a_parameter_and_an_input():
    over = dict(eta=np.linspace(0.5, 1.5, 7), mu=np.linspace(0.1, 0.5, 5))
    m = bounce.outcome_map(TURF, over, fixed=dict(xdot=0.01, omega=0.0, d1=0.0))
    assert m.slip.shape == (5, 7) and m.names == ("eta", "mu")
    model = TURF.replace(eta=1.5, mu=0.1, d1=0.0)
    assert abs(m.slip[0, 6] - bounce.simulate(model, 0.01, -1.0, 0.0).slip) < 1e-9


@pytest.mark.parametrize("count", [200, pytest.param(1000, marks=pytest.mark.slow)])
def test_large_maps_have_the_regions_of_the_paper(count):
    over = dict(xdot=np.linspace(-2, 2, count), omega=np.linspace(-4, 4, count))
    assert bounce.outcome_map(TURF, over).regions == PAPER


@pytest.mark.parametrize(
    ("over", "fixed", "words"),
    [
        ({"xdot": [1.0]}, {}, "over"),
        ({"xdot": [1.0], "spin": [1.0]}, {}, "'spin'"),
        ({"xdot": [1.0], "eta": [1.0]}, {}, "'omega'"),
        ({"xdot": [1.0], "omega": [1.0]}, {"omega": 1.0}, "'omega'"),
        ({"xdot": 1.0, "omega": [1.0]}, {}, "xdot"),
    ],
)
def test_bad_maps(over, fixed, words):
    with pytest.raises(ns.OptionError, match=words):
        bounce.outcome_map(TURF, over, fixed)


@pytest.mark.parametrize(
    ("over", "fixed", "error"),
    [
        ({"eta": [0.1, 0.2], "mu": [0.3]}, dict(xdot="a", omega=1), ns.ParameterError),
        ({"eta": [0.1, 0.2], "mu": [0.3]}, dict(xdot=[1, 2], omega=1), ns.ParameterError),
        (["eta", "mu"], {}, ns.OptionError),
        ({"xdot": [0.1, math.nan], "omega": [0.3]}, {}, ns.OptionError),
    ],
)
def test_maps_of_what_is_no_number(over, fixed, error):
    turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    with pytest.raises(error, match="expected"):
        bounce.outcome_map(turf, over, fixed)
