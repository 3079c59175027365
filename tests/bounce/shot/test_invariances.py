"""Mirror, scaling, energy, the friction cone, and no lift-off while rolling: for any parameters."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import bounce

# Gravity well below G = d2 |ydot|, where a damped ball would come to rest in the ground.
PARAMETERS = st.fixed_dictionaries(
    dict(
        mu=st.floats(0.05, 1.5),
        d1=st.floats(0.0, 0.5),
        d2=st.floats(0.0, 0.5),
        eta=st.floats(0.0, 4.0),
        G=st.floats(0.0, 0.01),
    )
)
LANDING = st.tuples(st.floats(-2, 2), st.floats(-2, -0.2), st.floats(-3, 3))
LOAD = st.sampled_from(["contact", "net"])
POWER_LAWS = [
    bounce.Hertz(mu=0.3, stiffness=1.0, eta=0.7),
    bounce.contact.HuntCrossley(mu=0.3, stiffness=1.0, damping=0.3, eta=0.7, d1=0.1),
    bounce.contact.Tsuji(mu=0.3, stiffness=1.0, damping=0.3, eta=0.7, d1=0.1, G=0.01),
    bounce.contact.KuwabaraKono(mu=0.3, stiffness=1.0, damping=0.3, eta=0.7, d1=0.1),
    bounce.contact.Maxwell(mu=0.3, branch_stiffness=1.0, relaxation=0.5, eta=0.7, d1=0.1),
]


@given(parameters=PARAMETERS, landing=LANDING, load=LOAD)
def test_mirror(parameters, landing, load):
    """(X, X', Omega) -> -(X, X', Omega) is an exact symmetry, of the arithmetic too."""
    model = bounce.KelvinVoigt(**parameters, load=load)
    xdot, ydot, omega = landing
    a, b = bounced(model, xdot, ydot, omega), bounced(model, -xdot, ydot, -omega)
    assert (a is None) == (b is None), "what is refused is refused in the mirror too"
    if a is None or b is None:
        return
    swap = str.maketrans("+-", "-+")
    assert b.itinerary == a.itinerary.translate(swap)
    assert np.abs(np.array(a.lift_off) * [-1, 1, -1, -1, 1] - b.lift_off).max() <= 1e-13


def bounced(model, *landing, tol=1e-13):
    """The bounce; None where only rounding knows to which side the ball slips as it lifts off."""
    try:
        return bounce.simulate(model, *landing, tol=tol)
    except bounce.LiftOffError as error:
        assert "NON_UNIQUE" in str(error)
        assert error.trajectory is not None
        _, _, y, ydot, _ = error.trajectory.x[-1]
        gravity = model.values["G"] if model.convention == "net" else 0.0
        load = -y - 2 * model.values["d2"] * ydot - gravity
        assert abs(load) <= 10 * tol, "the load is gone to rounding"
        return None


@given(parameters=PARAMETERS, landing=LANDING, load=LOAD, c=st.floats(0.1, 10))
def test_scaling(parameters, landing, load, c):
    """(p, G) -> (c p, c G): the linear model is homogeneous of degree one."""
    model = bounce.KelvinVoigt(**parameters, load=load)
    scaled = model.replace(G=c * parameters["G"])
    a = bounced(model, *landing, tol=1e-12)
    b = bounced(scaled, *(c * v for v in landing), tol=1e-12)
    if a is None or b is None:
        return
    assert np.abs(np.array(b.lift_off) - c * np.array(a.lift_off)).max() <= 1e-9 * max(1, c)
    assert abs(a.time - b.time) <= 1e-9


@example(  # the bound of sticking and the load reach zero together, to rounding
    parameters={"mu": 1.0, "d1": 0.0, "d2": 0.375, "eta": 5.186406375504506e-07, "G": 0.0},
    landing=(0.0, -2.0, 1.0),
)
@given(parameters=PARAMETERS, landing=LANDING)
def test_energy_and_cone(parameters, landing):
    check_energy_and_cone(bounce.KelvinVoigt(**parameters), landing)


@pytest.mark.parametrize("model", POWER_LAWS, ids=lambda m: type(m).__name__)
@pytest.mark.parametrize("landing", [(0.3, -1.0, 0.4), (1.0, -0.7, -2.5), (-0.9, -1.2, 0.9)])
def test_energy_and_cone_of_other_laws(model, landing):
    check_energy_and_cone(model, landing)


def check_energy_and_cone(model, landing):
    shot = bounced(model, *landing, tol=1e-12)
    if shot is None:
        return
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
