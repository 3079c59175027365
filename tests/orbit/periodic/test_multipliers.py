"""Multipliers are the eigenvalues of the map of the legs, with all their digits where the product has none."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.orbit.periodic import multipliers
from nonsmooth.orbit.periodic.cyclic_qr import Factor, Product
from tests.orbit.periodic_cases import values_of

CASES = values_of("cases/orbits_2.json")
DAMPING = ca.SX.sym("d")


def random_factors(seed, count, n):
    rng = np.random.default_rng(seed)
    return [rng.normal(size=(n, n)) for _ in range(count)]


def whole(matrices):
    product = np.eye(len(matrices[0]))
    for step in matrices:
        product = step @ product
    return product


@pytest.mark.parametrize(("count", "n"), [(1, 4), (3, 3), (2, 5), (7, 4), (4, 1)])
def test_eigenvalues_of_a_short_product_are_those_of_the_matrix(count, n):
    matrices = random_factors(count, count, n)
    found = np.exp(Product([Factor(m) for m in matrices]).logarithms)
    values = np.linalg.eigvals(whole(matrices))
    apart = np.abs(found[:, None] - values)
    assert found.size == n
    assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-13 * np.abs(values).max()


def test_what_a_factor_loses_is_no_direction_of_the_product():
    matrices = random_factors(5, 4, 4)
    matrices[2] = matrices[2] @ np.diag([1.0, 1.0, 0.0, 0.0])  # of rank two
    product = Product([Factor(m, np.eye(4)) for m in matrices])
    values = np.linalg.eigvals(whole(matrices))
    expected = np.sort(np.abs(values))[-2:]
    np.testing.assert_allclose(np.sort(np.exp(product.logarithms.real)), expected, rtol=1e-12)
    assert product.error < 1e-11


def test_a_long_product_keeps_the_eigenvalues_that_its_matrix_has_lost():
    """Triangular factors in other coordinates: the eigenvalues are products of the diagonals."""
    rng = np.random.default_rng(1)
    diagonals = rng.uniform(0.2, 0.9, (120, 3)) * [4.0, 1.0, 0.1] * rng.choice([-1, 1], (120, 3))
    turns = [np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(120)]
    upper = [np.diag(d) + np.triu(rng.normal(size=(3, 3)), 1) for d in diagonals]
    factors = [Factor(turns[(i + 1) % 120] @ m @ turns[i].T) for i, m in enumerate(upper)]
    product = Product(factors)
    found, expected = product.logarithms, np.log(np.abs(diagonals)).sum(axis=0)
    np.testing.assert_allclose(found.real, expected, atol=1e-11)
    np.testing.assert_allclose(np.cos(found.imag), np.sign(diagonals).prod(axis=0), atol=1e-12)
    assert expected[0] - expected[-1] > 300.0 and product.error < 1e-10


def passengers(mixed):
    """A relay oscillator with passengers that decay and grow, as in LM1; legs grow by 7e6."""
    x, v, z, w = (ca.SX.sym(s) for s in "xvzw")
    sides = [[v, s - x - 2 * DAMPING * v, x - 40 * z, 5 * w + v] for s in (1, -1)]
    if not mixed:
        return [x, v, z, w], v, sides, np.eye(4)
    k = np.array([[1, 2, 0, 1], [0, 1, 3, 0], [1, 2, 1, 2], [2, 5, 3, 3.0]])
    y = ca.SX.sym("y", 4)
    own, old = ca.DM(np.linalg.inv(k)) @ y, ca.vertcat(x, v, z, w)
    sides = [ca.vertsplit(ca.DM(k) @ ca.substitute(ca.vertcat(*f), old, own)) for f in sides]
    return ca.vertsplit(y), own[1], sides, k


@pytest.mark.parametrize("mixed", [False, True])
def test_multipliers_of_passengers_that_decay_and_grow(mixed):
    states, surface, (above, below), k = passengers(mixed)
    system = ns.FilippovSystem(
        states, surface=surface, above=above, below=below, parameters={DAMPING: 0.1}
    )
    start = k @ [float(text) for text in CASES["LM1"]["start"]]
    orbit = ns.periodic_orbit(system, start, itinerary=["+", "-"])
    assert orbit.problem.parts_of(1)[0] > 1 and orbit.residual < 1e-12
    expected = np.sort([float(text) for text in CASES["LM1"]["log_multipliers"]])[::-1]
    found = orbit.floquet.logarithms.real
    np.testing.assert_allclose(found, np.delete(expected, 1), atol=1e-9, rtol=1e-12)
    wrong = np.exp(np.minimum(found, 0.0)) * np.abs(found - np.delete(expected, 1))
    assert wrong.max() <= orbit.error_estimate < 1e-11
    assert orbit.stability.startswith("unstable, 1")
    assert orbit.multipliers[-1] == pytest.approx(float(CASES["LM1"]["multipliers"][2]), rel=1e-9)
    assert orbit.derivative("d").period == pytest.approx(2 * np.pi * 0.1 / 0.99**1.5, rel=1e-9)


@pytest.mark.slow
def test_a_branch_of_legs_that_are_divided_has_all_multipliers():
    states, surface, (above, below), _ = passengers(False)
    system = ns.FilippovSystem(
        states, surface=surface, above=above, below=below, parameters={DAMPING: 0.1}
    )
    start = [float(text) for text in CASES["LM1"]["start"]]
    orbit = ns.periodic_orbit(system, start, itinerary=["+", "-"])
    branch = ns.continue_orbit(orbit, "d", bounds=(0.05, 0.3))
    assert branch.ends == (ns.orbit.BranchEnd.REACHED_BOUND,) * 2 and not branch.events
    for one in branch.orbits[:: len(branch) // 6]:
        d = one.parameters["d"]
        period = 2 * np.pi / np.sqrt(1 - d * d)
        expected = np.array([5.0, -d, -40.0]) * period
        np.testing.assert_allclose(one.floquet.logarithms.real, expected, atol=1e-8)
        assert one.period == pytest.approx(period, rel=1e-12)
    assert branch[0.2].period == pytest.approx(2 * np.pi / np.sqrt(0.96), rel=1e-12)


def test_multipliers_of_a_half_are_roots_of_those_of_the_whole():
    system = ns.textbook.multi_sliding_relay().system
    orbit = ns.periodic_orbit(system, [0.0, 1.0, 2.57], itinerary=["+", "s"] * 7, symmetry="odd")
    np.testing.assert_allclose(orbit.multipliers[1:], orbit.half_multipliers**2, atol=1e-15)


@pytest.mark.parametrize("second", [1e-12, 1e-11, 1e-3, 1e6, 1e12])
def test_multipliers_do_not_depend_on_the_unit_of_time(second):
    """All legs of a scalar relay begin at zero: what it moves by is the size of its state."""
    x, t = ca.SX.sym("x"), ca.SX.sym("t")
    drive = 2.5 * ca.cos(t / second)
    relay = ns.FilippovSystem(
        [x], surface=x, time=t, above=[(drive - 1) / second], below=[(drive + 1) / second]
    )
    orbit = ns.periodic_orbit(relay, [0.5])
    c = 2.5 * np.sqrt(1 - (np.pi / 5) ** 2)
    assert abs(orbit.multipliers[0] - ((c - 1) / (c + 1)) ** 2) < 1e-12
    assert orbit.stability == "asymptotically stable"


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("start, drive", [([0.0], None), ([0.0, 0.1], 0.0), ([0.0, 0.1], 1.0)])
def test_multipliers_and_their_error_do_not_depend_on_the_unit_of_a_state_that_is_zero(
    start, drive, unit
):
    """x slides on 0 all the time; y follows it and a drive, or is zero as well."""
    x, y, t = (ca.SX.sym(s) for s in "xyt")
    rest = [] if drive is None else [-0.3 * y + x + unit * drive * ca.cos(t)]
    above, below = ([unit * (ca.cos(t) - 2 * s), *rest] for s in (1, -1))
    states = [x, y][: len(start)]
    system = ns.FilippovSystem(states, surface=x, above=above, below=below, time=t)
    orbit = ns.periodic_orbit(system, unit * np.array(start), itinerary=["s"])
    expected = [np.exp(-0.6 * np.pi)] * len(rest) + [0.0]
    wrong = np.abs(orbit.multipliers - expected).max()
    assert wrong <= orbit.error_estimate < 3e-14 and orbit.floquet.zeros == 1


@pytest.mark.parametrize("slides", [False, True])
@pytest.mark.parametrize("units", [(1e3, 1e-3, 1.0), (1e6, 1e-6, 1.0), (1e-9, 1.0, 1e4)])
def test_multipliers_do_not_depend_on_the_units_of_states(units, slides):
    """A forced relay, which may slide on 0 all the time, and two states that follow it."""
    x, y, z, t = (ca.SX.sym(s) for s in "xyzt")
    own = [x / units[0], y / units[1], z / units[2]]
    drive = (1.0 if slides else 2.5) * ca.cos(t)
    rest = [-0.3 * own[1] + own[0] + ca.cos(t), -0.1 * own[2] + own[1]]
    sides = [
        [u * f for u, f in zip(units, [drive - s * (1 + slides), *rest], strict=True)]
        for s in (1, -1)
    ]
    system = ns.FilippovSystem([x, y, z], surface=x, above=sides[0], below=sides[1], time=t)
    if slides:
        orbit = ns.periodic_orbit(system, [0.0, 0.1 * units[1], units[2]], itinerary=["s"])
    else:
        run = ns.simulate(system, 0.5 * np.array(units), 200.0, rtol=1e-10, atol=1e-10 * min(units))
        orbit = ns.periodic_orbit(system, run)
    c = 2.5 * np.sqrt(1 - (np.pi / 5) ** 2)
    relay = 0.0 if slides else ((c - 1) / (c + 1)) ** 2
    expected = [np.exp(-0.2 * np.pi), np.exp(-0.6 * np.pi), relay]
    wrong = np.abs(orbit.multipliers - sorted(expected, reverse=True)).max()
    assert wrong <= orbit.error_estimate < 1e-12 and orbit.stability == "asymptotically stable"


def test_an_orbit_that_is_zero_has_the_period_of_its_forcing():
    """What rounding leaves of the states does not repeat; the guess comes back best after several periods."""
    x, y, z, t = (ca.SX.sym(s) for s in "xyzt")
    sides = [[ca.cos(t) - 2 * s, x - 0.05 * y + 1.29 * z, -1.29 * y - 0.05 * z] for s in (1, -1)]
    system = ns.FilippovSystem([x, y, z], surface=x, above=sides[0], below=sides[1], time=t)
    orbit = ns.periodic_orbit(system, [0.0, 0.1, 0.1], itinerary=["s"])
    assert orbit.period == pytest.approx(2 * np.pi, rel=1e-15)
    np.testing.assert_allclose(np.abs(orbit.multipliers[:2]), np.exp(-0.1 * np.pi), rtol=1e-13)


def test_an_orbit_without_finite_derivatives_of_an_event_says_so(monkeypatch):
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    clock = ns.FilippovSystem([x, v], surface=v, above=[v, 0.5 - x - v], below=[v, -0.5 - x - v])
    orbit = ns.periodic_orbit(clock, ns.simulate(clock, [1.0, 0.0], 60.0))
    known = multipliers.event_maps
    monkeypatch.setattr(multipliers, "event_maps", lambda *given: np.nan * known(*given))
    found = multipliers.Multipliers(orbit.problem, orbit.evaluation, orbit.parameter_vector)
    assert "beyond the range" in found.stability and np.isnan(found.values).all()
