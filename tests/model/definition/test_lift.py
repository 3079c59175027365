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


def test_stick_slip_with_a_speed_that_weakens_friction():
    """Leine's oscillator: fabs in the denominator is continuous, so there is one reading."""
    force = ca.sign(y - 0.2) / (1 + 3 * ca.fabs(y - 0.2))
    system, written = lift([x, y], [y, -x - force]), ns.textbook.leine_stick_slip().system
    assert [s.hidden for s in system.lifted] == [False]
    run = same_runs(system, written, [0.0, 0.0], 30.0)
    sticks = [e.t for e in run.events if e.kind == "entry"]
    assert np.diff(sticks)[-1] == pytest.approx(12.001031294830578647, abs=1e-9)


def test_harvest_with_if_else():
    a, d, effort, b, level = 0.3556, 0.0444, 0.2067, 0.3, ca.SX.sym("level")
    eaten = a * x / (b + x)
    common = [x * (1 - x) - eaten * y, eaten * y - d * y]
    system = lift(
        [x, y],
        [common[0], common[1] - ca.if_else(y > level, effort * y, 0)],
        parameters={level: 0.9},
    )
    same_runs(system, ns.textbook.harvested_prey_predator().system, [0.3, 0.6], 60.0)


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
