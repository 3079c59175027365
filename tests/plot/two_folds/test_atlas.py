"""The atlas holds every class and boundary; its maps agree with the decision table everywhere."""

import math

import matplotlib
import numpy as np
import pytest
from matplotlib.path import Path
from numpy.testing import assert_allclose

import nonsmooth as ns
from nonsmooth.local.two_folds import classify_two_fold, max_flights
from nonsmooth.plot.two_folds.atlas import CASES
from nonsmooth.plot.two_folds.class_map import FILLS, areas
from papers.pictures import illegible

SIGMA = {"VV": (1, -1), "II": (-1, 1), "VI": (1, 1), "IV": (-1, -1)}


def test_every_class_and_every_boundary_has_its_case():
    labels = {name: classify_two_fold(*numbers) for name, numbers in CASES.items()}
    classes = {"VV-C1", "VV-F", "II-C", "II-F", "mix-0", "mix-S", "mix-C", "mix-F"}
    assert classes == {found.label for name, found in labels.items() if name in classes}
    for name, found in labels.items():
        if "|" in name:
            assert found.label.endswith(name)
        elif " with " in name:
            label, boundary = name.split(" with ")
            assert found.label == label
            assert boundary in [
                b.name.replace("Delta", "Δ").replace("nu", "ν") for b in found.boundaries
            ]


def test_a_fill_means_the_same_canards_wherever_it_is():
    meant = {}
    for name, fill in FILLS.items():
        found = classify_two_fold(*CASES[name])
        meant.setdefault(fill, set()).add((found.canards, found.faux_canards))
    assert all(len(canards) == 1 for canards in meant.values())
    assert len({min(c) for c in map(sorted, meant.values())}) == len(meant) == 6


@pytest.mark.parametrize("kind", SIGMA)
def test_areas_of_the_map_agree_with_the_decision_table(kind):
    rng = np.random.default_rng(3)
    points = rng.uniform(-2.99, 2.99, size=(3000, 2))
    mapped = np.full(len(points), "", dtype=object)
    for label, polygon in areas(kind):
        mapped[Path(polygon).contains_points(points)] = label
    for nu, label in zip(points, mapped, strict=True):
        found = classify_two_fold(SIGMA[kind], tuple(nu))
        assert found.label == label or found.margin < 2e-3


@pytest.mark.parametrize("kind", SIGMA)
def test_boundary_curves_lie_on_boundaries(kind):
    ax = ns.plot.two_fold_map(kind).axes[0]
    curves = [np.column_stack(line.get_data()) for line in ax.lines if line.get_gid() == "boundary"]
    for curve in curves:
        for nu in curve[:: max(len(curve) // 10, 1)]:
            found = classify_two_fold(SIGMA[kind], tuple(nu), tol=1e-9)
            product = nu[0] * nu[1]
            flights = any(abs(product - math.cos(math.pi / n) ** 2) < 1e-9 for n in range(3, 9))
            zero = abs(product) < 1e-12  # part of nu_i = 0, both axes drawn for II
            assert found.boundaries or (kind == "II" and (flights or zero))


def test_flight_curves_separate_flight_counts():
    for n in (3, 4, 5, 6, 8):
        root = math.cos(math.pi / n)
        below, above = -root * (1 - 1e-6), -root * (1 + 1e-6)
        assert max_flights(SIGMA["II"], (below, below)) == n - 1
        assert max_flights(SIGMA["II"], (above, above)) == n


def test_each_class_is_named_in_its_area():
    for kind, sigma in SIGMA.items():
        texts = ns.plot.two_fold_map(kind).axes[0].texts
        names = [text for text in texts if "-" in text.get_text()]
        assert len(names) >= 2
        for name in names:
            assert classify_two_fold(sigma, name.get_position()).label == name.get_text()


@pytest.mark.slow
def test_the_atlas_draws_the_requested_pages(tmp_path):
    before = dict(matplotlib.rcParams)
    figure = ns.plot.two_fold_atlas(["II-C", "mix-S"])
    assert dict(matplotlib.rcParams) == before
    titles = " ".join(ax.get_title() for ax in figure.axes)
    assert "II-C" in titles and "mix-S" in titles
    assert len(figure.axes) == 2 * 2 + 3
    figure.savefig(tmp_path / "atlas.svg")
    assert (tmp_path / "atlas.svg").read_text().startswith("<?xml")
    assert_allclose(figure.get_size_inches()[0], 7.0)  # the width of a page


@pytest.mark.slow
def test_pages_have_two_each_and_fit_a_page():
    pages = ns.plot.two_fold_atlas_pages(["II-C", "mix-S", "VV-F"])
    titles = [[ax.get_title().split(" ")[0] for ax in page.axes] for page in pages]
    assert [[t for t in page if "-" in t] for page in titles[:2]] == [["II-C", "mix-S"], ["VV-F"]]
    assert pages[2].axes[0].get_title() == "visible (VV)" and len(pages) == 3
    assert len(ns.plot.two_fold_atlas_pages(["II-C"], maps=False)) == 1
    for page in pages:
        width, height = page.get_size_inches()
        assert width == 7.0 and height <= 9.0


@pytest.mark.slow
def test_the_whole_atlas_is_drawn():
    figure = ns.plot.two_fold_atlas()
    assert len(figure.axes) == 2 * len(CASES) + 3
    pages = ns.plot.two_fold_atlas_pages()
    assert sum(len(page.axes) for page in pages) == len(figure.axes)
    assert [text for page in pages for text in illegible(page)] == []


def test_wrong_input_is_refused():
    for wrong in (["II-X"], [], "II-C"):
        for draw in (ns.plot.two_fold_atlas, ns.plot.two_fold_atlas_pages):
            with pytest.raises(ns.OptionError, match="cases"):
                draw(wrong)
    with pytest.raises(ns.OptionError, match="columns"):
        ns.plot.two_fold_atlas(["II-C"], columns=0)
    with pytest.raises(ns.OptionError, match="kind"):
        ns.plot.two_fold_map("visible")
