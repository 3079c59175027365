"""Analysis at a point of a system with discrete states is that of the system that holds them."""

import casadi as ca
import numpy as np
import pytest
from matplotlib.figure import Figure

import nonsmooth as ns

x, v, q, g, k, c = (ca.SX.sym(s) for s in ("x", "v", "q", "g", "k", "c"))
UP = ns.Reset(x - 1, {q: 1}, 1, level=True, when=q == 0, name="up")
DOWN = ns.Reset(x + 1, {q: 0}, -1, level=True, when=q == 1, name="down")


def room():
    return ns.textbook.thermostat().system


def pushed():
    """A mass on a belt with the speed 0.2, pushed to the right or the left with a force k."""
    force = k * (2 * q - 1) - x
    return ns.FilippovSystem(
        [x, v],
        surface=v - 0.2,
        above=[v, force - c],
        below=[v, force + c],
        discrete={q: (0, 1)},
        resets=[UP, DOWN],
        parameters={k: 3.0, c: 0.5},
    )


@pytest.mark.parametrize(("value", "at"), [(0, 0.0), (1, 30.0)])
def test_an_equilibrium_is_that_of_the_discrete_state_and_has_no_eigenvalue_for_it(value, at):
    found = ns.find_equilibrium(room(), [20.0, value])
    assert found.point.tolist() == [at, value]
    assert found.eigenvalues.tolist() == [-1.0] and found.kind == "stable node"
    assert found.status == "virtual"  # the heating changes at 18 and 22 degrees
    at_rest = ns.classify(room(), [at, value])
    assert (at_rest.kind, at_rest.label) == ("equilibrium", "virtual stable node")
    inside = {"a": 20.0}
    if value:
        assert ns.find_equilibrium(room(), [20.0, 1], parameters=inside).status == "real"


@pytest.mark.parametrize("value", [0, 1])
def test_folds_sliding_and_pseudo_equilibria_are_those_of_the_system_that_holds_it(value):
    system, side = pushed(), 2 * value - 1
    held = system.holding({"q": value})
    assert held.state_names == ("x", "v") and not held.resets
    middle = 3.0 * side
    for letter, at in (("+", middle - 0.5), ("-", middle + 0.5)):  # force - c = 0, force + c = 0
        fold = ns.find_fold(system, [at + 0.1, 0.2, value], side=letter)
        np.testing.assert_allclose(fold.point, [at, 0.2, value], atol=1e-12)
        assert fold.kind == ns.find_fold(held, [at + 0.1, 0.2], side=letter).kind
    here = [middle + 0.25, 0.2, value]
    assert ns.region(system, here) is ns.Region.ATTRACTING
    assert ns.alpha(system, here) == pytest.approx(0.75, abs=1e-14)
    np.testing.assert_allclose(ns.sliding_field(system, here), [0.2, 0.0, 0.0], atol=1e-14)
    found = ns.classify(system, here)
    assert (found.kind, found.label) == ("sliding", "attracting sliding")
    assert found.point.tolist() == here


def test_a_branch_of_equilibria_holds_the_discrete_state():
    branch = ns.continue_equilibrium(pushed(), [2.5, 0.0, 1], "k", bounds=(1.0, 5.0), side="-")
    assert [e.name for e in branch.ends] == ["REACHED_BOUND"] * 2 and not branch.events
    for value in (1.5, 4.0):
        (at,) = branch.at(value)
        np.testing.assert_allclose(at.point, [value + 0.5, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("values", "error", "part"),
    [
        ({"p": 1}, ns.DefinitionError, r"discrete state of \['q'\], received \['p'\]"),
        ({}, ns.DefinitionError, "Write holding"),
        ([1], ns.DefinitionError, "expected a mapping"),
        ({"q": float("nan")}, ns.PointError, "finite"),
        ({"q": 3}, ns.PointError, "the discrete state q has the values"),
    ],
)
def test_values_that_are_none_are_refused(values, error, part):
    with pytest.raises(error, match=part):
        room().holding(values)


def test_points_need_all_states_and_allowed_values():
    with pytest.raises(ns.PointError, match="shape"):
        ns.find_equilibrium(room(), [20.0])
    with pytest.raises(ns.PointError, match="has the values"):
        ns.find_equilibrium(room(), [20.0, 0.5])
    with pytest.raises(TypeError, match="find_equilibrium"):
        ns.find_equilibrium(room())
    with pytest.raises(ns.DefinitionError, match="has none"):
        pushed().holding({q: 1}).holding({q: 1})


def test_pictures_and_connections_name_the_system_that_they_can_take():
    with pytest.raises(ns.OptionError, match=r"ax= is one picture.*holding=\{'q': 0"):
        ns.plot.phase_portrait(pushed(), (-5, 5, -2, 2), ax=Figure().add_subplot())
    with pytest.raises(ns.DefinitionError, match="holding"):
        ns.find_homoclinic(pushed(), [2.5, 0.0, 1], "k")


def test_a_smooth_point_is_no_equilibrium():
    with pytest.raises(ns.PointError, match="expected an equilibrium"):
        ns.classify(room(), [20.0, 1])


CHOICES = [
    (ca.logic_and(q == 1, x > 0), lambda x, q, g: q == 1 and x > 0),
    (ca.logic_or(q == 1, x > 0), lambda x, q, g: q == 1 or x > 0),
    (ca.logic_not(ca.logic_and(q == 1, x > 0)), lambda x, q, g: not (q == 1 and x > 0)),
    (ca.logic_and(q == 1, g >= 2), lambda x, q, g: q == 1 and g >= 2),
    (x > q, lambda x, q, g: x > q),
    (q, lambda x, q, g: q),
]


@pytest.mark.parametrize("number", range(len(CHOICES)))
def test_a_field_may_compare_discrete_states(number):
    """In the field of a plain system too, unless a state that moves is compared with them."""
    condition, holds = CHOICES[number]
    given = {"discrete": {q: (0, 1), g: (1, 2, 3)}}
    field = [ca.if_else(condition, 30, ca.fmax(g, 2)) - x]
    made = [ns.FilippovSystem.from_expression([x], field, **given)]
    if not ca.depends_on(condition, x):
        made.append(ns.FilippovSystem([x], field=field, **given))
    for system in made:
        for at in ((a, b, c) for a in (-0.7, 0.3, 1.4) for b in (0, 1) for c in (1, 2, 3)):
            rate = (30 if holds(*at) else max(at[2], 2)) - at[0]
            expected = at[0] + rate * (1 - np.exp(-0.01))
            assert ns.simulate(system, at, 0.01).x[-1, 0] == pytest.approx(expected, abs=1e-12)


def test_a_field_that_compares_needs_the_values():
    with pytest.raises(ns.DefinitionError, match=r"discrete=\{q: \(0, 1\)\}"):
        ns.FilippovSystem([x], field=[ca.if_else(q == 1, 30, 0) - x], discrete=[q])


@pytest.mark.parametrize("wrong", [q + 1, "q", 1.0])
def test_discrete_states_are_symbols(wrong):
    with pytest.raises(ns.DefinitionError, match="scalar symbol"):
        ns.FilippovSystem([x], field=[q - x], discrete={wrong: (0, 1)})


def test_a_filter_is_a_condition():
    with pytest.raises(ns.DefinitionError, match=r"Write a comparison, such as \(x-3\) >= 0"):
        ns.FilippovSystem([x], field=[-x], resets=ns.Reset(x - 1, [2.0], -1, when=x - 3))
