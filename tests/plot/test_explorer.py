"""The page of a system shows what Python computes, follows pointer and keys, and needs no network."""

import itertools
import json
import re

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.local.scans.box import Box
from nonsmooth.local.scans.plane_scan import PlaneScan
from nonsmooth.plot import driver
from nonsmooth.plot.offline_page import WEB
from tests.browser import WIDTHS
from tests.node import script

x, v, belt, friction = (ca.SX.sym(name) for name in ("x", "v", "belt", "friction"))
BELT = ns.FilippovSystem(
    [x, v],
    surface=v - belt,
    above=[v, -x - friction + 0.2 * (v - belt)],
    below=[v, -x + friction + 0.2 * (v - belt)],
    parameters={belt: 0.3, friction: 0.4},
)
RANGES = {"belt": (0.05, 1.0), "friction": (0.0, 1.0)}


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("explore") / "belt.html"
    ns.explore(BELT, start=[0.0, 0.0], t_end=30.0, parameters=RANGES, path=path)
    return path


@pytest.fixture(scope="module")
def space(tmp_path_factory):
    path = tmp_path_factory.mktemp("explore") / "fold.html"
    problem = ns.textbook.PROBLEMS["two_fold"]()
    ns.explore(problem.system, start=[0.3, 0.5, 0.4], t_end=3.0, path=path)
    return path


# What is written ------------------------------------------------------------------------------------


def test_the_page_is_small_and_a_notebook_shows_it(page):
    made = ns.explore(BELT, start=[0.0, 0.0], t_end=30.0, title="Belt & block")
    assert len(made.html) < 400_000 and "<title>Belt &amp; block</title>" in made.html
    assert made._repr_html_().startswith("<iframe srcdoc=") and "kB" in repr(made)
    assert len(page.read_bytes()) < 400_000


@pytest.mark.parametrize(
    ("error", "words", "changes"),
    [
        (ns.PointError, "shape", dict(start=[0.0, 0.0, 0.0])),
        (ns.ParameterError, "'mass', but the system has belt, friction", dict(parameters={"mass": (0, 1)})),
        (ns.OptionError, r"parameters\['belt'\].*lower one first", dict(parameters={"belt": (1, 0)})),
        (ns.OptionError, r"parameters\['belt'\]", dict(parameters={"belt": (0, float("nan"))})),
        (ns.OptionError, "mapping", dict(parameters=[(0, 1)])),
        (ns.OptionError, "t_end is -1", dict(t_end=-1)),
        (ns.OptionError, "box has 3 numbers. Give low and high of 2 states", dict(box=[0, 1, 2])),
        (ns.OptionError, "box of v", dict(box=[0, 1, 2, 2])),
        (ns.DefinitionError, "FilippovSystem", dict(system="belt")),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(error, words, changes):
    with pytest.raises(error, match=words):
        ns.explore(changes.pop("system", BELT), **changes)


def test_a_parameter_without_a_value_begins_in_the_middle_of_its_range():
    y, a = ca.SX.sym("y"), ca.SX.sym("a")
    system = ns.FilippovSystem([y], surface=y, above=[-a], below=[a], parameters=[a])
    with pytest.raises(ns.ParameterError, match="a"):
        ns.explore(system, start=[1.0])
    made = ns.explore(system, start=[1.0], t_end=2.0, parameters={a: (1.0, 3.0)})
    assert '"name": "a", "value": 2.0, "low": 1.0, "high": 3.0' in made.html


def data(page):
    return json.loads(re.search(r'id="data-explorer">(.*?)</script>', page.html)[1])


def test_a_two_fold_is_explored_from_beside_it():
    fold = ns.find_two_fold(ns.textbook.PROBLEMS["two_fold"]().system, near=[0.0, 0.1, 0.1])
    made = data(ns.explore(fold, t_end=5.0))
    assert made["start"] == pytest.approx([0.3, 0.3, 0.3], abs=1e-9)
    assert made["box"] == pytest.approx([-1.0, 1.0] * 3, abs=1e-9)
    assert made["cuts"] == [[0, 2, 1], [0, 1, 2]]  # planes on which z1 varies


def test_without_a_start_discrete_states_have_their_first_value():
    assert data(ns.explore(ns.textbook.PROBLEMS["gearbox"]().system))["start"] == [0.0, 1.0]


def test_folds_are_shown_where_forces_jump_only():
    stiff = ns.FilippovSystem([x, v], surface=x, above=[v, -4 * x], below=[v, -x])
    assert data(ns.explore(BELT))["slides"] and not data(ns.explore(stiff))["slides"]


def test_a_module_of_other_sources_makes_no_page(monkeypatch, tmp_path):
    monkeypatch.setattr(driver, "MODULE", tmp_path / "core.wasm")
    driver.MODULE.write_bytes(b"\0asm")
    driver.module.cache_clear()
    with pytest.raises(ns.NonsmoothError, match="make wasm"):
        ns.explore(BELT)
    driver.module.cache_clear()


def test_every_status_has_its_sentence():
    text = (WEB / "explore" / "explore.js").read_text(encoding="utf-8")
    named = set(re.findall(r"^    ([A-Z_]+): \(", text, re.MULTILINE))
    assert named == {status.name for status in ns.Status}


# Special points -------------------------------------------------------------------------------------

SCAN = """
const given = JSON.parse(require("fs").readFileSync(0, "utf8"));
const { Engine } = require(given.web + "/engine.js");
const { Scan } = require(given.web + "/explore/scan.js");
(async () => {
  const bytes = await Engine.inflated(given.module);
  const answers = [];
  for (const { system, p, box } of given.cases) {
    system.image = await Engine.inflated(system.image);
    const { lines, marks } = Scan.planar(await Engine.load(bytes, system), p, box);
    answers.push({ marks, kinds: lines.map(({ kind }) => kind), line: lines.flatMap(({ line }) => line) });
  }
  console.log(JSON.stringify(answers));
})();
"""


def parabola():
    """Sliding on a parabola with a pseudo-saddle, and a node above it."""
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    above = [-(a - 0.1), -2 * (b - 1.2)]
    return ns.FilippovSystem([a, b], surface=b - a**2, above=above, below=[a + 0.3, 1 + 0 * b])


def circle():
    """A closed surface inside of which there is a centre."""
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    outside = [-a + 0.4 * b, -b - 0.4 * a + 0.2]
    return ns.FilippovSystem([a, b], surface=a**2 + b**2 - 1, above=outside, below=[b, -a])


PLANES = [
    (BELT, (-1.0, 1.2, -1.0, 1.0)),
    (parabola(), (-1.5, 1.6, -1.0, 2.0)),
    (circle(), (-2.0, 2.1, -1.9, 2.0)),
]


def special(scan):
    """Folds, pseudo-equilibria and equilibria of a scan in Python as the page names them."""
    folds = [("fold", f"{one.kind} fold", one.point) for one in scan.folds]
    pseudo = [("pseudo", "pseudo", one.point) for one in scan.pseudo_equilibria]
    rest = [("equilibrium", "", one.point) for one in scan.equilibria]
    return [*folds, *pseudo, *rest]


def test_special_points_are_those_of_python_s_scan():
    cases = [
        dict(system=driver.described(s), p=s.parameter_vector().tolist(), box=box)
        for s, box in PLANES
    ]
    answers = script(SCAN, dict(web=str(WEB), module=driver.module(), cases=cases))
    for (system, box), answer in zip(PLANES, answers, strict=True):
        scan = PlaneScan.of(system, {}, Box.read(box))
        expected = special(scan)
        assert len(expected) == len(answer["marks"]) > 0
        for kind, name, point in expected:
            near = min(answer["marks"], key=lambda m: np.linalg.norm(np.subtract(m["x"], point)))
            assert near["type"] == kind and near["x"] == pytest.approx(point, abs=1e-8)
            assert near["kind"] == name if kind == "fold" else name in near["kind"]
        assert set(answer["kinds"]) == {piece.kind for piece in scan.pieces}
        heights = [system.evaluate(system.surface_function(), q) for q in answer["line"]]
        assert np.abs(heights).max() < 1e-6


# What one sees --------------------------------------------------------------------------------------

READY = """
while (document.body.dataset.ready !== "yes") await new Promise((go) => setTimeout(go, 10));
await new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)));
await new Promise((go) => setTimeout(go, 260)); // the address follows after a rest
const text = (id) => document.getElementById(id).textContent;
return {
  word: text("word").trim().replaceAll("−", "-"), facts: text("facts").replaceAll("−", "-"), hash: location.hash,
  bands: [...document.querySelectorAll("#plane .band")].map((e) => e.getAttribute("class")),
  marks: [...document.querySelectorAll("#plane .mark title")].map((e) => e.textContent.split(" at ")[0]),
  cuts: [...document.querySelectorAll("#plane .cut")].map((e) => e.getAttribute("class")),
  say: document.querySelector(".handle").getAttribute("aria-valuetext").replaceAll("−", "-"),
  orbit: document.querySelector("#plane .orbit").getAttribute("d"),
};
"""


def copied(browser, button):
    return browser.run(
        "let kept; navigator.clipboard.writeText = async (words) => { kept = words; };"
        "document.getElementById(given[0]).click(); return kept;",
        button,
    )


def state_of(seen):
    return [float(v) for v in re.search(r"state(.*?)events", seen["facts"])[1].split(",")]


@pytest.mark.browser
@pytest.mark.parametrize("width", WIDTHS)
def test_page_fits_and_shows_the_run_of_python(browser, page, width):
    browser.open(page, width)
    seen = browser.run(READY)
    run = ns.simulate(BELT, [0.0, 0.0], 30.0)
    assert seen["word"] == run.itinerary
    assert state_of(seen) == pytest.approx(run.x[-1], abs=1e-6)
    assert "statusreached the end" in seen["facts"]
    assert "band attracting" in seen["bands"] and set(seen["marks"]) == {
        "visible fold",
        "unstable focus",
    }
    assert browser.errors() == {} and browser.unnamed() == []


@pytest.mark.slow
@pytest.mark.browser
def test_keys_sliders_and_the_address(browser, page):
    from selenium.webdriver.common.keys import Keys

    browser.open(page, hash="p=0.5,0.2&x=0.4,-0.2003&t=12&box=-1,1,-1,1")
    seen = browser.run(READY)
    run = ns.simulate(BELT, [0.4, -0.2003], 12.0, parameters={"belt": 0.5, "friction": 0.2})
    assert seen["word"] == run.itinerary and state_of(seen) == pytest.approx(run.x[-1], abs=1e-6)
    browser.run("document.querySelector('.handle').focus()")
    handle = browser.find(".handle")
    handle.send_keys(Keys.SHIFT, Keys.ARROW_LEFT * 2)
    seen = browser.run(READY)
    assert seen["say"] == "x 0.3, v -0.2003" and "&x=0.3,-0.2003&" in seen["hash"]
    browser.find("#p-0-range").send_keys(Keys.ARROW_RIGHT * 5)
    seen = browser.run(READY)
    (belt,) = re.findall(r"p=([\d.]+),0.2", seen["hash"])
    assert float(belt) > 0.5
    run = ns.simulate(BELT, [0.3, -0.2003], 12.0, parameters={"belt": float(belt), "friction": 0.2})
    assert seen["word"] == run.itinerary and state_of(seen) == pytest.approx(run.x[-1], abs=1e-6)
    browser.find("#reset").click()
    assert "p=0.3,0.4&x=0,0&t=30" in browser.run(READY)["hash"]
    assert browser.errors() == {}


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.parametrize("width", WIDTHS)
def test_the_start_is_dragged(browser, page, width):
    from selenium.webdriver.common.action_chains import ActionChains

    browser.open(page, width, hash="box=-1,1,-1,1")
    browser.run(READY)
    frame = browser.run(
        "return document.querySelector('#plane .frame').getBoundingClientRect().width"
    )
    dot = browser.find("#plane .handle .dot")
    by = int(frame / 4)
    ActionChains(browser.driver).click_and_hold(dot).move_by_offset(by, 0).release().perform()
    seen = browser.run(READY)
    x, v = [float(own) for own in re.search(r"&x=([^&]*)", seen["hash"])[1].split(",")]
    assert (x, v) == pytest.approx((0.5, 0.0), abs=0.03)
    assert seen["word"] == ns.simulate(BELT, [x, v], 30.0).itinerary


@pytest.mark.slow
@pytest.mark.browser
def test_python_and_svg_are_what_is_shown(browser, page):
    browser.open(page, hash="p=0.6,0.3&x=0.1,0.2&t=9")
    browser.run(READY)
    code = copied(browser, "python")
    names = {"nonsmooth": ns, "system": BELT, "print": lambda *_: None}
    exec(code, names)
    seen = browser.run(READY)
    assert names["run"].itinerary == seen["word"]
    picture = browser.run(
        "let kept; URL.createObjectURL = (blob) => { kept = blob; return 'data:,'; };"
        "document.getElementById('save').click(); return await kept.text();"
    )
    assert picture.startswith("<svg") and "var(" not in picture and seen["orbit"] in picture


def paced():
    """A clock whose period is a parameter, and gears, with names that HTML and Python escape."""
    y, period, gear = (ca.SX.sym(name) for name in ("y", 'T "<b>\\n', "counts"))
    clock, up = ns.Clock(period), {gear: ca.fmin(gear + 1, 3)}
    return ns.FilippovSystem(
        [y],
        field=[gear - y * ca.cos(clock.phase)],
        clocks=clock,
        discrete={gear: (1, 2, 3)},
        parameters={period: 0.7},
        resets=ns.Reset(y - 1, up, direction=1),
    )


@pytest.mark.slow
@pytest.mark.browser
def test_what_is_copied_is_what_is_shown(browser, tmp_path):
    from selenium.webdriver.common.keys import Keys

    system, path = paced(), tmp_path / "paced.html"
    ns.explore(system, start=[1 / 3, 0.1, 1.0], t_end=9.0, path=path)
    browser.open(path)
    for keys in (Keys.ARROW_RIGHT * 3, Keys.END, Keys.ARROW_LEFT):
        for slider in browser.driver.find_elements("css selector", "#inputs input[type=range]"):
            slider.send_keys(keys)
        link = copied(browser, "link")
        seen = browser.run(READY)
        names = {"nonsmooth": ns, "system": system, "print": lambda *_: None}
        exec(copied(browser, "python"), names)
        run = names["run"]
        assert run.itinerary.split(" ")[-36:] == seen["word"].removeprefix("… ").split(" ")
        assert state_of(seen) == pytest.approx(run.x[-1], rel=1e-6, abs=1e-9)
        assert browser.run("return document.querySelectorAll('#word .mode-slide').length") == 0
        browser.open(path, hash=link.partition("#")[2])
        assert state_of(browser.run(READY)) == state_of(seen)


@pytest.mark.slow
@pytest.mark.browser
def test_a_sweep_shows_the_states_of_python(browser, page):
    browser.open(page)
    browser.run(READY)
    script = """
    const found = [], sweep = new Sweep("own", (points) => points && found.push(...points));
    await sweep.request({ columns: 8, low: 0.1, high: 0.9, p: [0.3, 0.4], x: [0, 0], index: 0, state: 0,
      kinds: 1 << Page.data("system-own").machine.kinds.indexOf("entry"), tEnd: 3000 });
    while (!sweep.runs) await new Promise((go) => setTimeout(go, 10));
    return found;
    """
    points = np.reshape(browser.run(script), (-1, 2))
    assert len(np.unique(points[:, 0])) == 8
    for value in np.unique(points[:, 0]):
        run = ns.simulate(BELT, [0.0, 0.0], 300.0, parameters={"belt": value})
        entries = [event.x[0] for event in run.events if event.kind == "entry"]
        own = points[points[:, 0] == value, 1]
        assert own == pytest.approx(entries[-1], abs=1e-6)
    assert browser.errors() == {}


@pytest.mark.browser
def test_a_system_in_space_is_turned_and_its_start_moved(browser, space):
    from selenium.webdriver.common.action_chains import ActionChains

    browser.open(space)
    before = browser.run(READY)
    problem = ns.textbook.PROBLEMS["two_fold"]()
    assert before["word"] == ns.simulate(problem.system, [0.3, 0.5, 0.4], 3.0).itinerary
    assert before["cuts"]
    frame = browser.find("#plane .frame")
    drag = ActionChains(browser.driver).move_to_element_with_offset(frame, -150, 100)
    drag.click_and_hold().move_by_offset(90, 20).release().perform()
    turned = browser.run(READY)
    assert "turn=1.2,0.48" in turned["hash"] and turned["word"] == before["word"]
    assert turned["orbit"] != before["orbit"] and turned["say"] == before["say"]
    dot = browser.find("#plane .handle .dot")
    ActionChains(browser.driver).click_and_hold(dot).move_by_offset(25, 0).release().perform()
    assert browser.run(READY)["say"] != turned["say"]
    assert browser.errors() == {} and browser.unnamed() == []


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", [*ns.textbook.PROBLEMS][::6])
def test_pages_of_textbook_problems_have_no_errors(browser, tmp_path, name):
    problem = ns.textbook.PROBLEMS[name]()
    run = problem.run()
    t_end = max(float(run.t[-1]), 1e-3)
    values = {k: (v - 1, v + 1) for k, v in itertools.islice(run.parameters.items(), 2)}
    path = tmp_path / "page.html"
    ns.explore(problem.system, start=run.x[0], t_end=t_end, parameters=values, path=path)
    browser.open(path, 390)
    browser.run(READY)
    assert browser.errors() == {} and browser.unnamed() == []


@pytest.mark.slow
@pytest.mark.browser
def test_an_address_that_makes_no_sense_shows_the_start(browser, page):
    wrong = {
        "p=a,b&x=1&t=-3&flow=short": "p, x, t.",
        "box=1,0,0,0&turn=1": "box, turn.",
        "flow=toString": "flow.",
        "%E0%A4%A": "\ufffd%A.",
    }
    for words, left_out in wrong.items():
        browser.open(page, hash=words)
        seen = browser.run(READY)
        assert seen["say"] == "x 0, v 0" and browser.errors() == {}
        assert browser.left_out() == left_out
    browser.open(page, hash=seen["hash"].lstrip("#"))
    assert browser.run(READY)["say"] == "x 0, v 0" and browser.left_out() == ""
