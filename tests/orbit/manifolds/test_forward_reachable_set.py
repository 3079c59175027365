"""The funnel of a point is its forward-reachable set, checked against closed forms."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import nonsmooth as ns
from nonsmooth.flow.concatenation import forward, join, until
from tests.drawing import at_most

x, y, z, w, t, lam = (ca.SX.sym(s) for s in ("x", "y", "z", "w", "t", "lam"))
SGN = ns.FilippovSystem([x], surface=x, above=[1], below=[-1])


def two_fold(sigma, nu):
    return ns.textbook.two_fold(sigma, nu).system


def continuous(run):
    times = np.linspace(run.t[0], run.t[-1], 801)
    states = run(times)
    assert np.all(np.diff(run.steps.starts) > 0) and len(run.steps.starts) == len(run.steps)
    assert run.segments[0].first == 0 and run.segments[-1].last == len(run.steps.starts)
    np.testing.assert_allclose(run(run.t), run.x, atol=1e-9)
    return np.abs(np.diff(states, axis=0)).max() < 20 * (times[1] - times[0])


def solves(run, system):
    """Between events the derivative of the dense output is the field of the segment's mode."""
    for segment in run.segments:
        if "s" in segment.mode:
            continue
        s = 0.5 * (segment.t_start + segment.t_end)
        slope = (run(s + 1e-6) - run(s - 1e-6)) / 2e-6
        field = system.evaluate(system.field(segment.mode), run(s), t=s).ravel()[: len(slope)]
        np.testing.assert_allclose(slope, field, atol=1e-6)
    return True


# repelling sliding -----------------------------------------------------------------------------


def test_sign_function_fills_a_wedge():
    """x' = sgn x from 0: leaving at tau gives +-(t - tau), and all of |x| <= t is reached."""
    funnel = ns.orbit.funnel(SGN, [0.0], 2.0, samples=41)
    assert len(funnel) == 41 and funnel.t == 0.0 and funnel.past is None
    assert funnel.first_up(2.0)[0] == 2.0 and funnel.first_down(2.0)[0] == -2.0
    assert funnel.longest(2.0)[0] == 0.0
    for departure, end in zip(funnel.departures, funnel(1.7)[:, 0], strict=True):
        sign = {"+": 1, "-": -1, "s": 0}[departure.side]
        assert end == pytest.approx(sign * max(1.7 - departure.t, 0.0), abs=1e-12)
    spread = np.sort(funnel(2.0)[:, 0])
    assert np.diff(spread).max() < 0.11
    assert all(run.status is ns.Status.REACHED_END for run in funnel.trajectories)


def test_times_broadcast():
    funnel = ns.orbit.funnel(SGN, [0.0], 2.0, samples=5)
    assert funnel(1.0).shape == (5, 1)
    assert funnel(np.ones((2, 3))).shape == (5, 2, 3, 1)


@pytest.mark.slow
@given(st.floats(0.1, 3.0), st.floats(0.1, 3.0), st.floats(0.5, 3.0))
@at_most(20)
def test_leaving_speeds_are_those_of_the_two_fields(up, down, t_end):
    """Repelling sliding of (1, up) above and (-1, -down) below drifts at (down - up)/(up + down)."""
    system = ns.FilippovSystem([x, z], surface=z, above=[1, up], below=[-1, -down])
    funnel = ns.orbit.funnel(system, [0.0, 0.0], t_end, samples=9)
    drift = (down - up) / (up + down)
    for departure, end in zip(funnel.departures, funnel(t_end), strict=True):
        late = t_end - departure.t
        flight = {"+": (late, up * late), "-": (-late, -down * late), "s": (0.0, 0.0)}
        a, b = flight[departure.side]
        np.testing.assert_allclose(end, [drift * departure.t + a, b], atol=1e-9)


def test_sliding_ends_at_an_invisible_fold_and_continues():
    """L1 = 1 - x falls to 0 at x = 1, where F2 takes over: unique from there."""
    system = ns.FilippovSystem([x, z], surface=z, above=[1, 1 - x], below=[1, -1])
    funnel = ns.orbit.funnel(system, [0.0, 0.0], 3.0, samples=11)
    assert funnel.longest.itinerary == "s -"
    assert funnel.departures[-1].t == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(funnel.longest.x[-1], [3.0, -2.0], atol=1e-9)
    assert [e.kind for e in funnel.longest.events] == ["exit", "end"]
    assert all(d.t <= 1.0 for d in funnel.departures)
    # Leaving up at tau < 1 it comes back to z = 0 at 2 - tau and crosses.
    for departure, run in zip(funnel.departures, funnel.trajectories, strict=True):
        if departure.side == "+":
            crossing = next(e for e in run.events if e.kind == "crossing")
            assert crossing.t == pytest.approx(2.0 - departure.t, abs=1e-9)


def test_the_motion_that_gets_there_is_the_past():
    """x1 slides down to s = 0 on z = 0, beyond which sliding repels (planar visible fold-fold)."""
    system = ns.FilippovSystem([x, z], surface=z, above=[1, x], below=[1, -x])
    funnel = ns.orbit.funnel(system, [-1.0, 0.0], 3.0, samples=9)
    assert funnel.t == pytest.approx(1.0, abs=1e-9) and funnel.past is not None
    np.testing.assert_allclose(funnel(0.25)[:, 0], -0.75, atol=1e-9)
    for departure, end in zip(funnel.departures, funnel(2.5), strict=True):
        sign = {"+": 1, "-": -1, "s": 0}[departure.side]
        start = departure.t - 1.0
        height = (1.5**2 - start**2) / 2 if sign else 0.0
        np.testing.assert_allclose(end, [1.5, sign * height], atol=1e-8)
    assert {d.t for d in funnel.departures if d.side == "+"} > {funnel.t}


def test_a_run_is_continued():
    run = ns.simulate(SGN, [0.0], 1.0, t_start=0.5)
    funnel = ns.orbit.funnel(run, t_end=2.0, samples=5)
    assert funnel.t == 0.5 and funnel(2.0).max() == 1.5


def test_parameters_and_stops_are_kept():
    a = ca.SX.sym("a")
    system = ns.FilippovSystem(
        [x], surface=x, above=[a], below=[-a], parameters={a: 1.0}, stops=[ns.Stop(x - 1)]
    )
    funnel = ns.orbit.funnel(system, [0.0], 2.0, samples=5, parameters={"a": 2.0})
    assert funnel.first_up.status is ns.Status.STOPPED
    assert funnel.first_up.t[-1] == pytest.approx(0.5)
    assert np.isnan(funnel(1.0)[0, 0]) and funnel(1.0)[2, 0] == pytest.approx(-2.0)
    assert funnel.trajectories[0].parameters == {"a": 2.0}


def test_other_surfaces_keep_their_side():
    l1, l2 = ca.SX.sym("l1"), ca.SX.sym("l2")
    system = ns.FilippovSystem(
        [x, y], surfaces=[x, y - 1], multipliers=[l1, l2], field=[l1, 1 + 0.5 * l2]
    )
    funnel = ns.orbit.funnel(system, [0.0, 0.5], 3.0, samples=9)
    assert funnel.first_up.itinerary == "+- ++"
    assert funnel.longest.itinerary.startswith("s-")
    assert funnel.departures[-1].t == pytest.approx(1.0)  # y = 1 at t = 1
    assert funnel.longest.status is ns.Status.NON_UNIQUE


# two-folds -------------------------------------------------------------------------------------


def test_one_canard_of_a_visible_two_fold():
    """VV-C1, nu = (.5, .5): the canard is z2 = z3 = -t/4; from tau on F1 gives a parabola."""
    funnel = ns.orbit.funnel(two_fold((1, -1), (0.5, 0.5)), [0.0, 0.0, 0.0], 2.0, samples=33)
    assert funnel.two_fold.label == "VV-C1" and len(funnel) == 33
    np.testing.assert_allclose(funnel.longest(1.5), [0.0, -0.375, -0.375], atol=1e-9)
    late = [d.t for d in funnel.departures]
    for tau, departure, run in zip(late, funnel.departures, funnel.trajectories, strict=True):
        s = 2.0 - tau
        c = tau / 4
        expected = {
            "+": (c * s + s * s / 2, -c - s, -c + s / 2),
            "-": (-c * s - s * s / 2, -c + s / 2, -c - s),
            "s": (0.0, -c, -c),
        }[departure.side]
        np.testing.assert_allclose(run.x[-1], expected, atol=1e-8)
        assert continuous(run)
    assert funnel.first_up.itinerary == "+" and funnel.first_down.itinerary == "-"


def test_the_canard_continues_where_it_arrived():
    """From Da along the canard, through s, into Dr: simulate stops at s, the funnel continues."""
    system = two_fold((1, -1), (0.5, 0.5))
    run = ns.simulate(system, [0.0, 0.5, 0.5], 4.0)
    assert run.status is ns.Status.NON_UNIQUE
    funnel = ns.orbit.funnel(run, t_end=4.0)
    assert funnel.t == pytest.approx(2.0, abs=1e-8)
    np.testing.assert_allclose(funnel.longest(3.5), [0.0, -0.375, -0.375], atol=1e-7)
    np.testing.assert_allclose(funnel([0.5, 3.5])[:, 0, 1:], 0.375, atol=1e-9)


@pytest.mark.slow
def test_a_sector_of_canards_of_the_teixeira_singularity():
    """II-C, nu = (-2, -1): every orbit of Dr comes from s, after the time of the formula."""
    system = two_fold((-1, 1), (-2.0, -1.0))
    funnel = ns.orbit.funnel(system, [0.0, 0.3, 0.4], 3.0, samples=60)
    assert funnel.two_fold.label == "II-C" and funnel.t == pytest.approx(1.7)
    sliding = [
        (d, run)
        for d, run in zip(funnel.departures, funnel.trajectories, strict=True)
        if d.side == "s"
    ]
    assert len(sliding) == 5
    slopes = []
    for departure, run in sliding:
        for moment in np.linspace(funnel.t + 1e-3, departure.t - 1e-3, 7):
            assert abs(run(moment)[0]) < 1e-9
            since = -funnel.two_fold.reach_time(run(moment)[1:])
            assert since == pytest.approx(moment - funnel.t, abs=1e-7)
        last = run(departure.t - 1e-3)
        slopes.append(last[2] / last[1])
    assert min(slopes) < 0.1 and max(slopes) > 10.0  # to both folds: a sector, not one line
    assert all(map(continuous, funnel.trajectories))
    assert all(solves(run, system) for run in funnel.trajectories)
    assert {d.side for d in funnel.departures if d.path < 0} == set()  # invisible: none at once


@pytest.mark.slow
def test_faux_canards_leave_into_attracting_sliding():
    """VV-F, nu = (2, 1): from s up, down, or anywhere into Da, where sliding lasts to a fold."""
    funnel = ns.orbit.funnel(two_fold((1, -1), (2.0, 1.0)), [0.0, 0.0, 0.0], 1.0, samples=12)
    sides = [d.side for d in funnel.departures]
    assert sides == ["+", "-"] + ["s"] * 10
    for departure, run in zip(funnel.departures[2:], funnel.trajectories[2:], strict=True):
        moment = 0.5 * departure.t
        assert np.all(run(moment)[1:] > 0)
        assert -funnel.two_fold.reach_time(run(moment)[1:]) == pytest.approx(moment, abs=1e-7)
        assert run.itinerary in ("s +", "s -")


@pytest.mark.parametrize(
    ("sigma", "nu", "members"),
    [
        ((1, 1), (-1.5, 1.5), {"+", "-", "s"}),  # mix-S: a canard and a faux canard
        ((1, 1), (-3.0, -0.5), {"+", "-", "s"}),  # mix-C
        pytest.param((1, 1), (0.5, 3.0), {"+", "s"}, marks=pytest.mark.slow),  # mix-F
        pytest.param(
            (-1, -1), (3.0, 0.5), {"-", "s"}, marks=pytest.mark.slow
        ),  # mix-0 ... or F, with the sides exchanged
        ((1, 1), (0.0, 0.5), {"+"}),  # mix-0
        ((-1, 1), (-0.5, -0.5), {"s"}),  # II-F: one faux canard
    ],
)
def test_every_class_has_the_continuations_of_the_table(sigma, nu, members):
    system = two_fold(sigma, nu)
    funnel = ns.orbit.funnel(system, [0.0, 0.0, 0.0], 0.8, samples=15)
    assert {d.side for d in funnel.departures} == members
    assert all(continuous(run) for run in funnel.trajectories)
    canards = funnel.two_fold.canards
    repelling = {d.path for d in funnel.departures if d.side == "+" and d.path >= 0}
    assert len(repelling) == canards if np.isfinite(canards) else len(repelling) > 1


def test_four_states_start_at_the_two_fold_given():
    """The two-folds are a curve; every member of the sector comes from the one of the start."""
    system = ns.FilippovSystem(
        [x, y, z, w],
        surface=x,
        above=[-y, 1 + 0.2 * w, -2 + 0.1 * y, 1],
        below=[z, -1, 1 + 0.3 * w * w, 0.5 + z],
    )
    s = np.array([0.0, 0.0, 0.0, 0.1])
    funnel = ns.orbit.funnel(system, s, 1.0, samples=20)
    np.testing.assert_allclose(funnel.point, s, atol=1e-12)
    for run in funnel.trajectories:
        for early in (1e-2, 1e-3, 1e-4):
            assert np.abs(run(early) - s).max() < 3 * early
        # as a combination a F1 + b F2 its fourth component is between those of both fields
        assert 0.5 < (run(1e-3)[3] - 0.1) / 1e-3 < 1.01
        assert continuous(run)


@pytest.mark.slow
def test_explicit_time():
    """A two-fold at t = 0.3 of a system that depends on time: members leave it then."""
    system = ns.FilippovSystem(
        [x, y, z],
        surface=x,
        above=[-y, 1 + 0.2 * ca.sin(t), -2 + 0.1 * y],
        below=[z, -1, 1 + 0.3 * t],
        time=t,
    )
    funnel = ns.orbit.funnel(system, [0.0, 0.0, 0.0], 1.3, t_start=0.3, samples=20)
    assert all(run.t[0] == 0.3 for run in funnel.trajectories)
    assert all(solves(run, system) and continuous(run) for run in funnel.trajectories)


def test_coincident_fields_slide_through():
    """F1 = F2 at s: sliding is smooth there, and beyond it leaving is possible at any time."""
    system = ns.FilippovSystem(
        [x, y, z], field=[(z - y) / 2 - lam * (y + z) / 2, -2, -0.5], multipliers=lam, surface=x
    )
    funnel = ns.orbit.funnel(system, [0.0, 1.0, 0.25], 1.5, samples=9)
    assert funnel.t == pytest.approx(0.5)
    np.testing.assert_allclose(funnel.longest.x[-1], [0.0, -2.0, -0.5], atol=1e-9)
    late = [d.t for d in funnel.departures if d.side == "+"]
    assert min(late) == funnel.t and len(late) == 4


# joined trajectories ---------------------------------------------------------------------------


def test_a_backward_piece_reads_forward():
    system = ns.FilippovSystem([x, y], surface=y, above=[y, -ca.sin(x)], below=[y, -x])
    back = ns.flow.follow(system, [1.0, 0.5], -3.0, mode="+", tol=1e-12)
    run = forward(back)
    assert (run.t[0], run.t[-1]) == (-3.0, 0.0)
    times = np.linspace(-3.0, 0.0, 50)
    np.testing.assert_allclose(run(times), back(times), atol=1e-12)


def test_cut_and_joined_it_is_the_same():
    relay = ns.FilippovSystem([x, y], field=[y, -x - 0.4 * lam], multipliers=lam, surface=y)
    run = ns.simulate(relay, [3.0, 0.0], 20.0)
    for cut in (1.0, np.pi, 7.0, 15.0):
        first = until(run, cut)
        assert first.t[-1] == cut and len(first.steps) == first.segments[-1].last
        rest = ns.simulate(relay, first.x[-1], 20.0, t_start=cut)
        whole = join([first, rest])
        assert whole.itinerary == run.itinerary and whole.status is run.status
        times = np.linspace(0.0, 20.0, 200)
        np.testing.assert_allclose(whole(times), run(times), atol=1e-8)
        assert [e.kind for e in whole.events] == [e.kind for e in run.events]


# refusals --------------------------------------------------------------------------------------


def test_a_unique_motion_raises():
    with pytest.raises(ns.PointError, match=r"unique.*REACHED_END"):
        ns.orbit.funnel(SGN, [0.5], 1.0)
    stable = ns.FilippovSystem([x], surface=x, above=[-1], below=[1])
    with pytest.raises(ns.PointError, match="itinerary 's'"):
        ns.orbit.funnel(ns.simulate(stable, [0.0], 1.0), t_end=2.0)


def test_intersections_raise():
    l1, l2 = ca.SX.sym("l1"), ca.SX.sym("l2")
    system = ns.FilippovSystem([x, y], surfaces=[x, y], multipliers=[l1, l2], field=[l1, l2])
    with pytest.raises(ns.PointError, match=r"point.*\(h0, h1\)"):
        ns.orbit.funnel(system, [0.0, 0.0], 1.0)


def test_degenerate_two_folds_raise():
    cusp = ns.FilippovSystem([x, y, z], surface=x, above=[-y, z, 1], below=[z, 0.5, -1])
    with pytest.raises(ns.DegenerateError):
        ns.orbit.funnel(cusp, [0.0, 0.0, 0.0], 1.0)


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        ((SGN,), {"t_end": 1.0}, "point"),
        ((SGN, [0.0]), {}, "t_end"),
        ((SGN, [0.0], 1.0), {"samples": 2}, "samples"),
        ((SGN, [0.0], 1.0), {"samples": 9.5}, "samples"),
        ((ns.simulate(SGN, [0.0], 1.0), [0.0], 1.0), {}, "parameters.*trajectory"),
        ((ns.simulate(SGN, [0.0], 1.0),), {"t_end": 0.0}, "t_end"),
    ],
)
def test_invalid_options_raise(arguments, options, message):
    with pytest.raises(ns.OptionError, match=message):
        ns.orbit.funnel(*arguments, **options)


def test_times_before_the_start_raise():
    with pytest.raises(ns.PointError, match="time"):
        ns.orbit.funnel(SGN, [0.0], 1.0)(-0.1)


def test_words():
    funnel = ns.orbit.funnel(SGN, [0.0], 1.0, samples=5)
    assert repr(funnel) == ("Funnel(repelling sliding of h0 at t = 0, 5 members: 2 +, 2 -, 1 s)")
    assert str(funnel.departures[-1]) == "slides along path 0 until t = 1"


def test_a_planar_two_fold_is_left_by_sliding_at_the_mean_of_both_fields():
    """L1 = x, L2 = -x: beyond s sliding repels with x' = 3/2, and can be left at any time."""
    system = ns.FilippovSystem([x, z], surface=z, above=[1, x], below=[2, -x])
    funnel = ns.orbit.funnel(system, [0.0, 0.0], 2.0, samples=9)
    assert funnel.longest.itinerary == "s"
    for departure, end in zip(funnel.departures, funnel(2.0), strict=True):
        begun, s = 1.5 * departure.t, 2.0 - departure.t
        expected = {
            "+": (begun + s, begun * s + s**2 / 2),
            "-": (begun + 2 * s, -(begun * s + s**2)),
            "s": (3.0, 0.0),
        }[departure.side]
        np.testing.assert_allclose(end, expected, atol=1e-8)


def test_a_planar_visible_invisible_fold_has_one_continuation():
    """L1 = x and L2 = 2 x: nothing slides, and only the orbit above is there for t > 0."""
    system = ns.FilippovSystem([x, z], surface=z, above=[1, x], below=[2, 2 * x])
    funnel = ns.orbit.funnel(system, [0.0, 0.0], 2.0, samples=9)
    assert [d.side for d in funnel.departures] == ["+"]
    np.testing.assert_allclose(funnel(2.0)[0], [2.0, 2.0], atol=1e-9)


def test_equal_rates_on_both_sides_are_no_two_fold():
    """L1 = L2 = x: z'' = x' is 1 or 2 for any mixture, so that z = t^2/2 above is the one motion."""
    system = ns.FilippovSystem([x, z], surface=z, above=[1, x], below=[2, x])
    run = ns.simulate(system, [0.0, 0.0], 2.0)
    assert run.itinerary == "+"
    np.testing.assert_allclose(run.x[-1], [2.0, 2.0], atol=1e-12)
    with pytest.raises(ns.PointError, match="unique"):
        ns.orbit.funnel(system, [0.0, 0.0], 2.0)
