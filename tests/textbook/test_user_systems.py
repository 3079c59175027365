"""The 26 systems of a review by new users: each runs, and its local questions have the answers of closed forms
and of scipy. Tests have the numbers of the review; 16 is in tests/bounce. Runs of 2, 3, 5 to 7,
9 to 12, 14, 19 to 22, 24 and 26 are in testset, tests/cases (runs.json, events.json, stiff.json) and the textbook.
"""

import functools
import math

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import nonsmooth as ns
from nonsmooth import textbook

x, y, z, u, v, w, t = (ca.SX.sym(name) for name in "xyzuvwt")
lam, mu, q, k, s, r = (ca.SX.sym(name) for name in ("lam", "mu", "q", "k", "s", "r"))
REACHED = ns.Status.REACHED_END


def kinds(branch):
    return {event.kind: event.parameter for event in branch.events}


# 1: harvesting above a threshold -------------------------------------------------------------------


@functools.cache
def harvest():
    eat, cap, level = x / (1 + x), ca.SX.sym("K"), ca.SX.sym("T")
    prey = x * (1 - x / cap) - eat * y
    return ns.FilippovSystem(
        [x, y],
        surface=y - level,
        above=[prey, (eat - 0.65) * y],
        below=[prey, (eat - 0.35) * y],
        parameters={level: 0.8, cap: 2.5},
    )


def test_1_pseudo_equilibria_and_folds_of_a_harvested_predator():
    """(1 - x/K)(1 + x) = T while sliding; both fields are tangent where x/(1 + x) is 0.65 and 0.35."""
    rest = ns.find_pseudo_equilibrium(harvest(), [1.7, 0.8])
    assert rest.point[0] == pytest.approx((3 + math.sqrt(17)) / 4, rel=1e-14)
    assert (rest.status, rest.kind) == ("real", "stable pseudo-node")
    for side, effort, near in (("+", 0.65, [1.8, 0.73]), ("-", 0.35, [0.54, 1.2])):
        tangent = effort / (1 - effort)
        fold = ns.find_fold(harvest(), [tangent + 0.1, 0.8], side=side)
        assert fold.point[0] == pytest.approx(tangent, rel=1e-13) and fold.kind == "invisible"
        border = ns.find_boundary_equilibrium(harvest(), near, vary="T", side=side)
        assert border.value == pytest.approx((1 - tangent / 2.5) * (1 + tangent), rel=1e-13)
    branch = ns.continue_equilibrium(harvest(), rest.point, "T", side=None, bounds=(0.75, 1.3))
    found = kinds(branch)
    assert found["pseudo-saddle-node"] == pytest.approx(1.225, rel=1e-13)


# 2: sliding modes of the second order --------------------------------------------------------------


def test_2_twisting_and_super_twisting_rest_where_they_end():
    """A turn of twisting multiplies the speed by 3/7; super-twisting crosses beside its rest."""
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    twisting = ns.FilippovSystem(
        [x, v], surfaces=[x, v], multipliers=[a, b], field=[v, -5 * a - 2 * b]
    )
    assert [twisting.switching(i).slides for i in (0, 1)] == [False, True]
    here = ns.classify(twisting, [0.0, 0.0])
    assert (here.kind, here.label) == ("pseudo-equilibrium", "stable pseudo-node")
    assert ns.local.intersection(twisting, [0.0, 0.0]).attraction == "spiralling in"
    root = ca.sign(x) * ca.sqrt(ca.fabs(x))
    steep = ns.FilippovSystem.from_expression([x, v], [v - 1.5 * root, -1.1 * ca.sign(x)])
    assert not steep.switching().slides
    regions = [str(ns.region(steep, [0.0, speed])) for speed in (0.3, -0.3)]
    assert regions == ["crossing up", "crossing down"]


# 3: boost converter in discontinuous conduction, with a PI controller ----------------------------

SUPPLY, COIL, CAPACITY, LOAD, PERIOD = 16.0, 208e-6, 222e-6, 125.0, 333e-6


@functools.cache
def boost():
    """States current, voltage, integral of the error."""
    clock, on = ns.Clock(PERIOD, name="tick"), (1 - lam) / 2
    duty = 0.27 + k * (25 - v) + 20 * z
    return ns.FilippovSystem(
        [x, v, z],
        field=[(SUPPLY - (1 - on) * v + u) / COIL, ((1 - on) * x - v / LOAD) / CAPACITY, 25 - v],
        surfaces=[clock.phase / PERIOD - duty],
        multipliers=[lam],
        complementarity=ns.Complementarity(x, multiplier=u, name="diode"),
        parameters={k: 0.0128},
        clocks=clock,
    )


def test_3_a_diode_leaves_or_holds_by_its_voltage():
    late, early, border = (
        ns.classify(boost(), [0, 25, 0, part * PERIOD]) for part in (0.9, 0.1, 0.27)
    )
    assert (late.kind, early.kind) == ("closed", "leaving")
    assert late.evidence["multiplier"] == pytest.approx(25 - SUPPLY, rel=1e-12)
    assert early.evidence["multiplier"] == pytest.approx(-SUPPLY, rel=1e-12)
    assert border.kind == "crossing"


# 4: drill string with Stribeck friction ------------------------------------------------------------


@functools.cache
def drill():
    phi, top, bit, speed = (ca.SX.sym(name) for name in ("phi", "top", "bit", "Om"))

    def fields(sign):
        torque = sign * 13950 * (0.5 + 0.3 * ca.exp(-0.9 * sign * bit))
        drive = 425 * speed + 1000 * (speed - top) - 425 * top
        twist = 473 * phi + 23.2 * (top - bit)
        return [top - bit, (drive - twist) / 2122, (twist - 50 * bit - torque) / 374]

    return ns.FilippovSystem(
        [phi, top, bit], surface=bit, above=fields(1), below=fields(-1), parameters={speed: 3.0}
    )


def test_4_rest_break_away_and_the_hopf_point_of_a_drill_string():
    """Stuck: 473 phi = 1425 Om, up to 13950 0.8. Steady drilling by Routh: a2 a1 = a0 at the Hopf point."""
    stuck = ns.find_pseudo_equilibrium(drill(), [10.0, 0.0, 0.0])
    assert stuck.point[0] == pytest.approx(3 * 1425 / 473, rel=1e-12) and stuck.stable
    assert stuck.alpha == pytest.approx((1 - 1425 * 3 / (13950 * 0.8)) / 2, rel=1e-12)
    branch = ns.continue_equilibrium(drill(), stuck.point, "Om", side=None, bounds=(1.0, 12.0))
    found = kinds(branch)
    assert found["boundary equilibrium"] == pytest.approx(13950 * 0.8 / 1425, rel=1e-12)

    def routh(bit):
        slope = (50 - 0.9 * 13950 * 0.3 * math.exp(-0.9 * bit)) / 374
        a = np.array(
            [
                [0, 1, -1],  # of phi, top, bit
                [-473 / 2122, -(1425 + 23.2) / 2122, 23.2 / 2122],
                [473 / 374, 23.2 / 374, -23.2 / 374 - slope],
            ]
        )
        _, a2, a1, a0 = np.poly(a)
        return a2 * a1 - a0

    bit = brentq(routh, 3.0, 6.0, xtol=1e-15)
    speed = bit + (50 * bit + 13950 * (0.5 + 0.3 * math.exp(-0.9 * bit))) / 1425
    assert found["Hopf"] == pytest.approx(speed, rel=1e-10)
    assert found["Hopf"] == pytest.approx(9.0091179621, rel=1e-10)


# 5: adaptive exponential integrate-and-fire neuron -------------------------------------------------

C, G, REST, THRESHOLD, SHARP, SLOW, A, B = 281.0, 30.0, -70.6, -50.4, 2.0, 144.0, 4.0, 80.5


def neuron(cutoff):
    current = ca.SX.sym("I")
    spike = G * SHARP * ca.exp((v - THRESHOLD) / SHARP)
    return ns.FilippovSystem(
        [v, w],
        field=[(-G * (v - REST) + spike - w + current) / C, (A * (v - REST) - w) / SLOW],
        resets=ns.Reset(v - cutoff, [REST, w + B], direction=1, name="spike"),
        parameters={current: 300.0},
    )


def test_5_hopf_point_and_fold_of_an_exponential_neuron():
    """Where the slope of the exponential is 1 + C/(g tau) and 1 + a/g times g (Touboul 2008)."""
    rest = ns.find_equilibrium(neuron(0.0), [-60.0, 30.0])
    assert rest.kind == "stable node"
    found = kinds(ns.continue_equilibrium(neuron(0.0), rest.point, "I", bounds=(0.0, 900.0)))
    for name, slope in (("Hopf", 1 + C / G / SLOW), ("fold", 1 + A / G)):
        at = THRESHOLD + SHARP * math.log(slope)
        expected = (G + A) * (at - REST) - G * SHARP * slope
        assert found[name] == pytest.approx(expected, rel=1e-11)


# 6: rattling with backlash -------------------------------------------------------------------------


def test_6_gears_that_rattle():
    force = -50 * (ca.fmax(x - 1, 0) + ca.fmin(x + 1, 0))
    rattle = ns.FilippovSystem.from_expression(
        [x, v], [v, 3 * ca.cos(1.7 * t) - 0.1 * v + force], time=t
    )
    assert {rattle.switching(i).name for i in (0, 1)} == {"continuous of order 1"}
    assert ns.classify(rattle, [1.0, 0.4]).label == "crossing up"
    assert ns.classify(rattle, [1.0, 0.0], t=1.0).label == "from below"  # cos 1.7 < 0


# 7: modes with memory ------------------------------------------------------------------------------


def test_7_a_thermostat_of_the_users_numbers():
    room = ns.FilippovSystem(
        [x],
        field=[-0.1 * (x - 10) + 3 * q],
        discrete={q: (0, 1)},
        resets=[
            ns.Reset(x - 18, {q: 1}, -1, "on", level=True, when=q == 0),
            ns.Reset(x - 22, {q: 0}, 1, "off", level=True, when=q == 1),
        ],
    )
    run = ns.simulate(room, [15.0, 0], 30.0)
    on = [event.t for event in run.events if event.name == "on"]
    assert np.diff(on)[1] == pytest.approx(10 * math.log(1.5) + 10 * math.log(22 / 18), rel=1e-12)
    for value, place in ((0, 10.0), (1, 40.0)):  # both are beyond a threshold
        rest = ns.find_equilibrium(room, [place, value])
        assert (rest.point[0], rest.status) == (pytest.approx(place), "virtual")


def test_7_a_play_operator():
    low, high = ca.SX.sym("low"), ca.SX.sym("high")
    drive = ca.sin(t) + 0.3 * ca.sin(3.1 * t)
    play = ns.FilippovSystem(
        [w],
        field=[low - high],
        complementarity=[
            ns.Complementarity(w - drive + 0.5, multiplier=low, name="low"),
            ns.Complementarity(drive + 0.5 - w, multiplier=high, name="high"),
        ],
        time=t,
    )
    # by its definition on a fine grid, whose error is of the second order at the turns
    assert ns.simulate(play, [0.0], 10.0).x[-1, 0] == pytest.approx(-0.165271662722, abs=1e-8)
    held, free = ns.classify(play, [-0.5]), ns.classify(play, [0.5])
    assert (held.kind, free.kind) == ("closed", "leaving")
    assert held.evidence["multiplier"] == pytest.approx(1.93, rel=1e-12)  # the rate of the drive


# 8: compass gait -----------------------------------------------------------------------------------


@functools.cache
def compass():
    """Absolute angles of the swinging and of the standing leg (Goswami, Thuilot & Espiau 1998), on 3 degrees."""
    leg, part, mass, hip, g = 1.0, 0.5, 5.0, 10.0, 9.81
    swing, stand, rates = ca.SX.sym("n"), ca.SX.sym("s"), ca.SX.sym("rate", 2)
    angles, at = ca.vertcat(swing, stand), leg * ca.vertcat(-ca.sin(stand), ca.cos(stand))
    points = [at / 2, at, at + part * ca.vertcat(ca.sin(swing), -ca.cos(swing))]
    masses = [mass, hip, mass]
    height = sum(own * place[1] for own, place in zip(masses, points, strict=True))
    speeds = [ca.jtimes(place, angles, rates) for place in points]
    energy = sum(own * ca.sumsqr(speed) / 2 for own, speed in zip(masses, speeds, strict=True))
    momentum = ca.gradient(energy, rates)
    force = ca.gradient(energy - g * height, angles) - ca.jtimes(momentum, angles, rates)
    law = ca.solve(ca.jacobian(momentum, rates), force)
    c, both = ca.cos(stand - swing), mass * part * part
    before = ca.vertcat(
        ca.horzcat(-both, -both + (hip + 2 * mass * part) * c), ca.horzcat(0, -both)
    )
    after = ca.vertcat(
        ca.horzcat(both - mass * part * c, mass * (1 - part * c) + both + hip),
        ca.horzcat(both, -mass * part * c),
    )
    landed = ca.solve(after, ca.mtimes(before, rates))
    states = [swing, stand, *ca.vertsplit(rates)]
    strike = swing + stand + math.radians(6)
    return ns.FilippovSystem(
        states,
        field=[*ca.vertsplit(rates), *ca.vertsplit(law)],
        resets=ns.Reset(
            strike, [stand, swing, *ca.vertsplit(landed)], -1, "strike", when=stand <= 0
        ),
    )


def test_8_a_walker_without_motors():
    """Four strikes by scipy's DOP853."""
    system = compass()
    start = [-0.3234, 0.2187, -0.3772, -1.0918]

    times = [0.7349554745463336, 1.4684905101894423, 2.2029539349090896, 2.937527932439464]
    run = ns.simulate(system, start, 40.0, tol=1e-11)
    found = np.array([event.t for event in run.events if event.name == "strike"])
    np.testing.assert_allclose(found[: len(times)], times, rtol=0, atol=1e-8)
    assert np.diff(found)[-1] == pytest.approx(0.73435, abs=5e-6)  # published: 0.734


def test_8_upright_legs_are_a_pendulum_on_an_inverted_one():
    mass = np.array([[1.25, -2.5], [-2.5, 16.25]])
    stiffness = 9.81 * np.diag([2.5, -17.5])
    squares = np.linalg.eigvals(-np.linalg.solve(mass, stiffness))
    expected = np.sqrt(squares.astype(complex))
    rest = ns.find_equilibrium(compass(), [0.0, 0.1, 0.0, 0.0])
    found = np.sort_complex(rest.eigenvalues)
    np.testing.assert_allclose(found, np.sort_complex([*expected, *-expected]), atol=1e-9)


# 9: ice ages with a switch between growth and melting ---------------------------------------------


def ice(forcing, **more):
    """Volume, area and CO2; the switch is continuous but for the rate of CO2 (Paillard & Parrenin 2004)."""
    volume, area, gas, offset = (ca.SX.sym(name) for name in ("V", "A", "C", "d"))

    def rates(released):
        aim = 0.15 * forcing + 0.5 * released
        return [
            (0.8 - 1.3 * gas - 0.5 * forcing - volume) / 15,
            (volume - area) / 12,
            (aim - gas) / 5,
        ]

    return ns.FilippovSystem(
        [volume, area, gas],
        surface=0.3 * volume - 0.7 * area - 0.01 * forcing + offset,
        above=rates(0),
        below=rates(1),
        parameters={offset: 0.27},
        **more,
    )


@pytest.mark.slow
def test_9_switches_of_ice_ages():
    """Switches and end by scipy's DOP853, leg by leg."""
    forcing = ca.sin(2 * ca.pi * t / 41) + 0.5 * ca.sin(2 * ca.pi * t / 23)
    times = [
        *(46.1499593033436, 62.464459753667946, 89.78550099208549, 104.32485674832905),
        *(128.82832305747655, 145.5112913333408, 168.97023140577022, 182.94283605128174),
        *(210.0318307728888, 224.92631091978825, 252.7291910011884, 267.43545572441496),
        *(294.66290090044276, 309.8654603025007, 332.8397625018406, 349.2478391470292),
        *(374.0324451316401, 387.9165810823284, 415.58398968020083, 430.52027422243304),
        *(458.33304051000084, 473.0892776599398, 498.828958002158, 514.8627805568893),
        *(537.7905325562364, 552.5066695490914, 578.9567175195908, 593.5813689866123),
    ]
    run = ns.simulate(ice(forcing, time=t), [0.2, 0.2, 0.2], 600.0, tol=1e-11)
    found = [event.t for event in run.events if event.kind == "crossing"]
    np.testing.assert_allclose(found, times, rtol=0, atol=1e-7)
    end = [0.40347588636610227, 0.4176036473678574, 0.09178293777389979]
    np.testing.assert_allclose(run.x[-1], end, rtol=0, atol=1e-8)


def test_9_rest_and_border_of_ice_ages_without_forcing():
    """V = A = 0.8 - 1.3 C on both sides; between the borders d = 0.4 V rests V between two rates of CO2."""
    plain = ice(0.0)
    assert plain.switching().name == "velocity continuous of order 0"
    for side, gas, border in (("+", 0.0, 0.32), ("-", 0.5, 0.06)):
        level = 0.8 - 1.3 * gas
        found = ns.find_boundary_equilibrium(plain, [level, level, gas], vary="d", side=side)
        assert found.value == pytest.approx(border, rel=1e-12)
    level = 0.27 / 0.4
    between = ns.classify(plain, [level, level, (0.8 - level) / 1.3])
    assert between.kind == "rest" and between.evidence["nu"] == pytest.approx(5 / 26, rel=1e-12)
    assert ns.classify(plain, [0.6, 0.45 / 0.7, 0.3]).kind == "crossing"


# 10: genes -----------------------------------------------------------------------------------------


def genes(decay, production):
    states = [ca.SX.sym(f"x{i}") for i in range(4)]
    switches = [ca.SX.sym(f"l{i}") for i in range(4)]
    on = [(1 + one) / 2 for one in switches]
    return ns.FilippovSystem(
        states,
        surfaces=[one - 0.8 for one in states],
        multipliers=switches,
        field=[
            made - rate * one for made, rate, one in zip(production(on), decay, states, strict=True)
        ],
    )


def test_10_four_genes_that_regulate_themselves_rest_on_four_thresholds():
    """Production 2 (1 - H1)(1 - H2 H4), 2 (1 - H2), ... is what decays at 0.8."""
    decay = [1.0, 1.1, 0.9, 1.2]
    system = genes(
        decay,
        lambda on: [2 * (1 - on[0]) * (1 - on[1] * on[3]), *(2 * (1 - one) for one in on[1:])],
    )
    own = [1 - 0.4 * rate for rate in decay]
    own[0] = 1 - 0.4 / (1 - own[1] * own[3])
    here = ns.classify(system, [0.8] * 4)
    assert (here.kind, here.label) == ("pseudo-equilibrium", "stable pseudo-node")
    np.testing.assert_allclose([*here.evidence.values()][:4], 2 * np.array(own) - 1, atol=1e-12)
    run = ns.simulate(system, [0.1, 0.2, 0.3, 1.5], 20.0)
    assert run.status is REACHED and run.itinerary.endswith("ssss")


# 11: anti-lock brake behind a valve ----------------------------------------------------------------


def brake(surfaces):
    speed, slip, torque = (ca.SX.sym(name) for name in ("v", "s", "b"))
    grip = 0.32 * slip / (0.04 + slip**2)
    return ns.FilippovSystem(
        [speed, slip, torque],
        field=[-9.81 * grip, 30 / speed * (torque - grip / 2), (0.4 - 0.8 * lam - torque) / 0.03],
        surfaces=[surfaces(slip)],
        multipliers=[lam],
        stops=ns.Stop(speed - 1, -1, "slow"),
    )


def test_11_a_brake_slides_in_second_order_once_its_relay_is_quick():
    """Sliding at the slip 0.2 stops after 29/(9.81 0.8), and needs the torque grip/2 = 0.4."""
    valve = brake(lambda slip: slip - 0.2)
    assert valve.switching().name == "velocity continuous of order 0"
    assert ns.classify(valve, [20.0, 0.2, 0.4]).label == "invisible on both sides"
    run = ns.simulate(valve, [30.0, 0.2, 0.4], 5.0, rest_below=1e-3)
    assert run.status is ns.Status.STOPPED and run.itinerary == "s"
    assert run.t[-1] == pytest.approx(29 / (9.81 * 0.8), rel=1e-9)


# 12: rectifiers ------------------------------------------------------------------------------------


def test_12_a_bridge_rectifier_and_its_cold_start():
    """Sliding at no current needs a source below the capacitor's voltage; both vanish at the start."""
    source, rate = 10 * ca.sin(100 * math.pi * t), 1e-3
    bridge = ns.FilippovSystem(
        [x, v],
        surface=x,
        above=[(source - 0.1 * x - v) / rate, (x - v / 50) / rate],
        below=[(source - 0.1 * x + v) / rate, (-x - v / 50) / rate],
        time=t,
    )

    moment = 0.001
    alpha = ns.alpha(bridge, [0.0, 20.0], t=moment)
    assert alpha == pytest.approx(0.5 - math.sin(0.1 * math.pi) / 4, rel=1e-12)
    cold = ns.classify(bridge, [0.0, 0.0])
    assert (cold.kind, cold.label) == ("two-fold", "mix-0")


# 13: what a fit needs ----------------------------------------------------------------------------


def test_13_where_a_block_stops_and_its_derivative_by_the_friction():
    """After v^2/(2 mu g), and it stays under a push of less than mu g."""
    dry = ns.Friction(v, load=9.81, kinetic=mu)
    block = ns.FilippovSystem([x, v], field=[v, dry.force], surfaces=[dry], parameters={mu: 0.3})
    run = ns.simulate(block, [0.0, 2.0], 1.0)
    stop = 2 / (0.3 * 9.81)
    assert run.x[-1, 0] == pytest.approx(stop, rel=1e-11) and run.itinerary == "+ s"
    derivative = ns.sensitivity(run).dx_dp[0, 0]
    assert derivative == pytest.approx(-stop / 0.3, rel=1e-9)


# 14: stiff friction --------------------------------------------------------------------------------


def test_14_a_stiff_oscillator_with_friction_sticks_between_its_equilibria():
    field = [v, 1000 * (1 - x**2) * v - x]
    stuck = ns.FilippovSystem(
        [x, v], surface=v, above=[v, field[1] - 0.5], below=[v, field[1] + 0.5]
    )
    assert ns.alpha(stuck, [0.2, 0.0]) == pytest.approx(0.7, rel=1e-12)
    rest = ns.find_equilibrium(stuck, [-0.4, 0.0])
    assert (rest.status, rest.kind) == ("boundary", "unstable node")
    values = np.roots([1, -750, 1])
    np.testing.assert_allclose(rest.eigenvalues, np.sort(values), rtol=1e-10)


# 15: a boost converter in a sliding mode -----------------------------------------------------------


def test_15_two_folds_and_the_hopf_point_of_a_washout_filter():
    """Sliding about y = 2 has the two-fold k = a y and the Hopf point k = (w a y^2 - 1)/(2 a y)."""

    def rates(on):
        return [1 - on * y, on * x - y / 2, 2 * (x - z)]

    system = ns.FilippovSystem(
        [x, y, z], surface=y - 2 + k * (x - z), above=rates(1), below=rates(0), parameters={k: 1.4}
    )
    rest = ns.find_pseudo_equilibrium(system, [2.0, 2.0, 2.0])
    assert rest.alpha == pytest.approx(0.5, rel=1e-12)
    assert rest.eigenvalues.sum().real == pytest.approx(0.25, rel=1e-9)
    found = kinds(ns.continue_equilibrium(system, rest.point, "k", side=None, bounds=(0.8, 1.8)))
    assert found["two-fold"] == pytest.approx(1.0, abs=1e-10)
    assert found["Hopf"] == pytest.approx(1.5, abs=1e-10)
    fold = ns.find_two_fold(system, [2.4, 1.7, 2.2])
    assert fold.kind == "visible-invisible"
    above, below = (
        system.evaluate(system.lie_derivative(side), fold.point).item() for side in "+-"
    )
    assert (
        max(abs(above), abs(below), abs(fold.point[1] - 2 + 1.4 * (fold.point[0] - fold.point[2])))
        < 1e-12
    )


# 17: two incommensurate clocks ---------------------------------------------------------------------


def test_17_two_clocks_are_an_explicit_time():
    root = math.sqrt(2)

    def block(first, second, **more):
        push = 0.4 * ca.cos(first) + 0.4 * ca.cos(root * second)
        return ns.FilippovSystem(
            [x, v], surface=v, above=[v, push - x - 0.1], below=[v, push - x + 0.1], **more
        )

    clocks = [ns.Clock(2 * math.pi, name="one"), ns.Clock(root * math.pi, name="two")]
    beaten = block(*(clock.phase for clock in clocks), clocks=clocks)
    timed = block(t, t, time=t)
    runs = ns.simulate(beaten, [0.0] * 4, 40.0), ns.simulate(timed, [0.0, 0.0], 40.0)
    np.testing.assert_allclose(runs[0].x[-1, :2], runs[1].x[-1], rtol=0, atol=1e-8)
    push = 0.4 * math.cos(2) + 0.4 * math.cos(2 * root) + 0.55
    alphas = ns.alpha(beaten, [-0.55, 0.0, 2.0, 2.0]), ns.alpha(timed, [-0.55, 0.0], t=2.0)
    assert alphas == pytest.approx([(0.1 - push) / 0.2] * 2, rel=1e-10)


# 18: bowed string ----------------------------------------------------------------------------------


@functools.cache
def string(count):
    """Masses 1/n on a string, the bow at a fifth of it."""
    heights, speeds = ca.SX.sym("q", count), ca.SX.sym("p", count)
    ends = ca.vertcat(0, heights, 0)
    force = count**2 * (ends[2:] - 2 * heights + ends[:-2]) - 0.2 * speeds
    bow = ns.Friction(speeds[count // 5] - 0.2, load=1.0, kinetic=0.3, static=0.6, stribeck=0.2)
    force[count // 5] += count * bow.force
    return ns.FilippovSystem(
        [*ca.vertsplit(heights), *ca.vertsplit(speeds)],
        field=[*ca.vertsplit(speeds), *ca.vertsplit(force)],
        surfaces=[bow],
    )


@pytest.mark.slow
def test_18_a_bowed_string_sticks_and_slips():
    """Times and end by scipy's DOP853, leg by leg."""
    times = [
        *(0.040622734572079496, 0.6402688139587907, 2.35283271534678, 3.114870815173238),
        *(3.489850613019909, 3.531322750941977, 4.427431816097955, 4.485635447552028),
        4.771323407016731,
    ]
    end = [
        *(-0.005456214759860199, 0.006178351747022317, 0.043112091261384225, 0.02632009788604727),
        *(0.001372672854777542, 0.014744103250030654, 0.01229029266284292, -0.0031260595468078764),
        *(-0.012699987457222076, -0.01878938111509457, -0.08639564395531965, -0.03748141908997233),
        *(0.2, 0.2817026095073352, 0.13873720657113875, 0.03577217793379551, 0.2179630509118474),
        *(0.36417808194597906, 0.043214645289516816, -0.28300068693655506),
    ]
    run = ns.simulate(string(10), np.zeros(20), 5.0, tol=1e-11)
    found = [event.t for event in run.events if event.kind in ("entry", "exit")]
    np.testing.assert_allclose(found, times, rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.x[-1], end, rtol=0, atol=1e-8)


def test_18_a_string_of_a_hundred_masses_sticks_to_its_bow():
    """The bow carries the damping 0.2 0.2, of at most 0.6 n."""
    system, start = string(100), np.zeros(200)
    start[120] = 0.2
    assert ns.region(system, start) is ns.Region.ATTRACTING
    assert ns.alpha(system, start) == pytest.approx((1 + 0.04 / 60) / 2, rel=1e-12)


# 19 to 22, 24: problems of the textbook and of other collections --------------------------------


def test_19_the_curve_of_time_optimal_control_is_an_orbit_of_one_field():
    optimal = ns.FilippovSystem.from_expression([x, v], [v, -ca.sign(x + v * ca.fabs(v) / 2)])
    assert ns.region(optimal, [-0.5, 1.0]) is ns.Region.TANGENT_ABOVE
    assert ns.region(optimal, [0.5, -1.0], surface=1, mode="+s-") is ns.Region.TANGENT_BELOW


def test_20_a_rod_on_its_tip_topples_at_the_rate_of_a_pendulum():
    rod = textbook.painleve_rod().system
    upright = ns.find_equilibrium(rod, [0.0, 0.5, math.pi / 2, 0.0, 0.0, 0.0], mode="sc")
    ends = upright.eigenvalues.real[[0, -1]]
    assert ends == pytest.approx([-math.sqrt(1.5), math.sqrt(1.5)], rel=1e-10)


@pytest.mark.parametrize(
    ("angle", "slip", "mu", "itinerary", "time", "speed"),
    [
        (1.11, -0.5, 1.3331673, "-c sc", 3.8475787852e-05, -0.3008446978682633),
        (1.1084, -1.5, 1.3330999, "-c -o", 5.6458252654e-04, -1.0554995195170),
    ],
)
def test_20_a_rod_close_to_the_paradox_sticks_or_rises(angle, slip, mu, itinerary, time, speed):
    """Reactions are some thousand times the weight. Time and speed of the rod by scipy's DOP853."""
    start = [0, math.sin(angle) / 2, angle, slip, 0, 0]
    run = ns.simulate(textbook.painleve_rod().system, start, 0.01, parameters={"mu": mu})
    assert run.status is ns.Status.REACHED_END and run.itinerary == itinerary
    assert run.events[0].t == pytest.approx(time, rel=1e-8)
    assert run.events[0].x[3] == pytest.approx(speed, rel=1e-8)


def test_21_a_block_that_rocks_stands_stably():
    here = ns.classify(textbook.rocking_block().system, [0.0, 0.0])
    assert (here.kind, here.label) == ("rest", "stable, invisible on both sides")
    assert here.evidence["jumps"] == pytest.approx(0.81, rel=1e-12)


def test_22_a_string_that_may_be_slack():
    u1, v1 = ca.SX.sym("u1"), ca.SX.sym("v1")
    taut = ns.Impact((1 - x**2 - y**2) / 2, restitution=0, reaction=r, name="taut")
    string = ns.FilippovSystem([x, y, u1, v1], field=[u1, v1, -r * x, -1 - r * y], impacts=taut)
    hangs = ns.find_equilibrium(string, [0.1, -1.0, 0.0, 0.0], mode="c")
    np.testing.assert_allclose(hangs.eigenvalues, [-1j, 1j], atol=1e-12)
    assert ns.find_equilibrium(string, [0.1, 1.0, 0.0, 0.0], mode="c").status == "virtual"
    turning, falling = ([1.0, 0.0, 0.0, 1.2], [0.0, 1.0, -0.9, 0.0])
    assert ns.classify(string, turning).evidence["multiplier"] == pytest.approx(1.44, rel=1e-12)
    assert ns.classify(string, falling).kind == "leaving"  # v^2 < g at the top


def test_22_folds_of_a_threshold_policy():
    policy = textbook.sir_threshold().system
    for side, near, at, kind in (("+", 1.2, 1 / 0.8, "invisible"), ("-", 0.6, 1 / 2, "visible")):
        fold = ns.find_fold(policy, [near, 0.05], side=side)
        assert (fold.point[0], fold.kind) == (pytest.approx(at, rel=1e-12), kind)
    weight = (0.8 * 0.7 - 1) / (0.8 * 0.7 - 1 - (2 * 0.7 - 1))
    assert ns.alpha(policy, [0.7, 0.05]) == pytest.approx(weight, rel=1e-12)


def test_24_rest_at_a_soft_stop_passes_to_the_spring():
    push = ca.SX.sym("F")
    stop = ns.FilippovSystem.from_expression(
        [x, v], [v, push - 0.1 * v - x - 5 * ca.fmax(x - 1, 0)], parameters={push: 0.5}
    )
    rest = ns.find_equilibrium(stop, [0.4, 0.0], side="-")
    (event,) = ns.continue_equilibrium(stop, rest.point, "F", side="-", bounds=(0.2, 1.8)).events
    assert event.parameter == pytest.approx(1.0, rel=1e-12)
    assert event.far_side.verdict.startswith("persistence")


# 23: an arm with friction in its joints ------------------------------------------------------------

HELD = (1.0, 0.6, 0.3)


@functools.cache
def arm():
    """Three links of length 1 with masses 1 at their ends: the system, and its law for numbers."""
    angles, rates, torques = (ca.SX.sym(name, 3) for name in ("th", "om", "l"))
    turned = ca.cumsum(angles)
    points = ca.vertcat(ca.cumsum(ca.sin(turned)), -ca.cumsum(ca.cos(turned)))
    slopes = ca.jacobian(points, angles)
    mass = ca.mtimes(slopes.T, slopes)
    weight = 9.81 * ca.gradient(ca.sum1(points[3:]), angles)
    momentum = ca.mtimes(mass, rates)
    inertia = ca.jtimes(momentum, angles, rates) - ca.gradient(ca.dot(rates, momentum), angles) / 2
    law = ca.solve(mass, -inertia - weight - ca.DM(HELD) * torques)
    system = ns.FilippovSystem(
        [*ca.vertsplit(angles), *ca.vertsplit(rates)],
        field=[*ca.vertsplit(rates), *ca.vertsplit(law)],
        surfaces=ca.vertsplit(rates),
        multipliers=ca.vertsplit(torques),
    )
    return system, ca.Function("law", [angles, rates, torques], [law, weight])


@pytest.mark.slow
def test_23_an_arm_moves_as_with_steep_friction():
    """Beside tanh of a large slope, whose error falls with it."""
    system, law = arm()
    run = ns.simulate(system, [1.0, 0.5, -0.3, 0.0, 0.0, 0.0], 2.0)
    assert run.status is REACHED and len(run.events) > 5
    errors = []
    for steep in (1e4, 1e5):

        def rates(_, a, steep=steep):
            return np.concatenate(
                [a[3:], np.array(law(a[:3], a[3:], np.tanh(steep * a[3:]))[0]).ravel()]
            )

        end = solve_ivp(
            rates, (0.0, 2.0), [1.0, 0.5, -0.3, 0.0, 0.0, 0.0], "Radau", rtol=1e-8, atol=1e-10
        ).y[:, -1]
        errors.append(np.abs(end - run.x[-1]).max())
    assert errors[1] < 1e-3 and errors[1] < 0.5 * errors[0]


def test_23_an_arm_rests_where_its_joints_hold_it():
    system, law = arm()
    start = np.array([0.004, 0.003, -0.002, 0.0, 0.0, 0.0])
    weight = np.array(law(start[:3], start[3:], [0, 0, 0])[1]).ravel()
    found = ns.local.intersection(system, start)
    assert [one.mode for one in found.continuations] == ["sss"] and found.attraction == "attracting"
    np.testing.assert_allclose(found.sliding.multipliers, -weight / HELD, rtol=1e-9)
    assert ns.classify(system, [1.0, 0.01, -0.01, 0, 0, 0]).kind == "crossing"


# 25: sliding cycles in space -----------------------------------------------------------------------


def test_25_a_cycle_is_born_while_sliding():
    """r' = r (mu - r^2) on z = 0, attracting up to x = 50."""
    spin = [mu * x - y - x * (x**2 + y**2), x + mu * y - y * (x**2 + y**2)]
    system = ns.FilippovSystem(
        [x, y, z], surface=z, above=[*spin, 0.02 * x - 1], below=[*spin, 1], parameters={mu: -0.2}
    )
    rest = ns.find_pseudo_equilibrium(system, [0.1, 0.1, 0.0])
    assert rest.kind == "stable pseudo-focus"
    branch = ns.continue_equilibrium(system, rest.point, "mu", side=None, bounds=(-0.5, 0.5))
    assert kinds(branch)["Hopf"] == pytest.approx(0.0, abs=1e-12)
    assert ns.find_fold(system, [40.0, 0.0, 0.0]).point[0] == pytest.approx(50.0, rel=1e-12)
    run = ns.simulate(system, [0.1, 0.0, 0.0], 200.0, parameters={"mu": 0.04})
    assert run.itinerary == "s" and math.hypot(*run.x[-1, :2]) == pytest.approx(0.2, abs=1e-7)


# 26: pulse width modulation ------------------------------------------------------------------------


def test_26_the_gradient_through_pulses():
    """x' = 1 - x for the part d of each period, -x for the rest: 3 periods."""
    clock = ns.Clock(1.0, name="tick")
    pulses = ns.FilippovSystem(
        [x],
        field=[(1 - lam) / 2 - x],
        surfaces=[clock.phase - k],
        multipliers=[lam],
        clocks=clock,
        parameters={k: 0.4},
    )
    run = ns.simulate(pulses, [0.0, 0.0], 2.9)
    expected = sum(math.exp(0.4 - 2.9 + n) for n in range(3))
    assert ns.sensitivity(run).dx_dp[0, 0] == pytest.approx(expected, rel=1e-9)
    assert not pulses.switching().slides and ns.region(pulses, [0.5, 0.4]) is ns.Region.CROSSING_UP
