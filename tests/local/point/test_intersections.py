"""Where surfaces meet, the admissible modes, the attraction of sliding and pseudo-equilibria are those of
closed forms, of difference quotients and of runs."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import nonsmooth as ns
from tests.drawing import at_most

x, y, z, a, b, c, p = (ca.SX.sym(s) for s in ("x", "y", "z", "a", "b", "c", "p"))


def plane(first, second):
    return ns.FilippovSystem([x, y], field=[first, second], multipliers=[a, b], surfaces=[x, y])


CASES = {
    "each for itself": (plane(-a, -b), ["ss"], "attracting", "pseudo-equilibrium"),
    "spiral": (plane(-a + 2 * b, -2 * a - b), ["ss"], "attracting", "pseudo-equilibrium"),
    "two genes": (plane(-x + b, -y - a), ["ss"], "spiralling in", "pseudo-equilibrium"),
    "two genes that grow": (plane(x + b, y - a), ["ss"], "spiralling out", "pseudo-equilibrium"),
    "twisting": (plane(y, -3 * a - b), ["ss"], "spiralling in", "pseudo-equilibrium"),
    "twisting the other way": (plane(-y, 3 * a - b), ["ss"], "spiralling in", "pseudo-equilibrium"),
    "twisting of the second": (plane(-3 * b - a, x), ["ss"], "spiralling in", "pseudo-equilibrium"),
    "twisting out": (plane(y, -3 * a + b), ["ss"], "spiralling out", "pseudo-equilibrium"),
    "no twisting": (plane(y, -3 * a), ["ss"], "not shown", "pseudo-equilibrium"),
    "a centre": (plane(b, -a), ["ss"], "not shown", "pseudo-equilibrium"),
    "pushed off one": (plane(3 - a, -b), ["+s"], "", "sliding"),
    "pushed off both": (plane(3 - a, -2 - b), ["+-"], "", "crossing"),
    "a switch": (
        plane(-a + 2 * b, -b + 2 * a),
        ["++", "--", "ss"],
        "unstable across",
        "intersection",
    ),
    "one repels": (plane(a, -b), ["+s", "-s", "ss"], "unstable across", "intersection"),
}


@pytest.mark.parametrize("name", CASES)
def test_modes_that_can_go_on_and_attraction(name):
    system, modes, attraction, kind = CASES[name]
    found = ns.local.intersection(system, [0.0, 0.0])
    assert sorted(m.mode for m in found.continuations) == sorted(modes) and found.complete
    assert found.attraction == attraction and found.surfaces == (0, 1)
    assert ns.classify(system, [0.0, 0.0]).kind == kind
    assert ("admissible modes: " + ", ".join(m.mode for m in found.continuations)) in str(found)


def test_a_search_finds_the_rest_of_twisting_stable():
    found = ns.find_pseudo_equilibrium(plane(y, -3 * a - b), [0.1, 0.2], mode="ss")
    assert found.stable and found.kind == "stable pseudo-node"


def test_a_point_on_another_surface_is_refused():
    with pytest.raises(ns.PointError, match=r"one on surface 1\. Give surface=1"):
        ns.classify(plane(y, -3 * a - b), [0.3, 0.0])
    assert ns.classify(plane(y, -3 * a - b), [0.3, 0.0], surface=1).label == "crossing down"


NOT_RUN = ("a centre", "twisting out")  # rest continues in both, and so do orbits that leave


@pytest.mark.parametrize("name", [n for n in CASES if len(CASES[n][1]) == 1 and n not in NOT_RUN])
def test_a_run_continues_in_the_only_mode(name):
    system, (mode,), attraction, _ = CASES[name]
    run = ns.simulate(system, [0.0, 0.0], 1.0)
    if attraction == "spiralling out":
        assert run.status is ns.Status.INTERSECTION
    else:
        assert run.itinerary == mode and run.status is ns.Status.REACHED_END


def test_everything_leaves_a_repelling_intersection():
    found = ns.local.intersection(plane(a, b), [0.0, 0.0])
    assert len(found.continuations) == 9 and found.attraction == "repelling"
    assert ns.classify(plane(a, b), [0.0, 0.0]).label == "repelling sliding"


def test_a_limit_of_the_modes_is_degenerate():
    found = ns.classify(plane(1 - a, -b), [0.0, 0.0])
    assert found.kind == "degenerate" and found.distance == 0.0
    assert ns.classify(plane(0.999 - a, -b), [0.0, 0.0]).label == "stable pseudo-node"
    assert ns.classify(plane(1.001 - a, -b), [0.0, 0.0]).label == "sliding on in +s"


rates = st.integers(-20, 20).map(lambda k: k / 10)
inward = st.integers(-20, -5).map(lambda k: k / 10)  # most of what is drawn attracts


@at_most(40)
@given(st.tuples(inward, rates, rates, inward), st.tuples(rates, rates))
def test_attraction_is_what_runs_beside_the_intersection_do(m, drift):
    """A piecewise constant field: runs from beside an attracting intersection end on it, in finite time."""
    system = plane(drift[0] + m[0] * a + m[1] * b, drift[1] + m[2] * a + m[3] * b)
    found = ns.local.intersection(system, [0.0, 0.0])
    assume(found.distance >= 0.05 and found.attraction == "attracting")
    for start in ([1.0, 0.5], [-0.3, 1.0], [-1.0, -0.2], [0.6, -1.0]):
        run = ns.simulate(system, start, 1e4, max_events=500)
        if run.status is ns.Status.ACCUMULATION:
            assert np.abs(run.x[-1]).max() < 1e-4
        else:
            assert run.itinerary.endswith("ss") and np.abs(run.x[-1]).max() < 1e-12


def curved(angle=0.4):
    """Two curved surfaces in space, the field bilinear in the multipliers."""
    cos, sin = np.cos(angle), np.sin(angle)
    field = [-2 * a + 0.5 * b - x * z, -b + z * a * b / 3 + 0.3, a - p * z + 0.4 * z * b]
    surfaces = [x - 0.2 * z**2, y + x**2 + 0.1 * z]
    turn = {x: cos * x + sin * y, y: -sin * x + cos * y}
    new, old = ca.vertcat(*turn.values()), ca.vertcat(x, y)
    moved = [ca.substitute(e, old, new) for e in (ca.vertcat(*field), ca.vertcat(*surfaces))]
    f = ca.vertsplit(moved[0])
    turned = [cos * f[0] - sin * f[1], sin * f[0] + cos * f[1], f[2]]
    return ns.FilippovSystem(
        [x, y, z],
        field=turned,
        multipliers=[a, b],
        surfaces=ca.vertsplit(moved[1]),
        parameters={p: 1.0},
    )


@pytest.mark.slow
def test_eigenvalues_along_an_intersection_are_those_of_the_sliding_flow():
    system = curved()
    found = ns.find_pseudo_equilibrium(system, [0.1, 0.1, 0.1], mode="ss")
    assert found.status == "real" and found.mode == "ss" and found.eigenvalues.size == 1
    run = ns.simulate(system, found.point, 5.0)
    assert run.itinerary == "ss" and np.abs(run.x[-1] - found.point).max() < 1e-9
    beside = found.point + 1e-4 * np.array([0.0, 0.0, 1.0])
    gone = [
        np.linalg.norm(ns.simulate(system, on(system, beside), t, tol=1e-13).x[-1] - found.point)
        for t in (1.0, 2.0)
    ]
    assert np.log(gone[1] / gone[0]) == pytest.approx(found.eigenvalues[0].real, abs=1e-3)
    assert found.stable and ns.classify(system, found.point).label == found.kind


def on(system, point):
    """Newton's steps to both surfaces."""
    for _ in range(5):
        h = np.array([system.evaluate(system.surface_function(i), point).item() for i in (0, 1)])
        slope = np.vstack(
            [
                np.ravel(system.evaluate(system.gradient(system.surface_function(i)), point))
                for i in (0, 1)
            ]
        )
        point = point - np.linalg.lstsq(slope, h, rcond=None)[0]
    return point


def test_a_pseudo_equilibrium_does_not_depend_on_the_coordinates():
    one, two = (
        ns.find_pseudo_equilibrium(curved(angle), [0.1, 0.1, 0.1], mode="ss")
        for angle in (0.0, 1.1)
    )
    np.testing.assert_allclose(one.multipliers, two.multipliers, atol=1e-12)
    np.testing.assert_allclose(one.eigenvalues, two.eigenvalues, atol=1e-12)
    assert one.kind == two.kind


def test_a_second_surface_far_away_changes_nothing():
    system = ns.FilippovSystem(
        [x, y, z],
        field=[-a + y / 2, z, -y - z / 2 + a / 3 - b],
        multipliers=[a, b],
        surfaces=[x, z + 5],
    )
    alone = ns.find_pseudo_equilibrium(system, [0.1, 0.1, 0.1])
    same = ns.classify(system, alone.point)
    assert alone.mode == "s+" and same.kind == "pseudo-equilibrium"
    assert alone.multipliers == pytest.approx(1 - 2 * alone.alpha)
    exact = np.roots([1, 1 / 2, 1 - 1 / 6])  # lambda = y/2: z' = -y - z/2 + y/6
    np.testing.assert_allclose(
        np.sort_complex(alone.eigenvalues), np.sort_complex(exact), atol=1e-12
    )


@pytest.mark.parametrize("count", [2, 5, 40])
def test_many_surfaces_that_slide_for_themselves(count):
    """A chain: the multipliers solve one linear system, and nothing is tried 3^k times."""
    states = ca.SX.sym("q", count)
    lam = ca.SX.sym("l", count)
    pull = np.linspace(-0.5, 0.5, count)
    field = [-2 * lam[i] + (lam[i - 1] if i else 0) / 2 + pull[i] for i in range(count)]
    system = ns.FilippovSystem(
        ca.vertsplit(states),
        field=field,
        multipliers=ca.vertsplit(lam),
        surfaces=ca.vertsplit(states),
    )
    found = ns.local.intersection(system, np.zeros(count))
    expected = [pull[0] / 2]
    for i in range(1, count):
        expected.append((pull[i] + expected[-1] / 2) / 2)
    np.testing.assert_allclose(found.sliding.multipliers, expected, atol=1e-13)
    assert found.attraction == "attracting" and len(found.continuations) == 1


def test_three_genes_in_a_loop_do_not_stay():
    """Eigenvalues of the layer: the cube roots of -1."""
    system = ns.FilippovSystem(
        [x, y, z], field=[-c - x, a - y, b - z], multipliers=[a, b, c], surfaces=[x, y, z]
    )
    found = ns.local.intersection(system, [0.0, 0.0, 0.0])
    layer = np.sort_complex(found.sliding.eigenvalues)
    np.testing.assert_allclose(layer, np.sort_complex(np.roots([1, 0, 0, 1])), atol=1e-12)
    rest = ns.find_pseudo_equilibrium(system, [0.1, -0.1, 0.2], mode="sss")
    assert rest.kind == "pseudo-focus, unstable across" and not rest.stable
    assert rest.region is ns.Region.MIXED


def test_wrong_questions_are_refused():
    system = plane(-a, -b)
    with pytest.raises(ns.PointError, match="surfaces meet"):
        ns.local.intersection(system, [1.0, 1.0])
    with pytest.raises(ns.PointError, match=r"point.*\[0, 1\]"):
        ns.local.intersection(system, [0.0, 1.0], surfaces=[0, 1])
    with pytest.raises(ns.PointError, match="independent gradients"):
        touching = ns.FilippovSystem(
            [x, y], field=[-a, -b], multipliers=[a, b], surfaces=[y, y - x**2]
        )
        ns.local.intersection(touching, [0.0, 0.0])
    with pytest.raises(ns.DefinitionError, match="mode 'sss'"):
        three = ns.FilippovSystem(
            [x, y], field=[-a, -b - c], multipliers=[a, b, c], surfaces=[x, y, x + y]
        )
        ns.find_pseudo_equilibrium(three, [0.0, 0.0], mode="sss")
    with pytest.raises(ns.DefinitionError, match="switching surface"):
        ns.local.intersection(ns.FilippovSystem([x], field=[-x]), [0.0])
    with pytest.raises(ns.PointError, match="multipliers"):
        singular = ns.FilippovSystem(
            [x, y, z], field=[-a - b, -a - b, -z], multipliers=[a, b], surfaces=[x, y]
        )
        ns.find_pseudo_equilibrium(singular, [0.0, 0.0, 0.0], mode="ss")
