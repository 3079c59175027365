"""A step is accepted only when the field and the guards agree with its polynomials: nothing that lies
between, however flat the series at the start, is jumped over."""

import casadi as ca
import numpy as np
import pytest
from mpmath import mp, quad

import nonsmooth as ns

x, y, v, t, lam = (ca.SX.sym(s) for s in ("x", "y", "v", "t", "lam"))

one_and_many = pytest.mark.parametrize("many", [False, True], ids=["one", "many"])


def end(system, start, t_end, many, tol=1e-10, **options):
    """Last state and status of a run alone or in an ensemble."""
    if many:
        starts = np.tile(np.array(start, float), (100, 1))
        found = ns.ensemble(system, starts, t_end, tol=tol, work=ns.Work(progress=False), **options)
        assert np.array_equal(found.x, np.tile(found.x[0], (100, 1)), equal_nan=True)
        return found.x[0], ns.Status(int(found.status[0])), found.itinerary[0]
    run = ns.simulate(system, start, t_end, tol=tol, **options)
    return run.x[-1], run.status, run.itinerary


def swept(f):
    """x' = 1, y' = f(x)."""
    return ns.FilippovSystem([x, y], field=[1, f(x)])


def integral(f, low, high, *breaks):
    with mp.workdps(30):
        return float(quad(f, [low, *breaks, high]))


FLAT_AT_THE_START = {
    "x^20": (lambda u: u**20, 2.0, 2.0**21 / 21, 1e-10),
    "x^12 at 1e-6": (lambda u: u**12, 2.0, 2.0**13 / 13, 1e-6),
    "x^8 at 1e-3": (lambda u: u**8, 2.0, 2.0**9 / 9, 1e-3),
    "x^34 at 1e-14": (lambda u: u**34, 1.5, 1.5**35 / 35, 1e-14),
    "tanh": (lambda u: ca.tanh(u - 50), 100.0, 0.0, 1e-10),
    "plateau": (
        lambda u: 1 / (1 + (u / 50) ** 40),
        100.0,
        integral(lambda u: 1 / (1 + (u / 50) ** 40), 0, 100, 40, 50, 60),
        1e-10,
    ),
    "pulse": (lambda u: ca.exp(-((u - 50) ** 2) / 2), 100.0, (2 * np.pi) ** 0.5, 1e-10),
    "thin pulse": (
        lambda u: ca.exp(-(((u - 80) / 0.7) ** 2) / 2),
        100.0,
        0.7 * (2 * np.pi) ** 0.5,
        1e-10,
    ),
    "late pulse": (
        lambda u: ca.exp(-(((u - 5e5) / 3e4) ** 2) / 2),
        1e6,
        3e4 * (2 * np.pi) ** 0.5,
        1e-10,
    ),
    "flat point": (
        lambda u: ca.exp(-1 / ((u - 1) ** 2 + 1e-12)),
        2.0,
        integral(lambda u: mp.exp(-1 / ((u - 1) ** 2 + mp.mpf("1e-12"))), 0, 2, 0.9, 1, 1.1),
        1e-10,
    ),
}


@one_and_many
@pytest.mark.parametrize("name", FLAT_AT_THE_START)
def test_what_the_series_at_the_start_does_not_see_is_integrated(name, many):
    f, t_end, truth, tol = FLAT_AT_THE_START[name]
    state, status, _ = end(swept(f), [0.0, 0.0], t_end, many, tol)
    assert status is ns.Status.REACHED_END
    assert abs(state[1] - truth) <= 100 * tol * max(1.0, t_end, abs(truth))


@pytest.mark.slow_cases("many")
@one_and_many
def test_a_block_that_sticks_is_moved_by_a_load_that_comes_late(many):
    """Friction .4 under the load 3 exp(-(t - 30)^2): it breaks away, overshoots and sticks again."""
    load = 3 * ca.exp(-((t - 30) ** 2))
    system = ns.FilippovSystem(
        [x, v], field=[v, load - x - 0.4 * lam], multipliers=lam, surface=v, time=t
    )
    _, _, itinerary = end(system, [0.0, 0.0], 60.0, many)
    assert itinerary == "s + - + - + s"
    assert itinerary == end(system, [0.0, 0.0], 60.0, many, max_step=0.5)[2]


@one_and_many
def test_a_stop_inside_a_pulse_is_met(many):
    pulse = ca.exp(-((x - 50) ** 2) / 2)
    system = ns.FilippovSystem([x], field=[1], stops=[ns.Stop(pulse - 0.5, name="pulse")])
    state, status, _ = end(system, [0.0], 100.0, many)
    assert status is ns.Status.STOPPED
    assert abs(state[0] - (50 - (2 * np.log(2)) ** 0.5)) < 1e-9


@pytest.mark.slow_cases("many")
@one_and_many
def test_a_surface_inside_a_pulse_is_crossed(many):
    """Twice, upward and downward; between, y falls at the rate 2."""
    surface = ca.exp(-((x - 50) ** 2) / 2) - 0.5
    system = ns.FilippovSystem([x, y], surface=surface, above=[1, -2], below=[1, 0])
    state, _, itinerary = end(system, [0.0, 0.0], 100.0, many)
    assert itinerary == "- + -"
    assert abs(state[1] + 4 * (2 * np.log(2)) ** 0.5) < 1e-8


def test_max_step_excludes_what_the_checks_cannot_see():
    """A pulse a thousand times thinner than the time until it comes."""
    system = swept(lambda u: ca.exp(-(((u - 50) / 0.01) ** 2) / 2))
    truth = 0.01 * (2 * np.pi) ** 0.5
    run = ns.simulate(system, [0.0, 0.0], 100.0, max_step=0.05)
    assert abs(run.x[-1, 1] - truth) < 1e-9


def test_polynomial_motion_is_not_slowed_down():
    """Linear fields and guards need no check: their series have no more than their coefficients."""
    system = ns.FilippovSystem([y, v], field=[v, -9.81], stops=[ns.Stop(y, direction=-1)])
    run = ns.simulate(system, [1.0, 0.0], 1e6)
    assert len(run.t) == 2 and run.status is ns.Status.STOPPED


@pytest.mark.parametrize("t_end", [1e3, 1e10, 3e18, 1e19, 1e30, 1e300])
@pytest.mark.parametrize("tol", [1e-6, 1e-10, 1e-15])
@one_and_many
def test_a_late_end_loses_no_event(many, tol, t_end):
    """A falling body meets the ground however far the end of the run is."""
    stop = ns.Stop(y, direction=-1)
    system = ns.FilippovSystem([y, v], field=[v, -9.81], stops=[stop])
    state, status, _ = end(system, [1.0, 0.0], t_end, many, tol)
    assert status is ns.Status.STOPPED
    assert abs(state[1] + (2 * 9.81) ** 0.5) < 1e-12


@pytest.mark.parametrize("slow", [0.0, 0.3])
def test_what_rests_stays(slow):
    """Rounding in the multiplier that holds a block is no force."""
    starts = np.random.default_rng(1).normal(size=(20, 2))
    by_fields = ns.FilippovSystem(
        [y, v], surface=v - slow, above=[v - slow, -y - 0.27], below=[v - slow, 0.27 - y]
    )
    lam = ca.SX.sym("lam")
    by_law = ns.FilippovSystem(
        [y, v], surface=2 * v - 2 * slow, multipliers=lam, field=[v - slow, -y - 0.27 * lam]
    )
    for system in (by_fields, by_law):
        for start in starts:
            early, *late = [ns.simulate(system, start, t_end) for t_end in (60.0, 1e6, 1e12)]
            for run in late:
                assert run.itinerary == early.itinerary
                np.testing.assert_allclose(run.x[-1], early.x[-1], rtol=0, atol=1e-12)


@one_and_many
def test_a_late_end_loses_no_reset_and_no_surface(many):
    for tol in (1e-10, 1e-14):
        friction = ns.FilippovSystem([y, v], surface=v, above=[v, -y - 0.3], below=[v, 0.3 - y])
        state, status, itinerary = end(friction, [1.0, 0.0], 1e30, many, tol)
        assert status is ns.Status.REACHED_END and itinerary == "- + s"
        assert state[1] == 0.0 and abs(state[0] + 0.2) < 1e3 * tol
    hop = ns.Reset(y, [y, 0.0 * v, ca.SX(0)], direction=-1)
    z = ca.SX.sym("z")
    system = ns.FilippovSystem([y, v, z], field=[v, -9.81 * z, 0], resets=[hop])
    state, _, _ = end(system, [1.0, 0.0, 1.0], 1e20, many)
    assert abs(state[0]) < 1e-12 and state[1] == 0.0
    relay = ns.FilippovSystem([x], surface=x, above=[-1], below=[1])
    for t_end in (1e20, 1e30, 1e200):
        state, status, itinerary = end(relay, [3.0], t_end, many)
        assert status is ns.Status.REACHED_END
        assert itinerary == "+ s" and abs(state[0]) < 1e-12


@one_and_many
@pytest.mark.parametrize("f", [ca.log, lambda u: ca.log1p(u - 1), lambda u: ca.atanh(1 - u)])
def test_a_field_that_ends_is_not_called_complete(f, many):
    """x' = -1, y' = f(x) with a singularity at x = 0, which the run would pass."""
    system = ns.FilippovSystem([x, y], field=[-1, f(x)])
    state, status, _ = end(system, [1.0, 0.0], 2.0, many)
    assert status in (ns.Status.NOT_FINITE, ns.Status.STEP_TOO_SMALL)
    assert np.all(np.isfinite(state)) and -1e-9 < state[0] < 1e-6


@pytest.mark.slow_cases("many")
@one_and_many
def test_states_that_are_not_finite_end_the_run(many):
    """Sliding along a surface to which both fields are parallel; and a blow-up at infinity."""
    system = ns.FilippovSystem([x, y], surface=y, above=[1, 0], below=[2, 0])
    state, status, _ = end(system, [0.0, 0.0], 1.0, many)
    assert status in (ns.Status.NOT_FINITE, ns.Status.NON_UNIQUE)
    assert np.all(np.isfinite(state))
    grows = ns.FilippovSystem([x], field=[x])
    state, status, _ = end(grows, [1.0], 1e300, many)
    assert status is ns.Status.NOT_FINITE and np.all(np.isfinite(state))


def test_a_run_ends_where_derivatives_of_large_states_are_no_numbers():
    """x grows like exp(3 t): at 1e307 the steps of a point without derivatives went on for minutes."""
    system = ns.FilippovSystem([x, y], surface=x, above=[y + x, 3 * y], below=[y + x, 3 * y])
    start, least = [1.0, 0.3], np.log(1e300) / 3
    run = ns.simulate(system, start, 1000.0, max_steps=2000)
    assert run.status is ns.Status.NOT_FINITE and least < run.t[-1] < np.log(1e310) / 3


@pytest.mark.slow_cases("100000000.0-ensemble", "-1000000000.0-ensemble")
@one_and_many
@pytest.mark.parametrize("far", [1e8, -1e9])
def test_far_from_zero_rounding_is_no_defect(far, many):
    """cos of a time or a state of 1e9 is known to 1e-7 only: no step of it agrees better."""
    clock = ns.FilippovSystem([y], field=[ca.cos(t - far)], time=t)
    state, status, _ = end(clock, [0.0], far + 5.0, many, t_start=far)
    assert status is ns.Status.REACHED_END and abs(state[0] - np.sin(5.0)) < 1e-15 * abs(far)
    moved = ns.FilippovSystem([x, y], field=[1, ca.cos(x - far)])
    state, status, _ = end(moved, [far, 0.0], 5.0, many)
    assert status is ns.Status.REACHED_END and abs(state[1] - np.sin(5.0)) < 1e-15 * abs(far)


@pytest.mark.slow_cases("many")
@one_and_many
def test_a_field_whose_first_steps_are_all_too_long_has_no_branch_point(many):
    """x^40 grows by more than its series shows at every step; in units of 1e9 its coefficients are below
    the least double."""
    far = swept(lambda u: (u / 1e9) ** 40)
    state, status, _ = end(far, [0.0, 0.0], 2e9, many)
    assert status is ns.Status.REACHED_END and state[1] == pytest.approx(
        1e9 * 2.0**41 / 41, rel=1e-8
    )


def test_rows_that_rest_stay():
    starts = np.random.default_rng(1).normal(size=(100, 2))
    system = ns.FilippovSystem([y, v], surface=v, above=[v, -y - 0.27], below=[v, 0.27 - y])
    early, late = [
        ns.ensemble(system, starts, t_end, work=ns.Work(progress=False)) for t_end in (60.0, 1e12)
    ]
    assert early.engine == "lanes" and late.itinerary.tolist() == early.itinerary.tolist()
    np.testing.assert_allclose(late.x, early.x, rtol=0, atol=1e-12)
