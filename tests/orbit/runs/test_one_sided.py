"""One-sided derivatives: products of saltation matrices in both orders, and closed forms at grazings and ends."""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, v, a, l1, l2 = (ca.SX.sym(name) for name in "x y v a l1 l2".split())
CORNER = ns.FilippovSystem(
    [x, y],
    surfaces=[x, y],
    multipliers=[l1, l2],
    field=[1 + 0.5 * l1 - 0.2 * l2, 1 + 0.3 * l2 - 0.1 * l1],
)
#: y = -1/2 + x^2/2 + ..: the orbit from (-1, 1/2) touches y = 0, where it would slide.
SLIDE = ns.FilippovSystem([x, y], surface=y, above=[1, x], below=[1 + a, 2.0], parameters={a: 0.5})
WALL = ns.FilippovSystem([x, v], field=[v, 1.0], impacts=ns.Impact(x, restitution=0.5))


def field(one: int, two: int) -> np.ndarray:
    return np.array([1 + 0.5 * one - 0.2 * two, 1 + 0.3 * two - 0.1 * one])


def passed(modes: list[tuple[int, int]]) -> np.ndarray:
    """The product of saltation matrices of crossings at one point."""
    whole = np.eye(2)
    for before, after in pairwise(modes):
        normal = np.array(before) != np.array(after)
        one, two = field(*before), field(*after)
        whole = (np.eye(2) + np.outer(two - one, normal) / (normal @ one)) @ whole
    return whole


@pytest.mark.parametrize("first", [0, 1])
def test_at_a_corner_each_order_of_events_has_its_derivative(first: int) -> None:
    run = ns.simulate(CORNER, -field(-1, -1), 3.0)
    assert run.itinerary == "-- ++"
    with pytest.raises(ns.DegenerateError, match="corner"):
        ns.sensitivity(run)
    side = np.eye(2)[first]  # the one that is ahead is first
    exact = passed([(-1, -1), (1, -1) if first == 0 else (-1, 1), (1, 1)])
    assert np.abs(ns.sensitivity(run, side=side).dx_dx0 - exact).max() < 1e-12
    assert np.abs(ns.gradient(run, x + 2 * y, side=side).x0 - [1, 2] @ exact).max() < 1e-12
    assert np.abs(ns.vjp(run, [1, 2], side={"x0": side})[0] - [1, 2] @ exact).max() < 1e-12


#: System, start, end, direction, and the derivative by the start. A slide of the length d from L1 = -d is faster by d/4,
#: and the orbit ends higher or lower by as much as it is ahead.
CASES = {
    "above the graze": (SLIDE, [-1.0, 0.5], 2.0, [0, 1], [[1, 0], [2, 1]]),
    "with a slide": (SLIDE, [-1.0, 0.5], 2.0, [0, -1], [[0.75, -0.25], [0.75, -0.25]]),
    "beside a wall": (WALL, [0.5, -1.0], 2.0, [1, 0], [[1, 2], [0, 1]]),
    "before an impact": (WALL, [1.5, -2.0], 1.0, [1, 0], [[1, 1], [0, 1]]),
    "after an impact": (WALL, [1.5, -2.0], 1.0, [-1, 0], [[-0.5, -0.5], [-1.5, -2.0]]),
}


@pytest.mark.filterwarnings("ignore:Rounding")
@pytest.mark.parametrize("name", CASES)
def test_derivatives_at_a_grazing_and_at_the_end_are_those_of_the_side(name: str) -> None:
    system, start, t_end, side, exact = CASES[name]
    found = ns.sensitivity(ns.simulate(system, start, t_end, tol=1e-13), side=side)
    assert np.abs(found.dx_dx0 - exact).max() < 1e-7


def test_a_side_without_a_derivative_or_direction_raises() -> None:
    run = ns.simulate(WALL, [0.5, -1.0], 2.0)
    with pytest.raises(ns.DegenerateError, match="no finite limit"):  # the square root
        ns.sensitivity(run, side=[-1, 0])
    for side in ([0, 0], {"q": 1.0}, {}, [1, 2, 3], [np.nan, 1], "left"):
        with pytest.raises(ns.OptionError, match="side"):
            ns.sensitivity(run, side=side)


def test_samples_and_parameters_have_one_sided_derivatives() -> None:
    """A sample just at the impact, and a ramp that reaches the corner at once with a parameter."""
    run = ns.simulate(WALL, [1.5, -2.0], 2.0, t_eval=[0.5, 1.0], tol=1e-13)
    found = ns.sensitivity(run, side=[-1, 0])
    assert np.abs(found.dsample_dx0[1] - [[-0.5, -0.5], [-1.5, -2.0]]).max() < 1e-8
    ramp = ns.FilippovSystem(
        [x, y], surface=x, above=[a, y], below=[2 * a, -y], parameters={a: 1.0}
    )
    run = ns.simulate(ramp, [-2.0, 1.0], 1.0)  # it reaches x = 0 at its end
    for way, slope in ((1.0, 1.0), (-1.0, 2.0)):
        one = ns.sensitivity(run, side={"a": way})
        assert one.dx_dp[0, 0] == pytest.approx(slope, rel=1e-9)
