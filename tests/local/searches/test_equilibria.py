"""Equilibria of the two fields: found from many starts, named by eigenvalues and by their side."""

import casadi as ca
import pytest

import nonsmooth as ns
from nonsmooth.local import find_all, find_equilibrium

X, Y, Z = (ca.SX.sym(s) for s in "xyz")


PLANE = ns.FilippovSystem([X, Y], surface=Y, above=[1, X], below=[1, 1])


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


def test_messages():
    with pytest.raises(ns.DefinitionError, match="side"):
        find_equilibrium(PLANE, [0.0, 0.0], side="left")
    with pytest.raises(ns.ConvergenceError, match="equilibrium of F1"):
        find_equilibrium(PLANE, [0.0, 0.0])
    t = ca.SX.sym("t")
    moving = ns.FilippovSystem([X, Y], surface=Y, above=[ca.cos(t), -1], below=[1, 1], time=t)
    with pytest.raises(ns.DefinitionError, match="time"):
        find_equilibrium(moving, [0.0, 0.0])
