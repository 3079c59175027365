"""A system is defined in either form, and every inconsistent definition is refused."""

import math
import pickle

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.model import coupled_of, motion

x, v, t, lam, kap = (ca.SX.sym(s) for s in ("x", "v", "t", "lam", "kap"))
belt, friction = ca.SX.sym("belt"), ca.SX.sym("friction")


def stick_slip(**changes):
    definition = {
        "states": [x, v],
        "surface": v - belt,
        "above": [v, -x - friction],
        "below": [v, -x + friction],
        "parameters": {belt: 0.3, friction: 0.4},
    }
    return ns.FilippovSystem(**{**definition, **changes})


def test_the_two_forms_give_the_same_fields():
    a = stick_slip()
    b = ns.FilippovSystem(
        [x, v],
        field=[v, -x - lam * friction],
        multipliers=lam,
        surface=v - belt,
        parameters={belt: 0.3, friction: 0.4},
    )
    for mode in "+-s":
        for system in (a, b):
            m = motion(system, mode)
            value = system.evaluate(m.field, [0.2, 0.7]).ravel()
            expected = {"+": [0.7, -0.6], "-": [0.7, 0.2], "s": [0.7, 0.0]}[mode]
            np.testing.assert_allclose(value, expected, atol=1e-15)


def test_fields_fold_back_to_what_was_given():
    """No rounding from the convex combination: at lambda = +-1 the field is the expression given."""
    system = stick_slip()
    assert ca.is_equal(system.field("+")[1], -x - friction, 10)
    assert ca.is_equal(system.field("-")[1], -x + friction, 10)


def test_lie_derivatives_are_mixed_in_the_order_of_the_theory():
    """L12 = F1 . grad(F2 . grad h), and explicit time contributes its partial derivative."""
    y, z = ca.SX.sym("y"), ca.SX.sym("z")
    system = ns.FilippovSystem([x, y, z], surface=x, above=[-y, 1, -2], below=[z, -1, 1 + y])
    assert system.evaluate(system.lie_derivative("+-"), [0, 0, 0]).item() == -2.0  # F1 . grad z
    assert system.evaluate(system.lie_derivative("-+"), [0, 0, 0]).item() == 1.0  # F2 . grad(-y)
    moving = ns.FilippovSystem([x], surface=x - ca.sin(t), above=[1], below=[2], time=t)
    value = moving.evaluate(moving.lie_derivative("++"), [0.0], t=0.5)
    assert value.item() == pytest.approx(np.sin(0.5))


def test_a_system_survives_pickling():
    system = stick_slip(
        stops=[ns.Stop(x - 1, -1, "wall")], resets=[ns.Reset(x + 1, [x, -v], 1, "bounce back")]
    )
    copy = pickle.loads(pickle.dumps(system))
    assert repr(copy) == repr(system)
    assert copy.content_hash() == system.content_hash() != stick_slip().content_hash()
    assert copy == system != stick_slip() and hash(copy) == hash(system)
    assert system != "a system"
    runs = [ns.simulate(s, [0.0, 0.0], 20.0) for s in (system, copy)]
    assert runs[0].x.tolist() == runs[1].x.tolist()


def test_parameters_by_symbol_and_by_name():
    system = stick_slip()
    assert system.parameter_vector({belt: 1.0}).tolist() == [1.0, 0.4]
    assert system.parameter_vector({"friction": 2}).tolist() == [0.3, 2.0]


def test_products_of_different_multipliers_are_allowed():
    system = ns.FilippovSystem(
        [x, v], field=[lam * kap, -lam - kap], multipliers=[lam, kap], surfaces=[x, v]
    )
    assert system.modes == ("++", "+-", "+s", "-+", "--", "-s", "s+", "s-")


FOREIGN_X = ca.SX.sym("x")
WRONG = {
    "a missing field": ({"below": None}, "below"),
    "a field of the wrong length": ({"above": [v]}, "above"),
    "an undeclared symbol": ({"above": [v, t]}, "field.*'t'"),
    "a second symbol of the same name": ({"above": [FOREIGN_X, v]}, "field.*'x'"),
    "a constant surface": ({"surface": 1.0}, "surface 0.*constant"),
    "a surface of parameters only": ({"surface": belt}, "surface 0.*constant"),
    "a function of Python's math": ({"above": [v, math.sin(x)]}, "casadi.sin"),
    "a function as a field": ({"above": lambda x, v: [v, x]}, "above.*function"),
    "functions in a field": ({"above": [v, lambda x: x]}, "if_else"),
    "NaN in a field": ({"above": [v, np.nan]}, "field.*nan"),
    "inf in a surface": ({"surface": v - ca.inf}, "surface 0.*inf"),
    "NaN as a default": ({"parameters": {belt: np.nan, friction: 1}}, "parameter 'belt'"),
    "the same name twice": ({"parameters": {ca.SX.sym("x"): 1.0}}, "symbols.*'x'"),
    "a state that is no symbol": ({"states": [x, 2 * v]}, "states"),
    "states as strings": ({"states": ["x", "v"]}, "states"),
    "no states": ({"states": []}, "states"),
    "a vector entry": ({"above": [v, ca.vertcat(x, v)]}, "above.*shape"),
    "text in a field": ({"above": [v, "x"]}, "above.*'x'"),
    "MX": ({"above": [v, ca.MX.sym("m")]}, "contains.*'m'"),
    "both forms": ({"field": [v, x]}, "above=.*field="),
    "surface twice": ({"surfaces": [v]}, "surface=.*surfaces="),
    "a wrong direction": ({"stops": [ns.Stop(x, 2)]}, "direction of 'stop'"),
    "a surface with a multiple zero": ({"surface": (v - 1) ** 3}, "surface 0.*factor"),
    "a stop with a double zero": ({"stops": [ns.Stop(x * (v - x) ** 2)]}, "stop 'stop'.*factor"),
    "a reset map of the wrong length": ({"resets": [ns.Reset(x, [x])]}, "map of reset 'reset'"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_definitions_are_refused_in_words(name):
    changes, message = WRONG[name]
    with pytest.raises(ns.NonsmoothError, match=message) as caught:
        stick_slip(**changes)
    assert isinstance(caught.value, ValueError)


@pytest.mark.parametrize(
    "operation",
    [
        ca.fabs(x),
        ca.sign(v),
        ca.fmin(x, v),
        ca.fmax(x, 0),
        ca.if_else(x > 0, x, v),
        ca.floor(x),
        (x > 0) * v,
        ca.fmod(x, 1),
        ca.atan2(0, x),
        ca.atan2(x, 0),
        ca.hypot(x, 0),
    ],
)
@pytest.mark.parametrize("where", ["above", "surface", "stops"])
def test_non_smooth_operations_are_refused_with_advice(operation, where):
    changes = {
        "above": {"above": [v, operation]},
        "surface": {"surface": operation + v},
        "stops": {"stops": [ns.Stop(ca.sin(operation))]},  # fmin and fmax of guards are conditions
    }[where]
    advice = "conditions" if where == "stops" else "surface"
    with pytest.raises(ns.NotSmoothError, match=advice):
        stick_slip(**changes)


def test_multipliers_must_be_linear_and_one_per_surface():
    with pytest.raises(ns.DefinitionError, match="hidden"):
        ns.FilippovSystem([x], field=[lam**2], multipliers=lam, surface=x)
    with pytest.raises(ns.DefinitionError, match="multipliers"):
        ns.FilippovSystem([x], field=[lam], multipliers=[lam, kap], surface=x)
    with pytest.raises(ns.DefinitionError, match=r"surface 0.*multiplier"):
        ns.FilippovSystem([x], field=[lam], multipliers=lam, surface=x + lam)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"speed": 1.0}, "parameters.*'speed'"),
        ({"belt": np.inf}, "parameter 'belt'"),
        ({"belt": "fast"}, "parameter 'belt'"),
    ],
)
def test_wrong_parameters_are_refused(parameters, message):
    with pytest.raises(ns.ParameterError, match=message):
        stick_slip().parameter_vector(parameters)


def test_a_missing_parameter_is_named():
    system = stick_slip(parameters=[belt, friction])
    with pytest.raises(ns.ParameterError, match=r"parameters.*'belt', 'friction'"):
        system.parameter_vector()
    assert system.parameter_vector({"belt": 1, "friction": 2}).tolist() == [1, 2]


@pytest.mark.parametrize(
    ("point", "message"),
    [
        ([1.0], r"point.*shape \(1,\)"),
        ([[1.0, 2.0]], r"point.*shape \(1, 2\)"),
        ([1.0, np.nan], "point.*finite"),
        ([1.0, np.inf], "point.*finite"),
        (["a", "b"], "point.*numbers"),
        (None, "shape"),
    ],
)
def test_wrong_points_are_refused(point, message):
    with pytest.raises(ns.PointError, match=message):
        stick_slip().extended_point(point)


def test_a_mode_of_the_wrong_form_is_refused():
    for mode in ("", "++", "x", 1):
        with pytest.raises(ns.DefinitionError, match="mode"):
            stick_slip().parse_mode(mode)


def test_a_field_continuous_across_the_surface_is_seen_however_it_is_written():
    """Two products that differ by a multiple of h: no factor is in sight, yet F1 = F2 on h = 0."""
    a, b = x + 2 * v, 3 + x * v
    system = ns.FilippovSystem(
        [x, v], surface=v - 1, above=[a * b, v], below=[(a + (v - 1)) * b, v * v]
    )
    assert coupled_of(system).continuous[0]
    run = ns.simulate(ns.FilippovSystem([x, v], surface=v, above=[1, a * v], below=[1, (a + v) * v]),
                      [0.0, 0.0], 1.0)  # fmt: skip
    assert run.status is ns.Status.REACHED_END


def test_field_of_a_mode_slides_too():
    """Filippov's convex combination: the one that keeps h at zero, and each side's own."""
    x, y, a = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("a")
    system = ns.FilippovSystem(
        [x, y], surface=y, above=[1, -a], below=[3 * x, 1], parameters={a: 2.0}
    )
    point = [0.5, 0.0]
    assert system.evaluate(ns.local.mode_field(system, "+"), point).ravel().tolist() == [1.0, -2.0]
    sliding = system.evaluate(ns.local.mode_field(system, "s"), point).ravel()
    assert sliding == pytest.approx(ns.sliding_field(system, point), abs=1e-15)
    assert sliding == pytest.approx([1.0 / 3 + 2.0 / 3 * 1.5, 0.0], abs=1e-15)


def test_a_field_that_is_known_implicitly_is_refused():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    lam = ca.SX.sym("lam", 2)
    system = ns.FilippovSystem([x, y], field=[-lam[0], -lam[1]], multipliers=lam, surfaces=[x, y])
    assert ns.local.mode_field(system, "s+").numel() == 2
    with pytest.raises(ns.DefinitionError, match=r"mode.*'ss'"):
        ns.local.mode_field(system, "ss")
