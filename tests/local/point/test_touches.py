"""Surfaces on which nothing slides: touches, rest and boundary equilibria, and nothing that needs sliding."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import nonsmooth as ns
from nonsmooth.local import boundary_equilibrium, fold_fold
from nonsmooth.local.scans.box import Box
from nonsmooth.local.scans.plane_scan import PlaneScan
from nonsmooth.local.scans.surface_scan import SurfaceScan
from nonsmooth.local.searches.boundary_cycles import born_cycle
from tests.drawing import at_most
from tests.orbit.periodic_cases import cases_of

x, y, z, v, mu = (ca.SX.sym(s) for s in ("x", "y", "z", "v", "mu"))
CASES = cases_of("cases/continuous_switching.json").values()


def _sides(above, below, states=(x, v), surface=x, **more):
    return ns.FilippovSystem(states, surface=surface, above=above, below=below, **more)


STOP = _sides([v, 1.2 - x - 5 * (x - 1)], [v, 1.5 - x], surface=x - 1)
SPRING = _sides([v, 2 - 2 * x - 5 * (x - 1)], [v, 2 - 2 * x], surface=x - 1)


@pytest.mark.parametrize(
    ("system", "point", "kind", "label"),
    [
        (SPRING, [1.0, 0.3], "crossing", "crossing up"),
        (SPRING, [1.0, -0.3], "crossing", "crossing down"),
        (SPRING, [1.0, 0.0], "boundary equilibrium", "persistence"),
        (STOP, [1.0, 0.0], "touch", "from above"),
        (_sides([v, -2.0], [v, -1.0]), [0.0, 0.0], "touch", "from below"),
        (_sides([v, 1.0], [v, -1.0]), [0.0, 0.0], "rest", "visible on both sides"),
        (_sides([v, -2.0], [v, 1.0]), [0.0, 0.0], "rest", "neutral, invisible on both sides"),
        (
            _sides([v, -2.0, 1.0], [v, 1.0, 1.0], (x, v, z)),
            [0.0, 0.0, 0.0],
            "touch",
            "invisible on both sides",
        ),
        (_sides([v - x, -x], [v + x, -2 * x]), [0.0, 0.0], "boundary equilibrium", "persistence"),
        (_sides([v, -x], [v, 2 * x]), [0.0, 0.0], "boundary equilibrium", "nonsmooth fold"),
    ],
)
def test_points_of_such_surfaces(system, point, kind, label):
    found = ns.classify(system, point)
    assert (found.kind, found.label) == (kind, label)


@pytest.mark.parametrize(
    ("reset", "stability", "ratio"),
    [
        (ns.Reset(x, {v: 0.9 * v}), "stable", 0.81),
        (ns.Reset(2 * x, {v: 0.9 * v}, -1), "stable", 0.9),
        (ns.Reset(x, {v: -1.1 * v}), "unstable", 1.21),
        (ns.Reset(v, {v: 0.5 * v}), "neutral", None),
        (ns.Reset(x - 1, {v: 0.5 * v}), "neutral", None),
    ],
)
def test_rest_of_a_block_that_jumps_where_it_changes_corners(reset, stability, ratio):
    block = _sides([v, x - 1], [v, x + 1], resets=reset)
    found = ns.classify(block, [0.0, 0.0])
    assert (found.kind, found.label) == ("rest", f"{stability}, invisible on both sides")
    assert found.evidence.get("jumps") == (ratio and pytest.approx(ratio))


def test_what_needs_sliding_is_refused():
    soft = _sides([v, -x - z, z], [v, -x - z + x, z], (x, v, z))
    for verb in (ns.find_two_fold, ns.find_pseudo_equilibrium):
        with pytest.raises(ns.DefinitionError, match="continuous of order 1"):
            verb(soft, [0.0, 0.0, 0.0])
    with pytest.raises(ns.DefinitionError, match="continuous of order 1"):
        fold_fold(SPRING, [1.0, 0.0])
    for verb in (ns.find_fold, ns.local.fold):
        with pytest.raises(ns.DefinitionError, match="continuous of order 1"):
            verb(SPRING, [1.0, 0.0])
    force = _sides([v, -2.0, 1.0], [v, 1.0, 1.0], (x, v, z))
    for verb in (ns.find_two_fold, ns.find_pseudo_equilibrium, ns.find_fold):
        with pytest.raises(ns.DefinitionError, match="velocity continuous"):
            verb(force, [0.0, 0.0, 0.0])


@pytest.mark.parametrize("case", [c for c in CASES if c["id"].startswith("focus_focus")])
def test_cycles_of_reference(case):
    above, below = case["system"]["above"], case["system"]["below"]
    traces = tuple(float(f[0].split("*")[0]) for f in (above, below))
    found, true = born_cycle(traces, (1.0, 1.0)), case["values"]
    assert found.side == "+" and found.stable
    assert found.period == pytest.approx(float(true["period"]), rel=1e-13)
    assert found.multiplier == pytest.approx(float(true["multiplier"]), rel=1e-12)
    speeds = [-float(true["y_in_over_mu"]), float(true["y_out_over_mu"])]
    assert found.speeds == pytest.approx(speeds, rel=1e-11)


@pytest.mark.parametrize(("own", "other"), [(0.5, -2.0), (0.5, -2.0 - 1e-9), (1.9, -2.0)])
def test_a_cycle_beside_a_node_with_equal_eigenvalues(own, other):
    """One side is a degenerate node: a run from the surface closes after the period."""
    cycle = born_cycle((own, other), (1.0, 1.0))
    system = _sides([own * x - y, x - 1], [other * x - y, x - 1], (x, y))
    start = np.array([0.0, -cycle.speeds[0]])
    turn = ns.simulate(system, start, cycle.period, tol=1e-13)
    np.testing.assert_allclose(turn.x[-1], start, atol=1e-10 * np.abs(turn.x).max())
    assert cycle.side == "+" and cycle.stable


def test_a_cycle_that_is_not_resolved_is_none():
    assert born_cycle((1e-3, -1e3), (1.0, 1e7)) is None
    assert (
        born_cycle((2.0, -1.0), (1.0, 1.0)) is not None
    )  # round the stable focus, in reversed time


@at_most(25)
@given(st.integers(0, 10**6))
def test_a_cycle_is_one_of_the_linear_system_and_scales(seed):
    generator = np.random.default_rng(seed)
    own, other = generator.uniform(0.05, 1.5), generator.uniform(-6.0, -0.05)
    determinants = tuple(generator.uniform(0.6, 4.0, 2))
    if generator.integers(2):
        own, other = other, own
    cycle = born_cycle((own, other), determinants)
    assume(cycle is not None)
    k = 0 if cycle.side == "+" else 1
    height = 1e-3 if k == 0 else -1e-3
    push = determinants[k] * height
    system = _sides(
        [own * x - y, determinants[0] * x - push],
        [other * x - y, determinants[1] * x - push],
        (x, y),
    )
    start = np.array([0.0, -height * cycle.speeds[0]])
    turn = ns.simulate(system, start, cycle.period, tol=1e-13)
    assume(np.abs(turn.x).max() < 1e3)
    growth = max(1.0, cycle.multiplier)
    assert np.abs(turn.x[-1] - start).max() < 1e-10 * np.abs(turn.x).max() * growth
    inside = ns.simulate(system, start, 0.5 * cycle.durations[0]).x[-1, 0]
    outside = ns.simulate(system, start, cycle.period - 0.5 * cycle.durations[1]).x[-1, 0]
    assert inside * height > 0 > outside * height


def test_a_boundary_equilibrium_tells_its_cycle():
    system = _sides([0.5 * x - y, x], [-x - y, x], (x, y))
    found = ns.classify(system, [0.0, 0.0])
    assert found.detail.switching == "continuous" and found.detail.cycle.stable
    assert found.detail.cycle.period == pytest.approx(6.691476465262703, rel=1e-13)
    assert len(found.detail.other_eigenvalues) == 2
    calm = _sides([-0.5 * x - y, x], [-x - y, x], (x, y))
    assert ns.classify(calm, [0.0, 0.0]).detail.cycle is None


@at_most(15)
@given(st.integers(0, 10**6))
def test_persistence_and_folds_are_those_of_the_equilibria_that_are_found(seed):
    """Random continuous systems of three states: equilibria of both sides for a small shift."""
    generator = np.random.default_rng(seed)
    a, k, b = (generator.uniform(-1, 1, s) for s in ((3, 3), (3,), (3,)))
    other = a.copy()
    other[:, 0] += k
    states = ca.vertcat(x, y, z)
    fields = [ca.vertsplit(ca.mtimes(ca.DM(m), states) + mu * ca.DM(b)) for m in (a, other)]
    system = _sides(*fields, (x, y, z), parameters={mu: 0.0})
    found = boundary_equilibrium(system, [0.0, 0.0, 0.0])
    assert found.side == "" and found.switching == "continuous"
    for shift in (1e-3, -1e-3):
        heights = [np.linalg.solve(m, -b * shift)[0] for m in (a, other)]
        real = int(heights[0] > 0) + int(heights[1] < 0)
        assert real == 1 if found.unfolding == "persistence" else real in (0, 2)


@pytest.mark.parametrize(("preload", "unfolding"), [(1.0, "persistence"), (-1.0, "nonsmooth fold")])
def test_a_preload(preload, unfolding):
    system = _sides([v, mu - x - 0.2 * v], [v, mu - x - 0.2 * v + preload], parameters={mu: 0.0})
    found = boundary_equilibrium(system, [0.0, 0.0])
    assert (found.side, found.label, found.switching) == ("+", unfolding, "velocity continuous")
    assert found.numbers["s"] == pytest.approx(-preload)
    for value in (-0.5, -0.01):  # between the two equilibria it is at rest, stably, if it persists
        at = ns.classify(system, [0.0, 0.0], parameters={"mu": value})
        assert (at.kind == "rest") == (preload > 0)


def test_scans_find_no_folds_where_nothing_slides():
    """Friction beside them, of the same size, has what the scans find."""
    soft, rough = (
        _sides([v, 0.3 - x - force], [v, 0.3 - x + other], surface=h)
        for force, other, h in ((5 * (x - 0.1), 0.0, x - 0.1), (0.1, 0.1, v - 0.3))
    )
    for system, folds in ((soft, 0), (rough, 2)):
        scan = PlaneScan.of(system, {}, Box(-1, 1, -1, 1))
        assert len(scan.folds) == folds
        assert any(piece.kind == "attracting" for piece in scan.pieces) == (folds > 0)
        assert len(scan.pseudo_equilibria) == 0
    spring, belt = (
        _sides([v, z - x - force, -z], [v, z - x + other, -z], (x, v, z), h)
        for force, other, h in ((5 * x, 0.0, x), (0.1, 0.1, v - 0.3))
    )
    for system, folds in ((spring, 0), (belt, 2)):
        scan = SurfaceScan.of(system, {}, Box(-1, 1, -1, 1))
        assert len(scan.folds) == folds and not scan.two_folds
        assert set(np.unique(scan.regions)) == ({2, 3} if folds == 0 else {0, 2, 3})


@at_most(15)
@given(st.integers(0, 10**6))
def test_rest_between_two_forces_is_stable_as_runs_around_it_say(seed):
    generator = np.random.default_rng(seed)
    a1, a2 = generator.uniform(0.3, 2, 2)
    b1, b2, c1, c2, d1, d2 = generator.uniform(-1, 1, 6)
    system = _sides([v, -a1 + b1 * v + c1 * x + d1 * v * v], [v, a2 + b2 * v + c2 * x + d2 * v * v])
    found = ns.classify(system, [0.0, 0.0])
    assert found.kind == "rest"
    run = ns.simulate(system, [0.0, 1e-3], 20.0, tol=1e-13)
    first, second = [event.x[1] for event in run.events if event.kind == "crossing"][1:4:2]
    growth = found.evidence["growth"]
    assert (second - first) / first**2 == pytest.approx(2 / 3 * growth, rel=0.02, abs=0.01)
    word = "stable" if growth < 0 else "unstable"
    assert found.label == f"{word}, invisible on both sides"
