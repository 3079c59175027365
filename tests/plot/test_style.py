"""The style of pictures works for other figures, and leaves matplotlib's settings alone."""

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from numpy.testing import assert_allclose

import nonsmooth as ns

style = ns.plot.style


def test_settings_and_their_changes_end_with_the_block():
    before = dict(matplotlib.rcParams)
    with style.settings({"font.size": 13.0}):
        assert matplotlib.rcParams["font.size"] == 13.0
        assert matplotlib.rcParams["legend.frameon"] is False
    assert dict(matplotlib.rcParams) == before
    with style.settings():
        assert matplotlib.rcParams["font.size"] != 13.0


def test_fields_by_letter_are_the_colours_of_the_two_fields():
    assert {"+": style.ABOVE, "-": style.BELOW} == style.FIELDS
    palette = {style.BLACK, style.ORANGE, style.SKY, style.GREEN, style.YELLOW, style.BLUE,
               style.VERMILLION, style.PURPLE}  # fmt: skip
    assert len(palette) == 8


def arrowheads(ax):
    return [patch for patch in ax.patches if isinstance(patch, FancyArrowPatch)]


@pytest.mark.parametrize("at", [0.25, 0.5, 1.0])
def test_an_arrowhead_is_at_its_share_of_the_length_and_points_ahead(at):
    ax = Figure().add_subplot()
    style.arrowhead(ax, [[0, 0], [1, 0], [1, 3]], at, style.BLACK)
    (patch,) = arrowheads(ax)
    tail, tip = patch._posA_posB
    assert_allclose(tip, (4 * at, 0) if 4 * at <= 1 else (1, 4 * at - 1))
    ahead = np.subtract(tip, tail)
    assert ahead @ ([1, 0] if 4 * at <= 1 else [0, 1]) > 0


def test_lengths_are_measured_in_the_units_of_the_axes_on_request():
    ax = Figure().add_subplot()
    style.arrowhead(ax, [[0, 0], [1, 0], [1, 300]], 0.5, style.BLACK, scale=(1, 300))
    (patch,) = arrowheads(ax)
    assert_allclose(patch._posA_posB[1], (1, 0), atol=1e-12)


def test_a_curve_without_length_gets_no_arrowhead():
    ax = Figure().add_subplot()
    style.arrowhead(ax, [[1, 1], [1, 1]], 0.5, style.BLACK)
    assert arrowheads(ax) == []


@pytest.mark.parametrize("size", [None, 3, (1,), (1, -1), (1, np.inf), "ab"])
def test_wrong_sizes_and_axes_are_refused(size):
    with pytest.raises(ns.OptionError, match="size"):
        style.new_figure(size)
    with pytest.raises(ns.OptionError, match="size"):
        ns.plot.two_fold_map("VV", size=size or "x")
    assert plt.get_fignums() == []


def test_entries_of_a_legend():
    line = style.line(style.CANARD, "canard", 2.0, style.DASHED)
    assert (line.get_label(), line.get_color(), line.get_linewidth()) == ("canard", "#A8005C", 2.0)
    mark = style.marker("D", "fold", "white")
    assert (mark.get_marker(), mark.get_markerfacecolor()) == ("D", "white")
    assert mark.get_linestyle() == "None"


def test_pieces_inside_a_box():
    turns = np.linspace(0, 2 * np.pi, 400)
    pieces = style.inside(np.column_stack([2 * np.cos(turns), np.sin(turns)]), (-1, 1, -2, 2))
    assert len(pieces) == 2
    assert all(np.abs(piece[:, 0]).max() <= 1 for piece in pieces)


def test_nothing_shows_through_the_gaps_of_a_dashed_line():
    figure = Figure(figsize=(3, 1))
    ax = figure.add_axes((0, 0, 1, 1))
    for at in np.linspace(0.05, 0.95, 40):
        ax.plot([at, at], [0, 1], color="black", linewidth=1.0, zorder=2)
    look = {"color": style.GREEN, "linewidth": 2.4, "linestyle": style.LONG_DASH}
    ax.plot([0, 1], [0.5, 0.5], zorder=3, path_effects=style.halo(4.0), **look)
    ax.set(xlim=(0, 1), ylim=(0, 1))
    ax.set_axis_off()
    figure.canvas = FigureCanvasAgg(figure)
    figure.canvas.draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)
    middle = pixels[len(pixels) // 2]
    assert middle.sum(axis=1).min() > 200  # green or white; black is 0
    assert np.sum(middle.sum(axis=1) > 700) > 20  # and there are gaps
