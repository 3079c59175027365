"""A step that is not clear to lanes is made by the driver, and the run continues in its lane."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.engine import find_compiler, interpreter_for, lanes_for
from nonsmooth.flow.engine import lanes as engine
from nonsmooth.flow.options import Options
from nonsmooth.flow.results import Chunk

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

x, y, z, t = (ca.SX.sym(s) for s in ("x", "y", "z", "t"))


def pendulum():
    push = 0.8 * ca.sin(0.7 * t)
    fields = {
        name: [y, -ca.sin(x) + friction + push]
        for name, friction in (("above", -0.3), ("below", 0.3))
    }
    return ns.FilippovSystem([x, y], surface=y, time=t, **fields), 20.0, 2.0


def relay():
    above, below = [y - 1, z - 2, -3 - x], [y + 1, z + 2, 3 - x]
    return ns.FilippovSystem([x, y, z], surface=x, above=above, below=below), 10.0, 2.0


def converter():
    """Voltage v and current i, switched where an amplified error of v meets a sine, in units of a millisecond."""
    current, voltage = x, y
    charge = (current - voltage / 22) / 0.047
    carrier = 8.4 * (voltage - 11.3) - (6 + 2.2 * ca.sin(5 * ca.pi * t))
    return (
        ns.FilippovSystem(
            [voltage, current],
            surface=carrier,
            above=[charge, -voltage / 20],
            below=[charge, (22 - voltage) / 20],
            time=t,
        ),
        8.0,
        1.0,
    )


def oscillators():
    """Beats between two frequencies, to a stop."""
    fields = {
        name: [y, -x + side, 1.7 * (1 - z)] for name, side in (("above", -0.3), ("below", 0.3))
    }
    stops = [ns.Stop(z - 0.999, 1), ns.Stop(x + 2.5)]
    return ns.FilippovSystem([x, y, z], surface=x - 0.2 * z * z, stops=stops, **fields), 9.0, 2.0


SYSTEMS = {f.__name__: f for f in (pendulum, relay, converter, oscillators)}


def lanes_of(system, order, width, monkeypatch):
    monkeypatch.setattr(engine, "lane_width", lambda: width)
    return engine.Lanes(system, order)


def starts_of(system, size, count):
    start = np.random.default_rng(7).uniform(-size, size, (count, system.dimension))
    return np.hstack([start, np.zeros((count, int(system.time_dependent)))])


def words(chunk):
    return [chunk.words[k] for k in chunk.itinerary]


def same(one, two, digits):
    assert words(one) == words(two)
    for name in ("status", "kinds"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    for name in ("t", "x", "at_t", "at_x", "sample_t", "sample_x"):
        if getattr(one, name) is not None:
            pair = getattr(one, name), getattr(two, name)
            np.testing.assert_allclose(*pair, rtol=0, atol=digits, err_msg=name)


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("width", [1, 4, 8])
def test_steps_made_by_the_driver_at_random(width, name, monkeypatch):
    """Half of all steps are made by the driver: same itineraries and samples, the same numbers to the tolerance."""
    system, t_end, size = SYSTEMS[name]()
    options, p = Options(t_end=t_end, rtol=1e-10, atol=1e-10), system.parameter_vector()
    start, at, rng = starts_of(system, size, 60), (0, 2), np.random.default_rng(3)
    times = np.sort(rng.uniform(0, t_end, (60, 30)), axis=1)
    times[:, [0, 1, -2, -1]] = 0, 0, t_end, t_end
    start[5, 0] = np.nan
    rows = lambda: Chunk.empty(60, system, True, 30)
    scalar = interpreter_for(system, options).run_many(start, p, options, at, rows(), times=times)
    assert np.isnan(scalar.sample_t[5]).all() and np.isfinite(scalar.sample_t[:, 0]).sum() == 59
    lanes = lanes_of(system, options.order, width, monkeypatch)
    same(lanes.run_many(start, p, options, at, rows(), times=times), scalar, 1e-7)
    lanes.random = 5
    mixed = lanes.run_many(start, p, options, at, rows(), times=times)
    same(mixed, scalar, 1e-7)
    assert 0.45 < mixed.totals[2] / mixed.totals[0] < 0.6


def test_runs_that_begin_late(monkeypatch):
    """The time of a state is since the start in the driver, and that of the clock in lanes."""
    above, below = [y, -x - 0.4], [y, -x + 0.4]
    system = ns.FilippovSystem(
        [x, y], surface=y - 0.3 * ca.sin(t), above=above, below=below, time=t
    )
    options, p = Options(t_start=1e3, t_end=1e3 + 9, rtol=1e-9), system.parameter_vector()
    start = starts_of(system, 2.0, 40) + np.array([0, 0, 1e3])
    scalar = interpreter_for(system, options).run_many(start, p, options, (1, 1))
    assert (scalar.status == ns.Status.REACHED_END).all()
    lanes = lanes_of(system, options.order, 4, monkeypatch)
    lanes.random = 5
    same(lanes.run_many(start, p, options, (1, 1)), scalar, 1e-7)


def test_parameters_of_each_start(monkeypatch):
    a = ca.SX.sym("a")
    fields = {"above": [y, -x - a], "below": [y, -x + a]}
    system = ns.FilippovSystem([x, y], surface=y - 0.3, parameters={a: 0.5}, **fields)
    options = Options(t_end=20.0, rtol=1e-10, atol=1e-10)
    p, start = np.linspace(0.1, 0.9, 40)[:, None], starts_of(system, 2.0, 40)
    lanes = lanes_of(system, options.order, 4, monkeypatch)
    lanes.random = 3
    scalar = interpreter_for(system, options).run_many(start, p, options, (1, 1))
    same(lanes.run_many(start, p, options, (1, 1)), scalar, 1e-7)


def test_stops_with_conditions_are_not_for_lanes():
    half = {"when": y > 0}, {"level": True}, {"initially": True}
    for more in ({}, *half):
        system = ns.FilippovSystem([x, y], field=[y, -x], stops=[ns.Stop(x - 1, 1, **more)])
        assert (lanes_for(system, Options(t_end=1.0)) is None) == bool(more)


@pytest.mark.parametrize("base", [1.05, 2.0, 50.0])
def test_events_that_accumulate(base, monkeypatch):
    """The surface is crossed at 1 - base**(-k/2 - 1/4): the driver ends the run at the same event as in core."""
    turns = ca.cos(2 * ca.pi * ca.log(1 - y) / np.log(base))
    system = ns.FilippovSystem([x, y], surface=turns, above=[1, 1], below=[-1, 1])
    options, p = Options(t_end=2.0, rtol=1e-10, atol=1e-10), system.parameter_vector()
    start = starts_of(system, 1.0, 12) * [1, 0]
    start[:, 1] = np.linspace(0, 1 - 1e-6, 12)
    scalar = interpreter_for(system, options).run_many(start, p, options, None)
    lanes = lanes_of(system, options.order, 4, monkeypatch)
    found = lanes.run_many(start, p, options, None)
    assert (found.status == ns.Status.ACCUMULATION).all()
    assert found.totals[2] < 0.8 * found.totals[0]
    same(found, scalar, 1e-8)


def test_intervals_that_only_shrink_stay_in_lanes(monkeypatch):
    """Intervals of a converter become shorter for a while, and hardly a step leaves the lanes."""
    system, t_end, size = converter()
    options, p = Options(t_end=4 * t_end, rtol=1e-9, atol=1e-9), system.parameter_vector()
    lanes = lanes_of(system, options.order, 4, monkeypatch)
    found = lanes.run_many(starts_of(system, size, 60), p, options, None)
    assert found.totals[2] < 1e-3 * found.totals[0] and found.totals[1] > 4000
