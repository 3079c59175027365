"""Bifurcation diagrams show every solution and event where it is, stable and unstable ones apart."""

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import nonsmooth as ns

x, y, t, a, b = (ca.SX.sym(s) for s in ("x", "y", "t", "a", "b"))
BOX = [(-1, 1), (-1.5, 1)]
PULL = 0.2 * (y - 0.5) - x
BELT = ns.FilippovSystem([x, y], surface=y - 0.5, above=[y, PULL - 1], below=[y, PULL + 1])


@pytest.fixture(scope="module")
def takens():
    system = ns.FilippovSystem(
        [x, y],
        surface=y + 100,
        above=[y, a + b * x + x**2 - x * y],
        below=[1, 1],
        parameters={a: 0.1, b: -1.0},
    )
    return ns.continue_equilibrium(system, [0.11, 0], "a", bounds=(-0.5, 0.5))


@pytest.fixture(scope="module")
def relay():
    drive = a * ca.cos(t)
    system = ns.FilippovSystem(
        [x], surface=x, time=t, parameters={a: 2.5}, above=[drive - 1], below=[drive + 1]
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.5], 60))
    return ns.continue_orbit(orbit, "a", bounds=(1.6, 2.6))


def test_every_solution_is_on_a_line_and_every_event_on_a_marker(takens):
    ax = ns.plot.branch(takens).axes[0]
    lines = [line for line in ax.lines if not str(line.get_gid()).startswith("event")]
    drawn = {(float(u), float(v)) for line in lines for u, v in zip(*line.get_data(), strict=True)}
    expected = {(v, s.point[0]) for v, s in zip(takens.values, takens.solutions, strict=True)}
    assert expected < drawn
    assert_allclose([u - v + v**2 for u, v in drawn], 0.0, atol=1e-9)  # nothing between is made up
    for event in takens.events:
        (mark,) = [line for line in ax.lines if line.get_gid() == f"event {event.kind}"]
        assert_allclose([d[0] for d in mark.get_data()], [event.parameter, event.solution.point[0]])


def test_stable_and_unstable_solutions_differ_without_colour(takens):
    ax = ns.plot.branch(takens).axes[0]
    styles = {line.get_gid(): line.get_linestyle() for line in ax.lines}
    assert styles["stable equilibrium of +"] == "-"
    assert styles["unstable equilibrium of +"] == "--"


def test_a_line_changes_its_look_at_the_event_and_not_at_the_node_after_it(takens):
    ax = ns.plot.branch(takens).axes[0]
    lines = [line for line in ax.lines if not str(line.get_gid()).startswith("event")]
    ends = {float(v) for line in lines for v in line.get_xdata()[[0, -1]]}
    assert {event.kind for event in takens.events} == {"fold", "Hopf"}
    assert {float(event.parameter) for event in takens.events} <= ends


def test_a_line_has_no_corners_where_the_branch_is_smooth():
    system = ns.FilippovSystem(
        [x, y], surface=y, above=[a - x**2, 1 - y], below=[1, 1], parameters={a: 0.5}
    )
    fold = ns.continue_equilibrium(system, [0.7, 1.0], "a", bounds=(-1, 1))
    ax = ns.plot.branch(fold).axes[0]
    for line in ax.lines:
        if str(line.get_gid()).startswith("event"):
            continue
        points = np.column_stack(line.get_data())
        assert_allclose(points[:, 0], points[:, 1] ** 2, atol=1e-9)
        steps = np.diff(points / np.ptp(fold.values), axis=0)
        steps = steps[np.linalg.norm(steps, axis=1) > 0.008]
        turn = np.abs(np.diff(np.unwrap(np.arctan2(*steps.T[::-1]))))
        assert np.degrees(turn.max()) < 8.0


def test_orbits_are_drawn_by_their_largest_state_or_as_one_asks(relay):
    ax = ns.plot.branch(relay).axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("a", "max x")
    heights = np.concatenate([line.get_ydata() for line in ax.lines])
    assert heights.min() > 0.5
    periods = ns.plot.branch(relay, against="period").axes[0]
    assert_allclose(np.concatenate([line.get_ydata() for line in periods.lines]), 2 * np.pi)
    lengths = ns.plot.branch(relay, against=lambda orbit: len(orbit.legs)).axes[0]
    assert set(np.concatenate([line.get_ydata() for line in lengths.lines])) == {2, 4}


@pytest.mark.slow
def test_a_branch_from_hopf_to_homoclinic_is_drawn_to_its_ends():
    d, u = ca.SX.sym("d"), ca.SX.sym("u")
    r = ca.sqrt(x * x + y * y)
    above = [x * (1 - r) - y, y * (1 - r) + x]
    touching = ns.FilippovSystem(
        [x, y], surface=x + d, above=above, below=[0.4 - y, 1], parameters={d: 1.2}
    )
    orbit = ns.periodic_orbit(touching, ns.simulate(touching, [0.9, 0.0], 40.0))
    branch = ns.continue_orbit(orbit, "d", bounds=(0.8, 1.3))
    assert [event.kind for event in branch.events] == ["homoclinic", "grazing-sliding"]
    markers = [line for line in ns.plot.branch(branch).axes[0].lines if line.get_marker() == "*"]
    assert_allclose(markers[0].get_xdata(), branch.events[0].parameter)
    size = x * x + y * y
    small = ns.FilippovSystem(
        [x, y], field=[u * x - y - x * size, x + u * y - y * size], parameters={u: 0.3}
    )
    cycle = ns.periodic_orbit(small, ns.simulate(small, [0.5, 0.0], 60.0))
    branch = ns.continue_orbit(cycle, "u", bounds=(-0.5, 0.5))
    assert branch.events[0].kind == "Hopf" and np.all(np.isfinite(branch.values))
    ns.plot.branch(branch, against="x")
    assert not any("unstable" in orbit.stability for orbit in branch.orbits)


def test_curves_in_two_parameters_with_their_special_points(takens):
    curves = [ns.continue_bifurcation(e, ("a", "b"), bounds=BOX) for e in takens.events]
    ax = ns.plot.bifurcation_curves(curves).axes[0]
    for curve in curves:
        (line,) = [one for one in ax.lines if one.get_gid() == curve.kind]
        assert_allclose(np.column_stack(line.get_data()), curve.values)
    marks = [line for line in ax.lines if line.get_gid() == "Bogdanov-Takens"]
    assert marks and all(np.abs(m.get_data()).max() < 1e-9 for m in marks)
    assert {text.get_text() for text in ax.get_legend().get_texts()} == {"Hopf", "fold"}


@pytest.mark.slow
def test_an_orbit_has_its_modes_and_lies_over_a_portrait():
    orbit = ns.periodic_orbit(BELT, ns.simulate(BELT, [0.3, 0.4], 30))
    ax = ns.plot.periodic_orbit(orbit).axes[0]
    drawn = np.concatenate([np.column_stack(line.get_data()) for line in ax.lines[:2]])
    assert_allclose(drawn.max(axis=0), orbit.trajectory(np.linspace(0, 1, 2)).max(axis=0), atol=2)
    assert np.abs(drawn[:, 1].max() - 0.5) < 1e-9  # it sticks to the belt and slips below it
    words = [text.get_text() for text in ax.get_legend().get_texts()]
    assert words == ["mode \N{MINUS SIGN}", "mode s", "event", "surface"]
    under = ns.plot.phase_portrait(BELT, (-2, 2, -1, 1))
    assert ns.plot.periodic_orbit(orbit, ax=under.axes[0]) is under.axes[0]
    assert len(under.axes[0].get_legend().get_texts()) > 4  # of both


def test_multipliers_are_where_they_are_and_along_a_branch_coloured(relay):
    (crossing,) = [o for o in [relay[2.1]] if len(o.legs) == 2]
    ax = ns.plot.multipliers(crossing).axes[0]
    (points,) = [c for c in ax.collections if c.get_gid() == "multipliers"]
    assert_allclose(points.get_offsets()[:, 0], crossing.multipliers.real)
    assert len(ns.plot.multipliers(relay).axes) == 2  # with a colour bar


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda b: ns.plot.branch("branch"), ns.DefinitionError, "Branch"),
        (lambda b: ns.plot.branch(b, against="z"), ns.OptionError, "against"),
        (lambda b: ns.plot.branch([]), ns.DefinitionError, "Branch"),
        (lambda b: ns.plot.bifurcation_curves(b), ns.DefinitionError, "BifurcationCurve"),
        (lambda b: ns.plot.periodic_orbit(b), ns.DefinitionError, "PeriodicOrbit"),
        (lambda b: ns.plot.multipliers(b), ns.DefinitionError, "PeriodicOrbit"),
        (lambda b: ns.plot.branch(b, ax="axes"), ns.OptionError, "axes"),
    ],
)
def test_bad_input(takens, call, error, words):
    with pytest.raises(error, match=words):
        call(takens)


def test_structural_multipliers_are_named():
    orbit = ns.periodic_orbit(BELT, ns.simulate(BELT, [0.3, 0.4], 30))
    ax = ns.plot.multipliers(orbit).axes[0]
    names = [text.get_text() for part in ax.artists for text in part.get_children()]
    assert sorted(names) == ["of sliding", "of the flow"]
