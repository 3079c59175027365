"""The value of 0/0 is no number, whatever surfaces a system has, in single runs and in ensembles."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, a, b = (ca.SX.sym(name) for name in "xyab")


@pytest.mark.parametrize("count", [0, 1, 2])
def test_a_field_that_is_zero_over_zero_at_the_start_is_not_finite(count):
    multipliers, surfaces = [a, b][:count], [x - 5, y - 7][:count]
    push = sum(0.1 * (1 + m) for m in multipliers)
    given = {"multipliers": multipliers, "surfaces": surfaces} if count else {}
    system = ns.FilippovSystem([x, y], field=[x / y + push, 1.0 + push], **given)
    assert ns.simulate(system, [0.0, 0.0], 1.0).status is ns.Status.NOT_FINITE
    many = ns.ensemble(system, np.zeros((70, 2)), 1.0, work=ns.Work(progress=False))
    assert set(many.status) == {ns.Status.NOT_FINITE}
