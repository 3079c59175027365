"""Fields with roots of switching functions, through the zero of the root."""

import casadi as ca
import pytest

import nonsmooth as ns

x, y, v, t, one, two = (ca.SX.sym(n) for n in ("x", "y", "v", "t", "one", "two"))


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
