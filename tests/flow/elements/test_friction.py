"""Friction by name: times of stick and slip beside closed forms and an integrator that knows no switches."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import nonsmooth as ns

x, v, t, y, w = (ca.SX.sym(s) for s in ("x", "v", "t", "y", "w"))


def pulled(friction, **options):
    """A block on a spring whose end moves with speed 1."""
    return ns.FilippovSystem(
        [x, v], field=[v, t - x + friction.force], surfaces=[friction], time=t, **options
    )


def times(run, kind):
    return [event.t for event in run.events if event.kind == kind]


@pytest.mark.parametrize("many", [False, True])
def test_coulomb_friction_is_the_multiplier_times_the_load(many):
    named = pulled(ns.Friction(v, load=10.0, kinetic=0.3))
    lam = ca.SX.sym("lam")
    plain = ns.FilippovSystem(
        [x, v], field=[v, t - x - 3 * lam], surfaces=[v], multipliers=[lam], time=t
    )
    if many:
        runs = [ns.ensemble(s, np.zeros((3, 2)), 30.0) for s in (named, plain)]
        assert runs[0].itinerary[0] == runs[1].itinerary[0]
        np.testing.assert_allclose(runs[0].x, runs[1].x, atol=1e-9)
    else:
        runs = [ns.simulate(s, [0.0, 0.0], 30.0) for s in (named, plain)]
        assert runs[0].itinerary == runs[1].itinerary
        np.testing.assert_allclose(runs[0].x[-1], runs[1].x[-1], atol=1e-12)


@pytest.mark.parametrize(("kinetic", "static"), [(0.3, 0.4), (0.3, 0.31), (0.1, 0.9), (0.2, 1.0)])
def test_stick_slip_of_friction_that_drops(kinetic, static):
    """Slip for the time s with (static - kinetic) load (cos s - 1) = sin s, from a stretch static load."""
    load = 10.0
    run = ns.simulate(
        pulled(ns.Friction(v, load=load, kinetic=kinetic, static=static)),
        [0.0, 0.0],
        40.0,
        tol=1e-12,
    )
    assert run.itinerary.startswith("s + s +") and run.status is ns.Status.REACHED_END
    size = load * (static - kinetic)
    slip = 2 * np.pi - 2 * np.arctan(size)  # where the speed 1 + size sin s - cos s is zero again
    stick = 2 * size
    first = static * load
    assert times(run, "exit")[:2] == pytest.approx([first, first + slip + stick], abs=1e-8)
    assert times(run, "entry")[0] == pytest.approx(first + slip, abs=1e-8)


def test_a_stribeck_curve_beside_scipy():
    friction = ns.Friction(v, load=10.0, kinetic=0.3, static=0.4, stribeck=0.1, viscous=0.2)
    run = ns.simulate(pulled(friction), [0.0, 0.0], 20.0, tol=1e-12)
    first = times(run, "exit")[0]
    assert first == pytest.approx(4.0, abs=1e-10)

    def slipping(s, u):
        dry = 10 * (0.3 + 0.1 * np.exp(-((u[1] / 0.1) ** 2)))
        return [u[1], s - u[0] - dry - 0.2 * u[1]]

    at = first + 0.5
    beside = solve_ivp(slipping, (at, at + 3), run(at), rtol=1e-12, atol=1e-13, method="DOP853")
    np.testing.assert_allclose(run(at + 3), beside.y[:, -1], atol=1e-9)


def test_coefficients_may_be_parameters_and_a_load_a_function():
    mu, rest = ca.SX.sym("mu"), ca.SX.sym("rest")
    friction = ns.Friction(v, load=10 + ca.sin(t), kinetic=mu, static=rest)
    system = pulled(friction, parameters={mu: 0.3, rest: 0.4})
    run = ns.simulate(system, [0.0, 0.0], 6.0, parameters={"rest": 0.5}, tol=1e-12)
    release = times(run, "exit")[0]
    assert release == pytest.approx(0.5 * (10 + np.sin(release)), abs=1e-8)


def test_several_frictions_beside_a_surface_with_its_own_multiplier():
    lam = ca.SX.sym("lam")
    first, second = (ns.Friction(s, load=1.0, kinetic=k) for s, k in ((v, 0.3), (w, 0.5)))
    system = ns.FilippovSystem(
        [x, v, y, w],
        field=[v, 1 - x + first.force, w, -y + second.force - 0.1 * lam],
        surfaces=[first, y, second],
        multipliers=[lam],
    )
    run = ns.simulate(system, [0.0, 0.0, 1.0, 0.0], 10.0)
    assert run.status is ns.Status.REACHED_END
    with pytest.raises(ns.DefinitionError, match="expected 1, for what brings none"):
        ns.FilippovSystem([x, v], field=[v, first.force - lam], surfaces=[first, x], multipliers=[])


def test_a_system_with_friction_is_saved_and_read(tmp_path):
    run = ns.simulate(pulled(ns.Friction(v, load=10, kinetic=0.3, static=0.4)), [0, 0], 20.0)
    run.save(tmp_path / "run.npz")
    again = ns.load(tmp_path / "run.npz")
    assert again.itinerary == run.itinerary and again.system == run.system


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"kinetic": -0.1}, "kinetic of the friction"),
        ({"load": float("nan")}, "load of the friction"),
        ({"static": 0.2}, "more than kinetic"),
        ({"stribeck": 0.1}, "expected static="),
        ({"static": 0.5, "stribeck": 0.0}, "above zero"),
        ({"slip": [v, w], "static": 0.5}, "one direction only"),
        ({"slip": [v, w, x, y]}, "one to 3 velocities"),
        ({"slip": "v"}, "slip"),
    ],
)
def test_what_is_no_friction_is_refused(options, words):
    with pytest.raises(ns.DefinitionError, match=words):
        ns.Friction(**{"slip": v, "load": 1.0, "kinetic": 0.3, **options})


@pytest.mark.parametrize(
    ("force", "words"),
    [
        (ns.Friction(v, load=1.0, kinetic=0.3).force, "give that in surfaces="),
        (ns.Clock(2.0).phase, "give that in clocks="),
    ],
)
def test_an_element_that_is_not_given_to_the_system_is_named(force, words):
    with pytest.raises(ns.DefinitionError, match=words):
        ns.FilippovSystem([x, v], field=[v, force])
