"""Coefficients at Hopf, doubling and torus points are those of closed forms, and predict the size of what
branches off: of continued orbits, and of iterated maps."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.orbit.periodic_cases import symbols, table

X, Y, Z, C, R = symbols("x y z c r")


def ticking(states, maps, **parameters):
    """A map as a system that stands still between the ticks of a clock."""
    return ns.FilippovSystem(
        [*states, C],
        field=[*(0 * s for s in states), 1],
        resets=ns.Reset(C - 1, [*maps, 0], 1, "tick"),
        parameters={R: parameters.pop("r")},
    )


def turning(growth, parameters, speed=2):
    """r' = growth r in the plane, and a rotation."""
    field = [growth * X - speed * Y, growth * Y + speed * X]
    return ns.FilippovSystem([X, Y], field=field, parameters=parameters)


def fixed(system, point):
    return ns.periodic_orbit(system, [*point, 0.0], itinerary=[("", "tick")])


def test_the_logistic_map_doubles_with_the_coefficient_nine():
    """f'' = -6 and f''' = 0 at r = 3: (f''/2)^2 + f'''/6 = 9."""
    orbit = fixed(ticking([Y], [R * Y * (1 - Y)], r=2.8), [1 - 1 / 2.8])
    (event,) = ns.continue_orbit(orbit, "r", bounds=(2.5, 3.3)).events
    assert event.coefficients["cubic coefficient"] == pytest.approx(9.0, rel=1e-9)
    assert event.far_side.verdict.endswith("(supercritical, stable)")
    assert event.coefficients["its error"] < 1e-8


def test_doubled_orbits_meet_the_doubling_of_the_single_one():
    """From r = 3.2 down: both halves become one at r = 3."""
    system = ticking([Y], [R * Y * (1 - Y)], r=3.2)
    twice = [("", "tick"), ("", "tick")]
    orbit = ns.periodic_orbit(system, [0.513, 0.0], itinerary=twice)
    events = ns.continue_orbit(orbit, "r", bounds=(2.5, 3.3)).events
    event = next(e for e in events if e.kind == "period doubling")
    assert abs(event.parameter - 3) < 1e-9 and len(event.orbit.legs) == 1
    assert event.coefficients["cubic coefficient"] == pytest.approx(9.0, rel=1e-6)
    assert [e.kind for e in events] == ["period doubling"]  # beyond are the same orbits
    single = ns.continue_orbit(event.orbit, "r", bounds=(2.5, 3.3))
    assert single[2.8].legs[0].start[0] == pytest.approx(1 - 1 / 2.8, rel=1e-12)


@pytest.mark.slow
def test_the_third_doubling_of_the_walker_has_its_coefficient_too():
    """The orbits beside it hold in a small neighbourhood only."""
    problem = ns.textbook.simplest_walker()
    orbit = ns.periodic_orbit(problem.system, problem.start, itinerary=[("", "heelstrike")])
    values = []
    for _ in range(3):
        branch = ns.continue_orbit(orbit, "gamma", bounds=(0.009, 0.0185))
        orbit = next(e for e in branch.events if e.kind == "period doubling")
        values.append(orbit.parameter)
        assert orbit.far_side.verdict.endswith("(supercritical, stable)")
    assert (
        4.5 < (values[1] - values[0]) / (values[2] - values[1]) < 6
    )  # Feigenbaum: 4.669 in the limit


@pytest.mark.parametrize(
    ("image", "coefficient", "verdict", "error"),
    [
        (-R * Y - Y**3, -1.0, "(subcritical)", 1e-9),
        (-R * Y * ca.sqrt(1 - (Y / 1e-5) ** 2), 0.5e10, "(supercritical, stable)", 1e-7),
    ],
)
def test_a_doubling_has_the_coefficient_of_its_map(image, coefficient, verdict, error):
    """x -> -r x + c x^3 + ... at r = 1; the second map is defined beside x = 0 only."""
    orbit = fixed(ticking([Y], [image], r=0.8), [0.0])
    (event,) = ns.continue_orbit(orbit, "r", bounds=(0.5, 1.3)).events
    assert event.kind == "period doubling" and abs(event.parameter - 1) < 1e-12
    assert event.coefficients["cubic coefficient"] == pytest.approx(coefficient, rel=error)
    assert event.far_side.verdict.endswith(verdict)


def test_the_torus_of_the_delayed_logistic_map_has_the_predicted_radius():
    """(y, z) -> (r y (1 - z), y): angle pi/3 at r = 2, |multiplier|^2 = r - 1."""
    orbit = fixed(ticking([Y, Z], [R * Y * (1 - Z), Y], r=1.8), [1 - 1 / 1.8] * 2)
    (event,) = ns.continue_orbit(orbit, "r", bounds=(1.5, 2.2)).events
    assert event.kind == "Neimark-Sacker" and abs(event.coefficients["angle"] - np.pi / 3) < 1e-10
    value = event.coefficients["first Lyapunov coefficient"]
    errors = []
    for r in (2.002, 2.0005):
        y, z = 0.5, 0.5 + 0.03
        seen = []
        for k in range(80_000):
            y, z = r * y * (1 - z), y
            if k > 60_000:
                seen.append(y)
        radius = (max(seen) - min(seen)) / 4 * np.sqrt(2)  # y = 2 Re z q, |q_y| = 1/sqrt 2
        predicted = np.sqrt((np.sqrt(r - 1) - 1) / -value)
        errors.append(abs(radius / predicted - 1))
    assert errors[0] < 0.03 and errors[1] < 0.4 * errors[0]


def test_a_strong_resonance_has_no_such_coefficient():
    """(y, z) -> (-r z + y^2, y): multipliers +-i at r = 1."""
    orbit = fixed(ticking([Y, Z], [-R * Z + Y**2, Y], r=0.8), [0.0, 0.0])
    (event,) = ns.continue_orbit(orbit, "r", bounds=(0.5, 1.3)).events
    assert "a strong resonance" in event.far_side.verdict


def split(event, name, bounds, value):
    """Half the distance of the two halves of a doubled orbit, squared, and the multiplier of the single one."""
    single = event.orbit
    doubled = ns.continue_orbit(event, name, bounds=bounds)[value]
    legs = len(doubled.legs) // 2
    first, second = (doubled.evaluation.starts[k] for k in (0, legs))
    apart = first - second
    if single.problem.forcing is not None:
        apart[-1] += single.period
    return float(apart @ apart) / 4


@pytest.mark.parametrize(
    "case", ["ball on a table", pytest.param("buck converter", marks=pytest.mark.slow), "walker"]
)
def test_doubled_orbits_separate_as_the_coefficient_predicts(case):
    """The half distance e of the two halves obeys c e^2 = -1 - (multiplier of the single orbit)."""
    if case == "ball on a table":
        name, low, high = "A", 1.0, 1.2
        orbit = ns.periodic_orbit(
            table(), [0.65, 3.14], t_start=0.7, itinerary=[("", "reset")], parameters={"A": 1.0}
        )
    elif case == "buck converter":
        name, low, high = "E", 23.0, 26.0
        problem = ns.textbook.buck_converter()
        orbit = ns.periodic_orbit(problem.system, problem.start, parameters={"E": 23.0})
    else:
        name, low, high = "gamma", 0.009, 0.018
        problem = ns.textbook.simplest_walker()
        orbit = ns.periodic_orbit(problem.system, problem.start, itinerary=[("", "heelstrike")])
    branch = ns.continue_orbit(orbit, name, bounds=(low, high))
    event = next(e for e in branch.events if e.kind == "period doubling")
    c = event.coefficients["cubic coefficient"]
    assert event.coefficients["its error"] < 1e-4 * abs(c)
    errors = []
    for part in (0.02, 0.005):
        value = event.parameter + np.sign(c) * part * 0.1 * (high - low)
        beyond = -1 - np.min(branch[value].multipliers.real)
        squared = split(event, name, (low, high), value)
        errors.append(abs(c * squared / beyond - 1))
    assert errors[1] < 0.02 and errors[1] < 0.5 * errors[0] + 1e-6
    assert event.far_side.verdict.endswith("(supercritical, stable)") == (c > 0)


def brusselator():
    return ns.FilippovSystem(
        [X, Y], field=[1 - (R + 1) * X + X**2 * Y, R * X - X**2 * Y], parameters={R: 1.5}
    )


def test_orbits_around_a_hopf_point_grow_as_its_coefficient_predicts():
    """The Brusselator with A = 1: Hopf at B = 2, frequency 1, eigenvalue (B - 2)/2 + i w."""
    branch = ns.continue_equilibrium(brusselator(), [1.0, 1.5], "r", bounds=(1.0, 3.0))
    (event,) = branch.events
    assert event.kind == "Hopf" and abs(event.parameter - 2) < 1e-12
    assert event.coefficients["frequency"] == pytest.approx(1.0, rel=1e-12)
    value = event.coefficients["first Lyapunov coefficient"]
    assert value < 0 and event.far_side.verdict.endswith("(supercritical, stable)")
    cycles = ns.continue_orbit(event, "r", bounds=(1.0, 3.0))
    q = np.linalg.eig(np.array([[1.0, 1.0], [-2.0, -1.0]]))[1][:, 0]
    errors = []
    for beyond in (0.02, 0.005):
        run = cycles[2.0 + beyond].trajectory
        x = run(np.linspace(run.t[0], run.t[-1], 2001))[:, 0]
        size = (x.max() - x.min()) / 4 / abs(q[0])  # x = 2 Re z q
        errors.append(abs(size / np.sqrt(beyond / 2 / -value) - 1))
    assert errors[1] < 0.02 and errors[1] < 0.4 * errors[0]


def test_a_sliding_flow_on_a_bent_surface_has_the_coefficient_of_its_flow_in_the_plane():
    """On z = (x^2 + x y)/2 the sliding flow is the radial one, r' = mu r - 3 r^3; q has length one in space."""
    flow = [
        R * X - 2 * Y - 3 * X * (X**2 + Y**2) + X * Y,
        2 * X + R * Y - 3 * Y * (X**2 + Y**2) - X**2,
    ]
    bend = (X**2 + X * Y) / 2
    along = flow[0] * ca.jacobian(bend, X) + flow[1] * ca.jacobian(bend, Y)
    values = []
    for surface, climb in ((Z - bend, along), (Z, 0)):
        system = ns.FilippovSystem(
            [X, Y, Z],
            surface=surface,
            above=[*flow, climb - 1 - X / 2],
            below=[*flow, climb + 1],
            parameters={R: -0.5},
        )
        branch = ns.continue_equilibrium(system, [0, 0, 0], "r", bounds=(-1, 1), side=None)
        (event,) = branch.events
        assert abs(event.coefficients["frequency"] - 2) < 1e-12
        values.append(event.coefficients["first Lyapunov coefficient"])
    plane = ns.FilippovSystem([X, Y], field=flow, parameters={R: -0.5})
    (event,) = ns.continue_equilibrium(plane, [0.0, 0.0], "r", bounds=(-1, 1)).events
    values.append(event.coefficients["first Lyapunov coefficient"])
    assert values == pytest.approx([values[-1]] * 3, rel=1e-9)


def test_a_curve_of_hopf_points_has_its_bautin_point():
    """r' = r (mu + nu r^2 - r^4): the coefficient of the Hopf point at mu = 0 is nu, and cycles fold at
    mu = -nu^2/4 where nu > 0."""
    mu, nu = symbols("mu nu")
    square = X * X + Y * Y
    system = turning(mu + nu * square - square**2, {mu: -0.3, nu: 0.5})
    branch = ns.continue_equilibrium(system, [0.0, 0.0], "mu", bounds=(-1, 1))
    (event,) = branch.events
    assert event.far_side.verdict.endswith("(subcritical)")
    # |z|^2 = r^2/2 for an eigenvector of length one, and l1 is over the frequency
    assert event.coefficients["first Lyapunov coefficient"] == pytest.approx(0.5 * 2 / 2, rel=1e-9)
    curve = ns.continue_bifurcation(event, ("mu", "nu"), bounds=[(-1, 1), (-1, 1)])
    ((kind, values),) = [(point.kind, point.values) for point in curve.special]
    assert kind == "Bautin" and np.abs(values).max() < 1e-12
    (fold,) = ns.continue_orbit(event, "mu", bounds=(-1, 1)).events
    assert fold.kind == "fold" and fold.parameter == pytest.approx(-(0.5**2) / 4, rel=1e-9)


@pytest.mark.parametrize("cubic", [0.0, 1e-9, -1e-9])
@pytest.mark.parametrize("size", [1.0, 1e4])
def test_a_hopf_point_without_its_cubic_term_has_no_direction(cubic, size):
    """r' = r (mu + c r^2 - r^4) with r in units of ``size``: of c = 0 nothing says whether cycles are stable."""
    square = (X * X + Y * Y) / size**2
    system = turning(R + cubic * square - square**2, {R: -0.3})
    (event,) = ns.continue_equilibrium(system, [0.0, 0.0], "r", bounds=(-1, 1)).events
    words = "degenerate to rounding" if cubic == 0.0 else "subcritical" if cubic > 0 else "stable)"
    assert event.kind == "Hopf" and words in event.far_side.verdict


def test_a_linear_centre_is_degenerate():
    system = turning(R, {R: -0.4}, speed=3)
    (event,) = ns.continue_equilibrium(system, [0.0, 0.0], "r", bounds=(-1, 1)).events
    assert event.far_side.verdict.endswith("imaginary axis: degenerate to rounding")


def test_a_curve_of_doublings_has_the_point_where_it_becomes_subcritical():
    """x -> -(1 + m) x + n x^3 - x^5: c = n along m = 0."""
    m, n = symbols("m n")
    system = ns.FilippovSystem(
        [X, C],
        field=[0 * X, 1],
        resets=ns.Reset(C - 1, [-(1 + m) * X + n * X**3 - X**5, 0], 1, "tick"),
        parameters={m: -0.2, n: 0.5},
    )
    orbit = fixed(system, [0.0])
    (event,) = ns.continue_orbit(orbit, "m", bounds=(-0.5, 0.5)).events
    assert event.coefficients["cubic coefficient"] == pytest.approx(0.5, rel=1e-8)
    curve = ns.continue_bifurcation(event, ("m", "n"), bounds=[(-1, 1), (-1, 1)])
    ((kind, values),) = [(point.kind, point.values) for point in curve.special]
    assert kind == "degenerate period doubling" and np.abs(values).max() < 1e-8


@pytest.mark.slow
def test_asymmetric_orbits_separate_as_the_coefficient_of_the_pitchfork_predicts():
    """Duffing's oscillator: half the distance e of a state from the mirror image of that half a period later
    obeys c e^2 = -1 - (multiplier of the half map of the symmetric orbit)."""
    t, F = symbols("t F")
    system = ns.FilippovSystem(
        [X, Y], field=[Y, -0.2 * Y - X**3 + F * ca.cos(t)], parameters={F: 2.3}, time=t
    )
    run = ns.simulate(system, [1.0, 0.0], 200.0)
    orbit = ns.periodic_orbit(system, run, symmetry="odd")
    branch = ns.continue_orbit(orbit, "F", bounds=(2.2, 2.6))
    (event,) = branch.events
    assert event.kind == "pitchfork" and event.far_side.verdict.endswith("(supercritical, stable)")
    parted = ns.continue_orbit(event, "F", bounds=(2.2, 2.6))
    errors = []
    for beyond in (0.01, 0.0025):
        found = parted.at(event.parameter + beyond)[0].trajectory
        half = (found(found.t[0]) + found(found.t[0] + np.pi)) / 2
        smallest = branch[event.parameter + beyond].half_multipliers.real.min()
        predicted = (-1 - smallest) / event.coefficients["cubic coefficient"]
        errors.append(abs(half @ half / predicted - 1))
    assert errors[1] < 0.3 * errors[0] < 0.003
    # from orbits without the symmetry, and from symmetric ones that were not solved for as halves
    for near in (parted.at(event.parameter + 0.01)[0], ns.periodic_orbit(system, run)):
        reached = ns.continue_orbit(near, "F", bounds=(2.25, 2.45)).events
        again = next(e for e in reached if abs(e.parameter - event.parameter) < 1e-4)
        assert again.kind == "pitchfork" and again.orbit.symmetric
        assert again.parameter == pytest.approx(event.parameter, abs=1e-7)
        assert again.far_side.verdict == event.far_side.verdict
    assert ns.continue_orbit(again, "F", bounds=(2.2, 2.6)).at(event.parameter + 0.01)
