"""The contract of events, case by case from ``tests/cases/events.json``, through the public API."""

import json
import random
from pathlib import Path

import numpy as np
import pytest

import nonsmooth as ns
from testset.problem import Problem

TOL = 1e-10
#: Values agree to this much, relative and absolute.
CLOSE = 100 * TOL
CASES = {
    case["id"]: case
    for case in json.loads(
        (Path(__file__).parents[2] / "cases" / "events.json").read_text(encoding="utf-8")
    )["cases"]
}
#: Events of the contract; crossings and ends of sliding belong to the surfaces.
KINDS = ("reset", "stop", "impact")
#: At accumulation only the limit is fixed.
OPEN_ENDED = ("ACCUMULATION", "ENDLESS_JUMPS")


def close(found, expected):
    return abs(found - float(expected)) <= CLOSE * max(1.0, abs(float(expected)))


def listed(run):
    return [event for event in run.events if event.kind in KINDS]


def same(events, expected, order):
    """Compare events with those of the case, one by one."""
    for event, required in zip(events, expected, strict=True):
        assert event.name == required["name"] and event.kind == required["kind"]
        assert close(event.t, required["t"]), (event, required)
        for states, key in ((event.x, "x"), (event.x_after, "x_after")):
            for value, name in zip(states, order, strict=True):
                assert close(value, required[key][name]), (event, required)


def check(case, events, run):
    """Compare a run, whose events may have been found in pieces, with the case."""
    order = run.system.state_names
    assert run.status.name == case["status"], run.message
    if case["limit"] is not None and run.accumulation_time is not None:
        assert close(run.accumulation_time, case["limit"])
    if case["status"] == "ENDLESS_JUMPS":
        return
    shown = case["events"]
    if case["events_shown"] == "all":
        assert [event.name for event in events] == [required["name"] for required in shown]
        same(events, shown, order)
    else:
        same(events[:20], shown[:20], order)
        if case["status"] not in OPEN_ENDED and case["number_of_events"] is not None:
            assert len(events) == case["number_of_events"]
            same(events[-2:], shown[-2:], order)
    if case["status"] not in OPEN_ENDED:
        assert close(run.t[-1], case["t_last"])
        for value, name in zip(run.x[-1], order, strict=True):
            assert close(value, case["x_last"][name])


cases = pytest.mark.parametrize("name", CASES)


@cases
def test_a_run_has_the_events_of_its_case(name):
    case = CASES[name]
    run = Problem(case).run(tol=TOL)
    check(case, listed(run), run)
    if case["status"] not in OPEN_ENDED:
        assert np.array_equal(run(run.t[-1]), run.x[-1])


def pieces(case):
    return case["split"].startswith("the same")


@cases
def test_a_run_split_at_random_times_is_the_same(name):
    case = CASES[name]
    if not pieces(case):
        pytest.skip("it is not split")
    problem, choose = Problem(case), random.Random(name)
    times = sorted(choose.uniform(0.0, problem.t_end) for _ in range(2))
    run = ns.simulate(problem.system, problem.start, times[0], tol=TOL)
    events = listed(run)
    for t_end in [times[1], problem.t_end]:
        if run.status is ns.Status.REACHED_END:
            run = ns.simulate(problem.system, start=run, t_end=t_end, tol=TOL)
            events += listed(run)
    check(case, events, run)


@cases
def test_a_run_split_after_each_event_is_the_same(name):
    """Continued from the run that ``max_events`` ended, and from the event itself."""
    case = CASES[name]
    if not pieces(case):
        pytest.skip("it is not split")
    problem = Problem(case)
    for from_event in (False, True):
        given = {"x0": problem.start}
        events = []
        while True:
            run = ns.simulate(problem.system, **given, t_end=problem.t_end, tol=TOL, max_events=1)
            events += listed(run)
            if run.status is not ns.Status.TOO_MANY_EVENTS:
                break
            given = {"start": listed(run)[-1] if from_event and listed(run) else run}
        check(case, events, run)


@cases
def test_an_ensemble_counts_the_same_events(name):
    case = CASES[name]
    problem, work = Problem(case), ns.Work(threads=1, progress=False)
    starts = np.tile(problem.start, (3, 1))
    many = ns.ensemble(problem.system, starts, problem.t_end, tol=TOL, work=work)
    assert ns.Status(int(many.status[1])).name == case["status"]
    if case["status"] in OPEN_ENDED:
        return
    if case["number_of_events"] is not None:
        assert sum(int(many.events[kind][1]) for kind in KINDS) == case["number_of_events"]
    assert close(many.t[1], case["t_last"])
    for value, state in zip(many.x[1], problem.system.state_names, strict=True):
        assert close(value, case["x_last"][state])
