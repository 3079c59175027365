"""Half an orbit is accepted only where the other half is its mirror image, as a parameter varies too."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.orbit.periodic_cases import scalar_relay

X, V, T = (ca.SX.sym(name) for name in "xvt")


def test_a_forced_orbit_without_the_symmetry_is_refused():
    """A relay under 2.5 cos t + b: odd for b = 0 only, and never the same half a period later."""
    b = ca.SX.sym("b")
    drive = 2.5 * ca.cos(T) + b
    relay = ns.FilippovSystem(
        [X], surface=X, above=[drive - 1], below=[drive + 1], time=T, parameters={b: 0.0}
    )
    half = ns.periodic_orbit(relay, [0.5], symmetry="odd")
    whole = ns.periodic_orbit(relay, [0.5])
    assert half.multipliers == pytest.approx(whole.multipliers, abs=1e-13)
    with pytest.raises(ns.OptionError, match=r"symmetry.*half a forcing period"):
        ns.periodic_orbit(relay, [0.5], symmetry="odd", parameters={"b": 0.01})
    with pytest.raises(ns.OptionError, match="symmetry"):
        ns.periodic_orbit(scalar_relay(), [0.5], symmetry=np.eye(1))
    with pytest.raises(ns.OptionError, match="symmetry"):
        ns.continue_orbit(half, "b", bounds=(-0.1, 0.1))
    event = ns.continue_orbit(ns.periodic_orbit(relay, [0.5]), "b", bounds=(-0.1, 0.1))
    assert not event.events and not any(orbit.symmetric for orbit in event.orbits)


def test_walls_that_are_no_mirror_images_are_refused_and_others_are_not():
    """A forced mass between walls at 1 and -(1 + d), which it leaves with half of its speed."""
    d = ca.SX.sym("d")
    walls = [
        ns.Reset(X - 1, [X, -0.5 * V], direction=1, name="right"),
        ns.Reset(X + 1 + d, [X, -0.5 * V], direction=-1, name="left"),
    ]
    system = ns.FilippovSystem(
        [X, V], field=[V, 2 * ca.cos(2 * T) - 0.1 * V], time=T, resets=walls, parameters={d: 0.0}
    )
    run = ns.simulate(system, [0.0, 1.0], 400.0)
    orbit = ns.periodic_orbit(system, run, symmetry="odd")
    assert [leg.name(system) for leg in orbit.problem.legs] in (["right"], ["left"])
    assert orbit.multipliers == pytest.approx(ns.periodic_orbit(system, run).multipliers, abs=1e-11)
    with pytest.raises(ns.OptionError, match=r"symmetry.*half of the orbit"):
        ns.periodic_orbit(system, run, symmetry="odd", parameters={"d": 0.1})


@pytest.mark.parametrize("matrix", [[[np.nan]], [[2.0]], np.eye(2)])
def test_a_matrix_that_is_no_reflection_is_refused(matrix):
    with pytest.raises(ns.OptionError, match=r"symmetry.*\(1, 1\)"):
        ns.periodic_orbit(scalar_relay(), [0.5], symmetry=matrix)


@pytest.mark.parametrize("level", [0.0, 0.2])
def test_a_surface_that_is_no_mirror_image_is_refused(level):
    """Forced friction on a belt of velocity ``level``: the fields are odd, the surface only at rest."""
    slides = [[V, 2 * ca.cos(1.3 * T) - X - 0.2 * V + sign * 0.3] for sign in (-1, 1)]
    system = ns.FilippovSystem([X, V], surface=V - level, above=slides[0], below=slides[1], time=T)
    half = lambda: ns.periodic_orbit(system, [3.2, 0.0], itinerary="-", symmetry="odd")
    if not level:
        assert half().itinerary == "- +"
        return
    with pytest.raises(ns.OptionError, match=r"symmetry.*h0 = 0"):
        half()
