"""A lifted expression has the value of the original off the surfaces, and the runs of hand-written
systems; what cannot be lifted is refused by name."""

import functools
import pickle

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import nonsmooth as ns
from tests.drawing import at_most

x, y, z, t, mu, lam = (ca.SX.sym(s) for s in ("x", "y", "z", "t", "mu", "lam"))
lift = ns.FilippovSystem.from_expression


def value(system, point, parameters=None, time=0.0):
    """The field at a point off the surfaces, in the mode of its signs."""
    h = [
        system.evaluate(system.surface_function(i), point, parameters, time).item()
        for i in range(system.surface_count)
    ]
    assume(all(abs(v) > 1e-9 for v in h))
    mode = "".join("+" if v > 0 else "-" for v in h)
    return system.evaluate(system.field(mode), point, parameters, time).ravel()[: system.dimension]


EXPRESSIONS = {
    "sign": (ca.sign(x - y), 1),
    "fabs": (ca.fabs(x * y - 1), 1),
    "fmax": (ca.fmax(x, y**2), 1),
    "fmin": (ca.fmin(x, ca.sin(y)), 1),
    "if_else": (ca.if_else(x > y, x, -2 * y), 1),
    "if_else, reversed": (ca.if_else(x <= 1, 3, y), 1),
    "and": (ca.if_else(ca.logic_and(x > 0, y > 0), x * y, 1), 2),
    "or": (ca.if_else(ca.logic_or(x > 0, y > 0), x * y, 1), 2),
    "not": (ca.if_else(ca.logic_not(x > 0), x * y, 1), 1),
    "else if": (ca.if_else(x > 1, 1, ca.if_else(x > -1, x, -1)), 2),
    "nested on the same": (ca.if_else(x > 0, ca.if_else(x > 0, y, 1), 2), 1),
    "conditional": (ca.conditional(x > 0, [y], 3 * y), 1),
    "comparison as a number": (x * (y < 0.5), 1),
    "heaviside": (ca.heaviside(x - 1), 1),
    "ramp": (ca.ramp(x - 1), 1),
    "piecewise linear": (ca.pw_lin(x, [-1, 0, 2], [1, 0, 3]), 1),
    "copysign": (ca.copysign(x, y), 2),
    "copysign of what is zero on one side": (ca.copysign(x, ca.fmax(0, y)), 1),
    "copysign of zero": (ca.copysign(x, 0), 1),
    "root of a square": (ca.sqrt(x**2) + y, 1),
    "root of the square of a size": (ca.sqrt((2 * ca.fabs(x) - 1) ** 2), 3),
    "norm_1": (ca.norm_1(ca.vertcat(x, y)), 2),
    "norm_inf": (ca.norm_inf(ca.vertcat(x, y)), 4),
    "one surface, three switches": (ca.sign(x) + ca.fabs(-3 * x) + ca.fmax(0, x / 2), 1),
    "Stribeck friction": (ca.sign(y) * (1 + ca.exp(-ca.fabs(y) / 0.3)), 1),
    "asymmetric friction": (ca.sign(y) * ca.if_else(y > 0, 0.4, 0.3), 1),
    "square": ((1 + ca.sign(x)) ** 2 * y, 1),
    "exponential": (ca.exp(ca.sign(x)), 1),
    "power of a size": (ca.fabs(x) ** 1.5, 1),
    "saturation": (ca.fmax(ca.fmin(x, 1), -1), 2),
    "dead zone": (ca.if_else(ca.fabs(x) < 1, 0, x), 3),
    "size of a size": (ca.fabs(ca.fabs(x) - 1), 3),
    "switch moved by a switch": (ca.sign(x - 0.1 * ca.sign(y)), 3),
    "equal on one side": (ca.if_else(x < ca.fabs(x), y, 1) + (y <= ca.fabs(y)), 1),
    "product of relays": (ca.sign(x) * ca.sign(y), 2),
    "parameters only": (x * ca.fmax(mu, 0.1) * ca.sign(mu), 0),
    "a square hides the sign": (ca.sign(x) ** 2 * y, 0),
    "cancels": (ca.sign(x) + ca.sign(-2 * x), 0),
    "guarded root": (ca.if_else(x > 0, ca.sqrt(ca.fmax(x, 0)), 0), 1),
}


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_number_of_surfaces(name):
    expression, surfaces = EXPRESSIONS[name]
    assert lift([x, y], [expression, 1], parameters=[mu]).surface_count == surfaces


@functools.cache
def prepared(name):
    expression, _ = EXPRESSIONS[name]
    return (
        ca.Function("f", [x, y, mu], [expression]),
        lift([x, y], [expression, x], parameters=[mu]),
    )


@pytest.mark.slow_cases("sign")
@pytest.mark.parametrize("name", EXPRESSIONS)
@at_most(30)
@given(a=st.floats(-3, 3), b=st.floats(-3, 3), m=st.floats(-1, 1))
def test_off_the_surfaces_the_field_is_the_expression(name, a, b, m):
    assume(a != 0.0)  # where sign(x)**2 is 0 instead of 1
    original, system = prepared(name)
    lifted = value(system, [a, b], {mu: m})
    np.testing.assert_allclose(lifted, [float(original(a, b, m)), a], rtol=1e-13, atol=1e-13)


# A small grammar of expressions with switches in switches.
leaves = st.sampled_from([x, y, ca.SX(1), ca.SX(0.5), ca.SX(-2)])
expressions = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.builds(lambda a, b: a + b, inner, inner),
        st.builds(lambda a, b: a * b, inner, inner),
        st.builds(ca.sign, inner),
        st.builds(ca.fabs, inner),
        st.builds(ca.fmax, inner, inner),
        st.builds(ca.fmin, inner, inner),
        st.builds(lambda a, b, c: ca.if_else(a < b, c, a), inner, inner, inner),
        st.builds(lambda a: ca.sin(a), inner),
    ),
    max_leaves=6,
)


@at_most(50)  # points off x = 0, x = y, ..., where a removed switch could be 0
@given(expressions, st.floats(-3, 3).map(lambda v: v + 0.12345678), st.floats(-3, 3).map(np.exp))
def test_any_expression_is_itself_off_the_surfaces(expression, a, b):
    try:
        system = lift([x, y], [expression, 1])
    except ns.DefinitionError as error:  # 2^n sides
        assert "at most 6 others" in str(error)
        return
    original = float(ca.Function("f", [x, y], [expression])(a, b))
    lifted = value(system, [a, b])
    assert lifted[0] == pytest.approx(original, rel=1e-12, abs=1e-12)


@at_most(50)
@given(expressions)
def test_every_field_is_affine_in_every_multiplier(expression):
    try:
        system = lift([x, y], [expression, 1])
    except ns.DefinitionError:
        return
    for i in range(system.surface_count):
        symbols = [ca.SX.sym(f"l{k}") for k in range(system.surface_count)]
        assert ca.is_linear(system.field_with(ca.vertcat(*symbols)), symbols[i])


# the same runs as hand-written systems ---------------------------------------------------------


def same_runs(lifted, written, start, t_end):
    one, two = (ns.simulate(s, start, t_end, tol=1e-12) for s in (lifted, written))
    assert one.itinerary == two.itinerary and one.status is two.status
    np.testing.assert_allclose([e.t for e in one.events], [e.t for e in two.events], atol=1e-10)
    np.testing.assert_allclose(one.x[-1], two.x[-1], atol=1e-10)
    return one


def test_dry_friction():
    written = ns.FilippovSystem([x, y], field=[y, -x - 0.4 * lam], multipliers=lam, surface=y)
    run = same_runs(lift([x, y], [y, -x - 0.4 * ca.sign(y)]), written, [3.0, 0.0], 20.0)
    assert run.itinerary == "- + - + s"
    assert run.x[-1, 0] == pytest.approx(-0.2, abs=1e-10)


def test_stick_slip_with_a_speed_that_weakens_friction():
    """Leine's oscillator: fabs in the denominator is continuous, so there is one reading."""
    force = ca.sign(0.2 - y) / (1 + 3 * ca.fabs(y - 0.2))
    system = lift([x, y], [y, -x + force])
    written = ns.FilippovSystem(
        [x, y],
        surface=0.2 - y,
        above=[y, -x + 1 / (1 + 3 * (0.2 - y))],
        below=[y, -x - 1 / (1 + 3 * (y - 0.2))],
    )
    assert [s.hidden for s in system.lifted] == [False]
    run = same_runs(system, written, [0.0, 0.0], 30.0)
    sticks = [e.t for e in run.events if e.kind == "entry"]
    assert np.diff(sticks)[-1] == pytest.approx(12.001031294830578647, abs=1e-9)


def test_two_relays():
    s1, s2 = ca.sign(x), ca.sign(y)
    l1, l2 = ca.SX.sym("l1"), ca.SX.sym("l2")
    written = ns.FilippovSystem(
        [x, y], surfaces=[x, y], multipliers=[l1, l2], field=[-l1 + 2 * l2, -2 * l1 - l2]
    )
    run = same_runs(lift([x, y], [-s1 + 2 * s2, -2 * s1 - s2]), written, [1.0, 0.5], 2.0)
    rest = run.events[-2]
    assert run.status is ns.Status.REACHED_END and rest.kind == "rest"
    assert rest.t == pytest.approx(0.75, abs=1e-9)
    assert np.abs(run.x[-1]).max() < 1e-12


def test_harvest_with_if_else():
    a, d, effort, b, level = 0.3556, 0.0444, 0.2067, 0.3, ca.SX.sym("level")
    eaten = a * x / (b + x)
    common = [x * (1 - x) - eaten * y, eaten * y - d * y]
    system = lift(
        [x, y],
        [common[0], common[1] - ca.if_else(y > level, effort * y, 0)],
        parameters={level: 1.0},
    )
    written = ns.FilippovSystem(
        [x, y],
        surface=y - level,
        above=[common[0], common[1] - effort * y],
        below=common,
        parameters={level: 1.0},
    )
    same_runs(system, written, [0.3, 0.6], 60.0)


def test_state_dependent_jump_with_a_parameter():
    """IFDIFF's example: the range p <= x < p + 0.5 is two surfaces, and explicit time is kept."""
    p = ca.SX.sym("p")
    inside = ca.logic_and(x >= p, x < p + 0.5)
    system = lift([x, y], [0.01 * t**2 + y**3, 5 * inside], parameters={p: 5.437}, time=t)
    run = ns.simulate(system, [1.0, 0.0], 20.0, tol=1e-13)
    assert [s.function for s in system.lifted] == ["(x-p)", "((p+0.5)-x)"]
    switches = [e.t for e in run.events if e.kind == "crossing"]
    np.testing.assert_allclose(switches, [11.000275475194824, 11.270040323650827], atol=1e-9)
    np.testing.assert_allclose(run.x[-1], [49.2550674190591, 1.34882424228], rtol=1e-9)


def test_saturation_crosses_its_corners():
    """x'' = -sat(x) from (2, 0): each corner is at the time of its closed form."""
    system = lift([x, y], [y, -ca.fmax(ca.fmin(x, 1), -1)])
    run = ns.simulate(system, [2.0, 0.0], 4.0, tol=1e-13)
    first = np.sqrt(2.0)  # 2 - t^2/2 = 1
    second = first + 2 * np.arctan(1 / first)  # cos s - sqrt(2) sin s = -1
    crossings = [e.t for e in run.events if e.kind == "crossing"]
    np.testing.assert_allclose(crossings[:2], [first, second], atol=1e-11)


def test_absolute_value_slides_where_it_should():
    """x' = -1 + 2 fabs(y) ... y' = -sign(y): sliding on y = 0, where fabs(y) = 0."""
    run = ns.simulate(lift([x, y], [-1 + 2 * ca.fabs(y), -ca.sign(y)]), [0.0, 0.5], 2.0)
    assert run.itinerary == "+ s"
    assert run.x[-1, 0] == pytest.approx(-2.0 + 2 * 0.5**2 / 2, abs=1e-9)


# report and refusals ---------------------------------------------------------------------------


def test_surfaces_are_reported_in_order():
    system = lift([x, y], [ca.sign(y) + ca.fabs(x), ca.if_else(y > 0, 1, 2)])
    surfaces = "2 surfaces (continuous of order 1, generic): x, y"
    assert repr(system) == f"FilippovSystem(2 states: x, y; {surfaces})"
    assert [(s.surface, s.multiplier, s.function, s.origins) for s in system.lifted] == [
        ("h0", "lam1", "x", ("fabs",)),
        ("h1", "lam0", "y", ("comparison", "sign")),
    ]
    assert str(system.lifted[0]) == "h0 = x (fabs)"
    again = pickle.loads(pickle.dumps(system))
    assert again.lifted == system.lifted and again.content_hash() == system.content_hash()


@pytest.mark.parametrize(
    ("expression", "hidden"),
    [
        (ca.sign(x), False),
        (ca.sign(x) * ca.fabs(x) ** 3, False),
        (ca.sqrt(1 + ca.fmax(x, 0)), False),
        (ca.sin(ca.fmax(ca.fmin(x, 1), -1)), False),
        (ca.sign(x) * (y + ca.sign(x)), True),
        (ca.exp(ca.sign(x)), True),
        (1 / (2 + ca.sign(x)), True),
    ],
)
def test_other_readings_on_the_surface_are_reported(expression, hidden):
    system = lift([x, y], [expression, 1])
    assert any(s.hidden for s in system.lifted) is hidden
    assert any("hidden dynamics" in str(s) for s in system.lifted) is hidden


def test_hidden_dynamics_is_read_as_filippov():
    """Jeffrey's example: off the surface y' = 1, and so it is on it."""
    system = lift([x, y], [0.2 - ca.sign(x), 2 * ca.sign(x) ** 2 - 1])
    assert ns.simulate(system, [0.0, 0.0], 1.0).x[-1, 1] == pytest.approx(1.0)
    hidden = lift([x, y], [0.2 - ca.sign(x), 2 * ca.sign(x) ** 2 - 1], hidden=True)
    assert ns.simulate(hidden, [0.0, 0.0], 1.0).x[-1, 1] == pytest.approx(-0.92)


def test_hidden_keeps_only_what_is_nonlinear_on_the_surface():
    both = [ca.sign(x) ** 2 - ca.sign(y) / (1 + ca.fabs(y)), 1]
    assert lift([x, y], both, hidden=True).nonlinear == (True, False)
    assert lift([x, y], both).surface_count == 1


def test_names_do_not_clash_with_the_users():
    lam0 = ca.SX.sym("lam0")
    assert lift([lam0], [-ca.sign(lam0)]).lifted[0].multiplier == "lam_0"


def test_switches_of_time_with_a_state_are_surfaces():
    system = lift([x], [1 - 2 * ca.sign(x - ca.sin(t))], time=t)
    assert system.time_dependent and system.surface_count == 1


def test_smooth_expressions_have_no_surface():
    assert lift([x, y], [y, -ca.sin(x)]).surface_count == 0
    assert lift([x, y], ca.vertcat(y, -x)).lifted == ()


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        (ca.floor(x), "rhs.*floor"),
        (ca.ceil(x), "rhs.*ceil"),
        (ca.fmod(x, 2), "fmod"),
        (ca.remainder(x, 2), "remainder"),
        (ca.if_else(x == 0, 1, 2), r"rhs.*comparison \([=!]="),
        (x != y, r"rhs.*comparison \([=!]="),
        (ca.if_else(x, 1, 2), "if_else.*comparison"),
        (ca.logic_not(x), "logic_not"),
    ],
)
def test_what_cannot_be_lifted_is_named(expression, message):
    with pytest.raises(ns.NotSmoothError, match=message):
        lift([x, y], [1, y + expression])


def test_definitions_are_checked():
    wave = lift([x], [ca.sign(ca.sin(t))], time=t)  # a surface of the time alone
    assert str(wave.surface_function()) == "sin(t)"
    with pytest.raises(ns.DefinitionError, match=r"rhs.*'q'"):
        lift([x], [ca.sign(ca.SX.sym("q"))])
    with pytest.raises(ns.DefinitionError, match=r"\brhs\b"):
        lift([x], [x, x])
    with pytest.raises(ns.DefinitionError, match=r"\brhs\b"):
        lift([x], [ca.MX.sym("x")])
    with pytest.raises(ns.DefinitionError, match=r"rhs.*at most 6"):
        lift([x], [ca.sign(x + sum(ca.fabs(x - k) for k in range(7)))])
    with pytest.raises(ns.NotSmoothError, match="stop"):
        lift([x], [ca.sign(x)], stops=[ns.Stop(ca.sign(x) + x)])
