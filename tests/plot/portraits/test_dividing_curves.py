"""Pictures of dividing curves show the arcs that were computed, by their kinds, with their names."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from matplotlib.figure import Figure

import nonsmooth as ns
from nonsmooth.plot.labels import Labels

x, y, z = (ca.SX.sym(s) for s in "xyz")
SYSTEM = ns.FilippovSystem([x, y, z], surface=x, above=[y, 1, 0.5], below=[z, 0.3, -1])
START = lambda a, b: [0.3, a, b]
GIVEN = dict(starts=START, box=[(-1.5, -0.5), (-1, 1)], duration=6.0, spacing=0.5)


@pytest.fixture(scope="module")
def found():
    return ns.manifold(SYSTEM, ns.find_two_fold(SYSTEM, near=[0, 0, 0]), **GIVEN)


def backward():
    system = ns.FilippovSystem([x, y, z], surface=x, above=[-y, -1, -0.5], below=[-z, -0.3, 1])
    fold = ns.find_two_fold(system, near=[0, 0, 0])
    return ns.manifold(system, fold, stable=False, **GIVEN)


def words_of(axes):
    (names,) = (a for a in axes.get_children() if isinstance(a, Labels))
    return [text.get_text() for text in names.get_children()]


def test_arcs_of_both_kinds_and_where_they_meet(found):
    figure = ns.plot.dividing_curves(found, names=["y", "z"], title="starts")
    (axes,) = figure.axes
    *lines, dots = axes.lines
    for arc, line in zip(found.arcs, lines, strict=True):
        assert np.array_equal(line.get_xydata(), arc.points)
        assert line.is_dashed() == (arc.kind == "grazing")
    assert np.array_equal(dots.get_xydata(), found.junctions)
    assert words_of(axes) == ["+ just touches", "+ s into a two-fold"]
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_title()) == ("y", "z", "starts")


@pytest.mark.slow
def test_what_leaves_two_folds_has_another_colour(found):
    (axes,) = ns.plot.dividing_curves([found, backward()]).axes
    lines = [line for line in axes.lines if line.get_linestyle() != "None"]
    assert len({line.get_color() for line in lines}) == 2
    assert words_of(axes)[2:] == ["+ just touches, backward", "+ s into a two-fold, backward"]


def test_on_axes_of_ones_own_without_names(found):
    axes = Figure().add_subplot()
    assert ns.plot.dividing_curves(found, ax=axes, labels=False) is axes
    assert len(axes.lines) == 3 and not any(isinstance(a, Labels) for a in axes.get_children())


def test_what_does_not_fit_is_refused(found):
    for wrong in ([], [found, SYSTEM], SYSTEM):
        with pytest.raises(ns.OptionError, match="found"):
            ns.plot.dividing_curves(wrong)
    with pytest.raises(ns.OptionError, match=r"\bax\b"):
        ns.plot.dividing_curves(found, ax=Figure().add_subplot(projection="3d"))
    with pytest.raises(ns.OptionError, match="dividing_curves"):
        ns.plot.manifold(found)


@pytest.mark.slow
def test_a_circle_is_where_two_itineraries_of_one_kind_meet():
    given = dict(starts=lambda a, b: [a, b, 0.6 - 0.3 * b], box=[(-0.8, 0.83), (-2.1, 1.07)])
    fold = ns.find_two_fold(SYSTEM, near=[0, 0, 0])  # starts on either side of the surface
    cut = ns.manifold(SYSTEM, fold, duration=6.0, spacing=0.3, **given)
    meet = [
        a.points[-1]
        for curve in cut.curves
        for a, b in pairwise(curve)
        if a.kind == b.kind and a.itinerary != b.itinerary
    ]
    (axes,) = ns.plot.dividing_curves(cut, labels=False).axes
    (circles,) = (line for line in axes.lines if line.get_markerfacecolor() == "white")
    assert meet and np.array_equal(circles.get_xydata(), meet)
