"""The letters of a leg tell the mode after it, and a symmetry maps legs to those of the mirror image."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.orbit.branches.itinerary_changes import mode_after
from nonsmooth.orbit.periodic.boundary_value_problem import BoundaryProblem, mirrored
from nonsmooth.orbit.runs.legs import Leg

x, y, lam, kap = (ca.SX.sym(s) for s in ("x", "y", "lam", "kap"))
RELAY = ns.FilippovSystem([x, y], surface=y, above=[1, -x], below=[-1, -x])
TWO = ns.FilippovSystem([x, y], surfaces=[x, y], multipliers=[lam, kap], field=[-kap, lam])


@pytest.mark.parametrize(
    ("leg", "following"),
    [
        (Leg("+", "crossing", 0, 1), "-"),
        (Leg("-", "entry", 0, -1), "s"),
        (Leg("s", "exit", 0, 1), "+"),
        (Leg("s", "exit", 0, -1), "-"),
        (Leg("s+", "exit", 0, 1), "++"),
        (Leg("s+", "exit", 0, -1), "-+"),
        (Leg("+-", "crossing", 1, -1), "++"),
        (Leg("+-", "entry", 1, -1), "+s"),
        (Leg("", "reset", 0), ""),
    ],
)
def test_the_mode_after_a_leg(leg, following):
    assert mode_after(leg) == following


ODD = -np.eye(2)
LEGS = (
    (Leg("+", "crossing", 0, 1), Leg("-", "crossing", 0, -1)),
    (Leg("s", "exit", 0, 1), Leg("s", "exit", 0, -1)),
    (Leg("-", "entry", 0, -1), Leg("+", "entry", 0, 1)),
)


@pytest.mark.parametrize(("leg", "image"), LEGS)
def test_a_symmetry_that_turns_the_surface_turns_letters_and_exits(leg, image):
    problem = BoundaryProblem(RELAY, (leg,), symmetry=ODD)
    assert mirrored(problem, leg) == image
    assert mirrored(problem, image) == leg  # R^2 = 1


@pytest.mark.parametrize("symmetry", [None, np.diag([-1.0, 1.0])])
@pytest.mark.parametrize("leg", [leg for pair in LEGS for leg in pair])
def test_without_a_symmetry_or_with_one_along_the_surface_a_leg_stays(leg, symmetry):
    assert mirrored(BoundaryProblem(RELAY, (leg,), symmetry=symmetry), leg) == leg


def test_only_the_surfaces_that_are_turned_change_their_letters():
    """x -> -x, y -> y."""
    leg = Leg("+-", "crossing", 1, -1)
    problem = BoundaryProblem(TWO, (leg,), symmetry=np.diag([-1.0, 1.0]))
    assert mirrored(problem, leg) == Leg("--", "crossing", 1, -1)
