"""Equilibria and pseudo-equilibria on branches: every event at its closed-form value, both sides of it
as solutions found afresh."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, z, mu, a, b = (ca.SX.sym(s) for s in ("x", "y", "z", "mu", "a", "b"))


def planar(above, below, value=0.0, surface=y):
    return ns.FilippovSystem(
        [x, y], surface=surface, above=above, below=below, parameters={mu: value}
    )


def relays(field, value):
    """A relay on each axis."""
    given = {"surfaces": [x, y], "multipliers": [a, b], "parameters": {mu: value}}
    return ns.FilippovSystem([x, y], field=field, **given)


def named(branch):
    return [(event.kind, round(event.parameter, 10) + 0.0) for event in branch.events]


FOLDED = planar([mu - x**2, 1 - y], [1, 1], 0.5)


def folded():
    return ns.continue_equilibrium(FOLDED, [0.7, 1.0], "mu", bounds=(-1, 1))


def test_fold_of_equilibria():
    branch = folded()
    (event,) = branch.events
    assert event.kind == "fold" and abs(event.parameter) < 1e-13
    assert [e.kind for e in branch.at(0.25)] == ["saddle", "stable node"]
    assert [round(e.point[0], 12) for e in branch.at(0.25)] == [-0.5, 0.5]
    assert branch.ends == (ns.orbit.BranchEnd.REACHED_BOUND,) * 2


def test_hopf_point_and_not_a_neutral_saddle():
    """u = x - 1, v = y - 2: a focus whose trace is 2 mu; and a saddle whose trace vanishes."""
    u, v = x - 1, y - 2
    focus = planar([mu * u - 3 * v, 3 * u + mu * v], [1, 1], -0.4)
    (event,) = ns.continue_equilibrium(focus, [1, 2], "mu", bounds=(-1, 1)).events
    assert event.kind == "Hopf" and abs(event.parameter) < 1e-13
    assert abs(event.coefficients["frequency"] - 3) < 1e-12
    saddle = planar([(1 + mu) * u, -v], [1, 1], -0.4)
    assert ns.continue_equilibrium(saddle, [1, 2], "mu", bounds=(-0.9, 1)).events == ()


# Equilibrium (mu - 1) above the surface: eigenvalues of A; the other field is E.
FOCUS = ([[-1, -1], [1, -1]], 1.0)
SADDLE = ([[1, 0], [1, -2]], 2.0)


@pytest.mark.parametrize(("matrix", "pull"), [FOCUS, SADDLE])
def test_boundary_equilibrium_is_the_one_that_is_found_and_classified(matrix, pull):
    offset = ca.vertcat(x, y - (mu - 1))
    system = planar(ca.vertsplit(ca.DM(matrix) @ offset), [1, pull], 1.5)
    found = ns.find_boundary_equilibrium(system, [0, 0], vary="mu")
    local = ns.local.boundary_equilibrium(system, found.point, parameters=found.parameters)
    branch = ns.continue_equilibrium(system, [0, 0.5], "mu", bounds=(0.5, 2))
    (event,) = branch.events
    assert event.kind == "boundary equilibrium"
    assert abs(event.parameter - found.value) < 1e-13
    assert event.solution.label == local.label
    assert event.far_side.verdict.startswith(local.unfolding)
    # beyond it the pseudo-equilibria are those that a search finds
    pseudo = [s for s in branch.solutions if isinstance(s, ns.local.PseudoEquilibrium)]
    assert len(pseudo) > 3 and all(s.status == "real" for s in pseudo)
    persists = local.unfolding == "persistence"
    values = branch.values[[isinstance(s, ns.local.PseudoEquilibrium) for s in branch.solutions]]
    assert np.all(values < 1 + 1e-12) if persists else np.all(values > 1 - 1e-12)
    there = {"mu": 0.7 if persists else 1.3}
    again = ns.find_pseudo_equilibrium(system, pseudo[-1].point, parameters=there)
    (on_branch,) = [s for s in branch.at(there["mu"]) if isinstance(s, ns.local.PseudoEquilibrium)]
    assert np.abs(on_branch.point - again.point).max() < 1e-12


def test_from_a_pseudo_equilibrium_through_the_boundary_to_the_equilibrium():
    system = planar(ca.vertsplit(ca.DM(FOCUS[0]) @ ca.vertcat(x, y - (mu - 1))), [1, 1], 0.7)
    near = ns.find_pseudo_equilibrium(system, [0, 0]).point
    branch = ns.continue_equilibrium(system, near, "mu", bounds=(0.5, 2), side=None)
    assert [e.kind for e in branch.events] == ["boundary equilibrium"]
    assert isinstance(branch.solutions[-1], ns.local.Equilibrium)
    assert np.abs(branch[1.8].point - [0, 0.8]).max() < 1e-12
    halted = ns.continue_equilibrium(system, near, "mu", bounds=(0.5, 2), side=None, through=False)
    assert halted.ends == (ns.orbit.BranchEnd.REACHED_BOUND, ns.orbit.BranchEnd.EVENT)


def test_pseudo_saddle_node_in_three_dimensions_and_hopf_of_the_sliding_flow():
    """The sliding flow on z = 0 is given: (mu - x^2, -y), and a focus of trace 2 mu."""
    rows = ([mu - x**2, -y], [0.7, 0, 0]), ([mu * x - 2 * y, 2 * x + mu * y], [0, 0, 0])
    events = []
    for flow, near in rows:
        system = ns.FilippovSystem(
            [x, y, z], surface=z, above=[*flow, -1], below=[*flow, 1], parameters={mu: 0.5}
        )
        branch = ns.continue_equilibrium(system, near, "mu", bounds=(-1, 1), side=None)
        events += branch.events
    assert [event.kind for event in events] == ["pseudo-saddle-node", "Hopf"]
    assert abs(events[0].parameter) < 1e-12
    assert abs(events[1].coefficients["frequency"] - 2) < 1e-12


def test_a_pitchfork_is_a_branch_point():
    system = planar([x * (mu - x**2), 1 - y], [1, 1], -0.5)
    branch = ns.continue_equilibrium(system, [0, 1], "mu", bounds=(-1, 1))
    assert named(branch) == [("branch point", 0.0)]


def test_pseudo_equilibrium_through_a_two_fold_changes_from_repelling_to_attracting():
    """det(F1, F2) = 2 x + mu on y = 0, so x = -mu/2, L1 = -mu/2 = -L2 and alpha = 1/2."""
    system = planar([1, x], [-1, x + mu], -0.5)
    branch = ns.continue_equilibrium(system, [0.2, 0], "mu", bounds=(-1, 1), side=None)
    assert named(branch) == [("two-fold", 0.0)] and abs(branch.events[0].parameter) < 1e-12
    assert np.abs(branch[0.6].point - [-0.3, 0]).max() < 1e-13
    assert (branch[-0.6].region, branch[0.6].region) == (ns.Region.REPELLING, ns.Region.ATTRACTING)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (dict(bounds=(0.6, 1)), ns.OptionError, "bounds"),
        (dict(bounds=3), ns.OptionError, "bounds"),
        (dict(parameter="kappa"), ns.DefinitionError, "kappa"),
        (dict(step=-1), ns.OptionError, "step"),
        (dict(max_points=1), ns.OptionError, "max_points"),
        (dict(near=[1.0]), ns.PointError, "2"),
    ],
)
def test_bad_input(change, error, words):
    given = {"near": [0.7, 1.0], "parameter": "mu", "bounds": (-1, 1)} | change
    with pytest.raises(error, match=words):
        ns.continue_equilibrium(FOLDED, **given)


def test_a_value_that_the_branch_does_not_reach():
    branch = folded()
    with pytest.raises(ns.PointError, match="reaches"):
        branch.at(-0.5)
    assert "fold" in str(branch) and "fold" in repr(branch) and "fold" in repr(branch.events)


def test_a_smooth_system_has_equilibria_without_a_side():
    u, v = x - 1, y - 2
    smooth = ns.FilippovSystem(
        [x, y],
        field=[mu * u - 3 * v - u * (u**2 + v**2), 3 * u + mu * v - v * (u**2 + v**2)],
        parameters={mu: -0.4},
    )
    found = ns.find_equilibrium(smooth, [0.9, 2.1])
    assert np.abs(found.point - [1, 2]).max() < 1e-12
    assert (found.status, found.kind, found.mode) == ("real", "stable focus", "")
    assert str(found).startswith("stable focus at")
    branch = ns.continue_equilibrium(smooth, [0.9, 2.1], "mu", bounds=(-1, 1))
    (event,) = branch.events
    assert event.kind == "Hopf" and abs(event.parameter) < 1e-13
    cycle = ns.continue_orbit(event, "mu", bounds=(-1, 1))[0.25]
    assert cycle.period == pytest.approx(2 * np.pi / 3, rel=1e-12)  # r^2 = mu
    radius = np.hypot(*(cycle.start - [1, 2]))
    assert radius == pytest.approx(0.5, rel=1e-10)
    curve = ns.continue_equilibrium(smooth, [0.9, 2.1], "mu", bounds=(-1, 1), side="+")
    assert len(curve.events) == 1
    for options, words in (
        (dict(side="-"), r"\bside\b"),
        (dict(mode="+"), "surface"),
        (dict(surface=1), "surface"),
        (dict(side=None), "switching surface"),
    ):
        with pytest.raises((ns.OptionError, ns.DefinitionError), match=words):
            ns.continue_equilibrium(smooth, [0.9, 2.1], "mu", bounds=(-1, 1), **options)


def test_the_manifolds_of_a_smooth_saddle_are_followed():
    saddle = ns.FilippovSystem([x, y], field=[x, -y + x**2])
    found = ns.manifold(saddle, ns.find_equilibrium(saddle, [0.1, 0.1]), stable=False, length=1.0)
    for arc in found.arcs:
        assert np.abs(arc.points[:, 1] - arc.points[:, 0] ** 2 / 3).max() < 1e-9


def two_relays(value=1.5):
    """The equilibrium of ++ is at (mu, 2 - mu): on y = 0 at mu = 2, on x = 0 at mu = 0."""
    return relays([mu + 1 - a - x, 3 - mu - b - y], value)


def test_boundary_equilibria_on_either_of_two_surfaces():
    branch = ns.continue_equilibrium(two_relays(), [1.5, 0.5], "mu", bounds=(-0.5, 2.5))
    assert [event.kind for event in branch.events] == ["boundary equilibrium"] * 2
    values = [event.parameter for event in branch.events]
    np.testing.assert_allclose(values, [0.0, 2.0], rtol=0, atol=1e-12)
    modes = [s.mode for s in branch.solutions]
    assert modes[0] == "s+" and modes[-1] == "+s" and "++" in modes
    assert np.abs(branch[-0.25].point - [0, 2.25]).max() < 1e-12
    assert np.abs(branch[2.25].point - [2.25, 0]).max() < 1e-12
    other = ns.find_equilibrium(two_relays(2.25), [2.25, 0.5])
    assert other.status == "virtual" and other.h > 0  # beyond the second surface


def test_a_cycle_around_an_equilibrium_between_two_surfaces_has_its_mode():
    u, v = x - 1, y - 1
    growth = mu - u**2 - v**2
    system = relays([growth * u - 3 * v + (1 - a), 3 * u + growth * v + (1 - b)], -0.1)
    (event,) = ns.continue_equilibrium(system, [1, 1], "mu", bounds=(-0.2, 0.5)).events
    cycle = ns.continue_orbit(event, "mu", bounds=(-0.2, 0.5))[0.25]
    assert cycle.itinerary == "++" and cycle.period == pytest.approx(2 * np.pi / 3, rel=1e-12)


def test_a_pseudo_equilibrium_that_meets_another_surface_ends_there():
    """On x = 0 the sliding flow rests at y = mu while y > 0."""
    with_mode = dict(side=None, surface=0, mode="s+")
    system = relays([-a, mu - y - b + 1], 1.0)
    branch = ns.continue_equilibrium(system, [0.0, 1.0], "mu", bounds=(-0.5, 2), **with_mode)
    assert named(branch) == [("intersection", 0.0)] and abs(branch.events[0].parameter) < 1e-12
    assert branch.ends[0] is ns.orbit.BranchEnd.EVENT


def test_equilibria_of_a_continuous_field_go_on_or_meet_on_its_surface():
    """x' = mu - |x|: +mu and -mu meet at 0; with a spring of 4 beyond 1 the equilibrium continues as (mu + 3)/4."""
    v = y
    fold = ns.FilippovSystem.from_expression([x, v], [mu - ca.fabs(x), -v], parameters={mu: 0.5})
    branch = ns.continue_equilibrium(fold, [0.5, 0.0], "mu", bounds=(-1, 1))
    (event,) = branch.events
    assert abs(event.parameter) < 1e-12 and event.far_side.verdict.startswith("nonsmooth fold")
    assert event.solution.unfolding == "nonsmooth fold"
    np.testing.assert_allclose(sorted(e.point[0] for e in branch.at(0.7)), [-0.7, 0.7], atol=1e-12)
    force = mu - x - v - 3 * ca.fmax(x - 1, 0)
    stop = ns.FilippovSystem.from_expression([x, v], [v, force], parameters={mu: 0.5})
    branch = ns.continue_equilibrium(stop, [0.5, 0.0], "mu", bounds=(0, 5), side="-")
    (event,) = branch.events
    assert event.parameter == pytest.approx(1.0, abs=1e-12)
    assert event.far_side.verdict == "persistence: one continues the other"
    for value, at in ((0.3, 0.3), (4.0, 1.75)):
        (found,) = branch.at(value)
        assert found.point[0] == pytest.approx(at, abs=1e-12) and found.status == "real"


@pytest.mark.parametrize(("stiffness", "verdict"), [(3.0, "persistence"), (-3.0, "nonsmooth fold")])
def test_a_stop_with_a_damper_has_the_equilibria_of_its_springs(stiffness, verdict):
    """x = mu on one side and mu/stiffness on the other one; the damper, 1.2 x' beside 0.2 x', does not enter."""
    sides = [[y, mu - x - 0.2 * y], [y, mu - stiffness * x - 1.2 * y]]
    system = planar(*sides, 0.4, surface=x)
    branch = ns.continue_equilibrium(system, [0.4, 0], "mu", bounds=(-1, 1))
    (event,) = branch.events
    assert abs(event.parameter) < 1e-15 and verdict in event.far_side.verdict
    other = 0.3 if stiffness < 0 else -0.3
    found = sorted(float(one.point[0]) for one in branch.at(other))
    assert found == pytest.approx(
        sorted({0.3, other / stiffness} if other > 0 else {other / stiffness})
    )
    assert ns.classify(system, [0, 0], parameters={"mu": 0}).label == verdict


@pytest.mark.parametrize("force", [1.5, -1.5])
def test_equilibria_continue_with_rest_between_two_forces(force):
    """A force that jumps by 1.5 holds x = 0 against 0 < -mu < 1.5, or leaves it where it points away from there."""
    system = planar([y, mu - 2 * x - 0.3 * y], [y, mu - x - 0.1 * y + force], 0.4, surface=x)
    branch = ns.continue_equilibrium(system, [0.2, 0], "mu", bounds=(-3, 3))
    assert (
        named(branch)
        == sorted([("boundary equilibrium", -force), ("boundary equilibrium", 0.0)])[
            :: 1 if force > 0 else -1
        ]
    )
    word = "persistence" if force > 0 else "nonsmooth fold"
    assert all(word in event.far_side.verdict for event in branch.events)
    found = branch.at(-force / 2)
    (rest,) = (one for one in found if "rest" in one.kind)
    assert np.abs(rest.point).max() < 1e-15 and rest.alpha == pytest.approx(0.5)
    assert rest.stable == (force > 0) and "two-fold" not in str(rest)
    assert len(found) == (1 if force > 0 else 3)


@pytest.mark.parametrize(
    "sides",
    [
        ([y, mu - x - 0.2 * y], [y, mu - a * x - 1.2 * y]),  # a damper
        ([-y - 0.2 * x, x - mu], [-y - 0.2 * x, a * x - mu]),  # a spring
        ([y, mu - x - 0.2 * y], [y, mu - x - 0.2 * y + a]),  # a force
    ],
)
def test_a_boundary_equilibrium_changes_its_class(sides):
    system = ns.FilippovSystem(
        [x, y], surface=x, above=sides[0], below=sides[1], parameters={mu: 0.4, a: 1.0}
    )
    rest = ns.find_equilibrium(system, [0.4, 0.0]).point
    events = ns.continue_equilibrium(system, rest, "mu", bounds=(-3, 1)).events
    event = next(e for e in events if abs(e.parameter) < 1e-12)
    curve = ns.continue_bifurcation(event, ("mu", "a"), bounds=[(-3, 1), (-2, 2)])
    (point,) = curve.special
    assert point.kind == "persistence turns into nonsmooth fold"
    assert np.abs(point.values).max() < 1e-12
