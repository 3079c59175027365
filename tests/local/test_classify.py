"""classify names points of surfaces in space and near boundaries of classes, and refuses others."""

import casadi as ca
import pytest

import nonsmooth as ns
from nonsmooth import textbook
from nonsmooth.local import boundary_equilibrium, classify, fold_fold

X, Y, Z, T = (ca.SX.sym(s) for s in "xyzt")
PLANE = ns.FilippovSystem([X, Y], surface=Y, above=[1, X], below=[1, 1])
SPACE = ns.FilippovSystem([X, Y, Z], surface=X, above=[Y, 1, 0], below=[1, 0, 0])
MOVING = ns.FilippovSystem([X, Y], surface=Y, above=[ca.cos(T), -1], below=[1, 1], time=T)


def test_classify_in_three_dimensions():
    system = ns.FilippovSystem([X, Y, Z], surface=X, above=[-Y, 1, -2], below=[Z, -1, 1])
    cases = [
        ((0, 1, 1), "sliding", "attracting sliding"),
        ((0, -1, 1), "crossing", "crossing up"),
        ((0, 0, 1), "fold", "invisible"),
        ((0, 1, 0), "fold", "invisible"),
        ((0, 0, 0), "two-fold", "II-C"),
        ((0, 1e-8, 1), "degenerate", "near L1 = 0"),
    ]
    for point, kind, label in cases:
        found = classify(system, point)
        assert (found.kind, found.label) == (kind, label), str(found)
    whitney = ns.FilippovSystem([X, Y, Z], surface=X, above=[Y, Z, 1], below=[1, 0, 0])
    assert classify(whitney, [0, 0, 0]).kind == "cusp"
    assert classify(whitney, [0, 0, 1]).label == "visible"


@pytest.mark.parametrize("label", textbook.TWO_FOLDS)
def test_two_folds_are_named(label):
    found = classify(textbook.two_fold(label).system, [0, 0, 0])
    assert (found.kind, found.label) == ("two-fold", label)
    assert found.distance > 0.05 and "L11" in found.evidence


def test_two_folds_near_a_boundary_are_degenerate():
    for eps in (0.0, 1e-12, 1e-8):
        system = textbook.two_fold((1, -1), (2.0, 0.5 + eps)).system  # Delta = 2 eps
        found = classify(system, [0, 0, 0])
        assert found.kind == "degenerate" and found.nearest == "Delta=0"
        assert found.distance == pytest.approx(2 * eps, abs=1e-15)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: classify(PLANE, [1.0, 0.5]), ns.PointError, "point.*surface"),
        (lambda: classify(PLANE, [0.0, 0.0], margin=-1.0), ns.OptionError, "margin"),
        (lambda: fold_fold(PLANE, [0.0, 0.0]), ns.PointError, "fold-fold"),
        (lambda: fold_fold(SPACE, [0.0, 0.0, 0.0]), ns.DefinitionError, "fold-fold.*3 states"),
        (lambda: boundary_equilibrium(PLANE, [0.0, 0.0]), ns.PointError, "point.*equilibrium"),
        (
            lambda: ns.find_boundary_equilibrium(PLANE, [0, 0], vary="mu"),
            ns.DefinitionError,
            "vary",
        ),
        (lambda: ns.find_equilibrium(PLANE, [0.0, 0.0]), ns.ConvergenceError, "equilibrium of F1"),
        (lambda: ns.find_equilibrium(MOVING, [0.0, 0.0]), ns.DefinitionError, "time"),
    ],
)
def test_points_that_are_not_what_is_requested_are_refused(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_time_and_hidden_dynamics():
    lam = ca.SX.sym("lam")
    assert classify(MOVING, [0.0, 0.0], t=1.0).label == "attracting sliding"
    hidden = ns.FilippovSystem(
        [X, Y], surface=Y, multipliers=lam, field=[1, -(lam**3)], hidden=True
    )
    with pytest.raises(ns.DefinitionError, match="hidden"):
        classify(hidden, [0.0, 0.0])


def test_both_fields_vanish():
    system = ns.FilippovSystem([X, Y], surface=Y, above=[X, -Y], below=[-X, Y])
    found = classify(system, [0.0, 0.0])
    assert found.kind == "degenerate" and found.distance == 0.0


def test_a_two_fold_of_a_plane_and_time():
    """A rectifier at the start of its source, and the same with time as a state."""
    i, v, s = (ca.SX.sym(name) for name in ("i", "v", "s"))

    def rectifier(states, moment, **more):
        rates = [[ca.sin(moment) - i - v, i - v], [ca.sin(moment) - i + v, -i - v]]
        rest = [1] * (len(states) - 2)
        above, below = (rate + rest for rate in rates)
        return ns.FilippovSystem(states, surface=i, above=above, below=below, **more)

    found = ns.classify(rectifier([i, v], s, time=s), [0.0, 0.0])
    known = ns.classify(rectifier([i, v, s], s), [0.0, 0.0, 0.0])
    assert (found.kind, found.label) == (known.kind, known.label) == ("two-fold", "mix-0")
    assert found.evidence["nu1"] == known.evidence["nu1"] and found.detail is None
    assert ns.classify(rectifier([i, v], s, time=s), [0.0, 0.1]).label == "attracting sliding"
