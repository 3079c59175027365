"""A ball that leaves with more energy than it came with is not passed over in silence."""

import warnings

import numpy as np
import pytest

import bounce


class Sticky(bounce.ContactModel):
    """A spring that pulls at y = 0 already; its load is left at the default."""

    parameters = dict(mu=0.3, stiffness=1.0, adhesion=0.05, damping=0.0)

    def normal_force(self, s, p):
        return -p.stiffness * s.y - 2 * p.damping * s.ydot - p.adhesion

    def tangential_force(self, s, p):
        return 0


class PulledOff(Sticky):
    """The same spring let go where it pulls as hard as it can: at y = adhesion / stiffness."""

    parameters = dict(reach=0.05)

    def load(self, s, p):
        return p.reach - s.y

    def normal_force(self, s, p):
        return -p.stiffness * s.y - p.adhesion


ADVICE = "load.*lift_off"


def test_adhesion_with_the_default_load():
    with pytest.warns(bounce.EnergyWarning, match=ADVICE) as caught:
        shot = bounce.simulate(Sticky(), 0.2, -1.0, 0.1)
    assert shot.lift_off.ydot == pytest.approx(np.sqrt(1 + 0.05**2), abs=1e-9)
    assert len(caught) == 1 and caught[0].filename == __file__
    with pytest.warns(bounce.EnergyWarning, match="2 of 3 bounces") as caught:
        many = bounce.lift_off(Sticky(), 0.2, -1.0, 0.1, parameters=dict(adhesion=[0.05, 0.0, 0.1]))
    assert many.complete.all() and caught[0].filename == __file__


def test_adhesion_that_is_let_go_where_it_ends():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        shot = bounce.simulate(PulledOff(), 0.2, -1.0, 0.1)
        bounce.lift_off(PulledOff(), 0.2, [-1.0, -2.0], 0.1)
    # energy: 1/2 = v^2/2 + k r^2/2 + c r
    assert shot.lift_off.ydot == pytest.approx(np.sqrt(1 - 0.05**2 - 2 * 0.05 * 0.05), abs=1e-9)


@pytest.mark.slow_cases(
    "KelvinVoigt(mu=0.3, d1=0, d2=0, eta=1.5, G=0.01, slope=-0.3, load='net')-1e-06",
    "Hertz(mu=0.3, stiffness=1)-1e-06",
    "Maxwell(mu=0.3, branch_stiffness=1, relaxation=1e+06)-1e-06",
)
@pytest.mark.parametrize("tol", [1e-6, pytest.param(1e-10, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "model",
    [
        bounce.KelvinVoigt(mu=0.3, d1=0.0, d2=0.0, eta=0.5),
        bounce.KelvinVoigt(mu=0.0, d1=0.0, d2=0.0, eta=1.5, G=0.01, slope=0.3),
        bounce.KelvinVoigt(mu=0.3, d1=0.0, d2=0.0, eta=1.5, G=0.01, slope=-0.3, load="net"),
        bounce.Hertz(mu=0.3, stiffness=1.0),
        bounce.Maxwell(mu=0.3, branch_stiffness=1.0, relaxation=1e6),
    ],
    ids=repr,
)
def test_elastic_bounces_are_no_cause_for_concern(model, tol):
    """They keep their energy, to the tolerance, and some leave a little faster than they came."""
    rng = np.random.default_rng(0)
    xdot, omega = rng.uniform(-2, 2, (2, 200))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        many = bounce.lift_off(model, xdot, -1.0, omega, tol=tol)
        assert many.complete.all()
        bounce.simulate(model, xdot[0], -1.0, omega[0], tol=tol)
        bounce.simulate(model, 0.0, 1.0, 0.0, y=-0.5)  # released from a compressed spring
        bounce.lift_off(model, 0.0, 1.0, 0.0, y=-0.5)
