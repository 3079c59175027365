"""The condensed return map has the eigenvalues of the whole one, less what is lost on the way."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.compiled import find_compiler
from nonsmooth.flow.compiled.shooting import reduced_map
from nonsmooth.orbit.periodic import multipliers
from nonsmooth.orbit.periodic.multipliers import multipliers_of

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


def random_legs(seed, count, n, s):
    rng = np.random.default_rng(seed)
    sizes = [(count, s, n), (count, s), (count, s), (count, n, s)]
    legs = tuple(rng.normal(size=size) for size in sizes)
    legs[1][:] = np.einsum(
        "ikn,in->ik", legs[0], rng.normal(size=(count, n))
    )  # what the flow carries
    return legs, rng


def whole_map(legs, wrap):
    by_start, rate, gradient, after = legs
    product = np.eye(by_start.shape[2])
    for x, f, e, g in zip(by_start, rate, gradient, after, strict=True):
        product = g @ (x - np.outer(f, e @ x) / (e @ f)) @ product
    return product if wrap is None else wrap @ product


@pytest.mark.parametrize(("count", "n", "s"), [(1, 4, 4), (3, 3, 3), (2, 3, 5), (7, 5, 5)])
@pytest.mark.parametrize("mirrored", [False, True])
def test_nontrivial_multipliers_are_those_of_the_whole_map(count, n, s, mirrored):
    legs, rng = random_legs(count, count, n, s)
    wrap, units = (rng.normal(size=(n, n)) if mirrored else None), rng.uniform(1e-3, 1e3, n)
    reduced = reduced_map(legs, wrap, units, np.eye(n), 1e-8, 1e-12)
    assert reduced.shape == (n - 1, n - 1)
    values, found = np.linalg.eigvals(whole_map(legs, wrap)), np.linalg.eigvals(reduced)
    size = np.abs(values).max()
    nontrivial = values[np.argsort(-np.abs(values))][:-1]
    apart = np.abs(found[:, None] - nontrivial)
    assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-12 * size


def test_what_a_leg_loses_is_no_direction_of_the_reduced_map():
    legs, _ = random_legs(5, 4, 4, 4)
    legs[3][2] = legs[3][2] @ np.diag([1.0, 1.0, 0.0, 0.0])  # of rank two
    reduced = reduced_map(legs, None, np.ones(4), np.eye(4), 1e-8, 1e-12)
    assert len(reduced) <= 2
    values = np.sort(np.abs(np.linalg.eigvals(whole_map(legs, None))))[-len(reduced) :]
    np.testing.assert_allclose(np.sort(np.abs(np.linalg.eigvals(reduced))), values, rtol=1e-10)


def test_a_grazed_event_has_no_reduced_map():
    legs, _ = random_legs(1, 2, 3, 3)
    legs[2][1] -= legs[1][1] * (legs[2][1] @ legs[1][1]) / (legs[1][1] @ legs[1][1])
    assert reduced_map(legs, None, np.ones(3), np.eye(3), 1e-8, 1e-12) is None


def test_multipliers_are_the_same_in_c_and_in_python(monkeypatch):
    system = ns.textbook.multi_sliding_relay().system
    orbit = ns.periodic_orbit(system, [0.0, 1.0, 2.57], itinerary=["+", "s"] * 7, symmetry="odd")
    given = orbit.problem, orbit.evaluation, orbit.parameter_vector
    compiled = multipliers_of(*given)
    monkeypatch.setattr(multipliers, "has_interpreter", lambda: False)
    plain = multipliers_of(*given)
    assert compiled.zeros == plain.zeros
    np.testing.assert_allclose(compiled.of_map, plain.of_map, atol=1e-14)
    np.testing.assert_allclose(compiled.values, compiled.of_map**2, atol=1e-15)


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
