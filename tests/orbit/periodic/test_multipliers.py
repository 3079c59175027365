"""The condensed return map has the eigenvalues of the whole one, less what is lost on the way."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.orbit.periodic.multipliers import reduced_map


def random_legs(seed, count, n, s):
    rng = np.random.default_rng(seed)
    sizes = [(count, s, n), (count, s), (count, s), (count, n, s)]
    legs = tuple(rng.normal(size=size) for size in sizes)
    legs[1][:] = np.einsum(
        "ikn,in->ik", legs[0], rng.normal(size=(count, n))
    )  # what the flow carries
    return legs, rng


def maps_of(legs, wrap):
    """Maps across the flow from the start of each leg to that of the next."""
    maps = [g @ (x - np.outer(f, e @ x) / (e @ f)) for x, f, e, g in zip(*legs, strict=True)]
    if wrap is not None:
        maps[-1] = wrap @ maps[-1]
    return np.array(maps)


def reduced_of(legs, wrap, units):
    n, by = legs[0].shape[2], units / units[:, None]
    return reduced_map(maps_of(legs, wrap) * by, legs[0][:, :n] * by, np.eye(n))


def whole_map(legs, wrap):
    product = np.eye(legs[0].shape[2])
    for step in maps_of(legs, wrap):
        product = step @ product
    return product


@pytest.mark.parametrize(("count", "n", "s"), [(1, 4, 4), (3, 3, 3), (2, 3, 5), (7, 5, 5)])
@pytest.mark.parametrize("mirrored", [False, True])
def test_nontrivial_multipliers_are_those_of_the_whole_map(count, n, s, mirrored):
    legs, rng = random_legs(count, count, n, s)
    wrap, units = (rng.normal(size=(n, n)) if mirrored else None), rng.uniform(1e-3, 1e3, n)
    reduced = reduced_of(legs, wrap, units)
    assert reduced.shape == (n - 1, n - 1)
    values, found = np.linalg.eigvals(whole_map(legs, wrap)), np.linalg.eigvals(reduced)
    size = np.abs(values).max()
    nontrivial = values[np.argsort(-np.abs(values))][:-1]
    apart = np.abs(found[:, None] - nontrivial)
    assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-12 * size


def test_what_a_leg_loses_is_no_direction_of_the_reduced_map():
    legs, _ = random_legs(5, 4, 4, 4)
    legs[3][2] = legs[3][2] @ np.diag([1.0, 1.0, 0.0, 0.0])  # of rank two
    reduced = reduced_of(legs, None, np.ones(4))
    assert len(reduced) <= 2
    values = np.sort(np.abs(np.linalg.eigvals(whole_map(legs, None))))[-len(reduced) :]
    np.testing.assert_allclose(np.sort(np.abs(np.linalg.eigvals(reduced))), values, rtol=1e-10)


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
