"""Tables have what the arrays have: states, times, samples and events, with their axes."""

import sys

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

from .test_saving import BLOCK, MADE, many, run

x, v = ca.SX.sym("x"), ca.SX.sym("v")
RELAY = ns.FilippovSystem([x, v], surface=v, above=[v, -x - 0.4], below=[v, -x + 0.4])
STARTS = np.array([[[1.0, 0.0], [2.0, 0.0]], [[3.0, 0.0], [0.1, 0.0]]])


@pytest.mark.parametrize("t_eval", [None, [1.0, 2.0, 3.0]])
def test_a_run_as_a_dataset(t_eval):
    pytest.importorskip("xarray")
    result = ns.simulate(RELAY, [2.0, 0.0], 10.0, t_eval=t_eval)
    table = result.to_xarray()
    assert np.array_equal(table["x"], result.x) and np.array_equal(table["t"], result.t)
    assert np.array_equal(table.x.sel(state="v"), result.x[:, 1])
    assert ("sample_x" in table) == (t_eval is not None)
    if t_eval is not None:
        assert np.array_equal(table["sample_x"], result.sample_x)
        assert table.sample_t.values.tolist() == t_eval


@pytest.mark.parametrize("event", [None, ("entry", 1)])
@pytest.mark.parametrize("t_eval", [None, [1.0, 2.0]])
def test_an_ensemble_as_a_dataset(t_eval, event):
    pytest.importorskip("xarray")
    result = ns.ensemble(RELAY, STARTS, 10.0, t_eval=t_eval, at_event=event)
    table = result.to_xarray()
    assert table["x"].dims == ("start_0", "start_1", "state")
    assert np.array_equal(table["t"], result.t)
    assert ("event_x" in table, "sample_x" in table) == (event is not None, t_eval is not None)
    if event is not None:
        assert np.array_equal(table["event_x"], result.event_x, equal_nan=True)
    if t_eval is not None:
        assert table["sample_x"].dims == ("start_0", "start_1", "sample", "state")


def test_an_ensemble_of_one_axis_as_a_table():
    pytest.importorskip("pandas")
    result = ns.ensemble(RELAY, STARTS[0], 10.0)
    table = result.to_pandas()
    assert len(table) == 2 and table.index.nlevels == 1
    assert np.array_equal(table["x"], result.x[:, 0])
    assert list(table["itinerary"]) == list(result.itinerary)


def test_a_run_as_tables():
    pandas = pytest.importorskip("pandas")
    result = run()
    points, events = result.to_pandas(), result.to_pandas("events")
    assert isinstance(points, pandas.DataFrame) and list(points) == ["x", "v"]
    assert np.array_equal(points.to_numpy(), result.x) and points.index.name == "t"
    assert points.attrs["a"] == 0.4 and points.attrs["status"] == "REACHED_END"
    assert events.kind.tolist() == [e.kind for e in result.events]
    bumps = events[events.name == "bumper"]
    assert len(bumps) and np.array_equal(bumps.v_after, -bumps.v)
    assert result.to_pandas("samples").loc[1.0].tolist() == result(1.0).tolist()
    with pytest.raises(ns.OptionError, match=r"what is 'steps'"):
        result.to_pandas("steps")
    with pytest.raises(ns.OptionError, match="samples"):
        ns.simulate(BLOCK, [0.0, 0.0], 1.0).to_pandas("samples")


def test_an_ensemble_as_a_table_and_as_a_data_set():
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    result = many()
    table, data = result.to_pandas(), result.to_xarray()
    assert table.loc[(1, 0), "status"] == "NOT_FINITE" and table.index.names == [
        "start_0",
        "start_1",
    ]
    assert table.itinerary.tolist() == result.itinerary.ravel().tolist()
    assert np.array_equal(table[["x", "v"]].to_numpy(), result.x.reshape(4, 2), equal_nan=True)
    assert table.entry_count.tolist() == result.events["entry"].ravel().tolist()
    assert data.x.dims == ("start_0", "start_1", "state") and data.state.values.tolist() == [
        "x",
        "v",
    ]
    assert np.array_equal(data.sample_x, result.sample_x, equal_nan=True)
    assert data.sample_x.sel(state="x").dims == ("start_0", "start_1", "sample")


@pytest.mark.parametrize("name", ["pandas", "xarray"])
def test_libraries_that_are_not_there_are_asked_for(name, monkeypatch):
    monkeypatch.setitem(sys.modules, name, None)
    for make in MADE.values():
        with pytest.raises(ns.OptionError, match=rf"^to_{name} needs {name}"):
            getattr(make(), f"to_{name}")()
