"""Several trajectories in step go as one alone does, whatever the system."""

import platform

import casadi as ca
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import nonsmooth.flow.engine.lanes as lanes_module
import nonsmooth.textbook as textbook
from nonsmooth.flow.constants import KINDS
from nonsmooth.flow.engine import find_compiler, interpreter_for, lanes_for
from nonsmooth.flow.engine.building.codegen import lanes_source
from nonsmooth.flow.options import Options
from nonsmooth.flow.simulate import simulate
from nonsmooth.flow.status import Status
from nonsmooth.model import FilippovSystem, Stop
from nonsmooth.model.printing import ccode

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


def both(system, options):
    """The lanes, and the driver for one trajectory at a time."""
    return lanes_for(system, options), interpreter_for(system, options)


def agree(system, start, options, parameters=None, tolerance=1e-12):
    """Assert that a run in lanes is the run alone; return its status."""
    x, p = system.extended_point(start, options.t_start), system.parameter_vector(parameters)
    lanes, core = (
        of.run_many(np.tile(x, (11, 1)), p, options, None) for of in both(system, options)
    )
    scale = 1.0 + np.abs(core.x).max() + np.abs(core.t).max()
    bound = (tolerance + 100 * options.rtol) * scale
    assert lanes.words == core.words and np.array_equal(lanes.kinds, core.kinds)
    assert np.array_equal(lanes.status, core.status)
    np.testing.assert_allclose(lanes.x, core.x, rtol=0, atol=bound)
    np.testing.assert_allclose(lanes.t, core.t, rtol=0, atol=bound)
    return Status(int(core.status[0]))


#: Ends before what rounding decides: a graze, and a switch at the very end. Rounding decides how many impacts of the slider crank
#: accumulate.
ENDS = {"belt_oscillator": 13.0, "buck_converter": 0.0199}


@pytest.mark.slow_cases(
    *"""
    ambiguous_exit backlash belt_oscillator block_on_disc block_on_incline bouncing_ball
    buck_converter chua_circuit dry_friction forced_dry_friction gearbox glacial_cycles
    glass_loop harvested_prey_predator hidden_dynamics impact_oscillator integrate_and_fire
    integrate_and_fire_network integrate_and_fire_pair kelvin_voigt_bounce leine_stick_slip
    mckean_neuron multi_sliding_relay painleve_rod piecewise_cycle planar_relay pseudo_hopf
    rocking_block scalar_sliding shaken_block simplest_walker state_dependent_jump
    stick_slip_exponential tank_cascade thermostat turntable twisting two_fold two_relay_spiral
    welander_box woodpecker
    """.split()
)
@pytest.mark.parametrize("name", sorted({*textbook.PROBLEMS} - {"slider_crank"}))
def test_textbook_problems(name):
    problem = textbook.by_name(name)
    options = Options(t_end=ENDS.get(name, problem.t_end))
    if lanes_for(problem.system, options) is None:
        pytest.skip("another law than that of surfaces and sets")
    agree(problem.system, problem.start, options, problem.parameters, 1e-11)


def polynomial(draw, n, size):
    """A polynomial of degree 2 in n states: coefficients of 1, x_i, x_i x_j."""
    number = st.integers(-4, 4).map(lambda k: k / 4)
    constant = draw(number)
    linear = draw(st.lists(number, min_size=n, max_size=n))
    pairs = draw(
        st.lists(st.tuples(st.integers(0, n - 1), st.integers(0, n - 1), number), max_size=size)
    )
    return constant, linear, pairs


def expression(form, x):
    constant, linear, pairs = form
    value = ca.SX(constant)
    for c, xi in zip(linear, x, strict=True):
        value += c * xi
    for i, j, c in pairs:
        value += c * x[i] * x[j]
    return value


@st.composite
def polynomial_systems(draw, most):
    n = draw(st.integers(2, most))
    x = [ca.SX.sym(f"x{i}") for i in range(n)]
    # Damping keeps most solutions bounded.
    above = [expression(polynomial(draw, n, 2), x) - xi for xi in x]
    below = [expression(polynomial(draw, n, 2), x) - xi for xi in x]
    surface = expression(polynomial(draw, n, 1), x) + x[draw(st.integers(0, n - 1))] * 5
    start = draw(st.lists(st.integers(-8, 8).map(lambda k: k / 8), min_size=n, max_size=n))
    return FilippovSystem(x, above=above, below=below, surface=surface), start


def agree_on_polynomials(made):
    system, start = made
    # A loose tolerance means a low order: less to compile, and the two agree all the same.
    options = Options(t_end=2.0, max_steps=2000, rtol=1e-5, atol=1e-5)
    agree(system, start, options, tolerance=1e-9)


@pytest.mark.slow
@settings(max_examples=3, suppress_health_check=list(HealthCheck))
@given(polynomial_systems(most=3))
def test_polynomial_systems(made):
    agree_on_polynomials(made)


@pytest.mark.slow
@settings(max_examples=15, suppress_health_check=list(HealthCheck))
@given(polynomial_systems(most=6))
def test_polynomial_systems_in_more_dimensions(made):
    agree_on_polynomials(made)


LOOSE = {"rtol": 1e-5, "atol": 1e-5}


def every_operation():
    x, y, p, t = (ca.SX.sym(s) for s in ("x", "y", "p", "t"))
    f = (
        ca.sin(x)
        + ca.cos(y)
        - ca.tan(x / 3)
        + ca.exp(-y * y)
        + ca.log(2 + x * x)
        + ca.sqrt(2 + y)
        + ca.sinh(x / 4)
        - ca.cosh(y / 4)
        + ca.tanh(x)
        + ca.asin(x / 9)
        + ca.acos(y / 9)
        + ca.atan(x)
        + ca.asinh(y)
        + ca.acosh(4 + x)
        + ca.atanh(y / 9)
        + ca.atan2(y, 3 + x)
        + ca.erf(x)
        + (2 + x) ** 1.3
        + (3 + x) ** (y / 5)
        + x**3
        + (3 + y) ** -2
        + ca.expm1(x / 5)
        + ca.log1p(x * x)
        + ca.hypot(x, 1 + y * y)
        + ca.fabs(p)
        + ca.erfinv(x / 20)
    )
    return FilippovSystem(
        [x, y],
        above=[0.1 * f * ca.fmax(p, 0.1) - x + ca.sin(3 * t), -y - 1],
        below=[0.1 * f - x / p, 2 - y + 0.1 * x],
        surface=y - 0.3 * ca.sin(t),
        parameters={p: 0.7},
        time=t,
    )


def test_every_operation():
    system = every_operation()
    assert agree(system, [0.4, 0.9], Options(t_end=3.0, **LOOSE), None, 1e-9) is Status.REACHED_END
    options = Options(t_end=4.0, t_start=1.0, **LOOSE)
    assert agree(system, [0.4, 0.9], options, {"p": 1.5}, 1e-9) is Status.REACHED_END


def test_a_state_with_a_parameter_and_no_surface():
    x, a = ca.SX.sym("x"), ca.SX.sym("a")
    system = FilippovSystem([x], field=[a - x], parameters={a: 2.0}, stops=Stop(x - 1))
    assert "jet(" in lanes_source(system, 6, 8)


def test_functions_of_one_side_are_not_evaluated_on_the_other():
    """The root of the side above has no argument below, where all runs end."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    above, below = [1, -1 - ca.sqrt(y) * ca.log(1 + y)], [1, -2 - 0.1 * y]
    system = FilippovSystem([x, y], surface=y, above=above, below=below)
    assert agree(system, [0.0, 0.8], Options(t_end=3.0, **LOOSE), None, 1e-9) is Status.REACHED_END


def test_multipliers_whose_factor_is_on_the_surface_zero_act_beside_it():
    """Of two products with a multiplier one vanishes with h: it has no part in sliding."""
    x, y, lam = (ca.SX.sym(s) for s in ("x", "y", "lam"))
    field = [1 + lam * y, 0.3 * ca.sin(x) - lam * (2 + ca.cos(x))]
    system = FilippovSystem([x, y], field=field, surface=y, multipliers=lam)
    for start in ([0.0, 0.8], [0.5, -0.3]):
        status = agree(system, start, Options(t_end=3.0, **LOOSE), None, 1e-9)
        assert status is Status.REACHED_END


@pytest.mark.slow
@pytest.mark.parametrize("size", [25])
def test_functions_in_parts(size, monkeypatch):
    monkeypatch.setattr(ccode, "_WHOLE", 2 * size)
    monkeypatch.setattr(ccode, "_PART", size)
    system = every_operation()
    assert "jet_part1(" in lanes_source(system, 6, 8)
    assert (
        agree(system, [0.4, 0.9], Options(t_end=3.0, rtol=1e-3, atol=1e-3), None, 1e-9)
        is Status.REACHED_END
    )


@pytest.mark.slow
def test_curved_surface_keeps_the_slider_on_it():
    x, y, lam = (ca.SX.sym(s) for s in "xyl")
    h = x * x + y * y - 1
    system = FilippovSystem(
        [x, y], field=[-y - 2 * lam * x, x - 2 * lam * y], surface=h, multipliers=lam
    )
    options = Options(t_end=1000.0)
    run = simulate(system, [1.0, 0.0], 1000.0)
    assert run.itinerary == "s"
    assert np.abs(run.x[:, 0] ** 2 + run.x[:, 1] ** 2 - 1).max() < 1e-14
    chunk = lanes_for(system, options).run_many(
        np.tile([1.0, 0.0], (9, 1)), np.zeros(0), options, None
    )
    assert np.abs((chunk.x**2).sum(1) - 1).max() < 1e-14
    np.testing.assert_allclose(chunk.x[:, 0], np.cos(1000.0), atol=1e-9)


@pytest.mark.parametrize("t_end", [pytest.param(60.0, marks=pytest.mark.slow), 400.0])
def test_itineraries_of_any_length_in_lanes(t_end):
    """A square wave switches 40 or 250 times; lanes keep the last 31 modes in one number."""
    x, t, lam = (ca.SX.sym(s) for s in "xtl")
    system = FilippovSystem(
        [x], field=[ca.cos(2 * t)], multipliers=lam, surface=ca.sin(2 * t + 0.1 * x), time=t
    )
    starts = np.column_stack([np.linspace(-0.5, 0.5, 20), np.zeros(20)])
    options, p = Options(t_end=t_end), system.parameter_vector()
    lanes, scalar = (of.run_many(starts, p, options, None) for of in both(system, options))
    words = [lanes.words[k].split() for k in lanes.itinerary]
    assert words == [scalar.words[k].split() for k in scalar.itinerary]
    assert min(map(len, words)) > 0.6 * t_end
    assert len(set(map(tuple, words))) > 1 and lanes.totals[2] == 0


@pytest.mark.slow
def test_limits_become_the_same_status():
    problem = textbook.by_name("pseudo_hopf")
    for limits in ({"max_events": 5}, {"max_steps": 7}, {"max_step": 0.01}):
        assert agree(problem.system, problem.start, Options(t_end=5.0, **limits)) is not None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("width", "flags"),
    [(8, ""), (4, ""), (4, "-mno-avx512f"), (4, "-mno-avx"), (8, "-mno-avx512f")],
)
def test_lanes_of_any_width_and_instruction_set(width, flags, monkeypatch):
    if flags and platform.machine() not in ("x86_64", "AMD64"):
        pytest.skip("flags of another processor")
    problem = textbook.by_name("leine_stick_slip")
    system, options = problem.system, Options(t_end=30.0, rtol=1e-9, atol=1e-9)
    starts = np.random.default_rng(1).normal(size=(50, 2))
    p = system.parameter_vector()
    with monkeypatch.context() as patch:
        patch.setattr(lanes_module, "FLAGS", (*lanes_module.FLAGS, *flags.split()))
        patch.setattr(lanes_module, "lane_width", lambda: width)
        chunk = lanes_module.Lanes(system, options.order).run_many(starts, p, options, None)
    assert chunk.totals[2] < chunk.totals[1]  # the driver makes fewer steps than there are events
    expected = interpreter_for(system, options).run_many(starts, p, options, None)
    np.testing.assert_allclose(chunk.x, expected.x, rtol=0, atol=1e-8)
    assert [chunk.words[k] for k in chunk.itinerary] == [
        expected.words[k] for k in expected.itinerary
    ]


@pytest.mark.slow_cases("0.0--1.0-stop-1.0", "0.0--1.0-surface-1.0")
@pytest.mark.parametrize("t_end", [1.0, 10.0, 100.0, 1000.0])
@pytest.mark.parametrize("kind", ["stop", "surface"])
@pytest.mark.parametrize(("v0", "a0"), [(0.0, -1.0), (-1e-9, -1.0), (-1e-9, 0.0), (-1e-4, 0.0)])
def test_roots_with_others_beside_them(v0, a0, kind, t_end):
    """The root of y0 + v0 t + a0 t^2/2 - t^3/6, early in a step as long as t_end."""
    y, v, a = (ca.SX.sym(s) for s in "yva")
    if kind == "stop":
        system = FilippovSystem([y, v, a], field=[v, a, -1], stops=[Stop(y, -1)])
    else:
        system = FilippovSystem([y, v, a], surface=y, above=[v, a, -1], below=[v, a, -2])
    heights = np.logspace(-12, -2, 128)
    starts = np.stack([heights, np.full(128, v0), np.full(128, a0)], axis=1)
    options, kinds = Options(t_end=t_end), list(KINDS)
    at = (kinds.index("stop" if kind == "stop" else "crossing"), 1)
    times = np.full(128, 0.6)
    for _ in range(60):  # Newton from beyond the root of a function that falls ever faster
        slope = v0 + a0 * times - times**2 / 2
        times -= (heights + v0 * times + a0 * times**2 / 2 - times**3 / 6) / slope
    for engine in both(system, options):
        chunk = engine.run_many(starts, np.zeros(0), options, at)
        assert np.abs(chunk.at_t - times).max() < 1e-15 * t_end


def cubics(draw_outside, seed=0):
    """Starts of y = (t - r0)(t - r1)(t - r2) with r1 in the step and another root just outside."""
    rng = np.random.default_rng(seed)
    inside, outside = rng.uniform(0.05, 0.95, 2000), draw_outside(rng)
    r0 = -(10.0 ** rng.uniform(-9, 1, 2000)) if outside[0] > 0 else rng.uniform(1.5, 9, 2000)
    q = [np.poly([a, b, c])[::-1] for a, b, c in zip(r0, inside, outside, strict=True)]
    sign = np.sign([row[0] for row in q])
    return np.array([[c[0], c[1], 2 * c[2], 6.0] for c in q]) * sign[:, None], inside


@pytest.mark.parametrize(
    "outside",
    [
        pytest.param(lambda rng: 1 + 10.0 ** rng.uniform(-10, -5, 2000), marks=pytest.mark.slow),
        lambda rng: -(10.0 ** rng.uniform(-8, -5, 2000)),
    ],
    ids=["after the end", "before the start"],
)
def test_roots_just_outside_the_step_are_not_taken(outside):
    y, v, a, j = (ca.SX.sym(s) for s in "yvaj")
    system = FilippovSystem([y, v, a, j], field=[v, a, j, 0], stops=[Stop(y, -1)])
    starts, inside = cubics(outside)
    options = Options(t_end=1.0)
    for engine in both(system, options):
        chunk = engine.run_many(starts, np.zeros(0), options, None)
        np.testing.assert_allclose(chunk.t, inside, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("start", "t_end", "expected"),
    [
        pytest.param([2e-4, -0.03, 2.0], 1e6, 0.01, marks=pytest.mark.slow),
        ([2.0, -3.0, 2.0], 1e8, 1.0),
    ],
)
def test_pairs_early_in_a_long_step_are_seen(start, t_end, expected):
    """Rounding at an early root is not that at the end of the step: (t - .01)(t - .02) to 1e6."""
    y, v, a = (ca.SX.sym(s) for s in "yva")
    system = FilippovSystem([y, v, a], field=[v, a, 0], stops=[Stop(y, -1)])
    options = Options(t_end=t_end)
    x = np.array(start)
    for engine in both(system, options):
        chunk = engine.run_many(np.tile(x, (9, 1)), np.zeros(0), options, None)
        np.testing.assert_allclose(chunk.t, expected, rtol=1e-12)
