"""Results show themselves in notebooks: escaped text, a well-formed picture, nothing drawn by matplotlib."""

import dataclasses
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import casadi as ca
import numpy as np
import pytest

import bounce
import nonsmooth as ns
from nonsmooth.model.expressions.mathml import equation, symbol
from nonsmooth.notebook import circle, lines, quadrants, representation
from testset.problem import RUNS, Problem, cases


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
    written = rows(RELAY)
    assert written["surface h0"] == "h0=v"
    assert written["field above"] == "x˙=v" + "v˙=−(x+0.4)"
    two = rows(ns.textbook.glass_loop().system)
    assert "surface h1" in two and "field above" not in two and two["field"].endswith("−y")


def rows(thing):
    """The text of each row of a card by its name."""
    table = parsed(thing._repr_html_()).iter("tr")
    return {one[0].text: "".join(one[1].itertext()).replace("\u2062", "") for one in table}


@pytest.mark.parametrize(
    ("expression", "written"),
    [
        (X - (V - 1), "x−(v−1)"),
        (-(X + V) * 2, "2(−(x+v))"),
        (X / (1 + V) ** 2, "x(1+v)2"),
        (ca.sqrt(X) * ca.sin(V), "xsin(v)"),
        (1e-7 * X, "1·10-7x"),
        (X + (-0.5), "x−0.5"),
        (ca.fabs(ca.SX.sym("omega_1") * X), "|ω1x|"),
        (sum(ca.sin(k * X) ** k for k in range(60)), "…"),
    ],
)
def test_expressions_are_typeset_with_the_parentheses_they_need(expression, written):
    text = equation(symbol("y"), ca.SX(expression), ca.symvar(ca.vertcat(expression, X, V)))
    said = "".join(parsed(text).itertext()).replace("\u2062", "")
    assert said == f"y={written}"


def doors():
    """The modules whose names users import."""
    return [ns.local, ns.orbit, ns.flow, ns.proofs, ns.two_folds, ns.continuation, ns.textbook, bounce,
            bounce.golf, bounce.maps, bounce.shot]  # fmt: skip


def test_every_result_shows_itself():
    """Every exported dataclass has a card; a new one gets that of its fields."""
    public = [getattr(door, name) for door in doors() for name in door.__all__]
    kinds = [one for one in public if isinstance(one, type) and dataclasses.is_dataclass(one)]
    assert len(kinds) > 50
    assert {kind.__name__ for kind in kinds if not hasattr(kind, "_repr_html_")} == set()


def results():
    """Results of the functions that users call most, besides those of ``shown``."""
    belt = ns.textbook.leine_stick_slip()
    run = ns.simulate(RELAY, [3.0, 0.0], t_end=20.0)
    turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    yield belt
    yield run.events[0]
    yield ns.classify(RELAY, [0.2, 0.0])
    yield ns.basins(belt.system, {"x": [0.2, 0.5], "v": [0.0, 0.1]}, t_end=100.0)
    yield ns.gradient(run, X**2)
    yield ns.sensitivity(run)
    yield ns.two_folds.classify_two_fold((1, -1), (2.0, 1.0))
    yield bounce.Landing(20.0, -10.0, 200.0)
    yield bounce.golf.flight(bounce.Landing(60.0, 12.0, 280.0))
    yield bounce.lift_off(turf, 0.3, -1.0, [0.1, 0.2])
    yield bounce.dividing_curve(turf, step=0.4)


def test_results_are_well_formed_and_short():
    for one in results():
        assert rows(one), type(one)
        assert len(one._repr_html_()) < 20_000, type(one)


def test_systems_of_each_combination_of_parts_show_themselves():
    parts = {frozenset(one["system"]): one for one in cases(RUNS) if "system" in one}
    for one in parts.values():
        assert "states" in rows(Problem(one).system), one["id"]


def test_a_run_of_no_length_shows_itself():
    parsed(ns.simulate(RELAY, [1.0, 0.0], t_end=0.0)._repr_html_())


def test_numbers_of_canards_are_words_and_a_shot_has_rows(objects):
    assert rows(objects["TwoFold"])["canards"] == "infinitely many"
    assert list(rows(objects["Shot"]))[:2] == ["phases", "lift-off"] and bounce.__version__


def test_texts_are_escaped():
    evil = ca.SX.sym("<script>")
    system = ns.FilippovSystem([evil], field=[-evil])
    run = ns.simulate(system, [1.0], t_end=1.0)
    for thing in (system, run):
        text = thing._repr_html_()
        parsed(text)
        assert "<script>" not in text and "&lt;script&gt;" in text
    assert representation("<a>", [("<b>", "<c>")], "").count("&lt;") == 3


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
    assert len(representation("t", [("a", "x" * 10_000)])) < 400


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
