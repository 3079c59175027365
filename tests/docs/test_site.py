"""The built site is complete, its links resolve, and it needs no network."""

import html.parser
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from docs.tools import generate, pictures
from tests.browser import WIDTHS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"

#: What a page loads, by tag and attribute; a plain link to elsewhere loads nothing.
LOADS = {
    ("script", "src"),
    ("img", "src"),
    ("iframe", "src"),
    ("source", "src"),
    ("link", "href"),
    ("object", "data"),
}
FOREIGN = re.compile(r"^(?:https?:)?//")


class _Loads(html.parser.HTMLParser):
    def __init__(self):
        super().__init__()
        self.foreign, self.local = [], []

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        if tag == "link" and values.get("rel") == "canonical":
            return
        for name, value in attrs:
            if (tag, name) in LOADS and value:
                (self.foreign if FOREIGN.match(value) else self.local).append(value)


def loads(text):
    """What a page loads from elsewhere, and from beside it."""
    parser = _Loads()
    parser.feed(text)
    return parser.foreign, parser.local


# The README's picture ------------------------------------------------------------------------------


def test_pictures_of_the_readme_are_what_its_programs_draw(tmp_path):
    image = pytest.importorskip("matplotlib.image")
    made = pictures.draw(tmp_path)
    assert [path.name for path in made] == ["two_fold.png", "bounce.png"]
    for path in made:
        kept, drawn = image.imread(pictures.FOLDER / path.name), image.imread(path)
        for ours, theirs in zip(kept.shape, drawn.shape, strict=True):
            assert abs(ours - theirs) <= 0.02 * ours  # fonts differ a little between versions
        rows, columns = (min(a, b) for a, b in zip(kept.shape[:2], drawn.shape[:2], strict=True))
        difference = abs(kept[:rows, :columns] - drawn[:rows, :columns]).mean()
        assert difference < 0.02, "run `python docs/tools/pictures.py` and look at the pictures"


def test_readme_shows_the_measured_table():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert generate.measured() in text, "copy what docs/tools/elsewhere.py's measured() returns"


# The built site ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the built site."""
    pytest.importorskip("material", reason="the site is built with the docs extra")
    pytest.importorskip("mkdocstrings", reason="the site is built with the docs extra")
    folder = tmp_path_factory.mktemp("docs") / "site"
    build = subprocess.run(
        [sys.executable, "-m", "mkdocs", "--quiet", "build", "--strict", "--site-dir", str(folder)],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
    )
    assert build.returncode == 0, build.stderr[-3000:]
    yield folder
    shutil.rmtree(folder)


@pytest.mark.slow
def test_built_site_loads_nothing_from_elsewhere_and_everything_it_loads_is_there(site):
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 15
    for page in pages:
        text = page.read_text(encoding="utf-8")
        foreign, local = loads(text)
        assert foreign == [], page.name
        assert "<!-- generated" not in text, page.name
        if page.name != "404.html":  # its addresses begin at the root of a server
            missing = [
                name
                for name in local
                if not name.startswith("data:")
                and not (page.parent / name.partition("#")[0].partition("?")[0]).exists()
            ]
            assert missing == [], page.name
    for style in site.rglob("*.css"):
        assert not re.search(r"url\(\s*['\"]?(?:https?:)?//", style.read_text(encoding="utf-8"))
    pictures = {p for name in generate.GALLERY for p, _ in generate.pictures(name)}
    assert {p.stem for p in (site / "gallery").glob("*.svg")} == pictures


class _Prose(html.parser.HTMLParser):
    """The text of a page without what is no prose: code, formulas, heads, navigation, scripts."""

    LEFT_OUT = {*"pre code math script style nav header footer title b h1 h2 h3 h4 h5 h6".split()}

    def __init__(self):
        super().__init__()
        self.inside, self.text = [], []

    def handle_starttag(self, tag, attrs):
        if tag in self.LEFT_OUT:
            self.inside.append(tag)

    def handle_endtag(self, tag):
        if self.inside and tag == self.inside[-1]:
            self.inside.pop()

    def handle_data(self, data):
        if not self.inside:
            self.text.append(data)


@pytest.mark.slow
def test_no_page_of_the_api_has_a_formula_as_plain_text(site):
    plain = re.compile(r"\^|\bsqrt\b|[<>]=|\w'+ *=|\$\w|\w\$|\b(?:lambda|sigma|theta|kappa)\d?\b")
    pages = sorted((site / "api").glob("*.html"))
    assert len(pages) > 20
    formulas = 0
    for page in pages:
        text = page.read_text(encoding="utf-8")
        formulas += text.count("<math")
        prose = _Prose()
        prose.feed(text)
        assert prose.inside == [], page.name
        lines = "".join(prose.text).splitlines()
        assert [line.strip() for line in lines if plain.search(line)] == [], page.name
    assert formulas > 300


@pytest.mark.slow
def test_every_name_of_the_overview_leads_to_its_description(site):
    overview = (site / "api" / "index.html").read_text(encoding="utf-8")
    assert "][" not in overview  # a link that leads nowhere stays as it was written
    links = re.findall(r'href="(\w+\.html)#([\w.]+)"[^>]*><code>', overview)
    assert len(links) > 200
    for page, anchor in links:
        assert f'id="{anchor}"' in (site / "api" / page).read_text(encoding="utf-8"), anchor


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.parametrize("width", WIDTHS)
def test_every_page_fits_the_window_and_complains_of_nothing(browser, site, width):
    wrong = {}
    pages = [page for page in sorted(site.rglob("*.html")) if page.name != "404.html"]
    assert {
        "explore/two_folds.html",
        "explore/stick_slip.html",
        "explore/bounce.html",
        "index.html",
    } <= {page.relative_to(site).as_posix() for page in pages}
    for page in pages:
        browser.open(page, width)
        if errors := browser.errors():
            wrong[page.relative_to(site).as_posix()] = errors
    assert wrong == {}


SEARCH = """
const [words] = arguments;
const field = document.querySelector("input[name=query]");
const shown = () => [...document.querySelectorAll(".md-search-result__item")];
const send = async (value, done) => {
  field.value = value;
  field.dispatchEvent(new Event("input", {bubbles: true}));
  field.dispatchEvent(new KeyboardEvent("keyup", {bubbles: true}));
  for (let k = 0; k < 200 && !done(); k++) await new Promise((go) => setTimeout(go, 50));
};
field.focus();
await send("", () => !shown().length);
await send(words, () => shown().length);
return shown().slice(0, 3).flatMap((item) => [...item.querySelectorAll("a")].map((a) => a.href));
"""
#: Words that readers typed, and the section that answers; it is on one of the first three pages that are found.
ANSWERS = {
    "pseudo-equilibrium": "theory.html#pseudo-equilibria-and-boundary-equilibria",
    "not unique": "theory.html#repelling-escaping-sliding-is-not-unique",
    "hidden dynamics": "theory.html#hidden-dynamics",
    "grazing": "branches.html#grazing-of-an-impact-oscillator",
    "sampled": "trades.html#a-digital-controller-sampled-with-a-zero-order-hold",
    "saturation": "trades.html#saturation-and-a-pi-controller-with-anti-windup",
    "square wave": "trades.html#a-step-input-a-square-wave",
    "bifurcation diagram": "tutorial_converter.html",
    "forward voltage": "diodes.html#forward-voltage-a-bridge-rectifier",
    "too many events": "recipes.html#event-times-as-arrays-and-long-runs-with-many-events",
    "Stribeck": "friction.html#the-stribeck-curve",
    "cradle": "mechanisms.html#several-contacts-struck-at-once",
    "measured data": "trades.html#a-lookup-table-the-torque-of-a-motor-measured-data",
    "impact times": "recipes.html#event-times-as-arrays-and-long-runs-with-many-events",
    "gene": "trades.html#gene-networks-on-and-off-at-thresholds",
    "firing rate": "trades.html#a-neuron-spike-times-and-firing-rate",
    "t_eval": "start.html#parameters-forcing-tolerance-output-times",
    "save": "recipes.html#saving-a-run",
    "stimp": "golf.html#a-putt-on-a-green-of-given-speed",
    "headwind": "golf.html#launch-and-flight-in-wind-and-at-altitude",
    "bouncing ball": "recipes.html#jumps-what-a-reset-does-a-bouncing-ball",
    "parameters": "start.html#parameters-forcing-tolerance-output-times",
    "phase portrait": "start.html#what-a-point-is-and-a-phase-portrait",
    "division": "statuses.html#division-by-zero-00",
    "schmitt trigger": "trades.html#a-thermostat-simulate-a-relay-with-hysteresis-a-hybrid-automaton",
    "diabolo": "two_folds.html",
    "parallel": "start.html#many-in-parallel-sweep-starts-or-a-parameter",
    "speed": "index.html#measured-speed-and-accuracy",
    "restitution": "recipes.html#impacts-restitution-and-coming-to-rest",
    "dead zone": "trades.html#saturation-and-a-pi-controller-with-anti-windup",
    "font size": "recipes.html#plot-in-your-style-save-a-figure",
    "svg": "recipes.html#plot-in-your-style-save-a-figure",
    "sawtooth": "recipes.html#switching-with-a-clock-pulse-width-modulation-pwm",
    "licence": "cite.html",
    "backspin": "golf.html#the-first-bounce",
}


@pytest.mark.slow
@pytest.mark.browser
def test_search_finds_the_answers_from_files(browser, site):
    browser.open(site / "index.html")
    found = {words: browser.run(SEARCH, words) for words in ANSWERS}
    assert [w for w, to in ANSWERS.items() if not any(to in _plain(h) for h in found[w])] == []
    assert browser.errors() == {}


def _plain(address):
    """An address without the words that the search marks in the page."""
    return re.sub(r"\?h=[^#]*", "", address)
