"""Branches of periodic orbits: every bifurcation is at its reference value, from both sides, and the
orbits beyond it are those that a search finds there."""

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq, fsolve

import nonsmooth as ns
from nonsmooth.orbit.branches import orbit_branches
from tests.orbit.interrupts import interrupt
from tests.orbit.periodic_cases import (
    CASES,
    excited_oscillator,
    forced_friction,
    friction_oscillator,
    grazing_circle,
    impact_oscillator,
    kinds,
    relay,
    scalar_relay,
    symbols,
    table,
    walker,
    welander,
)


def number(case, name):
    return float(CASES[case][name])


def digits(case, name):
    return pytest.approx(number(case, name), rel=1e-12, abs=0)


def crossing():
    system = scalar_relay()
    return ns.periodic_orbit(system, ns.simulate(system, [0.5], 60))


@pytest.fixture(scope="module")
def forced():
    """x' = A cos t - k sgn x from crossing orbits through sliding ones to rest."""
    return ns.continue_orbit(crossing(), "A", bounds=(0.8, 3.0))


def test_crossing_sliding_and_adding_sliding_of_a_forced_relay(forced):
    assert kinds(forced) == ["adding-sliding", "crossing-sliding"]
    adding, crossing = forced.events
    assert crossing.parameter == digits("F1", "A_crossing_sliding")
    assert adding.parameter == digits("F2", "ADDING_SLIDING_A")
    assert [len(orbit.legs) for orbit in (crossing.orbit, adding.orbit)] == [2, 1]
    assert crossing.far_side.itinerary.split() == ["-", "s", "+", "s"]
    assert forced.ends == (ns.orbit.BranchEnd.REACHED_BOUND,) * 2


def test_orbits_beyond_an_event_have_the_reference_values(forced):
    sliding = forced[1.5]
    flights = [leg.duration for leg in sliding.legs if leg.mode != "s"]
    slides = [leg.duration for leg in sliding.legs if leg.mode == "s"]
    assert np.abs(np.array(flights) - number("F2", "flight")).max() < 1e-12
    assert np.abs(np.array(slides) - number("F2", "slide")).max() < 1e-12
    assert not sliding.is_virtual and sliding.stability == "superstable"
    assert abs(forced[2.5].multipliers[0] - number("F1", "multiplier")) < 1e-12


def test_an_orbit_that_slides_all_the_time_is_superstable(forced):
    """x = 0 attracts: the sliding field keeps x whatever it is, but x is no neighbour's to choose."""
    rest = forced[0.9]
    assert rest.itinerary == "s" and rest.stability == "superstable"
    assert rest.error_estimate < 1e-12


def test_the_branch_can_stop_at_the_event():
    branch = ns.continue_orbit(crossing(), "A", bounds=(1.5, 3.0), through=False)
    assert branch.ends == (ns.orbit.BranchEnd.EVENT, ns.orbit.BranchEnd.REACHED_BOUND)
    assert abs(branch.values[0] - number("F1", "A_crossing_sliding")) < 1e-12


def test_points_are_counted_on_each_side_of_the_start_through_events(forced):
    start = ns.periodic_orbit(forced.orbits[-1].system, [0.5])
    branch = ns.continue_orbit(start, "A", bounds=(0.5, 3.0), step=0.01, max_points=30)
    assert kinds(branch) == ["crossing-sliding"] and branch.values[29] == start.parameters["A"]
    assert branch.ends[0] is ns.orbit.BranchEnd.TOO_MANY_POINTS


@pytest.mark.parametrize("inside", [True, False])
def test_grazing_sliding_of_a_circle_from_either_side(inside):
    """A_i = 0 in the plane: from a stable orbit always persistence."""
    system = grazing_circle()
    d = 0.9 if inside else 1.1
    start = [0.0, 0.5] if inside else [0.9, 0.0]
    orbit = ns.periodic_orbit(system, ns.simulate(system, start, 40, parameters={"d": d}))
    branch = ns.continue_orbit(orbit, "d", bounds=(0.85, 1.15))
    (event,) = branch.events
    assert event.kind == "grazing-sliding"
    assert event.parameter == digits("F5", "d_grazing_sliding")
    assert event.far_side.verdict == "persistence"
    assert abs(event.coefficients["det(I - A_i)"] - 1) < 1e-9
    assert abs(event.coefficients["radius of A_o"] - number("F5", "multiplier_before")) < 1e-12
    assert abs(branch[0.9].period - number("F5", "period")) < 1e-11
    assert abs(branch[1.1].period - number("F5", "period_before")) < 1e-11


def test_fold_and_period_doubling_of_a_ball_on_a_table():
    orbit = ns.periodic_orbit(table(), [0.26, 3.1], t_start=0.64, itinerary=[("", "reset")])
    branch = ns.continue_orbit(orbit, "A", bounds=(0.3, 1.2))
    assert kinds(branch) in (["fold", "period doubling"], ["period doubling", "fold"])
    found = {event.kind: event.parameter for event in branch.events}
    assert found["fold"] == digits("I1", "A_fold")
    assert found["period doubling"] == digits("I1", "A_period_doubling")


def test_neimark_sacker():
    orbit = ns.periodic_orbit(
        excited_oscillator(), [-0.1, -1.1], t_start=1.3, itinerary=[("", "reset")]
    )
    (event,) = ns.continue_orbit(orbit, "d", bounds=(0.02, 0.06)).events
    assert event.kind == "Neimark-Sacker"
    assert event.parameter == digits("I4", "d_NS")
    assert event.orbit.multipliers.sum().real == digits("I4", "trace")
    pair = CASES["I4"]["multipliers"][0]
    expected = np.arctan2(abs(float(pair["im"])), float(pair["re"]))
    assert abs(event.coefficients["angle"] - expected) < 1e-11


def test_grazing_sliding_that_leads_to_chaos():
    """Kowalczyk & di Bernardo 2005: the derivatives with and without contact, and what follows."""
    nu = number("K1", "nu_grazing")
    orbit = ns.periodic_orbit(friction_oscillator(), [2.19, -0.42], parameters={"nu": nu + 1e-3})
    branch = ns.continue_orbit(orbit, "nu", bounds=(nu - 1e-4, nu + 1.1e-3))
    (event,) = branch.events
    assert event.kind == "grazing-sliding" and event.parameter == digits("K1", "nu_grazing")
    for found, value in zip(event.orbit.start, CASES["K1"]["start"], strict=True):
        assert found == pytest.approx(float(value), rel=1e-12, abs=0)
    # the time of a minimum has half of the digits
    assert event.orbit.margins[0].t == pytest.approx(number("K1", "graze_time"), rel=1e-12)
    outer = [float(v) for v in CASES["K2"]["A_out_eigenvalues"]]
    inner = [float(v) for v in CASES["K2"]["A_in_eigenvalues"]]
    numbers = event.coefficients
    assert abs(numbers["det(I + A_o)"] - np.prod(1 + np.array(outer))) < 1e-9
    assert abs(numbers["det(I + A_i)"] - np.prod(1 + np.array(inner))) < 1e-9
    assert "unstable orbit of twice the period" in event.far_side.verdict
    assert "chaos" in event.far_side.verdict


def test_the_walker_doubles_its_step_and_the_new_gait_is_found():
    """Garcia, Chatterjee, Ruina & Coleman 1998: period two from about 0.015 on."""
    system, state = walker(), [0.2003, -0.1998, 0.4006, -0.0158]
    orbit = ns.periodic_orbit(system, state, itinerary=[("", "heelstrike")])
    (event,) = ns.continue_orbit(orbit, "gamma", bounds=(0.008, 0.018)).events
    assert event.kind == "period doubling" and abs(event.parameter - 0.0151) < 5e-5
    double = ns.continue_orbit(event, "gamma", bounds=(0.0149, 0.0165))
    orbit = double[0.016]
    assert len(orbit.legs) == 2 and "asymptotically stable" in orbit.stability
    steps = [leg.duration for leg in orbit.legs]
    assert abs(steps[0] - steps[1]) > 1e-2
    again = ns.periodic_orbit(
        system, orbit.start, itinerary=[("", "heelstrike")] * 2, parameters={"gamma": 0.016}
    )
    assert abs(again.period - orbit.period) < 1e-11


def test_crossing_sliding_of_dry_friction_by_its_symmetry_and_without_it():
    system = forced_friction()
    run = ns.simulate(system, [1.5, 0.0], 100.0)
    half = ns.periodic_orbit(system, run, symmetry="odd")
    (event,) = ns.continue_orbit(half, "f", bounds=(0.15, 0.6)).events
    assert event.kind == "crossing-sliding"
    whole = ns.periodic_orbit(system, run)
    (twin,) = ns.continue_orbit(whole, "f", bounds=(0.15, 0.6)).events
    assert twin.kind == "crossing-sliding"
    assert abs(twin.parameter - event.parameter) < 1e-12


@pytest.mark.parametrize("hits", [False, True])
def test_impact_grazing_of_a_forced_oscillator_from_either_side(hits):
    """x'' + 2 z x' + x = F cos w t touches the wall x = 1 where F^2 = (1 - w^2)^2 + 4 z^2 w^2."""
    system, w, z = impact_oscillator(), 0.8, 0.05
    if hits:
        orbit = ns.periodic_orbit(system, [1.0, -0.32], t_start=0.088, itinerary=[("o", "impact")])
    else:
        rest = ns.simulate(system, [0, 0], 300, parameters={"F": 0.35}).x[-1]
        run = ns.simulate(system, rest, 360, t_start=300, parameters={"F": 0.35})
        orbit = ns.periodic_orbit(system, run, parameters={"F": 0.35})
    branch = ns.continue_orbit(orbit, "F", bounds=(0.33, 0.505))
    (event,) = branch.events
    assert event.kind == "impact grazing"
    assert abs(event.parameter - np.hypot(1 - w * w, 2 * z * w)) < 1e-12
    assert "square root" in event.far_side.verdict
    free = 2 * np.pi / w  # the orbit without an impact decays as exp(-z t), turning
    assert abs(event.coefficients["leading multiplier"] - np.exp(-z * free)) < 1e-11
    turn = np.angle(np.exp(1j * np.sqrt(1 - z * z) * free))
    assert abs(abs(event.coefficients["its angle"]) - abs(turn)) < 1e-9
    assert branch.ends == (ns.orbit.BranchEnd.REACHED_BOUND,) * 2
    assert "asymptotically stable" in branch[0.34].stability
    assert "unstable" in branch[0.45].stability and branch[0.45].legs[0].event == "impact"
    assert abs(branch[0.5].multipliers[0] - float(CASES["I2"]["multipliers"][0])) < 1e-10


@pytest.mark.parametrize("calls", [1, 2, 3, 4, 5, 40, 90])
def test_an_interrupt_returns_what_was_computed(monkeypatch, calls):
    orbit = crossing()
    interrupt(monkeypatch, type(orbit.problem), "evaluate", calls - 1, once=True)
    branch = ns.continue_orbit(orbit, "A", bounds=(0.8, 3.0), progress=True)
    assert ns.orbit.BranchEnd.INTERRUPTED in branch.ends
    assert len(branch) >= calls // 10
    assert np.all(np.isfinite(branch.values))


@pytest.mark.slow
def test_the_relays_sliding_bifurcations():
    """The values of a half orbit; the short slide grazes, an exit is added."""
    system = relay()
    run = ns.simulate(system, [0.0, -0.001, -0.02], t_end=40.0)
    orbit = ns.periodic_orbit(system, run, symmetry="odd")
    branch = ns.continue_orbit(orbit, "w", bounds=(24.0, 25.3))
    assert kinds(branch) == ["adding-sliding", "grazing-sliding"]
    for event in branch.events:  # where each is, the orbits on both sides are real
        for side in (-1e-3, 1e-3):
            assert not branch[event.parameter + side].is_virtual
    counts = [len(branch[w].legs) for w in (24.01, 24.6, 25.2)]
    assert counts == [24, 28, 24]


def test_a_period_that_diverges_ends_a_branch():
    orbit = ns.periodic_orbit(welander(), [0.4, 0.3])
    branch = ns.continue_orbit(orbit, "eps", bounds=(-0.05, -0.005))
    assert branch.ends[0] is ns.orbit.BranchEnd.PERIOD_DIVERGES


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (dict(parameter="kappa"), ns.DefinitionError, "kappa"),
        (dict(bounds=(3, 4)), ns.OptionError, "bounds"),
        (dict(step=0), ns.OptionError, "step"),
        (dict(orbit="orbit"), ns.DefinitionError, "PeriodicOrbit"),
    ],
)
def test_bad_input(forced, change, error, words):
    given = {"orbit": forced.orbits[5], "parameter": "A", "bounds": (0.8, 3)} | change
    with pytest.raises(error, match=words):
        ns.continue_orbit(given.pop("orbit"), given.pop("parameter"), **given)


def test_an_event_without_periodic_orbits_is_refused():
    x, y, a = symbols("x y a")
    folded = ns.FilippovSystem(
        [x, y], surface=y, above=[a + x - x**3, 1 - y], below=[1, 1], parameters={a: -1.0}
    )
    event = ns.continue_equilibrium(folded, [-1.3, 1.0], "a", bounds=(-2, 2)).events[0]
    assert event.kind == "fold"
    with pytest.raises(ns.DefinitionError, match="no event from which periodic orbits start"):
        ns.continue_orbit(event, "a", bounds=(-2, 2))


# two harmonics: every kind of sliding bifurcation, one or two at a time ---------------------------


def two_harmonics(symmetry, C, start):
    x, t, A, c, k = symbols("x t A C k")
    drive = A * ca.cos(t) + c * ca.cos(3 * t)
    system = ns.FilippovSystem(
        [x], surface=x, above=[drive - k], below=[drive + k], time=t, parameters={A: 3, c: C, k: 1}
    )
    run = ns.simulate(system, [0.5], 80.0)
    orbit = ns.periodic_orbit(system, run, period=2 * np.pi, symmetry=symmetry)
    return ns.continue_orbit(orbit, "A", bounds=(start, 4.0))


def crossing_by_closed_form(A, C):
    """Crossing orbits begin where A sin t + C/3 sin 3t = -pi/2; what is left of the drive over 1."""
    sines = np.roots([-4 * C / 3, 0, A + C, np.pi / 2])
    t = np.arcsin(sines[(abs(sines.imag) < 1e-9) & (abs(sines) <= 1)].real)
    return np.abs(A * np.cos(t) + C * np.cos(3 * t) - 1).min()


@pytest.mark.parametrize("symmetry", ["odd", pytest.param(None, marks=pytest.mark.slow)])
def test_a_drive_of_two_harmonics_switches_and_adds_slides(symmetry):
    branch = two_harmonics(symmetry, 1.6, 0.9)
    assert kinds(branch) == ["switching-sliding", "adding-sliding", "crossing-sliding"]
    _, adding, crossing = (event.parameter for event in branch.events)
    assert abs(crossing_by_closed_form(crossing, 1.6)) < 1e-12
    # inside a slide the drive comes to -1 where 12 cos^2 t = 3 - A/C
    c = np.sqrt((3 - adding / 1.6) / 12)
    assert abs(adding * c + 1.6 * (4 * c**3 - 3 * c) + 1) < 1e-12
    counts = [len(branch[A].legs) for A in (1.0, 1.2, 1.5, 3.0)]
    assert counts == [10, 8, 4, 2]
    for A in (0.95, 1.0, 1.2, 1.5, 3.0):  # a second method: the orbit attracts
        found, system = branch[A], branch.orbits[0].system
        run = ns.simulate(system, [0.1], 40 * np.pi, parameters={"A": A}, tol=1e-12)
        events = [e.t % (2 * np.pi) for e in run.events if 36 * np.pi < e.t < 38 * np.pi]
        assert len(events) == len(found.legs)
        starts = [leg.t % (2 * np.pi) for leg in found.legs]
        assert np.abs(np.sort(events) - np.sort(starts)).max() < 1e-9


@pytest.mark.parametrize("symmetry", ["odd", pytest.param(None, marks=pytest.mark.slow)])
def test_a_drive_against_its_third_harmonic_grazes_and_adds(symmetry):
    branch = two_harmonics(symmetry, -1.6, 0.35)
    assert kinds(branch) == ["crossing-sliding", "adding-sliding", "grazing-sliding"]
    assert abs(branch.events[1].parameter - 0.6) < 1e-12  # the drive at 0 is A + C = -1
    whole = branch[0.4]
    assert not whole.is_virtual and len(whole.legs) == 12
    grazing = branch.events[2]
    assert [len(branch[grazing.parameter + d].legs) for d in (-1e-3, 1e-3)] == [6, 2]


def test_three_equal_thirds_of_a_forcing_period_are_no_shorter_orbit():
    """On the surface only the clock tells the starts of legs apart."""
    x, t = symbols("x t")
    drive = 0.35 * ca.cos(t) - 1.6 * ca.cos(3 * t)
    system = ns.FilippovSystem([x], surface=x, above=[drive - 1], below=[drive + 1], time=t)
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.1], 125.0), period=2 * np.pi)
    assert len(orbit.legs) == 12 and abs(orbit.period - 2 * np.pi) < 1e-12


@pytest.mark.slow
def test_an_event_at_the_first_leg_of_a_half_orbit_is_that_of_its_own_mode():
    """The slide that ends at w = 31.63 begins the half; before it is the mirror image of the last leg."""
    problem = ns.textbook.multi_sliding_relay()
    at = {"w": 31.0}
    run = problem.run(at, t_end=60.0)
    orbit = ns.periodic_orbit(problem.system, run, parameters=at, symmetry="odd")
    begun = ns.periodic_orbit(problem.system, orbit.legs[0].start, parameters=at, symmetry="odd")
    branch = ns.continue_orbit(begun, "w", bounds=(31.0, 31.8))
    assert kinds(branch) == ["adding-sliding", "grazing-sliding"]
    assert branch.ends == (ns.orbit.BranchEnd.REACHED_BOUND,) * 2
    late = problem.run({"w": 31.8}, t_end=60.0)
    again = ns.periodic_orbit(problem.system, late, parameters={"w": 31.8}, symmetry="odd")
    assert branch[31.8].period == pytest.approx(again.period, rel=1e-12)
    assert len(branch[31.8].legs) == len(again.legs)


def test_an_event_at_which_the_equations_are_singular_is_where_the_branch_is_lost():
    """With the belt's speed b a stick-slip orbit shrinks as b does, x - 1 = b u(t), to a point at b = 0."""
    x, v, b = (ca.SX.sym(name) for name in "xvb")
    slip = v - b
    push = [[v, -x - s + 0.2 * slip] for s in (1, -1)]
    system = ns.FilippovSystem(
        [x, v], surface=slip, above=push[0], below=push[1], parameters={b: 0.5}
    )
    orbit = ns.periodic_orbit(system, [1.0, 0.5])
    branch = ns.continue_orbit(orbit, "b", bounds=(-0.5, 1.0))
    assert len(branch.events) == 1 and 0 <= branch.events[0].parameter < 1e-7
    assert branch[1e-3].period == pytest.approx(orbit.period, rel=1e-11)


def test_through_is_a_boolean():
    half = ns.periodic_orbit(scalar_relay(), [0.5])
    with pytest.raises(ns.OptionError, match="through"):
        ns.continue_orbit(half, "A", bounds=(1.0, 4.0), through="no")


def test_adding_sliding_is_where_it_is_from_the_singular_side_too():
    """Points across a step that are far from it are other orbits: they once put the event at A = 117."""
    orbit = ns.periodic_orbit(scalar_relay(), [-1.3])
    branch = ns.continue_orbit(orbit, "A", bounds=(0.8, 2.6))
    found = {event.kind: event.parameter for event in branch.events}
    assert found == pytest.approx(
        {"adding-sliding": 1.0, "crossing-sliding": np.hypot(1.0, np.pi / 2)}, rel=1e-12
    )
    assert branch.values.min() == 0.8 and branch.values.max() == 2.6


def test_no_event_hides_behind_another_in_a_long_step():
    """A turn of the speed is born inside the flight and touches zero before the flight's start does."""
    x, v, t, f = (ca.SX.sym(s) for s in ("x", "v", "t", "f"))
    pull = ca.cos(0.45 * t) - x
    friction = ns.FilippovSystem(
        [x, v], surface=v, above=[v, pull - f], below=[v, pull + f], parameters={f: 0.15}, time=t
    )
    orbit = ns.periodic_orbit(friction, [1.3, 0.0], symmetry="odd")
    branch = ns.continue_orbit(orbit, "f", bounds=(0.05, 0.5))
    assert kinds(branch) == ["grazing-sliding", "switching-sliding"]
    assert branch.ends == (ns.orbit.BranchEnd.REACHED_BOUND,) * 2
    assert not any(one.is_virtual for one in branch.orbits)
    # the speed along the flight in closed form: x = c + a cos(t - s) + b cos(0.45 t)
    leg, b = branch.events[0].orbit.legs[0], 1 / (1 - 0.45**2)
    (x0, v0), s = leg.start[:2], leg.t
    level = -branch.events[0].parameter if leg.mode == "+" else branch.events[0].parameter
    first = x0 - level - b * np.cos(0.45 * s)
    second = v0 + 0.45 * b * np.sin(0.45 * s)
    time = np.linspace(0.2, 1.5, 200_001)
    speed = second * np.cos(time) - first * np.sin(time)
    speed -= 0.45 * b * np.sin(0.45 * (time + s))
    assert abs((speed if leg.mode == "-" else -speed).max()) < 1e-11
    run = ns.simulate(friction, [1.3, 0.0], 2000.0, parameters={"f": 0.3})
    found = ns.periodic_orbit(friction, run)
    assert [leg.duration for leg in branch[0.3].legs] == pytest.approx(
        [leg.duration for leg in found.legs], abs=1e-10
    )


def test_a_graze_where_a_force_jumps_is_that_for_an_orbit_and_its_mirror_image():
    """Both fields are tangent there, and rounding must not name the two grazes differently."""
    x, v, t, F = (ca.SX.sym(s) for s in ("x", "v", "t", "F"))
    smooth = -0.2 * v - x**3 + F * ca.cos(t)
    system = ns.FilippovSystem(
        [x, v],
        surface=x,
        above=[v, smooth - 0.3],
        below=[v, smooth + 0.3],
        parameters={F: 2},
        time=t,
    )
    orbit = ns.periodic_orbit(system, [0.5, 0.1], symmetry="odd")
    (pitchfork,) = ns.continue_orbit(orbit, "F", bounds=(1.5, 4.0)).events
    branch = ns.continue_orbit(pitchfork, "F", bounds=(1.5, 11.8))
    named = kinds(branch)
    half = ["period doubling", "grazing of a jumping force", *["period doubling"] * 2]
    assert named == [*half, "pitchfork", *half[::-1]]
    first, last = (branch.events[i].parameter for i in (1, -2))
    assert first == pytest.approx(last, rel=1e-11)
    assert branch.ends == (ns.orbit.BranchEnd.REACHED_BOUND,) * 2


@pytest.mark.parametrize("number", [0, 1])
def test_an_event_at_the_start_is_found(forced, number):
    event = forced.events[number]
    low, high = event.parameter - 0.1, event.parameter + 0.1
    branch = ns.continue_orbit(event.orbit, "A", bounds=(low, high))
    assert kinds(branch) == [event.kind]
    assert branch.events[0].parameter == pytest.approx(event.parameter, abs=1e-12)
    assert branch.values.min() == low and branch.values.max() == high


def test_a_leg_that_does_not_exist_beyond_a_bifurcation_ends_no_branch():
    """A drill string with Stribeck friction exp(-slip), of which the slip grows on the side of sticking."""
    phi, top, bit, speed = symbols("phi top bit speed")

    def fields(s):
        torque = s * 13950 * (0.5 + 0.3 * ca.exp(-0.9 * s * bit))
        above = 425 * speed + 1000 * (speed - top) - 425 * top - 473 * phi - 23.2 * (top - bit)
        below = 473 * phi + 23.2 * (top - bit) - 50 * bit - torque
        return [top - bit, above / 2122, below / 374]

    drill = ns.FilippovSystem(
        [phi, top, bit], surface=bit, above=fields(1), below=fields(-1), parameters={speed: 14.0}
    )
    orbit = ns.periodic_orbit(drill, ns.simulate(drill, [0.0] * 3, 400.0))
    branch = ns.continue_orbit(orbit, "speed", bounds=(8.0, 14.8))
    assert kinds(branch) == ["fold", "grazing-sliding", "Hopf"]
    assert branch.events[-1].parameter == pytest.approx(9.0091179621, abs=1e-9)
    assert branch.reasons[0] == "The parameter reached its bound." and "Hopf" in branch.reasons[1]


def test_what_is_raised_at_an_event_is_reported_at_it(monkeypatch):
    def raises(self, zero):
        raise ns.DegenerateError("no such event")

    orbit = crossing()
    monkeypatch.setattr(orbit_branches.OrbitCurve, "event", raises)
    branch = ns.continue_orbit(orbit, "A", bounds=(1.7, 3.0))
    assert kinds(branch) == ["unclassified"] and "no such event" in branch.reasons[0]
    assert len(branch) > 10 and branch.ends[0] is ns.orbit.BranchEnd.EVENT


def test_a_reset_that_changes_nothing_is_added_and_left_out():
    """A relay with hysteresis, u = 1 below -q and -1 above q, whose output c x passes -q again shortly after."""
    rows = [[-1.4, -0.4, -0.41, -0.74], [0.12, -0.29, 1.3, -1.86]]
    A = np.array([*rows, [0.01, 0.74, -0.74, -0.91], [0.68, 1.71, -0.32, -0.83]])
    b, c = np.array([0.77, 0.52, 0.86, 1.21]), np.array([0.54, -0.71, -0.07, 0.36])
    far, one = -np.linalg.solve(A, b), np.eye(4)

    def start(half):  # the other half is the mirror image
        return np.linalg.solve(one + expm(A * half), (expm(A * half) - one) @ far)

    def later(half, t):
        return expm(A * t) @ (start(half) - far) + far

    def touch(v):
        return c @ (later(*v) - start(v[0])), c @ (A @ later(*v) + b)

    corner = brentq(lambda half: c @ (A @ start(half) + b), 1.2, 1.6, xtol=1e-15)
    touching = fsolve(touch, [1.247, 0.398], xtol=1e-12)[0]
    *x, u, q = symbols("x0 x1 x2 x3 u q")
    out, rate = (
        ca.dot(ca.DM(c), ca.vertcat(*x)),
        ca.vertsplit(ca.DM(A) @ ca.vertcat(*x) + ca.DM(b) * u),
    )
    off = ns.Reset(out - q, [*x, -1], direction=1, name="off")
    on = ns.Reset(out + q, [*x, 1], direction=-1, name="on")
    system = ns.FilippovSystem([*x, u], field=[*rate, 0], resets=[off, on], parameters={q: 0.3})
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.1, 0.1, 0.1, 0.1, 1.0], 100.0))
    branch = ns.continue_orbit(orbit, "q", bounds=(0.05, 0.6))
    assert kinds(branch) == ["grazing of a reset", "corner"]
    found = [event.parameter for event in branch.events]
    expected = [-c @ start(touching), -c @ start(corner)]
    assert found == pytest.approx(expected, abs=1e-10)
    assert all("persistence" in event.far_side.verdict for event in branch.events)
    assert branch.ends == (ns.orbit.BranchEnd.REACHED_BOUND,) * 2
    for value in (0.1, 0.16, 0.175, 0.2):
        assert len(branch[value].legs) == (4 if found[0] < value < found[1] else 2)


@pytest.mark.parametrize(
    ("level", "itinerary", "period", "least", "kinds"),
    [
        (1.2, "+ -", 230.4114882, 7.3e-57, ["crossing-sliding", "switching-sliding", "homoclinic"]),
        (1.6, "- + s", 299.95866648, 5.2e-81, ["switching-sliding"]),
        (2.0, "- s", 372.70790638188, 1.2e-106, []),
        (2.3, "-", 381.93555709071, 6.0e-110, ["grazing-sliding"]),
    ],
)
def test_branches_of_relaxation_oscillations(level, itinerary, period, least, kinds):
    """Harvested predators at b = 0.05: the period and the fewest prey by scipy, in logarithms of the states."""
    system, given = ns.textbook.harvested_prey_predator().system, {"alpha": level, "b": 0.3}
    run = ns.simulate(system, [0.5, 0.5], 600.0, parameters=given)
    orbit = ns.periodic_orbit(system, run, parameters=given)
    branch = ns.continue_orbit(orbit, "b", bounds=(0.05, 0.35))
    assert [event.kind for event in branch.events] == kinds
    orbit = branch.orbits[0]
    assert orbit.itinerary == itinerary and orbit.period == pytest.approx(period, rel=1e-10)
    fewest = orbit.trajectory.x[:, 0].min()
    assert np.log(fewest) == pytest.approx(np.log(least), rel=1e-3)
