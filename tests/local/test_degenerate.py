"""Points on a boundary of the classification are degenerate and name it; corners are intersections."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, z, lam, kap = (ca.SX.sym(s) for s in ("x", "y", "z", "lam", "kap"))


def planar(above, below):
    return ns.FilippovSystem([x, y, z], surface=z, above=above, below=below)


def relays(states, field):
    return ns.FilippovSystem(states, surfaces=[x, y], multipliers=[lam, kap], field=field)


def test_folds_along_the_same_line_are_no_transversal_two_fold():
    """L1 = y and L2 = 2 y vanish together on the whole line y = 0."""
    system = ns.FilippovSystem([x, y, z], surface=x, above=[y, 1, 0], below=[2 * y, 1, 1])
    found = ns.classify(system, [0.0, 0.0, 0.0])
    assert found.kind == "degenerate"
    assert found.nearest == "dependent grad h, grad L1, grad L2"
    assert found.margins[found.nearest] == 0.0


def test_the_pseudo_equilibrium_of_one_state_has_no_eigenvalues():
    found = ns.classify(ns.FilippovSystem([x], surface=x, above=[-1], below=[1]), [0.0])
    assert (found.kind, found.label) == ("pseudo-equilibrium", "stable pseudo-node")
    assert found.detail.eigenvalues.size == 0


def test_a_zero_eigenvalue_along_a_surface_in_space_is_left_open():
    """x' = x^2, y' = -y on z = 0, which attracts: eigenvalues 0 and -1."""
    found = ns.classify(planar([x**2, -y, -1], [x**2, -y, 1]), [0.0, 0.0, 0.0])
    assert found.kind == "degenerate"
    assert found.nearest == "a sliding eigenvalue without real part"


def test_an_intersection_that_holds_still_is_a_pseudo_equilibrium():
    system = relays([x, y, z], [-lam, -kap, -z])
    rest = ns.classify(system, [0.0, 0.0, 0.0])
    assert (rest.kind, rest.label) == ("pseudo-equilibrium", "stable pseudo-node")
    np.testing.assert_allclose(rest.detail.eigenvalues, [-1.0])
    description = str(rest.detail)
    assert "multipliers 0, 0" in description
    assert "along the intersection ss -1" in description
    moving = ns.classify(system, [0.0, 0.0, 0.3])
    assert (moving.kind, moving.label) == ("sliding", "attracting sliding")
    assert moving.margins["a pseudo-equilibrium"] > 0.1


def test_mode_selects_one_surface_at_a_corner():
    system = relays([x, y], [-lam, -kap])
    one = ns.classify(system, [0.0, 0.0], mode="s+")
    assert (one.kind, one.label) == ("sliding", "attracting sliding")
    both = ns.classify(system, [0.0, 0.0], mode="ss")
    assert both.kind == "pseudo-equilibrium"


def test_a_corner_that_both_fields_cross_has_one_mode_beyond():
    found = ns.classify(relays([x, y], [1 + lam / 10, 1 + kap / 10]), [0.0, 0.0])
    assert (found.kind, found.label) == ("crossing", "crossing to ++")


def test_a_surface_is_named_by_its_number():
    system = relays([x, y, z], [-lam, -kap, 1 + lam * kap])
    with pytest.raises(ns.DefinitionError, match="surface"):
        ns.local.intersection_range(system, [0.0, 0.0, 0.0], z, surfaces="x")


def test_derivatives_that_do_not_exist_are_refused_with_the_order():
    """L1 = x^(5/2) at x = 0: the third derivative of h along the orbit is finite, the fourth is not."""
    system = ns.FilippovSystem([x, y], surface=y, above=[1, x**2.5], below=[1, 1])
    message = "point.*max_order"
    with pytest.raises(ns.PointError, match=message):
        ns.local.fold(system, [0.0, 0.0], side="+")
