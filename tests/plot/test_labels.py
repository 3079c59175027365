"""Names stand beside what they name, on no other name, mark or frame, and hide as little as they can."""

import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.plot.labels import Labels


@pytest.fixture
def axes():
    with ns.plot.style.settings():
        ax = ns.plot.style.new_figure((4.0, 3.0)).add_subplot()
    ax.set(xlim=(0, 1), ylim=(0, 1))
    return ax


def boxes(ax, labels):
    """Rectangles of the names, after the figure was drawn."""
    ax.figure.draw_without_rendering()
    return [text.get_window_extent() for text in labels.get_children()]


def gap(box, points):
    """Shortest distance in points from a rectangle to one of some pixels."""
    low, high = box.get_points()
    away = np.maximum(np.maximum(low - points, points - high), 0.0)
    return np.hypot(*away.T).min() * 72 / 100


def test_names_of_neighbours_do_not_meet(axes):
    labels = Labels(axes)
    positions = [(0.5, 0.5), (0.52, 0.5), (0.5, 0.53), (0.98, 0.98), (0.02, 0.01)]
    for k, place in enumerate(positions):
        axes.plot(*place, "o", color="black", markersize=6)
        labels.name(f"a point with number {k}", place)
    found = boxes(axes, labels)
    frame = axes.get_window_extent()
    for k, (box, place) in enumerate(zip(found, axes.transData.transform(positions), strict=True)):
        assert not any(box.overlaps(other) for other in found[k + 1 :])
        assert frame.contains(*box.p0) and frame.contains(*box.p1)
        assert 2.0 < gap(box, place[None]) < 26.0


def test_a_line_leads_from_a_mark_to_a_name_that_is_far(axes):
    labels = Labels(axes)
    for _ in range(8):
        labels.name("many names in one place", (0.5, 0.5))
    boxes(axes, labels)
    place = axes.transData.transform((0.5, 0.5))
    far = [gap(t.get_window_extent(), place[None]) > 9.0 for t in labels.get_children()]
    lines = [len(name.leader.get_xdata()) == 2 for name in labels.names]
    assert any(lines) and lines == far


def test_a_name_hides_no_line_where_there_is_room(axes):
    labels, x = Labels(axes), np.linspace(0, 1, 200)
    axes.plot(x, 0.4 + 0.1 * np.sin(40 * x))
    axes.plot([0, 1], [0.4, 0.9])
    labels.name("a straight line", np.column_stack([x, 0.4 + 0.5 * x]), "red")
    (box,) = boxes(axes, labels)
    for drawn in axes.lines:
        points = axes.transData.transform(np.column_stack([x, np.interp(x, *drawn.get_data())]))
        assert gap(box, points) > 0.5
    assert gap(box, axes.transData.transform(np.column_stack([x, 0.4 + 0.5 * x]))) < 26.0
    assert labels.get_children()[0].get_color() == "red"


def test_names_inside_regions_are_on_their_points_and_those_out_of_sight_are_left_out(axes):
    labels = Labels(axes)
    labels.name("here", [(0.2, 0.2), (0.8, 0.8)], inside=True)
    labels.name("elsewhere", (3.0, 3.0))
    axes.plot(0.2, 0.2, "s", markersize=20)
    here, _ = boxes(axes, labels)
    middle = (here.p0 + here.p1) / 2
    assert np.abs(axes.transData.inverted().transform(middle) - 0.8).max() < 0.02
    assert [text.get_visible() for text in labels.get_children()] == [True, False]


def test_names_are_placed_again_for_another_resolution(axes, tmp_path):
    labels = Labels(axes)
    labels.name("a point", (0.5, 0.5))
    (small,) = boxes(axes, labels)
    axes.figure.savefig(tmp_path / "fine.png", dpi=300)
    (again,) = boxes(axes, labels)
    assert np.allclose(small.get_points(), again.get_points(), atol=1.0)
    axes.figure.savefig(tmp_path / "picture.pdf")
    labels.set_visible(False)
    axes.figure.draw_without_rendering()


def test_a_name_at_the_edge_is_inside_of_the_frame(axes):
    labels = Labels(axes)
    labels.name("a region at the edge", [[0.99, 0.5]], inside=True)
    (box,) = boxes(axes, labels)
    frame = axes.get_window_extent()
    assert frame.contains(*box.p0) and frame.contains(*box.p1)


def test_a_name_is_in_the_region_of_its_thing(axes):
    """Where there are lines, although another region is empty."""
    labels, x = Labels(axes), np.linspace(0, 1, 40)
    for height in np.linspace(0.05, 0.45, 9):
        axes.plot(x, 0 * x + height)
    labels.name(
        "a line", np.column_stack([x, 0 * x + 0.47]), keep=lambda points: points[:, 1] < 0.5
    )
    (box,) = boxes(axes, labels)
    assert axes.transData.inverted().transform(box.p1)[1] < 0.5


def test_names_of_two_sets_do_not_meet(axes):
    first, second = Labels(axes), Labels(axes)
    axes.plot(0.5, 0.5, "o")
    for labels in (first, second):
        labels.name("a point", (0.5, 0.5))
    (one,), (other,) = boxes(axes, first), boxes(axes, second)
    assert not one.overlaps(other)


def test_names_of_two_points_side_by_side_are_not_taken_for_each_other(axes):
    """Each is closer to its own point, and no line to a point passes another."""
    positions = np.array([(0.5, 0.5), (0.53, 0.5)])
    axes.plot([0, 0.5], [0.5, 0.5], color="black", linewidth=3.4)
    for y in np.linspace(0.52, 0.98, 12):
        axes.plot([0.5, 1.0], [0.5, y], color="black")
    axes.plot(*positions.T, "s", color="black", markersize=8, linestyle="none")
    labels = Labels(axes)
    for text, place in zip(("a stable node", "an invisible fold"), positions, strict=True):
        labels.name(text, place)
    points = axes.transData.transform(positions)
    for k, box in enumerate(boxes(axes, labels)):
        assert gap(box, points[k : k + 1]) <= gap(box, points[1 - k : 2 - k])
        assert not box.contains(points[0, 0] - 60, points[0, 1])  # the thick line is not hidden


def test_names_keep_a_distance_in_which_they_are_not_read_as_one(axes):
    labels = Labels(axes)
    for k in range(4):
        axes.plot(0.5, 0.5 + 0.01 * k, "o", color="black")
        labels.name(f"number {k}", (0.5, 0.5 + 0.01 * k))
    found = boxes(axes, labels)
    for k, box in enumerate(found):
        assert not any(box.padded(2.0).overlaps(other) for other in found[k + 1 :])
