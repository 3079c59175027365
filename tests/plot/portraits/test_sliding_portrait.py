"""The sliding portrait of a surface in three dimensions shows exact folds, points and orbits."""

import casadi as ca
import numpy as np
import pytest
from matplotlib.text import Text
from numpy.testing import assert_allclose

import nonsmooth as ns
from papers.pictures import illegible

x, y, z = (ca.SX.sym(name) for name in "xyz")
BOX = (-1.0, 1.0, -1.0, 1.0)


def drawn(figure, gid):
    return [line for line in figure.axes[0].lines if line.get_gid() == gid]


def system(above, below, surface=x):
    return ns.FilippovSystem([x, y, z], surface=surface, above=above, below=below)


@pytest.mark.parametrize(
    ("label", "words"),
    [
        ("VV-C1", ("visible", "visible")),
        pytest.param("II-C", ("invisible", "invisible"), marks=pytest.mark.slow),
        ("mix-S", ("visible", "invisible")),
    ],
)
def test_normal_form_has_its_folds_on_the_axes_and_its_class(label, words):
    problem = ns.textbook.two_fold(label)
    figure = ns.plot.sliding_portrait(problem.system, BOX)
    seen = {}
    for word in set(words):
        for line in drawn(figure, f"{word} fold"):
            points = line.get_xydata()
            seen[int(np.argmin(np.abs(points).max(axis=0)))] = word
            assert np.abs(points).min(axis=1).max() < 1e-14
    assert seen == {0: words[0], 1: words[1]}  # z2 = 0 is the fold of F1
    assert [t.get_text() for t in figure.axes[0].findobj(Text)].count(label) == 1
    assert len(drawn(figure, "two-fold")) == 1
    canards = {"VV-C1": 2, "II-C": 2, "mix-S": 2}[label]  # halves, in Da and in Dr
    assert len(drawn(figure, "canard")) == canards
    assert len(drawn(figure, "faux canard")) == (2 if label == "mix-S" else 0)


@pytest.mark.parametrize("centre", [(0.0, 0.0), (1.5, 1.0)])
def test_pseudo_saddle_and_its_manifolds(centre):
    # L1 = -1, L2 = 1: the sliding field is the mean of the two fields
    s = system([-1, 2 * (y - centre[0]), centre[1] - z], [1, 0, 0])
    figure = ns.plot.sliding_portrait(s, (-2, 3, -2, 3))
    (mark,) = drawn(figure, "pseudo-saddle")
    assert_allclose(mark.get_xydata()[0], centre, atol=1e-12)
    lines = drawn(figure, "manifold of a pseudo-saddle")
    assert len(lines) == 4
    for line in lines:
        assert np.abs(line.get_xydata() - centre).max(axis=0).min() < 1e-9  # along an axis


def test_cusp_parts_the_visible_from_the_invisible_fold():
    # L1 = z + y^2 - .3, L11 = 2 y + .2: cusp at y = -.1, z = .29, visible to the right of it
    s = system([z + y**2 - 0.3, 1, 0.2], [1, 0.3, 0.1 - z])
    figure = ns.plot.sliding_portrait(s, (-2, 2, -2, 2))
    (cusp,) = drawn(figure, "cusp")
    assert_allclose(cusp.get_xydata()[0], [-0.1, 0.29], atol=1e-12)
    (visible,), (invisible,) = drawn(figure, "visible fold"), drawn(figure, "invisible fold")
    assert visible.get_xydata()[:, 0].min() > -0.1 - 1e-12
    assert invisible.get_xydata()[:, 0].max() < -0.1 + 1e-12
    for line in (visible, invisible):
        a, b = line.get_xydata().T
        assert np.abs(b + a**2 - 0.3).max() < 1e-12


@pytest.mark.slow
def test_curved_surface_is_drawn_over_chosen_coordinates():
    s = system([1, 1, 0], [0, 0, 1], surface=z + x - y**2)  # L1 = 1 - 2 y, fold at y = .5
    for names, column in ((("x", "y"), 1), (("y", "x"), 0), (("y", "z"), 0)):
        figure = ns.plot.sliding_portrait(s, (-1, 1, -1, 1), coordinates=names)
        folds = drawn(figure, "visible fold") + drawn(figure, "invisible fold")
        assert folds
        for line in folds:
            assert_allclose(line.get_xydata()[:, column], 0.5, atol=1e-12)
        assert figure.axes[0].get_xlabel() == names[0]


def test_each_region_is_named_once():
    figure = ns.plot.sliding_portrait(ns.textbook.two_fold("II-F").system, BOX, orbits=0)
    names = [t.get_text() for t in figure.axes[0].texts if t.get_gid() == "region"]
    assert sorted(names) == ["$C_1$", "$C_2$", "$D_a$", "$D_r$"]  # each once
    assert not drawn(figure, "orbit")


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda s: ns.plot.sliding_portrait("no", BOX), ns.DefinitionError, "FilippovSystem"),
        (
            lambda s: ns.plot.sliding_portrait(ns.textbook.planar_relay().system, BOX),
            ns.DefinitionError,
            "phase_portrait",
        ),
        (lambda s: ns.plot.sliding_portrait(s, (1, 0, 0, 1)), ns.OptionError, r"\bbox\b"),
        (lambda s: ns.plot.sliding_portrait(s, "box"), ns.OptionError, r"\bbox\b"),
        (
            lambda s: ns.plot.sliding_portrait(s, BOX, coordinates=("z2", "q")),
            ns.DefinitionError,
            "coordinates",
        ),
        (
            lambda s: ns.plot.sliding_portrait(s, BOX, coordinates=("z1", "z2")),
            ns.DefinitionError,
            "surface",
        ),
    ],
)
def test_bad_input_is_refused_with_advice(call, error, words):
    with pytest.raises(error, match=words):
        call(ns.textbook.two_fold("II-C").system)


@pytest.mark.slow
@pytest.mark.parametrize("box", [(-1, 0.05, -1, 1), (-1, 1, -0.02, 1), (-0.03, 1, -1, 0.04)])
def test_the_name_of_a_class_is_inside_of_a_narrow_frame(box):
    system = ns.textbook.two_fold("VV-C1").system
    figure = ns.plot.sliding_portrait(system, box, size=(3.4, 4.4))
    assert [text for text in illegible(figure) if "VV-C1" in text] == []


def test_a_condition_slides_where_it_is_closed():
    """z = 0 is closed for x < 0.4, with rest at x = 0.3 y, y = 0.2 (0.4 - x)."""
    x, y, z, push = (ca.SX.sym(name) for name in ("x", "y", "z", "push"))
    field = [0.2 * push - y, x - 0.3 * y, x - 0.4 + push]
    conditions = [ns.Complementarity(z, push)]
    system = ns.FilippovSystem([x, y, z], field=field, complementarity=conditions)
    axes = ns.plot.sliding_portrait(system, (-1, 1, -1, 1)).axes[0]
    (rest,) = (line for line in axes.lines if line.get_gid() == "stable pseudo-focus")
    assert_allclose(rest.get_xydata()[0], np.array([0.024, 0.08]) / 1.06, atol=1e-10)
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert "$D_a$: closed" in texts and "$C_1$: opens" in texts
