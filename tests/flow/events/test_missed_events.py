"""No double crossing is missed and none is invented, whatever the depth of the dip and its phase."""

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import nonsmooth as ns

depths = st.floats(-9.0, -1.0).map(lambda e: 10.0**e)
phases = st.floats(0.0, 2 * math.pi)


def make_oscillator():
    """h = x + 1 - depth over x = cos: a dip of that depth once a period; z is the time below."""
    x, v, z, depth = (ca.SX.sym(s) for s in ("x", "v", "z", "depth"))
    return ns.FilippovSystem(
        [x, v, z], surface=x + 1 - depth, above=[v, -x, 0], below=[v, -x, 1], parameters=[depth]
    )


def make_parabola():
    """h = (x - c)^2 - depth along x = t: the step is as long as the run."""
    x, c, depth = (ca.SX.sym(s) for s in ("x", "c", "depth"))
    return ns.FilippovSystem(
        [x], surface=(x - c) ** 2 - depth, above=[1], below=[1], parameters=[c, depth]
    )


def make_quartic():
    """Two dips in one step: h = ((x - a)^2 - depth) ((x - b)^2 - depth)."""
    x, a, b, depth = (ca.SX.sym(s) for s in ("x", "a", "b", "depth"))
    return ns.FilippovSystem(
        [x],
        surface=((x - a) ** 2 - depth) * ((x - b) ** 2 - depth),
        above=[1],
        below=[1],
        parameters=[a, b, depth],
    )


OSCILLATOR, PARABOLA, QUARTIC = make_oscillator(), make_parabola(), make_quartic()


def crossings(run):
    return [e.t for e in run.events if e.kind == "crossing"]


@given(depth=depths, phase=phases, tol=st.sampled_from([1e-11, 1e-12, 1e-13]))
def test_every_dip_of_an_oscillation_is_two_crossings(depth, phase, tol):
    t_end, half = 20.0, 2 * math.asin(math.sqrt(depth / 2))
    centres = math.pi - phase + 2 * math.pi * np.arange(-1, 5)
    known = np.sort(np.concatenate([centres - half, centres + half]))
    assume(min(np.min(np.abs(known)), np.min(np.abs(known - t_end))) > 1e-6)
    inside = known[(known > 0) & (known < t_end)]
    start = [math.cos(phase), -math.sin(phase), 0.0]
    run = ns.simulate(OSCILLATOR, start, t_end, parameters={"depth": depth}, tol=tol)
    assert run.status is ns.Status.REACHED_END
    found = crossings(run)
    assert len(found) == len(inside)
    # the root is where h has slope sqrt(2 depth): the error of the state is divided by that
    assert np.max(np.abs(np.array(found) - inside)) < 100 * tol / math.sqrt(depth) + 1e-12


@given(clearance=st.floats(-9.0, -1.0).map(lambda e: 10.0**e), phase=phases)
def test_a_near_miss_is_no_crossing(clearance, phase):
    start = [math.cos(phase), -math.sin(phase), 0.0]
    run = ns.simulate(OSCILLATOR, start, 20.0, parameters={"depth": -clearance}, tol=1e-12)
    assert run.itinerary == "+" and not crossings(run)


@given(depth=depths, centre=st.floats(0.5, 9.5))
def test_a_dip_within_one_step_is_two_crossings(depth, centre):
    run = ns.simulate(PARABOLA, [0.0], 10.0, parameters={"c": centre, "depth": depth}, tol=1e-10)
    half = math.sqrt(depth)
    assert run.itinerary == "+ - +"
    # rounding of h, about 1e-14 at x = 10, is divided by its slope 2 sqrt(depth)
    error = np.abs(np.array(crossings(run)) - [centre - half, centre + half])
    assert np.max(error) < 1e-13 / half + 1e-13


@given(depth=depths, centre=st.floats(0.5, 4.0), gap=st.floats(1.0, 5.0))
def test_two_dips_within_one_step_are_four_crossings(depth, centre, gap):
    half = math.sqrt(depth)
    a, b = centre, centre + gap
    assume(gap > 2.5 * half)
    run = ns.simulate(QUARTIC, [0.0], 10.0, parameters={"a": a, "b": b, "depth": depth}, tol=1e-10)
    assert run.itinerary == "+ - + - +"
    known = [a - half, a + half, b - half, b + half]
    # rounding of the quartic over the one step, 10^4 times 1e-16, is divided by its slope at a root
    assert np.max(np.abs(np.array(crossings(run)) - known)) < 1e-10 / half


@given(depth=depths, centre=st.floats(0.5, 9.5))
def test_a_watched_function_is_not_missed_either(depth, centre):
    x = ca.SX.sym("x")
    system = ns.FilippovSystem([x], field=[1])
    run = ns.flow.follow(system, [0.0], 10.0, mode="", watch=[(x - centre) ** 2 - depth])
    assert [e.kind for e in run.events] == ["zero", "zero", "end"]


@pytest.mark.parametrize("depth", [1e-9, 1e-12])
def test_the_time_below_is_the_width_of_the_dips(depth):
    run = ns.simulate(OSCILLATOR, [1.0, 0.0, 0.0], 20.0, parameters={"depth": depth}, tol=1e-15)
    assert len(crossings(run)) == 6
    assert run.x[-1, 2] == pytest.approx(12 * math.asin(math.sqrt(depth / 2)), rel=1e-2)
