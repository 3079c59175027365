"""Basins have the boundaries of closed forms; interruptions lose nothing; statuses are labels."""

import math

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.orbit.basins import Search
from tests.orbit.periodic_cases import CASES, double_well

x, v, t, lam = (ca.SX.sym(s) for s in ("x", "v", "t", "lam"))
WELL = double_well()
QUIET = ns.Work(threads=1, progress=False)


@pytest.mark.slow
def test_thresholds_of_the_double_well_to_rounding_by_narrowing_the_grid():
    """B2: released at rest from x0; each threshold is bracketed by labels and narrowed."""
    for threshold, low, high in zip(
        map(float, CASES["B2"]["thresholds"]), (2.2, 3.1, 4.5), (2.6, 3.6, 4.9), strict=True
    ):
        for _ in range(6):
            axis = np.linspace(low, high, 41)
            found = ns.basins(WELL, {"x": axis, "v": 0.0}, t_end=120.0, tol=1e-13, work=QUIET)
            change = int(np.flatnonzero(np.diff(found.labels))[0])
            low, high = axis[change], axis[change + 1]
            if high - low < 1e-9:
                break
        assert low - 1e-10 < threshold < high + 1e-10


def test_forced_systems_are_sampled_after_each_period():
    pushed = ns.FilippovSystem(
        [x], surface=x, multipliers=lam, field=[lam - x + 0.5 * ca.cos(t)], time=t
    )
    starts = np.linspace(-2, 2, 40)[:, None]
    found = ns.basins(pushed, starts, t_end=300.0, section=2 * math.pi, work=QUIET)
    up = int(found.labels[-1])
    assert np.array_equal(found.labels == up, starts[:, 0] > 0) and 0 not in found.labels
    assert np.allclose(found.attractors[up - 1].points, [[1.25]], atol=1e-7)
    with pytest.raises(ns.OptionError, match=r"section.*period"):
        ns.basins(pushed, starts, t_end=100.0)


def test_statuses_are_labels():
    system = ns.FilippovSystem(
        [x, v], field=[v, -1], resets=ns.Reset(x, [x, -0.5 * v], -1), stops=ns.Stop(x - 4, 1)
    )
    starts = [[1.0, 0.0], [1.0, 4.0], [-1e-3, 0.0], [-2e-3, 0.0]]
    found = ns.basins(system, starts, t_end=50.0, rounds=4, work=QUIET)
    assert found.labels[:2].tolist() == [-2, -3] and found.name(-2) == "events accumulate"
    assert "stopped 25.00%" in repr(found)


def test_escape_to_infinity_in_finite_time_has_a_label():
    """x' = x^2 - 1 from 2 is infinite at ln(3)/2; from 0 it comes to -1."""
    found = ns.basins(
        ns.FilippovSystem([x], field=[x**2 - 1]), [[0.0], [2.0]], t_end=40.0, work=QUIET
    )
    assert found.labels.tolist() == [1, -5] and found.name(-5) == "to infinity"


def test_a_chaotic_attractor_is_one():
    """The logistic map at r = 4 at the ticks of a clock, beside what runs away."""
    clock = ns.Clock(1.0, map=[4 * x * (1 - x)])
    system = ns.FilippovSystem([x], field=[0.0 * x], clocks=clock)
    starts = np.stack([np.linspace(0.011, 0.987, 60), np.zeros(60)], axis=-1)
    found = ns.basins(
        system, starts, t_end=512.0, section="clock", near=0.05, samples=32, work=QUIET
    )
    assert set(found.labels.tolist()) == {1} and len(found.attractors) == 1
    assert np.ptp(found.attractors[0].points[:, 0]) > 0.9


def test_known_attractors_come_first_and_labels_survive_a_file(tmp_path):
    found = ns.basins(
        WELL, {"x": [-1.2, 1.3], "v": [0.0, 0.1]}, t_end=200.0, attractors=[[-1.0, 0.0]], work=QUIET
    )
    assert found.labels.tolist() == [[1, 1], [2, 2]]
    found.save(tmp_path / "basins.npz")
    again = ns.load(tmp_path / "basins.npz")
    assert np.array_equal(again.labels, found.labels) and repr(again) == repr(found)
    assert np.array_equal(again.attractors[1].points, found.attractors[1].points)
    assert list(again.axes) == ["x", "v"]


def test_an_interrupted_search_keeps_its_labels_and_continues_from_a_store(tmp_path, monkeypatch):
    grid = {"x": np.linspace(-3, 3, 9), "v": np.linspace(-2, 2, 6)}
    space = Search._sample.__globals__
    plain, calls, last = space["ensemble"], [], 10**6

    def ensemble(*args, **options):
        calls.append(1)
        if len(calls) == last:
            raise KeyboardInterrupt
        return plain(*args, **options)

    monkeypatch.setitem(space, "ensemble", ensemble)
    exact = ns.basins(WELL, grid, t_end=160.0, work=QUIET)
    last, calls = len(calls), []
    work = ns.Work(threads=1, progress=False, store=tmp_path / "saved")
    cut = ns.basins(WELL, grid, t_end=160.0, work=work)
    assert not cut.complete and "interrupted" in repr(cut)
    decided = cut.labels != 0
    assert 0 < decided.sum() < cut.labels.size
    assert np.array_equal(cut.labels[decided], exact.labels[decided])
    monkeypatch.setitem(space, "ensemble", plain)
    again = ns.basins(WELL, grid, t_end=160.0, work=work)
    assert again.complete and np.array_equal(again.labels, exact.labels)


@pytest.mark.parametrize(
    ("grid", "options", "error", "message"),
    [
        ([1.0], {}, ns.PointError, "grid"),
        ({"x": [1.0]}, {}, ns.PointError, "grid.*axis"),
        ([[np.nan, 0.0]], {}, ns.PointError, "grid"),
        (
            [[0.0, 0.0], [1.0, np.nan], [np.inf, 0.0]],
            {},
            ns.PointError,
            r"grid.*2 of 3.*\[1.0, nan\]",
        ),
        ({"x": [0.0, np.nan], "v": 0.0}, {}, ns.PointError, "grid.*1 of 2"),
        (np.zeros((0, 2)), {}, ns.PointError, "grid.*at least one"),
        ([0.0, 0.0], {"near": 2.0}, ns.OptionError, "near"),
        ([0.0, 0.0], {"t_end": 0.0}, ns.OptionError, "t_end"),
        ([0.0, 0.0], {"attractors": [[1.0]]}, ns.PointError, "attractors"),
    ],
)
def test_invalid_arguments_raise(grid, options, error, message):
    with pytest.raises(error, match=message):
        ns.basins(WELL, grid, **{"t_end": 10.0, **options})
