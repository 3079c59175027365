"""The harvest model's bifurcations are where the theory notes and an independent solver put them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from papers.kuznetsov_2003 import model


def free_field(t, x):
    psi = 0.3556 * x[0] / (0.3 + x[0])
    return [x[0] * (1 - x[0]) - psi * x[1], (psi - 0.0444) * x[1]]


def return_to_level(alpha, t_end=200.0):
    """Landing of the orbit from the free field's fold, by scipy."""

    def level(t, x):
        return x[1] - alpha if t > 1 else -1.0

    level.terminal, level.direction = True, 1
    start = [0.04280205655526992, alpha]
    return solve_ivp(free_field, (0, t_end), start, "DOP853", events=level, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("FREE_FOLD", 0.04280205655526992),
        ("HARVESTED_FOLD", 0.7208612440191388),
        ("BOUNDARY_FOCUS", 0.9227486601330945),
        ("BOUNDARY_NODE", 0.8013552803278313),
        ("SADDLE_NODE", 1.188132733408324),
    ],
)
def test_closed_forms_have_the_values_of_the_notes(name, value):
    assert getattr(model, name) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize("alpha", [0.95, 1.2, 2.0])
def test_landings_agree_with_scipy(alpha):
    found = return_to_level(alpha)
    time, x1 = model.landing(alpha)
    assert time == pytest.approx(found.t[-1], abs=1e-7)
    assert x1 == pytest.approx(found.y[0, -1], abs=1e-8)


def test_sliding_homoclinic_orbit_by_scipy():
    alpha = model.sliding_homoclinic()
    assert return_to_level(alpha).y[0, -1] == pytest.approx(
        model.pseudo_equilibria(alpha)[0], abs=1e-7
    )
    assert 0 < model.SADDLE_NODE - alpha < 1e-4


def test_free_cycle_by_scipy():
    top, _ = model.free_cycle()
    found = solve_ivp(
        free_field, (0, 400), [0.04280205655526992, top], "DOP853", rtol=1e-12, atol=1e-14,
        dense_output=True,
    )  # fmt: skip
    late = found.sol(np.linspace(200, 400, 200001))[1].max()
    assert late == pytest.approx(top, abs=2e-7)


def test_there_is_no_sliding_cycle_between_focus_and_homoclinic_orbit():
    assert np.isnan(model.period(1.1, 400.0))
    assert model.period(1.2) == pytest.approx(82.3475, abs=1e-4)
