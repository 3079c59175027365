"""Every picture is fit for print: at most as wide as a page, text of 8 points, none cut off or
overlapping, and no legend of more than six entries."""

import io

import casadi as ca
import numpy as np
import pytest
from matplotlib.image import imread

import nonsmooth as ns
from nonsmooth.plot.style import PrintFigure
from papers.pictures import illegible
from tests.plot.examples import EXAMPLES, basins, cut, harvest, run


@pytest.mark.slow_cases(
    *"""
    bifurcation_curves branch1 dividing_curves phase_portrait sliding_portrait two_fold0
    two_fold1 two_fold2 two_fold_3d0 two_fold_3d1 two_fold_atlas two_fold_atlas_pages
    outcome_map proven_map
    """.split()
)
@pytest.mark.parametrize(
    ("name", "example"),
    [pytest.param(name, one, id=name) for name, several in EXAMPLES.items() for one in several],
)
def test_picture_is_fit_for_print(name, example):
    drawn = example.draw(name)
    figure = drawn[-1] if isinstance(drawn, list) else drawn
    assert isinstance(figure, PrintFigure)  # whose fonts are TrueType (test_palette.py)
    assert illegible(figure) == []


COLUMN = (3.4, 4.4)


@pytest.mark.parametrize(
    "draw",
    [
        pytest.param(
            lambda: ns.plot.phase_portrait(harvest(), (0.0, 1.1, 0.5, 1.5), size=COLUMN),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            lambda: ns.plot.two_fold(ns.textbook.TWO_FOLDS["VV-C1"], size=COLUMN),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            lambda: ns.plot.two_fold_3d(ns.textbook.TWO_FOLDS["mix-C"], size=COLUMN),
            marks=pytest.mark.slow,
        ),
        lambda: ns.plot.trajectory(run(), size=COLUMN),
        lambda: ns.plot.basins(basins(2), size=COLUMN),
        pytest.param(
            lambda: ns.plot.dividing_curves(cut(), size=(3.4, 2.9)), marks=pytest.mark.slow
        ),
        pytest.param(
            lambda: ns.plot.dividing_curves(cut(), size=(7.0, 4.4)), marks=pytest.mark.slow
        ),
    ],
    ids=[
        "phase_portrait",
        "two_fold",
        "two_fold_3d",
        "trajectory",
        "basins",
        "dividing",
        "dividing, page",
    ],
)
def test_picture_as_wide_as_a_column_is_fit_for_print_too(draw):
    """The legend is below the picture there, which fills the column."""
    figure = draw()
    assert illegible(figure) == []
    assert max(ax.bbox.width for ax in figure.axes) > 0.3 * figure.bbox.width  # two side by side


@pytest.mark.parametrize("name", ["boost_converter", "diode_bridge"])
def test_a_long_itinerary_is_not_cut(name):
    assert illegible(ns.plot.trajectory(ns.textbook.by_name(name).run())) == []


@pytest.mark.slow
def test_no_title_is_cut_in_a_file():
    """Square axes of a narrow figure need more than one layout."""
    stream = io.BytesIO()
    ns.plot.two_fold(ns.textbook.TWO_FOLDS["II-C"], size=COLUMN).savefig(stream, dpi=150)
    stream.seek(0)
    assert imread(stream)[0].min() == 1.0  # the uppermost row of pixels is white


@pytest.mark.parametrize(
    ("count", "size"), [(2, COLUMN), (3, None), pytest.param(6, COLUMN, marks=pytest.mark.slow)]
)
def test_names_of_24_letters_do_not_meet(count, size):
    names = ["displacement_of_the_block", "tip_velocity_of_the_bow_", "temperature_of_the_spring"]
    names = [f"{names[k % 3]}{k // 3 or ''}" for k in range(count)]
    assert min(map(len, names)) >= 24
    states = [ca.SX.sym(name) for name in names]
    field = [states[1], -400 * states[0], *(-state for state in states[2:])]
    above, below = ([f - s * (k == 1) for k, f in enumerate(field)] for s in (100, -100))
    system = ns.FilippovSystem(states, surface=states[1] - 0.7, above=above, below=below)
    figure = ns.plot.trajectory(ns.simulate(system, np.ones(count), 0.5), size=size)
    assert illegible(figure) == []


def test_names_of_narrow_basins_are_about_their_middles():
    found = basins(7)
    figure = ns.plot.basins(found, size=COLUMN)
    figure.draw_without_rendering()
    (axes,) = figure.axes
    texts = [text for artist in axes.artists for text in artist.get_children()]
    assert len(texts) == 7
    for text in texts:
        box = text.get_window_extent()
        middle = axes.transData.inverted().transform((box.p0 + box.p1) / 2)
        k = int(text.get_text().split(":")[0].split()[1])
        inside = found.axes["x"][np.any(found.labels == k, axis=1)]
        assert inside.min() <= middle[0] <= inside.max()
