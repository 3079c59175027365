"""Periodic orbits with vector multipliers: closed forms, one dimension, central differences of the return map."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

X, Y, U, V, Z, W, T = (ca.SX.sym(name) for name in ("x", "y", "u", "v", "z", "w", "t"))
A, B, MU, E = (ca.SX.sym(name) for name in ("a", "b", "mu", "e"))
R = ca.SX.sym("r")


def puck():
    """A puck under a force that turns around."""
    dry = ns.Friction((U, V), load=1, kinetic=MU)
    push = A * ca.vertcat(ca.cos(1.3 * T), ca.sin(1.3 * T))
    return ns.FilippovSystem(
        [U, V], field=push + dry.force, surfaces=[dry], time=T, parameters={A: 1.0, MU: 0.4}
    )


def held(force, stiffness=(1, 2), viscous=0, mu=MU, belt=(0, 0), **curve):
    """A block on springs in the plane."""
    dry = ns.Friction((U - belt[0], V - belt[1]), load=1, kinetic=mu, viscous=viscous, **curve)
    pull = ca.vertcat(force[0] - stiffness[0] * X, force[1] - stiffness[1] * Y) + dry.force
    return ns.FilippovSystem(
        [X, Y, U, V],
        field=[U, V, *ca.vertsplit(pull)],
        surfaces=[dry],
        **({"time": T} if any(ca.depends_on(ca.SX(f), T) for f in force) else {}),
        parameters={A: 0.8, B: 0.31, MU: 0.4},
    )


def table():
    """A body on a table that swings up and down and around."""
    dry = ns.Friction((U - 0.8 * ca.cos(T), V - 0.8 * ca.sin(T)), load=R, kinetic=MU)
    return ns.FilippovSystem(
        [Z, U, V, W],
        field=[W, dry.force[0] - 0.1 * U, dry.force[1] - 0.1 * V, R - 1],
        surfaces=[dry],
        impacts=ns.Impact(Z - A * ca.sin(T), reaction=R, restitution=E),
        time=T,
        parameters={A: 1.3, E: 0.0, MU: 0.2},
    )


def beside_a_line():
    """A block on the plane, on a spring to one that rubs along a line."""
    plane, line = ns.Friction((U, V), load=1, kinetic=MU), ns.Friction(W, load=1, kinetic=0.25)
    pull = ca.vertcat(A * ca.cos(0.5 * T) - 1.3 * X + 0.3 * Z, 0.5 * A * ca.sin(0.5 * T) - Y)
    return ns.FilippovSystem(
        [X, Y, Z, U, V, W],
        field=[
            *(U, V, W, *ca.vertsplit(pull + plane.force)),
            0.3 * X - 1.3 * Z + 0.3 * ca.cos(0.5 * T) + line.force,
        ],
        surfaces=[plane, line],
        time=T,
        parameters={A: 0.8, MU: 0.4},
    )


def in_a_fluid_of_bingham():
    """A particle in space that moves where a force exceeds a yield."""
    dry = ns.Friction((U, V, W), load=1, kinetic=MU)
    drive = [A * ca.cos(0.5 * T), 0.3 * A * ca.sin(0.5 * T), 0.2 * ca.cos(T)]
    pull = ca.vertcat(*drive) - ca.vertcat(X, 2 * Y, 1.5 * Z) + dry.force
    return ns.FilippovSystem(
        [X, Y, Z, U, V, W],
        field=[U, V, W, *ca.vertsplit(pull)],
        surfaces=[dry],
        time=T,
        parameters={A: 0.9, MU: 0.4},
    )


def require_return_map(orbit, tol=1e-7):
    """Multipliers are eigenvalues of central differences of the stroboscopic map, from a leg off sets and contacts."""
    legs = [leg for leg in orbit.legs if not set("sc") & set(leg.mode)]
    longest = max(legs, key=lambda leg: leg.duration)
    begin = longest.t + 0.5 * longest.duration
    x, given = orbit.trajectory(begin), {"parameters": orbit.parameters, "tol": 1e-13}

    def after(x):
        return ns.simulate(orbit.system, x, begin + orbit.period, t_start=begin, **given).x[-1]

    assert np.abs(after(x) - x).max() < 1e-11
    steps = 1e-6 * np.eye(x.size)
    slope = np.column_stack([(after(x + h) - after(x - h)) / 2e-6 for h in steps])
    found, expected = (np.sort_complex(e) for e in (orbit.multipliers, np.linalg.eigvals(slope)))
    np.testing.assert_allclose(found, expected, atol=tol)


def test_a_puck_pushed_around_moves_on_a_circle():
    """In the frame that turns with the force it rests, at |u| = sqrt(a^2 - mu^2)/w, and its equations are linear there."""
    system, a, w, mu = puck(), 1.0, 1.3, 0.4
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.3, 0.1], 80.0))
    speed = np.sqrt(a**2 - mu**2) / w
    u = a / (1j * w + mu / speed)
    e = np.array([u.real, u.imag]) / speed
    slope = np.array([[0, w], [-w, 0]]) - mu / speed * (np.eye(2) - np.outer(e, e))
    expected = np.exp(np.linalg.eigvals(slope) * 2 * np.pi / w)
    np.testing.assert_allclose(np.hypot(*orbit.start), speed, rtol=1e-14)
    np.testing.assert_allclose(
        np.sort_complex(orbit.multipliers), np.sort_complex(expected), rtol=1e-12
    )
    by_a = orbit.derivative("a").start @ orbit.start / speed
    np.testing.assert_allclose(by_a, a / w / np.sqrt(a**2 - mu**2), rtol=1e-12)
    branch = ns.continue_orbit(orbit, "mu", bounds=(0.1, 0.9))
    sizes = [np.hypot(*one.start) for one in branch.orbits]
    np.testing.assert_allclose(sizes, np.sqrt(a**2 - branch.values**2) / w, rtol=1e-10)


def test_slip_along_a_line_is_scalar_friction():
    """Across the line a velocity decays as friction turns against it, and a displacement is kept while it sticks."""
    dry, c, s = ns.Friction(U, load=1, kinetic=0.4), np.cos(0.7), np.sin(0.7)
    drive = 0.6 * ca.cos(0.5 * T)
    line = ns.FilippovSystem([X, U], field=[U, drive - X + dry.force], surfaces=[dry], time=T)
    plane = held((c * drive, s * drive), (1, 1))
    one, two = (
        ns.periodic_orbit(system, ns.simulate(system, x, 100.0, tol=1e-12))
        for system, x in ((line, [0.3, 0.0]), (plane, [0.3 * c, 0.3 * s, 0.0, 0.0]))
    )
    assert (one.itinerary, two.itinerary) == ("+ s - s", "* s * s")
    turn = np.kron(np.eye(2), [c, s])
    np.testing.assert_allclose(turn @ two.start, one.start, atol=1e-13)
    durations = [[leg.duration for leg in orbit.legs] for orbit in (one, two)]
    np.testing.assert_allclose(*durations, rtol=1e-12)
    across, *along = two.multipliers
    np.testing.assert_allclose([*along, 0.0], [*one.multipliers, 0.0, 0.0], atol=1e-13)
    assert 0.0 < across.real < 1.0
    require_return_map(two)


SLOW = (A * ca.cos(0.5 * T), 0.3 * A * ca.sin(0.5 * T))
BELT = {"belt": (B, 0.37 * B), "mu": 0.4, "static": 1.0, "stribeck": 0.5}


@pytest.mark.parametrize(
    ("system", "start", "values", "itinerary"),
    [
        (held(SLOW), [0.3, 0.1, 0, 0], {}, "* s * s"),
        (held(SLOW, viscous=0.2), [0.3, 0.1, 0, 0], {"a": 0.6}, "* s * s"),
        (beside_a_line(), [0.1, 0.1, 0.1, 0.1, 0.1, 0.2], {}, "*+ *s *- *s"),
        (in_a_fluid_of_bingham(), [0.1, 0.2, 0.3, 0.1, 0.1, 0], {}, "*"),
        (table(), [1, 0, 0, 0], {}, "*c *o"),
        (table(), [1, 0, 0, 0], {"a": 2, "mu": 0.3}, "sc *c *o"),
        (table(), [1, 0, 0, 0], {"mu": 0.9}, "sc *c *o *c"),
        (table(), [1, 0, 0, 0], {"a": 1.5, "e": 0.5}, "*o"),
    ],
)
def test_multipliers_are_those_of_the_return_map(system, start, values, itinerary):
    run = ns.simulate(system, start, 150.0, parameters=values, tol=1e-12)
    orbit = ns.periodic_orbit(system, run)
    cycles = f"{itinerary} {itinerary}"
    assert orbit.itinerary in cycles and len(orbit.itinerary) == len(itinerary)
    assert orbit.residual < 1e-12 and not orbit.faults and orbit.margins
    require_return_map(orbit)
    for name in ("a", "mu"):
        high, low = (
            ns.periodic_orbit(system, orbit, parameters={name: orbit.parameters[name] + h})
            for h in (1e-5, -1e-5)
        )
        change = (high.evaluation.starts - low.evaluation.starts)[:, : system.dimension] / 2e-5
        np.testing.assert_allclose(orbit.derivative(name).starts, change, atol=1e-6)


@pytest.mark.slow
def test_a_block_on_a_belt_sticks_and_slips_by_itself():
    """Its period is that of runs, at every speed of the belt along the branch."""
    system = held((0, 0.2 * X), (1, 1.7), **BELT)
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.3, 0.1, 0, 0], 100.0, tol=1e-12))
    assert orbit.itinerary in ("s *", "* s") and orbit.multipliers[0] == 1.0
    branch = ns.continue_orbit(orbit, "b", bounds=(0.28, 0.4))
    for one in (branch.orbits[0], branch.orbits[-1]):
        run = ns.simulate(system, one.start, 80.0, parameters=one.parameters, tol=1e-12)
        entries = [event.t for event in run.events if event.kind == "entry"]
        np.testing.assert_allclose(np.diff(entries)[-3:], one.period, rtol=1e-10)


def test_friction_does_not_bound_a_resonance():
    """x'' + x = cos t with a friction of 0.3 grows without bound: there is no orbit, however far away one looks."""
    system = held((ca.cos(T), 0.6 * ca.sin(T)), (1, 1), mu=0.3)
    run = ns.simulate(system, [0.4, 0.1, 0, 0], 150.0)
    with pytest.raises(ns.ConvergenceError, match="ran away"):
        ns.periodic_orbit(system, run)


def test_half_of_a_symmetric_orbit_is_enough():
    system = held(SLOW)
    run = ns.simulate(system, [0.3, 0.1, 0, 0], 150.0, tol=1e-12)
    whole, half = (ns.periodic_orbit(system, run, symmetry=s) for s in (None, "odd"))
    assert len(half.problem.legs) == 2 and half.itinerary in "* s * s * s"
    np.testing.assert_allclose(half.multipliers, whole.multipliers, atol=1e-12)


def test_a_contact_that_never_opens_leaves_no_multipliers():
    """z and w follow the table: of the body's motion along it (u' = cos t - 0.1 u) exp(-0.2 pi) remains."""
    system = ns.FilippovSystem(
        [Z, U, W],
        field=[W, ca.cos(T) - 0.1 * U, R - 1],
        impacts=ns.Impact(Z - 0.5 * ca.sin(T), reaction=R),
        time=T,
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [1, 0, 0], 200.0))
    np.testing.assert_allclose(orbit.multipliers, [np.exp(-0.2 * np.pi), 0, 0], atol=1e-13)
    assert orbit.stability == "asymptotically stable"


def test_returns_to_a_section_have_the_derivatives_of_runs():
    system, x = held(SLOW), np.array([0.3, 0.1, 0.5, 0.1])
    returns = ns.orbit.poincare(system, 4 * np.pi, x, count=2, tol=1e-13)
    found = returns.jacobian(1) @ returns.jacobian(0)
    after = lambda x: ns.simulate(system, x, 8 * np.pi, tol=1e-13).x[-1]
    rows = [(after(x + h) - after(x - h)) / 2e-5 for h in 1e-5 * np.eye(4)]
    np.testing.assert_allclose(found, np.transpose(rows), atol=1e-8)


@pytest.mark.slow
def test_phase_of_a_block_on_a_belt_after_a_kick():
    """At the exit from the belt as on it: what moves the slip is lost, the displacement moves the phase."""
    system = held((0, 0.2 * X), (1, 1.7), **BELT)
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.3, 0.1, 0, 0], 100.0, tol=1e-12))
    response, begin = ns.phase_response(orbit), orbit.legs[0].t
    for t in (1.0, orbit.legs[0].duration + 1.2):
        x = orbit.trajectory(begin + t)

        def late(x):
            run = ns.simulate(system, x, 12 * orbit.period, tol=1e-13)
            return [event.t for event in run.events if event.kind == "entry"][-1]

        rows = [(late(x - h) - late(x + h)) / 6e-7 for h in 3e-7 * np.eye(4)]
        np.testing.assert_allclose(response(t), rows, atol=2e-6)


@pytest.mark.slow
def test_a_body_that_chatters_to_rest_on_the_table_rubs_on_it():
    """Far along the orbit a run from elsewhere is on it, up to what its accumulation of impacts resolves."""
    system, given = table(), {"parameters": {"a": 1.2, "e": 0.5}, "tol": 1e-12}
    orbit = ns.periodic_orbit(system, ns.simulate(system, [1, 0.1, 0.3, 0], 150.0, **given))
    assert orbit.itinerary in "*c *o *o... *c *o *o..." and not orbit.faults
    begin = orbit.legs[0].t + 12 * orbit.period
    late = ns.simulate(system, [1.5, 0, 0, 0], begin, **given | {"tol": 1e-13}).x[-1]
    np.testing.assert_allclose(late, orbit.trajectory(orbit.legs[0].t), rtol=0, atol=2e-8)
