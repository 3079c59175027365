"""The slip at lift-off turns once around the spins at which it is zero; arrays in 3-D are the bounces
one by one, come no farther apart than they landed, and turn with eta as the formula says."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bounce
import nonsmooth as ns

TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)


def test_arrays_are_the_bounces_one_by_one():
    rng = np.random.default_rng(4)
    v, w = rng.uniform(-1, 1, (4, 2)), rng.uniform(-1, 1, (4, 2))
    for model in (TURF.in_3d(side_slope=0.1), TURF.in_3d(drilling_radius=0.1)):
        many = bounce.lift_off(model, v, -1.0, w, tol=1e-9)
        assert np.all(many.complete)
        for k in range(4):
            one = bounce.simulate(model, v[k], -1.0, w[k], tol=1e-9)
            assert many.itinerary[k] == one.itinerary
            assert many.slip[k] == pytest.approx(one.slip, abs=1e-8)
            assert many.omega[k] == pytest.approx(one.lift_off.omega, abs=1e-8)
            assert many.travel_angle[k] == pytest.approx(one.travel_angle, abs=1e-6)


def test_arrays_of_a_law_with_bristles_and_of_what_is_no_landing():
    dahl = TURF.replace(friction=bounce.Dahl(bristle_stiffness=20.0)).in_3d()
    many = bounce.lift_off(dahl, [[1.0, 0.0], [np.nan, 0.0]], [-1.0, -1.0], [0.2, 0.1])
    assert many.itinerary.tolist() == ["*", ""]
    assert many.status.tolist() == [bounce.BounceStatus.LIFTED_OFF, bounce.BounceStatus.NOT_FINITE]
    for wrong in (dict(xdot=[1.0], omega=[0.1, 0.2]), dict(xdot=[1.0, 0.0], omega=0.1)):
        with pytest.raises(bounce.LandingError, match=r"expected an array \(\.\.\., 2\)"):
            bounce.lift_off(TURF.in_3d(), ydot=-1.0, **wrong)


def test_an_array_of_nothing_has_its_shape():
    none = bounce.lift_off(TURF.in_3d(), np.zeros((0, 2)), -1.0, np.zeros((3, 1, 2)))
    assert none.slip.shape == (3, 0, 2) and none.status.shape == (3, 0)


def distances(off, eta, k):
    """Squared distances of neighbours in the metric of friction."""
    parts = ((1.0, off["xdot"]), (k, off["omega"]), (eta**2, off["x"]))
    return sum(weight * np.sum((a[0] - a[1]) ** 2, axis=-1) for weight, a in parts)


@pytest.mark.parametrize(
    "eta, mu, load", [(0.5, 0.3, "contact"), pytest.param(1.5, 0.6, "net", marks=pytest.mark.slow)]
)
def test_in_the_plane_bounces_come_closer(eta, mu, load):
    """|dV|^2 + k |dW|^2 + eta^2 |dX|^2 does not grow while the load is nonnegative."""
    model = TURF.replace(eta=eta, mu=mu, load=load)
    rng = np.random.default_rng(1)
    v, w, x = rng.uniform(-2, 2, (3, 2, 2000))
    v[1], w[1] = v[0] + rng.normal(0, 0.3, 2000), w[0] + rng.normal(0, 0.3, 2000)
    off = bounce.lift_off(model, v, -1.0, w, x)
    before = distances(dict(xdot=v[..., None], omega=w[..., None], x=x[..., None]), eta, 0.4)
    ends = {name: getattr(off, name)[..., None] for name in ("xdot", "omega", "x")}
    assert np.all(off.complete)
    assert np.all(distances(ends, eta, 0.4) <= before * (1 + 1e-9) + 1e-12)


#: Friction of every kind takes part as -mu load lambda . h, of which the multiplier is a subgradient.
FRICTIONS = {
    "isotropic": {},
    "elliptical": dict(friction_ratio=0.4, grain=0.7),
    "drilling": dict(drilling_radius=0.3),
    "both, on a side slope": dict(
        friction_ratio=0.7, grain=-0.4, drilling_radius=0.1, side_slope=0.2
    ),
}


def come_closer(friction, eta, mu, load, seed, size, pairs):
    """Two landings each, apart by a part of their size, are no farther apart in friction's metric."""
    model = TURF.replace(load=load).in_3d(**FRICTIONS[friction])
    rng = np.random.default_rng(seed)
    n = 3 if model.drilling else 2
    v, x = rng.uniform(-1.5, 1.5, (2, 2, pairs, 2))
    w = rng.uniform(-1.5, 1.5, (2, pairs, n))
    for array in (v, w, x):
        array[1] = array[0] + size * array[1]
    work = ns.Work(progress=False, threads=1)
    values = dict(eta=eta, mu=mu)
    off = bounce.lift_off(model, v, -1.0, w, x, parameters=values, tol=1e-12, work=work)
    ends = {name: getattr(off, name) for name in ("xdot", "omega", "x")}
    assert np.all(off.complete)
    before = distances(dict(xdot=v, omega=w, x=x), eta, 0.4)
    assert np.all(np.sqrt(distances(ends, eta, 0.4)) <= np.sqrt(before) * (1 + 1e-12) + 1e-10)


TURFS_3D = dict(
    eta=st.floats(0.05, 4.0),
    mu=st.floats(0.05, 1.5),
    load=st.sampled_from(["contact", "net"]),
    seed=st.integers(0, 2**31),
    size=st.sampled_from([1.0, 1e-2, 1e-5]),
)


@pytest.mark.parametrize("friction", FRICTIONS)
@settings(max_examples=3)
@given(**TURFS_3D)
def test_in_3d_bounces_come_closer(friction, eta, mu, load, seed, size):
    come_closer(friction, eta, mu, load, seed, size, 15)


@pytest.mark.slow
@pytest.mark.parametrize("friction", FRICTIONS)
@settings(max_examples=12)
@given(**TURFS_3D)
def test_in_3d_many_bounces_come_closer(friction, eta, mu, load, seed, size):
    come_closer(friction, eta, mu, load, seed, size, 400)


@pytest.mark.parametrize("xdot, spin", [(0.2, 0.5505198965), (2.0, 1.5971891199)])
def test_vortices_are_on_the_dividing_curve(xdot, spin):
    """Published with the theory, by the sign of the slip, which is quadratic in the distance where the
    ball rolls into the two-fold and so known to 1e-8 there; and slipping up to the last moment."""
    (found,) = bounce.find_vortices(TURF, [xdot, 0.0])
    assert found == pytest.approx([spin, 0.0], abs=2e-8 if xdot < 1 else 1e-10)
    # It is in the middle between slips of equal size: to a thousandth of the distance.
    beside = found + 1e-6 * np.array([[1.0, 0.0], [-1.0, 0.0]])
    right, left = bounce.lift_off(TURF.in_3d(), [xdot, 0.0], -1.0, beside, tol=1e-13).slip[:, 0]
    assert right > 0 > left and right == pytest.approx(-left, rel=4e-3)
    e = np.array([math.cos(0.6), math.sin(0.6)])
    (turned,) = bounce.find_vortices(TURF, xdot * e)
    assert turned == pytest.approx(found[0] * e, abs=1e-12)


def test_the_slip_turns_once_around_a_vortex_and_not_beside_it():
    spin = 0.5505198965
    assert bounce.winding_number(TURF, [0.2, 0.0], [spin, 0.0], 0.3, tol=1e-6) == 1
    assert bounce.winding_number(TURF, [0.2, 0.0], [spin, 0.5], 0.3, tol=1e-6) == 0


@pytest.mark.slow
def test_winding_numbers_of_small_and_large_circles():
    for xdot, spin in ((0.2, 0.5505198965), (2.0, 1.5971891199)):
        for radius in (0.3, 0.03, 4.0):
            assert bounce.winding_number(TURF, [xdot, 0.0], [spin, 0.0], radius, tol=1e-8) == 1
        assert bounce.winding_number(TURF, [xdot, 0.0], [spin, 0.5], 0.3, tol=1e-8) == 0


def test_a_map_finds_the_cell_of_the_vortex():
    spins = np.linspace(0.45, 0.65, 3), np.linspace(-0.1, 0.15, 2)
    found = bounce.slip_map(TURF, [0.2, 0.0], spins, tol=1e-6)
    (vortex,) = found.vortices
    assert vortex.winding == 1 and vortex.omega == pytest.approx([0.6, 0.025])
    # Mirrored spins are the mirrored map.
    other = bounce.slip_map(TURF, [0.2, 0.0], (spins[0], -spins[1]), tol=1e-6)
    assert other.angle == pytest.approx(-found.angle, abs=1e-4)
    assert "+1 at [0.6, 0.025]" in repr(found)


def test_the_turn_with_eta_is_the_formula_to_first_order():
    """Published with the theory, in degrees: computed, and by the formula."""
    found = bounce.slip_turn(TURF, [2.0, 0.0], [0.5, 1.0], [0.01, 0.05, 0.1, 0.2, 0.5])
    assert np.degrees(found.turn) == pytest.approx([0.18914, 1.3069, 3.72, 15.3, 144.8], rel=4e-3)
    assert np.degrees(found.first_order[:3]) == pytest.approx([0.18806, 1.2517, 3.28], rel=1e-3)
    small = bounce.slip_turn(TURF, [2.0, 0.0], [0.5, 1.0], [1e-3, 5e-4], tol=1e-12)
    error = np.abs(small.turn - small.first_order)
    assert error[1] < 0.3 * error[0]  # second order
    mirrored = bounce.slip_turn(TURF, [2.0, 0.0], [0.5, -1.0], [0.05])
    assert mirrored.turn[0] == pytest.approx(-found.turn[1], abs=1e-9)


@pytest.mark.slow
def test_refusals():
    with pytest.raises(ns.OptionError, match="radius, points"):
        bounce.winding_number(TURF, [0.2, 0.0], [0.5, 0.0], 0.0)
    with pytest.raises(ns.ConvergenceError, match="without a direction"):
        bounce.winding_number(
            bounce.NormalKelvinVoigt(mu=0.3, d2=0.1), [0.2, 0.0], [0.0, 0.0], 0.1, tol=1e-6
        )  # it rolls and keeps rolling: no direction
    with pytest.raises(bounce.ModelError, match="the same in all directions"):
        bounce.find_vortices(TURF.in_3d(friction_ratio=0.5), [0.2, 0.0])
    with pytest.raises(bounce.LandingError, match="direction of travel"):
        bounce.find_vortices(TURF, [0.0, 0.0])
    with pytest.raises(ns.OptionError, match="slips throughout"):
        bounce.slip_turn(TURF, [0.2, 0.0], [0.1, 0.1], [0.1])
    with pytest.raises(ns.OptionError, match="two lists of spins"):
        bounce.slip_map(TURF, [0.2, 0.0], (0.5, [0.1]))
