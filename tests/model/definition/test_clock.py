"""A clock is periodic in time without drift: converters, kicks and sampled controls have their closed forms."""

import math

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, v, q, T = (ca.SX.sym(s) for s in ("x", "v", "q", "T"))


def test_a_ramp_compared_with_the_state_switches_as_pulse_width_modulation_does():
    # x' = u - x, u = 1 while x < 1 - phase; within a period the switch is at an algebraic root
    clock = ns.Clock(1.0)
    pwm = ns.FilippovSystem(
        [x], surface=x + clock.phase - 1, above=[-x], below=[1 - x], clocks=clock
    )
    run = ns.simulate(pwm, [0.2, 0.0], t_end=200.0, at="clock")
    assert np.allclose(run.sample_t, np.arange(1, 201), rtol=0, atol=1e-11)
    value = 0.2
    for k, found in enumerate(run.sample_x[:, 0]):
        low, high = 0.0, 1.0  # bisection for 1 - (1 - x) exp(-s) = 1 - s
        for _ in range(60):
            s = (low + high) / 2
            low, high = (s, high) if 1 - (1 - value) * math.exp(-s) < 1 - s else (low, s)
        value = (1 - (1 - value) * math.exp(-s)) * math.exp(s - 1)
        assert found == pytest.approx(value, abs=1e-9), k
    assert {e.name for e in run.events if e.kind == "reset"} == {"clock"}


def test_a_tick_may_change_the_other_states_and_a_period_may_be_a_parameter():
    # rate -q held between ticks: x -> x - T q with q := x at each tick
    clock = ns.Clock(T, map=[x, x], name="sampler")
    held = ns.FilippovSystem([x, q], field=[-q, 0], clocks=clock, parameters={T: 0.5})
    run = ns.simulate(held, [1.0, 1.0, 0.0], 5.0, at=ns.Section("sampler", after=True))
    assert np.allclose(run.sample_x[:, 0], 0.5 ** np.arange(1, 11), rtol=0, atol=1e-12)
    many = ns.ensemble(held, [1.0, 1.0, 0.0], 4.5, parameters={"T": np.array([0.25, 1.0])})
    assert np.allclose(many.x[:, 0], [0.75**18, 0.0], rtol=0, atol=1e-9)


def test_two_clocks_and_a_reset_of_the_states_keep_each_other():
    fast, slow = ns.Clock(1.0, name="fast"), ns.Clock(3.0, map=[x, v + 1], name="slow")
    system = ns.FilippovSystem(
        [x, v], field=[v, 0], clocks=[fast, slow], resets=ns.Reset(x - 2, [0, v], 1, "wrap")
    )
    run = ns.simulate(system, [0.0, 1.0, 0.0, 0.5], 4.75)
    times = {name: [e.t for e in run.events if e.name == name] for name in ("fast", "slow", "wrap")}
    assert times["fast"] == pytest.approx([1, 2, 3, 4])
    assert times["slow"] == pytest.approx([2.5])
    assert times["wrap"] == pytest.approx([2, 3.25, 4.25])
    assert run.x[-1] == pytest.approx([1.0, 2.0, 0.75, 2.25])


def test_lifted_expressions_take_clocks_too():
    clock = ns.Clock(2.0)
    system = ns.FilippovSystem.from_expression([x], [ca.sign(1 - clock.phase)], clocks=clock)
    run = ns.simulate(system, [0.0, 0.0], 5.0)
    assert run.x[-1] == pytest.approx([1.0, 1.0])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ns.Clock(0.0), "period of 'clock'"),
        (lambda: ns.Clock("one"), "period of 'clock'"),
        (lambda: ns.FilippovSystem([x], field=[1], clocks=[1.0]), "clocks"),
        (
            lambda: ns.FilippovSystem([x], field=[1], clocks=ns.Clock(1, map=[x, x])),
            "map of 'clock'",
        ),
        (
            lambda: ns.FilippovSystem([x], field=[1], clocks=[ns.Clock(1), ns.Clock(2)]),
            "symbols.*clock_phase",
        ),
    ],
)
def test_clocks_that_make_no_sense_are_refused(make, message):
    with pytest.raises(ns.DefinitionError, match=message):
        make()
