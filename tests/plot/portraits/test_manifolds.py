"""Pictures of manifolds show the curves and triangles that were computed, on axes that fit."""

import casadi as ca
import numpy as np
import pytest
from matplotlib.figure import Figure

import nonsmooth as ns

x, y, z = (ca.SX.sym(s) for s in "xyz")
PLANE = ns.FilippovSystem([x, y], surface=y, above=[x + y, -1], below=[x, 1])
SPACE = ns.FilippovSystem([x, y, z], surface=z, above=[x, -y, -1], below=[x, -y, 1])


def test_curves_in_the_plane():
    saddle = ns.find_pseudo_equilibrium(PLANE, [0.1, 0.0])
    both = [ns.manifold(PLANE, saddle, stable=s, length=1.0) for s in (True, False)]
    figure = ns.plot.manifold(both, names=["x", "y"], title="saddle")
    (axes,) = figure.axes
    arcs = [arc.points for one in both for arc in one.arcs]
    drawn = [line.get_xydata() for line in axes.lines if len(line.get_xydata()) > 1]
    assert all(np.array_equal(a, b) for a, b in zip(arcs, drawn, strict=True))
    assert len({line.get_color() for line in axes.lines}) == 3
    words = [text.get_text() for text in axes.get_legend().get_texts()]
    assert words == ["stable manifold", "unstable manifold", "their points"]
    assert axes.get_xlabel() == "x"


def test_a_surface_in_space():
    saddle = ns.find_pseudo_equilibrium(SPACE, [0.1, 0.1, 0.0])
    found = ns.manifold(SPACE, saddle, length=0.5, spacing=0.25)
    figure = ns.plot.manifold(found, names="xyz")
    (axes,) = figure.axes
    (faces,) = axes.collections
    figure.canvas.draw()
    assert len(faces.get_facecolor()) == len(found.triangles) > 10
    low, high = axes.get_zlim()
    assert low <= found.points[:, 2].min() and found.points[:, 2].max() <= high


def test_what_does_not_fit_is_refused():
    saddle = ns.find_pseudo_equilibrium(PLANE, [0.1, 0.0])
    found = ns.manifold(PLANE, saddle, length=0.2)
    with pytest.raises(ns.OptionError, match="found"):
        ns.plot.manifold([found, PLANE])
    space = Figure().add_subplot(projection="3d")  # pyplot would keep its figure
    with pytest.raises(ns.OptionError, match="ax"):
        ns.plot.manifold(found, ax=space)
