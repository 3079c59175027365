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
    assert shot.landing == bounce.shot.State(0.3, -1.0, 0.1, 0.0, 0.0)
    assert shot.slip == shot.lift_off.xdot + shot.lift_off.omega
    assert shot.slip_speed == -shot.slip and shot.slip_angle == shot.turn == math.pi
    assert shot.travel_angle == shot.kick == 0.0 and shot.reversal
    assert shot.restitution == -shot.lift_off.ydot / -1.0
    assert shot.model is TURF and shot.approach is None
    assert shot.trajectory.status is ns.Status.STOPPED
    assert [p.mode for p in shot.phases] == ["+", "s", "-"]
    assert shot.phases[0].t_start == 0.0 and shot.phases[-1].t_end == shot.time
    assert np.allclose(shot(shot.time), shot.trajectory.x[-1], rtol=0, atol=1e-15)
    assert shot(np.linspace(0, 1, 6).reshape(2, 3)).shape == (2, 3, 5)
    assert np.array_equal(shot.state([0.0, 1.0]).slip, shot([0.0, 1.0])[:, [1, 4]].sum(axis=1))
    assert bounce.simulate(TURF, *shot.landing, tol=1e-12).lift_off == shot.lift_off
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


PAIR = [1.0, 0.0]


@pytest.mark.parametrize(
    ("landing", "name"),
    [
        ((1, 1.0, 0), "ydot"),
        ((1, 0.0, 0), "ydot"),
        ((1, -1.0, 0, 0.0, 0.1), "y is 0.1"),
        ((math.nan, -1.0, 0), "xdot"),
        ((1, -math.inf, 0), "ydot"),
        ((1, -1.0, "fast"), "omega"),
        ((1, -1.0, None), "omega"),
        ((1, [-1.0], 0), "ydot"),
        (([1, 2], -1.0, 0), "omega"),
        ((1.0, -1.0, PAIR), "xdot"),
        ((np.ones(3), -1.0, PAIR), "xdot"),
        (([1.0], -1.0, PAIR), "xdot"),
        ((PAIR, -1.0, [0.1, 0.2, 0.3]), "omega.*drilling_radius"),
        ((PAIR, -1.0, [PAIR]), "omega"),
        (([1.0, math.nan], -1.0, PAIR), r"xdot\[1\]"),
        ((["1", "2"], -1.0, PAIR), r"xdot\[0\]"),
        ((PAIR, 0.0, PAIR), "ydot"),
        ((PAIR, [-1.0], PAIR), "ydot"),
        ((PAIR, -1.0, PAIR, 0.5), "x"),
    ],
    ids=repr,
)
def test_not_a_landing(landing, name):
    with pytest.raises(bounce.LandingError, match=name) as raised:
        bounce.simulate(TURF, *landing)
    assert isinstance(raised.value, ns.NonsmoothError) and isinstance(raised.value, ValueError)


def test_a_landing_in_the_plane_on_a_surface_in_3d():
    with pytest.raises(bounce.LandingError, match=r"xdot.*in_3d"):
        bounce.simulate(TURF.in_3d(), 1.0, -1.0, 0.1)


def test_moving_up_without_load():
    with pytest.raises(bounce.LandingError, match="lifted off"):
        bounce.simulate(TURF.replace(load="net"), 1.0, 2.0, 0.0, y=-1e-5)


def test_lift_off_that_never_comes():
    with pytest.raises(bounce.LiftOffError, match="t_max = 1") as raised:
        bounce.simulate(TURF, 1.0, -1.0, 0.0, t_max=1.0)
    assert raised.value.trajectory.status is ns.Status.REACHED_END
    with pytest.raises(bounce.LiftOffError, match="came to rest"):
        bounce.simulate(TURF.replace(G=10.0), 0.1, -1.0, 0.0)


class Own(bounce.ContactModel):
    """A model by its law of the normal force, and maybe of the load."""

    parameters = dict(mu=0.3)
    law = staticmethod(lambda s: -s.y)

    def normal_force(self, s, p):
        return self.law(s)

    def tangential_force(self, s, p):
        return 0


@pytest.mark.parametrize(
    ("methods", "t_max", "cause"),
    [
        (dict(law=lambda s: s.y), 100.0, "sinks"),
        (dict(law=lambda s: s.y - 1), 100.0, "sinks"),
        (dict(law=lambda s: ca.exp(-s.y)), 100.0, "above the ground"),
        (dict(law=lambda s: -1 - s.y, load=lambda s, p: s.y - 0.1), 3.0, "t_max = 3"),
        (dict(load=lambda s, p: -s.y - 5), 100.0, "without pressing"),
    ],
    ids=["wrong sign", "attractive", "never vanishes", "load never positive", "returns"],
)
def test_why_there_is_no_lift_off(methods, t_max, cause):
    model = type("Of", (Own,), {name: staticmethod(law) for name, law in methods.items()})()
    with pytest.raises(bounce.LiftOffError, match=cause):
        bounce.simulate(model, 1.0, -1.0, 0.2, t_max=t_max)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (dict(tol=0.0), "tol"),
        (dict(tol=-1e-6), "tol"),
        (dict(t_max=0.0), "t_max"),
        (dict(t_max=math.inf), "t_max"),
    ],
)
def test_options(options, message):
    with pytest.raises(ns.OptionError, match=message):
        bounce.simulate(TURF, 1.0, -1.0, 0.0, **options)


def test_not_a_model():
    with pytest.raises(bounce.ModelError, match="instance"):
        bounce.simulate(bounce.KelvinVoigt, 1.0, -1.0, 0.0)
    with pytest.raises(bounce.ModelError, match="lift_off"):
        bounce.simulate(bounce.laws.RigidBounce(mu=0.3, restitution=0.5), 1.0, -1.0, 0.0)
    with pytest.raises(bounce.ModelError, match="lift_off"):
        bounce.simulate(bounce.laws.RigidBounce(mu=0.3, restitution=0.5), PAIR, -1.0, PAIR)


def test_energy_needs_the_models_word():
    with pytest.raises(bounce.ModelError, match="stored_energy"):
        bounce.simulate(Own(), 1.0, -1.0, 0.0).energy(0.0)


POWER_LAWS = [
    bounce.Hertz(mu=0.3, stiffness=1),
    bounce.Hertz(mu=0.3, stiffness=1, G=0.01),
    bounce.Hertz(mu=0.3, stiffness=1, d1=0.1, eta=0.5, G=0.01, load="net"),
    bounce.contact.HuntCrossley(mu=0.3, stiffness=1, damping=0.3),
    bounce.contact.HuntCrossley(mu=0.3, stiffness=1, damping=0.3, d1=0.1, eta=0.5),
    bounce.contact.Tsuji(mu=0.3, stiffness=1, damping=0.3),
    bounce.contact.KuwabaraKono(mu=0.3, stiffness=1, damping=0.3, G=0.01, load="net"),
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
