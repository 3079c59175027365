"""Limit directions of sets of codimension two and three: against a scan of all directions, the astroid, and orbits
that are followed; regions."""

import pickle

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns


def frozen(a, m):
    """h' = a - M lambda with the states h."""
    k = len(a)
    h, lam = (ca.vertcat(*[ca.SX.sym(f"{name}{i}") for i in range(k)]) for name in "hl")
    rates = ca.DM(a) - ca.mtimes(ca.DM(m), lam)
    return ns.FilippovSystem(
        ca.vertsplit(h), field=ca.vertsplit(rates), surfaces=[h], multipliers=[lam]
    )


def definite(rng, k):
    """A random symmetric and positive definite matrix."""
    q, _ = np.linalg.qr(rng.normal(size=(k, k)))
    return q @ np.diag(rng.uniform(0.2, 2.0, k)) @ q.T


def scanned(a, m, count=20_000):
    """Limit directions in the plane: zeros of u_perp . (a - M u) by bracketing."""
    phi = np.linspace(0, 2 * np.pi, count + 1) + 1e-4
    u = np.array([np.cos(phi), np.sin(phi)])
    g = np.array(a)[:, None] - m @ u
    turning = -u[1] * g[0] + u[0] * g[1]
    at = np.flatnonzero(turning[:-1] * turning[1:] < 0)
    rates = (u * g).sum(axis=0)[at]
    return sorted(zip(rates.tolist(), (turning[at] > 0).tolist(), strict=True), reverse=True)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("symmetric", [True, False])
def test_directions_are_those_of_a_scan(seed, symmetric):
    rng = np.random.default_rng(seed)
    a, m = rng.normal(size=2), definite(rng, 2)
    if not symmetric:
        m = m + 0.3 * rng.normal() * np.array([[0.0, 1.0], [-1.0, 0.0]])
    found = ns.local.limit_directions(frozen(a, m), [0.0, 0.0])
    expected = scanned(a, m)
    assert [d.attracting for d in found] == [attracting for _, attracting in expected]
    assert [d.rate for d in found] == pytest.approx([rate for rate, _ in expected], abs=2e-3)
    for d in found:
        assert (m + d.rate * np.eye(2)) @ d.direction == pytest.approx(a, abs=1e-10)
        assert np.linalg.norm(d.direction) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_an_astroid_bounds_the_loads_with_four_directions(seed):
    rng = np.random.default_rng(seed)
    a, m = rng.uniform(-1, 1, 2), np.array([2.0, 0.6])
    inside = (np.abs(a) ** (2 / 3)).sum() < abs(m[0] - m[1]) ** (2 / 3)
    assert len(ns.local.limit_directions(frozen(a, np.diag(m)), [0.0, 0.0])) == (4 if inside else 2)


@pytest.mark.parametrize(
    ("a", "count"), [((0.9, 0.0), 4), ((0.0, 0.9), 4), ((1.6, 0.0), 2), ((0.0, 0.0), 4)]
)
def test_a_load_along_a_principal_axis(a, count):
    m = np.diag([2.0, 0.6])
    found = ns.local.limit_directions(frozen(a, m), [0.0, 0.0])
    assert len(found) == count
    for d in found:
        assert (m + d.rate * np.eye(2)) @ d.direction == pytest.approx(a, abs=1e-12)


@pytest.mark.parametrize("k", [2, 3])
@pytest.mark.parametrize("seed", range(10))
def test_one_direction_leads_away_where_friction_does_not_hold(k, seed):
    rng = np.random.default_rng(seed)
    a, m = rng.normal(size=k), definite(rng, k)
    system, origin = frozen(a, m), np.zeros(k)
    found = ns.local.limit_directions(system, origin)
    holds = np.linalg.norm(np.linalg.solve(m, a)) < 1
    assert sum(d.leaves for d in found) == (0 if holds else 1)
    assert ns.region(system, origin) is (ns.Region.SLIDING if holds else ns.Region.CROSSING)
    # Orbits from the set and from nearby go along the attracting directions.
    if holds:
        assert ns.simulate(system, origin, 1.0).itinerary == "s"
    else:
        assert found[0].leaves and found[0].attracting
        end = ns.simulate(system, origin, 1.0).x[-1]
        assert end == pytest.approx(found[0].rate * found[0].direction, abs=1e-9)


def test_regions_of_a_block_on_an_incline():
    v, lam = (ca.vertcat(ca.SX.sym(n + "1"), ca.SX.sym(n + "2")) for n in ("v", "l"))
    mu, slope = ca.SX.sym("mu"), ca.SX.sym("slope")
    block = ns.FilippovSystem(
        ca.vertsplit(v),
        field=[slope - mu * lam[0], -mu * lam[1]],
        surfaces=[v],
        multipliers=[lam],
        parameters={mu: 0.5, slope: 0.3},
    )
    regions = [ns.region(block, [0, 0], parameters={"slope": s}) for s in (0.3, 0.5, 0.7)]
    assert [str(r) for r in regions] == ["sliding", "boundary of sliding", "crossing"]
    assert [r.sliding for r in regions] == [True, False, False]
    assert ns.region(block, [0, 0], parameters={"mu": -0.5}) is ns.Region.MIXED
    assert ns.region(block, [0, 0], parameters={"mu": 0.0}) is ns.Region.CROSSING
    found = ns.local.limit_directions(block, [0, 0], parameters={"mu": 0.0})
    assert [d.rate for d in found] == pytest.approx([0.3, -0.3])
    assert repr(pickle.loads(pickle.dumps(found))) == repr(found)


@pytest.mark.parametrize(
    ("a", "m", "expected"),
    [
        ((0.3, 0.0), [[1.0, 0.0], [0.0, 0.0]], "MIXED"),
        ((0.1, 0.1), [[1.0, 1.0], [1.0, 1.0]], "MIXED"),
        ((0.0, 0.0, 0.0), np.diag([1.0, 1.0, 0.0]), "MIXED"),
        ((0.3, 0.0), [[0.0, -1.0], [1.0, 0.0]], "MIXED"),
        ((0.3, 0.1), [[1.0, 0.0], [0.0, 0.0]], "CROSSING"),
        ((1.3, 0.0), [[1.0, 0.0], [0.0, 0.0]], "CROSSING"),
        ((1.0, 0.0), [[1.0, 0.0], [0.0, 0.0]], "BOUNDARY"),
    ],
)
def test_friction_that_misses_a_direction_attracts_from_none_along_it(a, m, expected):
    """It holds only loads that it acts against: their multiplier is not unique, or nothing leads back."""
    system = frozen(a, np.array(m))
    assert ns.region(system, np.zeros(len(a))) is ns.Region[expected]


def test_beside_a_surface_the_side_is_known_or_required():
    v, lam = (ca.vertcat(ca.SX.sym(n + "1"), ca.SX.sym(n + "2")) for n in ("v", "l"))
    z, switch = ca.SX.sym("z"), ca.SX.sym("switch")
    system = ns.FilippovSystem(
        [*ca.vertsplit(v), z],
        field=[0.5 + 0.4 * switch - 0.7 * lam[0], -0.7 * lam[1], 1],
        surfaces=[z, v],
        multipliers=[switch, lam],
    )
    assert ns.region(system, [0, 0, 1.0], surface=1) is ns.Region.CROSSING
    assert ns.region(system, [0, 0, -1.0], surface=1) is ns.Region.SLIDING
    assert ns.region(system, [0, 0, 0.0], surface=1, mode="-s") is ns.Region.SLIDING
    with pytest.raises(ns.PointError, match=r"point.*h0.*mode="):
        ns.region(system, [0, 0, 0.0], surface=1)
    with pytest.raises(ns.DefinitionError, match="surface"):
        ns.local.limit_directions(system, [0, 0, 1.0], surface=0)


def test_points_off_the_set_and_other_systems_are_refused():
    system = frozen([0.3, 0.0], 0.5 * np.eye(2))
    with pytest.raises(ns.PointError, match=r"point.*h = \[0.1, 0.0\]"):
        ns.local.limit_directions(system, [0.1, 0.0])
    with pytest.raises(ns.PointError):
        ns.region(system, [np.nan, 0.0])
    x = ca.SX.sym("x")
    with pytest.raises(ns.DefinitionError, match="vector multiplier"):
        ns.local.limit_directions(ns.FilippovSystem([x], surface=x, above=[-1], below=[1]), [0.0])
