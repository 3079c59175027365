"""Joints: motions with constraints against minimal coordinates, closed forms and an index reduction with scipy."""

import pickle

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import nonsmooth as ns

x, y, u, v, r, lam, t = (ca.SX.sym(s) for s in ("x", "y", "u", "v", "r", "lam", "t"))
angle, rate = ca.SX.sym("angle"), ca.SX.sym("rate")
ROD = (x**2 + y**2 - 1) / 2


def pendulum(drag=0.0, torque=0.0, gravity=1.0, **others):
    """A bob of unit mass on a rod, with a torque and dry friction ``drag`` at the pivot if it is given."""
    turn = torque - drag * lam
    friction = {"surfaces": [x * v - y * u], "multipliers": [lam]} if drag else {}
    return ns.FilippovSystem(
        [x, y, u, v],
        field=[u, v, r * x - turn * y, r * y - gravity + turn * x],
        constraints=ns.Constraint(ROD, reaction=r, name="rod"),
        **friction,
        **others,
    )


def by_angle(drag=0.0, torque=0.0, gravity=1.0, **others):
    """The same pendulum by its angle from the horizontal."""
    friction = {"surfaces": [rate], "multipliers": [lam]} if drag else {}
    field = [rate, torque - gravity * ca.cos(angle) - drag * lam]
    return ns.FilippovSystem([angle, rate], field=field, **friction, **others)


def placed(state):
    """Position and velocity of the bob."""
    a, w = state
    return np.array([np.cos(a), np.sin(a), -w * np.sin(a), w * np.cos(a)])


class Mechanism:
    """Particles joined by rods, some to points that are fixed."""

    def __init__(self, masses, rods, fixed, start, gravity=9.81):
        self.masses, self.rods, self.fixed = np.array(masses, float), rods, fixed
        self.start, self.gravity = np.array(start, float), gravity
        self.lengths = [
            np.linalg.norm(self._end(i, self.start) - self._end(j, self.start)) for i, j in rods
        ]

    def _end(self, i, q):
        return np.array(self.fixed[-i - 1]) if i < 0 else q[2 * i : 2 * i + 2]

    def system(self, **others):
        n = len(self.masses)
        q, w, f = ca.SX.sym("q", 2 * n), ca.SX.sym("w", 2 * n), ca.SX.sym("f", len(self.rods))
        end = lambda i: ca.DM(self.fixed[-i - 1]) if i < 0 else q[2 * i : 2 * i + 2]
        force = ca.SX.zeros(2 * n)
        constraints = []
        for k, (i, j) in enumerate(self.rods):
            apart = end(i) - end(j)
            g = (ca.dot(apart, apart) - self.lengths[k] ** 2) / 2
            force += ca.gradient(g, q) * f[k]
            constraints.append(ns.Constraint(g, reaction=f[k], name=f"rod{k}"))
        field = [*ca.vertsplit(w)]
        for i, mass in enumerate(self.masses):
            field += [force[2 * i] / mass, force[2 * i + 1] / mass - self.gravity]
        states = [*ca.vertsplit(q), *ca.vertsplit(w)]
        return ns.FilippovSystem(states, field=field, constraints=constraints, **others)

    def by_scipy(self, velocity, t_end):
        """Accelerations by least squares, integrated without projection."""
        n = 2 * len(self.masses)
        weight = np.repeat(1 / self.masses, 2)
        load = np.tile([0.0, -self.gravity], len(self.masses))

        def field(_, z):
            q, w = z[:n], z[n:]
            rows, right = np.zeros((len(self.rods), n)), np.zeros(len(self.rods))
            for k, (i, j) in enumerate(self.rods):
                apart = self._end(i, q) - self._end(j, q)
                moved = np.zeros(2)
                for end, sign in ((i, 1), (j, -1)):
                    if end >= 0:
                        rows[k, 2 * end : 2 * end + 2] += sign * apart
                        moved += sign * w[2 * end : 2 * end + 2]
                right[k] = -(moved @ moved) - rows[k] @ load
            force = np.linalg.lstsq(rows * weight @ rows.T, right, rcond=1e-12)[0]
            return np.r_[w, load + weight * (rows.T @ force)]

        start = np.r_[self.start, velocity]
        solved = solve_ivp(field, (0, t_end), start, method="DOP853", rtol=1e-12, atol=1e-13)
        return solved.y[:, -1]


def test_a_pendulum_swings_as_by_its_angle():
    run = ns.simulate(pendulum(), placed((0.3, 1.5)), 20.0, tol=1e-11)
    plain = ns.simulate(by_angle(), [0.3, 1.5], 20.0, tol=1e-11)
    assert run.status is ns.Status.REACHED_END and run.itinerary == "s"
    np.testing.assert_allclose(run.x[-1], placed(plain.x[-1]), atol=1e-8)
    assert abs((run.x[:, :2] ** 2).sum(1) - 1).max() < 1e-14
    assert abs((run.x[:, :2] * run.x[:, 2:]).sum(1)).max() < 1e-14


@pytest.mark.parametrize(
    "mechanism",
    [
        pytest.param(
            Mechanism([1.0, 2.0], [(-1, 0), (0, 1)], [(0, 0)], [1, 0, 1.6, 0.8]), id="two rods"
        ),
        pytest.param(
            Mechanism(
                [1.0, 0.5], [(-1, 0), (0, 1), (1, -2)], [(0, 0), (2, 0)], [0.2, 0.9, 1.7, 1.4]
            ),
            id="four-bar linkage",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            Mechanism(
                [1.0, 0.7, 0.4],
                [(-1, 0), (-2, 1), (-3, 2), (0, 1), (1, 2)],
                [(0, 0), (1, 0), (2, 0)],
                [0.6, -0.8, 1.6, -0.8, 2.6, -0.8],
            ),
            id="parallel links",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_mechanism_moves_as_its_index_reduction(mechanism):
    n = len(mechanism.start)
    system, start = mechanism.system(), np.r_[mechanism.start, np.zeros(n)]
    run = ns.simulate(system, start, 3.0, tol=1e-11)
    assert run.status is ns.Status.REACHED_END, run.message
    np.testing.assert_allclose(run.x[-1], mechanism.by_scipy(np.zeros(n), 3.0), atol=1e-7)
    for (i, j), length in zip(mechanism.rods, mechanism.lengths, strict=True):
        apart = mechanism._end(i, run.x[-1]) - mechanism._end(j, run.x[-1])
        np.testing.assert_allclose(np.linalg.norm(apart), length, rtol=1e-14)


@pytest.mark.parametrize("links", [1, 3, pytest.param(5, marks=pytest.mark.slow)])
def test_a_table_hangs_on_parallel_links(links):
    """Three or more depend on one another; the table swings as a pendulum without turning (one link: turned fast)."""
    turn, spin = ca.SX.sym("turn"), ca.SX.sym("spin")
    f, positions = ca.SX.sym("f", links), np.linspace(-1, 1, links) if links > 1 else [0.0]
    force, moment, constraints = ca.SX.zeros(2), ca.SX(0), []
    for k, place in enumerate(positions):
        arm = place * ca.vertcat(ca.cos(turn), ca.sin(turn))
        link = ca.vertcat(x, y) + arm - ca.vertcat(place, 0)
        constraints.append(ns.Constraint(ca.dot(link, link) - 1, reaction=f[k], name=f"link{k}"))
        force += f[k] * link
        moment += f[k] * (arm[0] * link[1] - arm[1] * link[0])
    table = ns.FilippovSystem(
        [x, y, turn, u, v, spin],
        field=[u, v, spin, force[0], force[1] - 1, 3 * moment],
        constraints=constraints,
    )
    a, w = -1.2, 0.4
    px, py, pu, pv = placed((a, w))
    run = ns.simulate(table, [px, py, 0, pu, pv, 0], 6.0, tol=1e-11)
    assert run.status is ns.Status.REACHED_END, run.message
    required = placed(ns.simulate(by_angle(), [a, w], 6.0, tol=1e-11).x[-1])
    np.testing.assert_allclose(run.x[-1, [0, 1, 3, 4]], required, atol=1e-8)
    np.testing.assert_allclose(run.x[-1, [2, 5]], 0.0, atol=1e-8)


def test_a_constraint_that_holds_its_reaction_gives_it_at_once():
    """x' = r with 0 = r + 2 x - b and b = y + r/2 ... two of them determine two reactions."""
    other = ca.SX.sym("other")
    system = ns.FilippovSystem(
        [x, y],
        field=[r, -other],
        constraints=[
            ns.Constraint(r + 2 * x + other / 2, reaction=r),
            ns.Constraint(other - y - r, reaction=other),
        ],
    )
    run = ns.simulate(system, [1.0, 2.0], 1.0, tol=1e-11)
    matrix = np.array([[-4 / 3, -1 / 3], [4 / 3, -2 / 3]])
    values, vectors = np.linalg.eig(matrix)
    end = vectors @ (np.exp(values) * np.linalg.solve(vectors, [1.0, 2.0]))
    np.testing.assert_allclose(run.x[-1], end.real, atol=1e-10)
    assert system.constraints == () and system.surface_count == 0


def test_a_moving_pivot_drives_the_bob():
    """The pivot moves as 0.1 sin 3t along x."""
    pivot = 0.1 * ca.sin(3 * t)
    system = ns.FilippovSystem(
        [x, y, u, v],
        field=[u, v, r * (x - pivot), r * y - 1],
        constraints=ns.Constraint(((x - pivot) ** 2 + y**2 - 1) / 2, reaction=r),
        time=t,
    )
    plain = ns.FilippovSystem(
        [angle, rate], field=[rate, -ca.cos(angle) - 0.9 * ca.sin(3 * t) * ca.sin(angle)], time=t
    )
    start = [np.cos(0.2), np.sin(0.2), 0.3, 0.0]  # with the pivot's speed
    run = ns.simulate(system, start, 8.0, tol=1e-11)
    end = ns.simulate(plain, [0.2, 0.0], 8.0, tol=1e-11).x[-1]
    np.testing.assert_allclose(run.x[-1, 1], np.sin(end[0]), atol=1e-8)
    np.testing.assert_allclose(run.x[-1, 0], np.cos(end[0]) + 0.1 * np.sin(24.0), atol=1e-8)
    assert ns.simulate(system, [*start[:2], 0, 0], 8.0).status is ns.Status.INCONSISTENT


@pytest.mark.parametrize("drag", [0.1, 0.5])
def test_friction_at_a_pivot_stops_the_swing(drag):
    system, plain = pendulum(drag), by_angle(drag)
    run = ns.simulate(system, placed((0.0, 2.0)), 12.0, tol=1e-11)
    required = ns.simulate(plain, [0.0, 2.0], 12.0, tol=1e-11)
    assert run.status is ns.Status.REACHED_END, run.message
    assert [mode[:1] for mode in run.itinerary.split()] == required.itinerary.split()
    np.testing.assert_allclose(
        [e.t for e in run.events], [e.t for e in required.events], rtol=1e-8, atol=1e-8
    )
    np.testing.assert_allclose(run.x[-1], placed(required.x[-1]), atol=1e-8)


@pytest.mark.parametrize("law", ["newton", "moreau", "poisson"])
def test_a_bob_strikes_a_wall_through_its_rod(law):
    """The wall x = -0.4 stops the bob: the rate of x turns round, along the rod."""
    wall = ns.Impact(x + 0.4, restitution=0.6, name="wall", law=law)
    own = ns.Impact(angle - (2 * np.pi - np.arccos(-0.4)), restitution=0.6)
    start = (2 * np.pi - 0.1, 0.0)
    run = ns.simulate(pendulum(impacts=wall), placed(start), 20.0, tol=1e-11)
    required = ns.simulate(by_angle(impacts=own), start, 20.0, tol=1e-11)
    assert run.status is ns.Status.REACHED_END, run.message
    assert [e.kind for e in run.events] == [e.kind for e in required.events]
    np.testing.assert_allclose(run.x[-1], placed(required.x[-1]), atol=1e-7)


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_bob_comes_to_rest_on_a_floor_and_is_lifted(restitution):
    """The floor y = -1/2 carries it until a load that turns it upwards has grown."""
    floor, own = (ns.Impact(h, restitution=restitution) for h in (y + 0.5, angle + np.pi / 6))
    system = pendulum(torque=0.1 * t, impacts=floor, time=t)
    plain = by_angle(torque=0.1 * t, impacts=own, time=t)
    run = ns.simulate(system, placed((0.3, 0.0)), 10.0, tol=1e-11)
    required = ns.simulate(plain, [0.3, 0.0], 10.0, tol=1e-11)
    assert run.status is ns.Status.REACHED_END, run.message
    assert [e.kind for e in run.events if e.kind != "impact"] == ["contact", "release", "end"][
        restitution == 0 :
    ]
    for event, true in zip(run.events[-2:], required.events[-2:], strict=True):
        assert abs(event.t - true.t) < 1e-9
    np.testing.assert_allclose(run.x[-1], placed(required.x[-1]), atol=1e-7)


def test_kicks_along_the_rod_are_taken_and_others_refused():
    turn = 0.3
    along = ns.Reset(x, {u: u - turn * y, v: v + turn * x}, 1, name="kick")
    across = ns.Reset(x, {u: u + 0.1, v: v + 0.1}, 1, name="kick")
    plain = ns.Reset(angle + np.pi / 2, {rate: rate + turn}, 1, name="kick")
    run = ns.simulate(pendulum(resets=along), placed((-2.5, 0.0)), 6.0, tol=1e-11)
    required = ns.simulate(by_angle(resets=plain), [-2.5, 0.0], 6.0, tol=1e-11)
    np.testing.assert_allclose(run.x[-1], placed(required.x[-1]), atol=1e-8)
    lost = ns.simulate(pendulum(resets=across), placed((-2.5, 0.0)), 6.0)
    assert lost.status is ns.Status.INCONSISTENT
    assert "Rate of the function of 'rod' is -0.1" in lost.message


def test_a_start_that_is_off_by_rounding_is_projected():
    run = ns.simulate(pendulum(), [1.0 + 3e-10, 0.0, 2e-10, 0.5], 1.0)
    assert run.status is ns.Status.REACHED_END
    assert abs(run.x[0, :2] @ run.x[0, :2] - 1) < 1e-15 and abs(run.x[0, :2] @ run.x[0, 2:]) < 1e-15
    np.testing.assert_allclose(run.x[0], [1.0, 0.0, 0.0, 0.5], atol=1e-9)


def test_a_reaction_that_is_not_given_acts_along_the_gradient():
    field = [u, v, 0, -1]
    system = ns.FilippovSystem([x, y, u, v], field=field, constraints=ns.Constraint(ROD))
    run, own = (ns.simulate(s, placed((0.3, 0.0)), 4.0) for s in (system, pendulum()))
    np.testing.assert_allclose(run.x[-1], own.x[-1], atol=1e-9)


def test_a_system_with_constraints_keeps_its_definition():
    system = pendulum(0.1)
    again = pickle.loads(pickle.dumps(system))
    assert again == system and again.constraints == ("rod",) and again.joints == (1,)
    assert repr(system).endswith("1 surface; constraint 'rod')")
    run = ns.simulate(again, placed((0.0, 1.0)), 2.0)
    np.testing.assert_array_equal(run.x[-1], ns.simulate(system, placed((0.0, 1.0)), 2.0).x[-1])
    starts = np.array([placed((a, 0.0)) for a in np.linspace(-3, 3, 7)])
    many = ns.ensemble(system, starts, 5.0)
    for start, end in zip(starts, many.x, strict=True):
        np.testing.assert_allclose(end, ns.simulate(system, start, 5.0).x[-1], atol=1e-12)


def test_a_run_continues_from_its_events():
    system = pendulum(0.2)
    whole = ns.simulate(system, placed((0.0, 2.0)), 10.0)
    first = ns.simulate(system, placed((0.0, 2.0)), 3.0)
    rest = ns.simulate(system, start=first, t_end=10.0)
    np.testing.assert_allclose(rest.x[-1], whole.x[-1], atol=1e-9)
    mode = whole.events[0].mode_after
    again = ns.simulate(
        system, whole.events[0].x_after, 10.0, t_start=whole.events[0].t, start_mode=mode
    )
    np.testing.assert_allclose(again.x[-1], whole.x[-1], atol=1e-9)


def test_derivatives_are_those_by_the_angle():
    """Through friction, a stop of the slip and a wall."""
    g = ca.SX.sym("g")
    wall = ns.Impact(x + 0.4, restitution=0.6, name="wall")
    own = ns.Impact(angle - (2 * np.pi - np.arccos(-0.4)), restitution=0.6, name="wall")
    system = pendulum(0.1, gravity=g, impacts=wall, parameters={g: 1.0})
    plain = by_angle(0.1, gravity=g, impacts=own, parameters={g: 1.0})
    start = np.array([2 * np.pi - 0.1, -0.3])
    run = ns.simulate(system, placed(start), 5.0, tol=1e-11)
    required = ns.simulate(plain, start, 5.0, tol=1e-11)
    assert [e.kind for e in run.events] == [e.kind for e in required.events]
    assert "impact" in [e.kind for e in run.events] and "crossing" in [e.kind for e in run.events]
    outer, inner = (
        [[-np.sin(a), 0], [np.cos(a), 0], [-w * np.cos(a), -np.sin(a)], [-w * np.sin(a), np.cos(a)]]
        for a, w in (required.x[-1], start)
    )
    found, true = ns.sensitivity(run), ns.sensitivity(required)
    np.testing.assert_allclose(found.dx_dp, np.dot(outer, true.dx_dp), atol=1e-8)
    np.testing.assert_allclose(found.dx_dx0 @ inner, np.dot(outer, true.dx_dx0), atol=1e-8)


@pytest.mark.parametrize(("drag", "e"), [(0.1, 0.5), pytest.param(0, None, marks=pytest.mark.slow)])
def test_orbits_and_their_multipliers_are_those_by_the_angle(drag, e):
    """A forced pendulum with dry friction and a wall; each function that is held adds a zero multiplier."""
    a = ca.SX.sym("a")
    push, own = a * ca.cos(t), {"time": t, "parameters": {a: 0.5}}
    wall = lambda gap: {"impacts": ns.Impact(gap, restitution=e) if e else ()}
    system = pendulum(drag, push - 0.2 * (x * v - y * u), **wall(x + 0.2), **own)
    plain = by_angle(drag, push - 0.2 * rate, **wall(angle + np.arccos(-0.2)), **own)
    starts = ((system, placed((-1.5, 0))), (plain, [-1.5, 0]))
    found, required = (ns.periodic_orbit(s, ns.simulate(s, start, 150.0)) for s, start in starts)
    assert found.stability == required.stability == "asymptotically stable"
    np.testing.assert_allclose(found.multipliers, [*required.multipliers, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(found.trajectory.x[-1], found.start, atol=1e-9)
    branch = ns.continue_orbit(found, "a", bounds=(0.48, 0.52))
    assert not branch.events and {end.name for end in branch.ends} == {"REACHED_BOUND"}


@pytest.mark.parametrize("law", ["newton", "poisson"])
def test_constraints_that_are_given_twice_change_nothing(law):
    """Impulses act through both; derivatives need one of them."""
    wall = ns.Impact(x + 0.4, restitution=0.6, name="wall", law=law)
    twice = ns.FilippovSystem(
        [x, y, u, v],
        field=[u, v, (r + lam) * x, (r + lam) * y - 1],
        constraints=[ns.Constraint(ROD, reaction=r), ns.Constraint(2 * ROD, reaction=lam)],
        impacts=wall,
    )
    start = placed((2 * np.pi - 0.1, 0.0))
    run, own = (ns.simulate(s, start, 20.0, tol=1e-11) for s in (twice, pendulum(impacts=wall)))
    assert [e.kind for e in run.events] == [e.kind for e in own.events]
    np.testing.assert_allclose(run.x[-1], own.x[-1], atol=1e-8)
    with pytest.raises(ns.DegenerateError, match="Leave out those that follow from the others"):
        ns.sensitivity(run)


@pytest.mark.parametrize(
    ("constraints", "field", "text"),
    [
        (ns.Constraint(ROD, reaction=r), [u, v, 0, -1], "r is not in the field"),
        (ns.Constraint(ROD, reaction=r), [u, v, r**2, -1], "r is multiplied with r"),
        (ns.Constraint(x, reaction=r), [u, v, 0, r], "two derivatives without a reaction"),
        (ns.Constraint(x + r**2, reaction=r), [u, v, r, 0], "reaction enters nonlinearly"),
        (ns.Impact(x), [u, v, 0, 0], "expected a Constraint"),
    ],
)
def test_what_is_no_joint_is_refused(constraints, field, text):
    with pytest.raises(ns.DefinitionError, match=text.replace("(", r"\(").replace("*", r"\*")):
        ns.FilippovSystem([x, y, u, v], field=field, constraints=constraints)


def test_reactions_are_given_once():
    joints = [ns.Constraint(ROD, reaction=r), ns.Constraint(2 * ROD, reaction=r)]
    with pytest.raises(ns.DefinitionError, match="more than once"):
        ns.FilippovSystem([x, y, u, v], field=[u, v, r * x, r * y - 1], constraints=joints)
    sides = {"above": [u, v, r * x - 1, r * y], "below": [u, v, r * x + 1, r * y]}
    with pytest.raises(ns.DefinitionError, match="Give field= with multipliers="):
        ns.FilippovSystem([x, y, u, v], surface=u, **sides, constraints=joints[0])


def test_friction_by_the_reaction_of_a_joint_is_refused_with_what_to_write():
    with pytest.raises(ns.DefinitionError, match="Give friction at a joint a load of its own"):
        ns.FilippovSystem(
            [x, y, u, v],
            field=[u, v, -0.3 * lam * r, r - 1],
            surfaces=[u],
            multipliers=[lam],
            constraints=ns.Constraint(y, reaction=r),
        )


@pytest.mark.parametrize("pull", [1.0, -1.0])
def test_a_piston_rubs_on_its_guide_by_the_size_of_the_side_force(pull):
    """The guide carries pull (1 - x/2): with f = x - x^2/4 up to x = 2, then 2 - f, the piston stops where v^2/2 = mu f."""
    side, rho, mu = ca.SX.sym("side"), pull * (1 - 0.5 * x), 0.3
    dry = ns.Friction(u, load=side * rho, kinetic=mu)
    piston = ns.FilippovSystem(
        [x, y, u, v],
        field=[u, v, dry.force, r - rho],
        surfaces=[dry, rho],
        multipliers=[side],
        constraints=ns.Constraint(y, reaction=r),
    )
    run = ns.simulate(piston, [0, 0, 2.2, 0], 12.0, tol=1e-12)
    passed, stopped = (event for event in run.events if event.kind != "end")
    assert (passed.name, stopped.name) == ("h1", "h0")
    energy = lambda speed: speed**2 / 2
    np.testing.assert_allclose(energy(passed.x[2]), energy(2.2) - mu, rtol=1e-11)
    np.testing.assert_allclose(run.x[-1, 0], 2 + 2 * np.sqrt(energy(2.2) / mu - 1), rtol=1e-11)
    by_speed = 2.2 / mu / np.sqrt(energy(2.2) / mu - 1)
    np.testing.assert_allclose(ns.sensitivity(run).dx_dx0[0, 2], by_speed, rtol=1e-9)


def test_functions_for_other_systems_refuse_constraints():
    with pytest.raises(ns.DefinitionError, match="has constraints, which this function"):
        ns.find_homoclinic(pendulum(0.1), [1.0, 0.0, 0.0, 0.0], "damping")


def test_constraints_of_expressions_with_switches():
    """A pendulum with dry friction in its joint, by its angle, as from an expression and as CasADi's dictionary."""
    angle, rate, r = ca.SX.sym("angle"), ca.SX.sym("rate"), ca.MX.sym("r")
    plain = ns.FilippovSystem.from_expression(
        [angle, rate], [rate, -ca.sin(angle) - 0.1 * ca.sign(rate)]
    )
    expected = ns.simulate(plain, [np.pi / 2, 0.0], t_end=9.0, tol=1e-11)
    x = ca.MX.sym("x", 4)
    turn = 0.1 * ca.sign(x[0] * x[3] - x[1] * x[2])
    rod = ns.Constraint(x[0] ** 2 + x[1] ** 2 - 1, reaction=r, name="rod")
    rhs = [x[2], x[3], r * x[0] + turn * x[1], r * x[1] - 1 - turn * x[0]]
    by_expression = ns.FilippovSystem.from_expression([x], rhs, constraints=rod)
    by_dae = ns.FilippovSystem.from_dae({"x": x, "ode": ca.vertcat(*rhs)}, constraints=[rod])
    for system in (by_expression, by_dae):
        assert system.constraints == ("rod",)
        run = ns.simulate(system, [1.0, 0.0, 0.0, 0.0], t_end=9.0, tol=1e-11)
        assert len(run.events) == len(expected.events) > 2
        assert run.x[-1, 0] == pytest.approx(np.sin(expected.x[-1, 0]), abs=1e-10)
    with pytest.raises(ns.DefinitionError, match="contains"):
        ns.FilippovSystem.from_expression([x], rhs)


def test_elements_of_a_dictionary_are_in_its_symbols():
    """A diode, and a ball with its reaction, beside switches."""
    x, i, r = ca.MX.sym("x"), ca.MX.sym("i"), ca.MX.sym("r")
    diode = ns.Complementarity(x, multiplier=i, name="diode")
    system = ns.FilippovSystem.from_dae({"x": x, "ode": ca.sign(x - 1) + i}, complementarity=diode)
    falling = ns.simulate(system, [0.5], t_end=2.0)
    assert falling.events[0].t == pytest.approx(0.5)
    assert falling.x[-1, 0] == pytest.approx(0, abs=1e-12)
    state = ca.MX.sym("h", 2)
    ode = ca.vertcat(state[1], -1 - 0.1 * ca.sign(state[1]) + r)
    ball = ns.FilippovSystem.from_dae(
        {"x": state, "ode": ode}, impacts=ns.Impact(state[0], 0.5, reaction=r)
    )
    assert ns.simulate(ball, [1.0, 0.0], t_end=9.0).x[-1] == pytest.approx([0, 0], abs=1e-9)


def _on_a_wire(place, ties, count):
    """A bead on a wire with friction in all directions, and the same by its place s on the wire, with one multiplier."""
    q, w, s = ca.SX.sym("q", count), ca.SX.sym("w", count), ca.SX.sym("s")
    force, mu = ca.vertcat(1.5 * ca.cos(2 * t), 1.5 * ca.sin(3 * t), 0.7 * ca.sin(t))[:count], 0.5
    both, f = ca.SX.sym("both", count), ca.SX.sym("f", len(ties(q)))
    reactions = sum(f[k] * ca.gradient(g, q) for k, g in enumerate(ties(q)))
    free = ns.FilippovSystem(
        [*ca.vertsplit(q), *ca.vertsplit(w)],
        field=[*ca.vertsplit(w), *ca.vertsplit(force - mu * both + reactions)],
        surfaces=[w],
        multipliers=[both],
        constraints=[ns.Constraint(g, reaction=f[k]) for k, g in enumerate(ties(q))],
        time=t,
    )
    tangent = ca.jacobian(place(s), s)
    square = ca.dot(tangent, tangent)
    along = (ca.dot(force, tangent) - mu * lam * ca.sqrt(square)) / square
    plain = ns.FilippovSystem([s, v], field=[v, along], surfaces=[v], multipliers=[lam], time=t)
    return free, plain, ca.Function("placed", [s, v], [place(s), tangent * v])


WIRES = {
    "circle": (lambda s: ca.vertcat(ca.cos(s), ca.sin(s)), lambda q: [(ca.sumsqr(q) - 1) / 2], 2),
    "line": (lambda s: ca.vertcat(0.6 * s, 0.8 * s), lambda q: [0.8 * q[0] - 0.6 * q[1]], 2),
    "axis": (lambda s: ca.vertcat(0 * s, s), lambda q: [q[0]], 2),
    "helix": (
        lambda s: ca.vertcat(ca.cos(s), ca.sin(s), 0.3 * s),
        lambda q: [
            (ca.sumsqr(q[:2]) - 1) / 2,
            q[0] * ca.sin(q[2] / 0.3) - q[1] * ca.cos(q[2] / 0.3),
        ],
        3,
    ),
}


@pytest.mark.parametrize("start", [(0.0, 0.0), (1.0, 0.8)])
@pytest.mark.parametrize("wire", WIRES)
def test_friction_in_space_holds_and_releases_along_a_joint(wire, start):
    """Where a joint takes a part of the load, the least friction that holds decides when it slips."""
    free, plain, placed_at = _on_a_wire(*WIRES[wire])
    place = lambda z: np.concatenate([ca.DM(part).full().ravel() for part in placed_at(*z)])
    run = ns.simulate(free, place(start), 6.0, tol=1e-10)
    required = ns.simulate(plain, start, 6.0, tol=1e-10)
    assert run.status is ns.Status.REACHED_END, run.message
    np.testing.assert_allclose(run.x[-1], place(required.x[-1]), atol=1e-9)
    ends = [e.t for e in required.events if e.kind != "crossing"]
    np.testing.assert_allclose([e.t for e in run.events if e.kind != "crossing"], ends, atol=1e-9)
