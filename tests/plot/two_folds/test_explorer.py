"""The page on two-folds computes what Python computes, follows mouse and keys, and needs no network."""

import math
import re

import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.__main__ import main
from nonsmooth.local.two_folds.flights import has_diabolo
from nonsmooth.local.two_folds.reduced_flow import eigenlines, orbit, sectors
from nonsmooth.plot.offline_page import WEB
from nonsmooth.plot.two_folds.atlas import CASES
from nonsmooth.plot.two_folds.class_map import REACH, SIGMA
from tests.browser import WIDTHS

two_folds = ns.two_folds


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("explorer") / "two_folds.html"
    assert main(["explore", "--out", str(path)]) == 0
    return path


def pairs(folds, count):
    """Numbers of all sizes, a tenth of them on or beside a boundary of the class map."""
    rng = np.random.default_rng(sum(map(ord, folds)))
    nu = rng.uniform(-3, 3, (count, 2))
    nu[: count // 5] *= 10.0 ** rng.uniform(-3, 3, (count // 5, 1))
    edge = nu[count // 5 : count * 3 // 10]
    third = len(edge) // 3
    edge[:third, 1] = (1 if folds in ("VV", "II") else -1) / edge[:third, 0]  # Delta = 0
    edge[third : 2 * third, 1] = edge[third : 2 * third, 0] + 2 * rng.choice([-1, 1], third)  # g
    edge[2 * third :, rng.integers(2)] = 0.0
    edge *= 1 + rng.choice([0.0, 1e-12, 1e-7], (len(edge), 1))
    edge[:3] = [(-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]  # where boundaries meet
    return nu


def number(value):
    """JSON has no NaN and no infinity; the page's answers are sent as text."""
    return float(value.replace("Infinity", "inf"))


CLASSIFY = """
const [folds, pairs] = given;
const table = Page.data("two-folds").table;
return pairs.map((nu) => {
  const f = TwoFolds.flow(folds, nu);
  const c = TwoFolds.classify(table, folds, nu);
  const numbers = [c.canards, c.fauxCanards, c.margin, ...c.into, ...c.outOf, f.trace, f.determinant,
    f.discriminant, f.gap, TwoFolds.maxFlights(folds, nu), ...f.eigenvalues, ...f.slopes];
  return [c.label, c.kind, c.boundaries, c.nearest, c.row ? c.row.determinism : "", numbers.map(String)];
});
"""


def expected(folds, nu):
    flow = two_folds.ReducedFlow(SIGMA[folds], nu)
    c = two_folds.classify_two_fold(SIGMA[folds], nu)
    real = flow.discriminant >= 0
    numbers = [
        *(c.canards, c.faux_canards, c.margin),
        *(c.into.low, c.into.high, c.out_of.low, c.out_of.high),
        *(flow.trace, flow.determinant, flow.discriminant, flow.gap),
        two_folds.max_flights(SIGMA[folds], nu),
        *(flow.eigenvalues if real else ()),
        *(flow.slopes if real else ()),
    ]
    words = "" if math.isnan(c.canards) else c.determinism
    return [c.label, c.kind, [b.name for b in c.boundaries], c.nearest, words], numbers


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.parametrize("folds", SIGMA)
def test_classes_and_numbers_are_those_of_the_decision_table(browser, page, folds):
    browser.open(page)
    nu = pairs(folds, 10_000)
    answers = browser.run(CLASSIFY, folds, nu.tolist())
    assert len(answers) == 10_000
    labels = set()
    for pair, (*words, numbers) in zip(nu.tolist(), answers, strict=True):
        wanted_words, required = expected(folds, tuple(pair))
        assert words == wanted_words, pair
        got = [number(v) for v in numbers]
        np.testing.assert_allclose(got, required, rtol=1e-12, atol=1e-300, err_msg=str(pair))
        labels.add(words[0])
    plain = {row for row in labels if not row.startswith("boundary")}
    assert plain == ({"mix-0", "mix-S", "mix-C", "mix-F"} if folds in ("VI", "IV") else plain)
    assert len(plain) >= 2 and len(labels) > len(plain)


ORBITS = """
const [folds, nu, starts] = given;
const f = TwoFolds.flow(folds, nu);
return {
  lines: TwoFolds.eigenlines(f).map((l) => [l.value, l.slope]),
  ends: TwoFolds.sectors(f).map((s) => [s.orbit.comesFrom, s.orbit.goesTo]),
  orbits: starts.map((z) => TwoFolds.orbit(f, z)).map((o) => [o.points[0], o.points.at(-1), o.comesFrom, o.goesTo]),
  diabolo: TwoFolds.diabolo(folds, nu),
};
"""


@pytest.mark.browser
def test_orbits_and_eigenlines_are_python_s(browser, page):
    browser.open(page)
    kinds = {sigma: folds for folds, sigma in SIGMA.items()}
    for name, (sigma, nu) in CASES.items():
        flow = two_folds.ReducedFlow(sigma, nu)
        starts = [[0.3, 1.1], [1.7, 0.2]]
        got = browser.run(ORBITS, kinds[sigma], nu, starts)
        np.testing.assert_allclose(
            got["lines"], np.reshape(eigenlines(flow), (-1, 2)).tolist() or []
        )
        assert got["ends"] == [[s.orbit.comes_from, s.orbit.goes_to] for s in sectors(flow)], name
        for z, (first, last, comes, goes) in zip(starts, got["orbits"], strict=True):
            run = orbit(flow, z)
            assert (comes, goes) == (run.comes_from, run.goes_to), name
            for point, end, what in ((first, run.points[0], comes), (last, run.points[-1], goes)):
                if what.startswith("z"):  # where it leaves through a fold
                    np.testing.assert_allclose(point, end, rtol=1e-9, atol=1e-9)
        if has_diabolo(flow):
            np.testing.assert_allclose(got["diabolo"], two_folds.diabolo_slopes(nu), rtol=1e-13)
        else:
            assert got["diabolo"] is None


# What one sees --------------------------------------------------------------------------------------

SHOWN = """
return {
  hash: location.hash, label: document.getElementById("label").textContent,
  sentence: document.getElementById("determinism").textContent,
  slopes: [...document.querySelectorAll(".eigenline")].map((l) => Number(l.dataset.slope)),
  say: document.querySelector(".handle").getAttribute("aria-valuetext"),
  focus: document.activeElement.getAttribute("role"),
};
"""
FRAME = "await new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)));"


def in_letters(words):
    """The words of the table as the page writes them."""
    pairs = {"Da": "Dₐ", "Dr": "Dᵣ", "kappa_-": "κ₋", "kappa_+": "κ₊"}
    return re.sub("|".join(map(re.escape, pairs)), lambda m: pairs[m[0]], words)


def shown(browser):
    browser.run(FRAME)
    return browser.run(SHOWN)


@pytest.mark.browser
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("folds", SIGMA)
def test_page_fits_complains_of_nothing_and_names_every_control(browser, page, folds, width):
    browser.open(page, width, hash=f"folds={folds}&nu=-1.5,1.25")
    seen = shown(browser)
    assert browser.errors() == {} and browser.unnamed() == []
    found = two_folds.classify_two_fold(SIGMA[folds], (-1.5, 1.25))
    assert seen["label"] == f"Class {found.label}" and seen["sentence"] == in_letters(
        found.determinism
    )
    flow = two_folds.ReducedFlow(SIGMA[folds], (-1.5, 1.25))
    assert seen["slopes"] == pytest.approx([m for _, m in eigenlines(flow)])


@pytest.mark.slow
@pytest.mark.browser
def test_keys_move_the_point_and_everything_follows(browser, page):
    from selenium.webdriver.common.keys import Keys

    browser.open(page, hash="folds=II&nu=-2,-0.5")
    assert shown(browser)["label"] == "On a boundary: Δ=0, between II-C and II-F"
    handle = browser.find(".handle")
    browser.run("document.querySelector('.handle').focus()")
    handle.send_keys(Keys.ARROW_DOWN)
    seen = shown(browser)
    assert (seen["hash"], seen["label"]) == ("#folds=II&nu=-2,-0.55", "Class II-C")
    assert seen["say"] == "ν₁ = −2, ν₂ = −0.55" and seen["focus"] == "slider"
    handle.send_keys(Keys.SHIFT, Keys.ARROW_RIGHT)
    assert shown(browser)["hash"] == "#folds=II&nu=-1.5,-0.55"
    handle.send_keys(Keys.SHIFT, Keys.ARROW_LEFT * 5)
    assert shown(browser)["hash"] == "#folds=II&nu=-3,-0.55"  # the edge of the map
    # Tab reaches the numbers, the kinds by arrow keys as radio buttons do
    browser.find("input[value=II]").send_keys(Keys.ARROW_RIGHT)
    seen = shown(browser)
    assert seen["hash"] == "#folds=VI&nu=-3,-0.55" and seen["label"] == "Class mix-C"
    field = browser.find("#nu2")
    field.clear()
    field.send_keys("2.5")
    assert shown(browser)["label"] == "Class mix-S"
    field.send_keys("7")  # 2.57, and then outside the map
    field.send_keys(Keys.BACKSPACE * 4, "25")
    assert (
        browser.run("return document.getElementById('nu2').getAttribute('aria-invalid')") == "true"
    )
    assert shown(browser)["hash"] == "#folds=VI&nu=-3,2"
    assert browser.errors() == {}


@pytest.mark.browser
def test_classes_have_the_colours_of_the_atlas_and_boundaries_of_many_are_listed(browser, page):
    from nonsmooth.plot.two_folds.class_map import FILLS

    browser.open(page, hash="folds=VI&nu=-1,1")
    assert shown(browser)["label"].endswith("between mix-0, mix-S, mix-C and mix-F")
    fills = browser.run(
        """
        return Object.fromEntries(given[0].map((label) => {
          const shape = document.createElementNS("http://www.w3.org/2000/svg", "path");
          shape.setAttribute("class", `class-${label}`);
          document.querySelector("svg").append(shape);
          const fill = getComputedStyle(shape).fill.match(/\\d+/g).map(Number);
          shape.remove();
          return [label, "#" + fill.map((v) => v.toString(16).padStart(2, "0")).join("").toUpperCase()];
        }));
        """,
        list(FILLS),
    )
    assert fills == {label: color for label, (color, _) in FILLS.items()}


@pytest.mark.slow
@pytest.mark.browser
def test_an_address_that_makes_no_sense_shows_the_start(browser, page):
    wrong = {
        "folds=toString&nu=a,b": "folds, nu.",
        "folds=II&nu=1": "nu.",
        "nu=NaN,1": "nu.",
        "%E0%A4%A": "\ufffd%A.",
    }
    for words, left_out in wrong.items():
        browser.open(page, hash=words)
        assert shown(browser)["label"] == "Class II-C" and browser.errors() == {}
        assert browser.left_out() == left_out
    browser.open(page, hash="folds=II&nu=1e9,-1e9")  # as far as the map goes
    assert browser.left_out() == ""
    assert shown(browser)["say"] == "ν₁ = 3, ν₂ = −3"


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.parametrize("width", WIDTHS)
def test_the_point_is_dragged(browser, page, width):
    from selenium.webdriver.common.action_chains import ActionChains

    browser.open(page, width, hash="folds=VV&nu=0,0")
    dot = browser.find(".handle .dot")
    frame = browser.run(
        "const {width, height} = document.querySelector('#map .frame').getBoundingClientRect();"
        "return [width, height]"
    )
    by = int(frame[0] / 4)
    ActionChains(browser.driver).click_and_hold(dot).move_by_offset(by, -by).release().perform()
    nu = [float(v) for v in shown(browser)["hash"].partition("nu=")[2].split(",")]
    units = [2 * REACH / side for side in frame]  # of nu a pixel
    assert nu == pytest.approx([by * units[0], by * units[1]], abs=0.05)
    assert shown(browser)["label"] == "Class VV-F"


FINGER = """
const at = (id) => document.querySelector(id).getBoundingClientRect();
const [dot, frame] = [at("#map .handle .dot"), at("#map .frame")];
return [dot.x + dot.width / 2, dot.y + dot.height / 2, frame.width];
"""


@pytest.mark.slow
@pytest.mark.browser
def test_a_finger_drags_the_point_and_beside_it_scrolls_the_page(browser, page):
    def touch(kind, *points):
        where = [dict(x=x, y=y) for x, y in points]
        options = dict(type=f"touch{kind}", touchPoints=where)
        browser.driver.execute_cdp_cmd("Input.dispatchTouchEvent", options)

    def swipe(start, by):
        touch("Start", start)
        for k in range(1, 9):
            touch("Move", (start[0] + by[0] * k / 8, start[1] + by[1] * k / 8))
        touch("End")

    def numbers():
        return [float(v) for v in shown(browser)["hash"].partition("nu=")[2].split(",")]

    browser.open(page, 390, hash="folds=VV&nu=0,0")
    browser.run("document.getElementById('map').scrollIntoView({block: 'center'})")
    x, y, width = browser.run(FINGER)
    swipe((x, y), (60, 0))
    assert numbers() == pytest.approx([60 * 6 / width, 0], abs=0.1)
    moved, before = numbers(), browser.run("return window.scrollY")
    swipe((x - 90, y + 80), (0, -60))
    assert numbers() == moved
    assert browser.run("return window.scrollY") > before


@pytest.mark.browser
def test_dark_palette_is_respected(browser, page):
    ground = "return getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)"
    light = {}
    for scheme in ("dark", "light"):
        browser.palette(scheme)
        browser.open(page)
        light[scheme] = sum(browser.run(ground)) / 3
    assert light["light"] > 230 and light["dark"] < 60


def luminance(colour):
    """Relative luminance of WCAG 2.1."""
    parts = np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])
    linear = np.where(parts <= 0.03928, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


def contrast(one, other):
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("palette", [0, 1], ids=["light", "dark"])
def test_words_and_lines_stand_out_from_what_is_behind_them(palette):
    text = (WEB / "page.css").read_text(encoding="utf-8")
    root = re.findall(r":root \{(.*?)\}", text, re.DOTALL)[palette]
    colours = dict(re.findall(r"--([\w-]+): (#\w{6});", root))
    for word in ("ink", "soft", "accent"):
        assert contrast(colours[word], colours["ground"]) >= 4.5
        assert contrast(colours[word], colours["panel"]) >= 4.5
    tints = [colours[f"tint-{where}"] for where in ("crossing", "attracting", "repelling")]
    for line in ("above", "below", "canard", "faux", "ink"):
        assert min(contrast(colours[line], tint) for tint in tints) >= 3.0, line
    for where in ("attracting", "repelling"):
        assert contrast(colours[where], colours[f"tint-{where}"]) >= 3.0


def test_page_loads_nothing_and_says_so_to_the_browser(page):
    text = page.read_text(encoding="utf-8")
    assert "default-src 'none'" in text and "http" not in text.replace("http-equiv", "").replace(
        "http://www.w3.org/2000/svg", ""
    )


def test_data_that_json_cannot_hold_is_refused():
    with pytest.raises(ns.OptionError, match="data"):
        ns.plot.offline_page("t", "", data={"a": [math.nan]})


def test_a_file_that_cannot_be_written_is_an_error_in_words(tmp_path, capsys):
    assert main(["explore", "--out", str(tmp_path / "none" / "page.html")]) == 2
    assert "No such file" in capsys.readouterr().err
