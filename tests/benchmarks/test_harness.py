"""The benchmarks compare the same problems, and library, peers and references agree, on tiny sizes."""

from __future__ import annotations

import json
import math
import subprocess

import numpy as np
import pytest

import bounce
import nonsmooth as ns
from benchmarks import burridge_knopoff, library, problems, reference
from benchmarks.analysis import periodic_orbits, proof_checks, proof_times, two_folds
from benchmarks.bouncing import bounces_in_space
from benchmarks.peers import (
    diffrax_modes,
    heyoka_callbacks,
    heyoka_modes,
    scipy_dop853,
    scipy_shooting,
)

NAMES = ("linear", "nonlinear")


@pytest.mark.parametrize("name", NAMES)
def test_peers_and_library_get_the_same_fields(name):
    x = np.array([0.1, 0.7, -0.3, -0.4, 0.2])
    problem, system = problems.bounce(name), problems.bounce_system(name)
    for mode, letter in ((problems.PLUS, "+"), (problems.MINUS, "-")):
        values = system.evaluate(system.field(letter), x)
        assert np.allclose(problem.fields[mode](*x), np.ravel(values), rtol=1e-14, atol=1e-15)


@pytest.mark.slow_cases("nonlinear")
@pytest.mark.parametrize("name", NAMES)
def test_mpmath_scipy_and_the_library_agree(name):
    starts = problems.random_starts(2, seed=7)
    exact = reference.solve(name, starts)
    for solve in (library.make(name, 1e-13), scipy_dop853.make(name, 1e-11)):
        ends = solve(starts)
        assert reference.error(ends, exact).max() < 1e-9
        assert (ends.itinerary == exact.itinerary).all()


@pytest.mark.parametrize(
    "peer",
    [heyoka_modes, heyoka_callbacks, pytest.param(diffrax_modes, marks=pytest.mark.slow)],
    ids=lambda m: m.__name__.split(".")[-1],
)
def test_peers_that_are_installed_agree(peer):
    if not peer.available():
        pytest.skip("an extra of the benchmarks")
    starts = problems.random_starts(2, seed=7)
    exact = reference.solve("linear", starts)
    ends = peer.make("linear", 1e-10)(starts)
    assert reference.error(ends, exact).max() < 1e-8
    assert (ends.itinerary == exact.itinerary).all()


def test_stick_slip_is_the_same_for_peers():
    belt = problems.BELTS["many events"]
    engine = scipy_dop853.Scipy(problems.stick_slip(belt, math.cos), 1e-11, 1e-13)
    end = engine.solve(np.array([[*problems.STICK_START, 0.0]]), 20.0)
    run = ns.simulate(problems.stick_slip_system(belt), problems.STICK_START, 20.0)
    assert np.abs(end.x[0, :2] - run.x[-1]).max() < 1e-9
    assert end.itinerary[0] == problems.code(run.itinerary)


def test_the_script_by_hand_gives_the_same_classes():
    grid = np.array([(-2.0, 1.0), (1.5, -2.5), (2.5, 2.0)])
    assert two_folds.library(grid) == two_folds.by_hand(grid)


def test_what_is_timed_is_proven():
    assert len(proof_times.zeros(2)().zeros) == 4 and proof_times.two_fold()().proven


def test_theorems_have_judges_of_their_own():
    found = proof_checks.lists(seed=1, systems=2, starts=10)
    assert found.sound and found.starts == 20


def test_a_chain_is_the_same_for_siconos_and_us(monkeypatch):
    """Its matrices give the field."""
    count, given = 3, []
    system, x = burridge_knopoff.chain(count), np.arange(6.0)

    def peer(*_, **options):
        given.append(json.loads(options["input"]))
        return subprocess.CompletedProcess([], 0, '{"rows": []}', "")

    monkeypatch.setattr(subprocess, "run", peer)
    burridge_knopoff.siconos("python", count, 1.0, [1e-2])
    p = given[0]
    for mode, lam in (("+++", 1.0), ("---", -1.0)):
        ours = np.ravel(system.evaluate(system.field(mode), x))
        push = np.array(p["push"]) @ np.full(count, -lam)  # Siconos' relay acts against the slip
        theirs = np.array(p["matrix"]) @ x + p["offset"] + push
        np.testing.assert_allclose(ours, theirs, atol=1e-14)
    monkeypatch.delenv(burridge_knopoff.VARIABLE, raising=False)
    found = burridge_knopoff.run(True, 2, 5.0)
    assert found["same itinerary"] and found["nonsmooth"]["rows"][0]["error"] < 1e-9


@pytest.mark.parametrize("name", periodic_orbits.CASES)
def test_orbits_of_library_and_peer_are_those_of_the_reference(name):
    case = periodic_orbits.CASES[name]()
    ours = periodic_orbits.errors(case, *_orbit(case.solve()))
    assert ours["orbit"] < 1e-14 and ours["multipliers"] < 1e-11
    if name != "R1":  # the peer takes half a second
        theirs = periodic_orbits.errors(case, *scipy_shooting.solve(name, 1e-9, whole=False))
        assert 1e-13 < theirs["orbit"] < 1e-7 and theirs["multipliers"] < 0.02


def _orbit(orbit):
    half = 2 if orbit.symmetric else 1
    return orbit.start, orbit.period / half, orbit.half_multipliers


def test_bounces_in_space_are_those_of_the_library():
    x = bounces_in_space.starts(5)
    many = ns.ensemble(bounces_in_space.system("linear"), x, problems.T_MAX, tol=1e-11)
    v, w = x[:, [1, 3]], x[:, 6:] - x[:, [1, 3]]
    same = bounce.lift_off(bounces_in_space.TURF.in_3d(), v, -1.0, w, tol=1e-11)
    assert np.abs(many.x[:, [1, 3]] - same.xdot).max() < 1e-10
    assert many.itinerary.tolist() == same.itinerary.tolist()
