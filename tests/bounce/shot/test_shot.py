"""A shot ends at the first downward zero of the load, or says why there is none."""

import math

import casadi as ca
import numpy as np
import pytest

import bounce
import nonsmooth as ns

TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)


def test_what_a_shot_holds():
    shot = bounce.simulate(TURF, xdot=0.3, ydot=-1.0, omega=0.1, tol=1e-12)
    assert shot.landing == bounce.State(0.3, -1.0, 0.1, 0.0, 0.0)
    assert shot.slip == shot.lift_off.xdot + shot.lift_off.omega
    assert shot.restitution == -shot.lift_off.ydot / -1.0
    assert shot.model is TURF and shot.approach is None
    assert shot.trajectory.status is ns.Status.STOPPED
    assert [p.mode for p in shot.phases] == ["+", "s", "-"]
    assert shot.phases[0].t_start == 0.0 and shot.phases[-1].t_end == shot.time
    assert np.allclose(shot(shot.time), shot.trajectory.x[-1], rtol=0, atol=1e-15)
    assert shot(np.linspace(0, 1, 6).reshape(2, 3)).shape == (2, 3, 5)
    middle = [0.5 * (p.t_start + p.t_end) for p in shot.phases]
    assert list(shot.mode(middle)) == ["+", "s", "-"]
    assert "slip = -0.0063" in repr(shot)


def test_forces_are_the_accelerations():
    shot = bounce.simulate(TURF, xdot=0.3, ydot=-1.0, omega=0.1, tol=1e-13)
    t, h = np.array([0.3, 1.5, 2.9]), 1e-5
    rate = (shot(t + h) - shot(t - h)) / (2 * h)
    forces = shot.forces(t)
    assert np.allclose(rate[:, 4] * 0.4, forces.friction, atol=1e-9)
    assert np.allclose(rate[:, 3], forces.load - 1e-4, atol=1e-9)


def test_a_landing_with_negative_load_has_no_friction_until_it_is_positive():
    soft = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.0, eta=0.5, G=0.01, load="net")
    shot = bounce.simulate(soft, 0.3, -1.0, 0.2, tol=1e-13)
    assert shot.itinerary == "F + s -"
    end = shot.phases[0].t_end
    assert end == pytest.approx(0.009999666686665238206, abs=1e-12)
    t = np.array([0.5 * end, 0.5])
    forces = shot.forces(t)
    assert forces.friction[0] == 0.0 and forces.load[0] < 0.0 < forces.load[1]
    assert shot(t)[0, 4] == 0.2, "the spin is kept without friction"
    assert np.abs(shot(end) - shot.trajectory.x[0]).max() < 1e-15
    assert shot(t).shape == (2, 5)


def test_start_in_the_ground():
    """Continuing a bounce from its middle gives the same lift-off."""
    whole = bounce.simulate(TURF, 0.3, -1.0, 0.1, tol=1e-13)
    x, xdot, y, ydot, omega = whole(2.0)
    assert y < 0 < ydot
    rest = bounce.simulate(TURF, xdot, ydot, omega, x, y, tol=1e-13)
    assert rest.itinerary == "s -"
    assert np.abs(np.array(rest.lift_off) - whole.lift_off).max() < 1e-12
    assert rest.time == pytest.approx(whole.time - 2.0, abs=1e-12)


def test_straight_drop_rolls():
    shot = bounce.simulate(TURF, 0.0, -1.0, 0.0)
    assert shot.itinerary == "s" and shot.lift_off.xdot == shot.lift_off.omega == 0.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (dict(xdot=1, ydot=1.0, omega=0), "ydot: expected a negative number at y = 0, received 1.0"),
        (dict(xdot=1, ydot=0.0, omega=0), "does not approach"),
        (dict(xdot=1, ydot=-1.0, omega=0, y=0.1), "The ball is in the air"),
        (dict(xdot=math.nan, ydot=-1.0, omega=0), "xdot: expected a finite number, received nan"),
        (dict(xdot=1, ydot=-math.inf, omega=0), "ydot: expected a finite number, received -inf"),
        (dict(xdot=1, ydot=-1.0, omega="fast"), r"omega: expected a finite number, .*\(str\)"),
        (dict(xdot=[1, 2], ydot=-1.0, omega=0), r"xdot: expected one number, received \(2,\)"),
        (dict(xdot=np.ones(3), ydot=-1.0, omega=0), r"xdot: expected one number, received \(3,\)"),
        (dict(xdot=1, ydot=-1.0, omega=None), "omega: expected a finite number, received None"),
    ],
)  # fmt: skip
def test_not_a_landing(arguments, message):
    with pytest.raises(bounce.LandingError, match=message) as raised:
        bounce.simulate(TURF, **arguments)
    assert isinstance(raised.value, ns.NonsmoothError) and isinstance(raised.value, ValueError)


def test_moving_up_without_load():
    with pytest.raises(bounce.LandingError, match="has lifted off already"):
        bounce.simulate(TURF.replace(load="net"), 1.0, 2.0, 0.0, y=-1e-5)


def test_lift_off_that_never_comes():
    with pytest.raises(bounce.LiftOffError, match="before t_max = 1, received none") as raised:
        bounce.simulate(TURF, 1.0, -1.0, 0.0, t_max=1.0)
    assert raised.value.trajectory.status is ns.Status.REACHED_END
    with pytest.raises(bounce.LiftOffError, match="came to rest in the ground"):
        bounce.simulate(TURF.replace(G=10.0), 0.1, -1.0, 0.0)


def test_a_load_that_never_becomes_positive():
    class Hole(bounce.ContactModel):
        parameters = dict(mu=0.3)

        def normal_force(self, s, p):
            return -1 - s.y

        def load(self, s, p):
            return -0.1 + s.y

        def tangential_force(self, s, p):
            return 0

    with pytest.raises(bounce.LiftOffError, match=r"expected before t_max = 3"):
        bounce.simulate(Hole(), 1.0, -1.0, 0.0, t_max=3.0)


def test_a_ball_that_returns_without_pressing():
    class Trampoline(bounce.ContactModel):
        parameters = dict(mu=0.3)

        def normal_force(self, s, p):
            return -s.y

        def load(self, s, p):
            return -s.y - 5

        def tangential_force(self, s, p):
            return 0

    with pytest.raises(bounce.LiftOffError, match="passes through the surface without pressing"):
        bounce.simulate(Trampoline(), 1.0, -1.0, 0.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (dict(tol=0.0), "tol: expected"),
        (dict(tol=-1e-6), "tol: expected"),
        (dict(t_max=0.0), "t_max: expected a positive time"),
        (dict(t_max=math.inf), "t_max: expected a finite number"),
    ],
)
def test_options(options, message):
    with pytest.raises(ns.OptionError, match=message):
        bounce.simulate(TURF, 1.0, -1.0, 0.0, **options)


def test_not_a_model():
    with pytest.raises(bounce.ModelError, match="make an instance"):
        bounce.simulate(bounce.KelvinVoigt, 1.0, -1.0, 0.0)
    with pytest.raises(bounce.ModelError, match=r"use its lift_off\(xdot, ydot, omega\)"):
        bounce.simulate(bounce.laws.RigidBounce(mu=0.3, restitution=0.5), 1.0, -1.0, 0.0)


def test_energy_needs_the_models_word():
    class Plain(bounce.ContactModel):
        parameters = dict(mu=0.3)

        def normal_force(self, s, p):
            return -s.y

        def tangential_force(self, s, p):
            return 0

    with pytest.raises(bounce.ModelError, match="stored_energy"):
        bounce.simulate(Plain(), 1.0, -1.0, 0.0).energy(0.0)


POWER_LAWS = [
    bounce.Hertz(mu=0.3, stiffness=1),
    bounce.Hertz(mu=0.3, stiffness=1, G=0.01),
    bounce.Hertz(mu=0.3, stiffness=1, d1=0.1, eta=0.5, G=0.01, load="net"),
    bounce.HuntCrossley(mu=0.3, stiffness=1, damping=0.3),
    bounce.HuntCrossley(mu=0.3, stiffness=1, damping=0.3, d1=0.1, eta=0.5),
    bounce.Tsuji(mu=0.3, stiffness=1, damping=0.3),
    bounce.KuwabaraKono(mu=0.3, stiffness=1, damping=0.3, G=0.01, load="net"),
]


SLOWLY = [(m, tol) for m in POWER_LAWS[1:] for tol in (1e-6, 1e-13)]


@pytest.mark.slow_cases("Hertz(mu=0.3, stiffness=1, d1=0.1, eta=0.5, G=0.01, load='net')-1e-10")
@pytest.mark.parametrize(
    ("model", "tol"),
    [
        *[(POWER_LAWS[0], tol) for tol in (1e-6, 1e-13)],
        *[(model, 1e-10) for model in POWER_LAWS],
        *[pytest.param(*case, marks=pytest.mark.slow) for case in SLOWLY],
    ],
    ids=repr,
)
def test_a_ball_that_rolls_to_lift_off_where_the_load_fades(model, tol):
    """With no force along the ground rolling lasts to lift-off, whatever function ends the load."""
    landings = [(0.0, 0.0)] if model.values["eta"] else [(0.0, 0.0), (0.5, -0.5), (0.3, -0.1)]
    slipping = bounce.simulate(model, 5.0, -1.0, 5.0, tol=1e-13)
    for xdot, omega in landings:
        shot = bounce.simulate(model, xdot, -1.0, omega, tol=tol)
        assert shot.itinerary.endswith("s")
        assert abs(shot.slip) < 10 * tol
        many = bounce.lift_off(model, xdot, -1.0, omega, tol=tol)
        assert many.itinerary == shot.itinerary
        assert abs(shot.time - slipping.time) < 100 * tol
        assert abs(shot.lift_off.ydot - slipping.lift_off.ydot) < 100 * tol


class Law(bounce.ContactModel):
    parameters = dict(mu=0.3)
    law = staticmethod(lambda s: -s.y)

    def normal_force(self, s, p):
        return self.law(s)

    def tangential_force(self, s, p):
        return 0


@pytest.mark.parametrize(
    ("law", "cause"),
    [
        (lambda s: s.y, "sinks without end.*positive in compression"),
        (lambda s: s.y - 1, "sinks without end.*positive in compression"),
        (lambda s: ca.exp(-s.y), "above the ground: the load of this model does not vanish"),
    ],
    ids=["wrong sign", "attractive", "never vanishes"],
)
def test_why_there_is_no_lift_off(law, cause):
    model = type("Own", (Law,), dict(law=staticmethod(law)))()
    with pytest.raises(bounce.LiftOffError, match=cause):
        bounce.simulate(model, 1.0, -1.0, 0.2)
