"""Runs and ensembles of the interpreter, with any number of surfaces and impacts."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, u, v, t, r, lam = (ca.SX.sym(name) for name in ("x", "y", "u", "v", "t", "r", "lam"))


def blocks(count):
    """Blocks on a belt, coupled by springs, each with its own friction."""
    q, w, mu = (ca.SX.sym(name, count) for name in ("q", "w", "mu"))
    pull = [
        sum(q[j] - q[i] for j in (i - 1, i + 1) if 0 <= j < count) - 0.3 * q[i]
        for i in range(count)
    ]
    force = [pull[i] - (1 + 0.07 * i) * mu[i] for i in range(count)]
    return ns.FilippovSystem(
        [*ca.vertsplit(q), *ca.vertsplit(w)],
        field=[*ca.vertsplit(w), *force],
        surfaces=[w[i] - 0.1 for i in range(count)],
        multipliers=ca.vertsplit(mu),
    )


@pytest.mark.parametrize("count", [2, 7])
def test_blocks_with_friction(count):
    start = [*(0.5 * np.cos(1.7 * np.arange(count))), *np.zeros(count)]
    run = ns.simulate(blocks(count), start, 15.0)
    assert run.status is ns.Status.REACHED_END and len(run.events) > count


@pytest.mark.slow
def test_a_hundred_blocks_keep_their_energy_balance():
    """Energy changes by the work of friction, which is -mu_i lambda_i w_i: quadrature of the run."""
    count = 100
    system, rng = blocks(count), np.random.default_rng(1)
    start = [*(0.5 * rng.normal(size=count)), *np.zeros(count)]
    run = ns.simulate(system, start, 30.0)
    assert run.status is ns.Status.REACHED_END and len(run.events) > 100
    q, w = run.x[:, :count], run.x[:, count:]
    energy = (w**2).sum(1) / 2 + 0.15 * (q**2).sum(1) + (np.diff(q, axis=1) ** 2).sum(1) / 2
    work = 0.0
    nodes, weights = np.polynomial.legendre.leggauss(8)
    for segment in run.segments:
        sticks = np.array([letter == "s" for letter in segment.mode])
        signs = np.array([{"+": 1.0, "-": -1.0, "s": 0.0}[c] for c in segment.mode])
        for k in range(segment.first, segment.last):
            a = run.steps.starts[k]
            b = run.steps.starts[k + 1] if k + 1 < len(run.steps.starts) else run.t[-1]
            states = run(a + (b - a) * (nodes + 1) / 2)
            at = states[:, :count]
            pull = -0.3 * at
            pull[:, :-1] += at[:, 1:] - at[:, :-1]
            pull[:, 1:] += at[:, :-1] - at[:, 1:]
            friction = np.where(sticks, -pull, -signs * (1 + 0.07 * np.arange(count)))
            work += (b - a) / 2 * weights @ (friction * states[:, count:]).sum(1)
    assert energy[-1] - energy[0] == pytest.approx(work, abs=1e-8 * energy[0])


TABLE = ns.FilippovSystem(
    [y, v], field=[v, -9.81], impacts=ns.Impact(y - 0.2 * ca.sin(8 * t), restitution=0.5), time=t
)
WALLS = ns.FilippovSystem(
    [x, u],
    field=[u, -0.1 * u + ca.cos(t)],
    time=t,
    impacts=[ns.Impact(x + 0.3, 0.8, name="left"), ns.Impact(0.3 - x, 0.8, name="right")],
)


def test_ensembles_are_the_runs_one_by_one():
    starts = np.array([[0.5, 0.0], [1.0, 0.5], [np.nan, 0.0], [-1.0, 0.0]])
    many = ns.ensemble(TABLE, starts, 3.0, t_eval=[0.5, 1.0], at_event=("impact", 2))
    for k in (0, 1):
        run = ns.simulate(TABLE, starts[k], 3.0)
        np.testing.assert_array_equal(many.x[k], run.x[-1])
        np.testing.assert_allclose(many.sample_x[k], run([0.5, 1.0]), rtol=0, atol=1e-13)
        second = [e for e in run.events if e.kind == "impact"][1]
        np.testing.assert_array_equal(many.event_x[k], second.x)
        assert many.itinerary[k] == run.itinerary
    assert [str(ns.Status(s)) for s in many.status[2:]] == ["NOT_FINITE", "INCONSISTENT"]


def test_ensembles_that_slide_on_two_surfaces():
    """Sliding on two surfaces at once, of many trajectories: as one by one."""
    system = blocks(2)
    starts = np.column_stack([np.linspace(-1, 1, 80), np.linspace(1, -0.5, 80), *np.zeros((2, 80))])
    many = ns.ensemble(system, starts, 12.0, at_event=("entry", 2), t_eval=[11.0])
    assert any("ss" in word for word in many.itineraries)
    for k in range(0, 80, 13):
        run = ns.simulate(system, starts[k], 12.0)
        assert (many.status[k], many.itinerary[k]) == (run.status, run.itinerary)
        np.testing.assert_allclose(many.x[k], run.x[-1], rtol=0, atol=1e-12)
        np.testing.assert_allclose(many.sample_x[k], run([11.0]), rtol=0, atol=1e-12)
        entries = [e for e in run.events if e.kind == "entry"]
        np.testing.assert_allclose(many.event_t[k], entries[1].t, rtol=0, atol=1e-12)


def test_a_section_at_an_impact():
    at = ns.Section("impact", count=3)
    run = ns.simulate(TABLE, [1.0, 0.0], 5.0, at=at)
    many = ns.ensemble(TABLE, [[1.0, 0.0]] * 3, 5.0, at=at)
    hits = [e for e in run.events if e.kind == "impact"]
    assert len(hits) == 3 and run.status is ns.Status.STOPPED
    np.testing.assert_array_equal(many.sample_t[1], [e.t for e in hits])
    np.testing.assert_array_equal(many.sample_x[2], [e.x for e in hits])


OPERATIONS = {
    "arithmetic": lambda a, b: (a + b) * (a - b) / (2 + b * b) - 3 * a,
    "powers": lambda a, b: a**2 + (1 + a**2) ** -1.5 + (2 + a) ** b + a**7,
    "roots": lambda a, b: ca.sqrt(2 + a) + ca.hypot(a, 1 + b),
    "exponentials": lambda a, b: ca.exp(a) + ca.log(3 + b) + ca.expm1(b) + ca.log1p(a),
    "circles": lambda a, b: ca.sin(a) + ca.cos(b) + ca.tan(a) + ca.atan2(1 + a, 2 + b),
    "inverse": lambda a, b: ca.asin(a / 3) + ca.acos(b / 3) + ca.atan(a),
    "hyperbolic": lambda a, b: ca.sinh(a) + ca.cosh(b) + ca.tanh(a * b),
    "inverse hyperbolic": lambda a, b: ca.asinh(a) + ca.acosh(3 + b) + ca.atanh(a / 3),
    "error": lambda a, b: ca.erf(a) + ca.erfinv(b / 3),
    "parameters": lambda a, b: a * ca.fmax(P, 0.2) + ca.fabs(P) * b + ca.floor(P) + ca.sign(P),
}
P = ca.SX.sym("p")


@pytest.mark.slow_cases("error")
@pytest.mark.parametrize("name", OPERATIONS)
def test_every_operation(name):
    """As a field, as a curved surface with sliding, and as a stop, at two orders of the series."""
    f = OPERATIONS[name](x, y)
    system = ns.FilippovSystem(
        [x, y, u],
        field=[0.3 * ca.cos(u), -0.2 * x, 0.1 * f - (0.4 + x * x) * lam],
        surfaces=[u - 0.05 * f],
        multipliers=[lam],
        stops=[ns.Stop(f - 50)],
        parameters={P: -0.7},
    )
    run, fine = (ns.simulate(system, [0.2, 0.4, 1.0], 6.0, tol=tol) for tol in (1e-9, 1e-13))
    assert "s" in run.itinerary and run.itinerary == fine.itinerary
    assert run.status is fine.status and len(run.events) == len(fine.events)
    scale = 1.0 + np.abs(fine.x).max()
    np.testing.assert_allclose(run.x[-1], fine.x[-1], rtol=0, atol=2e-8 * scale)
    for one, other in zip(run.events, fine.events, strict=True):
        assert one.t == pytest.approx(other.t, abs=2e-8)


@pytest.mark.parametrize(
    "f", [ca.sin(x) / x, x / y, (1 - ca.cos(x)) / x, x / (P + 0.7), (P + 0.7) / x, y / x + 1]
)
def test_zero_over_zero_is_no_number(f):
    """Not zero either, as which a run would stay where it is and end well."""
    system = ns.FilippovSystem([x, y], field=[f, -y], parameters={P: -0.7})
    run = ns.simulate(system, [0.0, 0.0], 1.0)
    assert run.status is ns.Status.NOT_FINITE and run.t[-1] == 0.0
    many = ns.ensemble(system, np.zeros((70, 2)), 1.0)
    assert {ns.Status(s) for s in many.status} == {ns.Status.NOT_FINITE}


def test_quotients_whose_divisors_overflow():
    """Friction 2/(1 + exp(-v/e)) - 1 = tanh(v/2e) at speeds of 900 e, where exp is infinite or nearly."""
    width = 1e-2
    forms = [2 / (1 + ca.exp(-y / width)) - 1, 2 * (1 + ca.exp(-y / width)) ** -1.0 - 1]
    forms.append(2 / (1 + ca.exp(-y / width / 2) ** 2) - 1)
    ends = []
    for friction in [ca.tanh(y / (2 * width)), *forms]:
        run = ns.simulate(
            ns.FilippovSystem([x, y], field=[y, -x - 0.4 * friction]), [-10.0, 0.0], 12.0
        )
        assert run.status == ns.Status.REACHED_END and len(run.t) < 200
        ends.append(run.x[-1])
    np.testing.assert_allclose(ends[1:], [ends[0]] * 3, atol=1e-8)


def test_interruption_is_heard(monkeypatch):
    """Between bursts of steps; the burst is shortened here, so that no clock is needed."""
    import nonsmooth.flow.engine.interpreter as module

    calls, original = [], module.library().run_continue

    def interrupted(state, budget):
        calls.append(budget)
        if len(calls) > 2:
            raise KeyboardInterrupt
        return original(state, budget)

    monkeypatch.setattr(module, "BURST", 5)
    monkeypatch.setattr(module.library(), "run_continue", interrupted)
    with pytest.raises(KeyboardInterrupt):
        ns.simulate(WALLS, [0.0, 0.0], 50.0)
