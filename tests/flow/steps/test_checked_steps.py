"""A step is accepted only when the field and the guards agree with its polynomials: nothing that lies
between, however flat the series at the start, is jumped over."""

import casadi as ca
import numpy as np
import pytest

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
    """x grows like exp(3 t): at 1e307 the steps of a point without derivatives continued for minutes."""
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


def test_rows_that_rest_stay():
    starts = np.random.default_rng(1).normal(size=(100, 2))
    system = ns.FilippovSystem([y, v], surface=v, above=[v, -y - 0.27], below=[v, 0.27 - y])
    early, late = [
        ns.ensemble(system, starts, t_end, work=ns.Work(progress=False)) for t_end in (60.0, 1e12)
    ]
    assert early.engine == "lanes" and late.itinerary.tolist() == early.itinerary.tolist()
    np.testing.assert_allclose(late.x, early.x, rtol=0, atol=1e-12)
