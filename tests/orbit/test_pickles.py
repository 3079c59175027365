"""Every result about orbits survives pickling and deep copies, and still computes."""

import copy
import pickle

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, v, mu, a, b = (ca.SX.sym(s) for s in ("x", "y", "v", "mu", "a", "b"))
SPRINGS = ns.FilippovSystem(
    [x, v], surface=x, above=[v, -x + mu * (1 - x**2) * v], below=[v, -4 * x], parameters={mu: 0.5}
)
SADDLE = ns.FilippovSystem([x, y], surface=y, above=[x + y, -1], below=[x, 1])
TURN = ns.FilippovSystem(
    [x, y], surface=y, above=[a + b * x - x**3, 1 - y], below=[1, 1], parameters={a: 0.0, b: 0.5}
)


def run():
    return ns.simulate(SPRINGS, [0.5, 1.0], 40.0)


def branch():
    return ns.continue_equilibrium(TURN, [-1.5, 1.0], "a", bounds=(-2, 2))


def curve():
    fold = branch().events[0]
    return ns.continue_bifurcation(fold, ("a", "b"), bounds=[(-1, 1), (0.1, 1)])


RESULTS = {
    "Trajectory": (run, lambda r: r(3.0)),
    "Sensitivity": (lambda: ns.sensitivity(run()), lambda r: r.dx_dx0 * r.clearance),
    "Gradient": (lambda: ns.gradient(run(), x * v), lambda r: r.x0),
    "PeriodicOrbit": (lambda: ns.periodic_orbit(SPRINGS, run()), lambda r: r.multipliers),
    "Branch": (branch, lambda r: [e.parameter for e in r.events]),
    "BifurcationCurve": (curve, lambda r: r.values),
    "FixedItinerary": (
        lambda: ns.orbit.FixedItinerary(SPRINGS, "+ -", until="h0"),
        lambda r: r.arrive([0.5, 1.0]).x,
    ),
    "PoincareOrbit": (
        lambda: ns.orbit.poincare(SPRINGS, "h0", [0.5, 1.0], count=4),
        lambda r: r.jacobian(2),
    ),
    "LyapunovSpectrum": (
        lambda: ns.lyapunov_spectrum(SPRINGS, [0.5, 1.0], t_end=20.0),
        lambda r: r.exponents,
    ),
    "Basins": (
        lambda: ns.basins(SPRINGS, {"x": [0.5, 1.0], "v": 0.0}, t_end=40.0),
        lambda r: r.labels,
    ),
    "Manifold": (
        lambda: ns.manifold(SADDLE, ns.find_pseudo_equilibrium(SADDLE, [0.1, 0.0]), length=1.0),
        lambda r: r.arcs[0].points,
    ),
}


@pytest.mark.parametrize("kind", RESULTS)
def test_a_copy_has_the_same_results(kind):
    make, question = RESULTS[kind]
    result = make()
    assert type(result).__name__ == kind
    for again in (pickle.loads(pickle.dumps(result)), copy.deepcopy(result)):
        assert np.array_equal(question(again), question(result))
        assert repr(again) == repr(result) or kind == "FixedItinerary"


def test_an_orbit_of_a_forced_system_takes_its_period_along():
    """The period is an expression in the parameters of a system that is another object afterwards."""
    t, w = ca.SX.sym("t"), ca.SX.sym("w")
    drive = 2.5 * ca.cos(w * t)
    relay = ns.FilippovSystem(
        [x], surface=x, above=[drive - 1], below=[drive + 1], time=t, parameters={w: 1.0}
    )
    for period in (None, 2 * np.pi / w):
        orbit = ns.periodic_orbit(relay, [0.5], period=period)
        for again in (pickle.loads(pickle.dumps(orbit)), copy.deepcopy(orbit)):
            assert np.array_equal(again.multipliers, orbit.multipliers)
            faster = ns.periodic_orbit(again.system, again, parameters={"w": 1.2})
            assert faster.period == pytest.approx(2 * np.pi / 1.2)
        branch = ns.continue_orbit(orbit, "w", bounds=(0.8, 1.2))
        assert len(pickle.loads(pickle.dumps(branch))) == len(branch)
