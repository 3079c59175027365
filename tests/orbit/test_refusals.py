"""What cannot be a periodic orbit is refused with the leg, what happened and what to try."""

import casadi as ca
import pytest

import nonsmooth as ns
from tests.orbit.periodic_cases import (
    forced_friction,
    scalar_relay,
    stick_slip,
    walker,
    welander,
)

X, Y = ca.SX.sym("x"), ca.SX.sym("y")


@pytest.mark.parametrize(
    ("solve", "error", "message"),
    [
        (
            lambda: (forced_friction(), [1.5, 0.0], {"period": -2.0}),
            ns.OptionError,
            "positive time",
        ),
        (
            lambda: (forced_friction(), [1.5, 0.0], {"period": 3.3}),
            ns.OptionError,
            "the same again, received 3.3, after which it differs by",
        ),
        (
            lambda: (forced_friction(), [1.5, 0.0], {"period": "x"}),
            ns.OptionError,
            r"a number, or an expression in the parameters \['f', 'W'\], received 'x'",
        ),
        (
            lambda: (walker(), [0.2, -0.2, 0.4, -0.0158], {"itinerary": [("", "toe")]}),
            ns.OptionError,
            r"an event among \['heelstrike'\] .* received 'toe'",
        ),
        (
            lambda: (welander(), [0.4, 0.3], {"max_iterations": 0}),
            ns.OptionError,
            "max_iterations: expected a positive whole number",
        ),
        (
            lambda: (ns.FilippovSystem([X, Y], field=[Y, -X - Y / 2]), [1.0, 0.0], {}),
            ns.ConvergenceError,
            "shrank the orbit to a point, .* an equilibrium",
        ),
        (
            lambda: (stick_slip(), [1.0, 0.5], {"itinerary": "- s +"}),
            ns.ConvergenceError,
            r"leg 2 \(s, ended by L_F1 h\) to come to its event",
        ),
        (
            lambda: (stick_slip(), [1.0, 0.5], {"itinerary": "- s", "parameters": {"f": 0.0}}),
            ns.DegenerateError,
            "leg 2 .* a two-fold, at",
        ),
    ],
)
def test_what_cannot_be_an_orbit_is_refused_by_leg_and_cause(solve, error, message) -> None:
    system, guess, options = solve()
    with pytest.raises(error, match=message):
        ns.periodic_orbit(system, guess, **options)


def test_a_guess_from_which_trial_steps_overflow_is_no_reason_to_give_up() -> None:
    near = ns.periodic_orbit(stick_slip(), [1.0, 0.5], itinerary="- s")
    far = ns.periodic_orbit(stick_slip(), [1e9, 0.5], itinerary="- s")
    assert far.period == pytest.approx(near.period, rel=1e-12)


def test_a_section_that_is_unknown_is_named_with_those_that_are_known() -> None:
    with pytest.raises(ns.OptionError, match=r"a name of \['h0'\] .* received 'h7'"):
        ns.poincare(forced_friction(), "h7", [1.0, 0.0], count=3)


@pytest.mark.parametrize("word", [3, [("-", "h0", "entry")], [3], [("-", 2)], [[]], [None]])
def test_an_itinerary_that_is_none_is_refused(word) -> None:
    with pytest.raises(ns.OptionError, match=r"itinerary: expected modes, .* or pairs of a mode"):
        ns.periodic_orbit(stick_slip(), [1.0, 0.5], itinerary=word)


@pytest.mark.parametrize(
    ("names", "bounds", "error", "message"),
    [
        (None, [(1, 3), (0.5, 2)], ns.DefinitionError, "parameters: expected two names"),
        (3, [(1, 3), (0.5, 2)], ns.DefinitionError, "parameters: expected two names"),
        (("A", "k", "A"), [(1, 3), (0.5, 2)], ns.DefinitionError, "expected two names"),
        (("A", "k"), None, ns.OptionError, "bounds: expected two pairs of numbers"),
        (("A", "k"), 3.0, ns.OptionError, "bounds: expected two pairs of numbers"),
    ],
)
def test_what_is_no_pair_of_parameters_or_bounds_is_refused(names, bounds, error, message) -> None:
    branch = ns.continue_orbit(ns.periodic_orbit(scalar_relay(), [0.5]), "A", bounds=(1.5, 3.0))
    with pytest.raises(error, match=message):
        ns.continue_bifurcation(branch.events[0], names, bounds=bounds)


@pytest.mark.parametrize("points", [3, [[0.0]], [[float("nan"), 0.0]], [[[0.0, 1.0, 2.0]]]])
def test_attractors_that_are_no_points_are_refused(points) -> None:
    grid = {"x": [0.0, 1.0], "v": 0.0}
    with pytest.raises(
        ns.PointError, match=r"attractors: expected points \(m, 2\) that are finite"
    ):
        ns.basins(stick_slip(), grid, t_end=10.0, attractors=points)
