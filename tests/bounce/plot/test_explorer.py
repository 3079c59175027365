"""The page on one bounce computes what Python computes, follows mouse and keys, and needs no network."""

import json
import re

import casadi as ca
import numpy as np
import pytest

import bounce
import nonsmooth as ns
from bounce.contact import friction, models
from bounce.plot.explorer import TURF as PLAIN
from tests.browser import WIDTHS

TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
START = dict(**PLAIN.values, load="contact", xdot=0.6, ydot=-1.0, omega=0.9)


class Mud(bounce.ContactModel):
    """A model of a user: a steep spring, and damping with the depth."""

    parameters = dict(mu=0.4, k=1.0, c=0.3, eta=0.5)

    def normal_force(self, s, p):
        return -p.k * s.y * ca.sqrt(1e-9 - s.y) + p.c * s.y * s.ydot

    def tangential_force(self, s, p):
        return -(p.eta**2) * s.x - 0.2 * p.eta * s.xdot


MODELS = {
    "Hertz": bounce.Hertz(mu=0.3, stiffness=2.0, eta=0.4, d1=0.1),
    "HuntCrossley": models.HuntCrossley(mu=0.3, stiffness=1.5, damping=0.3, eta=0.7, d1=0.1),
    "Maxwell": models.Maxwell(mu=0.2, branch_stiffness=0.5, relaxation=1.0, eta=0.6, d1=0.1),
    "Stribeck": bounce.KelvinVoigt(
        mu=0.5,
        d1=0.1,
        d2=0.1,
        eta=0.5,
        friction=friction.Stribeck(mu_kinetic=0.3, stribeck_speed=0.1),
    ),
    "LuGre": bounce.KelvinVoigt(
        mu=0.4,
        d1=0.1,
        d2=0.1,
        eta=0.5,
        friction=friction.LuGre(bristle_stiffness=50.0, mu_kinetic=0.3, stribeck_speed=0.1),
    ),
    "Mud": Mud(),
    "slope": bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=0.1, slope=0.2),
}


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("explorer") / "bounce.html"
    return bounce.explore(path=path) and path


def surface_of(model):
    """A model as the page has it."""
    names = ("mu", "eta", "d1", "d2", "G", "inertia", "slope")
    return {**{n: model.values[n] for n in names}, "load": model.convention}


# One bounce -----------------------------------------------------------------------------------------

CONTACTS = """
const page = Page.data("bounce");
const pairs = page.loads.map(async (load) => [load, await Contact.of(load, page)]);
const contacts = Object.fromEntries(await Promise.all(pairs));
"""
BOUNCE = (
    CONTACTS
    + """
return given[0].map(([surface, landing]) => {
  const contact = contacts[surface.load];
  const shot = contact.simulate(surface, landing);
  const [{ itinerary, fault }] = contact.many(surface, [landing]);
  return [shot.fault, shot.itinerary, shot.time, shot.liftOff, fault ? "" : itinerary];
});
"""
)


def random_cases(count):
    """Surfaces and landings of all kinds: also without damping, friction, stiffness or slip."""
    rng = np.random.default_rng(1)

    def some(high, zero=0.05, low=-3):
        kinds = (0.0, rng.uniform(0, high), 10 ** rng.uniform(low, np.log10(high)))
        return float(rng.choice(kinds, p=[zero, 0.75 - zero, 0.25]))

    cases = []
    for _ in range(count):
        values = dict(mu=some(1.5), eta=some(3.0), d1=some(1.0), d2=some(0.95), G=some(0.5, 0.2))
        values["inertia"] = float(rng.choice([2 / 5, 1 / 2, 2 / 3, 1.0]))
        values["slope"] = 0.0
        xdot, omega = rng.uniform(-3, 3), rng.uniform(-6, 6)
        kind = rng.choice(["any", "no slip", "straight down"], p=[0.9, 0.07, 0.03])
        landing = dict(
            xdot=0.0 if kind == "straight down" else float(xdot),
            ydot=float(rng.choice([-1.0, -(10 ** rng.uniform(-1, 0.5))])),
            omega={"any": float(omega), "no slip": -float(xdot)}.get(kind, 0.0),
        )
        cases.append((values, str(rng.choice(["contact", "net"])), landing))
    return cases


@pytest.mark.slow
@pytest.mark.browser
def test_thousands_of_bounces_are_python_s(browser, page):
    """Lift-offs to 1e-9, and how many bounces have which itinerary."""
    cases = random_cases(4000)
    browser.open(page)
    requested = [({**values, "load": load}, landing) for values, load, landing in cases]
    seen = {}
    for (values, load, landing), answer in zip(cases, browser.run(BOUNCE, requested), strict=True):
        fault, itinerary, time, lift_off, of_many = answer
        model = bounce.KelvinVoigt(**values, load=load)
        try:
            shot = bounce.simulate(model, **landing)
        except bounce.LiftOffError:
            assert fault and not of_many, (values, load, landing)
            seen["none"] = seen.get("none", 0) + 1
            continue
        assert itinerary == of_many == shot.itinerary, (values, load, landing)
        expected = [shot.time, *(getattr(shot.lift_off, n) for n in lift_off)]
        got = [time, *lift_off.values()]
        assert got == pytest.approx(expected, abs=1e-9), (values, load, landing)
        seen[itinerary] = seen.get(itinerary, 0) + 1
    assert {"+", "-", "+ -", "- s +", "+ s -", "s"} <= set(seen)
    assert len(seen) > 40 and sum(seen.values()) > 3_950 and seen["none"] < 800


@pytest.mark.slow
@pytest.mark.browser
def test_the_course_of_a_bounce_is_python_s(browser, page):
    browser.open(page)
    landing = dict(xdot=0.6, ydot=-1.0, omega=0.9)
    script = """
    const shot = contacts.contact.simulate(given[0], given[1], true);
    return shot.phases.map((phase) => [phase.mode, phase.points]);
    """
    phases = browser.run(CONTACTS + script, surface_of(TURF), landing)
    shot = bounce.simulate(TURF, **landing)
    assert [mode for mode, _ in phases] == shot.itinerary.split()
    for (_, points), phase in zip(phases, shot.phases, strict=True):
        t = np.array([p["t"] for p in points])
        assert len(t) >= 4 and np.all(np.diff(t) > 0)
        np.testing.assert_allclose(t[[0, -1]], [phase.t_start, phase.t_end], atol=1e-9)
        inner = np.clip(t, phase.t_start, phase.t_end)[1:-1]
        state, forces = shot(inner), shot.forces(inner)
        columns = dict(zip(("x", "xdot", "y", "ydot", "omega"), state.T, strict=True))
        columns |= dict(load=forces.load, friction=forces.friction, slip=state[:, 1] + state[:, 4])
        for name, expected in columns.items():
            got = [p[name] for p in points[1:-1]]
            np.testing.assert_allclose(got, expected, atol=1e-8, err_msg=name)


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.parametrize("name", MODELS)
def test_any_model_has_its_page(browser, tmp_path, name):
    model = MODELS[name]
    path = tmp_path / "page.html"
    bounce.explore(model, xdot=0.8, omega=0.3, path=path)
    browser.open(path)
    seen = browser.run(SHOWN)
    assert seen["verdict"] == name_of(bounce.simulate(model, 0.8, -1.0, 0.3))
    surface = {**model.values, "load": model.convention}
    landings = [dict(xdot=a, ydot=-0.8, omega=b) for a in (-1.0, 0.3, 2.0) for b in (-0.5, 0.9)]
    answers = browser.run(BOUNCE, [(surface, landing) for landing in landings])
    for landing, (fault, itinerary, time, lift_off, of_many) in zip(landings, answers, strict=True):
        shot = bounce.simulate(model, **landing)
        assert not fault and itinerary == of_many == shot.itinerary
        expected = [shot.time, *(getattr(shot.lift_off, n) for n in lift_off)]
        assert [time, *lift_off.values()] == pytest.approx(expected, abs=1e-9)
    assert browser.errors() == {} and browser.unnamed() == []


def mirrored(model):
    page = bounce.explore(model).html
    return json.loads(re.search(r'id="data-bounce">(.*?)</script>', page)[1])["mirrored"]


def test_half_of_a_map_is_the_mirror_image_unless_the_surface_favours_a_side():
    assert mirrored(TURF) and mirrored(Mud())
    assert not mirrored(MODELS["slope"])

    class Grain(Mud):
        def tangential_force(self, s, p):
            return 0.1 - s.x

    assert not mirrored(Grain())


def test_ranges_and_landings_that_make_no_sense_are_refused():
    with pytest.raises(ns.ParameterError, match="weight"):
        bounce.explore(TURF, parameters={"weight": (0, 1)})
    with pytest.raises(ns.OptionError, match="empty range"):
        bounce.explore(TURF, parameters={"mu": (1, 1)})
    with pytest.raises(bounce.LandingError, match="approach"):
        bounce.explore(TURF, ydot=1.0)
    with pytest.raises(bounce.ModelError, match="ContactModel"):
        bounce.explore("turf")


# Maps -----------------------------------------------------------------------------------------------

MAP = (
    CONTACTS
    + """
const [surface, ydot, reach, count, tolerance] = given;
const map = Maps.empty(contacts[surface.load], surface, ydot, reach, count);
Maps.compute(map, Infinity);
Maps.divide(map, tolerance, Infinity);
return {...map, contact: null, code: [...map.code], curve: Maps.curve(map), rooms: Maps.rooms(map), shares: Maps.shares(map)};
"""
)


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.parametrize("load", ["contact", "net"])
def test_map_is_that_of_python(browser, page, load):
    model = TURF.replace(eta=0.8, G=0.15, load=load)
    browser.open(page)
    got = browser.run(MAP, surface_of(model), -1.0, [3, 6], 24, 1e-3)
    over = {"xdot": got["xdot"], "omega": got["omega"]}
    expected = bounce.outcome_map(model, over, tol=1e-11)
    names = np.array([*got["regions"], ""])[np.array(got["code"]).reshape(24, 24)]
    assert np.array_equal(names, np.array([*expected.regions, ""])[expected.code])
    for entry in got["shares"]:
        assert entry["share"] == pytest.approx(expected.share()[entry["name"]])
    for name, room in zip(got["regions"], got["rooms"], strict=True):
        i, j = got["xdot"].index(room["xdot"]), got["omega"].index(room["omega"])
        assert names[j, i] == name and room["room"] >= 1


@pytest.mark.slow
@pytest.mark.browser
def test_dividing_curve_is_that_of_python(browser, page):
    browser.open(page)
    curve = bounce.dividing_curve(TURF, reach=2.0)
    got = browser.run(MAP, surface_of(TURF), -1.0, [3, 6], 60, 1e-9)["curve"]
    kinds = {line["kind"] for line in got}
    assert kinds == {"two-fold", "slipping"} and len(got) <= 6  # joined, and cut at the junctions
    junction = abs(curve.junction[0])
    checked = 0
    for line in got:
        for xdot, omega in line["points"][1:-1:4]:
            if abs(xdot) > 2.0 or abs(abs(xdot) - junction) < 0.1:
                continue
            assert curve.omega(xdot) == pytest.approx(omega, abs=1e-7)
            assert line["kind"] == ("two-fold" if abs(xdot) < junction else "slipping")
            checked += 1
    assert checked >= 10


# What one sees --------------------------------------------------------------------------------------

READY = """
while (document.documentElement.dataset.ready !== "yes") await new Promise((go) => setTimeout(go, 10));
"""

SHOWN = (
    READY
    + """await new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)));
const text = (id) => document.getElementById(id).textContent;
return {
  hash: location.hash, verdict: text("verdict"), story: text("story"), facts: text("facts"),
  cone: document.querySelectorAll("#cone .phase").length,
  slip: document.querySelectorAll("#slip .phase:not(.end)").length,
  end: document.querySelectorAll("#slip .end").length,
  names: [...document.querySelectorAll("#map .region-name")].map((e) => e.textContent),
  say: document.querySelector(".handle").getAttribute("aria-valuetext"),
};
"""
)


def name_of(shot):
    return bounce.maps.outcomes.region_name(shot.itinerary).replace("-", "−")


FINE = """
while (document.documentElement.dataset.map !== "fine") await new Promise((go) => setTimeout(go, 20));
"""


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.parametrize("width", WIDTHS)
def test_page_fits_complains_of_nothing_and_names_every_control(browser, page, width):
    browser.open(page, width)
    seen = browser.run(SHOWN)
    start = {n: START[n] for n in ("mu", "eta", "d1", "d2", "G", "inertia", "load")}
    shot = bounce.simulate(
        bounce.KelvinVoigt(**start), START["xdot"], START["ydot"], START["omega"]
    )
    assert seen["verdict"] == "S+ R S−" and shot.itinerary == "+ s -"
    assert seen["story"].endswith(
        "slips forward, rolls, then slips in reverse, and leaves in reverse slip."
    )
    assert f"{shot.slip:.5f}".replace("-", "−") in seen["facts"]
    assert (seen["cone"], seen["slip"], seen["end"]) == (3, 3, 1)  # its last slip is enlarged
    browser.run(FINE)
    assert {"S+", "S−", "S+ R S−"} <= set(browser.run(SHOWN)["names"])
    assert browser.errors() == {} and browser.unnamed() == []


INSIDE = """
const frame = document.querySelector("#map .frame").getBoundingClientRect();
return [...document.querySelectorAll("#map .region-name")].filter((e) => {
  const box = e.getBoundingClientRect();
  return box.left < frame.left + 1 || box.right > frame.right - 1;
}).map((e) => e.textContent);
"""


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.parametrize("width", WIDTHS)
def test_names_of_regions_are_not_cut_by_the_frame(browser, page, width):
    browser.open(page, width)
    browser.run(FINE)
    assert browser.run(INSIDE) == []


COVERED = (
    READY
    + """
const words = [...document.querySelectorAll("#slip .halo, #slip .inset")];
const met = [];
for (const word of words) {
  const box = word.getBoundingClientRect();
  for (const path of document.querySelectorAll("#slip .phase:not(.end)")) {
    const m = path.getScreenCTM(), length = path.getTotalLength();
    for (let k = 0; k <= 400; k++) {
      const p = path.getPointAtLength((length * k) / 400).matrixTransform(m);
      if (p.x > box.left && p.x < box.right && p.y > box.top && p.y < box.bottom) {
        met.push(word.textContent || word.tagName);
        break;
      }
    }
  }
}
return [words.length, met];
"""
)


@pytest.mark.browser
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("sign", [1, -1])
def test_the_enlarged_end_lies_on_no_curve(browser, page, width, sign):
    browser.open(page, width, hash=f"xdot={0.6 * sign}&omega={0.9 * sign}")
    count, reached = browser.run(COVERED)
    assert count >= 2 and reached == []


@pytest.mark.slow
@pytest.mark.browser
def test_keys_and_fields_move_everything(browser, page):
    from selenium.webdriver.common.keys import Keys

    browser.open(page, hash="xdot=1&omega=0.5&ydot=-1&eta=0&mu=0.1")
    before = browser.run(SHOWN)
    assert before["verdict"] == "S+"
    browser.run("document.querySelector('.handle').focus()")
    handle = browser.find(".handle")
    handle.send_keys(Keys.SHIFT, Keys.ARROW_DOWN * 4)
    seen = browser.run(SHOWN)
    assert "&omega=-1.5&" in seen["hash"] and seen["say"] == "speed 1, spin −1.5"
    assert seen["verdict"] == "S− R"  # nothing pulls it along the ground: it rolls to the end
    slider = browser.find("#eta-range")
    slider.send_keys(Keys.ARROW_RIGHT * 40)
    seen = browser.run(SHOWN)
    assert "eta=0.4&" in seen["hash"]
    soft = bounce.KelvinVoigt(mu=0.1, d1=0.1, d2=0.1, eta=0.4, G=1e-4)
    assert seen["verdict"] == name_of(bounce.simulate(soft, 1.0, -1.0, -1.5))
    field = browser.find("#G")
    field.clear()
    field.send_keys("0.45")
    browser.run("document.getElementById('d2').focus()")
    browser.find("input[value=net]").click()
    assert "load=net" in browser.run(SHOWN)["hash"]
    browser.find("#reset").click()
    assert browser.run(SHOWN)["verdict"] == "S+ R S−"
    assert browser.errors() == {}


@pytest.mark.slow
@pytest.mark.browser
def test_an_address_that_makes_no_sense_shows_the_start(browser, page):
    wrong = {
        "mu=abc&eta=&xdot=NaN&ydot=-1": "mu, eta, xdot.",
        "load=toString&inertia=7": "load, inertia.",
        "%E0%A4%A&=&": "\ufffd%A, .",
    }
    for words, left_out in wrong.items():
        browser.open(page, hash=words)
        assert browser.run(SHOWN)["verdict"] == "S+ R S−" and browser.errors() == {}
        assert browser.left_out() == left_out
    browser.open(page, hash="mu=0&eta=0&xdot=1e9&omega=-1e9&ydot=5")  # as far as the sliders go
    assert browser.left_out() == ""
    assert browser.run(SHOWN)["say"] == "speed 3, spin −6"


@pytest.mark.browser
def test_a_ball_that_stays_is_reported(browser, page):
    browser.open(page, hash="d2=1&G=0.5&ydot=-0.1")
    seen = browser.run(SHOWN)
    assert seen["verdict"] == "No lift-off" and "the ball stays in the ground" in seen["story"]
    assert (seen["cone"], seen["slip"]) == (0, 0)
    with pytest.raises(bounce.LiftOffError):
        values = {n: START[n] for n in ("mu", "eta", "d1")}
        bounce.simulate(bounce.KelvinVoigt(**values, d2=1.0, G=0.5), 0.6, -0.1, 0.9)
    browser.run(FINE)
    assert browser.errors() == {}


def test_every_itinerary_of_the_start_has_its_colour():
    text = bounce.explore().html
    data = json.loads(re.search(r'id="data-bounce">(.*?)</script>', text)[1])
    assert data["start"] == START and data["version"] == ns.__version__
    assert {"S+ R S-", "S+"} <= set(data["colours"])
