"""The friction cone shows every phase inside the cone, and importing bounce loads no matplotlib."""

import subprocess
import sys

import numpy as np
import pytest

import bounce
import nonsmooth as ns

TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.0, eta=0.5, G=0.05, load="net")


@pytest.mark.slow
def test_friction_cone(tmp_path):
    shot = bounce.simulate(TURF, 0.3, -1.0, 0.2)
    assert shot.itinerary == "F + s -"
    figure = bounce.plot.friction_cone(shot)
    ax = figure.axes[0]
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels[-3:] == ["touch-down", "transition", "lift-off"]
    assert sum("slip" in label for label in labels) == 2
    for line in ax.get_lines():
        label = line.get_label()
        if "slip" in label or "rolling" in label:
            x, y = line.get_data()
            assert np.all(np.abs(x) <= 0.3 * y + 1e-9)
    figure.savefig(tmp_path / "cone.png")
    assert (tmp_path / "cone.png").stat().st_size > 10_000


@pytest.mark.parametrize("width", [6.4, 3.4])
def test_every_line_has_a_name_and_no_name_is_cut(width):
    figure = ns.plot.style.new_figure((width, 0.85 * width))
    ax = figure.add_subplot()
    bounce.plot.friction_cone(bounce.simulate(TURF, 0.3, -1.0, 0.2), ax=ax)
    figure.draw_without_rendering()
    figure.draw_without_rendering()
    (names,) = [one for one in ax.artists if isinstance(one, ns.plot.labels.Labels)]
    texts = names.get_children()
    written = {text.get_text().replace("\n", " ") for text in texts}
    assert written == {
        r"$\Lambda_T=-\mu\Lambda_N$", r"$\Lambda_T=\mu\Lambda_N$", "friction jumps", "no friction yet",
    }  # fmt: skip
    for text in texts:
        box = text.get_window_extent()
        assert ax.bbox.x0 <= box.x0 and box.x1 <= ax.bbox.x1 and ax.bbox.y0 <= box.y0
        if text.get_text().startswith("friction"):  # off the edges of the cone
            friction, load = ax.transData.inverted().transform(box.get_points()).T
            assert np.abs(friction).max() < 0.3 * load.min()
    key = ax.get_legend()
    assert len(key.get_texts()) <= 6
    box, name = key.get_window_extent(), ax.xaxis.label.get_window_extent()
    assert box.y1 <= name.y0 and box.x0 >= 0 and box.x1 <= figure.bbox.x1 and box.y0 >= 0


def test_phases_differ_in_colour_line_and_grey():
    styles = list(bounce.plot.STYLES.values())
    assert len({str(s["linestyle"]) for s in styles}) == len(styles)
    weights = np.array([0.299, 0.587, 0.114])
    greys = sorted(
        weights @ [int(s["color"][k : k + 2], 16) / 255 for k in (1, 3, 5)] for s in styles
    )
    assert np.diff(greys).min() > 0.1


def test_on_given_axes():
    from matplotlib.figure import Figure

    figure = Figure()
    left, _ = figure.subplots(1, 2)
    shot = bounce.simulate(TURF, 0.3, -1.0, 0.2)
    assert bounce.plot.friction_cone(shot, ax=left) is left
    assert left.get_lines()


def test_import_is_light():
    """On top of nonsmooth, bounce loads neither matplotlib nor scipy."""
    code = (
        "import sys, nonsmooth; before = set(sys.modules); import bounce; "
        "new = {name.partition('.')[0] for name in set(sys.modules) - before}; "
        "print(new & {'matplotlib', 'scipy'})"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "set()"


def test_unknown_attribute():
    with pytest.raises(AttributeError, match="no attribute 'plots'"):
        _ = bounce.plots
