"""An interrupted proof keeps its results; wrong starts, speeds and ranges raise errors."""

from dataclasses import replace

import casadi as ca
import pytest

import bounce
import bounce.maps.proven as proven_module
import nonsmooth as ns

x, y = ca.SX.sym("x"), ca.SX.sym("y")
FALL = ns.FilippovSystem([x, y], surface=y, above=[1, -1], below=[1, 1])
TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)


@pytest.mark.parametrize("inside", [False, True])
def test_a_map_of_proofs_keeps_its_decided_pieces(monkeypatch, inside):
    """Also where the interrupt comes inside a proof, which then ends undecided."""
    real, calls = proven_module.certify, []

    def certify(*args, **options):
        calls.append(args)
        if len(calls) == 4 and inside:
            return replace(real(*args, **options), proven=False, why="interrupted")
        if len(calls) == 4:
            raise KeyboardInterrupt
        return real(*args, **options)

    monkeypatch.setattr(proven_module, "certify", certify)
    found = bounce.maps.proven_map(TURF, xdot=(0.2, 0.26), omega=(0.6, 0.7), depth=1)
    assert found.interrupted and len(calls) == 4
    sizes = (found.boxes[:, 1] - found.boxes[:, 0]) * (found.boxes[:, 3] - found.boxes[:, 2])
    assert sizes.sum() == pytest.approx(0.06 * 0.1)  # the whole range, decided or not
    assert found.area["undecided"] > 0


@pytest.mark.parametrize("value", [None, 0.3, "ab", (0.0, float("inf"))])
def test_a_range_of_landings_is_two_numbers(value):
    with pytest.raises(bounce.LandingError, match="xdot"):
        bounce.maps.proven_map(TURF, xdot=value, omega=(0.0, 1.0))


@pytest.mark.parametrize("ydot", [0.0, 1.0, None, "down", (-1.0, 0.5)])
def test_a_landing_goes_into_the_ground(ydot):
    with pytest.raises(bounce.LandingError, match="ydot"):
        bounce.certify(TURF, 0.3, ydot, 0.1)


@pytest.mark.parametrize("value", ["much", None, -0.3, (0.1, -0.1)])
def test_a_parameter_is_within_its_limits(value):
    with pytest.raises(ns.ParameterError, match=r"\bmu\b"):
        bounce.certify(TURF, 0.3, -1.0, 0.1, parameters={"mu": value})


def test_a_bounce_that_has_not_ended_is_undecided():
    proof = bounce.certify(TURF, 0.3, -1.0, 0.1, t_max=0.5)
    assert (proof.proven, proof.outcome) == (False, "undecided")
    assert proof.why == "no lift-off until t = 0.5"


@pytest.mark.parametrize(
    ("start", "message"),
    [
        (1.0, "x0"),
        ([1.0], "x0"),
        ([(1.0, 0.0), 1.0], "start of 'x'"),
        ([1.0, (0.0, 1.0, 2.0)], "start of 'y'"),
    ],
)
def test_a_start_is_numbers_or_pairs(start, message):
    with pytest.raises(ns.PointError, match=message):
        ns.certify_orbit(FALL, start, 1.0)


@pytest.mark.parametrize("op", ["fabs", "floor"])
def test_a_field_with_a_kink_is_not_differentiated(op):
    """certify needs the slope of fabs(x) at a point of rest that it is not defined for."""
    bent = ca.fabs(x) if op == "fabs" else ca.floor(x)
    with pytest.raises(ns.NotSmoothError):
        ns.FilippovSystem([x, y], surface=y + 9, above=[bent - x - 1, -y], below=[1, 1])
