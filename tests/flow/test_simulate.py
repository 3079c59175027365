"""Starts in a mode that the user gives."""

import re

import casadi as ca
import pytest

import nonsmooth as ns
from nonsmooth.flow.engine import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


@pytest.mark.parametrize(("start", "mode"), [(1.0, "-"), (-1.0, "+"), (1.0, "s")])
def test_a_start_mode_on_another_side_than_the_point_is_refused(start, mode):
    x = ca.SX.sym("x")
    system = ns.FilippovSystem([x], surface=x, above=[-1], below=[3])
    side = "+" if start > 0 else "-"
    message = re.escape(f"start_mode is {mode!r}") + ".*" + re.escape(f"h0 = {start:g} ({side!r})")
    with pytest.raises(ns.OptionError, match=message):
        ns.simulate(system, [start], t_end=1.0, start_mode=mode)
    assert ns.simulate(system, [start], t_end=0.1, start_mode=side).status == 0
