"""What cannot be a periodic orbit is refused with the leg, what happened and what to try."""

import casadi as ca
import pytest

import nonsmooth as ns
from tests.orbit.periodic_cases import forced_friction, stick_slip, walker, welander

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
