"""Every kind of event and status is reached where the closed form says, and never by a guess."""

from fractions import Fraction

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, z, v, t, lam, kap = (ca.SX.sym(s) for s in ("x", "y", "z", "v", "t", "lam", "kap"))


def relay(**options):
    return ns.FilippovSystem(
        [x, y], field=[y, -x - 0.4 * lam], multipliers=lam, surface=y, **options
    )


def events(run, kind=None):
    return [e for e in run.events if kind is None or e.kind == kind]


def test_tangent_exit_is_not_pushed_off_the_surface():
    """Just after the fold the orbit is on the parabola z = s^2/2, at every scale of s."""
    system = ns.FilippovSystem([x, z], surface=z, above=[1, x - 1], below=[1, x + 1])
    run = ns.simulate(system, [0.0, 0.0], 3.0)
    for s in (1e-2, 1e-4, 1e-6):
        assert run(1.0 + s)[1] == pytest.approx(s * s / 2, rel=1e-6, abs=1e-16)


def test_sliding_into_a_mixed_two_fold_is_not_taken_for_an_exit():
    """mix-C, sigma = (+, +), nu = (-3, -1/2): a whole sector reaches s, none of it leaves there."""
    system = ns.FilippovSystem([x, y, z], surface=x, above=[-y, -1, -3], below=[z, -0.5, 1])
    for angle in np.linspace(0.05, np.arctan(2.0) - 0.05, 12):  # below the strong canard, slope 2
        start = [0.0, np.cos(angle), np.sin(angle)]
        run = ns.simulate(system, start, 10.0)
        assert run.status is ns.Status.NON_UNIQUE and run.itinerary == "s"
        np.testing.assert_allclose(run.x[-1], 0.0, atol=1e-8)


def test_several_surfaces_switch_independently():
    """Two uncoupled oscillators with friction: the same events as two separate runs."""
    w = ca.SX.sym("w")
    both = ns.FilippovSystem(
        [x, y, z, w],
        field=[y, -x - 0.4 * lam, w, -2 * z - 0.1 * kap],
        multipliers=[lam, kap],
        surfaces=[y, w],
    )
    one = ns.FilippovSystem([z, w], field=[w, -2 * z - 0.1 * kap], multipliers=kap, surface=w)
    t_end = 12.0  # before either comes to rest
    run = ns.simulate(both, [3.0, 0.0, 1.0, 0.0], t_end, tol=1e-12)
    a = ns.simulate(relay(), [3.0, 0.0], t_end, tol=1e-12)
    b = ns.simulate(one, [1.0, 0.0], t_end, tol=1e-12)
    np.testing.assert_allclose(run.x[-1], np.r_[a.x[-1], b.x[-1]], atol=1e-10)
    times = sorted(
        [e.t for e in a.events if e.kind != "end"] + [e.t for e in b.events if e.kind != "end"]
    )
    np.testing.assert_allclose([e.t for e in run.events[:-1]], times, atol=1e-10)


def rows(start):
    """Starts that are all the same, enough for lanes."""
    return np.tile(start, (100, 1))


@pytest.mark.parametrize(
    ("m", "tol"),
    [
        *[(2, 1e-4), (3, 1e-13)],
        *[pytest.param(2, tol, marks=pytest.mark.slow) for tol in (1e-7, 1e-10, 1e-13)],
        *[pytest.param(3, tol, marks=pytest.mark.slow) for tol in (1e-4, 1e-7, 1e-10)],
    ],
)
def test_a_polynomial_does_not_pass_a_branch_point(m, tol):
    """x' = -x^(1 - 1/m) from 1 is (1 - t/m)^m, a polynomial, to t = m; beyond, x stays 0."""
    power = ca.sqrt(x) if m == 2 else x ** (1 - 1 / m)
    system = ns.FilippovSystem([x, y], field=[-power, 1], surface=y - 4, multipliers=lam)
    run = ns.simulate(system, [1.0, 0.0], 5.0, tol=tol)
    exact = np.maximum(0.0, 1 - run.t / m) ** m
    assert run.status is ns.Status.STEP_TOO_SMALL and "root" in run.message
    assert np.max(np.abs(run.x[:, 0] - exact)) < 10 * tol
    assert run.t[-1] > m * (1 - 2 * tol ** (1 / m))
    many = ns.ensemble(system, rows([1.0, 0.0]), 5.0, tol=tol)
    assert set(many.status) == {ns.Status.STEP_TOO_SMALL}
    assert np.max(np.abs(many.x - run.x[-1])) < 10 * tol
    before = ns.simulate(system, [1.0, 0.0], 1.5, tol=tol)
    assert before.x[-1, 0] == pytest.approx((1 - 1.5 / m) ** m, abs=tol)


def test_super_twisting_control_rests_at_its_limit():
    """s' = v - k1 sqrt|s| sgn s, v' = -k2 sgn s: linear in sqrt|s|, v and the time int dt/(2 sqrt|s|),
    so that v is multiplied by -exp(-pi k1 / sqrt(8 k2 - k1^2)) from crossing to crossing."""
    k1, k2 = 1.5, 1.1
    system = ns.FilippovSystem(
        [x, v], surface=x, above=[v - k1 * ca.sqrt(x), -k2], below=[v + k1 * ca.sqrt(-x), k2]
    )
    ratio = np.exp(-np.pi * k1 / np.sqrt(8 * k2 - k1**2))
    run = ns.simulate(system, [1.0, 0.5], 10.0)
    assert run.status is ns.Status.REACHED_END and np.abs(run.x[-1]).max() < 1e-12
    (rest,) = events(run, "rest")
    crossed = np.array([e.x[1] for e in events(run, "crossing")])
    np.testing.assert_allclose(crossed[:6], crossed[0] * (-ratio) ** np.arange(6), atol=1e-6)
    first = run.events[0]
    left = abs(first.x[1]) * (1 + ratio) / (k2 * (1 - ratio))
    # v decides by sqrt|s|, and s is known to 1e-10
    assert rest.t == pytest.approx(first.t + left, abs=1e-5)


def test_a_root_on_one_of_several_surfaces_is_passed_as_on_one():
    """Super-twisting control beside an independent body with friction, at the same times."""
    w = ca.SX.sym("w")
    k1, k2 = 1.5, 1.1
    control = [v - k1 * ca.sqrt(ca.fabs(x)) * ca.sign(x), -k2 * ca.sign(x)]
    alone = ns.simulate(ns.FilippovSystem.from_expression([x, v], control), [1.0, 0.5], 10.0)
    beside = ns.FilippovSystem.from_expression([x, v, w], [*control, -0.3 * ca.sign(w)])
    run = ns.simulate(beside, [1.0, 0.5, 5.0], 10.0)
    assert run.status is ns.Status.REACHED_END and np.abs(run.x[-1][:2]).max() < 1e-12
    crossed, expected = events(run, "crossing"), events(alone, "crossing")
    for one, other in zip(crossed[:6], expected[:6], strict=True):
        assert one.t == pytest.approx(other.t, abs=1e-8)
        assert one.x[:2] == pytest.approx(other.x, abs=1e-6)
        assert one.x[2] == pytest.approx(5.0 - 0.3 * one.t)


def test_limits_end_the_run_with_advice():
    run = ns.simulate(relay(), [30.0, 0.0], 1e3, max_events=3)
    assert run.status is ns.Status.TOO_MANY_EVENTS and "max_events" in run.message
    run = ns.simulate(relay(), [30.0, 0.0], 1e3, max_steps=3)
    assert run.status is ns.Status.TOO_MANY_STEPS and len(run.t) == 4


def test_zero_duration():
    run = ns.simulate(relay(), [1.0, 1.0], 0.0)
    assert run.status is ns.Status.REACHED_END and run.x.tolist() == [[1.0, 1.0]]
    assert run([0.0]).tolist() == [[1.0, 1.0]]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tol": 0.0}, "^tol"),
        ({"tol": -1e-6}, "^tol"),
        ({"tol": np.nan}, "^tol"),
        ({"tol": "fine"}, "^tol"),
        ({"atol": 0.0}, "^atol"),
        ({"t_end": -1.0}, "^t_end .*t_start"),
        ({"t_end": np.inf}, "^t_end"),
        ({"max_step": 0.0}, "^max_step"),
        ({"max_events": -1}, "^max_events"),
    ],
)
def test_wrong_options_are_refused(options, message):
    arguments = {"t_end": 1.0, **options}
    with pytest.raises(ns.OptionError, match=message):
        ns.simulate(relay(), [1.0, 0.0], **arguments)


def test_wrong_starts_are_refused():
    with pytest.raises(ns.PointError, match="finite"):
        ns.simulate(relay(), [np.nan, 0.0], 1.0)
    with pytest.raises(ns.PointError, match="shape"):
        ns.simulate(relay(), [1.0, 0.0, 0.0], 1.0)
    with pytest.raises(ns.DefinitionError, match="mode"):
        ns.simulate(relay(), [1.0, 0.0], 1.0, start_mode="++")


def _rounded_steps(start, step, end):
    """What rounding of each sum takes from the way to ``end`` in equal steps."""
    count, state = 0, start
    while abs(end - state) >= abs(step):
        count, state = count + 1, state + step
    return float(Fraction(start) + count * Fraction(step) - Fraction(state))


@pytest.mark.parametrize("offset", [0.0, 1e6, 1e8])
@pytest.mark.parametrize(("direction", "speed"), [(-1, -1.0), (0, -1.0), (0, 1.0), (1, 1.0)])
def test_a_stop_at_the_end_of_a_step_is_reached(offset, direction, speed):
    """Steps of max_step end where the stop is, on either side of it by rounding, or on it."""
    y = ca.SX.sym("y")
    system = ns.FilippovSystem([y], field=[speed], stops=[ns.Stop(y - offset, direction)])
    for step in (0.1, 0.7, 0.3, 0.25):
        starts = offset - speed * step * np.arange(2, 40)[:, None]
        expected = (offset - starts[:, 0]) / speed
        many = ns.ensemble(system, starts, 50 * step, max_step=step, work=ns.Work(progress=False))
        assert np.all(many.status == ns.Status.STOPPED)
        # times are exact, and states are rounded once a step
        drift = [_rounded_steps(start, speed * step, offset) for start in starts[:, 0]]
        found = many.t - np.array(drift) / speed
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 * (1 + offset))
        run = ns.simulate(system, starts[7], 50 * step, max_step=step)
        assert run.status is ns.Status.STOPPED


@pytest.mark.parametrize("step", [0.25, 0.1, 0.01])
def test_a_ball_does_not_fall_through_the_floor_at_the_end_of_a_step(step):
    y, v = ca.SX.sym("y"), ca.SX.sym("v")
    system = ns.FilippovSystem([y, v], field=[v, -1], resets=[ns.Reset(y, [y, -0.8 * v], -1)])
    for n in range(2, 21):
        fall = n * step
        run = ns.simulate(system, [fall**2 / 2, 0.0], 2 * fall, max_step=step)
        assert [e.kind for e in run.events] == ["reset", "end"]
        assert run.events[0].t == pytest.approx(fall, abs=1e-14)
        assert run.x[:, 0].min() > -1e-15


def test_a_run_continues_from_where_its_sliding_ended():
    """Whatever rounding of terms that cancel leaves of a rate that is zero there."""
    a, u = ca.SX.sym("a"), 1000 * x
    large = 7.3 * ca.cos(u) - 7.2 * kap * ca.cos(u)
    system = ns.FilippovSystem(
        [x, v, z],
        field=[1e-4, ca.sin(3 * u) - a * lam * ca.exp(u) + large, -0.01 * kap],
        surfaces=[v, z - 5],
        multipliers=[lam, kap],
        parameters={a: 0.3},
    )
    ended = 0
    for value in np.linspace(0.12, 0.79, 40):
        given = {"a": value}
        run = ns.simulate(system, [-3e-4, 0.0, 9.0], 12.0, parameters=given)
        for event in events(run, "exit"):
            then = ns.simulate(system, event.x, 12.0, t_start=event.t, parameters=given)
            assert then.status is ns.Status.REACHED_END
            assert then.x[-1] == pytest.approx(run.x[-1], abs=1e-8)
            ended += 1
    assert ended > 15
