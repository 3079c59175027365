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


def test_dry_friction_stops_where_the_closed_form_says():
    run = ns.simulate(relay(), [3.0, 0.0], 20.0, tol=1e-13)
    assert run.itinerary == "- + - + s"
    assert [e.kind for e in run.events] == ["crossing"] * 3 + ["entry", "end"]
    np.testing.assert_allclose([e.t for e in run.events[:4]], np.pi * np.arange(1, 5), atol=1e-12)
    np.testing.assert_allclose(
        [e.x[0] for e in run.events[:4]], [-2.2, 1.4, -0.6, -0.2], atol=1e-12
    )
    assert run.status is ns.Status.REACHED_END and run.t[-1] == 20.0


def test_sliding_ends_at_a_visible_fold():
    """x' = 1, z' = z - x -+ 1: slides on z = 0 until x = 1, then follows z' = z - x + 1."""
    system = ns.FilippovSystem([x, z], surface=z, above=[1, x - 1], below=[1, x + 1])
    run = ns.simulate(system, [-0.5, 0.0], 3.0, tol=1e-13)
    assert run.itinerary == "s +"
    exit_event = events(run, "exit")[0]
    assert exit_event.t == pytest.approx(1.5, abs=1e-13)
    np.testing.assert_allclose(run.x[-1], [2.5, 1.5**2 / 2], atol=1e-12)


def test_tangent_exit_is_not_pushed_off_the_surface():
    """Just after the fold the orbit is on the parabola z = s^2/2, at every scale of s."""
    system = ns.FilippovSystem([x, z], surface=z, above=[1, x - 1], below=[1, x + 1])
    run = ns.simulate(system, [0.0, 0.0], 3.0)
    for s in (1e-2, 1e-4, 1e-6):
        assert run(1.0 + s)[1] == pytest.approx(s * s / 2, rel=1e-6, abs=1e-16)


def test_start_on_a_visible_fold_and_on_an_invisible_one():
    """At L1 = 0 the visible fold leaves along F1, the invisible one slides."""
    visible = ns.FilippovSystem([x, z], surface=z, above=[1, x], below=[1, 1])
    assert ns.simulate(visible, [0.0, 0.0], 1.0).itinerary == "+"
    invisible = ns.FilippovSystem([x, z], surface=z, above=[1, -x], below=[1, 1])
    assert ns.simulate(invisible, [0.0, 0.0], 1.0).itinerary == "s"


def test_start_on_a_cusp_follows_the_third_derivative():
    """z' = x^2 above: the tangency is cubic and the orbit leaves upward."""
    up = ns.FilippovSystem([x, z], surface=z, above=[1, x**2], below=[1, 1])
    run = ns.simulate(up, [0.0, 0.0], 1.0)
    assert run.itinerary == "+" and run.x[-1, 1] == pytest.approx(1 / 3, abs=1e-10)
    down = ns.FilippovSystem([x, z], surface=z, above=[1, -(x**2)], below=[1, 1])
    assert ns.simulate(down, [0.0, 0.0], 1.0).itinerary == "s"


def test_repelling_start_is_not_unique_and_each_continuation_can_be_chosen():
    system = ns.FilippovSystem([x], surface=x, above=[1], below=[-1])
    run = ns.simulate(system, [0.0], 1.0)
    assert run.status is ns.Status.NON_UNIQUE and run.t[-1] == 0.0
    assert "repelling" in run.message and "start_mode" in run.message
    ends = {m: ns.simulate(system, [0.0], 1.0, start_mode=m).x[-1, 0] for m in "+-s"}
    assert ends == {"+": 1.0, "-": -1.0, "s": 0.0}


def test_repelling_sliding_that_was_chosen_goes_on_until_it_ends():
    """L1 = 1 > 0 > L2 = x - 1: repelling until x = 1, where F2 turns upward and the orbit leaves.

    Beyond, both fields point up, and F2 is tangent with z'' = 1: only F1 leaves.
    """
    system = ns.FilippovSystem([x, z], surface=z, above=[1, 1], below=[1, x - 1])
    assert ns.simulate(system, [0.0, 0.0], 3.0).status is ns.Status.NON_UNIQUE
    run = ns.simulate(system, [0.0, 0.0], 3.0, start_mode="s", tol=1e-12)
    assert run.itinerary == "s +" and run.events[0].t == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(run.x[-1], [3.0, 2.0], atol=1e-11)


@pytest.mark.parametrize(("mode", "start"), [("+", 0.0), ("-", 0.0), ("s", 3.0)])
def test_a_start_mode_whose_field_points_elsewhere_is_refused(mode, start):
    """Attracting for x < 2: neither side leaves; crossing beyond: no sliding."""
    system = ns.FilippovSystem([x, z], surface=z, above=[1, x - 2], below=[1, 1])
    run = ns.simulate(system, [start, 0.0], 5.0, start_mode=mode)
    assert run.status is ns.Status.NON_UNIQUE and "cannot continue" in run.message


def test_two_folds_are_never_guessed_through():
    """Started at each kind of two-fold, and slid into a Teixeira singularity in finite time."""
    for above, below in [
        ((-y, -1, -2), (z, -1, 1)),
        ((-y, 1, 0.5), (z, 0.5, -1)),
        ((-y, -1, 0), (z, 0, -1)),
    ]:
        system = ns.FilippovSystem([x, y, z], surface=x, above=above, below=below)
        run = ns.simulate(system, [0.0, 0.0, 0.0], 1.0)
        assert run.status is ns.Status.NON_UNIQUE and "two-fold" in run.message


def test_finite_time_to_a_teixeira_singularity():
    """sigma = (-, +), nu = (-2, -1): t* = -(1, 1) M^-1 z0 for the linear sliding flow (phi = 1)."""
    system = ns.FilippovSystem([x, y, z], surface=x, above=[-y, 1, -2], below=[z, -1, 1])
    m = np.array([[-1.0, 1.0], [1.0, -2.0]])
    start = np.array([0.7, 0.3])
    run = ns.simulate(system, [0.0, *start], 10.0, tol=1e-12)
    assert run.status is ns.Status.NON_UNIQUE
    assert run.t[-1] == pytest.approx(-np.ones(2) @ np.linalg.solve(m, start), abs=1e-9)
    np.testing.assert_allclose(run.x[-1], 0.0, atol=1e-10)


def test_sliding_into_a_mixed_two_fold_is_not_taken_for_an_exit():
    """mix-C, sigma = (+, +), nu = (-3, -1/2): a whole sector reaches s, none of it leaves there."""
    system = ns.FilippovSystem([x, y, z], surface=x, above=[-y, -1, -3], below=[z, -0.5, 1])
    for angle in np.linspace(0.05, np.arctan(2.0) - 0.05, 12):  # below the strong canard, slope 2
        start = [0.0, np.cos(angle), np.sin(angle)]
        run = ns.simulate(system, start, 10.0)
        assert run.status is ns.Status.NON_UNIQUE and run.itinerary == "s"
        np.testing.assert_allclose(run.x[-1], 0.0, atol=1e-8)


def test_coincident_fields_are_no_obstacle():
    """F1 - F2 = -2 x^2 (0, 1): friction vanishes at x = 0 and sliding goes on smoothly through it."""
    system = ns.FilippovSystem([x, z], field=[1, -lam * x**2], multipliers=lam, surface=z)
    run = ns.simulate(system, [-1.0, 0.0], 2.0)
    assert run.status is ns.Status.REACHED_END and run.itinerary == "s"
    np.testing.assert_allclose(run.x[-1], [1.0, 0.0], atol=1e-12)


def test_friction_that_changes_sign_is_not_unique():
    """F1 - F2 = 2 x (0, 1) changes sign at x = 0: sliding turns repelling there."""
    system = ns.FilippovSystem([x, z], field=[1, lam * x], multipliers=lam, surface=z)
    run = ns.simulate(system, [-1.0, 0.0], 2.0)
    assert run.status is ns.Status.NON_UNIQUE and run.t[-1] == pytest.approx(1.0, abs=1e-9)


def test_stopping_surfaces_have_a_direction():
    for direction, expected in [(-1, np.pi / 2), (1, 3 * np.pi / 2), (0, np.pi / 2)]:
        system = ns.FilippovSystem([x, y], field=[y, -x], stops=[ns.Stop(x, direction, "section")])
        run = ns.simulate(system, [1.0, 0.0], 10.0, tol=1e-13)
        assert run.status is ns.Status.STOPPED and "'section'" in run.message
        assert run.t[-1] == pytest.approx(expected, abs=1e-12)
        assert [e.kind for e in run.events] == ["stop"]


def test_a_start_on_a_stopping_surface_is_not_an_event():
    """So a return map is one call: the first return to a section, not the start."""
    system = ns.FilippovSystem([x, y], field=[y, -x], stops=[ns.Stop(x, 1, "section")])
    run = ns.simulate(system, [0.0, 1.0], 10.0, tol=1e-13)
    assert run.t[-1] == pytest.approx(2 * np.pi, abs=1e-12)


def test_a_reset_jumps_and_the_trajectory_shows_both_sides():
    system = ns.FilippovSystem(
        [x, v], field=[v, -1], resets=[ns.Reset(x, [x, -v / 2], -1, "impact")]
    )
    run = ns.simulate(system, [0.5, 0.0], 1.5, tol=1e-13)
    k = int(np.flatnonzero(np.diff(run.t) == 0)[0])
    np.testing.assert_allclose(run.t[k : k + 2], 1.0, atol=1e-13)
    np.testing.assert_allclose(run.x[k : k + 2, 1], [-1.0, 0.5], atol=1e-13)
    assert run(1.0)[1] == pytest.approx(0.5, abs=1e-12)
    assert run.x[-1, 0] == pytest.approx(0.5 * 0.5 - 0.125, abs=1e-12)


@pytest.mark.parametrize("offset", [0.0, 1.0])
def test_impacts_accumulate_at_the_closed_form(offset):
    g, r, h0 = 9.81, 0.9, 1.0
    height = x - offset
    system = ns.FilippovSystem(
        [x, v], field=[v, -g], resets=[ns.Reset(height, [2 * offset - x, -r * v], -1)]
    )
    run = ns.simulate(system, [offset + h0, 0.0], 20.0)
    first = np.sqrt(2 * h0 / g)
    assert run.status is ns.Status.ACCUMULATION
    assert run.events[0].t == pytest.approx(first, abs=1e-12)
    assert run.accumulation_time == pytest.approx(first * (1 + r) / (1 - r), abs=1e-6)


def test_a_body_at_rest_on_its_reset_surface_accumulates_at_once():
    system = ns.FilippovSystem([x, v], field=[v, -1], resets=[ns.Reset(x, [x, -v / 2], -1)])
    run = ns.simulate(system, [0.0, 0.0], 1.0)
    assert run.status is ns.Status.ACCUMULATION and run.t[-1] == 0.0


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


def test_explicit_time():
    """h = x - sin t with x' = 0: crossings of a fixed x by a moving surface."""
    system = ns.FilippovSystem([x, y], surface=x - ca.sin(t), above=[0, 1], below=[0, 2], time=t)
    run = ns.simulate(system, [0.5, 0.0], 6.0, tol=1e-13)
    np.testing.assert_allclose(
        [e.t for e in events(run, "crossing")], [np.pi / 6, 5 * np.pi / 6], atol=1e-12
    )
    late = ns.simulate(system, [0.5, 0.0], 6.0, t_start=1.0, tol=1e-13)
    assert late.events[0].t == pytest.approx(5 * np.pi / 6, abs=1e-12)


def test_a_field_that_is_not_finite_ends_the_run():
    system = ns.FilippovSystem([x], field=[ca.log(x)])
    run = ns.simulate(system, [-1.0], 1.0)
    assert run.status is ns.Status.NOT_FINITE and "-1" in run.message


def test_blow_up_ends_with_step_too_small():
    run = ns.simulate(ns.FilippovSystem([x], field=[x**2]), [1.0], 2.0)
    assert run.status in (ns.Status.STEP_TOO_SMALL, ns.Status.NOT_FINITE)
    assert run.t[-1] == pytest.approx(1.0, abs=1e-6)


def test_a_power_law_starts_at_its_singular_point():
    """v' = -x^(3/2) from x = 0: energy v^2/2 + x^(5/2)/2.5 is kept to the tolerance."""
    system = ns.FilippovSystem([x, v], field=[v, -x * ca.sqrt(x)], stops=[ns.Stop(v, -1, "top")])
    run = ns.simulate(system, [0.0, 1.0], 10.0, tol=1e-12)
    assert run.status is ns.Status.STOPPED
    assert run.x[-1, 0] == pytest.approx(1.25**0.4, abs=1e-10)


def test_a_stop_inside_the_singular_step_is_not_skipped():
    """y' = -1 from 0 stops where (-y)^(3/2) = 1e-9, at t = 1e-6, within the first short step."""
    stop = ns.Stop((-y) ** 1.5 - 1e-9, 1, "depth")
    run = ns.simulate(ns.FilippovSystem([y], field=[-1], stops=[stop]), [0.0], 1.0)
    assert run.status is ns.Status.STOPPED and run.t[-1] == pytest.approx(1e-6, rel=1e-9)


def rows(start):
    """Starts that are all the same, enough for lanes."""
    return np.tile(start, (100, 1))


def and_slowly(fast, *slow):
    """Cases of which only the first are in the fast part of the suite."""
    return [*fast, *(pytest.param(case, marks=pytest.mark.slow) for case in slow)]


@pytest.mark.parametrize("gap", [3e-14, -3e-14])
def test_events_keep_their_order_until_rounding(gap):
    """x' = 1 from -1 meets x = 0 at t = 1, and a stop a few dozen roundings before or after."""
    system = ns.FilippovSystem(
        [x, y], field=[1, -lam], multipliers=lam, surface=x, stops=[ns.Stop(x - gap, 1, "wall")]
    )
    run = ns.simulate(system, [-1.0, 0.0], 2.0)
    assert run.itinerary == ("- +" if gap > 0 else "-")
    assert run.t[-1] == pytest.approx(1.0 + gap, abs=5e-16)
    many = ns.ensemble(system, rows([-1.0, 0.0]), 2.0)
    assert set(many.itinerary) == {run.itinerary}


@pytest.mark.parametrize("offset", [5e-14, -5e-14])
def test_a_start_is_on_a_surface_only_to_rounding(offset):
    """Sliding along x = y + 1.5 begins where the surface is met, unless the start is on it."""
    system = ns.FilippovSystem([x, y], field=[-lam, 0], multipliers=lam, surface=x - y)
    for start, word in (([1.5 + offset, 1.5], ("+ s", "- s")[offset < 0]), ([1.5, 1.5], "s")):
        assert ns.simulate(system, start, 1.0).itinerary == word
        many = ns.ensemble(system, rows(start), 1.0)
        assert set(many.itinerary) == {word}


@pytest.mark.parametrize(
    "tol", and_slowly([1e-4, 1e-8, 1e-13], 1e-5, 1e-6, 1e-7, 1e-9, 1e-10, 1e-11, 1e-12)
)
def test_a_guard_far_below_the_tolerance_keeps_its_sign(tol):
    """y^(3/2) grows from 3e-20; beyond its circle of convergence the series falls through zero."""
    system = ns.FilippovSystem([y], field=[1], stops=[ns.Stop(y**1.5, -1, "no load")])
    run = ns.simulate(system, [1e-13], 1.0, tol=tol)
    assert run.status is ns.Status.REACHED_END
    many = ns.ensemble(system, rows([1e-13]), 1.0, tol=tol)
    assert set(many.status) == {ns.Status.REACHED_END}


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
        [x, v],
        surface=x,
        above=[v - k1 * ca.sqrt(x), -k2],
        below=[v + k1 * ca.sqrt(-x), k2],
    )
    ratio = np.exp(-np.pi * k1 / np.sqrt(8 * k2 - k1**2))
    run = ns.simulate(system, [1.0, 0.5], 10.0)
    assert run.status is ns.Status.REACHED_END and np.abs(run.x[-1]).max() < 1e-12
    (rest,) = events(run, "rest")
    met = np.array([e.x[1] for e in events(run, "crossing")])
    np.testing.assert_allclose(met[:6], met[0] * (-ratio) ** np.arange(6), atol=1e-6)
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
    met, expected = events(run, "crossing"), events(alone, "crossing")
    for one, other in zip(met[:6], expected[:6], strict=True):
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


@pytest.mark.parametrize(
    ("states", "rhs", "start"),
    [
        ((x, y), [y, -x - ca.fmax(x, 0)], [0.0, 0.0]),
        ((x, y), [y, 1 - x - 3 * ca.fmax(x - 1, 0)], [1.0, 0.0]),
    ],
)
def test_rest_on_a_surface_across_which_the_field_is_continuous(states, rhs, start):
    system = ns.FilippovSystem.from_expression(states, rhs)
    run = ns.simulate(system, start, 10.0)
    assert run.status is ns.Status.REACHED_END
    np.testing.assert_array_equal(run.x[-1], start)


def test_a_surface_on_which_nothing_switches_never_makes_the_future_ambiguous():
    system = ns.FilippovSystem([x, y], field=[y, -x], multipliers=lam, surface=y - 1)
    run = ns.simulate(system, [0.0, 1.0], 6.0)  # tangent to the surface at the start
    assert run.status is ns.Status.REACHED_END and run.itinerary == "-"
    np.testing.assert_allclose(run.x[-1], [np.sin(6.0), np.cos(6.0)], atol=1e-9)


@pytest.mark.parametrize("unit", [1e-7, 1.0, 1e7])
def test_accumulation_does_not_depend_on_the_unit_of_time(unit):
    # x'' = -sgn x - v: the intervals shrink like 1/n, so their sum has no limit.
    damped = ns.FilippovSystem(
        [x, v], field=[v / unit, (-lam - v) / unit], multipliers=lam, surface=x
    )
    run = ns.simulate(damped, [0.5, 0.0], 100.0 * unit, max_events=400)
    assert run.status is ns.Status.TOO_MANY_EVENTS
    bounce = ns.FilippovSystem(
        [x, v],
        field=[v / unit, -1 / unit],
        resets=[ns.Reset(x, map=[x, -0.5 * v], direction=-1)],
    )
    run = ns.simulate(bounce, [0.0, 1.0], 100.0 * unit)
    assert run.status is ns.Status.ACCUMULATION
    assert run.accumulation_time == pytest.approx(4.0 * unit, rel=1e-9)


def _rounded_steps(start, step, end):
    """What rounding of each sum takes from the way to ``end`` in equal steps."""
    count, state = 0, start
    while abs(end - state) >= abs(step):
        count, state = count + 1, state + step
    return float(Fraction(start) + count * Fraction(step) - Fraction(state))


@pytest.mark.parametrize("offset", [0.0, 1e6, 1e8])
@pytest.mark.parametrize(("direction", "speed"), [(-1, -1.0), (0, -1.0), (0, 1.0), (1, 1.0)])
def test_a_stop_at_the_end_of_a_step_is_met(offset, direction, speed):
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


def test_a_touch_at_the_end_of_a_step_is_no_event():
    """A parabola with its vertex on the stop, where steps of max_step end."""
    y, v = ca.SX.sym("y"), ca.SX.sym("v")
    system = ns.FilippovSystem([y, v], field=[v, 1], stops=[ns.Stop(y, -1)])
    run = ns.simulate(system, [0.5, -1.0], 2.0, max_step=0.25)
    assert run.status is ns.Status.REACHED_END


def test_a_state_that_does_not_move_from_its_surface_has_no_unique_future():
    """Any of the fields between the two keeps it there."""
    for above, below in (([1, 0], [-1, 0]), ([-x, 0 * v], [x, 0 * v])):
        system = ns.FilippovSystem([x, v], surface=v, above=above, below=below)
        run = ns.simulate(system, [1.0, 0.0], 1.0)
        assert run.status is ns.Status.NON_UNIQUE and "'+', '-'" in run.message
        beside = ns.simulate(system, [1.0, 1e-3], 1.0)
        assert beside.itinerary == "+" and beside.status is ns.Status.REACHED_END


def test_a_run_goes_on_from_where_its_sliding_ended():
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
