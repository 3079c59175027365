"""Samples at sections, periods and given times are those of closed forms."""

import math

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, v, t, w, lam = (ca.SX.sym(s) for s in ("x", "v", "t", "w", "lam"))
TWO_SPRINGS = ns.FilippovSystem([x, v], surface=x, above=[v, -x], below=[v, -4 * x])
FALL = ns.FilippovSystem(
    [x, v], field=[v, -2], resets=ns.Reset(x, [x, -v], direction=-1, name="floor")
)
FORCED = ns.FilippovSystem([x], field=[ca.cos(w * t)], parameters={w: 2.0}, time=t)


@pytest.fixture(params=["simulate", "ensemble"])
def sample(request):
    """One run by ``simulate`` or in an ensemble, where the others have other starts."""

    def run(system, start, t_end, **options):
        if request.param == "simulate":
            found = ns.simulate(system, start, t_end, **options)
            return found.sample_t, found.sample_x, found
        starts = np.array([np.multiply(start, 1.1), start, np.full(len(start), np.nan)])
        found = ns.ensemble(system, starts, t_end, work=ns.Work(threads=1), **options)
        assert np.isnan(found.sample_x[2]).all() and np.isnan(found.sample_t[2]).all()
        return found.sample_t[1], found.sample_x[1], found

    return run


def test_crossings_of_a_surface_in_one_direction(sample):
    # half a period of each spring: pi above, pi/2 below; speed is kept
    at = ns.Section("h0", direction=1, count=3)
    times, states, _ = sample(TWO_SPRINGS, [0.0, 1.0], 100.0, at=at)
    assert np.allclose(times, 1.5 * math.pi * np.arange(1, 4), rtol=0, atol=1e-8)
    assert np.allclose(states, [[0, 1]] * 3, rtol=0, atol=1e-8)
    falling = ns.Section("h0", direction=-1, count=2)
    times, states, _ = sample(TWO_SPRINGS, [0.0, 1.0], 100.0, at=falling)
    assert np.allclose(times, math.pi * np.array([1, 2.5]), rtol=0, atol=1e-8)
    assert np.allclose(states[:, 1], -1, rtol=0, atol=1e-8)


def test_an_expression_in_states_is_a_section_and_its_start_is_no_hit(sample):
    # on the circle x**2 + v**2 = 1 above, the ellipse 4 x**2 + v**2 = 1 below: v = 0 at x = -1/2
    at = ns.Section(v, direction=1, count=3)
    times, states, _ = sample(TWO_SPRINGS, [-0.5, 0.0], 100.0, at=at)
    assert np.allclose(times, 1.5 * math.pi * np.arange(1, 4), rtol=0, atol=1e-8)
    assert np.allclose(states, [[-0.5, 0.0]] * 3, rtol=0, atol=1e-8)
    with pytest.raises(ns.DefinitionError, match="section"):
        sample(TWO_SPRINGS, [-0.5, 0.0], 1.0, at=ns.Section(v - w, count=1))


def test_impacts_and_contacts_are_sections(sample):
    # speed halves at each impact: the flights last 2, 1, 1/2, ... after a fall of 1
    ball = ns.FilippovSystem([x, v], field=[v, -2], impacts=ns.Impact(x, restitution=0.5))
    at = ns.Section("impact", count=3, after=True)
    times, states, _ = sample(ball, [1.0, 0.0], 10.0, at=at)
    assert np.allclose(times, [1.0, 2.0, 2.5], rtol=0, atol=1e-9)
    assert np.allclose(states, [[0, 1], [0, 0.5], [0, 0.25]], rtol=0, atol=1e-9)
    times, states, _ = sample(ball, [1.0, 0.0], 10.0, at=ns.Section("contact", count=1))
    assert np.allclose(times, [3.0], rtol=0, atol=1e-6) and np.allclose(states, 0.0, atol=1e-6)


def test_a_section_written_as_a_surface_is_that_surface_where_motion_may_slide():
    dry = ns.FilippovSystem([x, v], surface=v - 0.3, multipliers=lam, field=[v, -x - 0.4 * lam])
    plain = ns.simulate(dry, [0.0, 0.0], 20.0)
    entries = [e.t for e in plain.events if e.kind == "entry"]
    for section in (ns.Section(v - 0.3, direction=1), ns.Section(0.3 - v, direction=-1)):
        run = ns.simulate(dry, [0.0, 0.0], 20.0, at=section)
        assert run.sample_t.tolist() == entries and run.itinerary == plain.itinerary
    away = ns.simulate(dry, [0.0, 0.0], 20.0, at=ns.Section(0.3 - v, direction=1))
    assert away.sample_t.tolist() == [e.t for e in plain.events if e.mode_before == "+"]


def test_every_third_hit_after_two_that_are_passed_over(sample):
    # from rest at the height 1 the ball lands at 1, 3, 5, ... with the speed 2
    at = ns.Section("floor", every=3, skip=2, count=2, after=True)
    times, states, run = sample(FALL, [1.0, 0.0], 100.0, at=at)
    assert np.allclose(times, [9, 15], rtol=0, atol=1e-8)
    assert np.allclose(states, [[0, 2], [0, 2]], rtol=0, atol=1e-8)
    status = run.status if np.ndim(run.status) == 0 else run.status[1]
    assert status == ns.Status.STOPPED
    before = ns.Section("reset", count=1)
    assert np.allclose(sample(FALL, [1.0, 0.0], 9.0, at=before)[1], [[0, -2]])


def test_states_at_given_times_also_at_both_ends_and_after_a_jump(sample):
    given = [0.0, 0.5, 1.5, 2.0, 3.5]
    times, states, _ = sample(FALL, [1.0, 0.0], 3.5, t_eval=given)
    heights = [1.0, 0.75, 0.75, 1.0, 0.75]
    assert np.array_equal(times, given)
    assert np.allclose(states[:, 0], heights, rtol=0, atol=1e-9)


def test_times_after_the_end_of_a_run_are_nan():
    ends = ns.FilippovSystem([x], field=[1], stops=ns.Stop(x - 1))
    run = ns.simulate(ends, [0.0], 3.0, t_eval=[0.5, 1.0, 1.5])
    assert np.allclose(run.sample_x[:2, 0], [0.5, 1.0]) and np.isnan(run.sample_x[2, 0])
    many = ns.ensemble(ends, [[0.0], [0.7]], 3.0, t_eval=[0.5, 1.0, 1.5])
    assert np.array_equal(many.sample_x[0], run.sample_x, equal_nan=True)
    assert np.isnan(many.sample_t[1]).tolist() == [True, True, True]


def test_a_period_may_depend_on_parameters():
    # x = sin(w t)/w is back at zero after each period, half way up a quarter later
    values = np.array([2.0, 3.0, np.nan])
    many = ns.ensemble(FORCED, [[0.0]], 10.0, parameters={"w": values}, at=2 * ca.pi / w)
    assert many.sample_t.shape == (1, 3, 4) or many.sample_t.shape == (3, 4)
    times = many.sample_t.reshape(3, 4)
    assert np.allclose(times[0, :3], math.pi * np.array([1, 2, 3])) and np.isnan(times[0, 3])
    assert np.allclose(times[1], 2 * math.pi / 3 * np.arange(1, 5))
    assert np.nanmax(np.abs(many.sample_x)) < 1e-9 and np.isnan(times[2]).all()
    run = ns.simulate(FORCED, [0.0], 10.0, at=ns.Section(math.pi / 4, every=4, skip=1, count=2))
    assert np.allclose(run.sample_t, math.pi / 4 * np.array([5, 9])) and run.t[-1] < 7.1
    assert np.allclose(run.sample_x, 0.5, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_chunks_agree_on_hits_of_random_runs():
    dry = ns.FilippovSystem(
        [x, v],
        surface=v - 0.3,
        multipliers=lam,
        field=[v, ca.cos(1.3 * t) - x - 0.4 * lam],
        time=t,
        stops=ns.Stop(x - 3, name="wall"),
    )
    starts = np.random.default_rng(0).normal(size=(70, 2))
    for at in (ns.Section("entry", count=4), ns.Section("h0", direction=-1, count=3)):
        every = ns.ensemble(dry, starts, 20.0, at=at)
        small = ns.ensemble(dry, starts, 20.0, at=at, work=ns.Work(threads=2, chunk=7))
        assert np.array_equal(small.sample_x, every.sample_x, equal_nan=True)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"at": "h1"}, r"^at .*\['h0'\]"),
        ({"at": "end"}, "^at "),
        ({"at": -1.0}, "^period"),
        ({"at": [x]}, "^at "),
        ({"at": 50.0}, "^at .* 1 periods"),
        ({"at": ns.Section("entry", direction=1)}, "^direction"),
        ({"at": ns.Section(1.0, after=True)}, "^at .*direction="),
        ({"at": "h0", "t_eval": [1.0]}, "^t_eval and at"),
        ({"t_eval": [[1.0]]}, r"^t_eval .*\(1, 1\)"),
        ({"t_eval": [2.0, 1.0]}, "^t_eval .* decrease"),
        ({"t_eval": [0.0, 11.0]}, "^t_eval .* 11.0"),
        ({"t_eval": [math.nan]}, "^t_eval .* finite"),
        ({"t_eval": "all"}, "^t_eval .*'all'"),
    ],
)
def test_bad_requests_are_refused_by_name(options, message):
    for run in (ns.simulate, ns.ensemble):
        with pytest.raises(ns.OptionError, match=message):
            run(TWO_SPRINGS, [0.0, 1.0], 10.0, **options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"direction": 2}, "^direction"),
        ({"every": 0}, "^every"),
        ({"skip": -1}, "^skip"),
        ({"count": 0.5}, "^count"),
    ],
)
def test_bad_sections_are_refused(options, message):
    with pytest.raises(ns.OptionError, match=message):
        ns.Section("h0", **options)


def test_an_ensemble_must_know_how_many_samples_to_keep():
    with pytest.raises(ns.OptionError, match="count"):
        ns.ensemble(TWO_SPRINGS, [0.0, 1.0], 10.0, at="h0")


def test_events_that_share_a_name_are_hits_of_it() -> None:
    """Between walls at -1 and 1, the second of them not named, or all three named alike."""
    walls = [ns.Impact(1 - x, restitution=0.5), ns.Impact(x + 1, restitution=0.9)]
    system = ns.FilippovSystem([x, v], field=[v, 0 * v], impacts=walls)
    times = [0.9 / 1.3, 0.9 / 1.3 + 2 / 0.65]
    run = ns.simulate(system, [0.1, 1.3], 6.0, at="impact")
    assert run.sample_t == pytest.approx(times, abs=1e-12)
    second = ns.simulate(system, [0.1, 1.3], 6.0, at="impact 2")
    assert second.sample_t == pytest.approx(times[1:], abs=1e-12)
    named = ns.FilippovSystem(
        [x, v],
        field=[v, 0 * v],
        impacts=[ns.Impact(1 - x, restitution=0.5, name="w")],
        resets=[ns.Reset(x + 1, [x, -0.9 * v], direction=-1, name="w")],
    )
    run = ns.simulate(named, [0.1, 1.3], 6.0, at="w")
    assert run.sample_t == pytest.approx(times, abs=1e-12)


def test_a_section_of_ones_own_is_not_a_reset_called_section() -> None:
    kick = ns.Reset(x, [x, 2 * v], direction=1, name="section")
    system = ns.FilippovSystem([x, v], field=[v, 0 * v], resets=[kick])
    run = ns.simulate(system, [-1.0, 1.0], 3.0, at=x - 1)
    assert run.sample_t == pytest.approx([1.5], abs=1e-12)


def test_sections_beside_a_set_of_codimension_two() -> None:
    """A puck on a turning frame, v = (1 - mu t) (cos t, sin t), and a harmonic oscillator z = cos t."""
    v1, v2, z, w = (ca.SX.sym(name) for name in ("v1", "v2", "z", "w"))
    lam, one = ca.vertcat(ca.SX.sym("l1"), ca.SX.sym("l2")), ca.SX.sym("one")
    system = ns.FilippovSystem(
        [v1, v2, z, w],
        field=[-v2 - 0.1 * lam[0], v1 - 0.1 * lam[1], w, -z + 0 * one],
        surfaces=[ca.vertcat(v1, v2), z],
        multipliers=[lam, one],
    )
    quarters = np.pi * np.array([0.5, 1.5, 2.5])
    run = lambda at: ns.simulate(system, [1.0, 0.0, 1.0, 0.0], 9.5, at=at, tol=1e-12)
    for at in (z, -z, "h1", v1):
        assert run(at).sample_t == pytest.approx(quarters, abs=1e-9)
    for at in (ns.Section(z, 1), ns.Section(-z, -1), ns.Section("h1", 1), ns.Section(v1, 1)):
        assert run(at).sample_t == pytest.approx(quarters[1:2], abs=1e-9)
    many = ns.ensemble(system, [[1.0, 0.0, 1.0, 0.0]], 9.5, at=ns.Section(z, 1, count=1))
    assert many.sample_t[0] == pytest.approx(quarters[1:2], abs=1e-9)
    with pytest.raises(ns.OptionError, match=r"^at .*\['h0', 'h1'\]"):
        ns.simulate(system, [1.0, 0.0, 1.0, 0.0], 9.5, at="h2")
    with pytest.raises(ns.OptionError, match=r"^direction"):
        ns.simulate(system, [1.0, 0.0, 1.0, 0.0], 9.5, at=ns.Section("h0", direction=1))


def test_more_hits_than_any_run_has_are_not_reached() -> None:
    """Numbers beyond those of C, where they became others, and zero."""
    relay = ns.FilippovSystem([x, v], surface=v, above=[v, -x - 0.1], below=[v, -x + 0.1])
    run = lambda at: ns.simulate(relay, [1.05, 0.0], 10.0, at=at)
    hits = run("crossing").sample_t
    assert len(hits) > 2
    sections = {"every": 2**64, "skip": 2**64}, {"every": 2**64 + 1}, {"skip": 2**63}
    for options in sections:
        assert run(ns.Section("crossing", **options)).sample_t.size == 0
    for options in {"count": 2**62}, {"count": 2**62, "every": 4}, {"count": 2**64 + 1}:
        found = run(ns.Section("crossing", **options))
        assert found.status is ns.Status.REACHED_END
        assert (
            found.sample_t.tolist()
            == hits[options.get("every", 1) - 1 :: options.get("every", 1)].tolist()
        )
    for count in 2**63, 2**64 + 1:
        many = ns.ensemble(relay, [[1.05, 0.0]] * 2, 10.0, at_event=("crossing", count))
        assert np.isnan(many.event_t).all()
