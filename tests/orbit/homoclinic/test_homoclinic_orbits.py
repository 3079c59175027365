"""Homoclinic orbits to saddles and pseudo-saddles are those of closed forms, from rough parameters, in one
parameter, in two, and where branches of periodic orbits end."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.orbit.homoclinic import homoclinic_orbits
from nonsmooth.orbit.homoclinic.loops import SaddleLoop
from tests.orbit.interrupts import interrupt, watch_progress
from tests.orbit.periodic_cases import CASES

x, y, c, rho = (ca.SX.sym(s) for s in ("x", "y", "c", "rho"))


@pytest.fixture(scope="module")
def spiral() -> ns.FilippovSystem:
    above = [rho * x - (y - 1), x + rho * (y - 1)]
    return ns.FilippovSystem(
        [x, y], surface=y, above=above, below=[c, 1], parameters={rho: 0.1, c: -0.6}
    )


def close(found: float, digits: str) -> bool:
    return abs(found - float(digits)) <= 1e-12 * abs(float(digits))


def test_h1_is_the_root_of_its_closed_form(spiral: ns.FilippovSystem) -> None:
    values = CASES["H1"]
    found = ns.find_homoclinic(spiral, [-1.4, 0.0], "c", guess=-0.59)
    assert close(found.value, values["c_homoclinic"])
    assert close(found.saddle.point[0], values["x_pseudo_saddle"])
    assert close(found.flight, values["flight"])
    assert close(found.fold[0], values["x_fold"])
    assert close(found.eigenvalue, values["eigenvalue_sliding"])
    assert not found.faults and found.side == "+"
    end = found.trajectory.x[-1]
    assert np.abs(end - found.saddle.point).max() < 1e-11
    assert "Homoclinic orbit to a pseudo-saddle at c = -0.586212601032" in str(found)


def test_the_mirror_image_has_the_same_parameter(spiral: ns.FilippovSystem) -> None:
    below = [rho * x - (-y - 1), -(x + rho * (-y - 1))]
    mirror = ns.FilippovSystem(
        [x, y], surface=y, above=[c, -1], below=below, parameters={rho: 0.1, c: -0.59}
    )
    found = ns.find_homoclinic(mirror, [-1.4, 0.0], "c")
    assert close(found.value, CASES["H1"]["c_homoclinic"]) and found.side == "-"


def test_invalid_arguments_of_find_homoclinic_raise(spiral: ns.FilippovSystem) -> None:
    with pytest.raises(ns.ParameterError, match="'mu'"):
        ns.find_homoclinic(spiral, [-1.4, 0.0], "mu")
    with pytest.raises(ns.ConvergenceError, match="lands"):
        ns.find_homoclinic(spiral, [-1.4, 0.0], "c", guess=-3.0)
    relay = ns.FilippovSystem(
        [x, y],
        surface=x + y,
        above=[y - x, 3 * y - 10],
        below=[y - x, 3 * y + 10],
        parameters={c: 1},
    )
    with pytest.raises(ns.DegenerateError, match="pseudo-saddle"):
        ns.find_homoclinic(relay, [0.5, -0.4], "c")
    z = ca.SX.sym("z")
    solid = ns.FilippovSystem([x, y, z], surface=z, above=[1, 1, -1], below=[1, 1, 1])
    with pytest.raises(ns.ParameterError, match="parameter"):
        ns.find_homoclinic(solid, [0.0, 0.0, 0.0], "c")
    forced = ns.FilippovSystem(
        [x], surface=x, above=[c * ca.cos(z)], below=[1], time=z, parameters={c: 1}
    )
    with pytest.raises(ns.OptionError, match="autonomous"):
        ns.find_homoclinic(forced, [0.0], "c")
    with pytest.raises(ns.PointError, match="saddle"):
        ns.find_homoclinic(oscillator(), [0.0, 0.0, 0.0], "c")
    with pytest.raises(ns.DegenerateError, match="real saddle"):
        ns.find_homoclinic(oscillator(), [1.0, 0.0], "c")
    with pytest.raises(ns.ConvergenceError, match="homoclinic orbit"):
        ns.find_homoclinic(oscillator(), [0.0, 0.0], "c", guess=5.0)


# more dimensions, and saddles -----------------------------------------------------------------------

z, k, mu = (ca.SX.sym(s) for s in ("z", "k", "mu"))


def solid_spiral(shear: float) -> ns.FilippovSystem:
    """H1 with a third state that decays along the surface and is driven in flight, seen sheared."""
    u = x - shear * z
    above = [rho * u - (y - 1), u + rho * (y - 1), 0.3 - 0.5 * z]
    below = [c, 1, -k * z]
    fields = [[f[0] + shear * f[2], f[1], f[2]] for f in (above, below)]
    return ns.FilippovSystem(
        [x, y, z],
        surface=y,
        above=fields[0],
        below=fields[1],
        parameters={rho: 0.1, c: -0.6, k: 0.7},
    )


@pytest.mark.parametrize("shear", [0.0, pytest.param(0.4, marks=pytest.mark.slow)])
def test_a_pseudo_saddle_in_space_is_reached_by_sliding(shear: float) -> None:
    found = ns.find_homoclinic(solid_spiral(shear), [-1.4 + 0.2 * shear, 0.0, 0.2], "c")
    assert abs(found.value - float(CASES["H1"]["c_homoclinic"])) < 1e-12
    assert found.itinerary == "s + s" and not found.faults and found.residual < 1e-12
    flight = found.legs[1].duration
    assert close(flight, CASES["H1"]["flight"])
    last = found.trajectory.x[-1] - found.saddle.point
    assert np.linalg.norm(last) < 1e-4


@pytest.mark.parametrize(
    ("above", "below", "drives"),
    [
        ([1.06, 0.62], [0.35, 0.32], [[0.31, 0.41], [0.11, 0.23]]),
        (
            [0.5, 0.8, 1.1, 1.4],
            [1.3, 0.4, 0.9, 0.6],
            [[0.4, -0.1, 0.1, 0.3], [0.2, 0.4, -0.3, 0.0]],
        ),
    ],
)
def test_a_loop_with_decaying_states_has_the_parameter_of_its_plane(above, below, drives):
    """H1 with states that decay at other rates on each side; it lands nearest to the pseudo-saddle, or comes near later."""
    n = len(above)
    state = ca.SX.sym("w", n + 2)
    turn = np.linalg.qr(np.cos(np.arange((n + 2) ** 2).reshape(n + 2, -1) ** 2))[0]
    turn = turn if n > 2 else np.eye(n + 2)
    own = ca.DM(turn.T) @ state
    u, v, w = own[0], own[1], own[2:]
    fields = [[0.1 * u - (v - 1), u + 0.1 * (v - 1), drives[0] - ca.DM(above) * w]]
    fields += [[c, 1, drives[1] - ca.DM(below) * w]]
    sides = [ca.vertsplit(ca.DM(turn) @ ca.vertcat(*f)) for f in fields]
    system = ns.FilippovSystem(
        ca.vertsplit(state), surface=v, above=sides[0], below=sides[1], parameters={c: -0.6}
    )
    near = ns.find_pseudo_equilibrium(system, turn @ [-1.34, 0.0, *[0.0] * n])
    found = ns.find_homoclinic(system, near, "c")
    assert abs(found.value - float(CASES["H1"]["c_homoclinic"])) < 1e-12
    assert found.itinerary == "s + s" and not found.faults and found.residual < 1e-12


@pytest.mark.slow
def test_curves_of_pseudo_homoclinics_and_their_neutral_saddle() -> None:
    values = CASES["H1"]
    found = ns.find_homoclinic(solid_spiral(0.0), [-1.4, 0.0, 0.2], "c")
    curve = ns.continue_bifurcation(found, ("c", "k"), bounds=[(-1, 0), (0.1, 2)])
    assert np.abs(curve.values[:, 0] - float(values["c_homoclinic"])).max() < 1e-10
    assert curve.ends == (ns.orbit.BranchEnd.REACHED_BOUND,) * 2
    height = float(values["x_pseudo_saddle"]) - 0.1
    alpha = height / (height - 1)
    neutral = (float(values["eigenvalue_sliding"]) - 0.5 * (1 - alpha)) / alpha
    (special,) = curve.special
    assert special.kind == "homoclinic with neutral saddle"
    assert abs(special.values[1] - neutral) < 1e-9


@pytest.mark.slow
def test_planar_and_solid_curves_agree(spiral: ns.FilippovSystem) -> None:
    box = [(-1.0, 0.0), (0.08, 0.12)]
    planar = ns.continue_bifurcation(
        ns.find_homoclinic(spiral, [-1.4, 0.0], "c"), ("c", "rho"), bounds=box
    )
    solid = ns.continue_bifurcation(
        ns.find_homoclinic(solid_spiral(0.0), [-1.4, 0.0, 0.2], "c"), ("c", "rho"), bounds=box
    )
    assert planar.kind == "homoclinic"
    ends = [curve.values[np.argsort(curve.values[:, 0])][[0, -1]] for curve in (planar, solid)]
    assert np.abs(ends[0] - ends[1]).max() < 1e-10
    assert planar.solution(0).value == pytest.approx(planar.values[0][1])


def sandstede(a: float) -> ns.FilippovSystem:
    """Sandstede 1997: at mu = 0 the curve x^2 (1 - x) = y^2 in z = 0 is homoclinic."""
    bend = mu - 0.1 * z
    return ns.FilippovSystem(
        [x, y, z],
        field=[
            a * x + y - a * x**2 + bend * x * (2 - 3 * x),
            x + a * y - 1.5 * x**2 - 1.5 * a * x * y - 2 * bend * y,
            -2 * z + 0.5 * x * z + 0.1 * (x**2 * (1 - x) - y**2),
        ],
        parameters={mu: 0.02},
    )


@pytest.mark.parametrize("a", [pytest.param(-0.2, marks=pytest.mark.slow), 0.2])
def test_a_loop_with_a_closed_form(a: float) -> None:
    found = ns.find_homoclinic(sandstede(a), [0.0, 0.0, 0.0], "mu")
    assert abs(found.value) < 1e-12 and found.complete
    u, v, w = found.trajectory.x.T
    assert max(np.abs(u**2 * (1 - u) - v**2).max(), np.abs(w).max()) < 1e-8
    assert abs(found.saddle_quantity - 2 * a) < 1e-12


def test_an_interrupted_search_returns_the_orbit_that_it_has(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its parameter has an error of the second power, or more, of where it ends; the exact value is 0."""
    system, errors = sandstede(-0.2), []
    for count in range(4):
        with monkeypatch.context() as patch:
            interrupt(patch, SaddleLoop, "prolonged", count)
            found = ns.find_homoclinic(system, [0.0, 0.0, 0.0], "mu")
        assert not found.complete and found.residual < 1e-10
        assert f"interrupted: the orbit ends {found.loop.far:.2g} from the saddle" in str(found)
        errors.append(abs(found.value))
        assert errors[-1] < found.loop.far**2
    assert all(later < 0.3 * earlier for earlier, later in itertools.pairwise(errors))


def test_a_search_interrupted_before_it_has_an_orbit_is_interrupted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    interrupt(monkeypatch, SaddleLoop, "equations", 0)
    with pytest.raises(KeyboardInterrupt):
        ns.find_homoclinic(sandstede(-0.2), [0.0, 0.0, 0.0], "mu")


def test_progress_of_a_search_ends_at_all_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    parts, options = watch_progress(monkeypatch, homoclinic_orbits)
    ns.find_homoclinic(sandstede(-0.2), [0.0, 0.0, 0.0], "mu", progress=True)
    assert len(parts) > 3 and sum(parts[:-1]) == pytest.approx(100.0) and parts[-1] == "closed"
    assert options == [(100, True, "%")]


def test_lorenz_has_his_homoclinic_orbit() -> None:
    system = ns.FilippovSystem(
        [x, y, z],
        field=[10 * (y - x), rho * x - y - x * z, x * y - 8 / 3 * z],
        parameters={rho: 14.5},
    )
    found = ns.find_homoclinic(system, [0.0, 0.0, 0.0], "rho")
    assert abs(found.value - 13.926557) < 1e-6  # Sparrow 1982; Doedel, Krauskopf & Osinga 2006


@pytest.mark.slow
def test_an_orbit_that_comes_along_the_strongly_stable_direction() -> None:
    """The value where orbits of the unstable manifold turn from x > 1 to x < 1: bisection with scipy's DOP853."""
    force = x**2 - 1 + 0.2 * (mu + x) * y + 0.1 * z
    field = [y, force, -0.3 * z + 0.2 * x * y]
    system = ns.FilippovSystem([x, y, z], field=field, parameters={mu: 0.7286})
    found = ns.find_homoclinic(system, [1.0, 0.0, 0.0], "mu")
    assert abs(found.value - 0.728617915451457) < 1e-12


def oscillator() -> ns.FilippovSystem:
    """x'' = x - x^2 + (c + k x) x': Melnikov's c/k = -6/7 for small k, a Hopf point at c = -k."""
    field = [y, x - x**2 + (c + k * x) * y]
    return ns.FilippovSystem([x, y], field=field, parameters={c: -0.85, k: 1.0})


def test_homoclinics_of_a_small_perturbation_are_melnikovs() -> None:
    system, errors = oscillator(), []
    for size in (0.1, 0.2):
        found = ns.find_homoclinic(
            system, [0.0, 0.0], "c", parameters={"k": size, "c": -0.85 * size}
        )
        errors.append(found.value / size + 6 / 7)
    assert abs(errors[0]) < 1e-4 and abs(errors[1] / errors[0] - 4) < 0.1


@pytest.mark.slow
def test_a_branch_from_hopf_to_homoclinic() -> None:
    system, values = oscillator(), {"c": -0.95}
    run = ns.simulate(system, [1.3, 0.0], 80.0, parameters=values)
    branch = ns.continue_orbit(
        ns.periodic_orbit(system, run, parameters=values), "c", bounds=(-1.2, -0.5)
    )
    hopf, homoclinic = branch.events
    assert (hopf.kind, homoclinic.kind) == ("Hopf", "homoclinic")
    assert branch.ends[1] is ns.orbit.BranchEnd.PERIOD_DIVERGES
    assert abs(hopf.parameter + 1) < 1e-12
    # the orbits themselves, of finite period, come as near as exp(-T) to it
    assert abs(branch.values[-1] - homoclinic.parameter) < 1e-5
    curve = ns.continue_bifurcation(homoclinic, ("c", "k"), bounds=[(-2, 0), (0.1, 1.2)])
    low = curve.values[np.argmin(curve.values[:, 1])]
    assert abs(low[0] / low[1] + 6 / 7) < 1e-4


def test_orbits_are_followed_from_a_hopf_point_to_their_grazing() -> None:
    """Circles of the radius sqrt(m) touch x = -0.8 at m = 0.64."""
    size = x * x + y * y
    above = [mu * x - y - x * size, x + mu * y - y * size]
    system = ns.FilippovSystem(
        [x, y], surface=x + 0.8, above=above, below=[1, 0], parameters={mu: -0.3}
    )
    (hopf,) = ns.continue_equilibrium(system, [0.1, 0.1], "mu", bounds=(-0.5, 1)).events
    branch = ns.continue_orbit(hopf, "mu", bounds=(-0.5, 1))
    assert abs(np.linalg.norm(branch[0.3].start) - np.sqrt(0.3)) < 1e-12
    assert abs(branch[0.3].period - 2 * np.pi) < 1e-12
    (grazing,) = branch.events
    assert grazing.kind == "grazing-sliding" and abs(grazing.parameter - 0.64) < 1e-12
    assert branch[0.9].itinerary == "+ s" and not branch[0.9].is_virtual


def test_no_solution_is_searched_for_far_from_the_guess():
    """Where Newton's method diverges, of arctan(v - 3), damped steps integrate no loop beyond ten of its sizes."""
    seen = list[float]()
    loop = SimpleNamespace(scales=np.ones_like, iterations=0)

    def equations(v):
        seen.append(float(abs(v[0])))
        return np.arctan(v - 3.0), np.array([[1 / (1 + (v[0] - 3.0) ** 2)]])

    loop.equations = equations
    with pytest.raises(ns.ConvergenceError):
        homoclinic_orbits._solved(loop, np.zeros(1), "c", 30)
    far = sum(value > 10 for value in seen)
    found = homoclinic_orbits._solved(loop, np.zeros(1), "c", 30, damped=True)
    assert abs(found[0] - 3.0) < 1e-12 and sum(value > 10 for value in seen) == 2 * far
