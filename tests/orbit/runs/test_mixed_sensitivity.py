"""Derivatives of runs that meet sets of codimension two or three and, beside them, surfaces, impacts, resets and
stops: a puck in closed form, and differences of runs."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.flow.plane_friction import columns

X1, X2, V1, V2, L1, L2, L3, A, B, Y, W, Z, T = columns(
    *("x1", "x2", "v1", "v2", "l1", "l2", "l3", "a", "b", "y", "w", "z", "t")
)
PAIR, SLIP, PLACE = ca.vertcat(L1, L2), ca.vertcat(V1, V2), [X1, X2, V1, V2]


def puck():
    """A puck slides on a floor that is rougher beyond x = 0.6 to a wall at x = 1, and back."""
    near, far, restitution = columns("near", "far", "e")
    friction = near + (far - near) * (1 + L3) / 2
    return ns.FilippovSystem(
        PLACE,
        field=[V1, V2, -friction * L1, -friction * L2],
        surfaces=[SLIP, X1 - 0.6],
        multipliers=[PAIR, L3],
        impacts=ns.Impact(1 - X1, restitution),
        parameters={near: 0.3, far: 0.5, restitution: 0.7},
    )


def test_a_puck_that_comes_back_from_a_wall_in_closed_form():
    """It slides along straight lines, and v^2 falls by twice friction times distance."""
    v1, v2, near, far, e = unknowns = columns("v1", "v2", "near", "far", "e")
    (x, y), time, v = (ca.SX(0), ca.SX(0)), ca.SX(0), (v1, v2)
    times = []
    for friction, wall, bounces in ((near, 0.6, False), (far, 1.0, True), (far, 0.6, False)):
        speed = ca.sqrt(v[0] ** 2 + v[1] ** 2)
        way = (wall - x) * speed / v[0]
        later = ca.sqrt(speed**2 - 2 * friction * way)
        time += (speed - later) / friction
        times.append(time)
        x, y, v = ca.SX(wall), y + way * v[1] / speed, [c * later / speed for c in v]
        v = (-e * v[0], v[1]) if bounces else v
    speed = ca.sqrt(v[0] ** 2 + v[1] ** 2)
    times.append(time + speed / near)
    x, y = (c + u * speed / (2 * near) for c, u in zip((x, y), v, strict=True))
    slopes = ca.jacobian(ca.vertcat(x, y, *times), ca.vertcat(*unknowns))
    known = np.array(ca.Function("known", unknowns, [slopes])(1.2, 0.5, 0.3, 0.5, 0.7))
    run = ns.simulate(puck(), [0.0, 0.0, 1.2, 0.5], 4.0, tol=1e-13)
    assert run.itinerary == "*-o *+o *-o s-o"
    found = ns.sensitivity(run)
    assert found.dx_dx0[:2, 2:] == pytest.approx(known[:2, :2], abs=1e-11)
    assert found.dx_dp[:2] == pytest.approx(known[:2, 2:], abs=1e-11)
    assert found.dt_dx0[:, 2:] == pytest.approx(known[2:, :2], abs=1e-10)
    assert found.dt_dp == pytest.approx(known[2:, 2:], abs=1e-10)
    assert np.abs(found.dx_dx0[2:]).max() < 1e-14


def block(drive, across=0.1, **more):
    """A block pushed along both axes, with friction 0.5."""
    return ns.FilippovSystem(PLACE, field=[V1, V2, drive - 0.5 * L1, across - 0.5 * L2], **more)


def bent():
    """Slip that is no linear function of the states."""
    slip = ca.vertcat(V1 + 0.1 * V1**2 + 0.2 * ca.sin(T), V2 + 0.3 * V1 * V2 + 0.1 * V2**2)
    pushes = [V1, V2, 0.2 * T**2 - 0.5 * L1, 0.1 + 0.05 * T**2 - 0.4 * L2]
    return ns.FilippovSystem(PLACE, field=pushes, surfaces=[slip], multipliers=[PAIR], time=T)


def broken_loose():
    """A push that begins when a clock meets a moving surface takes the block out of rest."""
    return block(
        0.3 + 0.15 * A * (1 + L3),
        0.1 * ca.sin(T),
        surfaces=[SLIP, T - 2 + 0.1 * X1],
        multipliers=[PAIR, L3],
        parameters={A: 1.5},
        time=T,
    )


def kicked():
    """A block at rest is kicked."""
    kick = ns.Reset(T - 2.5, [X1, X2, V1 + 0.3 + 0.1 * X1, V2 - 0.2], 1)
    return block(0.1, 0, surfaces=[SLIP], multipliers=[PAIR], resets=kick, time=T)


def caught():
    """A block is caught, at once at rest."""
    hold = ns.Reset(X1 - 0.3, [X1, X2, 0.0 * V1, 0.0 * V2], 1)
    return block(0.1, 0, surfaces=[SLIP], multipliers=[PAIR], resets=hold)


def resting_and_let_go():
    """A mass falls onto a table that a growing force lifts it from; slip of a block beside it."""
    return ns.FilippovSystem(
        [Y, W, V1, V2],
        field=[W, -1 + 0.6 * T + 0.1 * V1, -0.4 * L1 + 0.05 * W, 0.1 - 0.4 * L2],
        surfaces=[SLIP],
        multipliers=[PAIR],
        impacts=ns.Impact(Y, 0.0),
        time=T,
    )


def sliding_beside():
    """A surface slides, and its multiplier moves the block too."""
    return ns.FilippovSystem(
        [V1, V2, Z],
        field=[
            0.1 - 0.5 * L1 + 0.2 * L3,
            -0.4 * L2 + 0.1 * L3 * (1 + 0.1 * Z),
            A * L1 - L3 + 0.3 * V2,
        ],
        surfaces=[SLIP, Z + 0.1 * V1],
        multipliers=[PAIR, L3],
        parameters={A: 0.2},
    )


def let_go_by_the_hit():
    """Sliding of a surface ends and begins again on the way to the set."""
    return ns.FilippovSystem(
        [V1, V2, Z],
        field=[0.1 - 0.5 * L1, -0.4 * L2, 0.9 * L1 - 0.1 + 0.3 * V2 - 0.7 * L3],
        surfaces=[SLIP, Z],
        multipliers=[PAIR, L3],
    )


def drilled():
    """A disc that turns too (codimension three) comes back from a wall."""
    spin = ca.SX.sym("spin")
    return ns.FilippovSystem(
        [V1, V2, spin, X1],
        field=[-0.3 * L1, 0.05 - 0.3 * L2, -0.5 * L3, V1],
        surfaces=[ca.vertcat(V1, V2, 0.4 * spin)],
        multipliers=[ca.vertcat(L1, L2, L3)],
        impacts=ns.Impact(0.3 - X1, 0.6),
    )


def rubbing():
    """A ball that hits a floor with friction in one direction; a block beside it."""
    reaction, mu = columns("reaction", "mu")
    return ns.FilippovSystem(
        [Y, W, V1, V2, Z],
        field=[W, -1 + reaction, -0.2 * L1 + 0.1 * Z, -0.2 * L2, -mu * reaction * L3],
        surfaces=[SLIP, Z],
        multipliers=[PAIR, L3],
        impacts=ns.Impact(Y, 0.5, reaction=reaction),
        parameters={mu: 0.3},
    )


def bounced():
    """A ball with a spring that is stiffer on one side, until it lifts off."""
    x = columns("x1", "x2", "v1", "v2", "w1", "w2", "y", "ydot")
    mu, k = columns("mu", "k")
    load = -0.2 * x[7] - x[6]
    f1, f2 = -mu * load * L1, -mu * load * L2
    spring = [-0.1 * x[2 + i] - 0.25 * x[i] for i in range(2)]
    stiffer = -0.3 * (x[0] - 0.3) * (1 + L3) / 2
    rates = [spring[0] + f1 + stiffer, spring[1] + f2, f1 / k, f2 / k]
    return ns.FilippovSystem(
        x,
        field=[x[2], x[3], *rates, x[7], load - 1e-4],
        surfaces=[ca.vertcat(x[2] + x[4], x[3] + x[5]), x[0] - 0.3],
        multipliers=[PAIR, L3],
        parameters={mu: 0.3, k: 0.4},
        stops=[ns.Stop(load, -1, "lift-off")],
    )


CASES = [
    (bent, [0, 0, 0.1, 0.15], 2.2, "* s *"),
    (broken_loose, [0, 0, 0.2, 0.3], 3.0, "*- s- *+"),
    (kicked, [0, 0, 0.4, 0.3], 3.2, "* s *"),
    (caught, [0, 0, 0.9, 0.5], 3.0, "* s"),
    (resting_and_let_go, [0.1, 0, 0.3, 0.2], 2.5, "*o *c sc so"),
    (sliding_beside, [0.5, 0.6, 0.3], 2.5, "*+ *s"),
    (let_go_by_the_hit, [0.5, 0.6, 0.05], 2.5, "*+ *s *+ s+ ss"),
    (drilled, [0.5, 0.3, 1.0, 0.0], 4.0, "*o so"),
    (rubbing, [0.3, 0, 0.5, 0.3, 0.8], 1.8, "*+o"),
    (bounced, [0, 0, 1.0, 0.2, 0.3, 0.5, 0, -1], 20.0, "*- *+ s+ *+"),
]


QUICK = ("bent", "kicked", "rubbing")


@pytest.mark.parametrize(
    ("system", "start", "t_end", "itinerary"),
    [
        pytest.param(*c, id=c[0].__name__, marks=[] if c[0].__name__ in QUICK else pytest.mark.slow)
        for c in CASES
    ],
)
def test_derivatives_are_differences_of_runs(system, start, t_end, itinerary):
    system, start = system(), np.array(start, float)
    run = ns.simulate(system, start, t_end, tol=1e-13)
    found, n, values = ns.sensitivity(run), len(start), run.parameters
    assert run.itinerary == itinerary

    def end(e, d, p):
        x, q = start + e * d, {name: values[name] + e * p.get(name, 0.0) for name in values}
        other = ns.simulate(system, x, t_end, parameters=q, tol=1e-14)
        assert other.itinerary == itinerary
        return np.append(other.x[-1], [event.t for event in other.events])

    def slope(d, p):
        one, two, three = ((end(e, d, p) - end(-e, d, p)) for e in (1e-4, 2e-4, 3e-4))
        return (45 * one - 9 * two + three) / 60e-4

    m = len(found.event_times)
    wanted = [slope(d, {}) for d in np.eye(n)]
    wanted += [slope(np.zeros(n), {name: 1.0}) for name in found.names]
    of_state = np.hstack([found.dx_dx0, found.dx_dp])
    of_times = np.hstack([found.dt_dx0, found.dt_dp])
    of_end = np.concatenate([found.dt_end_dx0, found.dt_end_dp])
    expected = np.array(wanted).T
    assert of_state == pytest.approx(expected[:n], abs=1e-10)
    assert of_times == pytest.approx(expected[n : n + m], abs=1e-8)
    assert of_end == pytest.approx(expected[-1], abs=1e-10)
