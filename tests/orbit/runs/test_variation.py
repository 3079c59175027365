"""Derivatives of a run are exact through every kind of event, whichever way one computes them."""

from __future__ import annotations

import pickle

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import nonsmooth as ns
from tests.orbit.periodic_cases import CASES, cases_of


def throw() -> ns.FilippovSystem:
    """Case G1: friction that changes at x = 1, a wall at x = 2, a belt at v = -b."""
    x, v, lam, place = (ca.SX.sym(s) for s in ("x", "v", "lam", "place"))
    mu1, mu2, r, b = (ca.SX.sym(s) for s in ("mu1", "mu2", "r", "b"))
    mu = (mu1 + mu2) / 2 + (mu2 - mu1) / 2 * place
    return ns.FilippovSystem(
        [x, v],
        field=[v, -mu * lam],
        multipliers=[lam, place],
        surfaces=[v + b, x - 1],
        parameters={mu1: 1.0, mu2: 1.5, r: 0.8, b: 0.3},
        resets=ns.Reset(x - 2, [x, -r * v], 1),
    )


def test_gradients_through_crossing_impact_and_entry_are_the_closed_forms() -> None:
    values = CASES["G1"]
    run = ns.simulate(throw(), [0.0, 3.0], t_end=2.0, tol=1e-14)
    s = ns.sensitivity(run)
    expected = {k: float(v) for k, v in values["dx_T"].items()}
    assert s.dx_dx0[0, 1] == pytest.approx(expected.pop("v0"), rel=1e-13)
    for name, value in expected.items():
        assert s.dx_dp[0, s.names.index(name)] == pytest.approx(value, rel=1e-13)
    assert np.abs(s.dx_dx0[1]).max() < 1e-15
    assert s.dx_dp[1].round(14).tolist() == [0, 0, 0, -1]
    assert s.event_times == pytest.approx([float(t) for t in values["event_times"]], rel=1e-13)


x, y, v, t, a, b = (ca.SX.sym(s) for s in "x y v t a b".split())


@settings(deadline=None, max_examples=4)
@given(st.integers(0, 10**6))
def test_adjoint_and_forward_agree_on_random_systems(seed: int) -> None:
    rng = np.random.default_rng(seed)
    states = [ca.SX.sym(f"x{i}") for i in range(2)]
    fields = [
        [ca.dot(ca.DM(row), ca.vertcat(*states)) + a * c for row, c in zip(m, u, strict=True)]
        for m, u in ((rng.normal(size=(2, 2)), rng.normal(size=2)) for _ in range(2))
    ]
    system = ns.FilippovSystem(
        states, surface=states[0], above=fields[0], below=fields[1], parameters={a: 1.0}
    )
    run = ns.simulate(system, rng.normal(size=2), 1.5)
    assume(run.status is ns.Status.REACHED_END)
    s = ns.sensitivity(run)
    found = np.hstack([s.dx_dx0, s.dx_dp])
    row = rng.normal(size=2)
    pulled = np.concatenate(ns.vjp(run, row))
    assert np.abs(pulled - row @ found).max() <= 1e-12 * (1 + np.abs(found).max())
    # A switching function times a number is the same system, and so are its derivatives.
    scaled = ns.FilippovSystem(
        states, surface=-1e3 * states[0], above=fields[1], below=fields[0], parameters={a: 1.0}
    )
    again = ns.sensitivity(ns.simulate(scaled, run.x[0], 1.5))
    assert np.abs(again.dx_dx0 - s.dx_dx0).max() <= 1e-8 * (1 + np.abs(found).max())


def test_a_run_back_in_time_has_the_inverse_derivative() -> None:
    forward = ns.FilippovSystem([x, y], surface=y, above=[1 + y, -1], below=[y - 1, -2 - x])
    back = ns.FilippovSystem([x, y], surface=y, above=[-1 - y, 1], below=[1 - y, 2 + x])
    run = ns.simulate(forward, [0.2, 0.5], 1.0, tol=1e-14)
    there = ns.sensitivity(run).dx_dx0
    home = ns.sensitivity(ns.simulate(back, run.x[-1], 1.0, tol=1e-14)).dx_dx0
    assert np.abs(home @ there - np.eye(2)).max() < 1e-12


def test_the_clearance_is_the_distance_from_a_guard_that_is_missed() -> None:
    system = ns.FilippovSystem([x, y], surface=2 * y, above=[1, 2 * x], below=[1, 1])
    run = ns.simulate(system, [-1.0, 1.01], 2.0)  # y = x^2 + 0.01
    s = ns.sensitivity(run)
    assert s.clearance == pytest.approx(0.01, rel=1e-9)
    assert "h0 > 0 at t = 1" in s.nearest


def test_a_grazing_raises() -> None:
    fall = ns.FilippovSystem([x, y], surface=y, above=[1, -3 * x**2], below=[1, -1])
    run = ns.simulate(fall, [-1.0, 1.0], 1.5, tol=1e-12)  # y = -x^3: tangent at the surface
    with pytest.raises(ns.DegenerateError, match="transversal"):
        ns.sensitivity(run)


def test_a_run_without_a_regular_end_raises() -> None:
    focus = ns.FilippovSystem([x, y], surface=y, above=[1, -x], below=[-1, -x])
    run = ns.simulate(focus, [-1.0, 0.5], 90.0, max_events=3)
    with pytest.raises(ns.DegenerateError, match="TOO_MANY_EVENTS"):
        ns.sensitivity(run)


def test_two_resets_that_only_meet_are_a_corner() -> None:
    """x = 1 and y = 1 at one time: which comes first depends on the start."""
    system = ns.FilippovSystem(
        [x, y],
        field=[1, 1],
        resets=[
            ns.Reset(x - 1, map=[x - 1, y], name="A", direction=1),
            ns.Reset(y - 1, map=[x, y - 1], name="B", direction=1),
        ],
    )
    run = ns.simulate(system, [0.0, 0.0], 1.5)
    with pytest.raises(ns.DegenerateError, match=r"'A' and 'B'.*corner"):
        ns.sensitivity(run)


def test_saltation_matrices_are_those_of_exact_fractions() -> None:
    def exact(rows) -> np.ndarray:
        return np.array([[eval(v) for v in row] for row in rows])  # fractions such as "-1/2"

    values, at = CASES["S1"], [0.0, 0.0]
    crossing = ns.FilippovSystem([x, y], surface=y, above=[1, -2], below=[3, -1])
    assert np.array_equal(
        ns.orbit.saltation_matrix(crossing, "+", "-", at), exact(values["crossing"])
    )
    entry = ns.FilippovSystem([x, y], surface=y, above=[1, -2], below=[3, 2])
    assert np.array_equal(ns.orbit.saltation_matrix(entry, "+", "s", at), exact(values["entry"]))
    moving = ns.FilippovSystem([x, y], surface=y + 3 * t, above=[1, -5], below=[3, -4], time=t)
    found = ns.orbit.saltation_matrix(moving, "+", "-", at)
    assert np.array_equal(found, exact(values["time_dependent"]))
    after = [x + y / 4, -y / 2]
    for surface in (x, x - y):
        jump = ns.FilippovSystem(
            [x, y],
            surface=surface,
            above=[1, 2],
            below=[1, -2],
            resets=ns.Reset(y, after, -1, "jump"),
        )
        found = ns.orbit.saltation_matrix(jump, "-", "+", at, event="jump")
        assert np.array_equal(found, exact(values["reset"]))


def swing(a0: float, tol: float, r: float = 0.5) -> tuple[ns.Trajectory, float]:
    """x'' = -x from -a0 against a wall at 1, and the derivative of x at t = 4 by the start."""
    wall = ns.FilippovSystem([x, v], field=[v, -x], resets=ns.Reset(x - 1, [x, -r * v], 1))
    run = ns.simulate(wall, [-a0, 0.0], t_end=4.0, tol=tol)
    speed = max(a0**2 - 1, 1e-300) ** 0.5  # at the wall, after the time arccos(-1/a0)
    later, sooner = 4.0 - np.arccos(-1 / a0), 1 / (a0 * speed)
    by_later = -np.sin(later) - r * speed * np.cos(later)
    return run, -float(by_later * sooner - r * a0 / speed * np.sin(later))


@pytest.mark.parametrize("tol", [1e-8, 1e-10])
@pytest.mark.parametrize("call", [ns.sensitivity, lambda run: ns.vjp(run, [1.0, 0.0])])
def test_an_impact_that_a_run_has_by_its_error_alone_is_a_graze(tol, call) -> None:
    run, _ = swing(1.0, tol)
    assert run.events[0].name == "reset"  # by rounding; the exact orbit touches the wall
    with pytest.raises(ns.DegenerateError, match="grazing"):
        call(run)


@pytest.mark.parametrize(
    ("beyond", "tol", "rel"), [(1e-6, 1e-8, 1e-4), (1e-8, 1e-12, 1e-4), (1e-10, 1e-14, 1e-4)]
)
def test_impacts_that_nearly_graze_have_their_derivative(beyond, tol, rel) -> None:
    run, expected = swing(1.0 + beyond, tol)
    assert abs(expected) > 400.0
    assert ns.sensitivity(run).dx_dx0[0, 0] == pytest.approx(expected, rel=rel)


def test_a_flat_impact_of_an_orbit_that_does_not_turn_back_is_no_graze() -> None:
    flat = ns.FilippovSystem(
        [x, y], field=[1, -1e-6 * b], resets=ns.Reset(y, [x, y + 1], -1), parameters={b: 1.0}
    )
    s = ns.sensitivity(ns.simulate(flat, [0.0, 1e-6], t_end=3.0))
    assert s.event_times == pytest.approx([1.0]) and s.dt_dx0[0, 1] == pytest.approx(1e6)


TURN = ns.FilippovSystem([x, y], surface=y, above=[1, x], below=[1, 1])
HALF = ns.FilippovSystem([x, y], surface=y, above=[1, -2], below=[3, -1])
FLOOR = ns.FilippovSystem([y, v], field=[v, -1], impacts=ns.Impact(y, restitution=0.5))


@pytest.mark.parametrize(
    ("system", "before", "after", "point", "message"),
    [
        (HALF, "+", "-", [0.0, 1.0], r"point.*'h0'.*mode '\+'"),
        (HALF, "+", "-", [0.0, 1e-8], "point.*1e-08"),
        (HALF, "-", "+", [0.0, 0.0], "point.*h0 < 0"),
        (HALF, "+", "s", [0.0, 0.0], "point.*lambda0 >= -1"),
        (TURN, "s", "+", [0.0, 1.0], "point.*'lambda0 = 1'.*h0 = 0"),
        (TURN, "s", "+", [1.0, 0.0], "point.*lambda0 = 1"),
        (TURN, "+", "s", [1.0, 0.0], "point.*h0 > 0"),
        (FLOOR, "o", "o", [1e-3, -1.0], "point.*0.001"),
        (FLOOR, "o", "o", [0.0, 1.0], "point.*gap of 'impact'"),
    ],
)
def test_a_point_at_which_no_such_event_happens_has_no_saltation_matrix(
    system, before, after, point, message
) -> None:
    with pytest.raises(ns.PointError, match=message):
        ns.orbit.saltation_matrix(system, before, after, point)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e6])
def test_points_on_the_event_to_rounding_are_accepted(size) -> None:
    """The tolerance is relative: the units of the states do not matter."""
    system = ns.FilippovSystem([x, y], surface=3 * x - y, above=[1, -1], below=[2, -1])
    line = np.array([1.0, 3.0]) * size / 3.0
    found = ns.orbit.saltation_matrix(system, "-", "+", line)  # S = 1 + (f+ - f-) e_x/(e_x f-)
    assert np.abs(found - np.eye(2) - np.outer([-1, 0], [3, -1]) / 7).max() < 1e-15
    with pytest.raises(ns.PointError, match=r"point.*'h0'"):
        ns.orbit.saltation_matrix(system, "-", "+", line * [1.0, 1.0 + 1e-6])


def test_invalid_arguments_raise() -> None:
    run = ns.simulate(throw(), [0.0, 3.0], t_end=2.0)
    with pytest.raises(ns.ParameterError, match="mu3"):
        ns.sensitivity(run, wrt="mu3")
    with pytest.raises(ns.OptionError, match="Trajectory"):
        ns.sensitivity("run")  # type: ignore[arg-type]
    with pytest.raises(ns.PointError, match="cotangent"):
        ns.vjp(run, [1.0, 2.0, 3.0])
    with pytest.raises(ns.PointError, match=r"cotangent.*nan"):
        ns.vjp(run, [np.nan, 2.0])
    with pytest.raises(ns.ParameterError, match="wrt"):
        ns.sensitivity(run, wrt=3)  # type: ignore[arg-type]
    with pytest.raises(ns.DefinitionError):
        ns.gradient(run, ca.SX.sym("stranger"))
    assert ns.sensitivity(run, wrt="r").dx_dp.shape == (2, 1)


def test_numbers_of_names_avoid_names_that_are_given() -> None:
    stops = [ns.Stop(x - k, name=name) for k, name in enumerate(["a", "a", "a 2", "a", "b"])]
    system = ns.FilippovSystem([x, v], field=[v, -x], stops=stops)
    assert [name for name, _ in system.stops] == ["a", "a 3", "a 2", "a 4", "b"]


@pytest.mark.parametrize("kind", [ns.Stop, ns.Reset])
def test_events_of_one_name_across_kinds_have_their_own_derivatives(kind) -> None:
    """Each wall doubles as another event: v is .5 v behind the first and .45 v behind the second."""
    back = dict(direction=-1, name="w")
    other = ns.Stop(v + 9, **back) if kind is ns.Stop else ns.Reset(x + 1, [x, -0.9 * v], **back)
    walls = [ns.Impact(1 - x, restitution=0.5, name="w")]
    if kind is ns.Stop:
        walls.append(ns.Impact(x + 1, restitution=0.9, name="h0"))
    more = dict(stops=[other]) if kind is ns.Stop else dict(resets=[other])
    system = ns.FilippovSystem([x, v], field=[v, 0 * v], impacts=walls, **more)
    found = ns.sensitivity(ns.simulate(system, [0.1, 1.3], 4.0, tol=1e-13)).dx_dx0
    late = 4 - 0.9 / 1.3 - 2 / 0.65
    expected = [[0.45, 0.45 * late + 0.585 * (0.9 + 4) / 1.3**2], [0.0, 0.45]]
    assert np.abs(found - expected).max() < 1e-12
    again = pickle.loads(pickle.dumps(system))
    assert again == system and again.impacts == system.impacts


def test_the_order_in_which_two_surfaces_of_position_are_reached_makes_a_corner():
    """Case corner_product: the derivatives beside it differ by D (n_y/L_y - n_x/L_x)."""
    case = cases_of("cases/continuous_switching.json")["corner_product"]
    symbols = {s: ca.SX.sym(s) for s in (*case["system"]["states"], "l1", "l2")}
    names = ("states", "field", "surfaces", "multipliers")
    states, field, surfaces, multipliers = (
        [eval(text, {}, symbols) for text in case["system"][name]] for name in names
    )
    system = ns.FilippovSystem(states, field=field, surfaces=surfaces, multipliers=multipliers)
    before, after, off = 0.1, 0.2, 1e-9
    # in mode -- the accelerations are 2 and -3, and the speeds at the corner 2 and 3
    start = np.array(
        [-2 * before + before**2, 2 - 2 * before, -3 * before - 1.5 * before**2, 3 + 3 * before]
    )
    found = [
        ns.sensitivity(
            ns.simulate(system, start + sign * off * np.eye(4)[0], before + after)
        ).dx_dx0
        for sign in (1, -1)
    ]
    flow = lambda time: np.kron(np.eye(2), [[1.0, time], [0.0, 1.0]])
    jump = [float(value) for value in case["values"]["D"]]
    corner = np.outer(jump, [-1 / 2, 0, 1 / 3, 0])
    expected = flow(after) @ corner @ flow(before)
    np.testing.assert_allclose(found[0] - found[1], expected, atol=1e-6)
