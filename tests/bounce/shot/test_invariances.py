"""Mirror, scaling, energy, the friction cone, and no lift-off while rolling: for any parameters."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bounce

# Gravity well below G = d2 |ydot|, where a damped ball would come to rest in the ground.
PARAMETERS = st.fixed_dictionaries(
    dict(
        mu=st.floats(0.05, 1.5),
        d1=st.floats(0.0, 0.5),
        d2=st.floats(0.0, 0.5),
        # between 0 and rounding nobody knows whether friction can hold at touch-down: NON_UNIQUE is said
        eta=st.just(0.0) | st.floats(1e-9, 4.0),
        G=st.floats(0.0, 0.01),
    )
)
LANDING = st.tuples(st.floats(-2, 2), st.floats(-2, -0.2), st.floats(-3, 3))
LOAD = st.sampled_from(["contact", "net"])
POWER_LAWS = [
    bounce.Hertz(mu=0.3, stiffness=1.0, eta=0.7),
    bounce.HuntCrossley(mu=0.3, stiffness=1.0, damping=0.3, eta=0.7, d1=0.1),
    bounce.Tsuji(mu=0.3, stiffness=1.0, damping=0.3, eta=0.7, d1=0.1, G=0.01),
    bounce.KuwabaraKono(mu=0.3, stiffness=1.0, damping=0.3, eta=0.7, d1=0.1),
    bounce.Maxwell(mu=0.3, branch_stiffness=1.0, relaxation=0.5, eta=0.7, d1=0.1),
]


@given(parameters=PARAMETERS, landing=LANDING, load=LOAD)
def test_mirror(parameters, landing, load):
    """(X, X', Omega) -> -(X, X', Omega) is an exact symmetry, of the arithmetic too."""
    model = bounce.KelvinVoigt(**parameters, load=load)
    xdot, ydot, omega = landing
    a, b = bounce.simulate(model, xdot, ydot, omega), bounce.simulate(model, -xdot, ydot, -omega)
    swap = str.maketrans("+-", "-+")
    assert b.itinerary == a.itinerary.translate(swap)
    assert np.abs(np.array(a.lift_off) * [-1, 1, -1, -1, 1] - b.lift_off).max() <= 1e-13


@given(parameters=PARAMETERS, landing=LANDING, load=LOAD, c=st.floats(0.1, 10))
def test_scaling(parameters, landing, load, c):
    """(p, G) -> (c p, c G): the linear model is homogeneous of degree one."""
    model = bounce.KelvinVoigt(**parameters, load=load)
    scaled = model.replace(G=c * parameters["G"])
    a = bounce.simulate(model, *landing, tol=1e-12)
    b = bounce.simulate(scaled, *(c * v for v in landing), tol=1e-12)
    assert np.abs(np.array(b.lift_off) - c * np.array(a.lift_off)).max() <= 1e-9 * max(1, c)
    assert abs(a.time - b.time) <= 1e-9


@given(parameters=PARAMETERS, landing=LANDING)
def test_energy_and_cone(parameters, landing):
    check_energy_and_cone(bounce.KelvinVoigt(**parameters), landing)


@pytest.mark.parametrize("model", POWER_LAWS, ids=lambda m: type(m).__name__)
@pytest.mark.parametrize("landing", [(0.3, -1.0, 0.4), (1.0, -0.7, -2.5), (-0.9, -1.2, 0.9)])
def test_energy_and_cone_of_other_laws(model, landing):
    check_energy_and_cone(model, landing)


def check_energy_and_cone(model, landing):
    shot = bounce.simulate(model, *landing, tol=1e-12)
    t = np.linspace(0.0, shot.time, 400)
    energy = shot.energy(t[:-1])
    assert np.all(np.diff(energy) <= 1e-11 * energy[0]), "energy never increases"
    load, friction = shot.forces(t)
    mu = model.values["mu"]
    assert np.all(load >= -1e-10)
    assert np.all(np.abs(friction) <= mu * load * (1 + 1e-12) + 1e-10)
    slipping = shot.mode(t) != "s"
    assert np.all(np.abs(friction[slipping]) == pytest.approx(mu * load[slipping], abs=1e-10))
    slip = shot(t)[:, 1] + shot(t)[:, 4]
    assert np.all(friction * slip <= 1e-11), "friction opposes the slip"


def test_rolling_dissipates_nothing():
    """Without dampers the energy is constant while the ball rolls."""
    elastic = bounce.KelvinVoigt(mu=0.5, d1=0.0, d2=0.0, eta=0.8, G=0.01)
    shot = bounce.simulate(elastic, 0.2, -1.0, 0.1, tol=1e-13)
    rolling = next(p for p in shot.phases if p.mode == "s")
    energy = shot.energy(np.linspace(rolling.t_start, rolling.t_end, 100))
    assert np.ptp(energy) <= 1e-13
    assert shot.energy(0.0) > energy[0]


@pytest.mark.parametrize("load", ["contact", "net"])
def test_no_rolling_lift_off_on_a_grid(load):
    """A ball that moves along the ground lifts off slipping: rolling lift-off has codimension one."""
    turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4, load=load)
    speeds, spins = np.linspace(-1.97, 2.03, 15), np.linspace(-3.97, 4.03, 15)
    itineraries = {
        bounce.simulate(turf, u, -1.0, w, tol=1e-8).itinerary for u in speeds for w in spins
    }
    assert not any(i.endswith("s") for i in itineraries)
    assert {"+", "-", "+ s +", "+ s -", "- s -", "- s +"} <= itineraries
