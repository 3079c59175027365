"""A step that is not clear to lanes is made by the driver, and the run continues in its lane."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.engine import find_compiler, interpreter_for
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


def impacts():
    """A forced mass between two stiff stops, on one of which it may rest."""
    walls = [ns.Impact(1.2 - x, 0.8, name="right"), ns.Impact(x + 0.6, 0.2, name="left")]
    field = [y, -x - 0.1 * y + 1.2 * ca.cos(1.7 * t)]
    return ns.FilippovSystem([x, y], field=field, impacts=walls, time=t), 12.0, 0.5


def kicks():
    """Friction, a wall as a reset, and a kick that a large speed makes due, whichever way it becomes so."""
    wall = ns.Reset(x - 0.6, {y: -0.7 * y}, 1, name="wall")
    kick = ns.Reset(ca.logic_or(y > 1, x < -1.2), {y: 0.2 * y, x: 0.5 * x}, name="kick")
    above, below = [y, -x - 0.1], [y, -x + 0.1]
    resets, stops = [wall, kick], [ns.Stop(y + 0.04 * x + 1.6, -1)]
    return (
        ns.FilippovSystem(
            [x, y], surface=y - 0.2, above=above, below=below, resets=resets, stops=stops
        ),
        9.0,
        1.0,
    )


def sampled():
    """A control that is sampled by one clock and switched by the phase of another."""
    one, two = ns.Clock(0.7, {z: -2 * x - y}, name="sample"), ns.Clock(0.4, name="carrier")
    duty = two.phase - 0.2 - 0.1 * ca.tanh(z)
    above, below = [y, -x - 0.4, 0], [y, -x + z, 0]
    rest = {"clocks": [one, two], "stops": ns.Stop(x - 1.2)}
    return ns.FilippovSystem([x, y, z], surface=duty, above=above, below=below, **rest), 8.4, 1.0


def heating():
    """A relay with hysteresis as a discrete state, and a window that opens while it is on."""
    on = ns.Reset(x < 18 - y, {z: 1}, level=True, when=z == 0, name="on")
    off = ns.Reset(x > 22 + y, {z: 0}, level=True, when=z == 1, name="off")
    window = ns.Reset(x - 20, {x: x - 0.4}, 1, when=y > 0, values="trigger", name="window")
    return (
        ns.FilippovSystem(
            [x, y],
            field=[30 * z - x + ca.sin(t), ca.cos(3 * t)],
            discrete={z: (0, 1)},
            resets=[on, off, window],
            time=t,
        ),
        6.0,
        0.9,
    )


def walls():
    """Springs that a mass meets at both ends, friction, and a multiplier that enters nonlinearly."""
    a, b, c = (ca.SX.sym(s) for s in "abc")
    push = -x - 2 * (1 + a) * (x - 0.5) + 2 * (b - 1) * (x + 0.6) - 0.2 * c + 0.1 * c**2
    system = ns.FilippovSystem(
        [x, y],
        field=[y, push + 0.9 * ca.cos(1.3 * t)],
        surfaces=[x - 0.5, x + 0.6, y - 0.1],
        multipliers=[a, b, c],
        hidden=True,
        time=t,
    )
    return system, 9.0, 1.0


SYSTEMS = {
    f.__name__: f
    for f in (pendulum, relay, converter, oscillators, impacts, kicks, sampled, heating, walls)
}

#: Systems with events that the driver makes.
EVENTS = [impacts, kicks, sampled, heating, walls]


def lanes_of(system, order, width, monkeypatch):
    monkeypatch.setattr(engine, "lane_width", lambda: width)
    return engine.Lanes(system, order)


def starts_of(system, size, count):
    start = np.random.default_rng(7).uniform(-size, size, (count, system.dimension))
    still = len(system.definition.clocks) + len(system.definition.discrete)
    start[:, system.dimension - still :] = 0
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


@pytest.mark.slow_cases(
    *("4-kicks", "4-heating", *[f"{w}-{f.__name__}" for f in EVENTS for w in (1, 8)])
)
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
    steps, driven = mixed.totals[[0, 2]]
    events = 0 if SYSTEMS[name] not in EVENTS else 60 + scalar.totals[1]
    assert 0.45 < driven / steps < 0.6 + events / steps


@pytest.mark.parametrize(("count", "share"), [(1, 1), (2, 0)])
def test_slides_of_several_surfaces_are_no_work_for_lanes(count, share):
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    given = {"surfaces": [x, y][:count], "multipliers": [a, b][:count]}
    system = ns.FilippovSystem([x, y], field=[-a, -b if count > 1 else x], **given)
    options, p = Options(t_end=1.0), system.parameter_vector()
    assert (interpreter_for(system, options).seconds(np.zeros(2), p, options) > 0) == share


def test_an_interrupt_is_heard_while_the_driver_slides(monkeypatch):
    """All of 200 runs slide from their starts on, for 1,000 steps each."""
    system = ns.FilippovSystem([x, y], field=[-z, -t], surfaces=[x, y], multipliers=[z, t])
    options, asked = Options(t_end=1.0, max_step=1e-3), []
    lanes = lanes_of(system, 6, 4, monkeypatch)
    stop = lambda: bool(asked.append(0))
    found = lanes.run_many(np.zeros((200, 2)), system.parameter_vector(), options, None, stop=stop)
    assert len(asked) > found.totals[0] / 20_000 > 5


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
