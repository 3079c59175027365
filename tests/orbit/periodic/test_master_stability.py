"""Master stability against matrix exponentials, the multipliers of pairs, and runs of pairs."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
import scipy.linalg as sl

import nonsmooth as ns
from nonsmooth.orbit import master_stability
from tests.orbit.periodic_cases import relay_oscillator, values_of, weakening_friction

VALUES = values_of("cases/orbits_2.json")


def relay_map(orbit, kappa, slope):
    """Product of matrix exponentials and saltation matrices of the relay oscillator, d = .1."""
    matrix = np.array([[0.0, 1.0], [-1.0, -0.2]]) - kappa * np.asarray(slope)
    product = np.eye(2)
    for leg, after in zip(orbit.legs, (*orbit.legs[1:], orbit.legs[0]), strict=True):
        x = after.start[0]
        jump = [[0.0, 0.0], [0.0, 0.0]]
        side = 1.0 if leg.mode == "+" else -1.0
        jump[1][1] = (-x - side) / (-x + side) - 1.0  # v' after over before
        product = (np.eye(2) + jump) @ sl.expm(matrix * leg.duration) @ product
    return product


@pytest.mark.parametrize("symmetry", [None, -np.eye(2)])
def test_relay_oscillators(symmetry):
    given = {} if symmetry is None else {"symmetry": symmetry}
    system = relay_oscillator()
    orbit = ns.periodic_orbit(system, [-6.4, 0.01], **given)
    x, v = ca.vertsplit(system.extended_states)
    kappa = np.array([0.0, 0.2, 0.1j, 5.0, -0.05])
    for coupling, slope in (([0, v], [[0, 0], [0, 1]]), ([x - v, 2 * x], [[1, -1], [2, 0]])):
        found = master_stability(orbit, coupling, kappa)
        for value, own in zip(kappa, found.multipliers, strict=True):
            true = np.poly(relay_map(orbit, value, slope))
            assert np.abs(np.poly(own) - true).max() < 1e-12
    found = master_stability(orbit, [0, v], kappa)
    assert not found.stable[0] and abs(found.exponents[0]) < 1e-12
    assert abs(found.multipliers[0, 1] - float(VALUES["PR2"]["multipliers"][1])) < 1e-12


def pair_of(system, rows, strength):
    """Two systems of one surface that pull each other."""
    n = system.dimension
    one, two = (ca.vertcat(*[ca.SX.sym(f"{s}{k}") for s in system.state_names]) for k in "ab")
    la, lb = ca.SX.sym("la"), ca.SX.sym("lb")
    x = system.extended_states
    defaults = {
        p: system.definition.defaults[str(p)]
        for p in ca.vertsplit(system.parameter_symbols)
        if system.parameter_names
    }
    field, output = system.field_with(system.definition.multipliers), ca.vertcat(*rows)
    lam, h = system.definition.multipliers, system.surface_function(0)
    own = lambda y, u: ca.substitute(field, ca.vertcat(x, lam), ca.vertcat(y, u))
    out = lambda y: ca.substitute(output, x, y)
    pull = strength * (out(two) - out(one))
    states = [*ca.vertsplit(one), *ca.vertsplit(two)]
    fields = [*ca.vertsplit(own(one, la) + pull), *ca.vertsplit(own(two, lb) - pull)]
    surfaces = [ca.substitute(h, x, one), ca.substitute(h, x, two)]
    assert len(states) == 2 * n
    return ns.FilippovSystem(
        states, field=fields, surfaces=surfaces, multipliers=[la, lb], parameters=defaults
    )


@pytest.mark.parametrize(
    ("build", "start", "strength"),
    [
        (relay_oscillator, [-6.4, 0.01], -0.1),
        (relay_oscillator, [-6.4, 0.01], 0.3),
        (weakening_friction, [1.0, 0.0], 0.05),
        (weakening_friction, [1.0, 0.0], -0.05),
    ],
)
def test_runs_of_pairs_part_or_meet_as_the_exponent_says(build, start, strength):
    system = build()
    orbit = ns.periodic_orbit(system, start)
    rows = [0, ca.vertsplit(system.extended_states)[0]]
    found = master_stability(orbit, rows, 2 * strength)
    pair = pair_of(system, rows, strength)
    slip = next(leg for leg in orbit.legs if leg.mode != "s")
    x, size = orbit.trajectory(slip.t + 0.5 * slip.duration), 1e-7
    ends = []
    for kick in size * np.eye(2):
        run = ns.simulate(pair, np.concatenate([x + kick, x - kick]), orbit.period, tol=1e-14)
        ends.append((run.x[-1, :2] - run.x[-1, 2:]) / (2 * size))
    factors = np.poly(np.array(ends).T)
    assert np.abs(factors - np.poly(found.multipliers[0])).max() < 1e-6


def test_a_coupling_that_jumps_is_refused():
    v, current = ca.SX.sym("v"), 1.2
    fire = ns.Reset(v - 1, [0.0], direction=1)
    orbit = ns.periodic_orbit(ns.FilippovSystem([v], field=[current - v], resets=fire), [0.3])
    with pytest.raises(ns.DegenerateError, match="does not jump"):
        master_stability(orbit, [v], 0.2)
    wave = ca.sin(2 * ca.pi * v)  # is the same before and after the spike
    found = master_stability(orbit, [wave], [0.0, 0.1])
    assert abs(found.multipliers[0, 0] - 1.0) < 1e-12


def test_spikes_of_a_coupled_variable_make_synchrony_unstable():
    """MS2: a pair that is pulled while one has fired parts by a factor that the single oscillator does not have."""
    v, w, strength = *(ca.SX.sym(s) for s in "vw"), 0.1
    field = [1.2 - v + strength * (w - v), 1.2 - w + strength * (v - w)]
    fire = [ns.Reset(v - 1, [0 * v, w], 1), ns.Reset(w - 1, [v, 0 * w], 1)]
    pair = ns.FilippovSystem([v, w], field=field, resets=fire)
    with pytest.raises(ns.DegenerateError, match="at the same instant"):
        ns.periodic_orbit(pair, [0.0, 0.0])
    period, growth = (float(VALUES["MS2"][k]) for k in ("period", "transversal multiplier"))
    times = 0.5 + period * np.arange(4)
    apart = np.diff(ns.simulate(pair, [0.0, 1e-8], 8.0, t_eval=times, tol=1e-13).sample_x)[:, 0]
    assert apart / apart[0] == pytest.approx(growth ** np.arange(4), rel=1e-5)


def test_refusals():
    system = relay_oscillator()
    x, v = ca.vertsplit(system.extended_states)
    orbit = ns.periodic_orbit(system, [-6.4, 0.01])
    for coupling in ([v], v, 3, [0, v, v]):
        with pytest.raises(ns.OptionError, match="coupling: expected 2 expressions"):
            master_stability(orbit, coupling, 0.1)
    for kappa in ([], [np.nan], [[0.1]]):
        with pytest.raises(ns.OptionError, match="kappa"):
            master_stability(orbit, [0, v], kappa)
    with pytest.raises(ns.OptionError, match="PeriodicOrbit"):
        master_stability(system, [0, v], 0.1)
    with pytest.raises(ns.NonsmoothError):
        master_stability(orbit, [0, ca.SX.sym("other")], 0.1)
    with pytest.raises(ns.NonsmoothError):
        master_stability(orbit, [0, ca.fabs(x)], 0.1)
