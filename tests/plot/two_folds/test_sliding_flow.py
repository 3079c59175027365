"""The portraits of a two-fold draw exact orbits, name every part, and leave matplotlib as it was."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from numpy.testing import assert_allclose

import nonsmooth as ns
from nonsmooth.local import find_two_fold
from nonsmooth.local.two_folds import ReducedFlow, classify_two_fold
from nonsmooth.local.two_folds.reduced_flow import eigenlines

CLASSES = ns.textbook.TWO_FOLDS
BOUNDARIES = {
    "Delta=0, ball": ((1, -1), (-1.0325, 1 / -1.0325)),
    "Delta=0, VV": ((1, -1), (2.0, 0.5)),
    "Delta=0, II": ((-1, 1), (-2.0, -0.5)),
    "Delta=0, mixed": ((1, 1), (-2.0, 0.5)),
    "disc=0": ((1, 1), (-1.5, 0.5)),
    "disc=0 outside": ((-1, -1), (-1.5, 0.5)),
    "nu1=0": ((-1, 1), (0.0, -1.0)),
    "IV": ((-1, -1), (-0.5, -3.0)),
}
ALL = {**CLASSES, **BOUNDARIES}


@cache
def shared(draw, sigma, nu) -> Figure:
    """A portrait that several tests look at and leave as it is."""
    return draw((sigma, nu))


def lines(figure: Figure, gid: str) -> list[np.ndarray]:
    return [
        np.column_stack(line.get_data())
        for line in figure.axes[0].get_lines()
        if line.get_gid() == gid
    ]


def words(figure: Figure) -> set[str]:
    return {text.get_text() for text in figure.axes[0].findobj(Text)}


@pytest.mark.parametrize("sigma, nu", ALL.values(), ids=ALL)
def test_drawn_orbits_satisfy_the_reduced_equation_in_the_direction_of_time(sigma, nu):
    flow = ReducedFlow(sigma, nu)
    drawn = lines(shared(ns.plot.two_fold, sigma, nu), "orbit")
    assert len(drawn) >= 4
    for curve in drawn:
        assert np.all(curve >= 0) or np.all(curve <= 0)  # each stays in Da or in Dr
        step = np.diff(curve, axis=0)
        middle = (curve[1:] + curve[:-1]) / 2
        field = middle @ flow.matrix.T * np.sign(middle.sum(axis=1))[:, None]
        size = np.linalg.norm(step, axis=1) * np.linalg.norm(field, axis=1)
        moving = size > 1e-9
        across = step[:, 0] * field[:, 1] - step[:, 1] * field[:, 0]
        along = np.sum(step * field, axis=1)
        assert np.all(np.abs(across[moving]) < 0.02 * size[moving])
        assert np.all(along[moving] > 0)


@pytest.mark.parametrize("label", [name for name in CLASSES if name != "mix-0"])
def test_drawn_orbits_are_exact(label):
    sigma, nu = CLASSES[label]
    flow = ReducedFlow(sigma, nu)
    low, high = flow.eigenvalues
    for curve in lines(shared(ns.plot.two_fold, sigma, nu), "orbit"):
        # u = u0 e^(low r), v = v0 e^(high r): this combination does not change along an orbit
        u, v = np.abs(np.linalg.solve(flow.eigenvectors, curve.T))
        away = (u > 1e-6) & (v > 1e-6)
        assert_allclose(np.ptp((high * np.log(u) - low * np.log(v))[away]), 0, atol=1e-8)


@pytest.mark.parametrize("sigma, nu", ALL.values(), ids=ALL)
def test_eigenlines_have_the_slope_of_the_theory(sigma, nu):
    flow = ReducedFlow(sigma, nu)
    drawn = lines(shared(ns.plot.two_fold, sigma, nu), "eigenline")
    assert len(drawn) == len(eigenlines(flow))
    for (value, _), line in zip(eigenlines(flow), drawn, strict=True):
        (a, b), (c, d) = line
        assert_allclose((d - b) / (c - a), (nu[1] - value) / sigma[0], rtol=1e-6)
        assert_allclose(line.sum(axis=0), 0, atol=1e-12)  # through the two-fold


@pytest.mark.slow_cases("mix-S-two_fold_3d")
@pytest.mark.parametrize("draw", [ns.plot.two_fold, ns.plot.two_fold_3d])
@pytest.mark.parametrize("sigma, nu", ALL.values(), ids=ALL)
def test_every_part_is_named(draw, sigma, nu):
    figure = shared(draw, sigma, nu)
    ax = figure.axes[0]
    assert {"$D_a$", "$D_r$", "$C_1$", "$C_2$"} <= words(figure)
    assert len(lines(figure, "fold")) == 2
    title = ax.get_title()
    label = classify_two_fold(sigma, nu).label
    assert label.removeprefix("boundary ").replace("Delta", "Δ") in title
    named = " ".join(words(figure))
    for value, _ in eigenlines(ReducedFlow(sigma, nu)):
        assert ("pseudo-equilibria" if abs(value) < 1e-9 else "canard") in named
    assert {"visible", "invisible"} >= {w.split(",\n")[1] for w in words(figure) if "fold of" in w}
    assert len([w for w in words(figure) if "fold of" in w]) == 2
    assert len(ax.get_legend().get_texts()) <= 6


@pytest.mark.slow
def test_names_of_lines_are_left_out_or_stand_without_a_legend():
    case = CLASSES["II-C"]
    for draw in (ns.plot.two_fold, ns.plot.two_fold_3d):
        folds = [
            sum("fold of" in w for w in words(draw(case, legend=legend, labels=labels)))
            for legend, labels in ((True, False), (False, True), (False, None))
        ]
        assert folds == [0, 2, 0]


def test_axes_are_labelled():
    ax = ns.plot.two_fold(CLASSES["mix-S"]).axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$z_2$", "$z_3$")
    assert {"$z_1$", "$z_2$", "$z_3$"} <= words(ns.plot.two_fold_3d(CLASSES["mix-S"]))


@pytest.mark.parametrize("sigma, nu", ALL.values(), ids=ALL)
def test_visible_folds_are_solid_and_invisible_ones_dashed(sigma, nu):
    folds = [
        line
        for line in shared(ns.plot.two_fold, sigma, nu).axes[0].lines
        if line.get_gid() == "fold"
    ]
    for line, visible in zip(folds, (sigma[0] == 1, sigma[1] == -1), strict=True):
        assert (line.get_linestyle() == "-") == visible


def test_a_found_two_fold_with_coincident_fields_is_drawn_as_such():
    x, y, z = (ca.SX.sym(name) for name in "xyz")
    # friction with a normal force that vanishes at the origin: F1 = F2 there
    system = ns.FilippovSystem(
        [x, y, z], surface=x, above=[-y, -1 - y, 1.0], below=[-y + 2 * (y + z), -1.0 - y, 1.0]
    )
    fold = find_two_fold(system, near=[0.0, 0.1, 0.1])
    assert fold.coincident_fields
    title = ns.plot.two_fold(fold).axes[0].get_title()
    assert "coincident fields" in title and fold.label in title


def test_drawing_on_given_axes():
    figure = Figure()
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, 2)
    ns.plot.two_fold(CLASSES["VV-F"], ax=axes[0], legend=False, title="here")
    ns.plot.two_fold_3d(CLASSES["VV-F"], ax=axes[1], legend=False)
    assert axes[0].get_title() == "here" and axes[0].get_legend() is None


@pytest.mark.parametrize("draw", [ns.plot.two_fold, ns.plot.two_fold_3d])
@pytest.mark.parametrize("wrong", [None, 3, "fold", [1, 2], ((1, -1), (1, 2, 3)), object()])
def test_what_is_not_a_two_fold_is_refused(draw, wrong):
    with pytest.raises(ns.DefinitionError, match="two-fold"):
        draw(wrong)


def test_other_wrong_input_is_refused():
    good = CLASSES["VV-F"]
    with pytest.raises(ns.DegenerateError, match="cusp"):
        ns.plot.two_fold(((0, 1), (1.0, 1.0)))
    with pytest.raises(ns.OptionError, match=r"\bnu\b"):
        ns.plot.two_fold(((1, 1), (np.nan, 1.0)))
    with pytest.raises(ns.OptionError, match="size"):
        ns.plot.two_fold(good, size=(3, -1))
    with pytest.raises(ns.OptionError, match=r"\bax\b"):
        ns.plot.two_fold(good, ax="here")
    with pytest.raises(ns.OptionError, match="orbits"):
        ns.plot.two_fold(good, orbits=2.5)
    with pytest.raises(ns.OptionError, match="elevation"):
        ns.plot.two_fold_3d(good, elevation=-10)
