"""A side is + or - in all functions of ``local``; anything else is refused."""

import casadi as ca
import pytest

import nonsmooth as ns

x, y = ca.SX.sym("x"), ca.SX.sym("y")
SYSTEM = ns.FilippovSystem([x, y], surface=y, above=[-x - y, x - y], below=[1, 1 + x])


@pytest.mark.parametrize(
    "call",
    [
        lambda side: ns.local.fold(SYSTEM, [0, 0], side=side),
        lambda side: ns.find_fold(SYSTEM, [0, 0], side=side),
        lambda side: ns.find_equilibrium(SYSTEM, [0, 0], side=side),
        lambda side: ns.find_boundary_equilibrium(SYSTEM, [0, 0], vary="mu", side=side),
        lambda side: ns.local.boundary_equilibrium(SYSTEM, [0, 0], side=side),
    ],
)
@pytest.mark.parametrize("side", ["above", "below", "s", "", 1, 0])
def test_other_words_are_refused(call, side):
    with pytest.raises(ns.DefinitionError, match=f"side.*{side!r}"):
        call(side)


def test_results_carry_the_letter():
    assert ns.find_fold(SYSTEM, [-0.9, 0.1], side="-").side == "-"
    assert ns.find_equilibrium(SYSTEM, [0.1, 0.1]).side == "+"
    assert ns.local.boundary_equilibrium(SYSTEM, [0, 0]).side == "+"
    assert ns.classify(SYSTEM, [-1.0, 0.0]).side == "-"
    assert ns.classify(SYSTEM, [2.0, 0.0]).side == ""
