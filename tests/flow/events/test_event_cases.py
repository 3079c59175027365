"""The contract of events, case by case from ``tests/cases/events.json``, through the public API."""

import json
import random
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

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
FUNCTIONS = {
    name: getattr(ca, name)
    for name in (
        *("sin", "cos", "tan", "exp", "log", "sqrt", "fabs", "sign", "floor"),
        *("fmin", "fmax", "if_else", "logic_and", "logic_or", "logic_not"),
    )
}


class Written:
    """A case as a system: states whose rate is 0 and that conditions read are discrete."""

    def __init__(self, case):
        given = case["system"]
        self.symbols = {name: ca.SX.sym(name) for name in given["states"]}
        self.time = ca.SX.sym("t")
        rates = dict(zip(given["states"], given["field"], strict=True))
        read = ca.vertcat(*[self._expression(text) for text in self._conditions(given)], 0)
        still = [
            name
            for name, symbol in self.symbols.items()
            if rates[name] == "0" and ca.depends_on(read, symbol)
        ]
        states = [name for name in given["states"] if name not in still]
        self.order = [*states, *still]
        rhs = [self._expression(rates[name]) for name in states]
        make = ns.FilippovSystem.from_expression
        self.system = make(
            [self.symbols[name] for name in states],
            rhs,
            time=self.time if self._timed(given) else None,
            resets=[self._event(ns.Reset, event) for event in given.get("resets", [])],
            stops=[self._event(ns.Stop, event) for event in given.get("stops", [])],
            impacts=self._impact(given.get("impact")),
            **({"discrete": [self.symbols[name] for name in still]} if still else {}),
        )
        self.start = [float(ca.evalf(self._expression(case["start"][n]))) for n in self.order]

    def _expression(self, text):
        return ca.SX(eval(str(text), {**FUNCTIONS, **self.symbols, "t": self.time}))

    @staticmethod
    def _conditions(given):
        events = [*given.get("resets", []), *given.get("stops", [])]
        return [
            event[key]
            for event in events
            for key in ("guard", "condition", "when")
            if event.get(key)
        ]

    def _timed(self, given):
        texts = [*given["field"], *self._conditions(given)]
        texts += [v for event in given.get("resets", []) for v in event["map"].values()]
        every = ca.vertcat(*map(self._expression, texts))
        return bool(ca.depends_on(every, self.time))

    def _event(self, kind, given):
        options = dict(given)
        options.pop("direction", None) if "condition" in options else None
        condition = self._expression(options.pop("guard", None) or options.pop("condition"))
        arguments = [condition]
        if kind is ns.Reset:
            arguments.append(
                {self.symbols[n]: self._expression(e) for n, e in options.pop("map").items()}
            )
        if options.get("when") is not None:
            options["when"] = self._expression(options["when"])
        if "priority" in options:
            options["priority"] = self._expression(options["priority"])
        return kind(*arguments, **options)

    def _impact(self, given):
        if given is None:
            return ()
        gap, restitution = (self._expression(given[k]) for k in ("gap", "restitution"))
        return ns.Impact(gap, restitution=restitution, name=given.get("name", "impact"))


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


def check(case, events, run, order):
    """Compare a run, whose events may have been found in pieces, with the case."""
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


def whole(written, case):
    return ns.simulate(written.system, written.start, float(case["t_end"]), tol=TOL)


cases = pytest.mark.parametrize("name", CASES)


@cases
def test_a_run_has_the_events_of_its_case(name):
    case = CASES[name]
    written = Written(case)
    run = whole(written, case)
    check(case, listed(run), run, written.order)
    if case["status"] not in OPEN_ENDED:
        assert np.array_equal(run(run.t[-1]), run.x[-1])


def pieces(case):
    return case["split"].startswith("the same")


@cases
def test_a_run_split_at_random_times_is_the_same(name):
    case = CASES[name]
    if not pieces(case):
        pytest.skip("it is not split")
    written, choose = Written(case), random.Random(name)
    end = float(case["t_end"])
    times = sorted(choose.uniform(0.0, end) for _ in range(2))
    run, events = ns.simulate(written.system, written.start, times[0], tol=TOL), []
    events += listed(run)
    for t_end in [times[1], end]:
        if run.status is ns.Status.REACHED_END:
            run = ns.simulate(written.system, start=run, t_end=t_end, tol=TOL)
            events += listed(run)
    check(case, events, run, written.order)


@cases
def test_a_run_split_after_each_event_is_the_same(name):
    """Continued from the run that ``max_events`` ended, and from the event itself."""
    case = CASES[name]
    if not pieces(case):
        pytest.skip("it is not split")
    written, end = Written(case), float(case["t_end"])
    for from_event in (False, True):
        given = {"x0": written.start}
        events = []
        while True:
            run = ns.simulate(written.system, **given, t_end=end, tol=TOL, max_events=1)
            events += listed(run)
            if run.status is not ns.Status.TOO_MANY_EVENTS:
                break
            given = {"start": listed(run)[-1] if from_event and listed(run) else run}
        check(case, events, run, written.order)


@cases
def test_an_ensemble_counts_the_same_events(name):
    case = CASES[name]
    written = Written(case)
    starts = np.tile(np.array(written.start), (3, 1))
    many = ns.ensemble(
        written.system,
        starts,
        float(case["t_end"]),
        tol=TOL,
        work=ns.Work(threads=1, progress=False),
    )
    assert ns.Status(int(many.status[1])).name == case["status"]
    if case["status"] in OPEN_ENDED:
        return
    if case["number_of_events"] is not None:
        assert sum(int(many.events[kind][1]) for kind in KINDS) == case["number_of_events"]
    assert close(many.t[1], case["t_last"])
    for value, state in zip(many.x[1], written.order, strict=True):
        assert close(value, case["x_last"][state])
