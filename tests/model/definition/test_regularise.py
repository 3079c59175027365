"""The smoothed system tends to the Filippov system at the known rate, also where that is delicate:
at a visible fold, and along the canard of a two-fold."""

import pickle

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, z, lam, mu, t, eps = (ca.SX.sym(s) for s in ("x", "y", "z", "lam", "mu", "t", "eps"))
SMOOTHERS = ["tanh", "erf", "algebraic", "arctan"]

CROSSING = ns.FilippovSystem([x, z], surface=z, above=[1, 1 + x], below=[2 - x, 1.5])
SLIDING = ns.FilippovSystem(
    [x, z], surface=z, above=[1 + x / 2, -1 + 0.3 * x], below=[-0.5, 1 + x**2]
)
LEAVING = ns.FilippovSystem([x, z], surface=z, above=[1, x - 1], below=[1.5, 1])
RELAY = ns.FilippovSystem([x, y], field=[y, -x - mu * lam], multipliers=lam, surface=y,
                          parameters={mu: 0.4})  # fmt: skip


def errors(system, start, t_end, transition, widths, **options):
    exact = ns.simulate(system, start, t_end, tol=1e-12).x[-1]
    smooth = ns.regularise(system, None, transition=transition)
    runs = [
        ns.simulate(smooth, start, t_end, parameters={"eps": e}, tol=1e-11, **options)
        for e in widths
    ]
    assert all(run.status is ns.Status.REACHED_END for run in runs)
    return np.array([np.abs(run.x[-1] - exact).max() for run in runs])


def order(found, widths):
    return np.log(found[-2] / found[-1]) / np.log(widths[-2] / widths[-1])


@pytest.mark.parametrize(
    "transition",
    [
        s if s in ("tanh", "algebraic") else pytest.param(s, marks=pytest.mark.slow)
        for s in SMOOTHERS
    ],
)
@pytest.mark.parametrize(
    ("system", "start", "t_end"),
    [(CROSSING, [0.0, -0.5], 2.0), (SLIDING, [0.0, 0.2], 1.0)],
    ids=["crossing", "attracting sliding"],
)
def test_first_order_where_the_solution_is_unique(system, start, t_end, transition):
    widths = [1e-2, 1e-3, 1e-4]
    found = errors(system, start, t_end, transition, widths)
    assert order(found, widths) == pytest.approx(1.0, abs=0.1)
    assert found[-1] < 1e-4


@pytest.mark.parametrize(("transition", "tail"), [("arctan", 1), ("algebraic", 2)])
def test_order_at_a_visible_fold_follows_from_the_tail(transition, tail):
    """1 - phi ~ s^-p balances h ~ xi^2 and xi ~ (eps/h)^p: the error is eps^(2p/(2p+1))."""
    widths = [1e-3, 1e-4]
    found = errors(LEAVING, [0.0, 0.0], 2.0, transition, widths)
    assert order(found, widths) == pytest.approx(2 * tail / (2 * tail + 1), abs=0.04)


def test_dry_friction_sticks_almost():
    smooth = ns.regularise(RELAY, 1e-3)
    run = ns.simulate(smooth, [3.0, 0.0], 14.0)
    assert run.x[-1, 0] == pytest.approx(-0.2, abs=2e-3)
    # It creeps: tanh(v/eps) = -x/mu.
    assert run.x[-1, 1] == pytest.approx(1e-3 * np.arctanh(-run.x[-1, 0] / 0.4), rel=1e-2)


@pytest.mark.parametrize("tol", [1e-4, 1e-7, 1e-10, 1e-13])
@pytest.mark.parametrize("transition", SMOOTHERS)
def test_no_run_steps_over_a_thin_layer(transition, tol):
    """From far away the layer is invisible to a step size; its edges show it."""
    system = ns.FilippovSystem([x, z], surface=z, above=[1, -1], below=[5, -1])
    for width in (1e-3, 1e-6, 1e-9):
        smooth = ns.regularise(system, width, transition=transition)
        run = ns.simulate(smooth, [0.0, 1.0], 3.0, tol=tol)
        assert run.x[-1, 0] == pytest.approx(11.0, abs=100 * (width + tol))
        names = {e.name for e in run.events if e.kind == "reset"}
        assert names and all(name.startswith("edge of h0") for name in names)
        assert run.itinerary == "o"


def test_without_edges_there_are_no_resets():
    smooth = ns.regularise(RELAY, 0.1, edges=False)
    assert smooth.resets == () and smooth.surface_count == 0
    run = ns.simulate(smooth, [3.0, 0.0], 10.0, max_step=0.05)
    other = ns.simulate(ns.regularise(RELAY, 0.1), [3.0, 0.0], 10.0)
    np.testing.assert_allclose(run.x[-1], other.x[-1], atol=1e-9)


def test_everything_else_is_kept():
    system = ns.FilippovSystem(
        [x, y],
        field=[y, -lam + ca.cos(t)],
        multipliers=lam,
        surface=y - ca.sin(t),
        parameters={mu: 0.5},
        time=t,
        stops=[ns.Stop(x - 3, 1, "far")],
        resets=[ns.Reset(x, [x, -mu * y], -1, "wall")],
    )
    smooth = ns.regularise(system, 0.1, transition="algebraic")
    assert smooth.stops == (("far", 1),)
    assert smooth.resets == (
        ("wall", -1),
        *[(f"edge of h0{more}", 0) for more in ("", " 2", " 3", " 4", " 5", " 6")],
    )
    assert smooth.parameter_names == ("mu", "eps") and smooth.time_dependent
    lam_at = 0.7 / np.sqrt(1 + 0.7**2)
    field = smooth.evaluate(smooth.field(""), [0.0, 0.07 + np.sin(2.0)], t=2.0).ravel()
    assert field[1] == pytest.approx(-lam_at + np.cos(2.0), abs=1e-12)
    run = ns.simulate(smooth, [1.0, -2.0], 1.0)
    assert run.events[0].name == "wall"
    again = pickle.loads(pickle.dumps(smooth))
    np.testing.assert_array_equal(ns.simulate(again, [1.0, -2.0], 1.0).x[-1], run.x[-1])


def test_several_surfaces_and_their_intersection():
    """The two-relay spiral ends at 0 at t = 0.75; smoothed, it stays within a few eps of it."""
    l1, l2 = ca.SX.sym("l1"), ca.SX.sym("l2")
    system = ns.FilippovSystem(
        [x, y], surfaces=[x, y], multipliers=[l1, l2], field=[-l1 + 2 * l2, -2 * l1 - l2]
    )
    for transition in SMOOTHERS:
        run = ns.simulate(ns.regularise(system, 1e-3, transition=transition), [1.0, 0.5], 1.0)
        assert run.status is ns.Status.REACHED_END
        assert np.abs(run.x[-1]).max() < 5e-3


def test_hidden_dynamics_shows_in_the_layer():
    """x' = b - lam, y' = 2 lam^2 - 1: the layer keeps lam = b, so y' = 2 b^2 - 1, not 1."""
    system = ns.FilippovSystem(
        [x, y], surface=x, multipliers=lam, field=[0.2 - lam, 2 * lam**2 - 1], hidden=True
    )
    run = ns.simulate(ns.regularise(system, 1e-3), [0.0, 0.0], 1.0)
    assert run.x[-1, 1] == pytest.approx(-0.92, abs=1e-2)


# the canard of a two-fold ----------------------------------------------------------------------


def two_fold(nu1, nu2, bend=0.0):
    """Visible two-fold, with stops where the motion has left the layer."""
    width = ca.SX.sym("width")
    return ns.FilippovSystem(
        [x, y, z],
        surface=x,
        above=[-y, -1, nu1 + bend * z],
        below=[z, nu2, -1],
        parameters={width: 1.0},
        stops=[ns.Stop(x - 10 * width, 1, "up"), ns.Stop(x + 10 * width, -1, "down")],
    )


def leave(smooth, width, start):
    parameters = {"eps": width, "width": width}
    run = ns.simulate(smooth, start, 20.0, parameters=parameters, tol=1e-13)
    return run.events[-1].name, run


def on_slow_manifold(width, c, slope):
    return [width * np.arctanh((slope - 1) / (slope + 1)), c, c * slope]


def canard_slope(smooth, width, c, low, high, halvings):
    """Bisect between leaving up and leaving down; return the slope and the longest run."""
    longest, (down, _) = None, leave(smooth, width, on_slow_manifold(width, c, low))
    assert down != leave(smooth, width, on_slow_manifold(width, c, high))[0]
    for _ in range(halvings):
        middle = (low + high) / 2
        side, run = leave(smooth, width, on_slow_manifold(width, c, middle))
        low, high = (middle, high) if side == down else (low, middle)
        if longest is None or run.t[-1] > longest.t[-1]:
            longest = run
    return (low + high) / 2, longest


def test_the_exact_canard_of_the_normal_form_never_leaves():
    """VV-C1 with nu = (.5, .5): on z2 = z3 lam = 0, so h = 0 holds exactly, through s and on."""
    smooth = ns.regularise(two_fold(0.5, 0.5), None)
    _, run = leave(smooth, 1e-3, [0.0, 0.5, 0.5])
    assert run.status is ns.Status.REACHED_END
    np.testing.assert_allclose(run(8.0), [0.0, -1.5, -1.5], atol=1e-12)


def test_beyond_the_two_fold_the_delay_is_the_square_root_of_eps():
    """z2, z3, t ~ sqrt(eps) and h ~ eps leave the smoothed normal form as it is, exactly."""
    smooth = ns.regularise(two_fold(0.5, 0.5), None)
    for off in (1e-2, 1e-8):
        delays = [
            leave(smooth, e, [off * e, 0.0, 0.0])[1].t[-1] / np.sqrt(e) for e in (1e-1, 1e-3, 1e-4)
        ]
        np.testing.assert_allclose(delays, delays[0], rtol=1e-6)
        # growth exp(t^2/(8 eps)), and an algebraic factor, from off to order one
        assert 1.0 < delays[0] / np.sqrt(8 * np.log(1 / off)) < 1.25


def test_canard_into_repelling_sliding_is_found_between_up_and_down():
    """The slope is that of the eigenline; at double precision about 12 sqrt(eps) are followed."""
    slope = (1 + np.sqrt(5)) / 2  # nu = (-2, -1)
    smooth = ns.regularise(two_fold(-2.0, -1.0), None)
    for width in (1e-2, 1e-3):
        found, run = canard_slope(smooth, width, 0.5, 1.2, 2.2, 40)
        assert found == pytest.approx(slope, abs=1e-9)
        reach = -run.x[-1, 1:] / np.sqrt(width)
        assert np.all(reach > 5.0) and np.all(reach < 20.0)
        end = run(run.t[-1] - 2 * np.sqrt(width) * 0.2)
        assert end[2] / end[1] == pytest.approx(slope, rel=0.05)


def test_canard_of_the_smoothed_system_tends_to_filippovs():
    """With a bend in the field the canard is a curve; the smoothed one is O(eps) from it."""
    system, c = two_fold(0.5, 0.5, 0.4), 0.3
    near = ns.flow.follow(system, [0.0, 1e-6, 1e-6], -3.0, mode="s", until=y - c, tol=1e-13)
    slope = near.x[-1, 2] / c
    smooth = ns.regularise(system, None)
    off = [abs(canard_slope(smooth, e, c, 0.8, 1.2, 26)[0] - slope) for e in (1e-2, 1e-3)]
    assert off[1] < 2e-3 and off[0] / off[1] == pytest.approx(10.0, rel=0.35)


# refusals --------------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", [0.0, -1.0, np.inf, np.nan, "thin"])
def test_width_is_positive(bad):
    with pytest.raises(ns.OptionError, match=r"\beps\b"):
        ns.regularise(RELAY, bad)


def test_wrong_requests_are_refused():
    with pytest.raises(ns.OptionError, match="transition"):
        ns.regularise(RELAY, 0.1, transition="cubic")
    with pytest.raises(ns.OptionError, match=r"transition.*0 to 1"):
        ns.regularise(RELAY, 0.1, transition=lambda s: (1 + ca.tanh(s)) / 2)
    with pytest.raises(ns.NotSmoothError):
        ns.regularise(RELAY, 0.1, transition=lambda s: ca.fmax(-1, ca.fmin(1, s)))
    with pytest.raises(ns.DefinitionError, match="name"):
        ns.regularise(RELAY, 0.1, name="mu")
    with pytest.raises(ns.ParameterError, match="eps"):
        ns.simulate(ns.regularise(RELAY, None), [1.0, 0.0], 1.0)


def test_a_function_of_ones_own():
    smooth = ns.regularise(RELAY, 1e-2, transition=lambda s: s / (1 + s**4) ** 0.25, name="w")
    assert smooth.parameter_names == ("mu", "w")
    assert ns.simulate(smooth, [3.0, 0.0], 14.0).x[-1, 0] == pytest.approx(-0.2, abs=2e-2)
