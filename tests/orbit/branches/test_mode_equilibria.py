"""Branches of equilibria through conditions, contacts and surfaces that open, close and are left: closed forms."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

X, Y, V, A = (ca.SX.sym(name) for name in ("x", "y", "v", "a"))
L, R = ca.SX.sym("l"), ca.SX.sym("r")

FOLD, PERSISTS = "nonsmooth fold", "persistence"


def unilateral(level):
    """Closed at x = sqrt(a), with the multiplier level - x; open on a = x^2 - x + level, where x >= level."""
    return ns.FilippovSystem(
        [X, Y],
        field=[Y - X**2 + A, X - Y - level + L],
        complementarity=[ns.Complementarity(Y, L)],
        parameters={A: 0.1},
    )


def diode():
    """Open at x = a up to 0.2; closed with l = x - 0.2 at x = (a + 0.2)/2."""
    return ns.FilippovSystem(
        [X],
        field=[A - X - L],
        complementarity=[ns.Complementarity(L - X + 0.2, L)],
        parameters={A: 0.1},
    )


def mass_on_floor():
    return ns.FilippovSystem(
        [X, V],
        field=[V, A - X - 0.2 * V + R],
        impacts=ns.Impact(X, reaction=R),
        parameters={A: 0.5},
    )


def relay_and_diode():
    """The relay rests at x = 0 for |a| < 1, the diode is closed up to x = 0.5."""
    return ns.FilippovSystem(
        [X, Y],
        field=[A - X - V, X - Y - 0.5 + L],
        surfaces=[X],
        multipliers=[V],
        complementarity=[ns.Complementarity(Y, L)],
        parameters={A: 0.1},
    )


@pytest.mark.parametrize(
    ("system", "mode", "near", "bounds", "events", "ends"),
    [
        (
            unilateral(0.4),
            "c",
            [0.3, 0],
            (0.05, 1),
            [(0.15, "fold"), (0.16, FOLD)],
            [np.sqrt(0.05), (1 + np.sqrt(3.4)) / 2],
        ),
        (
            unilateral(0.7),
            "c",
            [0.3, 0],
            (0.05, 1),
            [(0.49, PERSISTS)],
            [np.sqrt(0.05), (1 + np.sqrt(2.2)) / 2],
        ),
        (diode(), "o", [0.1], (-1, 2), [(0.2, PERSISTS)], [-1, 1.1]),
        (mass_on_floor(), "o", [0.5, 0], (-1, 1), [(0, PERSISTS)], [0, 1]),
        (
            relay_and_diode(),
            "sc",
            [0, 0],
            (-2, 2),
            [(-1, PERSISTS), (1, PERSISTS), (1.5, PERSISTS)],
            [-1, 1],
        ),
    ],
)
def test_branches_go_on_where_conditions_change(system, mode, near, bounds, events, ends):
    branch = ns.continue_equilibrium(system, near, "a", bounds=bounds, mode=mode)
    assert [str(end) for end in branch.ends] == ["REACHED_BOUND"] * 2
    found = sorted(branch.events, key=lambda event: event.parameter)
    np.testing.assert_allclose([e.parameter for e in found], [a for a, _ in events], atol=1e-12)
    for event, (_, words) in zip(found, events, strict=True):
        assert words in (event.kind, event.far_side.verdict.split(":")[0])
    rests = sorted(branch.solutions[i].point[0] for i in (0, -1))
    np.testing.assert_allclose(rests, ends, atol=1e-12)
    for one, value in zip(branch.solutions, branch.values, strict=True):
        again = ns.find_equilibrium(system, one.point, mode=one.mode, parameters={"a": value})
        np.testing.assert_allclose(again.point, one.point, atol=1e-12)
        np.testing.assert_allclose(again.eigenvalues, one.eigenvalues, atol=1e-9)
