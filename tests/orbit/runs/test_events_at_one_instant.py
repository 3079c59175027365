"""Derivatives of runs with events at one instant: those that one causes count, a corner is refused."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, v = (ca.SX.sym(s) for s in "xyv")


def test_a_reset_that_another_one_causes_is_part_of_its_derivative():
    """x = 1 puts y at 2, which takes it to 1 and triples v: y(T) = 1 + 3 v0 (T - 1 + x0)."""
    system = ns.FilippovSystem(
        [x, y, v],
        field=[1, v, 0],
        resets=[
            ns.Reset(x - 1, map=[x, 2, v], name="A", direction=1),
            ns.Reset(y - 2, map=[x, y - 1, 3 * v], name="B"),
        ],
    )
    t_end, (x0, _, v0) = 1.3, (0.0, 0.3, 0.5)
    run = ns.simulate(system, [x0, 0.3, v0], t_end, tol=1e-12)
    assert [e.name for e in run.events[:2]] == ["A", "B"]
    late = t_end - 1 + x0
    np.testing.assert_allclose(run.x[-1], [t_end, 1 + 3 * v0 * late, 3 * v0], atol=1e-12)
    expected = [[1, 0, 0], [3 * v0, 0, 3 * late], [0, 0, 3]]
    np.testing.assert_allclose(ns.sensitivity(run).dx_dx0, expected, atol=1e-10)


def test_two_resets_that_only_meet_are_a_corner():
    """x = 1 and y = 1 at one time: which comes first depends on the start."""
    system = ns.FilippovSystem(
        [x, y],
        field=[1, 1],
        resets=[
            ns.Reset(x - 1, map=[x - 1, y], name="A", direction=1),
            ns.Reset(y - 1, map=[x, y - 1], name="B", direction=1),
        ],
    )
    run = ns.simulate(system, [0.0, 0.0], 1.5)
    with pytest.raises(ns.DegenerateError, match=r"'A' and 'B'.*corner"):
        ns.sensitivity(run)
