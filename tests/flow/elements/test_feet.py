"""Bodies on feet with friction: a box that slides, stops and tips, against scipy; a ball in a corner; linkages with feet."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import nonsmooth as ns

G, B, H = 9.81, 0.5, 1.0
INERTIA = (B**2 + H**2) / 3
SLOW = pytest.mark.slow
LAWS = ["newton", "moreau", "poisson"]
x, y, th, u, v, w, t = (ca.SX.sym(name) for name in ("x", "y", "th", "u", "v", "w", "t"))


def box(mu, feet=(-1, 1), law="newton", pull=0.0, height=H):
    """A box on feet at these parts of its half width."""
    count = len(feet)
    r, lam = ca.SX.sym("r", count), ca.SX.sym("lam", count)
    gaps, slips, force, moment = [], [], ca.SX([0, 0]), 0
    for k, side in enumerate(feet):
        arm = ca.vertcat(
            side * B * ca.cos(th) + height * ca.sin(th), side * B * ca.sin(th) - height * ca.cos(th)
        )
        push = ca.vertcat(-mu * lam[k] * r[k], r[k])
        gaps.append(ns.Impact(y + arm[1], reaction=r[k], name=f"foot{k}", law=law))
        slips.append(u - arm[1] * w)
        force += push
        moment += arm[0] * push[1] - arm[1] * push[0]
    return ns.FilippovSystem(
        [x, y, th, u, v, w],
        field=[u, v, w, force[0] + pull, force[1] - G, 3 * moment / (B**2 + height**2)],
        surfaces=slips,
        multipliers=ca.vertsplit(lam),
        impacts=gaps,
        time=t,
    )


def tipping(mu, speed, t_end):
    """The box on its front foot alone, which slips and then sticks: forces by linear algebra."""

    def arm(a):
        return np.array([B * np.cos(a) + H * np.sin(a), B * np.sin(a) - H * np.cos(a)])

    def field(sticks):
        def rates(_, z):
            a, spin = z[2], z[5]
            p = arm(a)
            # Acceleration of the foot: that of the centre, the turn of the arm, the centripetal part.
            rows = np.array([[1, 0, -p[1]], [0, 1, p[0]]])
            weight = np.diag([1, 1, 1 / INERTIA])
            bias = rows @ [0, -G, 0] - spin**2 * p
            if sticks:
                force = np.linalg.solve(rows @ weight @ rows.T, -bias)
            else:
                along = np.array([-mu, 1])
                force = along * (-bias[1] / (rows[1] @ weight @ rows.T @ along))
            return np.r_[z[3:], np.array([0, -G, 0]) + weight @ rows.T @ force]

        return rates

    slip = lambda _, z: z[3] - arm(z[2])[1] * z[5]
    slip.terminal, slip.direction = True, -1
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    first = solve_ivp(field(False), (0, t_end), [0, H, 0, speed, 0, 0], events=slip, **options)
    second = solve_ivp(field(True), (first.t[-1], t_end), first.y[:, -1], **options)
    return first.t[-1], second.y[:, -1]


def test_a_box_that_grips_tips_on_its_front_foot():
    run = ns.simulate(box(0.6), [0, H, 0, 2.0, 0, 0], 0.6, tol=1e-11)
    stuck, end = tipping(0.6, 2.0, 0.6)
    assert run.segments[0].mode == "++oc"
    entry = next(event for event in run.events if event.kind == "entry")
    assert abs(entry.t - stuck) < 1e-9
    np.testing.assert_allclose(run.x[-1], end, atol=1e-8)


@pytest.mark.parametrize(
    "feet", [(-1, 1), (-1, 0, 1), (-1, -1, 1, 1), pytest.param((-1, -0.4, 0.4, 1), marks=SLOW)]
)
def test_a_box_that_slips_stops_flat_on_any_number_of_feet(feet):
    mu, speed = 0.4, 2.0
    run = ns.simulate(box(mu, feet), [0, H, 0, speed, 0, 0], 1.0)
    assert run.status is ns.Status.REACHED_END, run.message
    stop = speed / (mu * G)
    assert abs(run.events[0].t - stop) < 1e-10
    np.testing.assert_allclose(run.x[-1], [speed * stop / 2, H, 0, 0, 0, 0], atol=1e-10)


@pytest.mark.parametrize("law", [pytest.param(law, marks=SLOW) for law in LAWS])
def test_a_box_falls_flat_on_four_feet(law):
    run = ns.simulate(box(0.3, (-1, -0.4, 0.4, 1), law), [0, H + 0.2, 0, 0.5, 0, 0], 1.5, tol=1e-11)
    assert run.status is ns.Status.REACHED_END, run.message
    first = run.events[0]
    assert first.kind == "impact" and abs(first.t - np.sqrt(0.4 / G)) < 1e-11
    assert abs(first.x_after[3:]).max() < 1e-11  # friction takes the speed, within the impact
    np.testing.assert_allclose(run.x[-1, 3:], 0.0, atol=1e-9)


@pytest.mark.parametrize("law", LAWS)
def test_a_rocking_block_keeps_the_share_of_its_speed_that_housner_found(law):
    """A block that rocks about one edge and strikes with the other: w+ = (1 - 3/2 sin^2 a) w- (Housner 1963)."""
    h, tilt = 2.0, 0.1  # turned about the left edge, which stays at the origin
    c, s, square = np.cos(tilt), np.sin(tilt), B**2 + h**2
    start = [B * c - h * s, B * s + h * c, tilt, 0, 0, 0]
    run = ns.simulate(box(5.0, law=law, height=h), start, 3.0)
    assert run.status is ns.Status.REACHED_END, run.message
    strikes = [event for event in run.events if event.kind == "impact"]
    assert len(strikes) >= 3
    for event in strikes[:3]:
        share = event.x_after[5] / event.x[5]
        np.testing.assert_allclose(share, 1 - 1.5 * B**2 / square, atol=1e-9)
    energy = 2 / 3 * square * strikes[0].x[5] ** 2
    np.testing.assert_allclose(energy, G * (start[1] - h), rtol=1e-9)
