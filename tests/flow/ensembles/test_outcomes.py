"""Outcomes are what one counts in the ensemble of the same runs, here and as a card reduces them."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.engine import find_compiler
from nonsmooth.flow.engine.device import kernel
from nonsmooth.flow.ensembles import on_device
from tests.flow.engine.device.shim import Shim

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
RANGES = {"x": (-1.0, 1.0), "t": (0.0, 4.0)}
STARTS = ns.RandomStarts(300, [-2.0, -1.0], [2.0, 1.0], seed=4)


@pytest.fixture(scope="module")
def system():
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    stops = [ns.Stop(x - 1, 1, "right")]
    return ns.FilippovSystem(
        [x, v], surface=v - 0.2, above=[v, -x - 1], below=[v, -x + 1], stops=stops
    )


def agree(found, runs):
    """Counts are those of the ensemble's arrays; means to rounding."""
    assert found.count == runs.t.size == sum(found.itineraries.values())
    words, counts = np.unique(runs.itinerary.astype(str), return_counts=True)
    assert found.itineraries == dict(zip(words.tolist(), counts.tolist(), strict=True))
    assert list(found.itineraries.values()) == sorted(counts.tolist(), reverse=True)
    assert found.status == {s: n for s in ns.Status if (n := int(np.sum(runs.status == s)))}
    done = runs.complete
    columns = {"x": runs.x[done][:, 0], "v": runs.x[done][:, 1], "t": runs.t[done]}
    for name, values in columns.items():
        assert found.mean[name] == pytest.approx(values.mean(), rel=0, abs=1e-12)
        assert found.std[name] == pytest.approx(values.std(), rel=0, abs=1e-7)
    for name, ends in RANGES.items():
        counts, edges = np.histogram(columns[name], len(found.histogram[name]), ends)
        np.testing.assert_allclose(found.edges[name], edges, rtol=0, atol=1e-15)
        # A state held at a stop has an edge's value to rounding: it may be in either bin, or outside.
        assert np.abs(found.histogram[name] - counts).sum() <= 2 * np.sum(
            np.min(np.abs(columns[name][:, None] - edges), axis=1) < 1e-12
        )


@needs_compiler
def test_on_the_processor(system):
    options = dict(t_end=4.0, tol=1e-5)
    work = ns.Work(chunk=70, threads=1)
    found = ns.outcomes(system, STARTS, ranges=RANGES, bins=8, work=work, **options)
    agree(found, ns.ensemble(system, STARTS, **options))


@needs_compiler
@pytest.mark.parametrize("points", [pytest.param(kernel.TABLE_SIZE, marks=pytest.mark.slow), 2])
def test_on_a_card(system, monkeypatch, points):
    """With room for two itineraries in the card's table the other runs are counted here."""
    monkeypatch.setattr(kernel, "TABLE_SIZE", points)
    shim = Shim(fused=False)
    monkeypatch.setattr(on_device, "machine_for", lambda device: shim)
    options = dict(t_end=4.0, tol=1e-5, device="cuda", work=ns.Work(chunk=130))
    for starts in (STARTS, STARTS.at(np.arange(300))):
        found = ns.outcomes(system, starts, ranges=RANGES, bins=8, **options)
        agree(found, ns.ensemble(system, starts, **options))


def test_bins_hold_both_ends_and_nothing_outside():
    bins = kernel.Bins(4, np.array([0.0]), np.array([2.0]))
    values = np.array([-1e-9, 0.0, 0.5, 1.9, 2.0, 2.1, np.nan])
    assert bins.indices(0, values).tolist() == [0, 1, 3, 3]


@pytest.mark.parametrize("ranges", [{"z": (0, 1)}, {"x": (1, 1)}, {"x": 3}, {"x": (0, np.inf)}])
def test_ranges_are_refused(system, ranges):
    with pytest.raises(ns.OptionError, match=r"^ranges .*\('x', 'v', 't'\)"):
        ns.outcomes(system, STARTS, 1.0, ranges=ranges)


def test_what_keeps_nothing_has_no_store(system, tmp_path):
    with pytest.raises(ns.OptionError, match="store"):
        ns.outcomes(system, STARTS, 1.0, work=ns.Work(store=tmp_path / "runs"))


def test_no_runs_have_no_means(system):
    found = ns.outcomes(system, np.empty((0, 2)), 1.0)
    assert (found.count, found.status, found.itineraries) == (0, {}, {})
    assert np.isnan(found.mean["x"])
