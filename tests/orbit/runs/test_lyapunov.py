"""Lyapunov exponents are those of closed forms: chaotic maps in flows, forced friction, linear decay."""

import math

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.engine.columns import carry_frame
from nonsmooth.orbit.runs import lyapunov
from tests.orbit.interrupts import interrupt
from tests.orbit.periodic_cases import (
    CASES,
    PARAMETERS,
    cases_of,
    forced_friction,
    relay_oscillator,
    stick_slip,
)

x, y, u, v = (ca.SX.sym(s) for s in "xyuv")


def test_doubling_of_an_angle_by_squaring():
    """L2: the angle doubles at each tick, the radius returns to the circle."""
    clock, pull = ns.Clock(1.0, map=[u**2 - v**2, 2 * u * v]), (1 - u**2 - v**2) / 2
    system = ns.FilippovSystem([u, v], field=[u * pull, v * pull], clocks=clock)
    found = ns.lyapunov_spectrum(system, [math.cos(0.7), math.sin(0.7), 0.0], t_end=320.0)
    exact = [float(value) for value in CASES["L2"]["spectrum"]]
    assert np.allclose(found.exponents, exact, rtol=0, atol=1e-9)
    assert np.all(found.errors < 1e-7) and found.t == pytest.approx(288.0)
    assert found.sum_check == pytest.approx(sum(exact), abs=1e-9)
    assert math.isnan(found.dimension)  # volumes grow: the circle is no attractor of all directions


def test_chebyshev_map_at_the_ticks_of_a_clock():
    """x -> 2 x**2 - 1 has the exponent ln 2 for almost every start; errors cover the miss."""
    clock = ns.Clock(1.0, map=[2 * x**2 - 1])
    system = ns.FilippovSystem([x], field=[0.0 * x], clocks=clock)
    found = ns.lyapunov_spectrum(system, [0.3, 0.0], t_end=1500.0, k=1)
    assert abs(found.exponents[0] - math.log(2)) < 4 * found.errors[0] < 0.1
    assert found.exponents.shape == (1,) and found.blocks.shape == (32, 1)


def test_relay_oscillator_contracts_as_its_damping():
    """LY3: saltation adds d to the divergence -2 d."""
    system = relay_oscillator()
    case = cases_of("cases/orbits_2.json")["LY3"]
    exact = [float(value) for value in case["values"]["exponents"]]
    found = ns.lyapunov_spectrum(system, case["start"], t_end=1000.0)
    assert np.all(np.abs(found.exponents - exact) < 4 * found.errors) and found.errors.max() < 1e-3
    orbit = ns.periodic_orbit(system, case["start"])
    exponents = np.log(np.abs(orbit.multipliers)) / orbit.period
    assert np.allclose(exponents, exact, rtol=0, atol=1e-12)


def test_sum_of_forced_friction_is_that_of_its_closed_form():
    """D1: no sticking; the volume shrinks at the reversals only."""
    values, W = CASES["D1"], float(PARAMETERS["D1"]["W"])
    system = forced_friction()
    period, at = float(values["period"]), float(values["phase"])
    # the orbit turns at x0 when W t = phase, in one of the two senses of the angle
    starts = [(float(values["x0"]), sign * at / W) for sign in (1, -1)]
    runs = [ns.simulate(system, [a, 0.0], b + period, t_start=b) for a, b in starts]
    (x0, t0), run = min(zip(starts, runs, strict=True), key=lambda s: abs(s[1].x[-1, 0] - s[0][0]))
    assert abs(run.x[-1, 0] - x0) < 1e-9
    found = ns.lyapunov_spectrum(
        system, [x0, 0.0], t_start=t0, t_end=t0 + 40.25 * period, transient=8.25 * period
    )
    assert found.exponents.sum() == pytest.approx(float(values["lyapunov_sum"]), rel=1e-9)
    assert found.sum_check == pytest.approx(found.exponents.sum(), rel=1e-8)
    # a complex pair of multipliers: both exponents are half of the sum on average
    assert np.allclose(found.exponents, found.exponents.sum() / 2, atol=0.02)


def test_an_entry_to_sliding_loses_a_direction_for_good():
    """A block carried by a belt to its slip and back: one direction is lost, one is the flow's."""
    found = ns.lyapunov_spectrum(stick_slip(), [0.2, 0.5], t_end=200.0, progress=False)
    assert abs(found.exponents[0]) < 0.02 and found.exponents[1] == -math.inf
    assert math.isnan(found.sum_check) and "-inf" in str(found)


def test_smooth_linear_flow_has_its_eigenvalues_and_stiff_legs_are_cut():
    system = ns.FilippovSystem([x, y, u], field=[-x + 3 * y, -2 * y, -40 * u])
    found = ns.lyapunov_spectrum(system, [1.0, 1.0, 1.0], t_end=40.0, transient=25.0)
    assert np.allclose(found.exponents, [-1, -2, -40], rtol=1e-8)
    assert found.sum_check == pytest.approx(-43.0, rel=1e-12)
    turning = ns.FilippovSystem([x, y, u], field=[x / 4 - y, x + y / 4, -2 * u])
    found = ns.lyapunov_spectrum(turning, [1.0, 1.0, 1.0], t_end=40.0, transient=10.0, k=3)
    assert found.dimension == pytest.approx(2.25, abs=0.02)


def test_lyapunov_spectra_are_saved(tmp_path):
    system = ns.FilippovSystem([x], field=[-x])
    found = ns.lyapunov_spectrum(system, [1.0], t_end=5.0)
    found.save(tmp_path / "spectrum")
    again = ns.load(tmp_path / "spectrum")
    assert np.array_equal(again.blocks, found.blocks) and repr(again) == repr(found)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"t_end": 1.0, "k": 2}, ns.OptionError, r"\bk\b"),
        ({"t_end": 1.0, "transient": 1.0}, ns.OptionError, "t_end.*transient"),
        ({"t_end": -1.0}, ns.OptionError, "t_end"),
        ({"t_end": 3.0}, ns.DegenerateError, "STOPPED"),
    ],
)
def test_invalid_options_raise(options, error, message):
    system = ns.FilippovSystem([x], field=[1], stops=ns.Stop(x - 2))
    with pytest.raises(error, match=message):
        ns.lyapunov_spectrum(system, [0.0], **options)


def test_an_interrupt_keeps_the_exponents_so_far(monkeypatch):
    clock = ns.Clock(1.0, map=[x / 2])
    system = ns.FilippovSystem([x], field=[0.0 * x], clocks=clock)
    interrupt(monkeypatch, lyapunov, "passages_over", 3)
    found = ns.lyapunov_spectrum(system, [1.0, 0.0], t_end=200.0, transient=40.0, k=2)
    assert not found.complete and 10.0 <= found.t < 160.0 and "interrupted" in repr(found)
    assert np.allclose(np.sort(found.exponents), [-math.log(2), 0.0], atol=1e-9)


@pytest.mark.slow
def test_a_run_that_ends_at_an_event_loses_no_direction():
    """Chebyshev's map at each tick of a clock: ln 2, and 0 of the clock, whose last tick is the end."""
    x, c = ca.SX.sym("x"), ca.SX.sym("c")
    clocked = ns.FilippovSystem(
        [x, c], field=[0 * x, 1], resets=ns.Reset(c - 1, [2 * x**2 - 1, 0], 1, "tick")
    )
    found = ns.lyapunov_spectrum(clocked, [0.3, 0.0], t_end=800.0)
    assert found.exponents == pytest.approx([np.log(2), 0.0], abs=0.02)
    run = ns.simulate(clocked, [0.3, 0.0], 2.0)
    slope = ns.sensitivity(run, wrt="x0").dx_dx0
    value = 2 * 0.3**2 - 1
    assert np.abs(slope - [[4 * value * 4 * 0.3, 0], [0, 1]]).max() < 1e-12


def test_a_map_that_diverges_has_its_exponents_as_long_as_there_are_digits():
    """x -> 3 x, y -> -2 x y: the map has the derivatives 3 and -2 x, and x grows by 3 exp(1) each tick.

    Rates far above that of the clock's phase are no grazing of its tick."""
    start, clock = [1.0, 0.2, 0.5], ns.Clock(1.0, map=[3 * x, -2 * y * x])
    system = ns.FilippovSystem([x, y], field=[x, y - x], clocks=clock)
    found = ns.lyapunov_spectrum(system, start, t_end=4.0, transient=1.0, progress=False)
    sizes = [math.exp(0.5 + k) * 3.0**k for k in range(4)]  # x at the ticks
    total = sum(math.log(3.0) + math.log(2.0 * size) for size in sizes[1:]) + 2.0 * 3.0
    assert found.exponents.sum() == pytest.approx(total / 3.0, rel=1e-9)
    with pytest.raises(ns.DegenerateError, match=r"'clock'.*diverges"):
        ns.lyapunov_spectrum(system, start, t_end=20.0, progress=False)
    with pytest.raises(ns.DegenerateError, match=r"NOT_FINITE.*diverges"):
        ns.lyapunov_spectrum(system, start, t_end=60.0, progress=False)


def test_a_squaring_map_that_diverges_keeps_the_exponent_of_its_clock_finite():
    """x -> x^2 + 2 at rest between: the clock's direction is not lost, whatever x is."""
    system = ns.FilippovSystem([x], field=[0 * x], clocks=ns.Clock(1.0, map=[x**2 + 2]))
    found = ns.lyapunov_spectrum(system, [1.0, 0.5], t_end=8.4, transient=2.4, progress=False)
    size, total = 1.0, 0.0
    for k in range(8):  # ticks at 0.5, 1.5, ...
        total += math.log(2.0 * size) if k + 0.5 > 2.4 else 0.0
        size = size**2 + 2.0
    assert found.exponents.sum() == pytest.approx(total / 6.0, rel=1e-9)
    assert np.isfinite(found.exponents).all()


def test_a_passenger_of_a_chattering_ball_has_the_exponent_of_its_decay() -> None:
    """A limit of impacts loses the two directions of the ball."""
    y, v, z, t = (ca.SX.sym(s) for s in "yvzt")
    hit = ns.Impact(y - 0.5 * ca.sin(5 * t), restitution=0.5)
    table = ns.FilippovSystem([y, v, z], field=[v, -10, y - 0.2 * z], impacts=hit, time=t)
    found = ns.lyapunov_spectrum(table, [0.45, 1.5, 0.1], 8.0, t_start=0.2, transient=2.5)
    assert found.exponents.tolist() == [pytest.approx(-0.2, rel=1e-9), -math.inf, -math.inf]
    assert found.errors[0] < 1e-9


def friction_in_the_plane(strength: float) -> ns.FilippovSystem:
    """A pushed mass on springs, and a passenger w that follows it at the rate 1."""
    x, y, u, v, w, t = (ca.SX.sym(s) for s in "xyuvwt")
    lam = ca.SX.sym("lam", 2)
    along = -x - x**3 - u / 10 + 1.2 * ca.cos(t) - strength * lam[0] + y / 5
    across = -1.5 * y - v / 10 + 0.9 * ca.sin(t) - strength * lam[1] + 0.3 * x
    surface, field = ca.vertcat(u, v), [u, v, along, across, x - w]
    return ns.FilippovSystem(
        [x, y, u, v, w], field=field, surfaces=[surface], multipliers=[lam], time=t
    )


def test_slip_in_the_plane_has_the_volume_of_its_derivatives():
    system, start = friction_in_the_plane(0.9), [1.0, 0.2, 0.5, 0.1, 0.3]
    found = ns.lyapunov_spectrum(system, start, t_end=30.0, transient=0.0)
    slope = ns.sensitivity(ns.simulate(system, start, 30.0), wrt="x0").dx_dx0
    assert found.exponents.sum() * 30.0 == pytest.approx(np.linalg.slogdet(slope)[1], rel=1e-10)
    assert math.isnan(found.sum_check)


def test_sticking_in_the_plane_loses_the_velocities_and_keeps_the_passenger():
    start = [1.0, 0.2, 0.5, 0.1, 0.3]
    found = ns.lyapunov_spectrum(friction_in_the_plane(2.2), start, t_end=60.0)
    assert (found.exponents[-2:] == -math.inf).all()
    assert found.exponents[2] == pytest.approx(-1.0, abs=0.05)
    assert (np.abs(found.exponents[:2]) < 0.1).all()


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_an_entry_to_sliding_loses_its_direction_in_any_unit(scale):
    sides = [[-x - 2 * scale, -3 * v], [-x + 2 * scale, -3 * v]]
    system = ns.FilippovSystem([x, v], surface=x, above=sides[0], below=sides[1])
    found = ns.lyapunov_spectrum(system, [scale, scale], t_end=20.0, transient=10.0)
    assert found.exponents[0] == pytest.approx(-3.0, rel=1e-12)
    assert found.exponents[1] == -math.inf


def test_a_chain_of_decompositions_is_that_of_householder():
    rng = np.random.default_rng(3)
    matrices = rng.normal(size=(40, 5, 5)) * 10.0 ** rng.uniform(-3, 3, size=(40, 5, 1))
    q = np.linalg.qr(rng.normal(size=(5, 3)))[0]
    frames, growth = carry_frame(matrices, q)
    for matrix, frame, own in zip(matrices, frames, growth, strict=True):
        q, r = np.linalg.qr(matrix @ q)
        assert np.allclose(own, np.abs(np.diag(r)), rtol=1e-9)
        assert np.allclose(frame.T @ frame, np.eye(3), atol=1e-14)
        assert np.allclose(np.abs(np.diag(frame.T @ q)), 1.0, atol=1e-9)
        q = frame
