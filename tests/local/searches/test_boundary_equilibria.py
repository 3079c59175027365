"""Boundary equilibria: textbook values, the threshold of BF2 and BF3, exact derivatives by parameters."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth import textbook
from nonsmooth.local import (
    boundary_equilibrium,
    classify,
    find_boundary_equilibrium,
    find_equilibrium,
)
from nonsmooth.local.point.surface_point import surface_at
from nonsmooth.local.searches.boundary_equilibria import fold_orbit_landing

X, Y, Z = (ca.SX.sym(s) for s in "xyz")


@pytest.mark.parametrize(
    ("side", "quantity", "near", "kind", "label"),
    [
        ("-", "boundary focus", (0.05, 0.9), "unstable focus", "BF"),
        ("+", "boundary node", (0.7, 0.8), "stable node", "BN"),
    ],
)
def test_harvested_predator_boundary_equilibria(side, quantity, near, kind, label):
    problem = textbook.harvested_prey_predator()
    at = find_boundary_equilibrium(problem.system, near, vary="alpha", side=side)
    assert problem[quantity].agrees(at.value)
    assert (at.parameter, at.side, at.parameters["alpha"]) == ("alpha", side, at.value)
    found = classify(problem.system, at.point, parameters=at.parameters)
    assert found.kind == "boundary equilibrium" and found.label.startswith(label)
    assert found.side == side
    real = find_equilibrium(problem.system, near, side=side, parameters=at.parameters)
    assert (real.kind, real.status) == (kind, "boundary")


def test_welander_box():
    problem = textbook.welander_box()
    for side, quantity in (("-", "k = 0"), ("+", "k = 5")):
        at = find_boundary_equilibrium(problem.system, [0.5, 0.5], vary="eps", side=side)
        assert problem[f"boundary equilibrium, {quantity}"].agrees(at.value)


def test_the_threshold_between_bf2_and_bf3():
    for rho, known in ((0.1, -0.586212601032527), (0.3, 0.052559241307771)):
        assert rho + (1 + rho**2) / fold_orbit_landing(rho, 1.0) == pytest.approx(known, abs=1e-14)
        for shift, label in ((-0.01, "BF3"), (0.01, "BF2"), (0.0, "degenerate")):
            c = known + shift
            system = ns.FilippovSystem(
                [X, Y], surface=Y, above=[rho * X - Y, X + rho * Y], below=[c, 1]
            )
            assert boundary_equilibrium(system, [0, 0]).label == label


def test_boundary_equilibrium_in_three_dimensions_is_persistence_or_fold():
    for s in (1.0, -1.0):
        system = ns.FilippovSystem(
            [X, Y, Z], surface=X, above=[-X + Y, -Y + Z, -2 * Z], below=[1, -s, -3]
        )
        found = boundary_equilibrium(system, [0, 0, 0])
        expected = np.linalg.solve([[-1, 1, 0], [0, -1, 1], [0, 0, -2]], [1, -s, -3])[0]
        assert found.numbers["s"] == pytest.approx(expected)
        assert found.label == ("nonsmooth fold" if expected > 0 else "persistence")


def test_the_derivative_by_the_parameter_is_exact():
    """A parameter that acts on a scale far below any step of differencing, and a surface with it."""
    mu, scale = ca.SX.sym("mu"), 1e-9
    system = ns.FilippovSystem(
        [X, Y],
        surface=Y - ca.sin(mu / scale) / 2,
        above=[Y - X, 1 - Y - ca.exp(mu / scale) / 4],
        below=[1, 1],
        parameters={mu: 0.1 * scale},
    )
    at = find_boundary_equilibrium(system, [0.5, 0.5], vary="mu", tol=1e-13)
    u = at.value / scale
    assert 1 - np.exp(u) / 4 == pytest.approx(np.sin(u) / 2, abs=1e-14)
    assert at.point == pytest.approx([np.sin(u) / 2] * 2, abs=1e-14)
    assert at.iterations < 8 and at.residual < 1e-13
    assert str(at).startswith("equilibrium of F1 (above) on the surface at [")


def test_derivatives_by_parameters_are_those_of_the_expressions():
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    system = ns.FilippovSystem(
        [X, Y],
        surface=Y - a * X**2,
        above=[a * b, ca.sin(b * X)],
        below=[X, a**3],
        parameters={a: 0.7, b: 1.3},
    )
    where, x = surface_at(system, [0.4, 0.9])
    h, fields = where.parameter_derivatives(x)
    assert h == pytest.approx([-0.16, 0.0])
    assert fields[0] == pytest.approx(np.array([[1.3, 0.7], [0.0, 0.4 * np.cos(0.52)]]))
    assert fields[1] == pytest.approx(np.array([[0.0, 0.0], [3 * 0.49, 0.0]]))


def test_a_pseudo_equilibrium_at_infinity_is_degenerate():
    """The other field has no part along the inverse image: s = 0 to all digits."""
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    above, below = [v, -x - 1 + 0.2 * v], [v, -x + 1 + 0.2 * v]
    system = ns.FilippovSystem([x, v], surface=v, above=above, below=below)
    found = boundary_equilibrium(system, [1.0, 0.0])
    assert found.label == "degenerate" and found.margins["s"] == 0.0
    assert found.margins["fold orbit meets the pseudo-saddle"] == 1.0
