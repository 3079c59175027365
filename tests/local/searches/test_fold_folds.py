"""Fold-folds of planar systems: the fused focus of the literature, and refusals."""

import casadi as ca
import pytest

import nonsmooth as ns
from nonsmooth import textbook
from nonsmooth.local import fold_fold

X, Y, Z = (ca.SX.sym(s) for s in "xyz")


PLANE = ns.FilippovSystem([X, Y], surface=Y, above=[1, X], below=[1, 1])


def test_the_fused_focus_of_the_pseudo_hopf_bifurcation():
    problem = textbook.pseudo_hopf()
    found = fold_fold(problem.system, [0.0, 0.0], parameters={"al": 0.0})
    assert found.label == "II2"
    assert found.numbers["stability"] == pytest.approx(2 / 3)  # -2 r/3: the cycle is stable


def test_messages():
    with pytest.raises(ns.PointError, match="fold-fold"):
        fold_fold(PLANE, [0.0, 0.0])
    space = ns.FilippovSystem([X, Y, Z], surface=X, above=[Y, 1, 0], below=[1, 0, 0])
    with pytest.raises(ns.DefinitionError, match=r"fold-fold.*3 states"):
        fold_fold(space, [0.0, 0.0, 0.0])
