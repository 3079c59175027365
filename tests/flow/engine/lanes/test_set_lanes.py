"""Friction in the plane in lanes: reference cases in 24 digits, the interpreter's itineraries and states, and
results that depend on no neighbour."""

from functools import lru_cache

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from benchmarks.bouncing import bounces_in_space
from nonsmooth.flow.engine import lanes as engine
from nonsmooth.flow.engine.interpreter import interpreter_for
from nonsmooth.flow.engine.lanes import lanes_for
from nonsmooth.flow.ensembles import ensemble
from nonsmooth.flow.options import Options
from tests.flow import plane_friction as plane
from tests.flow.engine.test_sets import landings

TOL = 1e-9


@lru_cache
def drawn(count, seed=1):
    """Random starts (slip as a state) and parameters."""
    cases = list(landings(count, seed))
    x = np.array([start for _, start, _ in cases])
    x[:, 4:6] += x[:, 2:4]
    return x, np.array([plane.ball("contact", True).parameter_vector(p) for p, _, _ in cases])


def both(system, x, p, tol, t_end=20.0):
    """Runs in lanes and in the interpreter, and how many of the first were left to the second."""
    options = Options(t_end=t_end, rtol=tol, atol=tol)
    lanes = lanes_for(system, options).run_many(x, p, options, None)
    one_by_one = interpreter_for(system, options).run_many(x, p, options, None)
    return lanes, one_by_one


def agree(lanes, expected, bound):
    """Itineraries and events are the same, and states to a bound."""
    words = [np.array(c.words)[c.itinerary] for c in (lanes, expected)]
    assert np.array_equal(*words) and np.array_equal(lanes.status, expected.status)
    assert np.array_equal(lanes.kinds, expected.kinds)
    size = 1 + np.abs(expected.x).max(axis=1)
    assert (np.abs(lanes.x - expected.x).max(axis=1) / size).max() < bound
    assert np.abs(lanes.t - expected.t).max() < bound


def test_random_landings_agree_with_the_interpreter():
    x, p = drawn(400)
    lanes, expected = both(plane.ball("contact", True), x, p, TOL)
    agree(lanes, expected, 10 * TOL)
    assert len(expected.words) > 6
    # Landings on a line pass h = 0 exactly, and some begin at rounding from it; of the others few are rare.
    kind = np.arange(400) % 8
    alone = both(plane.ball("contact", True), x[kind < 5], p[kind < 5], TOL)[0]
    assert lanes.totals[2] < 80 and alone.totals[2] <= 3


def mixed(system, x, p, tol, t_end, width, monkeypatch, at=None):
    """Runs in lanes, half of whose steps the driver makes, and in the driver alone."""
    monkeypatch.setattr(engine, "lane_width", lambda: width)
    options = Options(t_end=t_end, rtol=tol, atol=tol)
    lanes = engine.Lanes(system, lanes_for(system, options).order)
    lanes.random = 5
    return lanes.run_many(x, p, options, at), interpreter_for(system, options).run_many(
        x, p, options, at
    )


@pytest.mark.parametrize("width", [1, 4, 8])
def test_steps_made_by_the_driver_at_random(width, monkeypatch):
    x, p = drawn(400)
    found, expected = mixed(
        plane.ball("contact", True), x, p, TOL, 20.0, width, monkeypatch, (0, 1)
    )
    agree(found, expected, 10 * TOL)
    for name in ("at_t", "at_x"):
        pair = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(*pair, rtol=0, atol=100 * TOL, err_msg=name)
    assert 0.4 < found.totals[2] / found.totals[0] < 0.6


def test_steps_made_by_the_driver_at_random_where_slip_is_no_state(monkeypatch):
    """A block on a turning disc under a load that swings: it slips, sticks, and is flung off."""
    x, v, lam, t = ca.SX.sym("x", 2), ca.SX.sym("v", 2), ca.SX.sym("lam", 2), ca.SX.sym("t")
    slip = v - ca.vertcat(-x[1], x[0])
    stops = [ns.Stop(ca.sumsqr(x) - 4.0, 1)]
    system = ns.FilippovSystem(
        ca.vertcat(x, v),
        field=ca.vertcat(v, -(0.7 + 0.5 * ca.sin(2 * t)) * lam),
        surfaces=[slip],
        multipliers=[lam],
        stops=stops,
        time=t,
    )
    start = np.random.default_rng(3).uniform(-1, 1, (120, 5)) * [1, 1, 1, 1, 0]
    found, expected = mixed(system, start, system.parameter_vector(), TOL, 6.0, 4, monkeypatch)
    agree(found, expected, 100 * TOL)
    assert {"* s", "* s *"} <= set(found.words) and (found.status == ns.Status.STOPPED).any()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["linear", "nonlinear"])
def test_mirror_images_are_mirrored_to_the_bit_and_turned_starts_turn(kind):
    system, x = bounces_in_space.system(kind), bounces_in_space.starts(400)
    pairs = np.array([[0, 2], [1, 3], [6, 7]])  # places, speeds and slip along the two directions

    def turned(x, by):
        out = x.copy()
        out[:, pairs] = x[:, pairs] @ np.transpose(by)
        return out

    def run(x, tol=TOL):
        options = Options(t_end=20.0, rtol=tol, atol=tol)
        found = lanes_for(system, options).run_many(x, system.parameter_vector({}), options, None)
        assert not found.totals[2]
        return found.x, found.t, np.array(found.words)[found.itinerary]

    ends, t, words = run(x)
    for mirror in (np.diag([1, -1]), np.diag([-1, 1])):
        mirrored = run(turned(x, mirror))
        assert np.array_equal(turned(mirrored[0], mirror), ends)
        assert np.array_equal(mirrored[1], t) and np.array_equal(mirrored[2], words)
    swapped = np.array([[0, 1], [1, 0]])
    other = run(turned(x, swapped))  # sums of the same in another order
    assert np.abs(turned(other[0], swapped) - ends).max() < 1e-14
    # Each state along the ground has its own tolerance, so steps are turned starts' own: the finest show rounding.
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s], [s, c]])
    (ends, t, words), other = run(x, 1e-14), run(turned(x, turn), 1e-14)
    assert np.abs(turned(other[0], turn.T) - ends).max() < 1e-14
    assert np.abs(other[1] - t).max() < 1e-14 and np.array_equal(other[2], words)


def test_an_ensemble_depends_on_no_neighbour(monkeypatch):
    monkeypatch.setattr(ensemble, "_FEW_WITH_SETS", 64)
    system, (x, p) = plane.ball("contact", True), drawn(400)
    given = {name: p[:, i] for i, name in enumerate(system.parameter_names)}
    run = lambda **work: ns.ensemble(
        system, x, 20.0, parameters=given, tol=TOL, at_event=("entry", 1),
        work=ns.Work(progress=False, **work),
    )  # fmt: skip
    whole, parts = run(threads=1), run(threads=2, chunk=37)
    for name in ("x", "t", "status", "event_x", "event_t"):
        assert np.array_equal(getattr(whole, name), getattr(parts, name), equal_nan=True)
    assert np.array_equal(whole.itinerary, parts.itinerary)
    rolls = np.array(["* s" in word for word in whole.itinerary])
    assert np.array_equal(np.isfinite(whole.event_t), rolls)
    slip = whole.event_x[rolls][:, 4:6]
    assert not slip.any()  # the set is reached to the last bit


def test_ends_and_starts_that_are_not_finite():
    system, (x, p) = plane.ball("contact", True), drawn(64)
    x = x.copy()
    x[5, 2] = np.nan
    lanes, expected = both(system, x, p, TOL, t_end=0.7)
    assert np.array_equal(lanes.status, expected.status)
    assert lanes.status[5] == ns.Status.NOT_FINITE
    rest = np.arange(64) != 5
    assert np.abs(lanes.x - expected.x)[rest].max() < 100 * TOL
    ended = lanes.status == ns.Status.REACHED_END
    assert ended.sum() > 50 and np.array_equal(lanes.t[ended], np.full(ended.sum(), 0.7))


def cases_of(kind_of):
    """Reference cases of balls with one kind of load, of which the motion with load is followed."""
    names = [n for n, c in plane.CASES.items() if c["kind"] == "ball" and c["load"] == kind_of]
    runs = [plane.bounce(plane.CASES[n], 1e-13) for n in names]
    x = np.array([run.x[0] for run, _ in runs])
    x[:, 4:6] += x[:, 2:4]
    values = [{k: float(v) for k, v in plane.CASES[n]["parameters"].items()} for n in names]
    system = plane.ball(kind_of, True)
    return names, x, np.array([system.parameter_vector(v) for v in values]), [b for _, b in runs]


@pytest.mark.slow
@pytest.mark.parametrize("tol", [1e-6, 1e-8, 1e-10, 1e-13])
@pytest.mark.parametrize("load", ["contact", "net"])
def test_reference_cases(load, tol):
    names, x, p, begun = cases_of(load)
    options = Options(t_end=20.0, rtol=tol, atol=tol)
    found = lanes_for(plane.ball(load, True), options).run_many(x, p, options, None)
    for i, name in enumerate(names):
        case = plane.CASES[name]
        assert found.words[found.itinerary[i]].replace(" ", "") == case["itinerary"], name
        end = found.x[i].copy()
        end[4:6] -= end[2:4]
        given = [float(v) for v in list(case["lift_off"].values())[:-1]]
        late = [float(t) for _, t in case["events"]][-1] - begun[i] - found.t[i]
        assert max(np.abs(end - given).max(), abs(late)) < (1e-12 if tol == 1e-13 else 100 * tol), (
            name
        )


@pytest.mark.slow
def test_many_random_landings_agree_at_tight_and_loose_tolerances():
    x, p = drawn(1600, 7)
    system, on_line = plane.ball("contact", True), np.arange(1600) % 8 == 5
    agree(*both(system, x, p, 1e-13), 1e-12)
    # Whether h = 0 is passed exactly, or at less than the tolerance from it, a loose tolerance does not tell.
    agree(*both(system, x[~on_line], p[~on_line], 1e-6), 100e-6)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pivoting_disc", "elliptical"])
def test_sets_of_three_and_friction_with_a_grain(kind, monkeypatch):
    rng = np.random.default_rng(0)
    disc = kind == "pivoting_disc"
    case = next(
        c for c in plane.CASES.values() if disc == (c["kind"] == kind) and c["kind"] != "ball"
    )
    if not disc:
        case = plane.CASES["elliptical-friction"]
    system = plane.sliding_body(case)
    x = rng.normal(size=(64, system.dimension))
    fast, slow = both(system, x, system.parameter_vector(), 1e-10, 3.0)
    agree(fast, slow, 1e-8)
    agree(mixed(system, x, system.parameter_vector(), 1e-10, 3.0, 4, monkeypatch)[0], slow, 1e-8)
    assert {"*", "* s"} == set(fast.words) and not fast.status.any()


@pytest.mark.parametrize("kind", ["entry", "exit"])
@pytest.mark.parametrize("tol", [1e-6, 1e-9, 1e-12])
def test_where_sets_are_reached_and_left_is_known_to_the_tolerance(monkeypatch, tol, kind):
    # The last way is taken in one step from where |h| is about the cube root of the tolerance: were its second
    # order wrong or missing, places and times of hits would be off by some 10 tol^(2/3).
    system, (x, p) = plane.ball("contact", True), drawn(400)
    rows = np.arange(400) % 8 < 5
    given = {name: p[rows, i] for i, name in enumerate(system.parameter_names)}
    run = lambda tol: ns.ensemble(
        system, x[rows], 20.0, parameters=given, tol=tol, at_event=(kind, 1)
    )
    fine = run(1e-14)
    monkeypatch.setattr(ensemble, "_FEW_WITH_SETS", 64)
    fast = run(tol)
    assert (fine.engine, fast.engine) == ("core", "lanes")
    assert np.array_equal(fast.itinerary, fine.itinerary)
    reached = np.isfinite(fine.event_t)
    size = 1 + np.abs(fine.event_x[reached]).max(axis=1)
    error = np.abs(fast.event_x - fine.event_x)[reached].max(axis=1) / size
    late = np.abs(fast.event_t - fine.event_t)[reached] / (1 + fine.event_t[reached])
    assert reached.sum() > 100
    assert max(error.max(), late.max()) < 2 * tol


@pytest.mark.parametrize("offset", [1e-3, 1e-5, 1e-7, -1e-8])
def test_direction_of_slip_however_small(offset):
    # As in test_plane_friction: slip at the end is quadratic in the offset.
    line = np.array([np.cos(0.7), np.sin(0.7)])
    w = 0.5505198964669  # its last slip is about zero
    p = {"mu": 0.3, "d1": 0.1, "d2": 0.1, "eta": 0.5, "G": 1e-4, "k": 0.4}
    system = plane.ball("contact", True)
    x = np.array([[0.0, 0.0, *0.2 * line, *(0.2 + w + offset) * line, 0.0, -1.0]])
    options = Options(t_end=20.0, rtol=1e-9, atol=1e-9)
    found = lanes_for(system, options).run_many(x, system.parameter_vector(p), options, None)
    h = found.x[0, 4:6]
    assert found.words == ["* s *"] and found.totals[2] <= (abs(offset) < 1e-6)
    assert abs(h @ [-line[1], line[0]]) < 1e-5 * np.linalg.norm(h)
    assert np.sign(h @ line) == np.sign(offset)


def test_what_has_no_lanes():
    v, z = plane.columns("v1", "v2"), ca.SX.sym("z")
    pair, lam = ca.vertcat(*plane.columns("l1", "l2")), ca.SX.sym("lam")
    options = Options(t_end=1.0)
    several = ns.FilippovSystem(
        [*v, z],
        field=[-pair[0], -pair[1], -lam],
        surfaces=[ca.vertcat(*v), z],
        multipliers=[pair, lam],
    )
    assert lanes_for(several, options) is None
    one = ns.FilippovSystem(
        v, field=[-pair[0], -pair[1]], surfaces=[ca.vertcat(*v)], multipliers=[pair]
    )
    assert lanes_for(one, options) is not None
    assert lanes_for(one, Options(t_end=1.0, start_mode="s")) is None
