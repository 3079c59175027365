"""The limits eta -> 0, d -> 0 and of the friction laws agree with closed forms, with their rates."""

import math

import numpy as np
import pytest

import bounce

MU, D2 = 0.3, 0.1


def distance_to_rigid(eta, d1):
    soft = bounce.KelvinVoigt(mu=MU, d1=d1, d2=D2, eta=eta)
    hard = bounce.laws.RigidBounce(mu=MU, restitution=bounce.laws.kelvin_voigt_restitution(D2))
    shot = bounce.simulate(soft, 1.0, -1.0, 0.2, tol=1e-13)
    limit = hard.lift_off(1.0, -1.0, 0.2)
    return math.hypot(shot.lift_off.xdot - limit.xdot, shot.lift_off.omega - limit.omega)


@pytest.mark.parametrize(("d1", "rate"), [(0.0, 2.0), (0.1, 1.0)])
def test_rigid_limit(d1, rate):
    """The tangential force is eta^2 X + 2 d1 eta X': order 2 in eta without damper, 1 with it."""
    errors = [distance_to_rigid(eta, d1) for eta in (4e-3, 2e-3, 1e-3)]
    rates = np.log2(np.divide(errors[:-1], errors[1:]))
    assert rates == pytest.approx([rate, rate], abs=0.03)


def test_slip_at_lift_off_in_the_rigid_limit():
    """H_F = A |A| / (7 mu Y'_F) (1 + O(eta)) after rolling."""
    for eta in (0.02, 0.01):
        turf = bounce.KelvinVoigt(mu=MU, d1=0.1, d2=D2, eta=eta)
        shot = bounce.simulate(turf, 0.5, -1.0, 0.1, tol=1e-13)
        a = -(2 * 0.1 * eta * shot.lift_off.xdot + eta**2 * shot.lift_off.x)
        assert shot.slip == pytest.approx(a * abs(a) / (7 * MU * shot.lift_off.ydot), rel=5 * eta)


def test_elastic_limit():
    """Without damping the normal motion is half a period and keeps its speed; rate 1 in d2."""
    shot = bounce.simulate(
        bounce.KelvinVoigt(mu=MU, d1=0, d2=0, eta=0.5), 1.0, -1.0, 0.2, tol=1e-13
    )
    assert shot.time == pytest.approx(math.pi, abs=1e-13)
    assert shot.lift_off.ydot == pytest.approx(1.0, abs=1e-13)
    losses = [
        1 - bounce.simulate(bounce.KelvinVoigt(mu=MU, d1=0, d2=d, eta=0.5), 1, -1, 0.2).restitution
        for d in (2e-4, 1e-4)
    ]
    assert losses[0] / losses[1] == pytest.approx(2.0, abs=1e-3)
    assert losses[1] == pytest.approx(math.pi * 1e-4, rel=1e-2)


def test_isotropic_stiffness_retraces_the_path_only_without_friction():
    """d1 = d2 = 0, eta = 1: velocities reverse, but friction moves the place by -mu pi/2 |Y'|."""
    for mu in (0.1, 0.01):
        turf = bounce.KelvinVoigt(mu=mu, d1=0.0, d2=0.0, eta=1.0)
        shot = bounce.simulate(turf, 0.7, -1.0, 5.0, tol=1e-13)
        assert shot.itinerary == "+"
        end = np.array(shot.lift_off) - [-0.7, 1.0, 5.0 - 5 * mu, -mu * math.pi / 2, 0.0]
        assert np.abs(end).max() < 1e-13


def test_hertz_contact_time():
    """t = 2 B(2/5, 1/2) (2/5) h/v with the depth h of a full stop: h^(5/2) = (5/4) v^2/k."""
    k, v = 2.0, 1.3
    shot = bounce.simulate(bounce.Hertz(mu=MU, stiffness=k), 0.1, -v, 5.0, tol=1e-13)
    depth = (1.25 * v**2 / k) ** 0.4
    beta = math.gamma(0.4) * math.gamma(0.5) / math.gamma(0.9)
    assert shot.time == pytest.approx(0.8 * beta * depth / v, abs=1e-11)
    assert shot.lift_off.ydot == pytest.approx(v, abs=1e-11)


def test_hunt_crossley_energy_relation():
    """With c = damping/stiffness: c(v + v') = ln((1 + c v)/(1 - c v')), Hunt & Crossley 1975."""
    c = 0.3
    model = bounce.HuntCrossley(mu=MU, stiffness=1.7, damping=1.7 * c)
    shot = bounce.simulate(model, 0.1, -1.0, 5.0, tol=1e-13)
    out = shot.lift_off.ydot
    assert c * (1 + out) == pytest.approx(math.log((1 + c) / (1 - c * out)), abs=1e-11)


def test_depth_damping_vanishes_with_its_coefficient():
    common = dict(mu=MU, d1=0.0, d2=D2, eta=0.5, G=1e-3)
    a = bounce.simulate(bounce.KelvinVoigt(**common), 0.3, -1.0, 0.2, tol=1e-13)
    b = bounce.simulate(bounce.DepthDampedKelvinVoigt(**common), 0.3, -1.0, 0.2, tol=1e-13)
    assert np.abs(np.array(a.lift_off) - b.lift_off).max() < 1e-13


def free_time(model):
    """When (v t)^q times the leading factor is G, from the power law at touch-down."""
    g, v = model.values["G"], 1.0
    if isinstance(model, bounce.Hertz):
        return (g / model.values["stiffness"]) ** (2 / 3) / v
    power = 0.25 if isinstance(model, bounce.Tsuji) else 0.5
    return (g / (model.values["damping"] * v)) ** (1 / power) / v


@pytest.mark.slow
@pytest.mark.parametrize("g", [0.05, 1e-2, 1e-3, 1e-4, 1e-6, 1e-9, 1e-14, 1e-200])
def test_the_frictionless_phase_at_every_scale(g):
    """From the scale of the bounce to below rounding, also for a ball that rolls at once."""
    for model in (
        bounce.KelvinVoigt(mu=MU, d1=0.1, d2=0.0, eta=0.5, G=g, load="net"),
        bounce.Hertz(mu=MU, stiffness=1.0, G=g, load="net", eta=0.5),
        bounce.KuwabaraKono(mu=MU, stiffness=1.0, damping=0.1, G=g, load="net", eta=0.5),
        bounce.Tsuji(mu=MU, stiffness=1.0, damping=0.1, G=g, load="net", eta=0.5),
    ):
        for xdot, omega in ((0.3, 0.2), (0.0, 0.0), (0.3, -0.3)):
            shot = bounce.simulate(model, xdot, -1.0, omega, tol=1e-11)
            near = bounce.simulate(model.replace(load="contact"), xdot, -1.0, omega, tol=1e-11)
            assert np.abs(np.array(shot.lift_off) - near.lift_off).max() <= 2 * g ** (2 / 3) + 1e-9
            assert shot.time > 3.0


@pytest.mark.parametrize(
    "model",
    [
        bounce.Hertz(mu=MU, stiffness=1.0, G=0.01, load="net", eta=0.5),
        bounce.KuwabaraKono(mu=MU, stiffness=1.0, damping=0.1, G=0.01, load="net", eta=0.5),
        bounce.Tsuji(mu=MU, stiffness=1.0, damping=0.1, G=0.01, load="net", eta=0.5),
    ],
    ids=lambda m: type(m).__name__,
)
def test_power_laws_of_the_net_load_begin_without_friction(model):
    """With gravity the paper's load is negative at y = 0; as G -> 0 the two conventions meet."""
    shot = bounce.simulate(model, 0.3, -1.0, 0.2, tol=1e-11)
    assert shot.itinerary == "F + s -"
    assert shot.phases[0].t_end == pytest.approx(free_time(model), rel=0.2)
    small = bounce.simulate(model.replace(G=1e-4), 0.3, -1.0, 0.2, tol=1e-11)
    none = bounce.simulate(model.replace(G=0.0), 0.3, -1.0, 0.2, tol=1e-11)
    assert none.itinerary == "+ s -"
    gap, finer = (np.abs(np.array(s.lift_off) - none.lift_off).max() for s in (shot, small))
    assert finer < 0.1 * gap


@pytest.mark.parametrize("omega", [0.2, -3.0])
def test_a_ball_that_comes_to_rest_does_not_lift_off(omega):
    """At critical damping, with the load less gravity: lift-off at 2 - G/(G + ydot) if -ydot > G, else rest."""
    heavy = bounce.KelvinVoigt(mu=MU, d1=0.1, d2=1.0, eta=0.5, G=0.16, load="net")
    slow = [-0.01, -0.05, -0.1, -0.159]
    fast = np.array([-0.2, -0.5, -1.0])
    for ydot in slow:
        with pytest.raises(bounce.LiftOffError, match=r"ball (at|came to) rest"):
            bounce.simulate(heavy, 0.1, ydot, omega)
    many = bounce.lift_off(heavy, 0.1, [*slow, *fast], omega)
    assert many.status.tolist() == [bounce.BounceStatus.NO_LIFT_OFF] * 4 + [0] * 3
    assert many.time[4:] == pytest.approx(2 - 0.16 / (0.16 + fast), rel=1e-8)
    for ydot, time in zip(fast, many.time[4:], strict=True):
        assert bounce.simulate(heavy, 0.1, ydot, omega).time == pytest.approx(time, rel=1e-8)
