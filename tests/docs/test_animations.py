"""Animations have the requested number of frames, move, and end with a still of the last one."""

import itertools

import numpy as np
import pytest
from PIL import Image

from docs.tools import animations


@pytest.mark.slow_cases("funnel")
@pytest.mark.parametrize("animation", animations.ANIMATIONS, ids=lambda a: a.name)
def test_it_moves_and_ends_with_a_still(animation, tmp_path):
    moving, still = animations.write(animation, tmp_path, count=3)
    with Image.open(moving) as image:
        assert image.n_frames == 3
        shown = []
        for k in range(3):
            image.seek(k)
            shown.append(np.asarray(image.convert("RGB"), float))
    assert all(np.abs(a - b).max() > 100 for a, b in itertools.pairwise(shown))
    with Image.open(still) as last:
        assert np.abs(np.asarray(last, float) - shown[-1]).mean() < 5  # WebP loses a little


def test_each_moment_of_the_bounce_has_its_dot_and_the_ground_is_below_the_ball():
    (bounce,) = [a for a in animations.ANIMATIONS if a.name == "bounce_in_its_cone"]
    for figure in bounce.frames(5):
        cone, ball = figure.axes
        assert sum(line.get_marker() == "o" for line in cone.lines) == 1
        (circle,) = ball.patches
        assert circle.get_xy()[:, 1].min() > ball.get_ylim()[0] + 0.1
