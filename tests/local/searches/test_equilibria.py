"""Equilibria of the two fields: found from many starts, named by eigenvalues and by their side."""

import casadi as ca
import pytest

import nonsmooth as ns
from nonsmooth.local import find_all, find_equilibrium

X, Y = ca.SX.sym("x"), ca.SX.sym("y")


def test_equilibria_from_many_starts():
    system = ns.FilippovSystem(
        [X, Y], surface=X - 0.5, above=[Y, X - X**3], below=[Y, X - X**3 - 0.1 * Y]
    )
    starts = [[x, y] for x in (-1.5, -0.4, 0.1, 1.2) for y in (-0.5, 0.5)]
    below = find_all(lambda x: find_equilibrium(system, x, side="-"), starts)
    table = {round(e.point[0]): (e.status, e.kind) for e in below}
    assert table == {
        -1: ("real", "stable focus"), 0: ("real", "saddle"), 1: ("virtual", "stable focus")
    }  # fmt: skip
    centre = find_equilibrium(system, [0.9, 0.1])
    assert (centre.status, centre.kind) == ("real", "degenerate")  # a centre: no real part


def test_an_equilibrium_behind_a_contact_is_virtual():
    spring = ns.FilippovSystem(
        [X, Y], field=[Y, -X - 1 - 0.1 * Y], impacts=ns.Impact(X, name="floor")
    )
    free = find_equilibrium(spring, [0.0, 0.0])
    assert (free.point.round(12).tolist(), free.status) == ([-1.0, 0.0], "virtual")
    assert str(free).startswith("virtual stable focus at")
    assert find_equilibrium(spring, [0.0, 0.0], mode="o").status == "virtual"
    beside = ns.FilippovSystem(
        [X, Y], surface=X - 2, above=[Y, -X], below=[Y, 1 - X - Y], impacts=ns.Impact(X)
    )
    assert find_equilibrium(beside, [0.5, 0.0], mode="-o").point.round(12).tolist() == [1.0, 0.0]
    with pytest.raises(ns.PointError, match="the gap of the contact 'floor' is -1"):
        ns.classify(spring, free.point)
    away = ns.FilippovSystem([X, Y], field=[Y, 1 - X - 0.1 * Y], impacts=ns.Impact(X))
    assert find_equilibrium(away, [0.0, 0.0]).status == "real"
    touching = ns.FilippovSystem([X, Y], field=[Y, -X - 0.1 * Y], impacts=ns.Impact(X))
    assert find_equilibrium(touching, [0.1, 0.0]).status == "boundary"


def test_rest_on_a_contact_and_on_friction():
    """A mass on a spring of rest length 1 along the floor: it rests where the friction 0.3 holds it."""
    u, v, r, lam = (ca.SX.sym(s) for s in ("u", "v", "r", "lam"))
    floor = ns.Impact(Y, reaction=r, name="floor")
    pulled = ns.FilippovSystem([X, Y, u, v], field=[u, v, 1 - X - 0.1 * u, r - 1], impacts=floor)
    found = find_equilibrium(pulled, [0.5, 0.1, 0.0, 0.0], mode="c")
    assert found.point.round(12).tolist() == [1.0, 0.0, 0.0, 0.0]
    assert (found.status, found.kind, found.h) == ("real", "stable focus", pytest.approx(1.0))
    assert found.eigenvalues == pytest.approx([-0.05 - 0.99875j, -0.05 + 0.99875j], abs=1e-5)
    held = ns.FilippovSystem(
        [X, Y, u, v],
        field=[u, v, 1 - X - 0.3 * lam * r, r - 1],
        surfaces=[u],
        multipliers=[lam],
        impacts=floor,
    )
    with pytest.raises(ns.ConvergenceError, match="equilibrium of F1"):
        find_equilibrium(held, [0.8, 0.0, 0.0, 0.0])  # it falls
    found = find_equilibrium(held, [0.8, 0.1, 0.0, 0.0], mode="sc")
    assert found.point.round(12).tolist() == [0.8, 0.0, 0.0, 0.0] and found.status == "real"
    assert find_equilibrium(held, [0.5, 0.0, 0.0, 0.0], mode="sc").status == "virtual"
    assert find_equilibrium(held, [0.5, 0.0, 0.0, 0.0], mode="+c").point[0] == pytest.approx(0.7)
