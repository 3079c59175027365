"""Starts by number are those that an array of them would have, whoever makes them and however many at a time."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.ensembles.starts import Starts

x, v, mu = (ca.SX.sym(s) for s in ("x", "v", "mu"))
BLOCK = ns.FilippovSystem(
    [x, v], surface=v, above=[v, -x - mu], below=[v, -x + mu], parameters={mu: 1.0}
)


def split_mix(seed, count):
    """The generator as its authors write it, one number after the other."""
    mask, state, out = 2**64 - 1, seed, []
    for _ in range(count):
        state = (state + 0x9E3779B97F4A7C15) & mask
        z = state
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
        out.append(z ^ (z >> 31))
    return out


@pytest.mark.parametrize("seed", [0, 1234567, 2**64 - 1])
def test_random_starts_are_those_of_the_published_generator(seed):
    starts = ns.RandomStarts(50, low=[-1.0, 2.0, 5.0], high=[1.0, 4.0, 5.0], seed=seed)
    part = np.array([n >> 11 for n in split_mix(seed, 150)]).reshape(50, 3) / 2**53
    assert np.array_equal(starts.at(np.arange(50)), [-1.0, 2.0, 5.0] + np.array([2, 2, 0]) * part)


def test_its_first_outputs_are_the_published_ones():
    """The test vector that goes round with implementations, seed 1234567."""
    assert split_mix(1234567, 3) == [6457827717110365317, 3203168211198807973, 9817491932198370423]


def test_random_starts_fill_the_box_evenly():
    starts = ns.RandomStarts(10**12, low=[0.0, 0.0], high=[1.0, 1.0], seed=3)
    found = starts.at(np.arange(10**12 - 40000, 10**12))
    counts, _, _ = np.histogram2d(*found.T, bins=20, range=[[0, 1], [0, 1]])
    assert np.sum((counts - 100) ** 2 / 100) < 400 + 5 * np.sqrt(800)
    assert abs(np.corrcoef(found[:-1, 0], found[1:, 1])[0, 1]) < 0.025


def test_a_grid_is_the_product_of_its_axes():
    a, b = np.linspace(-2, 2, 5), np.linspace(-1, 1, 4)
    whole = np.stack(np.meshgrid(a, b, indexing="ij"), axis=-1)
    one, other = (ns.ensemble(BLOCK, starts, 4.0) for starts in (ns.Grid([a, b]), whole))
    assert one.t.shape == (5, 4)
    assert one.x.tobytes() == other.x.tobytes() and one.itineraries == other.itineraries


@pytest.mark.parametrize(
    "drawn", [ns.Grid([[0.0, 1.0, 2.0], 0.5]), ns.RandomStarts(3, [0, 0], [1, 1])]
)
def test_parameters_broadcast_with_them(drawn):
    mus = np.linspace(0.5, 1.5, 4)[:, None]
    x0 = drawn.at(np.arange(3))
    one, other = (Starts(BLOCK, s, {"mu": mus}, 0.0) for s in (drawn, x0))
    assert one.shape == other.shape == (4, 3)
    for k in range(12):
        for a, b in zip(one.part(k, 12), other.part(k, 12), strict=True):
            assert np.array_equal(a, b)
    rows = np.array([11, 0, 5])
    for a, b in zip(one.rows(rows), other.rows(rows), strict=True):
        assert np.array_equal(a, b)


def test_a_single_point_is_a_grid_without_axes():
    many = ns.ensemble(BLOCK, ns.Grid([2.0, 0.0]), 1.0)
    assert many.t.shape == () and many.x.shape == (2,)


@pytest.mark.parametrize(
    "make",
    [
        lambda: ns.Grid([]),
        lambda: ns.Grid([[[1.0]]]),
        lambda: ns.Grid(["a", 1.0]),
        lambda: ns.Grid([np.nan, 1.0]),
        lambda: ns.RandomStarts(10, [0, 1], [1, 0]),
        lambda: ns.RandomStarts(10, [0], [1, 1]),
        lambda: ns.RandomStarts(10, [], []),
        lambda: ns.RandomStarts(10, 0.0, 1.0),
        lambda: ns.RandomStarts(10, [0, -np.inf], [1, 1]),
        lambda: ns.RandomStarts(10, [-1e308], [1e308]),
        lambda: ns.RandomStarts(-1, [0], [1]),
        lambda: ns.RandomStarts(1.5, [0], [1]),
        lambda: ns.RandomStarts(10, [0], [1], seed=-1),
        lambda: ns.ensemble(BLOCK, ns.RandomStarts(10, [0], [1]), 1.0),
        lambda: ns.ensemble(BLOCK, ns.Grid([1.0, 2.0, 3.0]), 1.0),
    ],
)
def test_what_is_no_start_is_refused(make):
    with pytest.raises(ns.PointError, match=r"^(axes|low|count|seed|x0)\b"):
        make()


def test_they_say_how_many_they_are():
    assert repr(ns.Grid([[0.0, 1.0], 2.0])) == "Grid(shape (2,), 2 states)"
    assert "count=3" in repr(ns.RandomStarts(3, [0.0], [1.0]))
