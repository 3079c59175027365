"""Tables have what the arrays have: states, times, samples and events, with their axes."""

import sys
from functools import cache

import casadi as ca
import numpy as np
import pytest

import bounce
import nonsmooth as ns

from .flow.test_saving import MADE, many, run
from .test_notebook import RELAY, V, X, results, shown

ONE_AXIS = np.array([[1.0, 0.0], [2.0, 0.0]])
mu, nu = ca.SX.sym("mu"), ca.SX.sym("nu")
TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
#: x' = mu - x and nu - x on the sides of x = 0: an equilibrium meets the surface.
CORNER = ns.FilippovSystem(
    [X, V], surface=X, above=[mu - X, nu - V], below=[1, -V], parameters={mu: 0.5, nu: 0.0}
)


def orbit():
    belt = ns.textbook.leine_stick_slip()
    return ns.periodic_orbit(belt.system, belt.run())


def branch():
    return ns.continue_equilibrium(CORNER, [0.5, 0.0], "mu", bounds=(-1.0, 1.0))


@cache
def found(name):
    """One of each result by the function that returns it."""
    belt = ns.textbook.leine_stick_slip().system
    makes = {
        "simulate": lambda: ns.simulate(RELAY, [3.0, 0.0], 20.0, t_eval=[1.0, 2.0, 3.0]),
        "events": lambda: found("simulate").events,
        "segments": lambda: found("simulate").segments,
        "saved": run,
        "ensemble": many,
        "sampled": lambda: ns.ensemble(RELAY, ONE_AXIS, 9.0, t_eval=[1.0], at_event=("entry", 1)),
        "outcomes": lambda: ns.outcomes(RELAY, ONE_AXIS, 9.0, ranges={"x": (-3, 3)}, bins=4),
        "sensitivity": lambda: ns.sensitivity(ns.simulate(CORNER, [1.0, 1.0], 2.0, t_eval=[1.0])),
        "periodic_orbit": orbit,
        "phase_response": lambda: ns.phase_response(orbit()),
        "lyapunov_spectrum": lambda: ns.lyapunov_spectrum(belt, [1.0, 0.2], t_end=60.0),
        "poincare": lambda: ns.orbit.poincare(RELAY, "h0", [3.0, 0.0], count=2),
        "master_stability": lambda: ns.orbit.MasterStability(
            np.array([0.0, 1j]), np.ones((2, 3), complex), np.array([0.0, -1.0]), 2.0
        ),
        "basins": lambda: ns.basins(CORNER, {"x": [0.2, 0.5, 0.7], "v": [0.0, 0.1]}, t_end=50.0),
        "branch": branch,
        "curve": lambda: ns.continue_bifurcation(
            branch().events[0], ("mu", "nu"), bounds=((-1, 1), (-1, 1))
        ),
        "funnel": lambda: ns.orbit.funnel(
            ns.FilippovSystem([X], surface=X, above=[1], below=[-1]), [0.0], 1.0, samples=5
        ),
        "manifold": lambda: ns.manifold(
            ns.FilippovSystem([X, V], field=[X, -V]),
            ns.find_equilibrium(ns.FilippovSystem([X, V], field=[X, -V]), [0.0, 0.0]),
            stable=False,
            length=1.0,
        ),
        "outcome_map": lambda: bounce.outcome_map(
            TURF, {"omega": [-1, 0, 1], "xdot": [-1, 1]}, {"ydot": -1.0}
        ),
        "dividing_surface": lambda: bounce.maps.dividing_surface(TURF, [-1.0, -2.0], step=0.4),
    }
    return makes[name]()


#: Result, table, column of the DataFrame, and where it is in the result.
COLUMNS = [
    ("simulate", "points", "v", lambda r: r.x[:, 1]),
    ("simulate", "samples", "x", lambda r: r.sample_x[:, 0]),
    ("simulate", "events", "v_after", lambda r: r.events.x_after[:, 1]),
    ("saved", "events", "name", lambda r: r.events.column("name")),
    ("events", "events", "x_1", lambda r: r.x[:, 1]),
    ("segments", "segments", "t_end", lambda r: r.t_end),
    ("ensemble", "ends", "v", lambda r: r.x[..., 1].ravel()),
    ("ensemble", "ends", "itinerary", lambda r: r.itinerary.ravel()),
    ("ensemble", "ends", "entry_count", lambda r: r.events["entry"].ravel()),
    ("ensemble", "samples", "x", lambda r: r.sample_x[..., 0].ravel()),
    ("sampled", "events", "x", lambda r: r.event_x[:, 0]),
    ("outcomes", "states", "std", lambda r: [r.std["x"], r.std["v"], r.std["t"]]),
    ("outcomes", "x", "count", lambda r: r.histogram["x"]),
    ("sensitivity", "end", "v", lambda r: r.dx_dx0[:, 1]),
    ("sensitivity", "end", "nu", lambda r: r.dx_dp[:, 1]),
    ("sensitivity", "samples", "mu", lambda r: r.dsample_dp[..., 0].ravel()),
    ("periodic_orbit", "legs", "duration", lambda r: [leg.duration for leg in r.legs]),
    ("periodic_orbit", "points", "x", lambda r: r.trajectory.x[:, 0]),
    ("periodic_orbit", "multipliers", "value", lambda r: r.multipliers),
    ("phase_response", "points", "v_z", lambda r: r.z[:, 1]),
    ("lyapunov_spectrum", "directions", "exponent", lambda r: r.exponents),
    ("lyapunov_spectrum", "blocks", "exponent_1", lambda r: r.blocks[:, 1]),
    ("poincare", "points", "x", lambda r: r.points[:, 0]),
    ("master_stability", "nodes", "multipliers_2", lambda r: r.multipliers[:, 2]),
    ("basins", "starts", "label", lambda r: r.labels.ravel()),
    ("basins", "attractors", "x", lambda r: np.concatenate([a.points for a in r.attractors])[:, 0]),
    ("branch", "points", "x", lambda r: [s.point[0] for s in r.solutions]),
    ("branch", "events", "mu", lambda r: [e.parameter for e in r.events]),
    ("curve", "points", "nu", lambda r: r.values[:, 1]),
    ("funnel", "points", "x", lambda r: np.concatenate([one.x[:, 0] for one in r.trajectories])),
    ("manifold", "points", "x_0", lambda r: np.concatenate([arc.points[:, 0] for arc in r.arcs])),
    ("outcome_map", "lift_offs", "omega_", lambda r: r.lift_offs.omega.ravel()),
    ("dividing_surface", "points", "omega", lambda r: np.concatenate(
        [arc.points[:, 1] for c in r.curves for arc in (*c.arcs, *c.reverse)])),
]  # fmt: skip


@pytest.mark.parametrize(("name", "what", "column", "read"), COLUMNS)
def test_columns_are_the_arrays(name, what, column, read):
    pytest.importorskip("pandas")
    result = found(name)
    table, expected = result.to_pandas(what), np.asarray(read(result))
    assert len(table) == len(expected) > 0
    equal = np.array_equal(table[column], expected, equal_nan=expected.dtype.kind in "fc")
    assert equal, table[column]


@pytest.mark.parametrize("name", [*dict.fromkeys(row[0] for row in COLUMNS)])
def test_data_sets_have_the_same_variables_with_named_axes(name):
    pytest.importorskip("xarray")
    result = found(name)
    data = result.to_xarray()
    for k, table in enumerate(result._tables().values()):
        assert not table.columns or set(table.index) <= set(data.sizes)
        for variable, more, array in table.variables():
            same = [v for key, v in data.data_vars.items() if key.endswith(variable)]
            dims = (*table.index, *more)
            assert any(v.dims == dims and v.shape == array.shape for v in same), (k, variable)


def test_axes_of_runs_and_ensembles():
    pytest.importorskip("xarray")
    one, data = found("simulate"), found("simulate").to_xarray()
    assert np.array_equal(data.x.sel(state="v"), one.x[:, 1]) and np.array_equal(data.t, one.t)
    assert data.sample_t.values.tolist() == [1.0, 2.0, 3.0]
    lots = found("ensemble").to_xarray()
    assert lots.x.dims == ("start_0", "start_1", "state")
    assert lots.sample_x.sel(state="x").dims == ("start_0", "start_1", "sample")
    frame = found("ensemble").to_pandas()
    assert frame.index.names == ["start_0", "start_1"]
    assert frame.loc[(1, 0), "status"] == "NOT_FINITE"
    points = found("saved").to_pandas()
    assert points.attrs["a"] == 0.4 and points.attrs["status"] == "REACHED_END"
    assert points.index.name == "t" and list(points) == ["x", "v"]


def test_states_with_the_names_of_columns_keep_their_values():
    pytest.importorskip("pandas")
    names = ("t", "status", "itinerary")
    system = ns.FilippovSystem([ca.SX.sym(name) for name in names], field=[1, 0, 0])
    many = ns.ensemble(system, [[1.0, 2.0, 3.0]], 1.0)
    frame = many.to_pandas()
    assert frame.loc[0, [f"{name}_x" for name in names]].tolist() == many.x[0].tolist()
    assert frame.loc[0, "status"] == "REACHED_END"


def test_every_result_of_the_notebooks_becomes_tables():
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    for one in [*dict(shown()).values(), *results()]:
        if one is not RELAY:
            tables = [one.to_pandas(what) for what in one._tables()]
            assert any(table.size for table in tables) and len(one.to_xarray().data_vars), one


def test_tables_that_are_not_there_are_refused():
    pytest.importorskip("pandas")
    with pytest.raises(ns.OptionError, match=r"'steps'. Trajectory has 'points', 'events'"):
        found("saved").to_pandas("steps")
    with pytest.raises(ns.OptionError, match="t_eval="):
        ns.simulate(RELAY, [1.0, 0.0], 1.0).to_pandas("samples")


@pytest.mark.parametrize("name", ["pandas", "xarray"])
def test_libraries_that_are_not_there_are_required(name, monkeypatch):
    monkeypatch.setitem(sys.modules, name, None)
    for make in MADE.values():
        with pytest.raises(ns.OptionError, match=rf"^to_{name} needs {name}"):
            getattr(make(), f"to_{name}")()
