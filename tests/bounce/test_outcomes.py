"""Arrays of bounces agree with single ones, nothing is dropped, maps name their regions."""

import math
import time

import matplotlib.colors
import numpy as np
import pytest

import bounce
import nonsmooth as ns

TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
PAPER = ("S+", "S+ S-", "S+ R S+", "S+ R S-", "S-", "S- S+", "S- R S+", "S- R S-")

MODELS = [
    TURF,
    bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.0, eta=0.5, G=0.01, load="net"),
    bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.0, eta=0.5),
    bounce.Hertz(mu=0.3, stiffness=1.0, d1=0.1, eta=0.5),
    bounce.Hertz(mu=0.3, stiffness=1.0, d1=0.1, eta=0.5, G=0.01, load="net"),
    bounce.Tsuji(mu=0.3, stiffness=1.0, damping=0.3, d1=0.1, eta=0.5),
    bounce.KuwabaraKono(mu=0.3, stiffness=1.0, damping=0.3, d1=0.1, eta=0.5),
    bounce.Maxwell(mu=0.3, branch_stiffness=1.0, relaxation=0.5, d1=0.1, eta=0.5),
    TURF.replace(friction=bounce.Stribeck(mu_kinetic=0.2, stribeck_speed=0.5)),
]


@pytest.mark.parametrize("model", MODELS, ids=lambda m: type(m).__name__)
def test_agrees_with_single_bounces(model):
    """Also where friction begins only when the load has risen, or at a power law's zero."""
    rng = np.random.default_rng(1)
    xdot, omega = rng.uniform(-1, 1, 100), rng.uniform(-2, 2, 100)
    ydot = rng.uniform(-2, -0.5, 100)
    many = bounce.lift_off(model, xdot, ydot, omega, tol=1e-12)
    assert many.complete.all()
    for k in range(0, 100, 9):
        shot = bounce.simulate(model, xdot[k], ydot[k], omega[k], tol=1e-12)
        row = [getattr(many, name)[k] for name in bounce.State._fields]
        assert np.abs(np.array(row) - shot.lift_off).max() < 1e-10
        assert abs(many.time[k] - shot.time) < 1e-10
        assert abs(many.slip[k] - shot.slip) < 1e-10
        assert many.itinerary[k] == shot.itinerary


@pytest.mark.parametrize("model", MODELS, ids=lambda m: type(m).__name__)
def test_no_bounce_is_left_to_the_slow_driver(model, monkeypatch):
    def refuse(*_):
        raise AssertionError("a bounce was handed to the reference driver")

    monkeypatch.setattr("nonsmooth.flow.chunks._run_reference", refuse)
    rng = np.random.default_rng(2)
    many = bounce.lift_off(model, rng.uniform(-1, 1, 500), -1.0, rng.uniform(-2, 2, 500))
    assert many.complete.all()


def test_inputs_and_parameters_broadcast():
    mu, eta = np.array([0.2, 0.3, 0.4])[:, None, None], np.array([0.4, 0.8])[:, None]
    many = bounce.lift_off(TURF, 0.3, -1.0, [0.1, 0.2, 0.3, 0.4], parameters=dict(mu=mu, eta=eta))
    assert many.slip.shape == many.itinerary.shape == many.status.shape == (3, 2, 4)
    shot = bounce.simulate(TURF.replace(mu=0.4, eta=0.8), 0.3, -1.0, 0.2)
    assert abs(many.omega[2, 1, 1] - shot.lift_off.omega) < 1e-9
    assert bounce.lift_off(TURF, 0.3, -1.0, 0.1).slip.shape == ()


def test_starts_in_the_ground():
    whole = bounce.simulate(TURF, 0.3, -1.0, 0.1, tol=1e-12)
    x, xdot, y, ydot, omega = whole(np.array([0.5, 2.0])).T
    rest = bounce.lift_off(TURF, xdot, ydot, omega, x, y, tol=1e-12)
    assert np.abs(rest.xdot - whole.lift_off.xdot).max() < 1e-10


def test_rows_that_cannot_be_simulated_are_named_and_the_others_go_on():
    names = bounce.BounceStatus
    many = bounce.lift_off(
        TURF,
        xdot=[0.3, np.nan, 0.3, 0.3, np.inf, 0.3],
        ydot=[-1.0, -1.0, 1.0, -1.0, -1.0, -1.0],
        omega=0.1,
        y=[0.0, 0.0, 0.0, 0.5, 0.0, 0.0],
        parameters=dict(mu=[0.3, 0.3, 0.3, 0.3, 0.3, -0.1]),
    )
    expected = [
        names.LIFTED_OFF,
        names.NOT_FINITE,
        names.NOT_A_LANDING,
        names.NOT_A_LANDING,
        names.NOT_FINITE,
        names.BAD_PARAMETER,
    ]
    assert many.status.tolist() == expected
    assert np.isnan(many.slip[1:]).all() and np.isfinite(many.slip[0])
    assert np.isnan(many.time[1:]).all()
    assert many.itinerary.tolist() == ["+ s -", "", "", "", "", ""]
    assert "BAD_PARAMETER 1" in repr(many)
    assert all(status.advice for status in names)


def test_a_ball_that_stays_or_never_presses_is_named():
    stays = bounce.lift_off(TURF.replace(G=0.5, d2=0.9), 0.3, [-1e-3, -1.0], 0.1, t_max=30.0)
    assert stays.status[0] == bounce.BounceStatus.NO_LIFT_OFF
    light = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.0, eta=0.5, G=0.01, load="net")
    up = bounce.lift_off(light, 0.3, [0.1, -1.0], 0.1, y=[-1e-3, 0.0])
    assert up.status.tolist() == [bounce.BounceStatus.NOT_A_LANDING, bounce.BounceStatus.LIFTED_OFF]


class Veil(bounce.ContactModel):
    """Pushes back, but rubs only below a depth."""

    parameters = dict(mu=0.3, depth=1.5)

    def normal_force(self, s, p):
        return -s.y

    def tangential_force(self, s, p):
        return -s.x

    def load(self, s, p):
        return -s.y - p.depth


def test_a_ball_that_comes_back_without_a_load_had_no_contact():
    many = bounce.lift_off(Veil(), 0.3, [-1.0, -3.0], 0.1)
    assert many.status.tolist() == [bounce.BounceStatus.NO_CONTACT, bounce.BounceStatus.LIFTED_OFF]
    assert many.itinerary[1] == bounce.simulate(Veil(), 0.3, -3.0, 0.1).itinerary
    with pytest.raises(bounce.LiftOffError, match="without pressing"):
        bounce.simulate(Veil(), 0.3, -1.0, 0.1)


def test_reference_engine_gives_the_same():
    arguments = (TURF, np.linspace(-1, 1, 4), -1.0, np.linspace(-2, 2, 3)[:, None])
    one = bounce.lift_off(*arguments, engine="reference", tol=1e-12)
    other = bounce.lift_off(*arguments, tol=1e-12)
    assert np.abs(one.slip - other.slip).max() < 1e-11
    assert (one.itinerary == other.itinerary).all()


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: bounce.lift_off("turf", 1, -1, 0), bounce.ModelError, "expected a ContactModel"),
        (lambda: bounce.lift_off(TURF, "a", -1, 0), bounce.LandingError, "xdot: expected numbers"),
        (lambda: bounce.lift_off(TURF, [1, 2], -1, [1, 2, 3]), bounce.LandingError, "broadcast"),
        (
            lambda: bounce.lift_off(TURF, 1, -1, 0, parameters={"nu": 1}),
            ns.ParameterError,
            r"received \['nu'\]",
        ),
    ],
)
def test_bad_input(call, error, words):
    with pytest.raises(error, match=words):
        call()


# Maps --------------------------------------------------------------------------------------------


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


def test_a_million_bounces_take_seconds():
    over = dict(xdot=np.linspace(-2, 2, 1000), omega=np.linspace(-4, 4, 1000))
    bounce.outcome_map(TURF, {k: v[::50] for k, v in over.items()})
    start = time.process_time()
    m = bounce.outcome_map(TURF, over)
    assert m.regions == PAPER
    assert time.process_time() - start < 15.0


@pytest.mark.parametrize(
    ("over", "fixed", "words"),
    [
        ({"xdot": [1.0]}, {}, "expected two names"),
        ({"xdot": [1.0], "spin": [1.0]}, {}, r"received \['spin'\]"),
        ({"xdot": [1.0], "eta": [1.0]}, {}, r"expected values for \['omega'\]"),
        ({"xdot": [1.0], "omega": [1.0]}, {"omega": 1.0}, "each name once"),
        ({"xdot": 1.0, "omega": [1.0]}, {}, "expected a list"),
    ],
)
def test_bad_maps(over, fixed, words):
    with pytest.raises(ns.OptionError, match=words):
        bounce.outcome_map(TURF, over, fixed)


# Pictures ----------------------------------------------------------------------------------------


def test_regions_are_named_on_the_picture(outcomes):
    figure = bounce.plot.outcome_map(outcomes, curve=bounce.dividing_curve(TURF, step=0.2))
    axes = figure.axes[0]
    assert {t.get_text() for t in axes.texts} == set(PAPER)
    assert axes.get_xlim() == (-2, 2) and axes.get_ylim() == (-4, 4)


def test_narrow_regions_are_in_the_legend():
    over = dict(eta=np.linspace(0.05, 3, 60), omega=np.linspace(-2, 3, 60))
    m = bounce.outcome_map(TURF, over, fixed=dict(xdot=0.5))
    axes = bounce.plot.outcome_map(m).axes[0]
    legend = axes.get_legend()
    assert legend is not None
    names = [t.get_text() for t in axes.texts] + [t.get_text() for t in legend.get_texts()]
    assert sorted(names) == sorted(m.regions)


@pytest.mark.parametrize("quantity", ["slip", "spin_reversal", "lift_off_angle"])
def test_quantities_are_drawn(outcomes, quantity):
    assert len(bounce.plot.outcome_map(outcomes, quantity).axes) == 2


def test_neighbouring_regions_differ_in_grey():
    """For readers who see no colours at all."""
    from bounce.outcome_plots import COLOURS

    def grey(name):
        return float(np.dot(matplotlib.colors.to_rgb(COLOURS[name]), [0.299, 0.587, 0.114]))

    pairs = [
        ("S+", "S+ R S+"),
        ("S+ R S+", "S- R S+"),
        ("S- R S+", "S- S+"),
        ("S-", "S- R S-"),
        ("S- R S-", "S+ R S-"),
        ("S+ R S-", "S+ S-"),
        ("S- S+", "S-"),
        ("S+ S-", "S+"),
    ]
    assert all(abs(grey(a) - grey(b)) > 0.15 for a, b in pairs)


def test_pictures_refuse_what_they_cannot_draw(outcomes):
    with pytest.raises(ns.OptionError, match="quantity: expected one of"):
        bounce.plot.outcome_map(outcomes, "spin")
    m = bounce.outcome_map(TURF, dict(mu=[0.1, 0.2], omega=[0.0, 1.0]), fixed=dict(xdot=1.0))
    with pytest.raises(ns.OptionError, match="map over xdot and omega"):
        bounce.plot.outcome_map(m, curve=bounce.dividing_curve(TURF, step=0.4, reach=0.6))


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


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("quantity", ["itinerary", "slip"])
def test_a_picture_of_a_map_without_lift_off(quantity):
    turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    over = {"xdot": [0.0, 1.0], "omega": [0.0, 1.0]}
    figure = bounce.plot.outcome_map(bounce.outcome_map(turf, over, {"ydot": 1.0}), quantity)
    figure.canvas.draw()


def test_a_legend_of_dozens_of_regions_is_short():
    stiff = bounce.KelvinVoigt(mu=0.3, d1=0.05, d2=0.1, eta=12)
    axis = np.linspace(-1, 1, 60)
    outcomes = bounce.outcome_map(stiff, {"xdot": axis, "omega": axis})
    legend = bounce.plot.outcome_map(outcomes).axes[0].get_legend()
    names = [text.get_text() for text in legend.get_texts()]
    assert len(outcomes.regions) > 40
    assert len(names) <= 17
    assert names[-1].endswith("more")
    assert max(map(len, names)) < 30
