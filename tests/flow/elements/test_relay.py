"""A relay with hysteresis is an element: its state is a letter, it has a memory, and all that runs a system runs it."""

import pickle

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, v, u, w, lam, q, a = (ca.SX.sym(s) for s in ("x", "y", "v", "u", "w", "lam", "q", "a"))


def thermostat(on=1.0, off=-1.0, **options):
    """x' = -x - 2u: x falls towards -2 while the relay is on, rises towards 2 while it is off."""
    options = {"surfaces": [ns.Relay(x, on=on, off=off)], "multipliers": [u], **options}
    return ns.FilippovSystem([x], field=[-x - 2 * u], **options)


def switches(run):
    return [e for e in run.events if e.kind == "crossing"]


def test_a_start_beyond_a_threshold_has_its_letter():
    assert ns.simulate(thermostat(), [1.5], 0.1, start_mode="-").status is ns.Status.NON_UNIQUE
    many = ns.ensemble(thermostat(), [[1.5], [0.5]], 0.1, start_mode="+")
    assert many.itinerary.tolist() == ["+", "+"]


def test_an_ensemble_runs_as_simulate_does():
    system, times = thermostat(a, -a, parameters={a: 1.0}), np.linspace(0.0, 7.0, 15)
    starts, widths = np.linspace(-1.6, 1.6, 100)[:, None], np.linspace(0.2, 1.4, 100)
    many = ns.ensemble(system, starts, 7.0, parameters={"a": widths}, t_eval=times)
    for k in range(0, 100, 9):
        run = ns.simulate(system, starts[k], 7.0, parameters={a: widths[k]}, t_eval=times)
        assert many.itinerary[k] == run.itinerary
        np.testing.assert_allclose(many.sample_x[k], run.sample_x, atol=1e-9)
        np.testing.assert_allclose(many.x[k], run.x[-1], atol=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_a_run_that_is_split_anywhere_is_the_same_run(seed):
    rng = np.random.default_rng(seed)
    system, t_end = two_relays(rng.uniform(0.2, 0.6)), 12.0
    whole = ns.simulate(system, [1.0, 0.0], t_end, tol=1e-12)
    cuts, run, events = np.sort(rng.uniform(0.0, t_end, 2)), None, []
    for cut in (*cuts, t_end):
        first = {"x0": [1.0, 0.0]} if run is None else {"start": run}
        run = ns.simulate(system, t_end=cut, tol=1e-12, **first)
        events += [(e.kind, e.name, e.t) for e in run.events[:-1]]
    assert [e[:2] for e in events] == [(e.kind, e.name) for e in whole.events[:-1]]
    np.testing.assert_allclose([e[2] for e in events], [e.t for e in whole.events[:-1]], atol=1e-9)
    np.testing.assert_allclose(run.x[-1], whole.x[-1], atol=1e-9)
    again = ns.simulate(system, start=whole.events[3], t_end=t_end, tol=1e-12)
    assert [e.name for e in again.events] == [e.name for e in whole.events[4:]]


def two_relays(width):
    """An oscillator with dry friction that two relays push, of which one waits for the speed."""
    return ns.FilippovSystem(
        [x, v],
        field=[v, -x - 0.5 * u - 0.2 * w - 0.15 * lam],
        surfaces=[ns.Relay(x, on=width, off=-width), v, ns.Relay(v + 0.3 * x, on=0.3, off=-0.2)],
        multipliers=[u, lam, w],
    )


@pytest.mark.parametrize("seed", range(8))
def test_relays_among_other_elements_are_what_discrete_states_and_resets_are(seed):
    """Random linear systems with friction that a relay scales, a set, and a contact that a relay loads."""
    rng = np.random.default_rng(seed)
    z, mu = ca.SX.sym("z", 4), ca.SX.sym("mu", 2)
    gap, speed, r = ca.SX.sym("gap"), ca.SX.sym("speed"), ca.SX.sym("r")
    matrix = rng.normal(size=(4, 4)) / 2 - 0.3 * np.eye(4)
    loads, signals = rng.normal(size=(4, 2)) * [1.5, 1.0], rng.normal(size=(2, 4))
    low, high = np.sort(rng.normal(size=(2, 2)), axis=1).T
    sets = [ca.vertcat(z[2], z[3])] if seed % 2 else []

    def field(one, two):
        rates = ca.SX(matrix) @ z + ca.SX(loads) @ ca.vertcat(one, two)
        rates[1] -= 0.8 * lam * (1 + 0.3 * one)
        rates[2:] -= 0.7 * mu * bool(sets)
        return [*ca.vertsplit(rates), speed, -1 - 1.5 * one]

    h = [ca.dot(ca.SX(row), z) for row in signals]
    states, impact = [*ca.vertsplit(z), gap, speed], ns.Impact(gap, restitution=0.5)
    relays = [ns.Relay(h[k], on=high[k], off=low[k]) for k in range(2)]
    one = ns.FilippovSystem(
        states,
        field=field(u, w),
        surfaces=[relays[0], z[1], *sets, relays[1]],
        multipliers=[u, lam, *[mu] * len(sets), w],
        impacts=impact,
    )
    levels = [(h[k], (low, high)[to > 0][k], (q, r)[k], to) for k in range(2) for to in (1, -1)]
    two = ns.FilippovSystem(
        states,
        field=field(q, r),
        surfaces=[z[1], *sets],
        multipliers=[lam, *[mu] * len(sets)],
        impacts=impact,
        discrete={q: (-1, 1), r: (-1, 1)},
        resets=[
            ns.Reset(f - level, {of: to}, to, level=True, when=of == -to, name=f"{of} {to}")
            for f, level, of, to in levels
        ],
    )
    start = [*rng.normal(size=4), 1.0, 0.0]
    ours = ns.simulate(one, start, 6.0, tol=1e-12)
    theirs = ns.simulate(two, [*start, -1, -1], 6.0, tol=1e-12)
    assert ours.status is theirs.status
    times = [e.t for e in ours.events if e.name in ("h0", f"h{2 + len(sets)}") and e.t > 0]
    expected = [e.t for e in theirs.events if e.kind == "reset" and e.t > 0]
    np.testing.assert_allclose(times, expected, atol=1e-9)
    np.testing.assert_allclose(ours.x[-1], theirs.x[-1][:6], rtol=1e-9, atol=1e-9)


def test_two_relays_with_one_signal_switch_together():
    system = ns.FilippovSystem(
        [x],
        field=[-x - u - w],
        surfaces=[ns.Relay(x, on=1.0, off=-1.0), ns.Relay(2 * x, on=2.0, off=-2.0)],
        multipliers=[u, w],
    )
    run = ns.simulate(system, [0.0], 10.0, tol=1e-13)
    one = ns.simulate(thermostat(), [0.0], 10.0, tol=1e-13)
    times = [e.t for e in switches(one)]
    np.testing.assert_allclose([e.t for e in switches(run)], times, atol=1e-12)
    assert run.segments[-1].mode == 2 * one.segments[-1].mode


def test_a_section_and_stops_see_the_relay():
    run = ns.simulate(thermostat(), [0.0], 30.0, at=ns.Section("h0", skip=4, count=3))
    np.testing.assert_allclose(np.diff(run.sample_t), np.log(3.0), atol=1e-9)
    counts = ns.ensemble(thermostat(), [[0.0]], 30.0, at_event=("crossing", 3))
    assert counts.event_t[0] == pytest.approx(np.log(2.0) + 2 * np.log(3.0), abs=1e-9)


def test_a_relay_that_is_continuous_at_one_threshold_is_generic():
    system = ns.FilippovSystem(
        [x], field=[-x - u * (x + 1)], surfaces=[ns.Relay(x, on=1.0, off=-1.0)], multipliers=[u]
    )
    assert system.switching().kind == "generic" and repr(system).endswith("1 surface)")


def test_thresholds_that_do_not_fit_are_refused():
    with pytest.raises(ns.DefinitionError, match=r"on.*off"):
        thermostat(-1.0, 1.0)
    with pytest.raises(ns.ParameterError, match="thresholds"):
        ns.simulate(thermostat(a, 0.0, parameters={a: 1.0}), [0.0], 1.0, parameters={a: -1.0})
    with pytest.raises(ns.DefinitionError, match="thresholds"):
        thermostat(1 + x**2, 0.0)
    with pytest.raises(ns.DefinitionError):
        ns.FilippovSystem([x], field=[u], surfaces=[ns.Relay(2.0, on=1, off=0)], multipliers=[u])


def test_what_does_not_know_relays_refuses_them():
    system = thermostat()
    run = ns.simulate(system, [0.0], 3.0)
    for verb in (
        lambda: ns.classify(system, [0.0]),
        lambda: ns.sensitivity(run),
        lambda: ns.region(system, [0.0]),
        lambda: ns.flow.follow(system, [0.0], 1.0, mode="+"),
        lambda: ns.regularise(system, 0.1),
    ):
        with pytest.raises(ns.DefinitionError, match="hysteresis"):
            verb()


def test_a_relay_is_kept_in_files_and_processes(tmp_path):
    system = thermostat(a, -1.0, parameters={a: 1.0})
    again = pickle.loads(pickle.dumps(system))
    assert again == system and again != thermostat(a, -2.0, parameters={a: 1.0})
    run = ns.simulate(system, [0.0], 3.0)
    run.save(tmp_path / "run.npz")
    loaded = ns.load(tmp_path / "run.npz")
    assert loaded.system == system
    more = ns.simulate(loaded.system, start=loaded, t_end=5.0)
    np.testing.assert_allclose(more.x[-1], ns.simulate(system, [0.0], 5.0).x[-1], atol=1e-9)
    many = ns.ensemble(again, [[0.0], [0.3]], 5.0, work=ns.Work(chunk=1))
    assert many.itinerary[0] == ns.simulate(system, [0.0], 5.0).itinerary
