"""Results show themselves in notebooks: escaped text, a well-formed picture, nothing drawn by matplotlib."""

import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import casadi as ca
import numpy as np
import pytest

import bounce
import nonsmooth as ns
from nonsmooth.notebook import card, circle, lines, quadrants


def parsed(text):
    """The elements of a piece of HTML, which must be well formed."""
    return ElementTree.fromstring(f"<all>{text.replace('<br>', '<br/>')}</all>")


def polylines(text):
    return list(parsed(text).iter("{http://www.w3.org/2000/svg}polyline"))


def coordinates(line):
    return np.array([[float(v) for v in p.split(",")] for p in line.get("points").split()])


X, V = ca.SX.sym("x"), ca.SX.sym("v")
RELAY = ns.FilippovSystem([X, V], surface=V, above=[V, -X - 0.4], below=[V, -X + 0.4])


def shown():
    """One of each object that shows itself."""
    run = ns.simulate(RELAY, [3.0, 0.0], t_end=20.0)
    belt = ns.textbook.leine_stick_slip()
    orbit = ns.periodic_orbit(belt.system, belt.run())
    mu = ca.SX.sym("mu")
    focus = ns.FilippovSystem(
        [X, V], surface=V, above=[-X - V + mu, X - V + mu], below=[1, 1], parameters={mu: 0.5}
    )
    yield "FilippovSystem", RELAY
    yield "Trajectory", run
    yield "Ensemble", ns.ensemble(RELAY, [[1.0, 0.0], [2.0, 0.0]], t_end=1.0)
    yield "TwoFold", ns.find_two_fold(ns.textbook.two_fold("II-C").system, near=[0.0, 0.0, 0.0])
    yield "PeriodicOrbit", orbit
    yield "Branch", ns.continue_equilibrium(focus, [0.0, 0.5], "mu", bounds=(-1.0, 1.0))
    turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    yield "Shot", bounce.simulate(turf, 0.3, -1.0, 0.1)


@pytest.fixture(scope="module")
def objects():
    return dict(shown())


def test_main_objects_show_themselves(objects):
    for name, thing in objects.items():
        text = thing._repr_html_()
        assert len(list(parsed(text).iter("td"))) >= 2, name
        assert len(text) < 20_000, name


@pytest.mark.parametrize(("name", "count"), [("Trajectory", 2), ("TwoFold", 2), ("Shot", 5)])
def test_pictures_show_what_they_should(objects, name, count):
    # two states; two eigenlines; five states of a ball
    assert len(polylines(objects[name]._repr_html_())) == count


def test_multipliers_are_beside_the_unit_circle():
    drawn = list(parsed(circle([0.5, -2.0, 1j, complex("nan")])).iter())
    dots = [e for e in drawn if e.get("r") == "3.5"]
    assert [(float(e.get("cx")), float(e.get("cy"))) for e in dots[::2]] == [
        (72.0, 52.0),
        (52.0, 12.0),
    ]
    assert dots[1].get("fill") != dots[0].get("fill")  # outside


def test_a_system_shows_its_fields_and_surface():
    cells = [e.text for e in parsed(RELAY._repr_html_()).iter("td")]
    assert cells[cells.index("surface h0") + 1] == "v"
    assert cells[cells.index("field above") + 1] == str(RELAY.field("+"))
    two = ns.textbook.glass_loop().system._repr_html_()
    assert "surface h1" in two and "field above" not in two


def test_a_run_of_no_length_shows_itself():
    parsed(ns.simulate(RELAY, [1.0, 0.0], t_end=0.0)._repr_html_())


def test_texts_are_escaped():
    evil = ca.SX.sym("<script>")
    system = ns.FilippovSystem([evil], field=[-evil])
    run = ns.simulate(system, [1.0], t_end=1.0)
    for thing in (system, run):
        text = thing._repr_html_()
        parsed(text)
        assert "<script>" not in text and "&lt;script&gt;" in text
    assert card("<a>", [("<b>", "<c>")], "").count("&lt;") == 3


def test_lines_keep_extremes_of_what_is_finite():
    t = np.linspace(0, 1, 1000)
    (line,) = polylines(lines(t, t[:, None] ** 2, ["x"]))
    points = coordinates(line)
    assert len(points) <= 300
    assert points[0].tolist() == [4.0, 84.0] and points[-1].tolist() == [256.0, 4.0]
    assert (np.diff(points[:, 0]) > 0).all() and (np.diff(points[:, 1]) <= 0).all()


@pytest.mark.parametrize(
    "values", [[np.nan, np.nan], [1.0], [], [0.0, np.inf, 1.0], [1e308, -1e308], [2.0, 2.0]]
)
def test_what_cannot_be_drawn_is_left_out(values):
    values = np.array(values)
    text = lines(np.arange(len(values)), values[:, None], ["x"])
    parsed(text)
    assert "nan" not in text and "inf," not in text


def test_slopes_that_are_infinite_are_left_out():
    assert len(polylines(quadrants([1.0, np.inf, np.nan, -2.0]))) == 2


def test_long_texts_are_cut():
    assert len(card("t", [("a", "x" * 10_000)])) < 400


def test_nothing_is_drawn_by_matplotlib():
    code = (
        "import sys, casadi as ca, nonsmooth as ns\n"
        "x = ca.SX.sym('x')\n"
        "run = ns.simulate(ns.FilippovSystem([x], field=[-x]), [1.0], 1.0)\n"
        "run._repr_html_()\n"
        "print('matplotlib' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
