"""Arrays of bounces agree with single ones, and nothing is dropped."""

import numpy as np
import pytest

import bounce
import nonsmooth as ns

TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)

MODELS = [
    TURF,
    bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.0, eta=0.5, G=0.01, load="net"),
    bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.0, eta=0.5),
    bounce.Hertz(mu=0.3, stiffness=1.0, d1=0.1, eta=0.5),
    bounce.Hertz(mu=0.3, stiffness=1.0, d1=0.1, eta=0.5, G=0.01, load="net"),
    bounce.contact.Tsuji(mu=0.3, stiffness=1.0, damping=0.3, d1=0.1, eta=0.5),
    bounce.contact.KuwabaraKono(mu=0.3, stiffness=1.0, damping=0.3, d1=0.1, eta=0.5),
    bounce.contact.Maxwell(mu=0.3, branch_stiffness=1.0, relaxation=0.5, d1=0.1, eta=0.5),
    TURF.replace(friction=bounce.contact.Stribeck(mu_kinetic=0.2, stribeck_speed=0.5)),
]


#: In the fast part of the suite: friction from the start, from a rising load, at a power law's zero.
FAST = (MODELS[0], MODELS[1], MODELS[4])
CASES = [m if m in FAST else pytest.param(m, marks=pytest.mark.slow) for m in MODELS]


IN_3D = [TURF.in_3d(side_slope=0.1), TURF.in_3d(drilling_radius=0.1), FAST[2].in_3d()]


@pytest.mark.slow
@pytest.mark.parametrize("model", [*CASES, *IN_3D], ids=repr)
def test_agrees_with_single_bounces(model):
    """Also where friction begins only when the load has risen, or at a power law's zero."""
    rng, along = np.random.default_rng(1), (2,) if model in IN_3D else ()
    xdot, omega = rng.uniform(-1, 1, (100, *along)), rng.uniform(-2, 2, (100, *along))
    ydot = rng.uniform(-2, -0.5, 100)
    many = bounce.lift_off(model, xdot, ydot, omega, tol=1e-12)
    assert many.complete.all()
    for k in range(0, 100, 9):
        shot = bounce.simulate(model, xdot[k], ydot[k], omega[k], tol=1e-12)
        for name, value in zip(shot.lift_off._fields, shot.lift_off, strict=True):
            assert np.abs(getattr(many, name)[k] - value).max() < 1e-10
        assert abs(many.time[k] - shot.time) < 1e-10
        assert np.abs(many.slip[k] - shot.slip).max() < 1e-10
        assert many.travel_angle[k] == pytest.approx(shot.travel_angle, abs=1e-8)
        assert many.itinerary[k] == shot.itinerary


@pytest.mark.slow_cases("KelvinVoigt1", "Hertz1")
@pytest.mark.parametrize("model", CASES, ids=lambda m: type(m).__name__)
def test_every_bounce_lifts_off(model):
    rng = np.random.default_rng(2)
    xdot, omega = rng.uniform(-1, 1, 500), rng.uniform(-2, 2, 500)
    many = bounce.lift_off(model, xdot, -1.0, omega, tol=1e-12)  # compiled above
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


@pytest.mark.parametrize("default", [0.0, 0.05])
@pytest.mark.parametrize(
    "model",
    [
        bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, load="net"),
        bounce.Hertz(mu=0.3, stiffness=1.0, load="net"),
    ],
    ids=lambda m: type(m).__name__,
)
def test_gravity_that_varies_is_in_every_load(model, default, tmp_path):
    """A load that is less gravity is so for each ball's own gravity, whatever the model's is."""
    gravity = [0.05, 0.0, 0.02]
    model = model.replace(G=default)
    for name, values in dict(all=gravity, some=[g for g in gravity if g]).items():
        folder = tmp_path / name
        for _ in range(2):  # and again, from what was kept
            many = bounce.lift_off(
                model,
                0.3,
                -1.0,
                0.1,
                parameters={"G": values},
                tol=1e-12,
                work=ns.Work(store=folder, progress=False),
            )
            for k, g in enumerate(values):
                shot = bounce.simulate(model.replace(G=g), 0.3, -1.0, 0.1, tol=1e-12)
                assert many.itinerary[k] == shot.itinerary
                assert many.time[k] == pytest.approx(shot.time, abs=1e-10)
                assert many.slip[k] == pytest.approx(shot.slip, abs=1e-10)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: bounce.lift_off("turf", 1, -1, 0), bounce.ModelError, "model"),
        (lambda: bounce.lift_off(TURF, "a", -1, 0), bounce.LandingError, "xdot"),
        (lambda: bounce.lift_off(TURF, [1, 2], -1, [1, 2, 3]), bounce.LandingError, "broadcast"),
        (lambda: bounce.lift_off(TURF, 1, -1, 0, parameters={"nu": 1}), ns.ParameterError, "'nu'"),
    ],
)
def test_bad_input(call, error, words):
    with pytest.raises(error, match=words):
        call()
