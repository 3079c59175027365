"""The benchmarks compute what they say: problems, references, errors and ratios, on tiny sizes."""

from __future__ import annotations

import json
import math
import subprocess

import mpmath as mp
import numpy as np
import pytest

import bounce
import nonsmooth as ns
from benchmarks import (
    bounces,
    chain,
    correctness,
    gpu,
    measure,
    orbits,
    ours,
    problems,
    proofs,
    reference,
    report,
    space,
    theorems,
    two_folds,
)
from benchmarks.peers import (
    diffrax_modes,
    heyoka_callbacks,
    heyoka_modes,
    scipy_dop853,
    scipy_shooting,
)
from nonsmooth.flow.ensembles import on_device

NAMES = ("linear", "nonlinear")


@pytest.mark.parametrize("name", NAMES)
def test_peers_and_library_get_the_same_fields(name):
    x = np.array([0.1, 0.7, -0.3, -0.4, 0.2])
    problem, system = problems.bounce(name), problems.bounce_system(name)
    for mode, letter in ((problems.PLUS, "+"), (problems.MINUS, "-")):
        values = system.evaluate(system.field(letter), x)
        assert np.allclose(problem.fields[mode](*x), np.ravel(values), rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("name", NAMES)
def test_mpmath_scipy_and_the_library_agree(name):
    starts = problems.random_starts(2, seed=7)
    truth = reference.solve(name, starts)
    for solve in (ours.reference_driver(name, 1e-13), scipy_dop853.make(name, 1e-11)):
        ends = solve(starts)
        assert reference.error(ends, truth).max() < 1e-9
        assert (ends.itinerary == truth.itinerary).all()


@pytest.mark.parametrize(
    "peer",
    [heyoka_modes, heyoka_callbacks, pytest.param(diffrax_modes, marks=pytest.mark.slow)],
    ids=lambda m: m.__name__.split(".")[-1],
)
def test_peers_that_are_installed_agree(peer):
    if not peer.available():
        pytest.skip("an extra of the benchmarks")
    starts = problems.random_starts(2, seed=7)
    truth = reference.solve("linear", starts)
    ends = peer.make("linear", 1e-10)(starts)
    assert reference.error(ends, truth).max() < 1e-8
    assert (ends.itinerary == truth.itinerary).all()


def test_stick_slip_is_the_same_for_peers():
    belt = problems.BELTS["many events"]
    engine = scipy_dop853.Scipy(problems.stick_slip(belt, math.cos), 1e-11, 1e-13)
    end = engine.solve(np.array([[*problems.STICK_START, 0.0]]), 20.0)
    run = ns.simulate(problems.stick_slip_system(belt), problems.STICK_START, 20.0)
    assert np.abs(end.x[0, :2] - run.x[-1]).max() < 1e-9
    assert end.itinerary[0] == problems.code(run.itinerary)


@pytest.mark.parametrize("depth", [1e-28, 1e-22, 1e-17, 1e-12])
def test_first_fall_of_two_zeros_that_are_closer_than_double_precision_tells(depth):
    """(t - 1/2)^2 - depth has them, with the sign turned it has none that falls before; plus depth, none."""
    square = [mp.mpf("0.25"), mp.mpf(-1), mp.mpf(1), *[mp.mpf(0)] * 28]
    with mp.workdps(34):
        apart = mp.sqrt(mp.mpf(depth))
        below, above = ([square[0] + sign * mp.mpf(depth), *square[1:]] for sign in (-1, 1))
        fall = reference.first_fall(below, mp.mpf(1), 0)
        assert abs(fall - (mp.mpf("0.5") - apart)) < 1e-3 * apart
        assert reference.first_fall(above, mp.mpf(1), 0) is None


def test_first_fall_skips_rises_and_what_is_dropped():
    # t (t - 0.25) (0.5 - t) (t - 0.75): falls at 0.5 only, after t is dropped
    c = [mp.mpf(v) for v in np.polynomial.polynomial.polyfromroots([0, 0.25, 0.5, 0.75])]
    assert abs(reference.first_fall(c, mp.mpf(1), 1) - mp.mpf("0.5")) < 1e-14
    assert reference.first_fall(c, mp.mpf("0.4"), 1) is None


def test_codes_are_itineraries():
    assert correctness.letters(problems.code("+ s -")) == "+s-"
    assert problems.code("- s -") != problems.code("+ s -")


def test_a_failed_run_is_an_infinite_error():
    good = reference.Ends(np.zeros(2), np.zeros((2, 5)), np.ones(2, np.int64))
    bad = reference.Ends(np.array([0.0, np.nan]), np.zeros((2, 5)), np.ones(2, np.int64))
    assert reference.error(bad, good).tolist() == [0.0, math.inf]


def test_ladder():
    assert bounces.ladder(-6, -8, 1) == (1e-6, 1e-7, 1e-8)


def test_work_takes_turns():
    order, now = [], iter(range(100))
    work = {name: lambda name=name: order.append(name) for name in "ab"}
    timings = measure.alternate(work, 2, clock=lambda: float(next(now)))
    assert order == list("ababab")
    assert timings["a"].median == 1.0 and timings["a"].rate(10) == 10.0


def test_a_fresh_process_reports():
    result = measure.fresh("note = 1 + 1")
    assert result["note"] == 2 and result["peak_mib"] > 1
    with pytest.raises(RuntimeError, match="no_such_name"):
        measure.fresh("no_such_name")


def test_the_script_by_hand_gives_the_same_classes():
    grid = np.array([(-2.0, 1.0), (1.5, -2.5), (2.5, 2.0)])
    assert two_folds.library(grid) == two_folds.by_hand(grid)


def test_what_is_timed_is_proven():
    assert len(proofs.zeros(2)().zeros) == 4 and proofs.two_fold()().proven


def test_theorems_have_judges_of_their_own():
    found = theorems.lists(seed=1, systems=2, starts=10)
    assert found.sound and found.starts == 20
    section = {"lists": vars(found), "bounces": {"linear": theorems.bounces("linear", 1, 2)}}
    assert theorems.wrong(section) == 0 and "2 complete" in theorems.markdown(section)
    found.missed.append((0, [0.0] * 3))
    section["bounces"]["linear"]["outside"].append(1)
    assert theorems.wrong(section) == 2 and not found.sound


def test_ratios_and_tables():
    solvers = {
        "nonsmooth": {"rate": 400.0},
        report.MODES: {"rate": 10.0},
        "scipy DOP853": {"rate": 0.2},
    }
    results = {
        "machine": {"cpu": "any"},
        "bounces": {"linear": {"solvers": solvers, "target": 1e-9}},
        "memory": {"peak MiB": 2048.0, "bounces": 10, "starts_mib": 1.0, "results_mib": 2.0},
    }
    found = report.figures(results)
    assert found[f"linear bounce: times {report.MODES}"] == 40.0
    assert found["linear bounce: times scipy"] == pytest.approx(2000.0)
    rows = report._targets(results).splitlines()[2:]
    assert [row.split("|")[-2].strip() for row in rows] == ["met", "**missed**", "met"]


def test_a_chain_is_the_same_for_siconos_and_us(monkeypatch):
    """Its matrices give the field, and a run without Siconos says what is missing."""
    count, given = 3, []
    system, x = chain.chain(count), np.arange(6.0)

    def peer(*_, **options):
        given.append(json.loads(options["input"]))
        return subprocess.CompletedProcess([], 0, '{"rows": []}', "")

    monkeypatch.setattr(chain.subprocess, "run", peer)
    chain.siconos("python", count, 1.0, [1e-2])
    p = given[0]
    for mode, lam in (("+++", 1.0), ("---", -1.0)):
        ours = np.ravel(system.evaluate(system.field(mode), x))
        push = np.array(p["push"]) @ np.full(count, -lam)  # Siconos' relay acts against the slip
        theirs = np.array(p["matrix"]) @ x + p["offset"] + push
        np.testing.assert_allclose(ours, theirs, atol=1e-14)
    monkeypatch.delenv(chain.VARIABLE, raising=False)
    found = chain.run(True, 2, 5.0, "reference")
    assert found["same itinerary"] and found["nonsmooth"]["rows"][0]["error"] < 1e-9
    assert chain.VARIABLE in report.chain(found)


@pytest.mark.parametrize("name", orbits.CASES)
def test_orbits_of_library_and_peer_are_those_of_the_reference(name):
    case = orbits.CASES[name]()
    ours = orbits.errors(case, *_orbit(case.solve()))
    assert ours["orbit"] < 1e-14 and ours["multipliers"] < 1e-11
    if name != "R1":  # the peer takes half a second
        theirs = orbits.errors(case, *scipy_shooting.solve(name, 1e-9, whole=False))
        assert 1e-13 < theirs["orbit"] < 1e-7 and theirs["multipliers"] < 0.02


def _orbit(orbit):
    half = 2 if orbit.symmetric else 1
    return orbit.start, orbit.period / half, orbit.half_multipliers


def test_figures_of_orbits_are_ratios_of_medians():
    fast, slow = {"median": 1e-3, "low": 1e-3, "high": 2e-3}, {"median": 0.2, "low": 0.1, "high": 1}
    miss = {"orbit": 1e-9, "multipliers": 1e-6}
    section = {
        "orbits": {
            "W1": {
                "nonsmooth": {"seconds": fast, **miss},
                "scipy DOP853, every state, 1e-13": {"seconds": slow, **miss},
            }
        },
        "iterations": {"W1": {"step": fast, "period": fast}},
        "branches": {"forced friction, four legs": {"legs": 4, "points": 30, **slow}},
        "gradients": {"relay, 15 events": {"run": fast, "gradient": fast}},
        "leg": {"apart": 0.0, "solvers": {"nonsmooth": {**fast, "to compile": 0.0}}},
    }
    found = orbits.figures(section)
    assert found["orbit W1: times scipy, every state"] == pytest.approx(200)
    assert found["orbit W1: times scipy, every state, fastest turns"] == pytest.approx(100)
    assert found["branch of four legs: points a second"] == pytest.approx(150)
    assert set(found) <= set(orbits.TARGETS)
    assert "| W1 | scipy DOP853, every state, 1e-13 | 200 |" in orbits.markdown(
        section, report.table
    )


def test_bounces_in_space_are_those_of_the_library_and_their_parts_are_told():
    x = space.starts(5)
    many = ns.ensemble(space.system("linear"), x, problems.T_MAX, tol=1e-11)
    v, w = x[:, [1, 3]], x[:, 6:] - x[:, [1, 3]]
    same = bounce.lift_off(space.TURF.in_3d(), v, -1.0, w, tol=1e-11)
    assert np.abs(many.x[:, [1, 3]] - same.xdot).max() < 1e-10
    assert many.itinerary.tolist() == same.itinerary.tolist()
    rates = {
        f"{name}, in 3-D": {"rate": r, "median": r}
        for name, r in (("linear", 30.0), ("nonlinear", 20.0))
    }
    section = {
        "rates": {**rates, space.PLANE: {"rate": 100.0, "median": 90.0}},
        "errors": {"linear": 1e-11},
    }
    found = report.figures({space.NAME: section})
    assert found["linear bounce in 3-D: part of the nonlinear planar rate"] == 0.3
    assert "| nonlinear, in 3-D | 20 | 20 | 0.20 |" in report.markdown(
        {space.NAME: section, "machine": {}}
    )


def test_the_gpu_section_says_that_there_is_no_card(monkeypatch, capsys):
    def none(fused):
        raise gpu.DeviceError("device: expected an NVIDIA card")

    monkeypatch.setattr(gpu, "card", none)
    section = gpu.run(quick=True)
    assert "no card: device: expected an NVIDIA card" in capsys.readouterr().out
    assert gpu.markdown(section, report.table).startswith("No card")


@pytest.mark.slow
def test_the_gpu_section_compares_bits_and_rates(monkeypatch):
    """On the shim in the card's place: the same bits as itself, and a table."""
    shim = gpu.Shim(fused=False)
    monkeypatch.setattr(on_device, "machine_for", lambda device: shim)
    bits = gpu.compared("linear", 300, shim, gpu.Shim(fused=False))
    assert bits["same bits"] == bits["same itinerary"] == 300
    assert bits["handed over"] < 15
    rates = gpu.rates("linear", 200, shim, 1)
    text = gpu.markdown(
        {"card": shim.name, "bits": {"linear": bits}, "rates": {"linear": rates}, "diffrax": None},
        report.table,
    )
    assert "| linear |" in text and shim.name in text
