"""Every result of ``local`` survives pickling and deep copies, and is read-only."""

import copy
import pickle

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, z, mu, lam, a, b = (ca.SX.sym(s) for s in ("x", "y", "z", "mu", "lam", "a", "b"))
SPACE = ns.FilippovSystem(
    [x, y, z], surface=x, above=[-y, 1, -2], below=[z, -1, 1 + mu * y], parameters={mu: 0.1}
)
PLANE = ns.FilippovSystem([x, y], surface=y, above=[x, y - 1 + x], below=[-2, 1 + x])
FOCUS = ns.FilippovSystem(
    [x, y], surface=y, above=[-x - y, x - y + mu], below=[1, 1], parameters={mu: 0.0}
)
HIDDEN = ns.FilippovSystem(
    [x, y], field=[(lam - 0.5) * (lam + 0.2), 1 - lam], multipliers=lam, surface=x, hidden=True
)
MEETING = ns.FilippovSystem([x, y], field=[-a - x, -b], multipliers=[a, b], surfaces=[x, y])
RESULTS = {
    "TwoFold": lambda: ns.find_two_fold(SPACE, [0.0, 0.1, -0.1]),
    "Fold": lambda: ns.find_fold(PLANE, [0.8, 0.1]),
    "Equilibrium": lambda: ns.find_equilibrium(PLANE, [0.1, 0.9]),
    "PseudoEquilibrium": lambda: ns.find_pseudo_equilibrium(
        ns.FilippovSystem([x, y], surface=y, above=[-x, -1], below=[-x, 1]), [0.3, 0.0]
    ),
    "BoundaryEquilibrium": lambda: ns.local.boundary_equilibrium(FOCUS, [0, 0]),
    "BoundaryBifurcation": lambda: ns.find_boundary_equilibrium(FOCUS, [0.1, 0.1], vary="mu"),
    "FoldFold": lambda: ns.local.fold_fold(
        ns.FilippovSystem([x, y], surface=y, above=[1, -x], below=[-1, -x]), [0, 0]
    ),
    "LocalObject": lambda: ns.classify(SPACE, [0.0, 0.0, 0.0]),
    "SlidingBranch": lambda: ns.local.sliding_branches(HIDDEN, [0.0, 0.0])[0],
    "Intersection": lambda: ns.local.intersection(MEETING, [0.0, 0.0]),
    "Continuation": lambda: ns.local.intersection(MEETING, [0.0, 0.0]).continuations[0],
    "Region": lambda: ns.region(PLANE, [0.5, 0.0]),
}


def numbers(thing):
    """The result with its arrays as lists and its system and chart left out, for comparison."""
    fields = {k: v for k, v in vars(thing).items() if k not in ("system", "chart")}
    plain = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in fields.items()}
    return {k: numbers(v) if k == "detail" and v is not None else v for k, v in plain.items()}


@pytest.mark.parametrize("kind", RESULTS)
@pytest.mark.parametrize(
    "copied", [lambda r: pickle.loads(pickle.dumps(r)), copy.deepcopy], ids=["pickle", "deepcopy"]
)
def test_a_copy_says_the_same(kind, copied):
    result = RESULTS[kind]()
    assert type(result).__name__ == kind
    if kind != "Region":
        assert getattr(ns.local, kind) is type(result)
    again = copied(result)
    assert str(again) == str(result) or kind == "SlidingBranch"
    assert repr(numbers(again)) == repr(numbers(result))  # as text: NaN equals NaN


def test_a_copied_two_fold_still_computes():
    fold = RESULTS["TwoFold"]()
    again = pickle.loads(pickle.dumps(fold))
    assert again.system is again.chart.where.system  # one system, not two
    at = [[0.02, 0.03], [-0.01, -0.02]]
    assert np.array_equal(again.point_at(at), fold.point_at(at))
    assert np.array_equal(again.reach_time(at), fold.reach_time(at), equal_nan=True)


@pytest.mark.parametrize("kind", ["TwoFold", "BoundaryBifurcation"])
def test_parameters_of_a_result_are_read_only_and_can_be_given_again(kind):
    result = RESULTS[kind]()
    with pytest.raises(TypeError):
        result.parameters["mu"] = 1.0
    assert dict(result.parameters) == {"mu": pytest.approx(0.1 if kind == "TwoFold" else 0.0)}
    system = SPACE if kind == "TwoFold" else FOCUS
    assert ns.classify(system, result.point, parameters=result.parameters).detail is not None
