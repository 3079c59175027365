"""Every function that integrates takes ``tol``, or ``rtol`` and ``atol``, and ``t_end`` by position."""

import inspect

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

X, V = ca.SX.sym("x"), ca.SX.sym("v")
BLOCK = ns.FilippovSystem([X, V], surface=V - 0.3, above=[V, -X - 0.4], below=[V, -X + 0.4])
LINE = ns.FilippovSystem([X], surface=X, above=[1], below=[-1])
RUNS = {
    "simulate": lambda **tol: ns.simulate(BLOCK, [1.0, 0.0], 9.0, **tol).x,
    "ensemble": lambda **tol: ns.ensemble(BLOCK, [[1.0, 0.0]], 9.0, **tol).x,
    "outcomes": lambda **tol: list(ns.outcomes(BLOCK, [[1.0, 0.0]], 9.0, **tol).mean.values()),
    "follow": lambda **tol: ns.flow.follow(BLOCK, [1.0, 0.0], 0.9, mode="-", **tol).x,
    "basins": lambda **tol: ns.basins(BLOCK, [[1.0, 0.1]], 99.0, **tol).attractors[0].points,
    "lyapunov_spectrum": lambda **tol: (
        ns.lyapunov_spectrum(BLOCK, [1.0, 0.0], 50.0, **tol).exponents
    ),
    "poincare": lambda **tol: ns.orbit.poincare(BLOCK, "h0", [1.0, 0.0], count=2, **tol).points,
    "funnel": lambda **tol: ns.orbit.funnel(LINE, [0.0], 2.0, samples=3, **tol)(1.5),
}


def functions():
    modules = (ns, ns.local, ns.flow, ns.orbit, ns.proofs, ns.plot)
    found = {f"{m.__name__}.{name}": getattr(m, name) for m in modules for name in m.__all__}
    return {name: f for name, f in found.items() if inspect.isfunction(f)}


def test_t_end_is_taken_by_position():
    found = {n: inspect.signature(f).parameters for n, f in functions().items()}
    verbs = {name: p["t_end"] for name, p in found.items() if "t_end" in p}
    assert len(verbs) >= 9
    assert [n for n, p in verbs.items() if p.kind is not p.POSITIONAL_OR_KEYWORD] == []


def test_what_takes_tol_and_integrates_takes_both():
    for name, function in functions().items():
        names = set(inspect.signature(function).parameters)
        if (name.rpartition(".")[2] in RUNS and "plot" not in name) or {"tol", "t_end"} <= names:
            assert {"tol", "rtol", "atol"} <= names, name


@pytest.mark.parametrize("name", RUNS)
def test_tol_is_both_and_each_can_be_given_apart(name):
    one, two = RUNS[name](tol=1e-7), RUNS[name](rtol=1e-7, atol=1e-7)
    assert np.array_equal(one, two)
    three, four = RUNS[name](tol=1e-7, atol=1e-5), RUNS[name](rtol=1e-7, atol=1e-5)
    assert np.array_equal(three, four)
    with pytest.raises(ns.OptionError, match="atol"):
        RUNS[name](atol=-1.0)
