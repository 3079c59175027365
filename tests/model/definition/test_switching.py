"""The class of a surface, beside classes by hand, and under changes that leave it as it is."""

import re

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import nonsmooth as ns
from tests.drawing import at_most
from tests.orbit.periodic_cases import cases_of

x, y, z, v, w, k, c, l1, l2 = (
    ca.SX.sym(s) for s in ("x", "y", "z", "v", "w", "k", "c", "l1", "l2")
)

CASES = cases_of("cases/continuous_switching.json")
CLASSES = {name: case for name, case in CASES.items() if name.startswith("class")}


def _read(text, symbols):
    return eval(text, {"sinh": ca.sinh}, symbols)


@pytest.mark.parametrize("name", CLASSES)
def test_classes_of_reference(name):
    case = CLASSES[name]
    of, expected = case["system"], case["values"]["class_"]
    symbols = {s: ca.SX.sym(s) for s in (*of["states"], "k", "p", "c")}
    surface, *_ = (_read(h, symbols) for h in of["surfaces"])
    above, below = ([_read(f, symbols) for f in of[side]] for side in ("above", "below"))
    used = {s.name() for s in ca.symvar(ca.vertcat(*above, *below))} - set(of["states"])
    states = [symbols[s] for s in of["states"]]
    parameters = [symbols[s] for s in sorted(used)]
    system = ns.FilippovSystem(
        states, surface=surface, above=above, below=below, parameters=parameters
    )
    kind, order = re.match(r"([a-z ]+), [mk]=(\d)", expected).groups()
    found = system.switching()
    assert (found.kind, found.order) == (kind, int(order)) and not found.slides


def _two(surface, above, below, states=(x, v), **more):
    return ns.FilippovSystem(states, surface=surface, above=above, below=below, **more)


@pytest.mark.parametrize(
    ("stiffness", "gap", "push"), [(0.7, 0.1, 0.07), (5.3, 2.17, 11.501), (9.0, 0.3, 2.7)]
)
def test_a_stop_of_numbers_is_continuous_to_their_rounding(stiffness, gap, push):
    """0.7 x - 0.07 is not zero at the double 0.1; a force of 1e-15 beside it is one that jumps."""
    for more, kind in ((0.0, "continuous"), (1e-13, "velocity continuous")):
        force = ca.if_else(x > gap, push + more - stiffness * x, 0)
        system = ns.FilippovSystem.from_expression([x, v], [v, force - x])
        assert system.switching().kind == kind


BY_HAND = {
    "dashpot": (_two(x - 1, [v, -5 * (x - 1) - v], [v, 0]), "velocity continuous", 1, 1.5),
    "quadratic dashpot": (_two(x - 1, [v, x - 1 - v**2], [v, 0]), "velocity continuous", 2, 1.5),
    "relay of the force": (_two(x, [v, -1], [v, 1]), "velocity continuous", 0, 0.5),
    "friction": (_two(v, [v, -1], [v, 1]), "generic", None, None),
    "cosine": (_two(x, [1, ca.cos(x) * v], [1, v]), "continuous", 2, 2.5),
    "logarithm": (_two(x - 1, [1, ca.log(x) * v], [1, 0]), "continuous", 1, 1.5),
    "cube of tanh": (_two(x, [1, ca.tanh(x) ** 3], [1, 0]), "continuous", 3, 3.5),
    "surface of degree 3": (
        _two(x**3 + v**3 - 1, [x**3 + v**3 - 1, 1], [0, 1]),
        "continuous",
        1,
        1.5,
    ),
    "identity of exponentials": (
        _two(x, [1, ca.exp(v) * ca.exp(2 * v) + x], [1, ca.exp(3 * v)]),
        "continuous",
        1,
        1.5,
    ),
    "no identity of exponentials": (
        _two(x, [1, ca.exp(v) * ca.exp(2 * v)], [1, ca.exp(3.0000001 * v)]),
        "velocity continuous",
        None,
        None,
    ),
    "Hertz": (_two(x - 1, [v, -((x - 1) ** 1.5)], [v, 0]), "continuous", None, None),
    "bodies that touch": (
        _two(x - y, [v, y - x, w, x - y], [v, 0, w, 0], (x, v, y, w)),
        "continuous",
        1,
        1.5,
    ),
    "dashpot between bodies": (
        _two(x - y, [v, w - v, w, v - w], [v, 0, w, 0], (x, v, y, w)),
        "velocity continuous",
        1,
        1.5,
    ),
    "dashpot of an angle": (
        _two(ca.sin(x) - 0.5, [v, -v * ca.cos(x)], [v, 0]),
        "velocity continuous",
        1,
        1.5,
    ),
    "a jump of 1e-12": (_two(v, [v, -1e-12], [v, 1e-12]), "generic", None, None),
}


@pytest.mark.parametrize("name", BY_HAND)
def test_classes_by_hand(name):
    system, *expected = BY_HAND[name]
    found = system.switching()
    assert [found.kind, found.order, found.touch_order] == expected


def test_both_walls_of_a_gap_are_springs():
    force = (x - 1) * (1 + l1) / 2 + (x + 1) * (1 - l2) / 2
    system = ns.FilippovSystem(
        [x, v], field=[v, -x - 5 * force], surfaces=[x - 1, x + 1], multipliers=[l1, l2]
    )
    assert [system.switching(i).order for i in (0, 1)] == [1, 1]
    assert {system.switching(i).kind for i in (0, 1)} == {"continuous"}


def test_modes_of_the_other_surface():
    system = ns.FilippovSystem(
        [x, v, y], field=[v, -x - l1 * (1 + l2), 1 - 2 * l2], surfaces=[x, y], multipliers=[l1, l2]
    )
    kinds = {mode: system.switching(0, mode=mode).kind for mode in ("++", "+-", "+s")}
    assert kinds == {"++": "velocity continuous", "+-": "continuous", "+s": "velocity continuous"}
    assert system.switching(0).kind == "velocity continuous"


def test_sliding_of_another_surface_makes_a_jump_of_force_one_of_velocity():
    """While y slides, the force of the wall enters y' and with it the multiplier that moves x."""
    system = ns.FilippovSystem(
        [x, v, y], field=[v + l2, -x, 0.2 * l1 - 2 * l2], surfaces=[x, y], multipliers=[l1, l2]
    )
    assert system.switching(0, mode="++").kind == "velocity continuous"
    assert system.switching(0, mode="+s").kind == "generic"


def test_a_class_at_one_value_of_a_parameter():
    system = _two(x - 1, [v, -x - k * (x - 1) - c], [v, -x], parameters={k: 5.0, c: 0.0})
    assert system.switching().kind == "velocity continuous"
    assert system.switching(parameters={}).kind == "continuous"
    assert system.switching(parameters={"c": 1e-300}).kind == "velocity continuous"
    with pytest.raises(ns.ParameterError):
        system.switching(parameters={"d": 1.0})


def test_a_set_is_generic_and_wrong_surfaces_are_refused():
    lam = ca.SX.sym("lam", 2)
    disc = ns.FilippovSystem(
        [x, v], field=[-lam[0], -lam[1]], surfaces=[ca.vertcat(x, v)], multipliers=[lam]
    )
    assert disc.switching().kind == "generic"
    with pytest.raises(ns.DefinitionError):
        disc.switching(2)


@at_most(12)
@given(st.integers(0, 10**6), st.sampled_from(sorted(set(BY_HAND) - {"Hertz"})))
def test_a_linear_change_of_states_and_a_unit_of_h_change_nothing(seed, name):
    system, kind, order, _ = BY_HAND[name]
    generator = np.random.default_rng(seed)
    old, n = system.extended_states, system.dimension
    matrix = np.eye(n) + generator.integers(-2, 3, (n, n)) * np.tri(n, n, -1)
    new = ca.SX.sym("u", n)
    at = ca.mtimes(ca.DM(np.linalg.inv(matrix).round()), new)
    h = ca.substitute(system.surface_function(), old, at) * 2.0 ** int(generator.integers(-9, 9))
    fields = [ca.mtimes(ca.DM(matrix), ca.substitute(system.field(mode), old, at)) for mode in "+-"]
    above, below = (ca.vertsplit(f) for f in fields)
    found = _two(h, above, below, ca.vertsplit(new)).switching()
    assert (found.kind, found.order) == (kind, order)
    swapped = _two(-h, below, above, ca.vertsplit(new)).switching()
    assert (swapped.kind, swapped.order) == (kind, order)
