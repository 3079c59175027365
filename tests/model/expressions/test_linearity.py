"""A field is affine with sines of the time added, exactly where its graph is built of nothing else."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.model.expressions.linearity import bent

X, V, T, P = (ca.SX.sym(name) for name in "xvtp")
STATES = ca.vertcat(X, V, T)

AFFINE = [
    ca.SX(3.0),
    P * P * X + ca.exp(P),
    2 * X - V / P + T,
    -X + P * ca.cos(P * T + 1) - 0.2 * ca.sin(3 * T),
    (X + ca.sin(T)) / 3 - (V - ca.cos(2 * (T - 1))),
    ca.sin(P) * X,
]
BENT = [
    X * V,
    X * T,
    T * T,
    ca.cos(T) * X,
    ca.cos(T) ** 2,
    ca.cos(T) * ca.sin(T),
    ca.sin(X),
    ca.sin(X + T),
    ca.sin(ca.sin(T)),
    ca.sin(T * T),
    ca.exp(T),
    ca.exp(-(((T - 5) / 1e-3) ** 2)),
    ca.tanh(T),
    1 / (2 + ca.cos(T)),
    ca.sqrt(T),
]


@pytest.mark.parametrize("expression", AFFINE, ids=str)
def test_affine_with_sines(expression: ca.SX) -> None:
    assert bent(expression, STATES, T) == [False]


@pytest.mark.parametrize("expression", BENT, ids=str)
def test_bent(expression: ca.SX) -> None:
    assert bent(expression, STATES, T) == [True]


def test_each_expression_has_its_own_answer_and_without_time_sines_are_bent() -> None:
    both = ca.vertcat(X + ca.cos(T), X * V, ca.cos(T))
    assert bent(both, STATES, T) == [False, True, False]
    assert bent(both, STATES) == [True, True, True]


@pytest.mark.parametrize("omega", [0.05, 1.0, 37.0])
def test_forced_linear_runs_keep_the_tolerance_though_no_step_is_checked(omega: float) -> None:
    """x'' + x = cos(omega t) and a stop that is reached between, against the closed form."""
    x = ca.SX.sym("x", 2)
    t = ca.SX.sym("t")
    end = 0.5 + 0.1 * ca.cos(3 * t)
    system = ns.FilippovSystem(
        x, field=ca.vertcat(x[1], -x[0] + ca.cos(omega * t)), time=t, stops=[ns.Stop(x[0] - end)]
    )
    tol = 1e-9
    run = ns.simulate(system, [0.0, 1.0], 3.0, tol=tol)
    solution = lambda s: (
        np.sin(s)
        + (s * np.sin(s) / 2 if omega == 1 else (np.cos(omega * s) - np.cos(s)) / (1 - omega**2))
    )
    assert run.status == ns.Status.STOPPED
    assert abs(solution(run.t[-1]) - 0.5 - 0.1 * np.cos(3 * run.t[-1])) < 100 * tol
    early = np.linspace(0, run.t[-1], 200)[:-1]
    assert np.all(solution(early) < 0.5 + 0.1 * np.cos(3 * early))
    np.testing.assert_allclose(run(early)[:, 0], solution(early), atol=100 * tol)
