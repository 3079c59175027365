"""Rings of sliding orbits reach the two-fold as the theory has it, and excursions come back."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.text import Annotation
from mpl_toolkits.mplot3d import proj3d

import nonsmooth as ns
from papers.colombo_jeffrey_2011 import figures, model, results


@pytest.mark.slow_cases("VV-C1", "VV-F", "II-F", "mix-0", "mix-S", "mix-C", "mix-F")
@pytest.mark.parametrize("name", model.CLASSES)
def test_classes_have_their_label_and_their_ring_counts(name):
    numbers = model.CLASSES[name]
    assert ns.two_folds.classify_two_fold(*numbers).label == name
    found = (model.arrivals(numbers), model.repelling_arrivals(numbers))
    assert found == results.COUNTS[name]


def test_excursions_end_where_they_began():
    for e in model.excursions(8, seed=7):
        assert e.returned
        assert np.abs(e.trajectory.x[-1]).max() < 1e-8


def test_drawn_excursions_have_arrows_in_the_direction_of_time():
    figure = figures.funnel()
    (ax,) = figure.axes
    arrows = [text for text in ax.texts if isinstance(text, Annotation)]
    assert len(arrows) >= 4 and {a.arrowprops["color"] for a in arrows} == {"#000000", "#A8005C"}
    orbits = model.excursions()[1:3]
    flow = []
    for e in orbits:
        t = np.linspace(0, e.trajectory.t[-1], 3000)
        x, y, z = e.trajectory(t).T
        flow.append(np.column_stack(proj3d.proj_transform(y, z, x, ax.get_proj())[:2]))
    for arrow in arrows:
        tail, tip = np.array(arrow.xyann), np.array(arrow.xy)
        near = [np.argmin(np.linalg.norm(path - tip, axis=1)) for path in flow]
        which = int(
            np.argmin([np.linalg.norm(p[k] - tip) for p, k in zip(flow, near, strict=True)])
        )
        path, k = flow[which], near[which]
        assert np.dot(tip - tail, path[k + 1] - path[k - 1]) > 0


def test_slid_orbit_leads_from_the_two_fold_to_the_exit():
    e = model.excursions()[0]
    orbit = model.slid_from(tuple(e.start))
    assert orbit[-1] == pytest.approx(e.start, abs=1e-12)
    assert np.abs(orbit[0]).max() < 2e-3
    assert np.all(orbit[:, 1:] <= 0)


def test_nothing_returns_below_the_bifurcation():
    run = model.calm_run(50.0)
    assert run.status is ns.Status.REACHED_END and run.x[-1, 1] > 1
