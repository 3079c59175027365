"""Welander's box has the period, multiplier and equilibria of the theory notes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import fsolve

import nonsmooth as ns
from papers.welander_1982 import model


def closed_form_cycle(eps):
    """Both fields are linear: times of the two phases and the crossing points, by fsolve."""
    a, b, k = 0.8, 0.5, 5.0

    def rest(t, x):
        return 1 + (x[0] - 1) * math.exp(-t), 1 + (x[1] - 1) * math.exp(-b * t)

    def mix(t, x):
        mean = 1 / (1 + k), b / (b + k)
        rates = 1 + k, b + k
        return tuple(m + (v - m) * math.exp(-r * t) for m, v, r in zip(mean, x, rates, strict=True))

    def equations(u):
        start = (u[0], a * u[0] + eps)
        up = rest(u[1], start)
        end = mix(u[2], up)
        return [up[1] - a * up[0] - eps, end[1] - a * end[0] - eps, end[0] - u[0]]

    return fsolve(equations, [0.464, 1.429, 0.144], xtol=1e-13)


def test_cycle_agrees_with_the_notes_and_with_closed_forms():
    temperature, period, multiplier = model.cycle(-0.01)
    assert period == pytest.approx(1.573348798772239528671, abs=1e-10)
    assert multiplier == pytest.approx(0.0794560287002, abs=1e-8)
    start, resting, mixing = closed_form_cycle(-0.01)
    assert temperature == pytest.approx(start, abs=1e-10)
    assert period == pytest.approx(resting + mixing, abs=1e-10)


def test_boundary_equilibria():
    assert pytest.approx(0.2, abs=1e-15) == model.BOUNDARY_RESTING
    assert pytest.approx(-7 / 165, abs=1e-15) == model.BOUNDARY_MIXED


def test_pseudo_equilibrium_on_the_formula():
    assert model.threshold_of(0.836866682439359) == pytest.approx(0.05, abs=1e-14)


@pytest.mark.parametrize("eps", [-1e-5, -1e-3, -0.04])
def test_cycle_returns_to_its_start(eps):
    temperature, period, multiplier = model.cycle(eps)
    landing, time = model.once_around(temperature, eps)
    assert landing == pytest.approx(temperature, abs=1e-11)
    assert time == pytest.approx(period, abs=1e-10)
    assert 0 < multiplier < 1


def test_no_sliding_at_threshold_zero():
    for temperature in np.linspace(0.1, 0.7, 7):
        found = ns.region(model.SYSTEM, model.point(temperature, 0.0), parameters=model.at(0.0))
        assert not found.sliding
