"""Tables have what the arrays have: states, times, samples and events, with their axes."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, v = ca.SX.sym("x"), ca.SX.sym("v")
RELAY = ns.FilippovSystem([x, v], surface=v, above=[v, -x - 0.4], below=[v, -x + 0.4])
STARTS = np.array([[[1.0, 0.0], [2.0, 0.0]], [[3.0, 0.0], [0.1, 0.0]]])


@pytest.mark.parametrize("t_eval", [None, [1.0, 2.0, 3.0]])
def test_a_run_as_a_dataset(t_eval):
    pytest.importorskip("xarray")
    run = ns.simulate(RELAY, [2.0, 0.0], 10.0, t_eval=t_eval)
    table = run.to_xarray()
    assert np.array_equal(table["x"], run.x) and np.array_equal(table["t"], run.t)
    assert ("sample_x" in table) == (t_eval is not None)
    if t_eval is not None:
        assert np.array_equal(table["sample_x"], run.sample_x)


@pytest.mark.parametrize("event", [None, ("entry", 1)])
@pytest.mark.parametrize("t_eval", [None, [1.0, 2.0]])
def test_an_ensemble_as_a_dataset(t_eval, event):
    pytest.importorskip("xarray")
    many = ns.ensemble(RELAY, STARTS, 10.0, t_eval=t_eval, at_event=event)
    table = many.to_xarray()
    assert table["x"].dims == ("start_0", "start_1", "state")
    assert np.array_equal(table["t"], many.t)
    assert ("event_x" in table, "sample_x" in table) == (event is not None, t_eval is not None)
    if event is not None:
        assert np.array_equal(table["event_x"], many.event_x, equal_nan=True)
    if t_eval is not None:
        assert table["sample_x"].dims == ("start_0", "start_1", "sample", "state")


@pytest.mark.parametrize("starts", [STARTS, STARTS[0]])
def test_an_ensemble_as_a_table(starts):
    pytest.importorskip("pandas")
    many = ns.ensemble(RELAY, starts, 10.0)
    table = many.to_pandas()
    assert len(table) == many.t.size and table.index.nlevels == many.t.ndim
    assert np.array_equal(table["x"], many.x[..., 0].ravel())
    assert list(table["itinerary"]) == list(many.itinerary.ravel())
