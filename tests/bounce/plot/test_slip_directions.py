"""Directions are drawn in colours that colour-blind readers tell apart, with a key and arrows."""

import numpy as np
import pytest
from matplotlib.quiver import Quiver

import bounce
import nonsmooth as ns

# Machado, Oliveira & Fernandes 2009, severity 1.0, on linear sRGB.
BLIND = {
    "protan": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deutan": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "none": np.eye(3),
}
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def lab(rgb, eyes):
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = np.clip(linear @ np.transpose(eyes), 0, 1) @ TO_XYZ.T / TO_XYZ.sum(axis=1)
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.stack(
        [116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=-1
    )


@pytest.mark.parametrize("eyes", BLIND)
def test_directions_differ_to_every_eye(eyes):
    """An eighth of a turn apart they differ by 12 or more in CIELAB (2.3 is just seen)."""
    angle = np.linspace(-np.pi, np.pi, 48, endpoint=False)
    seen = lab(bounce.plot.direction_colours(angle), BLIND[eyes])
    apart = np.linalg.norm(seen[:, None] - seen, axis=-1)
    steps = np.abs(np.arange(48)[:, None] - np.arange(48))
    far = np.minimum(steps, 48 - steps) >= 6
    assert apart[far].min() >= 12.0


def test_forward_and_reverse_differ_in_grey_and_the_colours_close():
    forward, reverse = lab(bounce.plot.direction_colours([0.0, np.pi]), np.eye(3))[:, 0]
    assert forward - reverse > 50
    ends = bounce.plot.direction_colours([-np.pi, np.pi])
    assert ends[0] == pytest.approx(ends[1], abs=1e-12)


def test_a_picture_has_map_wheel_arrows_and_vortex():
    turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    spins = np.linspace(0.45, 0.65, 3), np.linspace(-0.1, 0.15, 2)
    directions = bounce.slip_map(turf, [0.2, 0.0], spins, tol=1e-6)
    figure = bounce.plot.slip_map(directions)
    (ax,) = figure.axes
    (ring,) = ax.child_axes
    assert [label.get_text() for label in ring.get_xticklabels()] == [
        "forward",
        "right",
        "reverse",
        "left",
    ]
    (dot,) = ax.lines
    assert dot.get_xydata()[0] == pytest.approx(directions.vortices[0].omega)
    (arrows,) = [c for c in ax.collections if isinstance(c, Quiver)]
    assert np.ravel(arrows.V) == pytest.approx(np.cos(directions.angle).ravel())


@pytest.mark.parametrize("width", [7.0, 3.4])
def test_arrows_are_within_the_frame_and_off_the_vortex(width):
    turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    spins = np.linspace(0.0, 2.6, 26), np.linspace(-1.3, 1.3, 26)
    directions = bounce.slip_map(turf, [1.0, 0.0], spins, tol=1e-6)
    figure = ns.plot.style.new_figure((width, 0.85 * width))
    ax = figure.add_subplot()
    bounce.plot.slip_map(directions, ax=ax)
    figure.draw_without_rendering()
    figure.draw_without_rendering()
    (arrows,) = [c for c in ax.collections if isinstance(c, Quiver)]
    shown = ~np.broadcast_to(arrows.Umask, arrows.U.shape)
    assert shown.sum() > {7.0: 150, 3.4: 50}[width]
    middle = ax.transData.transform(arrows.XY)[shown]
    half = ax.bbox.width / arrows.scale / 2
    assert 2 * half > 6 / 72 * figure.dpi  # points: a head and a tail
    way = np.column_stack([np.ravel(arrows.U), np.ravel(arrows.V)])[shown] * half
    ends = np.vstack([middle - way, middle + way])
    assert np.all(ends >= ax.bbox.min) and np.all(ends <= ax.bbox.max)
    (dot,), (name,) = ax.lines, ax.texts
    centre = ax.transData.transform(dot.get_xydata()[0])
    radius = dot.get_markersize() / 2 * figure.dpi / 72
    assert np.linalg.norm(ends - centre, axis=1).min() > radius
    assert name.get_text() == "+1" and name.get_window_extent().contains(*centre)
    wheel = [text.get_window_extent() for text in ax.child_axes[0].get_xticklabels()]
    assert all(box.x0 > ax.bbox.x1 and box.x1 <= figure.bbox.x1 for box in wheel)
