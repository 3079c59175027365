"""Periodic orbits have all digits of the reference cases, from a run or from a guess of two digits."""

from __future__ import annotations

import math
from functools import partial

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import nonsmooth as ns
from tests.orbit.periodic_cases import (
    CASES,
    excited_oscillator,
    forced_friction,
    friction_oscillator,
    fused_focus,
    grazing_circle,
    impact_oscillator,
    relay,
    scalar_relay,
    stick_slip,
    table,
    walker,
    welander,
)


def numbers(values) -> np.ndarray:
    """Complex numbers from the file."""
    if isinstance(values, str):
        return np.array([float(v) for v in values.split(",")], complex)
    return np.array(
        [
            complex(float(v["re"]), float(v["im"])) if isinstance(v, dict) else float(v)
            for v in values
        ],
        complex,
    )


def agree(found, expected, tol: float = 1e-11) -> bool:
    """Whether two sets of multipliers are the same, in any order."""
    found, rest = list(np.asarray(found, complex)), list(np.atleast_1d(expected))
    if len(found) != len(rest):
        return False
    for value in found:
        k = int(np.argmin([abs(value - r) for r in rest]))
        if abs(value - rest.pop(k)) > tol:
            return False
    return True


def close(found: float, digits: str) -> bool:
    return abs(found - float(digits)) <= 1e-12 * abs(float(digits))


@pytest.mark.parametrize("symmetry", [None, "odd"])
def test_r1_the_relay_that_slides_fourteen_times(symmetry) -> None:
    values, system = CASES["R1"], relay()
    run = ns.simulate(system, [0.0, -0.001, -0.02], t_end=40.0)
    orbit = ns.periodic_orbit(system, run, symmetry=symmetry)
    assert close(orbit.period, values["period"])
    assert agree(orbit.multipliers, [1, float(values["nontrivial_multiplier"]), 0])
    assert orbit.error_estimate < 1e-12 and orbit.stability == "asymptotically stable"
    found = sorted(leg.duration for leg in orbit.legs)
    expected = sorted(2 * [float(v) for v in values["flights_half"] + values["slides_half"]])
    # the shortest slide moves by 400 times what rounding does to the equations in doubles
    assert np.allclose(found, expected, rtol=1e-12, atol=0)
    if symmetry:
        derivative = -float(values["half_map_derivative"])
        assert agree(orbit.half_multipliers, [derivative, 0])
    exits = [leg.start[2] for leg in orbit.legs if leg.mode != "s"]
    assert close(max(map(abs, exits)), values["x3_at_exit"])
    assert "Periodic orbit of period 5.961836942614" in str(orbit)


def test_r3_stick_slip() -> None:
    values, system = CASES["R3"], stick_slip()
    for guess, options in (
        (ns.simulate(system, [0.3, 0.4], 30), {}),
        ([1.0, 0.5], {"itinerary": "- s"}),
    ):
        orbit = ns.periodic_orbit(system, guess, **options)
        assert close(orbit.period, values["period"])
        assert orbit.multipliers.tolist() == [1, 0] and orbit.stability == "superstable"
        legs = {leg.mode: leg for leg in orbit.legs}
        assert close(legs["-"].duration, values["slip_time"])
        assert close(legs["s"].duration, values["stick_time"])
        assert close(legs["s"].start[0], values["x_restick"])


def test_r5_a_nearly_tangent_crossing_keeps_the_multiplier() -> None:
    values, orbit = CASES["R5"], ns.periodic_orbit(welander(), [0.4, 0.3])
    assert close(orbit.period, values["period"])
    assert agree(orbit.multipliers, [1, float(values["multiplier"])], 1e-14)
    legs = {leg.mode: leg for leg in orbit.legs}
    assert close(legs["+"].duration, values["t_k5"]) and close(legs["-"].duration, values["t_k0"])
    assert close(legs["+"].start[0], values["T_end_k0"])
    assert close(legs["-"].start[0], values["T_end_k5"])


def test_r6_a_crossing_cycle_around_a_fused_focus() -> None:
    orbit = ns.periodic_orbit(fused_focus(), [0.30, 0.0])
    assert close(orbit.period, CASES["R6"]["period"])
    assert agree(orbit.multipliers, [1, float(CASES["R6"]["multiplier"])])
    assert close(max(leg.start[0] for leg in orbit.legs), CASES["R6"]["x0"])


def test_f1_and_f2_a_forced_relay_that_crosses_or_slides() -> None:
    system = scalar_relay()
    crossing = ns.periodic_orbit(system, ns.simulate(system, [0.5], 60))
    assert agree(crossing.multipliers, [float(CASES["F1"]["multiplier"])])
    phases = [math.remainder(leg.t, 2 * math.pi) for leg in crossing.legs if leg.mode == "+"]
    assert close(phases[0], CASES["F1"]["crossing_phase_up"])
    run = ns.simulate(system, [0.5], 60, parameters={"A": 1.5})
    sliding = ns.periodic_orbit(system, run)
    assert sliding.multipliers.tolist() == [0] and sliding.stability == "superstable"
    durations = {leg.mode: leg.duration for leg in sliding.legs}
    assert close(durations["+"], CASES["F2"]["flight"])
    assert close(durations["s"], CASES["F2"]["slide"])
    k = next(i for i, leg in enumerate(sliding.legs) if leg.mode == "+")
    for i, name in ((k, "exit_time"), ((k + 1) % len(sliding.legs), "landing_time")):
        assert close(math.remainder(sliding.legs[i].t, 2 * math.pi), CASES["F2"][name])


def test_f5_grazing_sliding_on_both_sides() -> None:
    values, system = CASES["F5"], grazing_circle()
    inside = ns.periodic_orbit(system, ns.simulate(system, [0.9, 0.0], 40))
    assert close(inside.period, values["period"])
    assert inside.multipliers.tolist() == [1, 0]
    legs = {leg.mode: leg for leg in inside.legs}
    assert close(legs["+"].duration, values["flight"]) and close(
        legs["s"].duration, values["slide"]
    )
    assert close(legs["+"].start[0], values["x_fold"])
    assert close(legs["s"].start[0], values["x_landing"])
    run = ns.simulate(system, [0.9, 0.0], 40, parameters={"d": 1.1})
    outside = ns.periodic_orbit(system, run)
    assert outside.itinerary == "+" and close(outside.period, values["period_before"])
    assert agree(outside.multipliers, [1, float(values["multiplier_before"])])
    nearest = outside.margins[0]
    assert "h0 > 0" in nearest.what and abs(nearest.value - 0.1) < 1e-12


def test_i1_bounces_on_a_table_from_two_digits() -> None:
    values = CASES["I1"]
    orbit = ns.periodic_orbit(table(), [0.26, 3.1], t_start=0.64, itinerary=[("", "reset")])
    assert agree(orbit.multipliers, numbers(values["multipliers"]))
    assert close(orbit.legs[0].t, values["phase"])
    assert close(orbit.start[1], values["launch_velocity"])
    assert close(np.prod(orbit.multipliers).real, values["det"])


def test_i2_an_impact_oscillator_whose_orbit_is_unstable() -> None:
    values = CASES["I2"]
    orbit = ns.periodic_orbit(
        impact_oscillator(), [1.0, -0.32], t_start=0.088, itinerary=[("o", "impact")]
    )
    assert agree(orbit.multipliers, numbers(values["multipliers"]))
    assert orbit.stability == "unstable, 1 multiplier outside the unit circle"
    assert close(orbit.start[1], values["v_after"]) and close(orbit.legs[0].t, values["phase_time"])
    assert abs(np.linalg.det(orbit.monodromy) - float(values["det_closed"])) < 1e-13


def test_i4_on_the_unit_circle() -> None:
    values = CASES["I4"]
    orbit = ns.periodic_orbit(
        excited_oscillator(), [-0.1, -1.1], t_start=1.3, itinerary=[("", "reset")]
    )
    assert agree(orbit.multipliers, numbers(values["multipliers"]))
    assert close(orbit.start[1], values["v_after"]) and close(orbit.legs[0].t, values["phase_time"])
    assert "on the unit circle" in orbit.stability


def test_d1_and_d5_forced_friction_with_and_without_a_stick() -> None:
    system = forced_friction()
    orbit = ns.periodic_orbit(system, ns.simulate(system, [1.5, 0.0], 100.0), symmetry="odd")
    assert agree(orbit.half_multipliers, numbers(CASES["D1"]["half_map_multipliers"]))
    assert agree(orbit.multipliers, numbers(CASES["D1"]["multipliers"]))
    assert close(orbit.period, CASES["D1"]["period"])
    assert close(abs(orbit.start[0]), CASES["D1"]["x0"])
    assert close(abs(math.remainder(0.6 * orbit.legs[0].t, math.pi)), CASES["D1"]["phase"])
    assert close(np.prod(orbit.half_multipliers).real, CASES["D1"]["det_half"])
    rate = math.log(abs(np.prod(orbit.multipliers))) / orbit.period
    assert close(rate, CASES["D1"]["lyapunov_sum"])
    run = ns.simulate(system, [1.5, 0.0], 100.0, parameters={"f": 0.6})
    for symmetry in ("odd", None):
        orbit = ns.periodic_orbit(system, run, symmetry=symmetry)
        assert agree(orbit.multipliers, numbers(CASES["D5"]["multipliers"]))
        durations = {leg.mode: leg.duration for leg in orbit.legs}
        assert close(durations["s"], CASES["D5"]["stick_time"])
        assert close(durations["+"], CASES["D5"]["slip_time"])
    given = {"symmetry": "odd", "t_start": 0.64, "parameters": {"f": 0.6}}
    stick = ns.periodic_orbit(system, [1.44, 0.0], itinerary="s -", **given)
    assert close(abs(stick.start[0]), CASES["D5"]["x_stick"])
    assert close(0.6 * stick.legs[0].t % math.pi, CASES["D5"]["phase_landing"])
    assert agree(stick.half_multipliers[:1], float(CASES["D5"]["half_map_derivative"]))


def test_k1_an_orbit_of_four_forcing_periods_that_grazes() -> None:
    values = CASES["K1"]
    orbit = ns.periodic_orbit(friction_oscillator(), [2.19, -0.42])
    assert orbit.problem.periods == 4 and len(orbit.legs) == 1
    assert agree(orbit.multipliers, numbers(values["multipliers_smooth"]))
    assert abs(orbit.margins[0].value) < 1e-12 and "h0 > 0" in orbit.margins[0].what


def test_k1_from_one_mode_where_the_run_from_the_guess_goes_elsewhere() -> None:
    """Of two digits, at a neighbouring frequency: the run meets the belt, the orbit does not."""
    nu = {"nu": 1.7085}
    known = ns.periodic_orbit(friction_oscillator(), [2.19, -0.42], parameters=nu)
    found = ns.periodic_orbit(friction_oscillator(), [2.2, -0.42], itinerary="+", parameters=nu)
    assert found.problem.periods == 4 and len(found.legs) == 1
    assert found.period == pytest.approx(known.period, rel=1e-13)
    assert np.abs(found.multipliers - known.multipliers).max() < 1e-11


def test_w1_two_gaits_of_the_simplest_walker_from_two_digits() -> None:
    values, system = CASES["W1"], walker()
    for angle, rate, length in ((0.20, -0.20, "long"), (0.19, -0.20, "short")):
        state = [angle, rate, 2 * angle, (1 - math.cos(2 * angle)) * rate]
        orbit = ns.periodic_orbit(system, state, itinerary=[("", "heelstrike")])
        if abs(orbit.period - float(values[f"{length}_step_time"])) > 0.1:
            # both gaits are near; the guess of two digits for the short one leads to either
            state[0], state[1] = 0.194, -0.204
            state[2:] = [2 * state[0], (1 - math.cos(2 * state[0])) * state[1]]
            orbit = ns.periodic_orbit(system, state, itinerary=[("", "heelstrike")])
        assert close(orbit.period, values[f"{length}_step_time"])
        found = [m for m in orbit.multipliers[1:]]
        assert agree(found, [*numbers(values[f"{length}_eigenvalues"]), 0])
        for value, digits in zip(orbit.start, values[f"{length}_period"], strict=False):
            assert close(value, digits)


# Properties --------------------------------------------------------------------------------------


def test_multipliers_agree_with_differences_of_the_return_map() -> None:
    system = friction_oscillator()
    orbit = ns.periodic_orbit(system, [2.19, -0.42])
    n, h, columns = 2, 1e-4, []
    t0, t1 = orbit.legs[0].t, orbit.legs[0].t + orbit.period
    for e in h * np.eye(n):
        ends = {
            k: ns.flow.follow(system, orbit.start + k * e, t1, mode="+", t_start=t0, tol=1e-14).x[
                -1
            ]
            for k in (-2, -1, 1, 2)
        }
        columns.append((8 * (ends[1] - ends[-1]) - (ends[2] - ends[-2])) / (12 * h))
    assert agree(orbit.multipliers, np.linalg.eigvals(np.array(columns).T), 1e-9)


def test_time_runs_back_and_the_multipliers_are_inverted() -> None:
    system = fused_focus()
    orbit = ns.periodic_orbit(system, [0.30, 0.0])
    x, y, al, r = (*ca.vertsplit(system.extended_states), *ca.vertsplit(system.parameter_symbols))
    back = ns.FilippovSystem(
        [x, y],
        surface=y,
        above=[-1, x],
        below=[1, (x - al) + r * (x - al) ** 2],
        parameters={al: -0.03, r: -1},
    )
    reverse = ns.periodic_orbit(back, orbit.start)
    assert abs(reverse.period - orbit.period) < 1e-12
    assert abs(reverse.multipliers[1] * orbit.multipliers[1] - 1) < 1e-11


def test_units_do_not_matter() -> None:
    x, v, f, k, b = (ca.SX.sym(s) for s in "x v f k b".split())
    small = ns.FilippovSystem(  # lengths in another unit, and h times a number
        [x, v],
        surface=-1e4 * (v - b),
        below=[v, -x - 1e-3 * (f - k * (1e3 * v - 1e3 * b))],
        above=[v, -x + 1e-3 * (f - k * (1e3 * b - 1e3 * v))],
        parameters={f: 1, k: 0.2, b: 0.5e-3},
    )
    orbit = ns.periodic_orbit(small, ns.simulate(small, [0.3e-3, 0.4e-3], 30, tol=1e-13))
    assert close(orbit.period, CASES["R3"]["period"])
    assert orbit.multipliers.tolist() == [1, 0]


def test_the_derivative_by_a_parameter_is_that_of_the_orbit() -> None:
    system = welander()
    orbit = ns.periodic_orbit(system, [0.4, 0.3])
    slope, h = orbit.derivative("a"), 1e-4
    ends = {k: ns.periodic_orbit(system, orbit, parameters={"a": 0.8 + k * h}) for k in (-1, 1)}
    assert slope.period == pytest.approx((ends[1].period - ends[-1].period) / (2 * h), rel=1e-5)
    assert slope.start == pytest.approx((ends[1].start - ends[-1].start) / (2 * h), rel=1e-5)
    with pytest.raises(ns.ParameterError, match="'mu'"):
        orbit.derivative("mu")


def test_the_orbit_is_a_run_that_closes() -> None:
    orbit = ns.periodic_orbit(grazing_circle(), [0.9, 0.0])
    run = orbit.trajectory
    assert run.itinerary == orbit.itinerary
    assert np.abs(run.x[-1] - run.x[0]).max() < 1e-11
    assert run.t[-1] - run.t[0] == pytest.approx(orbit.period, rel=1e-13)


def test_an_orbit_that_slides_all_the_time() -> None:
    x, y, z = (ca.SX.sym(s) for s in "xyz")
    r2 = x * x + y * y
    cycle = [x * (1 - r2) - y, y * (1 - r2) + x]
    system = ns.FilippovSystem([x, y, z], surface=z, above=[*cycle, -1], below=[*cycle, 1])
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.5, 0.0, 0.3], 30))
    assert orbit.itinerary == "s" and orbit.period == pytest.approx(2 * math.pi, rel=1e-13)
    assert abs(orbit.start[2]) < 1e-15
    assert agree(orbit.multipliers, [1, math.exp(-4 * math.pi), 0])


def test_an_orbit_that_rests_on_a_shaken_table() -> None:
    y, v, t, A = (ca.SX.sym(s) for s in "yvtA")
    system = ns.FilippovSystem(
        [y, v],
        field=[v, -1],
        impacts=ns.Impact(y - A * ca.sin(t), restitution=0.0),
        time=t,
        parameters={A: 1.5},
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [2.0, 0.0], 30))
    assert orbit.multipliers.tolist() == [0, 0] and orbit.period == pytest.approx(2 * math.pi)
    flight = next(leg for leg in orbit.legs if leg.mode == "o")
    assert 1.5 * math.sin(flight.t) == pytest.approx(1.0, rel=1e-13)  # where the table falls freely
    assert flight.start == pytest.approx([1.0, 1.5 * math.cos(flight.t)], rel=1e-12)


def test_multipliers_agree_with_the_return_map_in_forty_digits() -> None:
    rng = np.random.default_rng(3)
    for _ in range(3):
        a, b, k = rng.uniform([0.75, 0.45, 5.0], [0.85, 0.55, 6.0])
        orbit = ns.periodic_orbit(welander(), [0.4, 0.3], parameters={"a": a, "b": b, "k": k})
        (x0,) = [leg.start[0] for leg in orbit.legs if leg.mode == "+"]
        with mp.workdps(40):
            slope = mp.diff(partial(_returned, a=a, b=b, k=k, orbit=orbit), x0)
        assert abs(orbit.multipliers[1] - float(slope)) < 1e-12


def _returned(T0, a, b, k, orbit):
    """T after one turn of the box from T0 on the surface, by closed-form phases."""
    S0 = a * T0 - mp.mpf("0.01")
    for mode, mixing in (("+", mp.mpf(k)), ("-", mp.mpf(0))):
        guess = next(leg.duration for leg in orbit.legs if leg.mode == mode)
        rest = 1 / (1 + mixing), b / (b + mixing)

        def phase(t, T0=T0, S0=S0, mixing=mixing, rest=rest):
            T = rest[0] + (T0 - rest[0]) * mp.exp(-(1 + mixing) * t)
            return T, rest[1] + (S0 - rest[1]) * mp.exp(-(b + mixing) * t)

        t = mp.findroot(lambda t: phase(t)[1] - a * phase(t)[0] + mp.mpf("0.01"), guess)
        T0, S0 = phase(t)
    return T0


def test_one_of_a_family_of_orbits() -> None:
    # u keeps its size for ever, so every u > 1/2 has an orbit: a multiplier is 1.
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    jumps = [ns.Reset(x - 1, [x, -u], 1, "up"), ns.Reset(x + 1, [x, -u], -1, "down")]
    relay = ns.FilippovSystem([x, u], field=[2 * u - x, 0], resets=jumps)
    orbit = ns.periodic_orbit(relay, ns.simulate(relay, [0.0, 1.0], t_end=5.0))
    assert orbit.period == pytest.approx(4 * math.atanh(0.5), rel=1e-13)
    assert orbit.stability == "neutral to first order, 1 multiplier on the unit circle"


# Bad input ---------------------------------------------------------------------------------------


def test_runs_that_do_not_close_raise() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    away = ns.FilippovSystem([x, y], surface=y, above=[1, -x], below=[1, -x])
    with pytest.raises(ns.ConvergenceError, match="does not close"):
        ns.periodic_orbit(away, ns.simulate(away, [0.0, 1.0], 3.0))
    with pytest.raises(ns.ConvergenceError, match="leg 1"):
        ns.periodic_orbit(away, [2.0, 1.0], itinerary=[("-", "h0"), ("+", "h0")])


def test_virtual_orbits_raise_without_the_option() -> None:
    system = grazing_circle()
    at = {"d": 0.9}
    free = ns.periodic_orbit(system, ns.simulate(system, [0.9, 0.0], 40, parameters={"d": 1.1}))
    with pytest.raises(ns.ConvergenceError, match=r"leg 1 \(\+\).*h0 > 0") as refused:
        ns.periodic_orbit(system, free, parameters=at)
    assert refused.value.orbit.period == pytest.approx(2 * math.pi, rel=1e-13)
    virtual = ns.periodic_orbit(system, free, parameters=at, virtual=True)
    assert virtual.is_virtual and str(virtual).startswith("Virtual periodic orbit")


def test_invalid_arguments_raise() -> None:
    system = forced_friction()
    run = ns.simulate(system, [1.5, 0.0], 60.0)
    with pytest.raises(ns.ParameterError, match="mu"):
        ns.periodic_orbit(system, run, parameters={"mu": 1.0})
    with pytest.raises(ns.OptionError, match="symmetry"):
        ns.periodic_orbit(system, run, symmetry="even")
    with pytest.raises(ns.OptionError, match="symmetry"):
        ns.periodic_orbit(system, run, symmetry=2 * np.eye(2))
    with pytest.raises(ns.OptionError, match="itinerary"):
        ns.periodic_orbit(system, [1.5, 0.0], itinerary="+ + -")
    with pytest.raises(ns.PointError):
        ns.periodic_orbit(system, [1.5, 0.0, 1.0])


def test_no_convergence_names_the_leg() -> None:
    with pytest.raises(ns.ConvergenceError, match="leg 1"):
        ns.periodic_orbit(
            table(), [0.26, 3.1], t_start=0.64, itinerary=[("", "reset")], parameters={"A": 0.2}
        )


def test_a_guess_of_several_periods_gives_the_prime_period() -> None:
    # Multipliers are a pair at 156 degrees, so a run comes back best after five periods.
    buck = ns.textbook.buck_converter()
    orbit = ns.periodic_orbit(buck.system, buck.run(tol=1e-13))
    assert orbit.itinerary == "- +" and orbit.period == pytest.approx(4e-4, rel=1e-13)
    x, v, t = (ca.SX.sym(s) for s in "xvt")
    forced = ns.FilippovSystem([x, v], field=[v, ca.cos(2 * t) - x - 0.1 * v], time=t)
    run = ns.simulate(forced, [0.0, 0.0], 40.0)
    orbit = ns.periodic_orbit(forced, run)
    assert orbit.problem.periods == 1 and orbit.period == pytest.approx(math.pi, rel=1e-13)


def test_legs_and_events_of_an_orbit_have_elements_and_sides():
    """The same stick-slip orbit, found whole, with a second surface, and as its own run."""
    expected = [("entry", 0, -1, "h0"), ("exit", 0, -1, "lambda0 = -1")]
    one = stick_slip()
    lam, mu = ca.SX.sym("lam"), ca.SX.sym("mu")
    x, v, f, k, b = (ca.SX.sym(name) for name in "xvfkb")
    two = ns.FilippovSystem(
        [x, v],
        surfaces=[v - b, x - 50],
        multipliers=[lam, mu],
        field=[v, -x - lam * f + k * (v - b)],
        parameters={f: 1, k: 0.2, b: 0.5},
    )
    for system in (one, two):
        orbit = ns.periodic_orbit(system, ns.simulate(system, [0.3, 0.4], 60))
        legs = [(leg.kind, leg.element, leg.side, leg.event) for leg in orbit.legs]
        events = [(e.kind, e.element, e.side, e.name) for e in orbit.trajectory.events[:-1]]
        assert legs == events and sorted(legs) == expected


def test_mirrored_legs_have_mirrored_sides():
    system = forced_friction()
    half = ns.periodic_orbit(system, ns.simulate(system, [1.5, 0.0], 100.0), symmetry="odd")
    names = [(leg.kind, leg.element, leg.side, leg.event) for leg in half.legs]
    count = len(names) // 2
    assert half.symmetric and names[:count] != names[count:]
    for (kind, element, side, event), other in zip(names[:count], names[count:], strict=True):
        assert other[:3] == (kind, element, -side)
        swapped = {"lambda0 = 1": "lambda0 = -1", "lambda0 = -1": "lambda0 = 1"}
        assert other[3] == swapped.get(event, event)
