"""Colours that appear together differ for deuteranopes too; saved figures have TrueType fonts."""

from itertools import combinations, pairwise

import casadi as ca
import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_rgb

import bounce
import nonsmooth as ns
from bounce.plot.regions import COLOURS
from bounce.plot.shot import STYLES
from nonsmooth.plot.basin_map import COLORS

style = ns.plot.style

#: Machado, Oliveira & Fernandes 2009, A physiologically-based model for simulation of color vision
#: deficiency, Table 1: deuteranomaly of severity 1, for linear RGB.
DEUTERANOPIA = np.array(
    [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ]
)
#: Linear sRGB to CIE XYZ, and its white (IEC 61966-2-1).
XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)


def lab(colour, eye):
    """CIE L*a*b* of a colour as an eye sees it."""
    s = np.array(to_rgb(colour))
    linear = np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)
    x, y, z = np.cbrt(
        np.maximum(XYZ @ np.clip(eye @ linear, 0, 1) / XYZ.sum(axis=1), 0)
    )  # dark colours, where the cube root is no longer meant, are not among them
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def apart(a, b, eye):
    """Distance of two colours in L*a*b*; 2.3 is just noticeable."""
    return np.linalg.norm(lab(a, eye) - lab(b, eye))


#: Colours that appear in one picture with different meanings.
TOGETHER = {
    "fields": [style.ABOVE, style.BELOW],
    "sliding": [style.ATTRACTING, style.REPELLING],
    "regions": [style.TINT_ATTRACTING, style.TINT_REPELLING],
    "canards": [style.CANARD, style.FAUX_CANARD],
    "canards and fields": [style.CANARD, style.ABOVE, style.BELOW],
    "faux canards and fields": [style.FAUX_CANARD, style.ABOVE, style.BELOW],
    "phases of a bounce": [look["color"] for look in STYLES.values()],
    "attractors": [*COLORS, "#FFFFFF"],
    "Okabe and Ito": [style.BLACK, style.ORANGE, style.SKY, style.GREEN, style.YELLOW, style.BLUE,
                      style.VERMILLION],
}  # fmt: skip


RING = ["S+", "S+ R S+", "S- R S+", "S- S+", "S-", "S- R S-", "S+ R S-", "S+ S-", "S+"]
ACROSS = [("S+ R S+", "S+ R S-"), ("S- R S+", "S- R S-"), ("S+", "S+ R S-"), ("S-", "S- R S+")]
LAW = ["I+", "II+", "III+", "III-", "II-", "I-"]
#: Pairs of colours in one picture, and of neighbours on maps of itineraries and of a law.
PAIRS = {name: list(combinations(colours, 2)) for name, colours in TOGETHER.items()}
PAIRS["itineraries"] = [(COLOURS[a], COLOURS[b]) for a, b in [*pairwise(RING), *ACROSS]]
PAIRS["law"] = [(COLOURS[a], COLOURS[b]) for a, b in pairwise(LAW)]


@pytest.mark.parametrize("eye", [np.eye(3), DEUTERANOPIA], ids=["most", "deuteranopia"])
@pytest.mark.parametrize("name", PAIRS)
def test_colours_that_appear_together_are_distinct(name, eye):
    assert {pair for pair in PAIRS[name] if apart(*pair, eye) < 15.0} == set()


TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
DRAWN = {
    "two_fold": lambda: ns.plot.two_fold(((-1, 1), (-2.0, -1.0))),
    "two_fold_3d": lambda: ns.plot.two_fold_3d(((-1, 1), (-2.0, -1.0))),
    "two_fold_map": lambda: ns.plot.two_fold_map("II"),
    "two_fold_atlas": lambda: ns.plot.two_fold_atlas(["II-F"], maps=False),
    "trajectory": lambda: ns.plot.trajectory(ns.textbook.leine_stick_slip().run()),
    "friction_cone": lambda: bounce.plot.friction_cone(
        bounce.simulate(TURF, xdot=0.3, ydot=-1.0, omega=0.1)
    ),
    "outcome_map": lambda: bounce.plot.outcome_map(
        bounce.outcome_map(TURF, {"xdot": np.linspace(-2, 2, 9), "omega": np.linspace(-4, 4, 9)})
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "kind"), [*((name, "pdf") for name in DRAWN), ("friction_cone", "ps")]
)
def test_fonts_are_true_type_whatever_the_settings(name, kind, tmp_path):
    before = dict(matplotlib.rcParams)
    DRAWN[name]().savefig(tmp_path / f"picture.{kind}")
    assert dict(matplotlib.rcParams) == before
    content = (tmp_path / f"picture.{kind}").read_bytes()
    fonts = {"pdf": (b"/Type3", b"/CIDFontType2"), "ps": (b"/FontType 3", b"/FontType 42")}
    unwanted, expected = fonts[kind]
    assert unwanted not in content and expected in content


BLOCK = ns.FilippovSystem(
    [ca.SX.sym("x"), V := ca.SX.sym("v")], surface=V - 1, above=[V, -1 - V], below=[V, 1 - V]
)
FILES = {
    "two_fold": DRAWN["two_fold"],
    "two_fold_3d": DRAWN["two_fold_3d"],
    "phase_portrait": lambda: ns.plot.phase_portrait(BLOCK, (-1, 1, 0.5, 1.5)),
    "trajectory": DRAWN["trajectory"],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_files_are_written_in_every_format_and_settings_are_left_alone(name, tmp_path):
    before = dict(matplotlib.rcParams)
    figure = FILES[name]()
    assert dict(matplotlib.rcParams) == before
    for suffix, start in (("png", b"\x89PNG"), ("pdf", b"%PDF-"), ("svg", b"<?xml")):
        figure.savefig(tmp_path / f"picture.{suffix}")
        content = (tmp_path / f"picture.{suffix}").read_bytes()
        assert content.startswith(start) and len(content) > 5000
