"""The map of basins shows each start's cell in its label's colour, and the attractors on it."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, v = ca.SX.sym("x"), ca.SX.sym("v")
WELL = ns.FilippovSystem([x, v], surface=x, above=[v, 1 - x - 0.3 * v], below=[v, -1 - x - 0.3 * v])


def test_cells_marks_and_legend():
    found = ns.basins(WELL, {"x": np.linspace(-3, 3, 7), "v": [-1.0, 0.0, 1.0]}, t_end=100.0)
    figure = ns.plot.basins(found, title="wells")
    (axes,) = figure.axes
    (mesh,) = axes.collections
    values = mesh.get_array().reshape(3, 7)
    present = np.unique(found.labels)
    assert np.array_equal(present[values.astype(int)].T, found.labels)
    assert axes.get_xlim() == (-3.5, 3.5) and axes.get_ylim() == (-1.5, 1.5)
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_title()) == ("x", "v", "wells")
    marks = np.array([line.get_xydata()[0] for line in axes.lines])
    assert np.allclose(marks, [a.points[0] for a in found.attractors])
    words = [text.get_text() for text in axes.get_legend().get_texts()]
    assert words[0].startswith("attractor 1: ") and words[-2].startswith("not unique: ")
    assert words[-1] == "attractor"
    colours = {mesh.cmap(mesh.norm(k)) for k in range(len(present))}
    assert len(colours) == len(present)


def test_other_grids_are_refused():
    found = ns.basins(WELL, [[1.0, 0.0]], t_end=100.0)
    for given in (found, WELL):
        with pytest.raises(ns.OptionError, match="found"):
            ns.plot.basins(given)
