"""Fields with roots of switching functions, through the zero of the root."""

import casadi as ca
import pytest

import nonsmooth as ns

x, y, v, t, one, two = (ca.SX.sym(n) for n in ("x", "y", "v", "t", "one", "two"))


@pytest.mark.parametrize("below", [0, 1])
def test_a_tank_empties(below):
    tank = ns.FilippovSystem([x], surface=x, above=[-ca.sqrt(x)], below=[below])
    run = ns.simulate(tank, [1.0], 5.0)
    assert run.itinerary == "+ s" and run.x[-1].tolist() == [0]
    assert run.events[0].t == pytest.approx(2.0, abs=1e-9)
    assert run(1.0)[0] == pytest.approx(0.25, abs=1e-9)


def test_two_tanks_in_cascade():
    first, second = (1 + one) / 2 * ca.sqrt(x), (1 + two) / 2 * ca.sqrt(y)
    tanks = ns.FilippovSystem(
        [x, y], surfaces=[x, y], multipliers=[one, two], field=[-first, first - second]
    )
    run = ns.simulate(tanks, [1.0, 1.0], 5.0)
    assert run.itinerary == "++ s+ ss" and run.x[-1].tolist() == [0, 0]
    assert [e.t for e in run.events[:2]] == pytest.approx([2.0, 3.0925860317], abs=1e-9)


def test_cube_root_reaches_zero_in_finite_time():
    rhs = [-ca.sign(x) * ca.fabs(x) ** (1 / 3)]
    run = ns.simulate(ns.FilippovSystem.from_expression([x], rhs), [1.0], 5.0)
    assert run.itinerary == "+ s" and run.events[0].t == pytest.approx(1.5, abs=1e-9)


def test_valve_passes_zero():
    # Values by an implicit Runge-Kutta method (Radau) at two tolerances.
    rhs = [-2 * ca.sign(x) * ca.sqrt(ca.fabs(x)) + 0.3 * ca.cos(t)]
    run = ns.simulate(ns.FilippovSystem.from_expression([x], rhs, time=t), [1.0], 20.0)
    assert run.x[-1] == pytest.approx([0.00518905], abs=1e-8)
    flow = ca.sign(x - v) * ca.sqrt(ca.fabs(x - v))
    rhs = [-flow + 0.3 * ca.cos(t), flow]
    run = ns.simulate(ns.FilippovSystem.from_expression([x, v], rhs, time=t), [1.0, 0.0], 20.0)
    assert run.x[-1] == pytest.approx([0.63953631, 0.63434726], abs=1e-8)


def _super_twisting(gain, push=0.0):
    return ns.FilippovSystem(
        [x, v], surface=x, above=[v - gain * ca.sqrt(x), push - 1.1],
        below=[v + gain * ca.sqrt(-x), push + 1.1], time=t,
    )  # fmt: skip


@pytest.mark.parametrize(("start", "limit"), [(0.2, 0.7788952494520), (1.0, 1.7416627251264)])
def test_super_twisting_comes_to_rest(start, limit):
    # limits by matrix exponentials: linear in sqrt(x) and a time of its own
    run = ns.simulate(_super_twisting(1.5), [start, 0.0], 5.0)
    assert run.itinerary.endswith("s") and run.x[-1].tolist() == [0, 0]
    rest = run.events[-2]
    assert (rest.kind, rest.name) == ("rest", "h0")
    assert rest.t == pytest.approx(limit, abs=1e-10)


def test_super_twisting_without_oscillation_rests_too():
    run = ns.simulate(_super_twisting(4.0), [1.0, 0.3], 5.0)
    assert run.itinerary == "+ - s" and run.x[-1].tolist() == [0, 0]


def test_super_twisting_holds_a_disturbance():
    run = ns.simulate(_super_twisting(1.5, 0.9 * ca.sin(t)), [0, 0], 10.0)
    assert run.itinerary == "s" and run.x[-1].tolist() == [0, 0]


@pytest.mark.parametrize(
    ("above", "below", "start", "when"),
    [
        ([2 * ca.sqrt(x)], [-2 * ca.sqrt(-x)], 0.0, 0.0),  # 0, t^2 and -t^2
        ([ca.sqrt(x)], [-1], 0.0, 0.0),  # rest in 0, t^2/4
        ([ca.sqrt(x)], [1], -1.0, 1.0),  # arrives, and stays or leaves by (t - 1)^2/4
        ([x ** (1 / 3)], [0], 0.0, 0.0),
    ],
)
def test_a_root_that_drives_away_has_several_futures(above, below, start, when):
    """h' = k h^p with k > 0 leaves zero in finite time, or stays."""
    system = ns.FilippovSystem([x], surface=x, above=above, below=below)
    run = ns.simulate(system, [start], 3.0)
    assert run.status is ns.Status.NON_UNIQUE and run.t[-1] == pytest.approx(when, abs=1e-9)


@pytest.mark.parametrize("rate", [1e-6, 1.0])
def test_a_root_that_drives_away_from_where_the_rate_is_inward_does_not(rate):
    system = ns.FilippovSystem([x], surface=x, above=[ca.sqrt(x) - rate], below=[1])
    run = ns.simulate(system, [0.0], 1.0)
    assert run.itinerary == "s" and run.x[-1, 0] == 0.0


@pytest.mark.parametrize(
    ("start", "enters", "rests"),
    [([1.0, -2.0], 0.0, 1.0), ([1.0, 0.0], 0.516397779494, 1.290994448736)],
)
def test_terminal_sliding_rests(start, enters, rests):
    """On v + 2 |x|^(1/2) sgn x = 0 the root of x falls at rate 1; v' = -3 before, so 15 t^2 = 4 from rest."""
    surface = v + 2 * ca.sqrt(ca.fabs(x)) * ca.sign(x)
    run = ns.simulate(
        ns.FilippovSystem.from_expression([x, v], [v, -3 * ca.sign(surface)]), start, 4.0
    )
    assert run.status is ns.Status.REACHED_END and run.x[-1].tolist() == [0, 0]
    assert run.events[-2].t == pytest.approx(rests, abs=1e-9)
    middle = (enters + rests) / 2
    assert run(middle)[0] == pytest.approx((rests - middle) ** 2, abs=1e-9)


@pytest.mark.parametrize(("push", "rests"), [(0.0, True), (1.5, True), (-1.5, True), (2.5, False)])
def test_powers_in_a_switching_function_hold_what_is_below_the_gain(push, rests):
    surface = x + ca.sign(v) * ca.fabs(v) ** (5 / 3)
    rhs = [v, push - ca.sign(v) * ca.fabs(v) ** (1 / 3) - 2 * ca.sign(surface)]
    run = ns.simulate(ns.FilippovSystem.from_expression([x, v], rhs), [0.0, 0.0], 1.0)
    assert (run.status is ns.Status.REACHED_END) == rests
    assert not rests or run.x[-1].tolist() == [0, 0]


def test_roots_that_were_found_are_named():
    """Above, below, in one field with multipliers, in a switching function; not a square, nor what is no surface."""
    tank = ns.FilippovSystem([x, y], surface=x, above=[-ca.sqrt(x), ca.sqrt(y)], below=[0, 0])
    assert tank.roots == {"h0": 0.5} and "root |h0|^0.5" in repr(tank)
    valve = ns.FilippovSystem.from_expression([x], [-ca.sign(x) * ca.fabs(x) ** (1 / 3)])
    assert valve.roots == {"h0": pytest.approx(1 / 3)} and "root |h0|^0.333333" in repr(valve)
    first, second = (1 + one) / 2 * ca.sqrt(x), (1 + two) / 2 * ca.sqrt(y)
    cascade = ns.FilippovSystem(
        [x, y], surfaces=[x, y], multipliers=[one, two], field=[-first, first - second]
    )
    assert cascade.roots == {"h0": 0.5, "h1": 0.5}
    surface = v + 2 * ca.sqrt(ca.fabs(x)) * ca.sign(x)
    terminal = ns.FilippovSystem.from_expression([x, v], [v, -3 * ca.sign(surface)])
    assert set(terminal.roots.values()) == {0.5} and len(terminal.roots) == 1
    smooth = ns.FilippovSystem([x], surface=x, above=[-(x**2)], below=[1])
    assert smooth.roots == {} and "root" not in repr(smooth)


def _two_roots(a, b):
    """Stable in finite time, and homogeneous where b = a/(2 - a) (Bhat & Bernstein 2000)."""
    sign_v, sign_x = ca.sign(v), ca.sign(x)
    return ns.FilippovSystem.from_expression(
        [x, v], [v, -sign_v * ca.fabs(v) ** a - sign_x * ca.fabs(x) ** b]
    )


@pytest.mark.parametrize("a", [0.5, 0.6])
@pytest.mark.parametrize("start", [[0.1, 0.0], [0.0, 0.2], [-1.0, 0.3]])
def test_two_roots_come_to_rest_at_the_limit_of_their_turns(a, start):
    run = ns.simulate(_two_roots(a, a / (2 - a)), start, 30.0)
    times = [event.t for event in run.events if event.name == "h0" and event.kind == "crossing"]
    one, two, three = times[:3]
    limit = one + (two - one) / (1 - (three - two) / (two - one))
    assert run.status == ns.Status.REACHED_END and run.x[-1].tolist() == [0, 0]
    assert run.itinerary.endswith("ss")
    # that long a motion takes from twenty tolerances
    assert run.events[-2].t == pytest.approx(limit, abs=(20 * 1e-9) ** (1 - a))


@pytest.mark.parametrize(("a", "b"), [(0.5, 1 / 3), (0.3, 0.5), (0.5, 0.5)])
def test_two_roots_that_start_at_rest_stay_there(a, b):
    run = ns.simulate(_two_roots(a, b), [0.0, 0.0], 5.0)
    assert run.status == ns.Status.REACHED_END and run.itinerary == "ss"
    assert run.x[-1].tolist() == [0, 0]


@pytest.mark.parametrize("start", [1.0, -1.0])
@pytest.mark.parametrize("power", [0.5, 1.5])
@pytest.mark.parametrize("number", range(6))
def test_a_power_of_a_magnitude_is_the_same_however_it_is_written(start, power, number):
    """v' = -|v|^p sgn v: |v| = (|v0|^(1 - p) - (1 - p) t)^(1/(1 - p)); a parameter may be a factor inside."""
    k, m = ca.SX.sym("k"), ca.SX.sym("m")
    size = [
        ca.fabs(v) ** power,
        (v**2) ** (power / 2),
        ca.sqrt(ca.fabs(v)) ** (2 * power),
        ca.fabs(v) * ca.fabs(v) ** (power - 1),
        ca.fabs(k * v * m) ** power,
        (v**2 / k) ** (power / 2) * ca.fabs(v / m) ** (power - power),
    ][number]
    parameters = {k: 1.0, m: -1.0} if number > 3 else {}
    system = ns.FilippovSystem.from_expression([v], [-ca.sign(v) * size], parameters=parameters)
    run = ns.simulate(system, [start], 1.5)
    expected = start * (1 - (1 - power) * 1.5) ** (1 / (1 - power))
    assert run.x[-1, 0] == pytest.approx(expected, abs=1e-10)
    assert system.surface_count == 1
