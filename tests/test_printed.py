"""What is printed in an interactive session says what a result is: its kind, its size and how it ended."""

import casadi as ca
import numpy as np
import pytest

import bounce
import nonsmooth as ns

x, y = ca.SX.sym("x"), ca.SX.sym("y")
TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
SLIDING = ns.FilippovSystem([x, y], surface=y, above=[-x, -1 - y], below=[-x, 1])


def outcomes():
    axis = np.linspace(-1, 1, 4)
    return bounce.outcome_map(TURF, over={"xdot": axis, "omega": axis[:3]})


def attractor():
    """x' = x - x^3, y' = -y: runs from the right come to (1, 0)."""
    system = ns.FilippovSystem([x, y], field=[x - x**3, -y])
    found = ns.basins(system, np.array([[0.5, 0.3], [1.5, -0.2]]), t_end=40.0)
    return found.attractors[0]


@pytest.mark.parametrize(
    ("make", "printed"),
    [
        (lambda: ns.Clock(2.0, name="tick"), "Clock(period=2.0, name='tick')"),
        (outcomes, "OutcomeMap(xdot x omega, 4 x 3; regions "),
        (
            lambda: ns.certify(ns.find_pseudo_equilibrium(SLIDING, [0.0, 0.0]), system=SLIDING),
            "Proof(pseudo-equilibrium, real stable pseudo-node, proven)",
        ),
        (lambda: ns.certify_orbit(SLIDING, [0.5, 1.0], 1.0), "OrbitProof('+ s', end)"),
        (lambda: bounce.certify(TURF, 0.3, -1.0, 0.1), "BounceProof('+ s -', reverse)"),
        (attractor, "Attractor("),
        (
            lambda: ns.prove_all(SLIDING, [(-1, 1), (-1, 1)], "pseudo-equilibrium"),
            "Census(1 of kind pseudo-equilibrium, complete)",
        ),
        (
            lambda: ns.certify(
                ns.find_pseudo_equilibrium(SLIDING, [0.0, 0.0]), system=SLIDING
            ).point["x"],
            "Enclosure('0', '0')",
        ),
    ],
)
def test_a_result_prints_what_it_is(make, printed):
    assert repr(make()).startswith(printed)


@pytest.mark.slow
def test_a_dividing_curve_prints_its_arcs_and_where_they_join():
    curve = bounce.dividing_curve(TURF, ydot=-1.0)
    first, second = curve.arcs[:2]
    assert repr(first) == f"Arc('+ s', {len(first.points)} points, junction)"
    a, b = curve.junction
    assert f"junction ({a:g}, {b:g})" in repr(curve)
    assert len(curve.points) == sum(len(arc.points) for arc in curve.arcs)
    # The curve continues from arc to arc: the slipping one begins where the rolling one ends.
    np.testing.assert_allclose(first.points[-1], second.points[0], atol=1e-9)
