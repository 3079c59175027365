"""Regions are named on the picture, differ in grey, and what cannot be drawn is refused."""

import matplotlib.colors
import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from scipy.interpolate import RegularGridInterpolator

import bounce
import nonsmooth as ns
from tests.bounce.maps.test_outcomes import PAPER, TURF


@pytest.fixture(scope="module")
def outcomes():
    over = dict(xdot=np.linspace(-2, 2, 60), omega=np.linspace(-4, 4, 80))
    return bounce.outcome_map(TURF, over)


def test_regions_are_named_on_the_picture(outcomes):
    figure = bounce.plot.outcome_map(outcomes, curve=bounce.dividing_curve(TURF, step=0.2))
    axes = figure.axes[0]
    assert {t.get_text() for t in axes.texts} == set(PAPER)
    assert axes.get_xlim() == (-2, 2) and axes.get_ylim() == (-4, 4)


def test_narrow_regions_are_in_the_legend_and_every_colour_has_one_meaning():
    over = dict(eta=np.linspace(0.05, 3, 60), omega=np.linspace(-2, 3, 60))
    m = bounce.outcome_map(TURF, over, fixed=dict(xdot=0.5))
    axes = bounce.plot.outcome_map(m).axes[0]
    legend = axes.get_legend()
    assert legend is not None
    names = {t.get_text() for t in (*axes.texts, *legend.get_texts())}
    more = int(legend.get_texts()[-1].get_text().split()[1])
    assert len(set(m.regions) - names) == more and len(legend.get_texts()) <= 6
    (mesh,) = [one for one in axes.collections if isinstance(one, QuadMesh)]
    colours = dict(zip(m.regions, mesh.get_cmap().colors, strict=True))
    said = [colours[name] for name in m.regions if name in names]
    others = {colours[name] for name in m.regions if name not in names}
    assert len(set(said)) == len(said) and len(others) == 1 and not others & set(said)
    axes.figure.draw_without_rendering()
    axes.figure.draw_without_rendering()
    for key in axes.findobj(Legend):  # also the one below the map is on the sheet
        box = key.get_window_extent()
        assert box.y0 >= 0 and box.x1 <= axes.figure.bbox.x1


def test_a_title_is_not_cut_in_a_narrow_map():
    figure = ns.plot.style.new_figure((3.4, 3.0))
    ax = figure.add_subplot()
    bounce.plot.outcome_map(golf_map("penner"), ax=ax)
    figure.draw_without_rendering()
    figure.draw_without_rendering()
    assert ax._left_title.get_window_extent().x1 <= figure.bbox.x1


def golf_map(law):
    """A map of a law over landings as golfers read them."""
    over = dict(angle=np.radians(np.linspace(5, 75, 40)), spin=np.linspace(-1000, 1000, 50))
    with pytest.warns(bounce.golf.ExtrapolationWarning):
        return bounce.golf.landing_map(bounce.laws.TURFS[law].law, over, dict(speed=28.0))


@pytest.mark.parametrize("law", ["kelvin-voigt", "natural"])
def test_the_line_is_where_the_slip_at_lift_off_is_zero_and_says_so(outcomes, law):
    m = outcomes if law == "kelvin-voigt" else golf_map(law)
    axes = bounce.plot.outcome_map(m, "slip").axes[0]
    units = (1, 1) if m is outcomes else (np.pi / 180, np.pi / 30)
    points = np.vstack([line.get_xydata() for line in axes.lines]) * units
    slip = RegularGridInterpolator(m.axes[::-1], m.slip)
    assert len(points) >= 3
    assert np.abs(slip(points[:, ::-1])).max() < 1e-9 * np.abs(m.slip).max()
    assert "slip at lift-off $H_F=0$" in {text.get_text() for text in axes.findobj(Text)}


def test_no_line_where_no_bounce_leaves_in_reverse_slip():
    axes = bounce.plot.outcome_map(golf_map("natural-rigid")).axes[0]
    assert not axes.lines


def test_maps_of_golfers_are_in_degrees_and_say_all_of_the_law():
    m = golf_map("natural")
    figure = bounce.plot.outcome_map(m, "lift_off_angle")
    assert figure.axes[1].get_ylabel() == "angle above +x at lift-off (deg)"
    shown = figure.axes[0].collections[0].get_array()
    np.testing.assert_allclose(np.reshape(shown, m.slip.shape), np.degrees(m.lift_off_angle))
    title = figure.axes[0].get_title(loc="left")
    assert "mu = 0.998, restitution = 0.147, tilt = 18.4 deg, speed = 28 m/s" in title


@pytest.mark.parametrize("speeds, said", [("mph", "62.63 mph"), ("m/s", "28 m/s")])
def test_values_in_the_title_have_the_digits_of_a_landing(speeds, said):
    figure = bounce.plot.outcome_map(golf_map("natural"), speeds=speeds)
    assert figure.axes[0].get_title(loc="left").endswith(f"speed = {said}")


def test_the_cases_of_a_law_are_said_in_words_where_there_is_room():
    m = golf_map("penner")
    cases = {name.rstrip("+-") for name in m.regions}
    for quantity, width, shown in (
        ("itinerary", 7, True),
        ("itinerary", 3.4, False),
        ("slip", 7, False),
    ):
        ax = ns.plot.style.new_figure((width, 0.8 * width)).add_subplot()
        bounce.plot.outcome_map(m, quantity, ax=ax)
        said = {text.get_text().partition(":")[0] for text in ax.findobj(Text)}
        assert (cases <= said) is shown and ("+, \N{MINUS SIGN}" in said) is shown
    with pytest.raises(StopIteration):
        next(t for t in bounce.plot.outcome_map(m).findobj(Text) if "grip" in t.get_text())


@pytest.mark.parametrize("quantity", ["slip", "spin_reversal", "lift_off_angle"])
def test_quantities_are_drawn(outcomes, quantity):
    assert len(bounce.plot.outcome_map(outcomes, quantity).axes) == 2


@pytest.mark.slow
@pytest.mark.parametrize("width", [7.0, 3.4])
@pytest.mark.parametrize("quantity", ["itinerary", "slip", "spin_reversal"])
def test_keys_and_titles_are_within_the_sheet_and_off_the_map(outcomes, quantity, width):
    figure = ns.plot.style.new_figure((width, 0.85 * width))
    ax = figure.add_subplot()
    curve = bounce.dividing_curve(TURF, step=0.2)
    bounce.plot.outcome_map(outcomes, quantity, curve=curve, ax=ax)
    figure.draw_without_rendering()
    figure.draw_without_rendering()
    (key,) = ax.findobj(Legend)
    said = {text.get_text() for text in key.get_texts()}
    assert {"$H_F=0$, two-fold", "$H_F=0$, slipping", "their junction"} <= said and len(said) <= 6
    boxes = [key.get_window_extent(), ax.xaxis.label.get_window_extent()]
    assert not Bbox.intersection(*boxes) and boxes[0].y1 <= ax.bbox.y0
    for box in (*boxes, ax._left_title.get_window_extent()):
        assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1


def test_the_key_names_what_is_in_view():
    """The junction of the curve is at xdot = 0.44, beyond this map."""
    small = bounce.outcome_map(TURF, dict(xdot=np.linspace(0, 0.2, 8), omega=np.linspace(0, 1, 8)))
    figure = bounce.plot.outcome_map(small, curve=bounce.dividing_curve(TURF, step=0.2))
    said = {text.get_text() for key in figure.findobj(Legend) for text in key.get_texts()}
    assert {name for name in said if "$" in name or "junction" in name} == {"$H_F=0$, two-fold"}


def test_names_of_regions_are_off_the_line_in_a_narrow_map():
    """On Penner's turf the line crosses a small region."""
    figure = ns.plot.style.new_figure((3.4, 3.0))
    ax = figure.add_subplot()
    bounce.plot.outcome_map(golf_map("penner"), ax=ax)
    figure.draw_without_rendering()
    points = np.vstack([line.get_path().interpolated(20).vertices for line in ax.lines])
    pixels = ax.transData.transform(points)
    assert ax.texts
    for text in ax.texts:
        box = text.get_window_extent()
        assert not any(box.contains(*p) for p in pixels), text.get_text()


def test_a_map_of_yes_and_no_has_two_colours(outcomes):
    figure = bounce.plot.outcome_map(outcomes, "spin_reversal")
    assert figure.axes[0].collections[0].get_cmap().N == 2


def test_neighbouring_regions_differ_in_grey():
    """For readers who see no colours at all."""
    from bounce.plot.regions import COLOURS

    def grey(name):
        return float(np.dot(matplotlib.colors.to_rgb(COLOURS[name]), [0.299, 0.587, 0.114]))

    pairs = [
        ("S+", "S+ R S+"),
        ("S+ R S+", "S- R S+"),
        ("S- R S+", "S- S+"),
        ("S-", "S- R S-"),
        ("S- R S-", "S+ R S-"),
        ("S+ R S-", "S+ S-"),
        ("S- S+", "S-"),
        ("S+ S-", "S+"),
    ]
    assert all(abs(grey(a) - grey(b)) > 0.15 for a, b in pairs)


def test_pictures_refuse_what_they_cannot_draw(outcomes):
    with pytest.raises(ns.OptionError, match="quantity"):
        bounce.plot.outcome_map(outcomes, "spin")
    m = bounce.outcome_map(TURF, dict(mu=[0.1, 0.2], omega=[0.0, 1.0]), fixed=dict(xdot=1.0))
    with pytest.raises(ns.OptionError, match="curve"):
        bounce.plot.outcome_map(m, curve=bounce.dividing_curve(TURF, step=0.4, reach=0.6))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("quantity", ["itinerary", "slip"])
def test_a_picture_of_a_map_without_lift_off(quantity):
    turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    over = {"xdot": [0.0, 1.0], "omega": [0.0, 1.0]}
    figure = bounce.plot.outcome_map(bounce.outcome_map(turf, over, {"ydot": 1.0}), quantity)
    figure.canvas.draw()
    assert figure.axes[0].patch.get_hatch() and "no lift-off" in key_of(figure)


def key_of(figure):
    return [t.get_text() for k in figure.findobj(Legend) for t in k.get_texts()]


@pytest.mark.parametrize("size", [(3.4, 3.0), (7.0, 5.4)])
@pytest.mark.parametrize("quantity", ["itinerary", "slip"])
def test_landings_without_lift_off_are_hatched_and_named(size, quantity):
    """White is the middle of the scale of slip: it has one meaning. Slow balls stay in their own dent."""
    law = bounce.laws.TURFS["natural"].law
    over = dict(speed=np.linspace(5, 40, 30), spin=np.linspace(-1000, 1000, 30))
    with pytest.warns(bounce.golf.ExtrapolationWarning):
        found = bounce.golf.landing_map(law, over, dict(angle=np.radians(40)))
    stays = ~found.lift_offs.complete
    assert stays.any()
    axes = ns.plot.style.new_figure(size).add_subplot()
    figure = bounce.plot.outcome_map(found, quantity, ax=axes)
    (mesh,) = (c for c in axes.collections if isinstance(c, QuadMesh))
    assert np.array_equal(np.ma.getmaskarray(mesh.get_array()), stays)
    assert axes.patch.get_hatch() and key_of(figure).count("no lift-off") == 1
    with pytest.warns(bounce.golf.ExtrapolationWarning):
        fast = bounce.golf.landing_map(
            law, dict(over, speed=np.linspace(20, 40, 30)), dict(angle=np.radians(40))
        )
    assert "no lift-off" not in key_of(bounce.plot.outcome_map(fast, quantity))


def test_a_legend_of_dozens_of_regions_is_short():
    stiff = bounce.KelvinVoigt(mu=0.3, d1=0.05, d2=0.1, eta=12)
    axis = np.linspace(-1, 1, 60)
    outcomes = bounce.outcome_map(stiff, {"xdot": axis, "omega": axis})
    legend = bounce.plot.outcome_map(outcomes).axes[0].get_legend()
    names = [text.get_text() for text in legend.get_texts()]
    assert len(outcomes.regions) > 40
    assert len(names) == 6
    assert names[-1].endswith("more")
    assert max(map(len, names)) < 30
    assert len({*names}) == 6  # shortened, they still differ


def test_landings_outside_the_fit_are_hatched_and_named():
    m = golf_map("natural")
    axes = bounce.plot.outcome_map(m).axes[0]
    areas = [patch for patch in axes.patches if patch.get_gid() == "extrapolated"]
    (low, high), (left, right) = (axes.get_ylim(), axes.get_xlim())
    angle, spin = np.degrees(m.axes[0]), m.axes[1] * 30 / np.pi
    points = np.stack(np.meshgrid(angle, spin), axis=-1)[2:-2, 2:-2].reshape(-1, 2)
    hatched = np.any([area.get_path().contains_points(points) for area in areas], axis=0)
    assert 0.95 < np.mean(hatched == m.extrapolated[2:-2, 2:-2].ravel()) and hatched.any()
    assert not hatched.all() and left < right and low < high
    said = {text.get_text() for text in axes.findobj(Text)}
    assert "outside the landings of the fit" in said
    assert golf_map("natural").extrapolated.shape == m.slip.shape
