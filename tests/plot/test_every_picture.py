"""Every public drawing function draws in the user's style: on given axes, with given lines, after rcParams."""

import inspect

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text

import bounce
import nonsmooth as ns
from nonsmooth.plot.labels import Labels
from tests.plot.examples import EXAMPLES, OTHERS

OWN = "#12ab34"
ATLAS = pytest.mark.slow_cases("two_fold_atlas", "two_fold_atlas_pages")  # of other pictures
STYLES = {"dark": ["dark_background"], "light": []}


def functions(module):
    """Public functions and classes of a module of pictures."""
    return {name for name in module.__all__ if callable(getattr(module, name))}


def example(name, **options):
    return EXAMPLES[name][0].draw(name, **options)


def figures(drawn):
    return drawn if isinstance(drawn, list) else [drawn]


def colours(artist):
    """Every colour of an artist."""
    for name in ("color", "facecolor", "edgecolor", "markerfacecolor", "markeredgecolor"):
        got = getattr(artist, f"get_{name}", list)()
        several = got if isinstance(artist, Collection) else [got]
        yield from (to_rgba(one) for one in several if not isinstance(one, list))


def is_drawn(artist):
    return isinstance(artist, (Line2D, Patch, Collection))


def seen(figure):
    """The texts of a figure that are not empty, also those that are placed while it is drawn."""
    figure.draw_without_rendering()
    return [t for t in figure.findobj(Text) if t.get_text().strip() and t.get_visible()]


def test_every_function_is_here():
    """A new drawing function fails here until it has an example, with which the tests below draw it."""
    public = functions(ns.plot) | functions(bounce.plot)
    assert public == set(EXAMPLES) | OTHERS
    drawing = [getattr(ns.textbook, name) for name in ns.textbook.__all__]  # systems: none draws
    methods = {name for one in drawing for name in dir(one) if name.startswith(("plot", "draw"))}
    assert not methods


@pytest.mark.parametrize("name", EXAMPLES)
def test_options_have_the_same_names(name):
    function = getattr(ns.plot, name, None) or getattr(bounce.plot, name)
    taken = inspect.signature(function).parameters
    kinds = {parameter.kind for parameter in taken.values()}
    assert inspect.Parameter.VAR_KEYWORD in kinds and "colors" in taken
    assert name == "two_fold_atlas_pages" or ({"ax", "figure"} & set(taken) and "size" in taken)
    for option in {"ax", "figure", "size", "colors", "title", "legend"} & set(taken):
        assert taken[option].kind is inspect.Parameter.KEYWORD_ONLY
    with pytest.raises(TypeError, match="shape_of_things"):
        example(name, shape_of_things=1)
    with pytest.raises(ns.OptionError, match="colors"):
        example(name, colors="red")
    assert plt.get_fignums() == []  # nothing is left of a picture that was refused


@ATLAS
@pytest.mark.parametrize("name", EXAMPLES)
def test_a_new_figure_is_known_to_pyplot_and_follows_its_settings(name):
    before = dict(matplotlib.rcParams)
    plain = figures(example(name))
    assert [figure.number for figure in plain] == plt.get_fignums()
    assert dict(matplotlib.rcParams) == before
    small = min(text.get_fontsize() for figure in plain for text in seen(figure))
    plt.close("all")
    size = {} if name == "two_fold_atlas_pages" else {"size": (14.0, 12.0)}
    with plt.rc_context({"font.size": 20.0, "font.family": "serif"}):
        large = figures(example(name, **size))
    texts = [text for figure in large for text in seen(figure)]
    assert min(text.get_fontsize() for text in texts) > 1.5 * small
    families = {tuple(text.get_fontfamily()) for text in texts}
    assert families <= {("serif",), ("monospace",)} and ("serif",) in families


@ATLAS
@pytest.mark.parametrize("name", EXAMPLES)
def test_lines_have_the_properties_that_are_given(name):
    look = {"c": OWN, "lw": 3.25, "alpha": 0.75}
    for dark in ([], ["dark_background"]):
        with plt.style.context(dark):
            drawn = figures(example(name, **look))
        parts = [part for figure in drawn for part in figure.findobj(is_drawn)]
        mine = [
            p for p in parts if any(c[:3] == pytest.approx(to_rgba(OWN)[:3]) for c in colours(p))
        ]
        assert mine, name
        widths = [np.atleast_1d(part.get_linewidth()).max() for part in mine]
        assert max(widths) == pytest.approx(3.25)


def place(name):
    """Axes in a figure of the user's, or the figure, and the name of its option."""
    function = getattr(ns.plot, name, None) or getattr(bounce.plot, name)
    figure = Figure(figsize=(7.0, 7.0), layout="constrained")
    if "ax" in inspect.signature(function).parameters:
        return figure, "ax", figure.subplots(1, 2)[0]
    return figure, "figure", figure


@pytest.mark.parametrize("name", sorted(set(EXAMPLES) - {"two_fold_atlas_pages"}))
def test_given_axes_are_drawn_on_and_returned(name):
    figure, option, given = place(name)
    assert example(name, **{option: given}) is given
    assert plt.get_fignums() == []
    assert given.findobj(is_drawn)
    if option == "ax":
        other = figure.axes[1]
        assert not (other.lines or other.collections or other.texts)
        assert given.get_xlabel() or not given.axison
    with pytest.raises(ns.OptionError, match=option):
        example(name, **{option: "here"})


def contrast(one, other):
    """Of WCAG 2.1: 1 to 21."""
    low, high = sorted(ns.plot.style.luminance(color) for color in (one, other))
    return (high + 0.05) / (low + 0.05)


@ATLAS
@pytest.mark.parametrize("name", EXAMPLES)
def test_a_dark_background_is_kept_and_everything_is_seen_on_it(name):
    """What is light on white paper is dark on black, with the same contrast to within a half."""
    least = {}
    for theme, names in STYLES.items():
        with plt.style.context(names):
            drawn = figures(example(name))
            paper = to_rgba(matplotlib.rcParams["axes.facecolor"])
        for figure in drawn:
            assert to_rgba(figure.get_facecolor()) == paper
            assert all(to_rgba(ax.get_facecolor()) == paper for ax in figure.axes)
            texts = [t for t in seen(figure) if not on_something(t)]
            lines = [line for line in figure.findobj(Line2D) if line.get_linestyle() != "None"]
            for kind, artists in (("text", texts), ("line", lines)):
                values = [contrast(artist.get_color(), paper) for artist in artists]
                least.setdefault(kind, {}).setdefault(theme, []).append(min(values, default=21.0))
    for values in least.values():
        assert min(values["dark"]) >= min(2.5, 0.65 * min(values["light"]))


def on_something(text):
    """Whether a text is on a region of a map, whose colour it contrasts with."""
    return text.get_fontweight() == "bold" or text.get_bbox_patch() is not None


def test_names_and_their_halos_have_the_colours_of_the_background():
    with plt.style.context("dark_background"):
        figure = example("two_fold")
    figure.draw_without_rendering()
    (labels,) = [a for ax in figure.axes for a in ax.artists if isinstance(a, Labels)]
    for text in labels.get_children():
        assert contrast(text.get_color(), "black") > 2.5


def test_colours_by_name_and_repeated_pictures_share_a_legend():
    branch = EXAMPLES["branch"][0].arguments[0]
    _, ax = plt.subplots()
    name = "stable equilibrium of +"
    assert ns.plot.branch(branch, ax=ax, colors={name: OWN}) is ax
    drawn = [line for line in ax.lines if line.get_gid() == name]
    assert drawn and all(line.get_color() == OWN for line in drawn)
    first = [text.get_text() for text in ax.get_legend().get_texts()]
    assert name in first
    ns.plot.branch(branch, ax=ax, color="black")
    assert [text.get_text() for text in ax.get_legend().get_texts()] == first


def test_a_size_of_the_settings_is_taken_and_a_given_one_before_it():
    with plt.rc_context({"figure.figsize": (3.0, 2.0)}):
        assert example("two_fold_map").get_size_inches().tolist() == [3.0, 2.0]
        assert example("two_fold_map", size=(4, 5)).get_size_inches().tolist() == [4.0, 5.0]


def test_white_is_the_background_on_tinted_paper():
    with plt.style.context("ggplot"):
        figure = example("two_fold")
    (ax,) = figure.axes
    boxes = [text.get_bbox_patch() for text in ax.texts if text.get_bbox_patch()]
    assert boxes and all(box.get_facecolor()[:3] == to_rgba("#E5E5E5")[:3] for box in boxes)


def test_several_runs_and_one_panel():
    run = EXAMPLES["trajectory"][0].arguments[0]
    other = ns.simulate(run.system, [0.6, 0.1], 30)
    figure = ns.plot.trajectory([run, other], color=OWN)
    plane = figure.axes[-1]
    starts = [line.get_xydata()[0].tolist() for line in plane.lines if line.get_gid() == "start"]
    assert starts == [run.x[0].tolist(), other.x[0].tolist()]
    _, ax = plt.subplots()
    ns.plot.trajectory(run, states=["v"], phase_plane=False, ax=ax)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("t", "v")
    with pytest.raises(ns.OptionError, match="figure"):
        ns.plot.trajectory(run, ax=ax, figure=figure)


def test_notebooks_show_a_figure_once(monkeypatch):
    figure = example("two_fold_map")
    with pytest.raises(NotImplementedError):  # IPython then shows it as any figure
        figure._ipython_display_()
    monkeypatch.setattr(
        matplotlib, "get_backend", lambda: "module://matplotlib_inline.backend_inline"
    )
    figure._ipython_display_()  # pyplot shows it at the end of the cell
    plt.close(figure)
    with pytest.raises(NotImplementedError):
        figure._ipython_display_()


def test_axes_of_parts_of_a_figure_are_drawn_on():
    part = Figure().subfigures(1, 2)[1].add_subplot()
    assert isinstance(part, Axes)
    assert example("two_fold_map", ax=part) is part
